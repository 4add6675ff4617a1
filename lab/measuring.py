"""Figures of a measure: medians of several runs, ours and the peer's by turns.

Times are CPU seconds (of this process and its ended children), which other work on the machine disturbs less than the
clock on the wall does; figures of wall time are marked.
"""

from __future__ import annotations

import os
import resource
import statistics
import time
from collections.abc import Callable, Iterable
from dataclasses import dataclass, field
from pathlib import Path

SHARED = Path(os.environ.get("TRACE_DAG_SHARED", Path(__file__).resolve().parents[2] / "shared")) / "data"


@dataclass(frozen=True)
class Figure:
    """One measured figure. ``peer_value`` has the same unit; ``ratio`` is ours to the peer's.

    ``goal`` is what the figure (or, if ``goal_of_ratio``, the ratio) must not exceed, or must reach if ``at_least``.
    With ``hidden`` it belongs to the table of calibration: so many things were hidden, the value is the share that came
    back, the peer's is chance, and ``asked`` has the shares of language models by their names.
    """

    name: str
    value: float
    unit: str
    peer: str = ""
    peer_value: float | None = None
    goal: float | None = None
    at_least: bool = False
    goal_of_ratio: bool = False
    note: str = ""
    hidden: int | None = None
    asked: dict[str, float] = field(default_factory=dict)

    @property
    def ratio(self) -> float | None:
        """Return the ratio of our time to the peer's."""
        return self.value / self.peer_value if self.peer_value else None

    @property
    def reached(self) -> bool | None:
        """Return whether the goal is reached; None without one."""
        judged = self.ratio if self.goal_of_ratio else self.value
        if self.goal is None or judged is None:
            return None
        return judged >= self.goal if self.at_least else judged <= self.goal


Work = Callable[[], object]


def cpu_s() -> float:
    """Return the CPU time so far of this process and of its children that have ended."""
    used = [resource.getrusage(who) for who in (resource.RUSAGE_SELF, resource.RUSAGE_CHILDREN)]
    return sum(each.ru_utime + each.ru_stime for each in used)


def medians(runs: int, *works: Work, clock: Callable[[], float] = cpu_s) -> list[float]:
    """Return the median seconds of each of some works, done by turns so that all meet the same machine."""
    taken: list[list[float]] = [[] for _ in works]
    for _ in range(runs):
        for number, work in enumerate(works):
            began = clock()
            work()
            taken[number].append(clock() - began)
    return [statistics.median(each) for each in taken]


def wall_s() -> float:
    """Return the clock on the wall."""
    return time.perf_counter()


def exit_code(figures: Iterable[Figure]) -> int:
    """Return the exit code of a command that measured figures: 1 if a goal is missed."""
    return 1 if any(figure.reached is False for figure in figures) else 0
