"""What Dagster costs per crash: all seven stages with next to no work in them, through Dagster and without it.

    python -m benchmarks orchestration                       100 and 1,000 crashes
    python -m benchmarks.orchestration 500 36000 --runs 2    two runs of 250 crashes in cohorts of these sizes

Dagster's event log is included: a planned and a done event for each stage and crash, and the metadata the UI shows.
"""

from __future__ import annotations

import argparse
import os
import sys
import tempfile
from collections.abc import Callable, Iterator
from dataclasses import replace
from itertools import pairwise
from pathlib import Path
from typing import Any

from benchmarks.measuring import Figure, cpu_s, medians

sys.path.insert(0, str(Path(__file__).resolve().parents[1] / "tests"))

SIZES = (100, 1000)
SETTINGS: dict[str, Any] = {"execution": {"executor": "in_process"}}


def measure(runs: int) -> Iterator[Figure]:
    """CPU seconds per crash beyond those of the same stages called without Dagster."""
    for crashes in SIZES:
        with_dagster, bare = medians(runs, lambda n=crashes: _through_dagster(n), lambda n=crashes: _bare(n))
        yield Figure(
            f"orchestration, {crashes} crashes",
            (with_dagster - bare) / crashes,
            "CPU s per crash",
            "the bare stage functions",
            bare / crashes,
            None,
        )


def main() -> int:
    """Print what each size asked for takes: CPU milliseconds per crash, of its parts."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("crashes", type=int, nargs="+")
    parser.add_argument("--runs", type=int, help="carry out so many runs of each size, and leave the others")
    options = parser.parse_args()
    _through_dagster(10)  # modules are read
    for crashes in options.crashes:
        told = [cpu_s()]
        done = _through_dagster(crashes, options.runs, lambda told=told: told.append(cpu_s()))  # type: ignore[misc]
        preparing, planning, running = (1e3 * (end - start) for start, end in pairwise(told))
        print(
            f"{crashes:,} crashes, CPU ms for each: preparing {preparing / crashes:.2f}, planning "
            f"{planning / crashes:.2f}, running {running / done:.2f} (of {done:,})",
            flush=True,
        )
    return 0


def _prepared(folder: str, crashes: int) -> Any:
    import fake_flow

    from trace_dag.flow.workspace import Workspace

    workspace = Workspace.open(f"{folder}/root", replace(fake_flow.FLOW, picture=None))
    behaviours = {f"2023-{510_000 + number}": "" for number in range(crashes)}
    reports = fake_flow.write_reports(Path(folder) / "reports", behaviours)
    workspace.with_settings(SETTINGS).registry.register("fakes", reports)
    return workspace


def _through_dagster(crashes: int, runs: int | None = None, on_progress: Callable[[], None] = lambda: None) -> int:
    """How many crashes went through, in all runs or in the first ones; ``on_progress`` is called when all is prepared,
    when it is planned, and when it has run."""
    from trace_dag.definitions.launch import open_instance, planned, run_batches
    from trace_dag.flow.selection import select_stale

    environment = dict(os.environ)
    with tempfile.TemporaryDirectory() as folder:
        workspace = _prepared(folder, crashes)
        workspace = workspace.with_settings(SETTINGS)
        with open_instance(workspace) as instance:
            on_progress()
            batches = planned(workspace, instance, select_stale(workspace))
            on_progress()
            report = run_batches(workspace, instance, batches[:runs], settings=SETTINGS)
            on_progress()
    os.environ.clear()
    os.environ.update(environment)
    if report.errors:
        raise RuntimeError(report.errors[0])
    return sum(len(batch.keys) for batch in batches[:runs])


def _bare(crashes: int) -> None:
    from trace_dag.flow.batch import run_stages

    with tempfile.TemporaryDirectory() as folder:
        workspace = _prepared(folder, crashes).with_settings(SETTINGS)
        for _ in run_stages(workspace, workspace.registry.keys(), run_id="bare"):
            pass


if __name__ == "__main__":
    sys.exit(main())
