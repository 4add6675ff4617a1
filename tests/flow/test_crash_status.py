"""Final states and the funnel, against a count by hand."""

from __future__ import annotations

from collections import Counter
from dataclasses import replace

from trace_dag.common.errors import Reason
from trace_dag.common.stage import Stage
from trace_dag.flow.batch import run_stages
from trace_dag.flow.crash_status import FinalState, crash_status, crash_statuses, funnel
from trace_dag.flow.records import read_records

BEHAVIOURS = {
    "2023-510010": "",
    "2023-510011": "",
    "2023-510012": "reject:crash_record",
    "2023-510013": "reject:road_map",
    "2023-510014": "reject:simulation_log",
    "2023-510015": "reject:verdict",
    "2023-510016": "fail:crash_record",
    "2023-510017": "fail:verdict",
}


def stand(workspace):
    return crash_statuses(read_records(workspace.storage, workspace.registry.keys()))


def test_every_crash_is_in_exactly_one_final_state(make_workspace):
    workspace = make_workspace(BEHAVIOURS)
    list(run_stages(workspace, [key for key in BEHAVIOURS if key != "2023-510011"], run_id="x"))
    crashes = stand(workspace)
    assert Counter(crash.final_state for crash in crashes.values()) == {
        FinalState.VERIFIED: 1,
        FinalState.REJECTED: 4,
        FinalState.FAILED: 2,
        FinalState.PENDING: 1,
    }
    assert crashes["2023-510013"].stage_reached is Stage.ROAD_MAP
    assert crashes["2023-510013"].reason is Reason.CRASH_OFF_ROAD
    assert crashes["2023-510016"].stage_reached is Stage.CRASH_RECORD
    assert crashes["2023-510011"].stage_reached is None
    assert [(step.step, step.crashes) for step in funnel(crashes.values())] == [
        ("registered", 8),
        ("complete", 5),
        ("mapped", 4),
        ("estimated", 4),
        ("collided", 3),
        ("accepted", 1),
        ("verified", 1),
    ]
    assert [step.published for step in funnel(crashes.values())] == [100, None, 65, None, None, 52, None]


def test_a_later_stage_built_on_something_replaced_does_not_count(make_workspace, tmp_path):
    workspace = make_workspace({"2023-510010": ""})
    list(run_stages(workspace, ["2023-510010"], run_id="x"))
    assert stand(workspace)["2023-510010"].final_state is FinalState.VERIFIED
    changed = make_workspace({"2023-510010": "now it says something else"})
    list(run_stages(changed, ["2023-510010"], [Stage.RAW_REPORT, Stage.CRASH_RECORD], run_id="y"))
    crash = stand(changed)["2023-510010"]
    assert (crash.final_state, crash.stage_reached) == (FinalState.PENDING, Stage.CRASH_RECORD)


def test_verified_crashes_of_registers_without_areas_of_impact_are_distinguished(make_workspace):
    workspace = make_workspace({"2023-510010": "", "2023-510011": "reject:verdict"})
    list(run_stages(workspace, ["2023-510010", "2023-510011"], run_id="x"))
    for key, records in read_records(workspace.storage, workspace.registry.keys()).items():
        read = records[Stage.CRASH_RECORD]
        found = []
        for areas in (True, False):
            told = replace(read, figures={**read.figures, "areas_of_impact": areas})
            found.append(crash_status(key, {**records, Stage.CRASH_RECORD: told}).without_areas)
        assert found == [False, key == "2023-510010"]
