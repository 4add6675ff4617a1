"""Backfills as the UI starts them: they repair what the command repairs, and the summary is made once."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path

import fake_flow
import pytest
from dagster import AssetKey, DagsterRun, build_run_status_sensor_context

from tests.assets.dagster_ui import DagsterUi, dagster_ui, launch_in_this_process
from trace_dag.assets.automation import summary_after_runs
from trace_dag.assets.batch import SUMMARY_TAG
from trace_dag.assets.launch import open_instance
from trace_dag.assets.studies import STUDIES
from trace_dag.common.stage import Stage
from trace_dag.flow.selection import select_again

KEYS = [f"2023-5100{number:02}" for number in range(1, 4)]
BROKEN = KEYS[1]
STAGES = {stage.value: KEYS for stage in Stage}
SUMMARY = {"warehouse", "benchmark"}
WHOLE_GRAPH = STAGES | dict.fromkeys(SUMMARY)


@pytest.fixture
def made(campaign, monkeypatch):
    """Crashes of which one fails at its road map, the first time."""
    monkeypatch.setenv("TRACE_DAG_EXECUTION__EXECUTOR", "in_process")
    made = campaign({key: "fail-once:road_map" if key == BROKEN else "" for key in KEYS})
    made.instance.dispose()
    launch_in_this_process(made.workspace.dagster_home)
    made.instance = open_instance(made.workspace)
    return made


@pytest.fixture
def ui(made, tmp_path) -> Iterator[DagsterUi]:
    with dagster_ui(made.instance, made.workspace.storage.root, tmp_path) as opened:
        yield opened


def asked_for_summary(made, run: DagsterRun) -> bool:
    """Whether the sensor that follows runs asks for the summary after this one."""
    event = made.instance.report_engine_event("done", run)
    context = build_run_status_sensor_context("summary_after_runs", event, made.instance, run)
    return type(summary_after_runs(context)).__name__ == "RunRequest"


def assets_of(run: DagsterRun) -> set[str]:
    return {key.to_user_string() for key in run.asset_selection or ()}


def test_a_backfill_executed_again_from_failure_computes_what_the_command_would(made, ui):
    first = ui.materialize(STAGES)
    by_command = {
        (stage.value, key)
        for key, start in select_again(made.workspace, failed=True).start.items()
        for stage in start.and_later()
    }
    assert by_command == {(stage.value, BROKEN) for stage in Stage.ROAD_MAP.and_later()}
    before = fake_flow.calls(Path(made.workspace.storage.root))
    again = ui.execute_again_from_failure(first)
    after = fake_flow.calls(Path(made.workspace.storage.root))
    assert {where for where in after if after[where] != before.get(where)} == by_command
    assert set(made.statuses().values()) == {"MATERIALIZED"}
    (run,) = ui.runs_of(again)
    assert asked_for_summary(made, run), "it runs no warehouse itself"


def test_the_page_of_a_backfill_counts_the_crashes_that_succeeded_and_that_failed(ui):
    first = ui.materialize(STAGES)
    before = {stage.value: (3, 0) for stage in Stage if stage not in Stage.ROAD_MAP.and_later()}
    assert ui.counts(first) == before | {stage.value: (2, 1) for stage in Stage.ROAD_MAP.and_later()}
    again = ui.execute_again_from_failure(first)
    assert ui.counts(again) == {stage.value: (1, 0) for stage in Stage.ROAD_MAP.and_later()}


def test_one_crash_can_be_materialized_alone(made, ui):
    ui.materialize({stage.value: KEYS[:1] for stage in Stage})
    assert {key for (_, key), status in made.statuses().items() if status == "MATERIALIZED"} == {KEYS[0]}
    assert {key for _, key in fake_flow.calls(Path(made.workspace.root))} == {KEYS[0]}


def test_current_crashes_are_named_and_can_be_forced(made, ui):
    one = {stage.value: KEYS[:1] for stage in Stage}
    ui.materialize(one)
    before = fake_flow.calls(Path(made.workspace.root))
    (run,) = ui.runs_of(ui.materialize(one))
    assert fake_flow.calls(Path(made.workspace.root)) == before
    assert run.tags[SUMMARY_TAG] == "Nothing was to do: 1 crash is up to date."
    assert any("force: [all]" in entry.user_message for entry in made.instance.all_logs(run.run_id))
    (shown,) = made.instance.fetch_materializations(AssetKey("verdict"), limit=1).records
    assert "force: [all]" in shown.asset_materialization.metadata["nothing to do"].value
    ui.materialize(one, config={"ops": {"crashes": {"config": {"force": ["verdict"]}}}})
    after = fake_flow.calls(Path(made.workspace.root))
    assert {where for where in after if after[where] != before[where]} == {("verdict", KEYS[0])}


def test_all_is_materialized_though_studies_lack_their_input(campaign, monkeypatch, tmp_path):
    monkeypatch.setenv("TRACE_DAG_EXECUTION__EXECUTOR", "in_process")
    made = campaign(dict.fromkeys(KEYS, "reject:crash_record"))
    launch_in_this_process(made.workspace.dagster_home)
    with open_instance(made.workspace) as instance, dagster_ui(instance, made.workspace.root, tmp_path) as ui:
        backfill = ui.materialize(WHOLE_GRAPH | dict.fromkeys(STUDIES))
        assert instance.get_backfill(backfill).status.value == "COMPLETED_SUCCESS"
        shown = {name: instance.get_latest_materialization_event(AssetKey(name)) for name in STUDIES}
    said = {name: event.asset_materialization.metadata["skipped"].value for name, event in shown.items() if event}
    assert said.keys() == STUDIES.keys()
    assert all(said.values())


def test_outputs_of_all_crashes_are_made_once(made, ui):
    first = ui.materialize(WHOLE_GRAPH)
    (failed,) = ui.runs_of(first)
    assert not assets_of(failed) & SUMMARY, "downstream of a failure"
    assert asked_for_summary(made, failed)
    stages, summary = ui.runs_of(ui.execute_again_from_failure(first))
    assert not assets_of(stages) & SUMMARY
    assert assets_of(summary) == SUMMARY
    assert not asked_for_summary(made, stages)
    assert not asked_for_summary(made, summary)
