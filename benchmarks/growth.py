"""How registering, planning and looking at a cohort grow with it: 100, 1,000, 10,000 crashes.

The same per crash at every size means that a cohort a hundred times larger takes a hundred times as long, and no more.
"""

from __future__ import annotations

import os
import tempfile
from collections.abc import Iterator
from pathlib import Path

from benchmarks.measuring import Figure, cpu_s
from trace_dag.assets.launch import open_instance, planned
from trace_dag.pipeline.home import Home
from trace_dag.pipeline.registry import ReportSource
from trace_dag.pipeline.selection import select_stale
from trace_dag.pipeline.stages import FLOW

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
        home = Home(f"{folder}/root", FLOW)
        with open_instance(home) as instance:
            began = cpu_s()
            pipeline = home.pipeline()
            reports = {key: ReportSource("file", str(Path(folder) / key), "0" * 64) for key in keys}
            pipeline.registry.register("grown", reports)
            planned(pipeline, instance, select_stale(pipeline))
            taken = cpu_s() - began
    os.environ.clear()
    os.environ.update(environment)
    return taken
