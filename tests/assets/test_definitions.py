"""The code location: it loads, quickly and without a root, and says what the assets are."""

from __future__ import annotations

import subprocess
import sys
from datetime import timedelta

from dagster import AssetKey

from trace_dag.assets.definitions import build_definitions
from trace_dag.common.stage import Stage
from trace_dag.flow.workspace import Workspace

DEFINITIONS = build_definitions()
SPECS = {spec.key: spec for spec in DEFINITIONS.resolve_all_asset_specs()}


def test_the_graph_is_the_flow_and_what_is_made_of_all():
    made_of_all = {"warehouse", "benchmark"}
    flow = {key.to_user_string() for key, spec in SPECS.items() if spec.group_name != "studies"}
    assert flow == {*(stage.value for stage in Stage), *made_of_all}
    for stage in Stage:
        spec = SPECS[AssetKey(stage.value)]
        upstream = {dep.asset_key.to_user_string() for dep in spec.deps}
        assert all(Stage(name).position < stage.position for name in upstream)
        assert spec.partitions_def is not None
        assert spec.partitions_def.name == "crashes"
    assert SPECS[AssetKey("warehouse")].partitions_def is None


def test_every_asset_is_described_owned_and_grouped():
    for key, spec in SPECS.items():
        assert spec.description, key
        assert spec.owners, key
        assert spec.kinds, key
        assert spec.group_name != "default", key


def test_columns_of_tables_are_documented():
    for name in ("crash_record", "simulation_log"):
        schema = SPECS[AssetKey(name)].metadata["dagster/column_schema"]
        assert schema.columns
        assert all(column.description for column in schema.columns)


def test_jobs_and_checks_resolve():
    repository = DEFINITIONS.get_repository_def()
    names = {job.name for job in repository.get_all_jobs()}
    assert {name for name in names if not name.startswith("__")} == {"summary"}
    assert {key.name for key in repository.asset_graph.asset_check_keys} == {
        "no_failed_crashes",
        "everything_adds_up",
        "maps_pass_their_gates",
        "criteria_are_evaluated",
        "verified",
    }
    assert [schedule.name for schedule in repository.schedule_defs] == ["newly_released_cases"]


def test_the_warehouse_is_overdue_after_the_hours_that_the_settings_give(tmp_path):
    workspace = Workspace.open(str(tmp_path), overrides={"automation": {"fresh_within_h": 24}})
    specs = {spec.key.to_user_string(): spec for spec in build_definitions(workspace).resolve_all_asset_specs()}
    policy = specs["warehouse"].freshness_policy
    assert (policy.fail_window.to_timedelta(), policy.warn_window.to_timedelta()) == (
        timedelta(hours=24),
        timedelta(hours=18),
    )
    assert all(spec.freshness_policy is None for name, spec in specs.items() if name != "warehouse")


def test_loading_touches_no_root(tmp_path):
    subprocess.run([sys.executable, "-c", "import trace_dag.assets.definitions"], check=True, cwd=tmp_path)
    assert list(tmp_path.iterdir()) == []


def test_summary_follows_the_last_run_started_in_the_ui_and_no_other(campaign):
    from dagster import DagsterRunStatus, build_run_status_sensor_context

    from trace_dag.assets.automation import summary_after_runs
    from trace_dag.assets.definitions import build_definitions
    from trace_dag.assets.run_requests import PROCESS_TAG

    made = campaign({"2023-510010": ""})
    job = build_definitions(made.workspace).resolve_implicit_global_asset_job_def()
    selected = frozenset({AssetKey("verdict")})

    def request_after(tags: dict[str, str]) -> str:
        run = made.instance.create_run_for_job(
            job, tags=tags, status=DagsterRunStatus.SUCCESS, asset_selection=selected
        )
        event = made.instance.report_engine_event("done", run)
        context = build_run_status_sensor_context("summary_after_runs", event, made.instance, run)
        return type(summary_after_runs(context)).__name__

    assert request_after({}) == "RunRequest"
    assert request_after({PROCESS_TAG: "here:1:1"}) == "SkipReason"
    made.instance.create_run_for_job(
        job, status=DagsterRunStatus.STARTED, asset_selection=frozenset({AssetKey("verdict")})
    )
    assert request_after({}) == "SkipReason"
