"""Object stores that fail, hang, cut short; disks that are full: what is finished stays, and the rest is done later."""

from __future__ import annotations

import random
import threading
from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path

import fake_flow
import pytest
from faults.stores import NO_SPACE, ProviderError, TroubledStore, every

from trace_dag.common.provenance import Outcome
from trace_dag.common.stage import Stage
from trace_dag.common.storage.files import Storage
from trace_dag.flow.batch import first_stale, run_stages
from trace_dag.flow.cohorts.registry import ReportSource
from trace_dag.flow.records import read_records, write_record
from trace_dag.flow.verify import verify_storage
from trace_dag.flow.workspace import Workspace

BEHAVIOURS = {f"2023-5100{number}": "" for number in range(10, 16)} | {"2023-510020": "reject:road_map"}


@pytest.fixture
def store(monkeypatch: pytest.MonkeyPatch) -> Iterator[type[TroubledStore]]:
    monkeypatch.setattr("time.sleep", lambda _: None)
    monkeypatch.setattr(fake_flow, "count_call", lambda key, services, stage: 1)
    TroubledStore.reset()
    yield TroubledStore
    TroubledStore.reset()


def pipeline_on_store(tmp_path: Path, behaviours: dict[str, str] = BEHAVIOURS) -> Workspace:
    settings = {"execution": {"executor": "in_process", "retry_wait_s": 0.0, "transient_retries": 0}}
    workspace = Workspace.open("troubled://bucket/root", fake_flow.FLOW, settings)
    workspace.registry.register("fakes", fake_flow.write_reports(tmp_path / "reports", behaviours))
    return workspace


def run(workspace: Workspace, run_id: str = "run") -> list[tuple[str, Stage, bool]]:
    return [
        (each.key, each.stage, each.failed) for each in run_stages(workspace, workspace.registry.keys(), run_id=run_id)
    ]


def assert_whole(workspace: Workspace, folder: Path) -> None:
    report = verify_storage(workspace.storage, folder, contents=True)
    assert report.disagreements == ()
    outcomes = {key: {stage: record.outcome for stage, record in of.items()} for key, of in report.records.items()}
    for key, behaviour in BEHAVIOURS.items():
        expected = dict.fromkeys(list(Stage)[:3] if behaviour else Stage, Outcome.ACCEPTED)
        assert outcomes[key] == expected | ({Stage.ROAD_MAP: Outcome.REJECTED} if behaviour else {})


@pytest.mark.parametrize("error", [OSError("503 Slow Down"), TimeoutError(), ProviderError("connection lost")])
def test_a_store_that_fails_now_and_then_is_asked_again(store, tmp_path, error):
    workspace = pipeline_on_store(tmp_path)
    store.fault = every(5, error)
    assert not any(failed for _, _, failed in run(workspace))
    assert_whole(workspace, tmp_path)


@pytest.mark.parametrize("seed", range(4))
def test_on_a_slow_store_that_often_fails_every_crash_ends_done_or_failed_and_to_be_tried_again(store, tmp_path, seed):
    workspace, draw = pipeline_on_store(tmp_path), random.Random(seed)

    def slow_and_unreliable(kind: str, path: str) -> None:
        threading.Event().wait(0.001)
        if kind == "put" and draw.random() < 0.6:  # four times in a row for one request in eight
            raise TimeoutError

    store.fault = slow_and_unreliable
    ends = {key: failed for key, _, failed in run(workspace)}
    store.fault = None
    assert ends.keys() == BEHAVIOURS.keys()
    assert any(ends.values())
    recorded = [each for of in read_records(workspace.storage, list(BEHAVIOURS)).values() for each in of.values()]
    assert all(record.transient for record in recorded if record.outcome is Outcome.FAILED)
    assert not any(failed for _, _, failed in run(workspace, "second"))
    assert_whole(workspace, tmp_path)


def test_while_a_store_takes_nothing_crashes_fail_and_the_next_run_finishes_them(store, tmp_path):
    workspace = pipeline_on_store(tmp_path)
    writes = 0

    def stop_writing(kind: str, path: str) -> None:
        nonlocal writes
        writes += kind == "put"
        if kind == "put" and writes > 60:
            raise ProviderError("connection refused")

    store.fault = stop_writing
    keys = {key for key, _, failed in run(workspace) if failed}
    assert keys
    assert keys < set(BEHAVIOURS), "what was written before stays"
    store.fault = None
    finished = {
        (key, stage): record.run_id
        for key, of_crash in read_records(workspace.storage, list(BEHAVIOURS)).items()
        for stage, record in of_crash.items()
        if record.outcome is Outcome.ACCEPTED
    }
    assert not any(failed for _, _, failed in run(workspace, "second"))
    after = read_records(workspace.storage, list(BEHAVIOURS))
    assert all(after[key][stage].run_id == run_id for (key, stage), run_id in finished.items())
    assert_whole(workspace, tmp_path)


