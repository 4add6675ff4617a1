"""Intervals of shares take the crash as the unit."""

from __future__ import annotations

import pytest

from trace_dag.agents.evaluation.shares import clustered_share, wilson_interval


def test_both_drivers_of_a_crash_count_once() -> None:
    """Pairs that agree say no more than half as many runs: the interval is that of forty, not of eighty."""
    found = clustered_share((f"2023-{n}", n % 2 == 0) for n in range(40) for _ in range(2))
    assert (found.part, found.of, found.crashes) == (40, 80, 40)
    assert (found.low, found.high) == pytest.approx(wilson_interval(20, 40))


@pytest.mark.parametrize("holds", [True, False])
def test_frequencies_of_0_and_1_are_not_certain(holds: bool) -> None:
    found = clustered_share((f"2023-{n // 2}", holds) for n in range(20))
    assert (found.low, found.high) == wilson_interval(10 * holds, 10)


def test_crashes_that_all_go_alike_are_not_certain_either() -> None:
    """In each of three crashes one driver avoids it and the other does not: a resampled crash is always one half."""
    found = clustered_share((f"2023-{n // 2}", n % 2 == 0) for n in range(6))
    assert (found.part, found.of) == (3, 6)
    assert (found.low, found.high) == pytest.approx(wilson_interval(1.5, 3))


def test_a_crash_that_weighs_much_leaves_few() -> None:
    """Weights 3 and 1 are worth (3 + 1)^2 / (9 + 1) = 1.6 crashes (Kish)."""
    found = clustered_share([("2023-1", True), ("2023-2", False)], {"2023-1": 3.0})
    assert found.part / found.of == 0.75
    assert (found.low, found.high) == pytest.approx(wilson_interval(1.2, 1.6))


def test_no_runs_are_no_error() -> None:
    assert clustered_share([])[:3] == (0, 0, 0)
