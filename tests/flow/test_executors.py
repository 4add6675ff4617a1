"""Process pools and Dask: the same results, and what happens when workers die."""

from __future__ import annotations

import os
import signal
import subprocess
import sys
from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path

import fake_flow
import pytest
from waiting import eventually

from trace_dag.common.errors import UserError
from trace_dag.common.provenance import Outcome
from trace_dag.common.settings import ExecutionSettings
from trace_dag.common.stage import Stage
from trace_dag.flow.batch import first_stale, run_stages
from trace_dag.flow.executors import DaskExecutor, InProcessExecutor, ProcessExecutor, make_executor
from trace_dag.flow.records import read_records
from trace_dag.flow.worker import work_on_chunk
from trace_dag.flow.workspace import Workspace

BEHAVIOURS = {
    "2023-510010": "",
    "2023-510011": "reject:road_map",
    "2023-510012": "fail:state_estimate",
    "2023-510013": "reject:osm_extract",
    "2023-510014": "",
    "2023-510015": "fail:crash_record",
}


def outcomes(workspace: Workspace) -> dict[tuple[str, str], tuple[str, str | None, tuple[str, ...]]]:
    """What the records say, without times."""
    return {
        (key, stage): (record.outcome, record.reason, tuple(file.sha256 for file in record.artefacts))
        for key, records in read_records(workspace.storage, workspace.registry.keys()).items()
        for stage, record in records.items()
    }


@pytest.fixture(scope="module")
def pool() -> Iterator[ProcessExecutor]:
    executor = ProcessExecutor(2)
    yield executor
    executor.close()


def test_pool_gives_what_one_process_gives(make_workspace, tmp_path, pool):
    workspace = make_workspace(BEHAVIOURS)
    list(run_stages(replace(workspace, executor=InProcessExecutor()), list(BEHAVIOURS), run_id="one"))
    alone = outcomes(workspace)
    again = Workspace.open(str(tmp_path / "other"), fake_flow.FLOW, {"execution": {"chunk_size": 2}})
    again.registry.register("fakes", fake_flow.write_reports(tmp_path / "reports", BEHAVIOURS))
    events = list(run_stages(replace(again, executor=pool), list(BEHAVIOURS), run_id="two"))
    assert len(events) == 7 * len(BEHAVIOURS)
    assert outcomes(again) == alone
    pids = {pid for log in (tmp_path / "other/calls").iterdir() for pid in log.read_text().split()}
    assert str(os.getpid()) not in pids


def test_crash_that_kills_its_worker_fails_alone_and_the_others_finish(make_workspace, pool):
    workspace = make_workspace(BEHAVIOURS | {"2023-510020": "die:simulation_log"}, execution={"chunk_size": 8})
    keys = workspace.registry.keys()
    events = list(run_stages(replace(workspace, executor=pool), keys, run_id="x"))
    assert len(events) == 7 * len(keys)
    record = read_records(workspace.storage, keys)["2023-510020"][Stage.SIMULATION_LOG]
    assert record.outcome is Outcome.FAILED
    assert "worker process died" in record.detail
    failed = {event.key for event in events if event.failed}
    assert failed == {"2023-510012", "2023-510015", "2023-510020"}


def test_killed_workers_chunk_is_done_again_and_finished_stages_are_not(make_workspace, tmp_path, pool):
    workspace = make_workspace({"2023-510010": "", "2023-510011": "die-once:verdict"})
    events = list(run_stages(replace(workspace, executor=pool), workspace.registry.keys(), run_id="x"))
    assert not any(event.failed for event in events)
    counts = fake_flow.calls(tmp_path / "root")
    assert counts["verdict", "2023-510011"] == 2
    assert counts["simulation_log", "2023-510011"] == 1


def test_batch_stage_that_kills_its_worker_is_narrowed_down(make_workspace, pool):
    workspace = make_workspace({"2023-510010": "", "2023-510011": "die:osm_extract", "2023-510012": ""})
    events = list(run_stages(replace(workspace, executor=pool), workspace.registry.keys(), run_id="x"))
    assert {event.key for event in events if event.failed} == {"2023-510011"}


RUN_FOR_EVER = """
import dataclasses
import sys
sys.path.insert(0, {tests!r})
import fake_flow
from trace_dag.flow.batch import run_stages
from trace_dag.flow.executors import ProcessExecutor
from trace_dag.flow.workspace import Workspace
if __name__ == "__main__":
    workspace = Workspace.open({root!r}, fake_flow.FLOW)
    workspace = dataclasses.replace(workspace, executor=ProcessExecutor(2))
    list(run_stages(workspace, workspace.registry.keys(), run_id="killed"))
"""


