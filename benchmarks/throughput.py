"""Crashes per minute through all seven stages, and what a second worker process adds.

The bundled sample (under new keys where more crashes are wanted) with its maps: report, map, estimate, simulation,
verdict and picture of each crash. ``TRACE_DAG_BENCH_CRASHES`` sets the size of the cohort.
"""

from __future__ import annotations

import os
import subprocess
import sys
import tempfile
from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path

from benchmarks.cohorts import MAPS, repeated_sample
from benchmarks.measuring import Figure, cpu_s, medians, wall_s
from trace_dag.benchmark.crash_files import making_at_once
from trace_dag.cohorts.ingest import ingest
from trace_dag.flow.batch import run_stages
from trace_dag.flow.executors import InProcessExecutor, ProcessExecutor
from trace_dag.flow.stages import FLOW
from trace_dag.flow.workspace import Workspace

CRASHES = int(os.environ.get("TRACE_DAG_BENCH_CRASHES", "60"))


def measure(runs: int) -> Iterator[Figure]:
    """One process against two, with Dagster's records against without them, and the whole command."""
    yield _scaling(runs)
    yield _records(runs)
    yield from _command()


def _scaling(runs: int) -> Figure:
    executors = [ProcessExecutor(1), ProcessExecutor(2)]
    with tempfile.TemporaryDirectory() as folder:
        for executor in executors:  # what a worker loads once is not what is measured
            _run(Path(folder) / f"warm-{executor.workers}", executor, 8)
        numbers = iter(range(10**6))

        def run(executor: ProcessExecutor) -> None:
            _run(Path(folder) / f"root-{next(numbers)}", executor, CRASHES)

        one, two = medians(max(1, runs // 2), lambda: run(executors[0]), lambda: run(executors[1]), clock=wall_s)
    for executor in executors:
        executor.close()
    load = f"wall time, load {os.getloadavg()[0]:.1f} on {os.cpu_count()} cores"
    return Figure(
        "throughput of two worker processes",
        60 * CRASHES / two,
        "crashes per minute",
        "one process",
        60 * CRASHES / one,
        1.7,
        at_least=True,
        goal_of_ratio=True,
        note=load,
    )


def _records(runs: int) -> Figure:
    """What Dagster's records add to what the workers of a run do, all of it in this process."""
    environment, settings = dict(os.environ), {"execution": {"executor": "in_process"}}
    with tempfile.TemporaryDirectory() as folder:
        roots = (Path(folder) / f"root-{number}" for number in range(10**6))

        def with_records(crashes: int = CRASHES) -> None:
            from trace_dag.definitions.launch import open_instance, planned, run_batches
            from trace_dag.flow.selection import select_stale

            workspace = _registered(next(roots), crashes).with_settings(settings)
            with open_instance(workspace) as instance:
                batches = planned(workspace, instance, select_stale(workspace))
                report = run_batches(workspace, instance, batches, settings=settings)
            if report.errors:
                raise RuntimeError(report.errors[0])

        def bare(crashes: int = CRASHES) -> None:
            workspace = replace(_registered(next(roots), crashes), executor=InProcessExecutor())
            keys = workspace.registry.keys()
            afterwards = making_at_once(workspace.storage, keys)
            for _ in run_stages(workspace, keys, run_id="bare", afterwards=afterwards):
                pass

        with_records(8)  # what is loaded once is not what is measured
        taken, without = medians(max(1, runs // 2), with_records, bare)
    os.environ.clear()
    os.environ.update(environment)
    return Figure(
        "stages, replays and packages with Dagster's records, in one process",
        taken / CRASHES,
        "CPU s per crash",
        "the same without the records",
        without / CRASHES,
        1.25,
        goal_of_ratio=True,
    )


def _registered(root: Path, crashes: int) -> Workspace:
    _register(root, root.with_name(f"reports-{crashes}"), crashes)
    return Workspace.open(str(root))


def _command() -> Iterator[Figure]:
    with tempfile.TemporaryDirectory() as folder:
        root = Path(folder) / "root"
        _register(root, Path(folder) / "reports", CRASHES)
        began, cpu = wall_s(), cpu_s()
        command = [sys.executable, "-m", "trace_dag.cli", "--root", str(root), "run"]
        subprocess.run(command, check=True, capture_output=True)
        taken, used = wall_s() - began, cpu_s() - cpu
        bare_root = Path(folder) / "bare"
        _register(bare_root, Path(folder) / "reports", CRASHES)
        cpu = cpu_s()
        workspace = Workspace.open(str(bare_root), FLOW)
        for _ in run_stages(replace(workspace, executor=InProcessExecutor()), workspace.registry.keys(), run_id="bare"):
            pass
        bare = cpu_s() - cpu
    load = f"load {os.getloadavg()[0]:.1f} on {os.cpu_count()} cores"
    yield Figure(
        f"trace-dag run, {CRASHES} crashes, warehouse and benchmark included",
        used / CRASHES,
        "CPU s per crash",
        "the bare stage functions in one process",
        bare / CRASHES,
    )
    yield Figure(
        f"trace-dag run, {CRASHES} crashes, packages and pages included",
        60 * CRASHES / taken,
        "crashes per minute",
        note=f"wall time, {load}",
    )


def _register(root: Path, reports: Path, crashes: int) -> None:
    from trace_dag.storage.files import Storage

    ingest(Storage.open(root), "sample", reports=[repeated_sample(reports, crashes)], maps=[MAPS])


def _run(root: Path, executor: ProcessExecutor, crashes: int) -> None:
    workspace = _registered(root, crashes)
    for event in run_stages(replace(workspace, executor=executor), workspace.registry.keys(), run_id="benchmark"):
        if event.failed:
            raise RuntimeError(f"{event.key} failed in {event.stage}")
