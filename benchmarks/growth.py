"""How registering, planning and looking at a cohort grow with it: 100, 1,000, 10,000 crashes.

The same per crash at every size means that a cohort a hundred times larger takes a hundred times as long, and no more.
"""

from __future__ import annotations

import os
import tempfile
from collections.abc import Iterator
from pathlib import Path

from benchmarks.measuring import Figure, cpu_s
from trace_dag.cohorts.registry import ReportSource
from trace_dag.definitions.launch import open_instance, planned
from trace_dag.flow.selection import select_stale
from trace_dag.flow.stages import FLOW
from trace_dag.flow.workspace import Workspace

SIZES = (100, 1_000, 10_000)


def measure(runs: int) -> Iterator[Figure]:
    """CPU milliseconds per crash to register, make partitions and plan the runs; beside the smallest cohort's."""
    smallest: float | None = None
    for crashes in SIZES:
        taken = sorted(_registered(crashes) for _ in range(runs if crashes < SIZES[-1] else 1))
        per_crash = 1e3 * taken[len(taken) // 2] / crashes
        peer = f"per crash of {SIZES[0]}" if smallest else ""
        yield Figure(f"cohort of {crashes:,}: register and plan", per_crash, "CPU ms per crash", peer, smallest)
        smallest = smallest or per_crash


def _registered(crashes: int) -> float:
    environment = dict(os.environ)
    keys = [f"{2023 - number // 9_999}-{310_001 + number % 9_999}" for number in range(crashes)]
    with tempfile.TemporaryDirectory() as folder:
        workspace = Workspace.open(f"{folder}/root", FLOW)
        with open_instance(workspace) as instance:
            began = cpu_s()
            reports = {key: ReportSource("file", str(Path(folder) / key), "0" * 64) for key in keys}
            workspace.registry.register("grown", reports)
            planned(workspace, instance, select_stale(workspace))
            taken = cpu_s() - began
    os.environ.clear()
    os.environ.update(environment)
    return taken
