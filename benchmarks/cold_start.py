"""How long it takes until something happens: importing the package, the command's help, the Dagster definitions."""

from __future__ import annotations

import subprocess
import sys
from collections.abc import Iterator

from benchmarks.measuring import Figure, medians

STARTS = {
    "import trace_dag": (("-c", "import trace_dag"), 1.0),
    "trace-dag --help": (("-m", "trace_dag.cli", "--help"), 1.0),
    "definitions": (("-c", "import trace_dag.definitions"), 4.0),
}


def measure(runs: int) -> Iterator[Figure]:
    """Each start beside one of the bare interpreter."""
    for name, (arguments, goal_s) in STARTS.items():
        ours, bare = medians(runs, lambda arguments=arguments: _python(*arguments), lambda: _python("-c", ""))
        yield Figure(f"cold start: {name}", ours, "s", "bare interpreter", bare, goal_s)


def _python(*arguments: str) -> None:
    subprocess.run([sys.executable, *arguments], check=True, stdout=subprocess.DEVNULL)
