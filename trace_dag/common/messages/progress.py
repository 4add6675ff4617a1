"""Progress of long work, as calls; :mod:`trace_dag.cli.printing` shows it."""

from __future__ import annotations

from collections.abc import Callable

OnProgress = Callable[[int, int], None]
"""Hears how many of how many are done."""


def silent(_done: int, _total: int) -> None:
    """Ignore the progress of work."""