def test_an_answer_cut_short_is_asked_for_again_and_nothing_is_made_anew(store, tmp_path):
    workspace = pipeline_on_store(tmp_path)
    run(workspace)
    store.cut_short = {"road_map/2023-510010.txt", "state_estimate/2023-510011.outcome.json"}
    changed = Workspace(workspace.storage, workspace.settings, workspace.flow)
    events = list(run_stages(changed, list(BEHAVIOURS), run_id="second", force=[Stage.STATE_ESTIMATE]))
    assert store.cut_short == set(), "both were read"
    assert {event.stage for event in events if event.record.run_id == "second"} == {Stage.STATE_ESTIMATE}
    assert_whole(workspace, tmp_path)


def test_an_object_that_is_cut_short_for_good_is_made_again(store, tmp_path):
    workspace = pipeline_on_store(tmp_path)
    run(workspace)
    name = "road_map/2023-510010.txt"
    workspace.storage.write(name, workspace.storage.read(name)[:-3])
    assert first_stale(workspace, list(BEHAVIOURS)) == {"2023-510010": Stage.ROAD_MAP}
    run(workspace)
    assert_whole(workspace, tmp_path)


def test_reading_a_cohort_costs_listings_and_not_a_request_per_crash(store, tmp_path):
    behaviours = {f"2023-51{number:04}": "" for number in range(120)}
    workspace = pipeline_on_store(tmp_path, behaviours)
    run(workspace)
    store.requests.clear()
    records = read_records(workspace.storage, list(behaviours))
    assert sum(map(len, records.values())) == 7 * 120
    assert store.requests == {"list": 8, "get": 1}, "a listing per stage, one of the runs, and the run's records"
    write_record(workspace.storage, replace(records["2023-510007"][Stage.VERDICT], detail="changed since"))
    assert read_records(workspace.storage, list(behaviours))["2023-510007"][Stage.VERDICT].detail == "changed since"
    store.requests.clear()
    assert verify_storage(workspace.storage, tmp_path).disagreements == ()
    assert sum(store.requests.values()) < 60, "some for each folder, none for each crash"


def test_a_full_disk_fails_what_it_could_not_take_and_loses_nothing(make_workspace, tmp_path, monkeypatch):
    workspace = make_workspace(BEHAVIOURS)
    monkeypatch.setattr("trace_dag.common.storage.files.os.fdopen", full_after(60))
    events = list(run_stages(workspace, list(BEHAVIOURS), run_id="full"))
    failed = {event.key for event in events if event.failed}
    assert failed
    assert failed < set(BEHAVIOURS)
    assert all("free some space" in event.record.detail for event in events if event.failed and event.record)
    monkeypatch.undo()
    root = Path(workspace.storage.root)
    assert not list(root.rglob(".writing-*"))
    assert verify_storage(workspace.storage, root, contents=True).disagreements == ()
    assert not any(event.failed for event in run_stages(workspace, list(BEHAVIOURS), run_id="space again"))
    assert_whole(workspace, root)


def full_after(writes: int):
    import os

    opened, real = 0, os.fdopen

    def fdopen(handle, *arguments):
        nonlocal opened
        opened += 1
        if opened > writes:
            os.close(handle)
            raise NO_SPACE
        return real(handle, *arguments)

    return fdopen


def test_a_report_kept_on_a_store_that_is_down_is_a_failure_and_no_rejection(store, tmp_path, monkeypatch):
    workspace = pipeline_on_store(tmp_path)
    storage = Storage("troubled://bucket/root")
    storage.write("reports/2023-510030.xml", b"x")
    source = ReportSource("stored", "reports/2023-510030.xml")
    workspace.registry.register("stored", {"2023-510030": source})

    def down(kind: str, path: str) -> None:
        if path.endswith("reports/2023-510030.xml"):
            raise ProviderError("no route to host")

    from trace_dag.flow.stages import FLOW

    flow = replace(fake_flow.FLOW, stages=(FLOW.definition(Stage.RAW_REPORT), *fake_flow.FLOW.stages[1:]))
    store.fault = down
    events = list(run_stages(replace(workspace, flow=flow), ["2023-510030"], run_id="down", stages=[Stage.RAW_REPORT]))
    (record,) = [event.record for event in events]
    assert (record.outcome, record.transient) == (Outcome.FAILED, True)
