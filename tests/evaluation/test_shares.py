"""Intervals of shares take the crash as the unit."""

from __future__ import annotations

import pytest

from trace_dag.evaluation.shares import clustered_share, wilson_interval


def test_both_drivers_of_a_crash_count_once() -> None:
    """Pairs that agree say no more than half as many runs: the interval is that of forty, not of eighty."""
    pairs = [(f"2023-{n}", n % 2 == 0) for n in range(40) for _ in range(2)]
    found = clustered_share(pairs)
    assert (found.part, found.of, found.crashes) == (40, 80, 40)
    low, high = wilson_interval(20, 40)
    assert (found.low, found.high) == (pytest.approx(low, abs=0.03), pytest.approx(high, abs=0.03))


@pytest.mark.parametrize("holds", [True, False])
def test_what_holds_always_or_never_is_not_certain(holds: bool) -> None:
    found = clustered_share((f"2023-{n // 2}", holds) for n in range(20))
    assert (found.low, found.high) == wilson_interval(10 * holds, 10)


def test_one_crash_whose_drivers_differ_leaves_everything_open() -> None:
    found = clustered_share([("2023-1", True), ("2023-1", False)])
    assert (found.part, found.of, found.low, found.high) == (1, 2, 0.0, 1.0)


def test_no_runs_are_no_error() -> None:
    assert clustered_share([])[:3] == (0, 0, 0)
