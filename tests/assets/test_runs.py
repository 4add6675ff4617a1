"""What Dagster shows after runs: exactly what broke is failed, the rest materialized, and re-runs repair just that."""

from __future__ import annotations

import subprocess
import sys
from collections import Counter
from dataclasses import replace
from pathlib import Path

import fake_flow
from dagster import AssetKey, DagsterRunStatus

from trace_dag.assets.batch import STEP_PROCESS_TAG
from trace_dag.assets.launch import open_instance
from trace_dag.assets.run_requests import PROCESS_TAG
from trace_dag.assets.specs import event_metadata
from trace_dag.common.errors import Reason
from trace_dag.common.stage import Stage
from trace_dag.flow.batch import run_stages
from trace_dag.flow.records import read_records
from trace_dag.flow.selection import select_again
from trace_dag.flow.tasks import Action, StageEvent

KEYS = [f"2023-5100{number}" for number in range(10, 16)]


def materializations(campaign, stage: Stage) -> list[tuple[str, dict[str, object]]]:
    """Crashes and metadata of all materializations of a stage."""
    records = campaign.instance.fetch_materializations(AssetKey(stage.value), limit=1000).records
    return [
        (record.partition_key, {name: value.value for name, value in record.asset_materialization.metadata.items()})
        for record in records
    ]


def counts(campaign) -> Counter[tuple[str, str]]:
    return Counter((stage.value, key) for stage in Stage for key, _ in materializations(campaign, stage))


def test_a_broken_stage_shows_as_failed_for_its_crashes_and_the_stages_after_and_a_rerun_repairs_just_those(campaign):
    broken = {KEYS[1]: "fail-once:road_map", KEYS[4]: "fail-once:road_map"}
    made = campaign({key: broken.get(key, "") for key in KEYS})
    report = made.run()
    assert len(report.errors) == 1
    assert report.errors[0].startswith("2 of 6 crashes failed")
    failed = {where for where, status in made.statuses().items() if status == "FAILED"}
    assert failed == {(stage, key) for key in broken for stage in Stage.ROAD_MAP.and_later()}
    assert {status for where, status in made.statuses().items() if where not in failed} == {"MATERIALIZED"}

    before = counts(made)
    assert made.run(select_again(made.workspace, failed=True)).errors == ()
    assert set(made.statuses().values()) == {"MATERIALIZED"}
    assert counts(made) - before == dict.fromkeys(failed, 1)


def test_rejected_crashes_are_materialized_everywhere_with_their_outcome(campaign):
    made = campaign({KEYS[0]: "reject:osm_extract"})
    assert made.run().errors == ()
    assert set(made.statuses().values()) == {"MATERIALIZED"}
    for stage in Stage.OSM_EXTRACT.and_later():
        ((_, metadata),) = materializations(made, stage)
        assert metadata["outcome"] == "rejected"
        assert metadata["reason"] == "no_map_coverage"
        assert metadata["stage_reached"] == "osm_extract"
        assert "7 m" in str(metadata["detail"])


def test_verdict_carries_its_sketch_inline_and_links_its_picture(campaign):
    made = campaign({KEYS[0]: ""})
    made.run()
    ((_, metadata),) = materializations(made, Stage.VERDICT)
    assert metadata["picture, served by trace-dag ui"] == f"/site/pictures/{KEYS[0]}.png"
    assert str(metadata["sketch"]).startswith(f"![{KEYS[0]} from above](data:image/png;base64,")
    assert Path(str(metadata["picture file"])).read_bytes().startswith(b"\x89PNG")


def test_verdict_of_every_crash_names_its_page_and_of_a_simulated_one_the_command_that_replays_it(campaign):
    made = campaign({KEYS[0]: "", KEYS[1]: "reject:road_map"})
    made.run()
    root = made.workspace.storage.root
    shown = dict(materializations(made, Stage.VERDICT))
    assert {key: metadata["page, served by trace-dag ui"] for key, metadata in shown.items()} == {
        key: f"/site/benchmark/crashes/{key}.html" for key in KEYS[:2]
    }
    assert shown[KEYS[0]]["page file"] == f"{root}/benchmark/crashes/{KEYS[0]}.html"
    assert shown[KEYS[0]]["replay"] == f"trace-dag --root {root} replay {KEYS[0]}"
    assert "replay" not in shown[KEYS[1]]


