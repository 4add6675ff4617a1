"""Families of crashes, and agents evaluated in them, from the command line: ``vary`` and ``evaluate``."""

from __future__ import annotations

import json
from pathlib import Path

import pytest
import sample_runs
from click.testing import CliRunner
from sample_runs import asked, trace_dag

from tests.roads import judges
from trace_dag.cli.main import cli

CRASHES = ("2023-319003", "2023-319022")
REJECTED = "2023-319061"
COUNT = 2


def vary(root: Path, *arguments: str, workers: int = 1) -> list[dict]:
    done = trace_dag(
        root, "vary", "--count", str(COUNT), "--only", *CRASHES, "--workers", str(workers), "--json", *arguments
    )
    assert done.returncode == 0, done.stderr
    return json.loads(done.stdout)


def evaluate(root: Path, *arguments: str) -> list[dict]:
    done = trace_dag(root, "evaluate", "--workers", "1", "--json", *arguments)
    assert done.returncode == 0, done.stderr
    return json.loads(done.stdout)


def files(folder: Path) -> dict[str, bytes]:
    return {path.name: path.read_bytes() for path in sorted(folder.iterdir())}


@pytest.fixture(scope="module")
def root(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A root of their own with a family of each crash: these commands write."""
    root = sample_runs.copy_finished(tmp_path_factory.mktemp("driving") / "root")
    packages = root.parent / "packages"
    assert [(each["key"], each["kept"]) for each in vary(root, "--output", str(packages))] == [
        (key, COUNT) for key in CRASHES
    ]
    return root


def test_variations_enter_the_warehouse_and_have_packages(root: Path) -> None:
    found = {row["variation_id"] for row in asked(root, "SELECT variation_id FROM variations")}
    assert found == {f"{key}-v{number:03}" for key in CRASHES for number in range(1, COUNT + 1)}
    assert set(files(root.parent / "packages")) == {f"{name}.zip" for name in found}


def test_the_same_families_whatever_the_number_of_workers(root: Path, tmp_path: Path) -> None:
    other = sample_runs.copy_finished(tmp_path / "root")
    vary(other, workers=2)
    assert files(other / "variations") == files(root / "variations")


def test_traffic_enters_the_warehouse_replays_and_packages_and_is_the_same_again(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    root = sample_runs.copy_finished(tmp_path / "root")
    monkeypatch.setenv("SUMO_HOME", str(judges.sumo_home()))
    asked_for = ["traffic", "--only", CRASHES[0], "--factor", "2", "--seed", "5", "--json"]
    done = trace_dag(root, *asked_for)
    assert done.returncode == 0, done.stderr
    (report,) = json.loads(done.stdout)
    assert report["vehicles"] > 0
    rows = asked(root, "SELECT DISTINCT factor, seed, vehicles FROM traffic")
    assert rows == [{"factor": 2.0, "seed": 5, "vehicles": report["vehicles"]}]
    page, packages = tmp_path / "replay.html", tmp_path / "packages"
    assert trace_dag(root, "replay", CRASHES[0], "--output", str(page)).returncode == 0
    assert '"traffic":[{"length"' in page.read_text()
    assert trace_dag(root, "export", "--only", CRASHES[0], "--output", str(packages)).returncode == 0
    made = files(root / "traffic")
    traffic = f"{CRASHES[0]}.traffic.json"
    assert (packages / CRASHES[0] / "traffic.json").read_bytes() == made[traffic]
    assert trace_dag(root, *asked_for).returncode == 0
    assert files(root / "traffic") == made
    assert trace_dag(root, "verify", "--contents").returncode == 0


def test_without_sumo_a_line_names_the_extra(root: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("PATH", "")
    monkeypatch.delenv("SUMO_HOME", raising=False)
    done = trace_dag(root, "traffic", "--only", CRASHES[0])
    assert done.returncode == 2
    assert "pip install 'trace-dag[sumo]'" in done.stderr.strip().splitlines()[-1]


def test_an_agent_takes_the_place_of_both_and_its_evaluations_enter_the_warehouse(root: Path) -> None:
    rows = evaluate(root, "--agent", "replay", "--only", CRASHES[0])
    # Whoever drives as recorded has the recorded crash.
    assert [(row["case_id"], row["vehicle_number"], row["outcome"]) for row in rows] == [
        (CRASHES[0], 1, "unchanged"),
        (CRASHES[0], 2, "unchanged"),
    ]
    stored = asked(root, f"SELECT outcome FROM evaluations WHERE agent = 'replay' AND case_id = '{CRASHES[0]}'")
    assert stored == [{"outcome": "unchanged"}] * 2
    assert asked(root, "SELECT unchanged FROM leaderboard WHERE agent = 'replay'") == [{"unchanged": 2}]


def test_agents_drive_in_the_variations_of_a_crash(root: Path) -> None:
    rows = evaluate(root, "--agent", "brake", "--ego", "first", "--variations", "--only", CRASHES[0])
    assert [(row["key"], row["case_id"]) for row in rows] == [
        (CRASHES[0], f"{CRASHES[0]}-v{number:03}") for number in range(1, COUNT + 1)
    ]


def test_an_agent_drives_in_the_likely_courses_of_a_crash(root: Path) -> None:
    """Whoever drives as recorded has the crash of each course."""
    rows = evaluate(root, "--agent", "replay", "--ego", "first", "--courses", "--only", CRASHES[0])
    assert {row["outcome"] for row in rows} == {"unchanged"}
    assert sum(row["weight"] for row in rows) == pytest.approx(1.0)
    found = asked(root, "SELECT key, courses, avoided FROM agent_probabilities WHERE agent = 'replay'")
    assert found == [{"key": CRASHES[0], "courses": len(rows), "avoided": 0.0}]
    done = trace_dag(root, "evaluate", "--agent", "replay", "--ego", "first", "--courses", "--only", CRASHES[0])
    assert [line.split()[:2] for line in done.stdout.splitlines()[2:]] == [["replay", "all"], ["replay", CRASHES[0]]]
    assert "As probabilities" in (root / "benchmark/leaderboard.html").read_text()


@pytest.mark.parametrize("options", [["--variations"], ["--courses"]])
def test_persistent_traffic_meets_who_is_slow_in_every_case_and_its_replay(
    root: Path, tmp_path: Path, options: list[str]
) -> None:
    asked_for = ["--agent", "replay?pace=0.7", "--traffic", "persistent", "--ego", "first"]
    rows = evaluate(root, *asked_for, *options, "--only", CRASHES[0])
    assert {row["collided"] for row in rows if row["recorded_delta_v_mps"]} == {True}
    page = tmp_path / "replay.html"
    case_id = rows[0]["case_id"]
    assert trace_dag(root, "replay", case_id, *asked_for, "--output", str(page)).returncode == 0
    assert f"{rows[0]['outcome']}, delta-v" in page.read_text()
    assert f", in {case_id}" in page.read_text()


def test_an_agent_that_was_only_tried_leaves_tables_and_site(tmp_path: Path) -> None:
    root = sample_runs.copy_finished(tmp_path / "root")
    evaluate(root, "--agent", "replay", "brake", "--ego", "first", "--only", CRASHES[0])
    assert trace_dag(root, "evaluate", "--remove", "brake").stdout.startswith("1 evaluations of brake removed")
    assert asked(root, "SELECT agent FROM leaderboard") == [{"agent": "replay"}]
    assert trace_dag(root, "evaluate", "--remove", "replay").returncode == 0
    assert "leaderboard.html" not in (root / "benchmark/index.html").read_text()
    assert trace_dag(root, "verify").returncode == 0


def test_results_for_people_are_by_class_of_crash(root: Path) -> None:
    done = trace_dag(root, "evaluate", "--agent", "replay", "--ego", "first", "--only", CRASHES[0], "--workers", "1")
    assert done.returncode == 0, done.stderr
    classes = [line.split()[:2] for line in done.stdout.splitlines()[2:]]
    assert classes == [["replay", "all"], ["replay", "initiator"], ["replay", "angle"]]


@pytest.mark.parametrize(
    ("bound", "value", "taken"),
    [
        ("--speed", "nan", "0<=x<1"),
        ("--speed", "1.0", "0<=x<1"),
        ("--friction", "0.0", "0<x<=1"),
        ("--timing", "-1.0", "0<=x<=60"),
    ],
)
def test_a_bound_that_cannot_be_is_named_with_what_can(bound: str, value: str, taken: str) -> None:
    done = CliRunner().invoke(cli, ["vary", bound, value])
    assert done.exit_code == 2
    assert f"'{bound}': {value} is not in the range {taken}." in done.output


@pytest.mark.parametrize(
    ("arguments", "said"),
    [
        (["evaluate", "--agent", "nobody"], "--agent nobody: expected brake"),
        (["evaluate", "--agent", "no_module:Agent"], "no module 'no_module'"),
        (["evaluate", "--agent", "replay", "json:Nope"], "--agent json:Nope: module json has no class Nope"),
        (["evaluate", "--agent", "json:JSONDecoder"], "it has no method reset and act"),
        (["evaluate", "--remove", "nobody"], "--remove nobody: no evaluations of it are stored"),
        (["evaluate", "--only", REJECTED], "is verified"),
        (["evaluate", "--only", "2023-510999"], "is not registered"),
        (["evaluate", "--variations"], "trace-dag vary makes them"),
        (["replay", f"{CRASHES[0]}-c99", "--agent", "brake"], f"{CRASHES[0]}-c99 is not among {CRASHES[0]}-c"),
        (["evaluate", "--courses", "--departures"], "--courses are of crashes between parties"),
        (["vary", "--cohort", "nowhere"], "cohort 'nowhere' is not registered"),
        (["vary", "--only", REJECTED], "is verified"),
    ],
)
def test_impossible_commands_give_one_line_and_exit_code_2(
    finished_root: Path, arguments: list[str], said: str
) -> None:
    done = trace_dag(finished_root, *arguments)
    assert (done.returncode, done.stderr.count("\n")) == (2, 1), done.stderr
    assert said in done.stderr
