"""Whole batches of fake crashes: outcomes, what is done again and what is not, interruptions."""

from __future__ import annotations

from collections import Counter
from dataclasses import replace
from pathlib import Path

import fake_flow
import pytest

from trace_dag.assets.specs import event_metadata
from trace_dag.common.provenance import Outcome, OutcomeRecord, artefact_name
from trace_dag.common.stage import Stage
from trace_dag.flow.batch import first_stale, run_stages
from trace_dag.flow.contract import CrashFiles
from trace_dag.flow.crash_store import picture_name
from trace_dag.flow.records import read_records, write_record
from trace_dag.flow.run_summary import RunSummary
from trace_dag.flow.tasks import Action, StageEvent
from trace_dag.flow.workspace import Workspace

GOOD, OTHER, THIRD = "2023-510001", "2023-510002", "2023-510003"


def run(workspace: Workspace, **options: object) -> dict[tuple[str, Stage], StageEvent]:
    events = list(run_stages(workspace, workspace.registry.keys(), run_id="test", **options))  # type: ignore[arg-type]
    by_crash_and_stage = {(event.key, event.stage): event for event in events}
    assert len(by_crash_and_stage) == len(events), "an event came twice"
    return by_crash_and_stage


def record_of(workspace: Workspace, key: str, stage: Stage) -> OutcomeRecord:
    return read_records(workspace.storage, [key])[key][stage]


def actions(events: dict[tuple[str, Stage], StageEvent], key: str) -> list[Action]:
    return [events[key, stage].action for stage in Stage if (key, stage) in events]


def test_accepted_crash_has_all_artefacts_and_records_that_list_them(make_workspace):
    workspace = make_workspace({GOOD: ""})
    events = run(workspace)
    assert actions(events, GOOD) == [Action.COMPUTED] * 7
    final = workspace.storage.read(f"verdict/{GOOD}.txt").decode()
    assert final.splitlines() == [f"through:{stage}" for stage in Stage]
    for stage in Stage:
        record = record_of(workspace, GOOD, stage)
        assert record.outcome is Outcome.ACCEPTED
        stored = workspace.storage.read(artefact_name(stage, GOOD, "txt"))
        assert [(file.name, file.size) for file in record.artefacts] == [(f"{stage}/{GOOD}.txt", len(stored))]
    assert workspace.storage.exists(f"pictures/{GOOD}.png")


def draws_one(crash: CrashFiles) -> dict[str, bytes]:
    if crash.key == GOOD:
        raise ZeroDivisionError("no scale")
    return fake_flow.picture(crash)


def test_a_picture_that_cannot_be_drawn_is_missed_by_nobody(make_workspace):
    workspace = make_workspace({GOOD: "", OTHER: ""})
    run(workspace)

    again = replace(workspace, flow=replace(fake_flow.FLOW, picture=f"{__name__}:draws_one"))
    events = run(again, force=[Stage.ROAD_MAP])
    assert actions(events, GOOD) == actions(events, OTHER)  # the crash goes on
    assert {where: event.no_picture for where, event in events.items() if event.no_picture} == {
        (GOOD, Stage.VERDICT): "ZeroDivisionError: no scale"
    }
    # The picture of what the crash was before is not shown as that of what it is.
    assert [workspace.storage.exists(picture_name(key)) for key in (GOOD, OTHER)] == [False, True]
    summary = RunSummary()
    for event in events.values():
        summary.note(event)
    assert f"pictures missing: 1 ({GOOD}: ZeroDivisionError: no scale)" in summary.in_words()
    assert event_metadata(events[GOOD, Stage.VERDICT], workspace.storage)["picture"] == (
        "could not be drawn: ZeroDivisionError: no scale"
    )


@pytest.mark.parametrize("stage", list(fake_flow.REASON_OF))
def test_rejection_ends_the_crash_there_and_later_stages_are_not_reached(make_workspace, stage):
    workspace = make_workspace({GOOD: f"reject:{stage}", OTHER: ""})
    events = run(workspace)
    expected = [Action.COMPUTED] * (stage.position + 1) + [Action.NOT_REACHED] * (6 - stage.position)
    assert actions(events, GOOD) == expected
    assert actions(events, OTHER) == [Action.COMPUTED] * 7
    for later in stage.and_later():
        record = events[GOOD, later].record
        assert record is not None
        assert (record.stage, record.outcome, record.reason) == (stage, Outcome.REJECTED, fake_flow.REASON_OF[stage])
        assert (record.measured, record.threshold) == (7.0, 5.0)
        assert not events[GOOD, later].failed


def test_a_negative_verdict_keeps_its_artefact(make_workspace):
    workspace = make_workspace({GOOD: "reject:verdict"})
    run(workspace)
    assert workspace.storage.exists(f"verdict/{GOOD}.txt")


