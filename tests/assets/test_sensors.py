"""Reports that arrive in a watched folder, and crashes registered elsewhere: known to Dagster and run, each once."""

from __future__ import annotations

import os
import time
from pathlib import Path

import fake_flow
import pytest
from dagster import DagsterInstance, DagsterRun, DagsterRunStatus, RunRequest, SkipReason, build_sensor_context

from trace_dag.assets.automation import arriving_reports, registered_crashes
from trace_dag.assets.definitions import build_definitions
from trace_dag.assets.launch import open_instance
from trace_dag.assets.run_requests import keys_of, range_tags
from trace_dag.common.provenance import Outcome
from trace_dag.common.stage import Stage
from trace_dag.flow.batch import run_stages
from trace_dag.flow.cohorts.ingest import ingest
from trace_dag.flow.records import read_records
from trace_dag.flow.selection import PlannedBatch
from trace_dag.flow.workspace import Workspace

REPORTS = Path(__file__).resolve().parents[2] / "data" / "sample" / "reports"
CASES = ("319003", "319022", "319024")


class Watched:
    """A cohort that watches a folder, and the sensor's looks at it."""

    def __init__(self, folder: Path) -> None:
        self.inbox = folder / "inbox"
        self.inbox.mkdir()
        self.workspace = Workspace.open(str(folder / "root"), fake_flow.FLOW)
        self.workspace = self.workspace.with_settings({"execution": {"executor": "in_process"}})
        ingest(self.workspace.storage, "arriving", reports=[self.inbox], watch=True)
        self.instance = open_instance(self.workspace)
        self.cursor = ""
        self.said = ""

    def arrive(self, case: str, *, content: bytes | None = None, age_s: float = 60.0) -> None:
        path = self.inbox / f"{case}.xml"
        path.write_bytes((REPORTS / f"crash_{case}.xml").read_bytes() if content is None else content)
        os.utime(path, (time.time() - age_s,) * 2)

    def look(self) -> list[RunRequest]:
        with build_sensor_context(
            instance=self.instance, cursor=self.cursor, resources={"workspace": self.workspace}
        ) as context:
            result = arriving_reports(context)
        if isinstance(result, SkipReason):
            self.cursor = context.cursor or ""
            self.said = result.skip_message or ""
            return []
        self.cursor = result.cursor
        return list(result.run_requests)

    def partitions(self) -> list[str]:
        return list(self.instance.get_dynamic_partitions("crashes"))


@pytest.fixture
def watched(tmp_path, monkeypatch):
    for name in ("DAGSTER_HOME", "TRACE_DAG_ROOT"):
        monkeypatch.setenv(name, "to be replaced")
    made = Watched(tmp_path)
    yield made
    made.instance.dispose()


def test_arrivals_are_registered_and_run_once(watched):
    assert watched.look() == []
    watched.arrive(CASES[0])
    watched.arrive(CASES[1])
    (request,) = watched.look()
    assert watched.partitions() == watched.workspace.registry.keys("arriving") == [f"2023-{case}" for case in CASES[:2]]
    assert watched.look() == []

    job = build_definitions(watched.workspace).resolve_implicit_global_asset_job_def()
    config = {"ops": {"crashes": {"config": {"settings": {"execution": {"executor": "in_process"}}}}}}
    assert job.execute_in_process(run_config=config, instance=watched.instance, tags=request.tags).success
    records = read_records(watched.workspace.storage, watched.partitions())
    assert {each[Stage.VERDICT].outcome for each in records.values()} == {Outcome.ACCEPTED}

    watched.arrive(CASES[2])
    (request,) = watched.look()
    assert keys_of(request.tags, watched.partitions()) == [f"2023-{CASES[2]}"]


def test_a_report_that_changed_is_run_again(watched):
    watched.arrive(CASES[0])
    watched.look()
    before = watched.workspace.registry.sources([f"2023-{CASES[0]}"])[f"2023-{CASES[0]}"].report.sha256
    watched.arrive(CASES[0], content=(REPORTS / f"crash_{CASES[0]}.xml").read_bytes() + b"\n", age_s=30.0)
    assert len(watched.look()) == 1
    assert watched.workspace.registry.sources([f"2023-{CASES[0]}"])[f"2023-{CASES[0]}"].report.sha256 != before


def test_files_still_written_to_wait_for_the_next_look(watched):
    watched.arrive(CASES[0], age_s=0.0)
    assert watched.look() == []
    assert watched.partitions() == []
    watched.arrive(CASES[0], age_s=60.0)
    assert len(watched.look()) == 1


