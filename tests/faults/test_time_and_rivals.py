"""Services that are gone for an hour, clocks that jump, two runs on the same crashes."""

from __future__ import annotations

import subprocess
import sys
from datetime import UTC, datetime, timedelta
from pathlib import Path

import fake_flow
import httpx
import pytest

from trace_dag.common.errors import TransientFailure
from trace_dag.common.network.http import HttpClient, HttpPolicy
from trace_dag.common.network.rate_limit import take_turn
from trace_dag.common.provenance import Outcome
from trace_dag.flow.batch import first_stale, run_stages
from trace_dag.flow.records import read_records
from trace_dag.flow.verify import verify_storage

HOUR_S = 3600.0


class Clock:
    """Time that passes only where somebody sleeps or waits for an answer."""

    def __init__(self) -> None:
        self.now_s = 0.0

    def __call__(self) -> float:
        return self.now_s

    def sleep(self, seconds: float) -> None:
        self.now_s += seconds


def test_a_service_silent_for_an_hour_costs_each_crash_one_wait_and_answers_when_it_is_back():
    clock = Clock()
    asked = []

    def answer(request: httpx.Request) -> httpx.Response:
        asked.append(clock.now_s)
        if clock.now_s < HOUR_S:
            clock.sleep(60.0)
            raise httpx.ReadTimeout("silent", request=request)
        return httpx.Response(200, content=b"here")

    client = HttpClient(HttpPolicy(timeout_s=60.0, attempts=5), sleep=clock.sleep, clock=clock)
    client._client = httpx.Client(transport=httpx.MockTransport(answer))
    failed = 0
    for number in range(1000):
        try:
            assert client.get(f"http://service.test/{number}") == b"here"
        except TransientFailure:
            failed += 1
    # The first is patient (five waits); each after it waits once: an hour holds fewer than sixty.
    assert 50 < failed < 60
    assert clock.now_s < HOUR_S + 1000
    assert len(asked) == failed + 4 + (1000 - failed)


def test_a_clock_that_jumps_changes_neither_outcome_nor_what_is_current(make_workspace, monkeypatch):
    workspace = make_workspace({"2023-510010": "", "2023-510011": "fail-once:verdict"})
    keys = workspace.registry.keys()
    moments = iter([timedelta(0), timedelta(days=400), timedelta(days=-400), timedelta(hours=-3)] * 100)
    monkeypatch.setattr(
        "trace_dag.flow.worker.now", lambda: (datetime(2026, 1, 1, tzinfo=UTC) + next(moments)).isoformat()
    )
    list(run_stages(workspace, keys, run_id="first"))
    events = list(run_stages(workspace, keys, run_id="second"))
    assert not any(event.failed for event in events)
    records = read_records(workspace.storage, keys)
    assert {record.run_id for record in records["2023-510010"].values()} == {"first"}
    assert first_stale(workspace, keys) == {}
    assert all(0.0 <= record.duration_s < 60.0 for of_crash in records.values() for record in of_crash.values())
    assert verify_storage(workspace.storage, Path(workspace.storage.root), contents=True).disagreements == ()


def test_turns_follow_a_clock_that_cannot_be_set(tmp_path, monkeypatch):
    monkeypatch.setattr("time.time", lambda: pytest.fail("the wall clock was asked"))
    first = take_turn(tmp_path / "turns", 100.0, 2.0)
    assert take_turn(tmp_path / "turns", 100.0, 2.0) == pytest.approx(first + 2.0)


RIVAL = """
import sys
sys.path.insert(0, {tests!r})
import fake_flow
from trace_dag.flow.batch import run_stages
from trace_dag.flow.workspace import Workspace
settings = {{"execution": {{"executor": "in_process"}}, "sim": {{"friction": {friction}}}}}
workspace = Workspace.open({root!r}, fake_flow.FLOW, settings)
events = list(run_stages(workspace, workspace.registry.keys(), run_id={run_id!r}))
sys.exit(any(event.failed for event in events))
"""


def test_two_runs_on_the_same_crashes_leave_one_whole_result_of_each(make_workspace, tmp_path):
    behaviours = {f"2023-5100{number}": "slow:simulation_log" for number in range(10, 16)}
    workspace = make_workspace(behaviours)
    rivals = [
        subprocess.Popen(
            [
                *(sys.executable, "-c"),
                RIVAL.format(
                    tests=str(Path(fake_flow.__file__).parent),
                    root=workspace.storage.root,
                    friction=friction,
                    run_id=f"run-{friction}",
                ),
            ]
        )
        for friction in (0.4, 0.6)
    ]
    assert [rival.wait() for rival in rivals] == [0, 0]
    report = verify_storage(workspace.storage, tmp_path / "root", contents=True)
    assert report.disagreements == ()
    for of_crash in report.records.values():
        assert len(of_crash) == 7
        assert {record.outcome for record in of_crash.values()} == {Outcome.ACCEPTED}