@pytest.mark.parametrize("stage", list(Stage))
def test_failure_blocks_later_stages_of_that_crash_only(make_workspace, stage):
    workspace = make_workspace({GOOD: f"fail:{stage}", OTHER: "", THIRD: ""})
    events = run(workspace)
    failed = {where for where, event in events.items() if event.failed}
    assert failed == {(GOOD, later) for later in stage.and_later()}
    record = record_of(workspace, GOOD, stage)
    assert record.outcome is Outcome.FAILED
    assert "is broken" in record.detail
    assert "Traceback" in record.error


def test_second_run_computes_nothing(make_workspace, tmp_path: Path):
    workspace = make_workspace({GOOD: "", OTHER: "reject:road_map", THIRD: "reject:verdict"})
    run(workspace)
    before = fake_flow.calls(tmp_path / "root")
    assert first_stale(workspace, workspace.registry.keys()) == {}
    events = run(make_workspace())
    assert {event.action for event in events.values()} == {Action.UNCHANGED, Action.NOT_REACHED}
    assert fake_flow.calls(tmp_path / "root") == before


def test_changed_setting_recomputes_from_its_stage_on(make_workspace, tmp_path: Path):
    run(make_workspace({GOOD: "", OTHER: "reject:road_map"}))
    before = fake_flow.calls(tmp_path / "root")
    changed = make_workspace(sim={"friction": 0.4})
    assert first_stale(changed, [GOOD, OTHER]) == {GOOD: Stage.SIMULATION_LOG}
    run(changed)
    now = fake_flow.calls(tmp_path / "root")
    # The fake simulation makes the same bytes again, so the verdict, which does not depend on friction, stands.
    assert {where for where in now if now[where] != before.get(where)} == {("simulation_log", GOOD)}


def test_setting_that_only_states_how_a_service_is_reached_changes_nothing(make_workspace):
    run(make_workspace({GOOD: ""}))
    assert first_stale(make_workspace(sim={"carla_port": 2002}, states={"llm_timeout_s": 1.0}), [GOOD]) == {}


def test_settings_of_an_estimator_that_is_not_chosen_change_nothing(make_workspace):
    run(make_workspace({GOOD: ""}))
    other_model = {"llm_model": "openai/gpt-4.1", "llm_prompt": "coordinates-v1", "llm_max_attempts": 1}
    assert first_stale(make_workspace(states=other_model), [GOOD]) == {}
    assert first_stale(make_workspace(states={"estimator": "llm"}), [GOOD]) == {GOOD: Stage.STATE_ESTIMATE}


def test_settings_of_the_estimator_that_is_chosen_recompute_its_estimates(make_workspace):
    run(make_workspace({GOOD: ""}, states={"estimator": "llm"}))
    changed = make_workspace(states={"estimator": "llm", "llm_model": "openai/gpt-4.1"})
    assert first_stale(changed, [GOOD]) == {GOOD: Stage.STATE_ESTIMATE}


def test_failures_are_tried_again_and_rejections_are_kept(make_workspace, tmp_path: Path):
    workspace = make_workspace({GOOD: "fail-once:road_map", OTHER: "reject:road_map"})
    assert any(event.failed for event in run(workspace).values())
    assert first_stale(workspace, [GOOD, OTHER]) == {GOOD: Stage.ROAD_MAP}
    events = run(workspace)
    assert not any(event.failed for event in events.values())
    counts = fake_flow.calls(tmp_path / "root")
    assert counts["road_map", GOOD] == 2
    assert counts["road_map", OTHER] == 1
    assert counts["osm_extract", GOOD] == 1
    history = record_of(workspace, GOOD, Stage.ROAD_MAP).history
    assert [past.outcome for past in history] == [Outcome.FAILED]


def test_forced_stage_runs_again_and_unchanged_results_spare_the_rest(make_workspace, tmp_path: Path):
    workspace = make_workspace({GOOD: ""})
    run(workspace)
    run(workspace, force=[Stage.STATE_ESTIMATE])
    counts = fake_flow.calls(tmp_path / "root")
    assert [counts[stage, GOOD] for stage in Stage] == [1, 1, 1, 1, 2, 1, 1]


def test_changed_report_recomputes_the_crash(make_workspace, tmp_path: Path):
    run(make_workspace({GOOD: "", OTHER: ""}))
    workspace = make_workspace({GOOD: "something else", OTHER: ""})
    assert first_stale(workspace, [GOOD, OTHER]) == {GOOD: Stage.RAW_REPORT}
    events = run(workspace)
    assert actions(events, GOOD) == [Action.COMPUTED] * 7
    assert actions(events, OTHER) == [Action.UNCHANGED] * 7


