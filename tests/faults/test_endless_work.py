"""Stages that never end and workers that are stopped: their crash fails, is named, and the others are done."""

from __future__ import annotations

import os
import signal
from dataclasses import replace
from pathlib import Path

import fake_flow
import pytest

from trace_dag.common.provenance import Outcome
from trace_dag.common.stage import Stage
from trace_dag.flow.batch import run_stages
from trace_dag.flow.executors import DaskExecutor, ProcessExecutor
from trace_dag.flow.pool import Pool
from trace_dag.flow.records import read_records

GOOD = ("2023-510010", "2023-510011")
BAD = "2023-510020"


def run_beside_good_ones(make_workspace, behaviour: str, executor: str, limit_s: float = 3.0):
    """The failed record of a crash with a behaviour; the crashes beside it went through all stages."""
    settings = {"executor": executor, "workers": 2, "stage_time_limit_s": limit_s, "retry_wait_s": 0}
    workspace = make_workspace({**dict.fromkeys(GOOD, ""), BAD: behaviour}, execution=settings)
    events = list(run_stages(workspace, workspace.registry.keys(), run_id="x"))
    assert {event.key for event in events if event.failed} == {BAD}
    records = read_records(workspace.storage, workspace.registry.keys())
    for key in GOOD:
        assert {record.outcome for record in records[key].values()} == {Outcome.ACCEPTED}
        assert len(records[key]) == len(Stage)
    (failed,) = [record for record in records[BAD].values() if record.outcome is Outcome.FAILED]
    return failed


@pytest.mark.parametrize("stage", [Stage.OSM_EXTRACT, Stage.ROAD_MAP])
@pytest.mark.parametrize("executor", ["in_process", "processes"])
def test_a_stage_that_never_ends_fails_its_crash(make_workspace, stage, executor):
    failed = run_beside_good_ones(make_workspace, f"hang:{stage}", executor)
    assert failed.stage is stage
    assert failed.detail.startswith(f"{stage} of {BAD}: not done after 3 s (execution.stage_time_limit_s)")


def test_on_dask_too_a_stage_that_never_ends_fails_its_crash(make_workspace, monkeypatch):
    pytest.importorskip("distributed")
    from distributed import LocalCluster

    monkeypatch.setenv("PYTHONPATH", str(Path(fake_flow.__file__).parent))
    endless = {"2023-510020": "hang:road_map", "2023-510021": "sleep:road_map", "2023-510022": "hang:osm_extract"}
    settings = {"stage_time_limit_s": 3.0, "retry_wait_s": 0}
    workspace = make_workspace({**dict.fromkeys(GOOD, ""), **endless}, execution=settings)
    with LocalCluster(n_workers=2, threads_per_worker=1, dashboard_address=None) as cluster:
        executor = DaskExecutor(cluster.scheduler_address)
        events = list(run_stages(replace(workspace, executor=executor), workspace.registry.keys(), run_id="x"))
        executor.close()
    assert {event.key for event in events if event.failed} == set(endless)
    records = read_records(workspace.storage, workspace.registry.keys())
    for key, behaviour in endless.items():
        stage = Stage(behaviour.partition(":")[2])
        assert records[key][stage].detail.startswith(f"{stage} of {key}: not done after 3 s")
    assert all(len(records[key]) == len(Stage) for key in GOOD)


def test_a_worker_that_never_comes_back_to_python_ends_itself(make_workspace):
    failed = run_beside_good_ones(make_workspace, "freeze:road_map", "processes", limit_s=1.0)
    assert failed.stage is Stage.ROAD_MAP


def test_a_worker_that_was_stopped_is_lost_and_its_crash_fails(make_workspace, monkeypatch):
    monkeypatch.setattr(Pool, "most_stopped_s", 0.5)
    failed = run_beside_good_ones(make_workspace, "stop:road_map", "processes", limit_s=60.0)
    assert failed.stage is Stage.ROAD_MAP
    assert "worker process died" in failed.detail


def test_an_interruption_ends_a_pool_whose_worker_was_stopped(make_workspace, monkeypatch):
    monkeypatch.setattr(Pool, "most_stopped_s", 3600.0)  # so that nothing but the interruption ends it
    workspace = make_workspace({BAD: "stop:road_map"})
    executor = ProcessExecutor(1)
    events = run_stages(replace(workspace, executor=executor), [BAD], run_id="x")
    executor.prepare(os.getpid)
    signal.signal(signal.SIGALRM, signal.default_int_handler)
    signal.setitimer(signal.ITIMER_REAL, 4.0)
    with pytest.raises(KeyboardInterrupt):
        list(events)
    assert executor.processes() == []
