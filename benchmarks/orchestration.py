"""What Dagster costs per crash: all seven stages with next to no work in them, through Dagster and without it.

Dagster's event log is included: a planned and a done event for each stage and crash, and the metadata the UI shows.
"""

from __future__ import annotations

import os
import sys
import tempfile
from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path
from typing import Any

from benchmarks.measuring import Figure, medians

sys.path.insert(0, str(Path(__file__).resolve().parents[1] / "tests"))

SIZES = (100, 1000)
SETTINGS: dict[str, Any] = {"execution": {"executor": "in_process"}}
GOAL_S = 0.12


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
            GOAL_S,
        )


def _prepared(folder: str, crashes: int) -> Any:
    import fake_flow

    from trace_dag.flow.workspace import Workspace

    workspace = Workspace.open(f"{folder}/root", replace(fake_flow.FLOW, picture=None))
    behaviours = {f"2023-{510_000 + number}": "" for number in range(crashes)}
    reports = fake_flow.write_reports(Path(folder) / "reports", behaviours)
    workspace.with_settings(SETTINGS).registry.register("fakes", reports)
    return workspace


def _through_dagster(crashes: int) -> None:
    from trace_dag.definitions.launch import open_instance, planned, run_batches
    from trace_dag.flow.selection import select_stale

    environment = dict(os.environ)
    with tempfile.TemporaryDirectory() as folder:
        workspace = _prepared(folder, crashes)
        workspace = workspace.with_settings(SETTINGS)
        with open_instance(workspace) as instance:
            batches = planned(workspace, instance, select_stale(workspace))
            report = run_batches(workspace, instance, batches, settings=SETTINGS)
    os.environ.clear()
    os.environ.update(environment)
    if report.errors:
        raise RuntimeError(report.errors[0])


def _bare(crashes: int) -> None:
    from trace_dag.flow.batch import run_stages

    with tempfile.TemporaryDirectory() as folder:
        workspace = _prepared(folder, crashes).with_settings(SETTINGS)
        for _ in run_stages(workspace, workspace.registry.keys(), run_id="bare"):
            pass