def test_sigkill_in_the_middle_loses_nothing_finished_and_leaves_nothing_half_written(make_workspace, tmp_path):
    behaviours = {f"2023-5100{number}": "slow:road_map\nslow:verdict" for number in range(10, 22)}
    workspace = make_workspace(behaviours)
    script = tmp_path / "run.py"
    script.write_text(RUN_FOR_EVER.format(tests=str(Path(fake_flow.__file__).parent), root=workspace.storage.root))
    process = subprocess.Popen([sys.executable, str(script)])

    def under_way() -> bool:
        assert process.poll() is None, "the run ended before it could be killed"
        return len(list(Path(workspace.storage.root, "verdict").glob("*.outcome.json"))) >= 2

    eventually(under_way, "the run never got going")
    process.send_signal(signal.SIGKILL)
    process.wait()
    workers = {int(pid) for log in (tmp_path / "root/calls").iterdir() for pid in log.read_text().split()}
    eventually(lambda: not any(_alive(pid) for pid in workers), "workers outlived their parent")

    finished = outcomes(workspace)
    for (key, stage), (outcome, _, digests) in finished.items():
        assert outcome == "accepted"
        data = workspace.storage.read(f"{stage}/{key}.txt")
        assert workspace.storage.write("scratch/copy.txt", data).sha256 == digests[0]
    counts = fake_flow.calls(tmp_path / "root")
    assert not any(event.failed for event in run_stages(workspace, list(behaviours), run_id="after"))
    after = fake_flow.calls(tmp_path / "root")
    assert all(after[stage, key] == counts[stage, key] for key, stage in finished)
    assert len(outcomes(workspace)) == 7 * len(behaviours)


def _alive(pid: int) -> bool:
    try:
        return "\nState:\tZ" not in Path(f"/proc/{pid}/status").read_text()
    except FileNotFoundError:
        return False


class ThreeMachines(InProcessExecutor):
    machines = 3


def test_machines_share_the_rate_at_which_services_are_asked(make_workspace, monkeypatch):
    workspace = make_workspace({"2023-510010": ""}, services={"requests_per_s": 6.0})
    seen = set()
    monkeypatch.setattr(
        "trace_dag.flow.batch.work_on_chunk",
        lambda chunk: seen.add(chunk.work.settings.services.requests_per_s) or work_on_chunk(chunk),
    )
    events = list(run_stages(replace(workspace, executor=ThreeMachines()), workspace.registry.keys(), run_id="x"))
    assert seen == {2.0}
    assert not any(event.failed for event in events)
    assert first_stale(workspace, workspace.registry.keys()) == {}, "how often one may ask changes no result"


def test_dask_needs_an_address_that_answers():
    with pytest.raises(UserError, match="dask_address"):
        DaskExecutor(None)


def test_dask_workers_in_other_processes_give_the_same_and_survive_a_dead_one(make_workspace, tmp_path, monkeypatch):
    pytest.importorskip("distributed")
    from distributed import LocalCluster

    monkeypatch.setenv("PYTHONPATH", str(Path(fake_flow.__file__).parent))
    behaviours = BEHAVIOURS | {"2023-510020": "die-once:road_map"}
    workspace = make_workspace(behaviours, execution={"chunk_size": 2})
    with LocalCluster(n_workers=2, threads_per_worker=1, dashboard_address=None) as cluster:
        executor = DaskExecutor(cluster.scheduler_address)
        events = list(run_stages(replace(workspace, executor=executor), workspace.registry.keys(), run_id="dask"))
        executor.close()
    assert len(events) == 7 * len(behaviours)
    assert {event.key for event in events if event.failed} == {"2023-510012", "2023-510015"}


def test_a_dask_cluster_that_stays_without_workers_ends_the_run_in_a_line():
    distributed = pytest.importorskip("distributed")
    with distributed.LocalCluster(n_workers=0, processes=False, dashboard_address=None) as cluster:
        executor = DaskExecutor(cluster.scheduler_address)
        executor.most_without_workers_s = 0.0
        with pytest.raises(UserError, match=r"has had no workers for 0 s; start workers, then run again"):
            list(executor.run(abs, [-1, -2]))
        cluster.scale(1)
        assert dict(executor.run(abs, [-1, -2])) == {-1: 1, -2: 2}, "workers that come in time do the work"
        executor.close()


def test_executor_by_settings():
    assert isinstance(make_executor(ExecutionSettings(executor="in_process")), InProcessExecutor)
    executor = make_executor(ExecutionSettings(executor="processes", workers=3))
    assert isinstance(executor, ProcessExecutor)
    assert executor.workers == 3
