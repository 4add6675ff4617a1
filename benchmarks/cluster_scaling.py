"""How much faster several workers of a Dask cluster are than one: the stages of the sample, by workers that are warm.

    python -m benchmarks.cluster_scaling [--crashes 60] [--runs 3] [--workers 2]

One scheduler with one worker and one with several, all processes of their own on loopback, each with one thread. Each
worker has worked on all crashes once before anything is measured. The clock on the wall is disturbed by whatever else
runs. So the processor time of this process, the scheduler and the workers is measured too: on as many free cores the
workers can be no faster than these together need, shared, while of one worker the others run beside it.
"""

from __future__ import annotations

import argparse
import os
import statistics
import sys
import tempfile
import time
from collections.abc import Iterator
from contextlib import closing
from dataclasses import replace
from pathlib import Path

from benchmarks.cohorts import MAPS, repeated_sample
from benchmarks.measuring import Figure, exit_code
from benchmarks.results import keep
from tests.faults.cluster import DaskCluster, dask_cluster
from trace_dag.cohorts.ingest import ingest
from trace_dag.flow.batch import run_stages
from trace_dag.flow.executors import DaskExecutor
from trace_dag.flow.workspace import Workspace
from trace_dag.stage import Stage

_GOAL = 0.9  # times the number of workers


def main() -> int:
    """Exit code 1 if the goal is missed."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--crashes", type=int, default=60)
    parser.add_argument("--runs", type=int, default=3)
    parser.add_argument("--workers", type=int, default=2)
    parser.add_argument("--no-keep", action="store_true", help="print only")
    options = parser.parse_args()
    with tempfile.TemporaryDirectory() as folder:
        figures = list(measured(Path(folder), options.crashes, options.runs, options.workers))
    for figure in figures:
        print(f"{figure.name}: {figure.value:.2f} {figure.unit} ({figure.note})")
    if not options.no_keep:
        keep(figures)
    return exit_code(figures)


def measured(folder: Path, crashes: int, runs: int, workers: int) -> Iterator[Figure]:
    """The runs with one worker and with several by turns."""
    workspace = Workspace.open(str(folder / "root"))
    ingest(workspace.storage, "sample", reports=[repeated_sample(folder / "reports", crashes)], maps=[MAPS])
    with dask_cluster(folder, 1, {}) as one, dask_cluster(folder, workers, {}) as several:
        for number, cluster in ((1, one), (workers, several)):
            cluster.wait_for_workers(number)
            _run(workspace, cluster)
        taken = [(_run(workspace, one), _run(workspace, several)) for _ in range(runs)]
    wall = [statistics.median(each[number][0] for each in taken) for number in (0, 1)]
    others_s, workers_s = (statistics.median(each[1][part] for each in taken) for part in (1, 2))
    load = f"load {os.getloadavg()[0]:.1f}"
    note = f"{1e3 * wall[0] / crashes:.0f} and {1e3 * wall[1] / crashes:.0f} ms per crash by the clock, {load}"
    name = f"{workers} workers of a cluster to one"
    yield Figure(f"{name}, by the clock", wall[0] / wall[1], "times", "", None, _GOAL * workers, True, note=note)
    note = (
        f"CPU ms per crash: workers {1e3 * workers_s / crashes:.0f}, "
        f"command and scheduler {1e3 * others_s / crashes:.0f}"
    )
    share = workers_s / (workers_s + others_s)
    yield Figure(f"{name}, by processor time", workers * share, "times", note=note)


def _run(workspace: Workspace, cluster: DaskCluster) -> tuple[float, float, float]:
    """Seconds by the clock, and CPU seconds of this process with the scheduler, and of the workers."""
    began_s, others_s, workers_s = time.monotonic(), _others_s(cluster), _workers_s(cluster)
    with closing(DaskExecutor(cluster.address)) as executor:
        keys = workspace.registry.keys()
        events = list(run_stages(replace(workspace, executor=executor), keys, run_id="scaling", force=tuple(Stage)))
    if any(event.failed for event in events):
        raise SystemExit("a crash failed")
    return time.monotonic() - began_s, _others_s(cluster) - others_s, _workers_s(cluster) - workers_s


def _others_s(cluster: DaskCluster) -> float:
    return time.process_time() + _used_s(cluster.scheduler.pid)


def _workers_s(cluster: DaskCluster) -> float:
    return sum(_used_s(worker.pid) for worker in cluster.workers)


def _used_s(pid: int) -> float:
    """CPU seconds of a process so far, of proc(5)."""
    fields = Path(f"/proc/{pid}/stat").read_text().rpartition(")")[2].split()
    return sum(map(int, fields[11:13])) / os.sysconf("SC_CLK_TCK")


if __name__ == "__main__":
    sys.exit(main())
