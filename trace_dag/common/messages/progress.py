"""How work that takes its time says how far it is; who shows it is :mod:`trace_dag.cli.progress`'s."""

from __future__ import annotations

from collections.abc import Callable

OnProgress = Callable[[int, int], None]
"""Hears how many of how many are done."""


def silent(_done: int, _total: int) -> None:
    """The progress of work that nobody watches."""
