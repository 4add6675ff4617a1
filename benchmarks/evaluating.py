"""Evaluations per minute: the baselines in the bundled sample's verified crashes, as trace-dag evaluate runs them.

    python -m benchmarks.evaluating [ROOT]

ROOT is a storage root whose crashes have been run; without one the sample is run first.
"""

from __future__ import annotations

import resource
import sys
import tempfile
import time

from trace_dag.evaluation.evaluate import Conditions
from trace_dag.evaluation.registry import BASELINES
from trace_dag.flow.executors import available_cores
from trace_dag.flow.workspace import Workspace
from trace_dag.studies.cases import AgentRole, verified_cases
from trace_dag.studies.evaluations import Limits, evaluate_agents


def main() -> None:
    """Print how many evaluations a minute the machine makes, by the clock and by processor time."""
    if len(sys.argv) > 1:
        root = sys.argv[1]
    else:
        from trace_dag.cli import cli

        root = tempfile.mkdtemp(prefix="trace-dag-evaluating-")
        cli.main(["--root", root, "demo"], standalone_mode=False)
    workspace = Workspace.open(root)
    cases = verified_cases(workspace, None, ())
    began = time.perf_counter()
    rows = evaluate_agents(workspace, cases, BASELINES, (AgentRole.FIRST, AgentRole.SECOND), Conditions(), Limits())
    took_s = time.perf_counter() - began
    used = resource.getrusage(resource.RUSAGE_CHILDREN)
    busy_s = used.ru_utime + used.ru_stime
    cores = available_cores()
    print(f"{len(rows)} evaluations of {len(cases)} crashes by {len(BASELINES)} agents on {cores} cores")
    print(f"{60 * len(rows) / took_s:.0f} a minute by the clock ({took_s:.1f} s)")
    print(f"{60 * len(rows) * cores / busy_s:.0f} a minute by processor time of the workers ({busy_s:.1f} s)")


if __name__ == "__main__":
    main()
