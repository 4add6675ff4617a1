"""A new attempt that fails leaves the earlier result standing, marked as outdated, as long as its inputs are there."""

from __future__ import annotations

from pathlib import Path

import fake_flow
import pytest

from trace_dag.common.provenance import Outcome
from trace_dag.common.stage import Stage
from trace_dag.common.storage.files import Storage
from trace_dag.flow.batch import first_stale, run_stages
from trace_dag.flow.crash_status import FinalState, crash_status
from trace_dag.flow.records import read_records
from trace_dag.flow.selection import select_again
from trace_dag.flow.tasks import Action
from trace_dag.flow.verify import verify_storage

KEY = "2023-510010"


def run(workspace, **options):
    return {event.stage: event for event in run_stages(workspace, [KEY], run_id=options.pop("run_id", "x"), **options)}


def records_of(workspace):
    return read_records(workspace.storage, [KEY])[KEY]


def files_of(workspace) -> dict[str, bytes]:
    """Everything stored of the crash but its outcome records."""
    root = Path(workspace.storage.root)
    found = (path for folder in (*Stage, "pictures") for path in (root / folder).glob("*"))
    return {str(path): path.read_bytes() for path in found if not path.name.endswith(".outcome.json")}


@pytest.mark.parametrize("stage", [Stage.OSM_EXTRACT, Stage.STATE_ESTIMATE, Stage.VERDICT])
def test_a_verified_crash_stays_verified_outdated_until_an_attempt_succeeds(make_workspace, stage):
    workspace = make_workspace({KEY: f"fail-second:{stage}"})
    run(workspace, run_id="first")
    files, verdict = files_of(workspace), records_of(workspace)[Stage.VERDICT].fingerprint

    events = run(workspace, run_id="second", force=[stage])
    assert events[stage].failed
    assert events[stage].record.detail == f"RuntimeError: {stage} is broken for {KEY}"
    assert {events[later].action for later in stage.and_later()[1:]} <= {Action.BLOCKED}
    assert files_of(workspace) == files
    record = records_of(workspace)[stage]
    assert (record.outcome, record.run_id, record.failed_attempt.run_id) == (Outcome.ACCEPTED, "first", "second")
    assert "is broken for" in record.failed_attempt.error
    status = crash_status(KEY, records_of(workspace))
    assert (status.final_state, status.stage_reached, status.outdated) == (FinalState.VERIFIED, Stage.VERDICT, stage)
    assert status.outdated_because == f"RuntimeError: {stage} is broken for {KEY}"
    assert records_of(workspace)[Stage.VERDICT].fingerprint == verdict
    assert verify_storage(workspace.storage, Path(workspace.storage.root), contents=True).disagreements == ()

    assert first_stale(workspace, [KEY]) == {KEY: stage}
    assert select_again(workspace, failed=True).start == {KEY: stage}
    assert not any(event.failed for event in run(workspace, run_id="third").values())
    mended = records_of(workspace)[stage]
    assert (mended.run_id, mended.failed_attempt) == ("third", None)
    assert [(past.run_id, past.outcome) for past in mended.history] == [
        ("first", Outcome.ACCEPTED),
        ("second", Outcome.FAILED),
    ]
    assert crash_status(KEY, records_of(workspace)).outdated is None


def test_a_rejection_stands_too(make_workspace):
    workspace = make_workspace({KEY: "reject:road_map\nfail-second:road_map"})
    run(workspace)
    run(workspace, force=[Stage.ROAD_MAP])
    status = crash_status(KEY, records_of(workspace))
    assert (status.final_state, status.stage_reached, status.outdated) == (
        FinalState.REJECTED,
        Stage.ROAD_MAP,
        Stage.ROAD_MAP,
    )


def test_a_result_of_other_inputs_does_not_stand(make_workspace):
    run(make_workspace({KEY: ""}))
    changed = make_workspace({KEY: "fail:state_estimate"})  # another report: every artefact before is another one
    run(changed)
    status = crash_status(KEY, records_of(changed))
    assert (status.final_state, status.stage_reached, status.outdated) == (
        FinalState.FAILED,
        Stage.STATE_ESTIMATE,
        None,
    )
    assert not (Path(changed.storage.root) / f"state_estimate/{KEY}.txt").exists()


def test_a_result_that_has_lost_a_file_does_not_stand(make_workspace):
    workspace = make_workspace({KEY: "fail-second:state_estimate"})
    run(workspace)
    workspace.storage.delete(f"state_estimate/{KEY}.txt")
    run(workspace)
    assert crash_status(KEY, records_of(workspace)).final_state is FinalState.FAILED


def test_a_result_whose_files_were_being_replaced_does_not_stand(make_workspace, monkeypatch):
    workspace = make_workspace({KEY: ""})
    run(workspace)
    real = Storage.write

    def write(self, name, data):
        if name == f"state_estimate/{KEY}.txt":
            raise OSError("no space left")
        return real(self, name, data)

    monkeypatch.setattr(Storage, "write", write)
    run(workspace, force=[Stage.STATE_ESTIMATE])
    monkeypatch.undo()
    assert crash_status(KEY, records_of(workspace)).final_state is FinalState.FAILED
    assert verify_storage(workspace.storage, Path(workspace.storage.root), contents=True).disagreements == ()


def test_a_worker_that_dies_in_a_new_attempt_costs_no_result(make_workspace):
    processes = {"executor": "processes", "workers": 2}
    workspace = make_workspace({KEY: "die-later:simulation_log"}, execution=processes)
    run(workspace, run_id="first")
    assert run(workspace, run_id="second", force=[Stage.SIMULATION_LOG])[Stage.SIMULATION_LOG].failed
    status = crash_status(KEY, records_of(workspace))
    assert (status.final_state, status.outdated) == (FinalState.VERIFIED, Stage.SIMULATION_LOG)
    assert "the worker process died" in status.outdated_because
    assert fake_flow.calls(Path(workspace.storage.root))["simulation_log", KEY] > 2
