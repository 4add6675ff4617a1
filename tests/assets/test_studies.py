"""Studies as assets: run from the UI, they enter the warehouse and show their tables."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path

import pytest
import sample_runs
from dagster import AssetKey, DagsterInstance, DagsterRunStatus, build_run_status_sensor_context, materialize

from tests.roads import judges
from trace_dag.assets.automation import summary_after_runs
from trace_dag.assets.definitions import build_definitions
from trace_dag.assets.studies import STUDIES
from trace_dag.flow.study_tables import FOLDER
from trace_dag.flow.workspace import Workspace

COHORT = "sample"


@pytest.fixture(scope="module")
def workspace(tmp_path_factory: pytest.TempPathFactory) -> Workspace:
    root = tmp_path_factory.mktemp("studies") / "root"
    return Workspace.open(str(sample_runs.copy_finished(root)), overrides={"execution": {"workers": 1}})


@pytest.fixture
def instance() -> Iterator[DagsterInstance]:
    with DagsterInstance.ephemeral() as made:
        yield made


def run(name: str, workspace: Workspace, instance: DagsterInstance, config: dict, *, fine: bool = True):
    result = materialize(
        [STUDIES[name]],
        instance=instance,
        resources={"workspace": workspace},
        run_config={"ops": {name: {"config": config}}},
        raise_on_error=False,
    )
    assert result.success is fine
    return result


@pytest.mark.parametrize(
    ("name", "config", "shown", "stored"),
    [
        ("traffic", {"cohort": COHORT}, "left out", "traffic/2023-319003.traffic.json"),
        ("controls", {"most": 2}, "another crash's report", f"{FOLDER}/controls-{COHORT}.json"),
        ("variations", {"count": 1, "cohort": COHORT}, "near misses", "variations/2023-319003.family.parquet"),
        ("evaluations", {"agents": ["brake"], "ego": ["striking"]}, "brake", "evaluations/brake.parquet"),
    ],
)
def test_a_study_is_stored_and_shown(
    workspace: Workspace,
    instance: DagsterInstance,
    monkeypatch: pytest.MonkeyPatch,
    name: str,
    config: dict,
    shown: str,
    stored: str,
) -> None:
    if name == "traffic":
        monkeypatch.setenv("SUMO_HOME", str(judges.sumo_home()))
    run(name, workspace, instance, config)
    event = instance.get_latest_materialization_event(AssetKey(name))
    assert event is not None
    assert event.asset_materialization is not None
    assert shown in event.asset_materialization.metadata["table"].value
    assert "](data:image/svg+xml," in event.asset_materialization.metadata["picture"].value
    assert workspace.storage.exists(stored)


@pytest.mark.parametrize(
    ("name", "config", "said"),
    [
        ("evaluations", {"variations": True, "courses": True}, "courses are of crashes, not of variations"),
        (
            "evaluations",
            {"agents": ["brake"], "ego": ["third"]},
            "'third': expected one of first, second, striking, struck",
        ),
        (
            "evaluations",
            {"agents": ["brake"], "traffic": "heavy"},
            "'heavy': expected one of recorded, reactive, persistent",
        ),
    ],
)
def test_impossible_requests_fail_the_run_in_a_line(
    workspace: Workspace, instance: DagsterInstance, name: str, config: dict, said: str
) -> None:
    result = run(name, workspace, instance, config, fine=False)
    (failure,) = [event for event in result.all_events if event.is_step_failure]
    assert failure.step_failure_data.user_failure_data.description.startswith(said)


def test_the_warehouse_follows_a_study(workspace: Workspace, instance: DagsterInstance) -> None:
    definitions = build_definitions(workspace)
    job = definitions.resolve_implicit_global_asset_job_def()
    made = instance.create_run_for_job(
        job, status=DagsterRunStatus.SUCCESS, asset_selection=frozenset({AssetKey("variations")})
    )
    event = instance.report_engine_event("done", made)
    context = build_run_status_sensor_context("summary_after_runs", event, instance, made)
    assert type(summary_after_runs(context)).__name__ == "RunRequest"


def test_every_study_is_beside_the_flow_and_its_options_are_described(workspace: Path) -> None:
    definitions = build_definitions()
    specs = {spec.key.to_user_string(): spec for spec in definitions.resolve_all_asset_specs()}
    assert {name for name, spec in specs.items() if spec.group_name == "studies"} == set(STUDIES)
    for name in STUDIES:
        assert specs[name].description
        assert specs[name].deps
