"""Measures of the lab: their ratios and goals, and that each can be loaded."""

from __future__ import annotations

from importlib import import_module
from pathlib import Path

import pytest

import lab
from lab.measuring import Figure, medians


@pytest.mark.parametrize(
    ("figure", "reached"),
    [
        (Figure("time", 0.5, "s", goal=1.0), True),
        (Figure("time", 1.5, "s", goal=1.0), False),
        (Figure("rate", 150.0, "1/min", goal=200.0, at_least=True), False),
        (Figure("two", 180.0, "1/min", "one", 100.0, 1.7, at_least=True, goal_of_ratio=True), True),
        (Figure("no goal", 1.0, "s"), None),
    ],
)
def test_goals(figure, reached):
    assert figure.reached is reached


def test_every_benchmark_can_be_loaded():
    """No test runs them: one that asks for what the program no longer has would be found when it is needed."""
    names = [file.stem for file in Path(lab.__file__).parent.glob("*.py") if file.stem != "__main__"]
    assert "kills" in names
    for name in names:
        import_module(f"lab.{name}")


def test_work_and_its_peer_take_turns():
    done, moments = [], iter(range(100))
    both = medians(3, lambda: done.append("ours"), lambda: done.append("peer"), clock=lambda: float(next(moments)))
    assert done == ["ours", "peer"] * 3
    assert both == [1.0, 1.0]
