"""Replays, negative controls and the comparison with a published benchmark, from the command line."""

from __future__ import annotations

import json
from pathlib import Path

import pytest
import sample_runs
from sample_runs import asked, study, trace_dag

VERIFIED = "SELECT key FROM verdicts WHERE label = 'verified' ORDER BY key"


@pytest.fixture(scope="module")
def root(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A root of their own: these commands write."""
    return sample_runs.copy_finished(tmp_path_factory.mktemp("judging") / "root")


@pytest.fixture(scope="module")
def verified(root: Path) -> list[str]:
    """Keys of the verified crashes."""
    return [row["key"] for row in asked(root, VERIFIED)]


@pytest.mark.parametrize(("image_format", "begins"), [("html", b"<!DOCTYPE html>"), ("webp", b"RIFF")])
def test_a_simulated_crash_can_be_watched(
    root: Path, verified: list[str], tmp_path: Path, image_format: str, begins: bytes
) -> None:
    target = tmp_path / f"crash.{image_format}"
    done = trace_dag(root, "replay", verified[0], "--output", str(target))
    assert done.returncode == 0, done.stderr
    assert target.read_bytes().startswith(begins)


@pytest.mark.parametrize(
    ("command", "said"),
    [
        (("replay", "2023-319003", "--output", "x.docx"), "name the file .html, .glb, .webp"),
        (("replay", "2023-319003", "--output", "nodir/x.html"), "there is no folder nodir"),
        (("sql", "FROM funnel", "--output", "nodir/x.csv"), "there is no folder nodir"),
        (("sql", "FROM funnel", "--format", "csv", "--output", "{root}/warehouse.duckdb"), "not written over"),
        (("export", "--output", "/dev/full/crash"), "output /dev/full/crash: cannot read and write there"),
    ],
)
def test_unwritable_outputs_are_named_before_the_work(root: Path, command: tuple[str, ...], said: str) -> None:
    done = trace_dag(root, *(word.format(root=root) for word in command))
    assert done.returncode == 2, done.stderr
    assert said in done.stderr
    assert "storage root /dev" not in done.stderr


def test_a_crash_that_was_not_simulated_has_no_replay(root: Path) -> None:
    rejected = asked(root, "SELECT key FROM crashes WHERE stage_reached = 'crash_record' LIMIT 1")[0]["key"]
    done = trace_dag(root, "replay", rejected)
    assert done.returncode == 2
    assert "was not simulated" in done.stderr
    assert "Traceback" not in done.stderr


def test_controls_enter_the_warehouse(root: Path, verified: list[str]) -> None:
    done = trace_dag(root, "controls")
    assert done.returncode == 0, done.stderr
    assert "another crash's report" in done.stdout
    rows = asked(
        root, "SELECT kind, count(*) AS n, avg(verified::INTEGER) AS rate FROM negative_controls GROUP BY kind"
    )
    found = {row["kind"]: row for row in rows}
    assert found["other_report"]["n"] == len(verified) * (len(verified) - 1)
    assert found["shifted"]["n"] == len(verified)
    assert found["true"]["n"] >= len(verified)
    assert found["shifted"]["rate"] in (0.0, None)
    assert found["other_report"]["rate"] < found["true"]["rate"]


def test_a_large_cohort_is_compared_in_a_sample_of_pairs(root: Path) -> None:
    drawn = []
    for _ in range(2):
        done = trace_dag(root, "controls", "--most", "2", "--json")
        assert done.returncode == 0, done.stderr
        rows = json.loads(done.stdout)
        own = {row["key"] for row in rows if row["kind"] == "true"}
        others = {(row["key"], row["other_key"]) for row in rows if row["kind"] == "other_report"}
        assert len(own) == 2
        assert {key for pair in others for key in pair} <= own
        drawn.append((own, others))
    assert drawn[0] == drawn[1]


def test_another_set_of_rules_can_judge_without_a_new_run(root: Path) -> None:
    accepted = "SELECT rule_set, count(*) FILTER (verified) AS n FROM negative_controls WHERE kind = {} GROUP BY 1"
    others = {}
    for rules in ("trace-dag", "strict"):
        assert trace_dag(root, "controls", "--rules", rules).returncode == 0
        ((own,), (other,)) = (asked(root, accepted.format(kind)) for kind in ("'true'", "'other_report'"))
        assert own["rule_set"] == rules
        others[rules] = own["n"], other["n"]
    # Reported speeds are driven, so that strict rules accept the same crashes, and fewer of others' reports.
    assert others["strict"][0] == others["trace-dag"][0] > 0
    assert others["strict"][1] < others["trace-dag"][1]


def test_controls_need_verdicts(tmp_path: Path) -> None:
    done = trace_dag(tmp_path, "controls")
    assert done.returncode == 2
    assert "no crash is registered" in done.stderr


def test_changed_reports_go_through_all_stages_again(root: Path, verified: list[str]) -> None:
    def stored() -> dict[str, bytes]:
        folders = (
            "raw_report",
            "crash_record",
            "osm_extract",
            "road_map",
            "state_estimate",
            "simulation_log",
            "verdict",
        )
        return {str(path): path.read_bytes() for folder in folders for path in (root / folder).iterdir()}

    before, kinds = stored(), ("nothing", "clocks_6h", "clocks_random", "names_made_up", "foreign_site", "moved_30m_n")
    asking = ("perturbed", "--only", *verified[:2], "--json", "--kinds")
    drawn = study(root, *asking, "clocks_random", "names_made_up", "--executor", "processes", "--workers", "2")
    assert drawn.returncode == 0, drawn.stderr
    done = study(root, *asking, *kinds)
    assert done.returncode == 0, done.stderr
    found = json.loads(done.stdout)
    rows = {(row["key"], row["perturbation"]): row for row in found}
    elsewhere = {(row["key"], row["perturbation"]): row for row in json.loads(drawn.stdout)}
    assert elsewhere == {name: rows[name] for name in elsewhere}, "what is drawn is the same in two processes"
    assert {kind for _, kind in elsewhere} == {"clocks_random", "names_made_up"}
    assert stored() == before
    for key in verified[:2]:
        same = rows[key, "nothing"]
        assert (same["final_state"], same["own_verified"], same["moved_m"]) == ("verified", True, 0.0)
        assert not rows[key, "clocks_6h"]["own_verified"]
        assert rows[key, "moved_30m_n"]["moved_m"] == pytest.approx(30.0, abs=0.01)
        assert rows[key, "foreign_site"]["other_key"] in set(verified) - {key}
    assert {row["final_state"] for row in found} <= {"verified", "first_event_only", "rejected"}
    (count,) = asked(root, "SELECT count(*) AS n FROM perturbed_controls")
    assert count["n"] == len(found)


def test_a_changed_report_that_states_too_little_is_refused(root: Path, verified: list[str]) -> None:
    kinds = ("blank", "tree_event_code", "type_single")
    done = study(root, "perturbed", "--only", *verified, "--json", "--kinds", *kinds)
    assert done.returncode == 0, done.stderr
    refused = [row for row in json.loads(done.stdout) if row["stage_reached"] == "crash_record"]
    assert {"2023-319003"} <= {row["key"] for row in refused}
    assert {(row["final_state"], row["verified"], row["own_verified"]) for row in refused} == {
        ("rejected", False, False)
    }


def test_an_unknown_perturbation_is_named(root: Path) -> None:
    done = study(root, "perturbed", "--kinds", "clock_5h")
    assert done.returncode == 2
    assert "clock_6h" in done.stderr
