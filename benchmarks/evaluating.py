"""Evaluations per minute: the baselines in the bundled sample's verified crashes, as trace-dag evaluate runs them.

    python -m benchmarks.evaluating [ROOT]

ROOT is a storage root whose crashes have been run; without one the sample is run first.
"""

from __future__ import annotations

import ctypes
import os
import resource
import sys
import tempfile
import time
from contextlib import suppress

from trace_dag.evaluation.agent_main import AgentLimits
from trace_dag.evaluation.evaluate import Conditions
from trace_dag.evaluation.registry import BASELINES
from trace_dag.flow.executors import available_cores
from trace_dag.flow.workspace import Workspace
from trace_dag.studies.cases import AgentRole, verified_cases
from trace_dag.studies.evaluations import evaluate_agents


def _take_in_orphans() -> None:
    """Be the parent of processes whose own has ended, so that their processor time counts (prctl(2), 36)."""
    if sys.platform == "linux":
        ctypes.CDLL(None).prctl(36, 1)


def main() -> None:
    """Print how many evaluations a minute the machine makes, by the clock and by processor time."""
    if len(sys.argv) > 1:
        root = sys.argv[1]
    else:
        from trace_dag.cli import cli

        root = tempfile.mkdtemp(prefix="trace-dag-evaluating-")
        cli.main(["--root", root, "demo"], standalone_mode=False)
    _take_in_orphans()
    workspace = Workspace.open(root)
    cases = verified_cases(workspace, None, ())
    began = time.perf_counter()
    rows = evaluate_agents(
        workspace, cases, BASELINES, (AgentRole.FIRST, AgentRole.SECOND), Conditions(), AgentLimits()
    )
    took_s = time.perf_counter() - began
    with suppress(ChildProcessError):
        while os.waitpid(-1, os.WNOHANG)[0]:  # agents' processes, whose workers have ended before them
            pass
    used = resource.getrusage(resource.RUSAGE_CHILDREN)
    busy_s = used.ru_utime + used.ru_stime
    cores = available_cores()
    print(f"{len(rows)} evaluations of {len(cases)} crashes by {len(BASELINES)} agents on {cores} cores")
    print(f"{60 * len(rows) / took_s:.0f} a minute by the clock ({took_s:.1f} s)")
    print(f"{60 * len(rows) * cores / busy_s:.0f} a minute by processor time of workers and agents ({busy_s:.1f} s)")


if __name__ == "__main__":
    main()