def test_transient_failure_is_tried_again_within_the_run(make_workspace):
    workspace = make_workspace({GOOD: "flaky:osm_extract", OTHER: "flaky:road_map"}, execution={"transient_retries": 1})
    events = run(workspace)
    assert events[OTHER, Stage.ROAD_MAP].record.attempts == 2  # type: ignore[union-attr]
    assert not any(event.failed for event in events.values())


def test_subset_of_stages_runs_only_those(make_workspace, tmp_path: Path):
    workspace = make_workspace({GOOD: "", OTHER: "reject:crash_record", THIRD: "fail-once:crash_record"})
    run(workspace, stages=[Stage.RAW_REPORT, Stage.CRASH_RECORD])
    events = run(workspace, stages=[Stage.OSM_EXTRACT, Stage.ROAD_MAP])
    assert actions(events, GOOD) == [Action.COMPUTED] * 2
    assert actions(events, OTHER) == [Action.NOT_REACHED] * 2
    assert actions(events, THIRD) == [Action.BLOCKED] * 2
    assert {stage for stage, _ in fake_flow.calls(tmp_path / "root")} == set(list(Stage)[:4])


def test_lost_artefact_is_made_again(make_workspace):
    workspace = make_workspace({GOOD: ""})
    run(workspace)
    workspace.storage.delete(f"road_map/{GOOD}.txt")
    assert first_stale(workspace, [GOOD]) == {GOOD: Stage.ROAD_MAP}
    events = run(workspace)
    assert actions(events, GOOD) == [Action.UNCHANGED] * 3 + [Action.COMPUTED] + [Action.UNCHANGED] * 3


def test_artefact_damaged_without_changing_its_size_is_noticed_when_read(make_workspace):
    workspace = make_workspace({GOOD: ""})
    run(workspace)
    name = f"road_map/{GOOD}.txt"
    whole = workspace.storage.read(name)
    workspace.storage.write(name, b"X" * len(whole))
    run(workspace, force=[Stage.STATE_ESTIMATE])
    assert workspace.storage.read(name) == whole
    assert record_of(workspace, GOOD, Stage.VERDICT).outcome is Outcome.ACCEPTED


def test_damage_outside_the_selected_stages_fails_now_and_is_repaired_by_the_next_whole_run(make_workspace):
    workspace = make_workspace({GOOD: ""})
    run(workspace)
    name = f"road_map/{GOOD}.txt"
    workspace.storage.write(name, b"X" * len(workspace.storage.read(name)))
    only = [Stage.STATE_ESTIMATE]
    assert run(workspace, stages=only, force=only)[GOOD, Stage.STATE_ESTIMATE].failed
    assert first_stale(workspace, [GOOD]) == {GOOD: Stage.ROAD_MAP}
    assert not any(event.failed for event in run(workspace).values())


def test_interrupted_stage_is_run_again(make_workspace):
    """A record marked as started is what a kill between two artefacts leaves behind."""
    workspace = make_workspace({GOOD: ""})
    run(workspace)
    record = record_of(workspace, GOOD, Stage.SIMULATION_LOG)
    write_record(workspace.storage, replace(record, outcome=Outcome.STARTED))
    assert first_stale(workspace, [GOOD]) == {GOOD: Stage.SIMULATION_LOG}


def test_every_crash_and_stage_gets_exactly_one_event_in_stage_order(make_workspace):
    behaviours = {
        f"2023-5100{number:02d}": behaviour
        for number, behaviour in enumerate(
            ["", "reject:osm_extract", "fail:osm_extract", "reject:raw", "fail:verdict", "reject:verdict", ""] * 3,
            start=10,
        )
    }
    workspace = make_workspace(behaviours)
    events = list(run_stages(workspace, list(behaviours), run_id="test"))
    counts = Counter((event.key, event.stage) for event in events)
    assert set(counts.values()) == {1}
    assert len(counts) == len(behaviours) * 7
    for key in behaviours:
        assert [event.stage for event in events if event.key == key] == list(Stage)


def broken_grouping(crashes):
    raise RuntimeError("cannot tell what belongs together")


def test_grouping_that_breaks_does_not_keep_the_crashes_from_running(make_workspace):
    workspace = make_workspace({GOOD: "", OTHER: "fail:osm_extract"})
    extract = replace(fake_flow.FLOW.definition(Stage.OSM_EXTRACT), grouping=f"{__name__}:broken_grouping")
    stages = tuple(extract if each.stage is Stage.OSM_EXTRACT else each for each in fake_flow.FLOW.stages)
    events = run(replace(workspace, flow=replace(fake_flow.FLOW, stages=stages)))
    assert {key for (key, _), event in events.items() if event.failed} == {OTHER}
