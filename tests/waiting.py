"""Waiting in tests for what another process does."""

from __future__ import annotations

import time
from collections.abc import Callable

_MOST_S = 300.0  # a machine that does other things too is slow; what never comes still ends the test


def eventually(condition: Callable[[], object], missing: str) -> None:
    """Returns once the condition holds. Fails with what is missing if it never does; a condition may fail earlier."""
    until_s = time.monotonic() + _MOST_S
    while not condition():
        assert time.monotonic() < until_s, missing
        time.sleep(0.05)