def test_invalid_reports_and_missing_folders_stop_nothing(watched):
    watched.arrive("notes", content=b"not a report")
    for _ in range(2):
        assert watched.look() == []
        assert "notes.xml: it is not XML" in watched.said, "named as long as it lies there"
    watched.arrive(CASES[0])
    assert len(watched.look()) == 1
    assert watched.look() == []
    assert "notes.xml: it is not XML" in watched.said
    for path in watched.inbox.iterdir():
        path.unlink()
    watched.inbox.rmdir()
    assert watched.look() == []
    assert watched.partitions() == [f"2023-{CASES[0]}"]


def test_without_a_watched_folder_it_states_how_to_get_one(tmp_path, monkeypatch):
    for name in ("DAGSTER_HOME", "TRACE_DAG_ROOT"):
        monkeypatch.setenv(name, "to be replaced")
    workspace = Workspace.open(str(tmp_path / "root"), fake_flow.FLOW)
    with (
        open_instance(workspace) as instance,
        build_sensor_context(instance=instance, resources={"workspace": workspace}) as context,
    ):
        result = arriving_reports(context)
    assert isinstance(result, SkipReason)
    assert "--watch" in str(result.skip_message)


class Elsewhere:
    """A root in which another machine registers crashes, and the looks of the sensor of a Dagster that has a database
    of its own."""

    def __init__(self, folder: Path) -> None:
        self.reports = folder / "reports"
        self.workspace = Workspace.open(str(folder / "root"), fake_flow.FLOW)
        self.instance = DagsterInstance.ephemeral()
        self.cursor = None

    def register(self, *keys: str) -> None:
        self.workspace.registry.register("elsewhere", fake_flow.write_reports(self.reports, dict.fromkeys(keys, "")))

    def look(self, *, run: bool) -> list[list[str]]:
        """The crashes of each run that is asked for."""
        settings = {"execution": {"executor": "in_process"}, "automation": {"run_registered": run}}
        self.workspace = self.workspace.with_settings(settings)
        with build_sensor_context(
            instance=self.instance, cursor=self.cursor, resources={"workspace": self.workspace}
        ) as context:
            result = registered_crashes(context)
        self.cursor = context.cursor if isinstance(result, SkipReason) else result.cursor
        requests = [] if isinstance(result, SkipReason) else result.run_requests
        return [list(keys_of(request.tags, self.partitions())) for request in requests]

    def partitions(self) -> list[str]:
        return list(self.instance.get_dynamic_partitions("crashes"))


@pytest.fixture
def elsewhere(tmp_path):
    made = Elsewhere(tmp_path)
    yield made
    made.instance.dispose()


FIRST, SECOND, THIRD = "2023-510010", "2023-510011", "2023-510012"


def test_dagster_learns_of_crashes_registered_elsewhere_and_runs_only_on_request(elsewhere):
    assert elsewhere.look(run=False) == []
    elsewhere.register(FIRST)
    assert elsewhere.look(run=False) == []
    assert elsewhere.partitions() == [FIRST]
    elsewhere.register(SECOND)
    assert elsewhere.look(run=False) == []
    assert elsewhere.partitions() == [FIRST, SECOND]


def test_registered_crashes_are_run_once_where_the_settings_say_so(elsewhere):
    elsewhere.register(FIRST, SECOND)
    assert elsewhere.look(run=True) == [[FIRST, SECOND]]
    assert elsewhere.look(run=True) == []
    list(run_stages(elsewhere.workspace, [FIRST, SECOND], run_id="x"))
    elsewhere.register(THIRD)
    assert elsewhere.look(run=True) == [[THIRD]]


def test_crashes_of_a_run_under_way_are_not_requested_again(elsewhere):
    elsewhere.register(FIRST, SECOND)
    elsewhere.look(run=False)
    tags = range_tags(PlannedBatch((FIRST, SECOND), tuple(Stage)))
    elsewhere.instance.add_run(DagsterRun("__ASSET_JOB", run_id="r", status=DagsterRunStatus.STARTED, tags=tags))
    elsewhere.register(THIRD)
    assert elsewhere.look(run=True) == [[THIRD]]


def test_a_run_of_one_crash_that_was_launched_in_the_ui_counts_as_under_way(elsewhere):
    elsewhere.register(FIRST)
    elsewhere.look(run=False)
    tags = {"dagster/partition": FIRST}  # as Dagster's UI marks a run of a single partition
    elsewhere.instance.add_run(DagsterRun("__ASSET_JOB", run_id="r", status=DagsterRunStatus.STARTED, tags=tags))
    elsewhere.register(SECOND)
    assert elsewhere.look(run=True) == [[SECOND]]


def test_nothing_but_a_listing_is_read_while_no_cohort_changes(elsewhere, monkeypatch):
    elsewhere.register(FIRST)
    elsewhere.look(run=True)
    monkeypatch.setattr(type(elsewhere.workspace.registry), "cohorts", lambda _: pytest.fail("cohorts were read"))
    assert elsewhere.look(run=True) == []
