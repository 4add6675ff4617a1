"""Thresholds and rules are the verdict's alone: other ones judge stored simulations again and simulate nothing."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import pytest
from sample_runs import SAMPLE, reports_of

from trace_dag.common.errors import Reason
from trace_dag.common.provenance import Outcome, OutcomeRecord
from trace_dag.common.stage import Stage
from trace_dag.common.storage.files import Storage
from trace_dag.flow.batch import run_stages
from trace_dag.flow.cohorts.ingest import ingest
from trace_dag.flow.records import read_records
from trace_dag.flow.stages import FLOW
from trace_dag.flow.tasks import Action
from trace_dag.flow.workspace import Workspace

KEY = "2023-319003"


@pytest.fixture(scope="module")
def root(tmp_path_factory: pytest.TempPathFactory) -> str:
    folder = tmp_path_factory.mktemp("rejudging")
    ingest(Storage(str(folder / "root")), "one", reports=[reports_of(folder / "reports", [KEY])], maps=[SAMPLE / "osm"])
    return str(folder / "root")


def judged(root: str, **verdict: Any) -> tuple[dict[Stage, Action], OutcomeRecord]:
    """What each stage did under some settings of the verdict, and the crash's verdict."""
    overrides = {"execution": {"executor": "in_process", "pictures": False}, "verdict": verdict}
    workspace = Workspace.open(root, FLOW, overrides)
    done = {event.stage: event.action for event in run_stages(workspace, [KEY], run_id="test")}
    return done, read_records(workspace.storage, [KEY])[KEY][Stage.VERDICT]


def test_other_thresholds_judge_again_and_simulate_nothing(root: str) -> None:
    done, as_reported = judged(root)
    assert set(done.values()) == {Action.COMPUTED}
    assert as_reported.outcome is Outcome.ACCEPTED
    simulation = Path(root, "simulation_log", f"{KEY}.parquet")
    simulated_at = simulation.stat().st_mtime_ns
    only_judged = dict.fromkeys(Stage, Action.UNCHANGED) | {Stage.VERDICT: Action.COMPUTED}

    done, strict = judged(root, max_contact_distance_m=1e-6)
    assert done == only_judged
    assert (strict.outcome, strict.reason) == (Outcome.REJECTED, Reason.WRONG_LOCATION)
    assert (strict.measured or 0.0) > (strict.threshold or 0.0) == 1e-6

    for rules in ("published", "strict"):
        done, other = judged(root, rule_set=rules)
        assert done == only_judged
        assert other.figures["rule_set"] == rules

    done, again = judged(root)
    assert done == only_judged
    assert again.outcome is Outcome.ACCEPTED
    assert simulation.stat().st_mtime_ns == simulated_at