def test_an_estimate_names_its_estimator_inputs_cost_and_fallback(campaign):
    made = campaign({KEYS[0]: ""})
    made.run()
    ((_, metadata),) = materializations(made, Stage.STATE_ESTIMATE)
    shown = {name: metadata[name] for name in ("model", "cost_usd", "fallback")}
    assert shown == {"model": "none", "cost_usd": 0.0, "fallback": "none"}
    figures = {
        "estimator": "analytic",
        "model": "gemini/gemini-2.5-flash",
        "cost_usd": 0.002,
        "fallback_from": "llm",
        "fallback_reason": "no answer held",
    }
    record = replace(read_records(made.workspace.storage, KEYS[:1])[KEYS[0]][Stage.STATE_ESTIMATE], figures=figures)
    event = StageEvent(KEYS[0], Stage.STATE_ESTIMATE, Action.COMPUTED, record)
    shown = event_metadata(event, made.workspace.storage)
    assert shown["fallback"] == "analytic in place of llm: no answer held"
    assert (shown["estimator"], shown["model"], shown["cost_usd"]) == ("analytic", "gemini/gemini-2.5-flash", 0.002)


def test_nothing_is_run_when_nothing_changed_and_a_changed_setting_runs_from_its_stage_on(campaign):
    made = campaign(dict.fromkeys(KEYS, ""))
    made.run()
    assert made.run().runs == 0
    before = fake_flow.calls(Path(made.workspace.storage.root))
    changed = {"execution": {"executor": "in_process"}, "sim": {"friction": 0.3}}
    assert made.run(settings=changed).runs == 1
    (run,) = made.instance.get_runs(limit=1)
    assert {key.to_user_string() for key in run.asset_selection} == {"simulation_log", "verdict"}
    after = fake_flow.calls(Path(made.workspace.storage.root))
    assert {stage for stage, key in after if after[stage, key] != before[stage, key]} == {"simulation_log"}


def test_rejected_crashes_are_examined_again_only_when_asked_for(campaign):
    made = campaign({KEYS[0]: "reject:road_map", KEYS[1]: "reject:verdict", KEYS[2]: ""})
    made.run()
    before = fake_flow.calls(Path(made.workspace.storage.root))
    made.run(select_again(made.workspace, reason=Reason.CRASH_OFF_ROAD))
    after = fake_flow.calls(Path(made.workspace.storage.root))
    assert {where for where in after if after[where] != before.get(where)} == {("road_map", KEYS[0])}


def test_unreported_results_reach_dagster_without_being_done_again(campaign):
    made = campaign({KEYS[0]: "", KEYS[1]: ""})
    list(run_stages(made.workspace, KEYS[:2], run_id="killed before it could say so"))
    before = fake_flow.calls(Path(made.workspace.storage.root))
    assert set(made.statuses().values()) == {"MISSING"}
    assert made.run().runs == 1
    assert set(made.statuses().values()) == {"MATERIALIZED"}
    assert fake_flow.calls(Path(made.workspace.storage.root)) == before


def test_runs_of_dead_processes_are_closed(campaign):
    made = campaign({KEYS[0]: ""})
    made.run()
    (run,) = made.instance.get_runs()
    dead = subprocess.Popen([sys.executable, "-c", ""])
    dead.wait()
    host = run.tags[PROCESS_TAG].partition(":")[0]
    orphan = made.instance.create_run_for_job(
        made_job(made), tags={PROCESS_TAG: f"{host}:{dead.pid}:123"}, status=DagsterRunStatus.STARTED
    )
    launched = made.instance.create_run_for_job(  # by the daemon, which no command started
        made_job(made), tags={STEP_PROCESS_TAG: f"{host}:{dead.pid}:123"}, status=DagsterRunStatus.STARTED
    )
    assert run.tags[STEP_PROCESS_TAG] == run.tags[PROCESS_TAG], "the step says where it runs"
    with open_instance(made.workspace) as instance:
        assert instance.get_run_by_id(orphan.run_id).status is DagsterRunStatus.FAILURE
        assert instance.get_run_by_id(launched.run_id).status is DagsterRunStatus.FAILURE
        assert instance.get_run_by_id(run.run_id).status is DagsterRunStatus.SUCCESS


def made_job(made):
    from trace_dag.assets.definitions import build_definitions

    return build_definitions(made.workspace).resolve_implicit_global_asset_job_def()
