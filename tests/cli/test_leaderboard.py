"""Results of a part are written to a file, and entered elsewhere only if they can be of the crashes that are there."""

from __future__ import annotations

import json
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest
import sample_runs
from sample_runs import trace_dag

from trace_dag.common.storage.checksums import add_checksum, check_document

AGENT = "trace_dag.agents.evaluation.baselines:BrakeOnTimeToCollision"
NAME = "trace_dag.agents.evaluation.baselines.BrakeOnTimeToCollision"


@pytest.fixture(scope="module")
def elsewhere(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The results of an agent, evaluated in another root of the same crashes."""
    folder = tmp_path_factory.mktemp("elsewhere")
    root = sample_runs.copy_finished(folder / "root")
    file = folder / "results.json"
    done = trace_dag(root, "evaluate", "--agent", AGENT, "--split", "train", "--results", str(file))
    assert done.returncode == 0, done.stderr
    return file


@pytest.fixture(scope="module")
def here(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return sample_runs.copy_finished(tmp_path_factory.mktemp("here") / "root")


def changed(file: Path, target: Path, change: Callable[[dict[str, Any]], object]) -> Path:
    """The file with something changed, and the checksum made anew by whoever changed it."""
    document = check_document(file.read_bytes(), name="results")
    change(document)
    target.write_bytes(add_checksum(json.dumps(document).encode()))
    return target


def faster(document: dict[str, Any]) -> None:
    next(run for run in document["runs"] if run["collided"])["outcome"] = "conflict_avoided"


FORGED = {
    "outcome conflict_avoided, but its measures say": faster,
    "expected one run in the place of each": lambda document: document["runs"].pop(),
    "judged again since": lambda document: document["runs"][0].update(verdict_fingerprint="0" * 16),
    "measured by code": lambda document: document["runs"][0].update(code_version="0.0.1"),
    "the protocol has 150": lambda document: document["runs"][0].update(range_m=500.0),
    "in the crash itself": lambda document: document["runs"][0].update(recorded_delta_v_mps=99.0),
    "brake is the name of a baseline": lambda document: [run.update(agent="brake") for run in document["runs"]],
    "'my agent' cannot be the name": lambda document: [run.update(agent="my agent") for run in document["runs"]],
    "none of its crashes is among": lambda document: [run.update(key="2001-1") for run in document["runs"]],
    "did not write": lambda document: document["runs"][0].update(split=None),
    "not a file of results": lambda document: document.pop("split"),
    "has other columns": lambda document: document["runs"][0].pop("seed"),
    "is 'yes'; expected": lambda document: document["runs"][0].update(collided="yes"),
}


@pytest.mark.parametrize("why", FORGED)
def test_a_forged_or_stale_file_is_refused_with_a_line(why: str, elsewhere: Path, here: Path, tmp_path: Path) -> None:
    file = changed(elsewhere, tmp_path / "forged.json", FORGED[why])
    done = trace_dag(here, "leaderboard", "add", str(file))
    assert done.returncode == 2
    assert why in done.stderr
    assert len(done.stderr.strip().splitlines()) == 1
    assert not list((here / "evaluations").glob("*.parquet"))


def test_a_changed_file_and_one_that_is_none_are_refused(elsewhere: Path, here: Path, tmp_path: Path) -> None:
    for data, why in (
        (elsewhere.read_bytes().replace(b"true", b"false", 1), "has changed since it was written"),
        (b"[]", "has changed since it was written"),
    ):
        (tmp_path / "results.json").write_bytes(data)
        done = trace_dag(here, "leaderboard", "add", str(tmp_path / "results.json"))
        assert (done.returncode, why in done.stderr) == (2, True), done.stderr


def test_results_from_elsewhere_stand_on_the_leaderboard_once(elsewhere: Path, tmp_path: Path) -> None:
    root = sample_runs.copy_finished(tmp_path / "root")
    runs = json.loads(elsewhere.read_bytes())["runs"]
    done = trace_dag(root, "leaderboard", "add", str(elsewhere))
    assert done.returncode == 0, done.stderr
    assert f"{NAME}  {len(runs)} runs entered" in done.stdout
    rows = json.loads(trace_dag(root, "sql", "FROM leaderboard", "--format", "json").stdout)
    assert [row["agent"] for row in rows] == [NAME]
    assert NAME in (root / "benchmark" / "leaderboard.html").read_text()
    again = trace_dag(root, "leaderboard", "add", str(elsewhere))
    assert again.returncode == 2
    assert "already" in again.stderr


def test_a_part_is_handed_in_as_a_whole(here: Path) -> None:
    done = trace_dag(here, "evaluate", "--split", "train", "--only", "2023-319003")
    assert (done.returncode, "--split takes a part as a whole" in done.stderr) == (2, True)
    done = trace_dag(here, "evaluate", "--results", "results.json")
    assert (done.returncode, "--results needs --split" in done.stderr) == (2, True)
