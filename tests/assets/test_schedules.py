"""The schedule that follows the CrashAPI: what it released since is registered, given a partition, and run."""

from __future__ import annotations

from datetime import UTC, datetime

import pytest
from dagster import AssetKey, RunRequest, SkipReason, build_schedule_context
from fake_flow import ASKING
from public_services import NEBRASKA, NOT_RELEASED, VERIFIED, public_services

from trace_dag.assets.automation import schedules
from trace_dag.assets.definitions import build_definitions
from trace_dag.assets.launch import open_instance
from trace_dag.assets.run_requests import add_partitions, range_tags
from trace_dag.common.errors import UserError
from trace_dag.common.settings import AutomationSettings, Schedule
from trace_dag.common.stage import Stage
from trace_dag.crash.cohorts import CohortFilter
from trace_dag.flow.cohorts.choice import Choice
from trace_dag.flow.cohorts.ingest import ingest
from trace_dag.flow.cohorts.services import crash_api
from trace_dag.flow.records import read_records
from trace_dag.flow.selection import PlannedBatch
from trace_dag.flow.workspace import Workspace

CHOICE = Choice(CohortFilter(states=frozenset([NEBRASKA]), years=frozenset([2023]), min_vehicles=2, max_vehicles=2))


class Following:
    """A cohort that follows the service, and the schedule's looks at it."""

    def __init__(self, root: str, *, watch: bool = True) -> None:
        self.workspace = Workspace.open(root, ASKING)
        workspace = self.workspace
        client = crash_api(workspace.settings.services, workspace.storage)
        ingest(workspace.storage, "nebraska", crash_api=client, choice=CHOICE, watch=watch)
        self.instance = open_instance(self.workspace)
        add_partitions(self.instance, workspace.registry.keys())

    def look(self) -> list[RunRequest]:
        at = datetime(2026, 1, 5, 6, tzinfo=UTC)
        with build_schedule_context(self.instance, scheduled_execution_time=at) as context:
            (look,) = schedules(AutomationSettings())
            result = look(context, workspace=self.workspace)
        return [] if isinstance(result, SkipReason) else list(result)

    def run(self, requests: list[RunRequest]) -> None:
        job = build_definitions(self.workspace).resolve_implicit_global_asset_job_def()
        for request in requests:
            assert job.execute_in_process(
                run_config=request.run_config,
                instance=self.instance,
                tags=request.tags,
                asset_selection=[AssetKey(Stage.RAW_REPORT.value)],
            ).success

    def reasons(self) -> dict[str, str | None]:
        workspace = self.workspace
        records = read_records(workspace.storage, workspace.registry.keys())
        return {
            key: each[Stage.RAW_REPORT].reason and each[Stage.RAW_REPORT].reason.value
            for key, each in records.items()
            if each
        }


@pytest.fixture
def service(monkeypatch):
    for name in ("DAGSTER_HOME", "TRACE_DAG_ROOT"):
        monkeypatch.setenv(name, "to be replaced")
    monkeypatch.setenv("TRACE_DAG_EXECUTION__EXECUTOR", "in_process")
    with public_services() as made:
        for name, value in made.settings.items():
            text = f'["{value[0]}"]' if isinstance(value, tuple) else str(value)
            monkeypatch.setenv(f"TRACE_DAG_SERVICES__{name.upper()}", text)
        made.cases = (VERIFIED[0],)
        yield made


def test_cases_listed_since_are_registered_and_run_and_only_once(tmp_path, service):
    following = Following(str(tmp_path / "root"))
    assert following.look() == []
    service.cases = (VERIFIED[0], VERIFIED[1], NOT_RELEASED)
    requests = following.look()
    keys = [f"2023-{case}" for case in (VERIFIED[1], NOT_RELEASED)]
    assert following.workspace.registry.keys("nebraska") == sorted([f"2023-{VERIFIED[0]}", *keys])
    assert set(following.instance.get_dynamic_partitions("crashes")) >= set(keys)
    following.run(requests)
    assert following.reasons() == {keys[0]: None, keys[1]: "not_released"}
    following.instance.dispose()


def test_a_case_that_was_not_released_is_asked_for_until_it_is(tmp_path, service):
    key = f"2023-{VERIFIED[0]}"
    service.withheld = {VERIFIED[0]}
    following = Following(str(tmp_path / "root"))
    following.run([RunRequest(tags=range_tags(PlannedBatch((key,), (Stage.RAW_REPORT,))), run_config={})])
    assert following.reasons() == {key: "not_released"}
    following.run(following.look())
    assert following.reasons() == {key: "not_released"}
    service.withheld.clear()
    following.run(following.look())
    assert following.reasons() == {key: None}
    assert following.look() == []
    following.instance.dispose()


def test_cohorts_that_do_not_follow_the_service_are_left_alone(tmp_path, service):
    following = Following(str(tmp_path / "root"), watch=False)
    service.cases = VERIFIED
    assert following.look() == []
    assert following.workspace.registry.keys() == [f"2023-{VERIFIED[0]}"]
    following.instance.dispose()


def test_invalid_cron_hours_and_duplicate_names_are_reported():
    nightly = Schedule(name="nightly", cron="0 2 * * *")
    with pytest.raises(UserError, match="nightly is taken"):
        schedules(AutomationSettings(schedules=(nightly, nightly)))
    with pytest.raises(UserError, match="every night at two"):
        schedules(AutomationSettings(schedules=(Schedule(name="nightly", cron="at two"),)))
    with pytest.raises(ValueError, match="America/New_York"):
        Schedule(name="nightly", cron="0 2 * * *", timezone="Eastern")
