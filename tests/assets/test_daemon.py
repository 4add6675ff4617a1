"""What a sensor or a schedule starts by itself reaches the warehouse and the site: the daemon's own iterations."""

from __future__ import annotations

import os
import time
from collections.abc import Callable, Iterator
from contextlib import ExitStack
from datetime import datetime, timedelta
from pathlib import Path
from zoneinfo import ZoneInfo

import fake_flow
import pytest
from public_services import NEBRASKA, VERIFIED, public_services
from sample_runs import SAMPLE

from tests.assets.dagster_ui import DagsterUi, dagster_ui, launch_in_this_process
from trace_dag.assets.launch import open_instance
from trace_dag.crash.cohorts import CohortFilter
from trace_dag.flow.cohorts.choice import Choice
from trace_dag.flow.cohorts.ingest import ingest
from trace_dag.flow.cohorts.services import crash_api
from trace_dag.flow.workspace import Workspace
from trace_dag.warehouse.query import query

NEBRASKA_2023 = Choice(
    CohortFilter(states=frozenset([NEBRASKA]), years=frozenset([2023]), min_vehicles=2, max_vehicles=2)
)
MINUTE_S, DAY_S, WEEK_S = 60.0, 24 * 3600.0, 7 * 24 * 3600.0
OpenUi = Callable[[Workspace, str], DagsterUi]


@pytest.fixture
def open_ui(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Iterator[OpenUi]:
    """Opens the UI of a root; its runs are carried out in this process."""
    for name in ("DAGSTER_HOME", "TRACE_DAG_ROOT"):
        monkeypatch.setenv(name, "to be replaced")
    monkeypatch.setenv("TRACE_DAG_EXECUTION__EXECUTOR", "in_process")
    with ExitStack() as resources:

        def opened(workspace: Workspace, flow: str) -> DagsterUi:
            open_instance(workspace).dispose()
            launch_in_this_process(workspace.dagster_home)
            instance = resources.enter_context(open_instance(workspace))
            return resources.enter_context(dagster_ui(instance, workspace.root, tmp_path, flow))

        yield opened


def standing(workspace: Workspace) -> dict[str, str]:
    """Where the warehouse says crashes stand."""
    if not workspace.warehouse.exists():
        return {}
    return dict(query(workspace.warehouse, "SELECT key, final_state FROM crashes")[1])


def pages(workspace: Workspace) -> set[str]:
    return {path.stem for path in (Path(workspace.root) / "benchmark" / "crashes").glob("*.html")}


def test_reports_that_arrive_reach_the_warehouse_and_the_site(tmp_path, open_ui):
    inbox = tmp_path / "inbox"
    inbox.mkdir()
    workspace = Workspace.open(str(tmp_path / "root"))
    ingest(workspace.storage, "arriving", reports=[inbox], maps=[SAMPLE / "osm"], watch=True)
    ui = open_ui(workspace, "trace_dag.flow.stages:FLOW")
    ui.start_sensor("arriving_reports")
    now = time.time()
    ui.let_daemon_look(now)
    assert standing(workspace) == {}

    for case in ("319024", "319061"):
        report = inbox / f"{case}.xml"
        report.write_bytes((SAMPLE / "reports" / f"crash_{case}.xml").read_bytes())
        os.utime(report, (now - MINUTE_S,) * 2)
    for minute in (1, 2):  # the reports are run; then the sensors that follow runs are asked
        ui.let_daemon_look(now + minute * MINUTE_S)
    assert standing(workspace) == {"2023-319024": "verified", "2023-319061": "rejected"}
    assert pages(workspace) == set(standing(workspace))


def test_cases_released_since_reach_the_warehouse(tmp_path, open_ui, monkeypatch):
    with public_services() as service:
        for name, value in service.settings.items():
            text = f'["{value[0]}"]' if isinstance(value, tuple) else str(value)
            monkeypatch.setenv(f"TRACE_DAG_SERVICES__{name.upper()}", text)
        service.cases = (VERIFIED[0],)
        workspace = Workspace.open(str(tmp_path / "root"), fake_flow.ASKING)
        client = crash_api(workspace.settings.services, workspace.storage)
        ingest(workspace.storage, "nebraska", crash_api=client, choice=NEBRASKA_2023, watch=True)
        ui = open_ui(workspace, "fake_flow:ASKING")
        ui.start_schedule("newly_released_cases")
        now = time.time()
        ui.let_daemon_look(now)
        assert standing(workspace) == {}
        service.cases = VERIFIED[:2]
        for minute in (0, 1):  # one of its Mondays has come; then the sensors that follow runs are asked
            ui.let_daemon_look(now + WEEK_S + minute * MINUTE_S)
        rows = query(workspace.warehouse, "SELECT key, stage_reached FROM crashes WHERE stage_reached IS NOT NULL")[1]
        assert rows == [(f"2023-{VERIFIED[1]}", "raw_report")]


NIGHTLY = """
[automation]
fresh_within_h = 24
[[automation.schedules]]
name = "nightly"
cron = "0 2 * * *"
timezone = "America/New_York"
cohort = "fakes"
"""


def test_a_cohort_is_run_at_its_hour_and_only_what_is_not_up_to_date(tmp_path, open_ui):
    root = tmp_path / "root"
    root.mkdir()
    (root / "settings.toml").write_text(NIGHTLY)
    workspace = Workspace.open(str(root), fake_flow.FLOW)
    keys = [f"2023-5100{number}" for number in (10, 11)]
    reports = fake_flow.write_reports(tmp_path / "reports", dict.fromkeys(keys, ""))
    workspace.registry.register("fakes", reports)
    ui = open_ui(workspace, "fake_flow:FLOW")  # the schedule is on from the start: whoever wrote it asked for it
    tomorrow = datetime.now(ZoneInfo("America/New_York")) + timedelta(days=1)
    hour = tomorrow.replace(hour=2, minute=0, second=30).timestamp()
    ui.let_daemon_look(time.time())
    assert standing(workspace) == {}
    for minute in (0, 1):  # the crashes are run; then the sensors that follow runs are asked
        ui.let_daemon_look(hour + minute * MINUTE_S)
    assert standing(workspace) == dict.fromkeys(keys, "verified")
    stages = len(ui.runs("verdict"))
    ui.let_daemon_look(hour + DAY_S)
    assert len(ui.runs("verdict")) == stages, "there was nothing to run the next night"


def test_crashes_that_another_machine_registers_are_run_as_the_helm_values_ask_for(tmp_path, open_ui, monkeypatch):
    monkeypatch.setenv("TRACE_DAG_AUTOMATION__RUN_REGISTERED", "true")
    workspace = Workspace.open(str(tmp_path / "root"), fake_flow.FLOW)
    ui = open_ui(workspace, "fake_flow:FLOW")  # the sensor is on from the start
    now = time.time()
    ui.let_daemon_look(now)
    assert ui.runs("verdict") == []
    keys = ["2023-510010", "2023-510011"]
    reports = fake_flow.write_reports(tmp_path / "reports", dict.fromkeys(keys, ""))
    Workspace.open(str(tmp_path / "root"), fake_flow.FLOW).registry.register("fakes", reports)
    for minute in (1, 2, 3):  # the crashes are run; then the sensors that follow runs are asked
        ui.let_daemon_look(now + minute * MINUTE_S)
    assert standing(workspace) == dict.fromkeys(keys, "verified")
    assert len(ui.runs("verdict")) == 1
