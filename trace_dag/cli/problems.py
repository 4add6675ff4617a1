"""Damaged crashes and files that a command left out: listed once at its end, each with its remedy."""

from __future__ import annotations

from trace_dag.cli.printing import one_line
from trace_dag.common.errors import Failure
from trace_dag.common.messages.logs import print_problem

_SHOWN = 20
_LINE = 500


class Problems:
    """Collects damaged crashes and files while a command does the rest."""

    def __init__(self) -> None:
        self._said: dict[str, None] = {}

    def add(self, failure: Failure) -> None:
        """Remember a complaint, each only once."""
        self._said[str(failure)] = None

    def print_all(self) -> int:
        """Print the collected problems; return the exit code, 1 if there are any."""
        for said in list(self._said)[:_SHOWN]:
            print_problem(f"failed: {one_line(said, _LINE)}")
        if len(self._said) > _SHOWN:
            print_problem(f"failed: {len(self._said) - _SHOWN} more; trace-dag verify --contents lists them")
        return 1 if self._said else 0
