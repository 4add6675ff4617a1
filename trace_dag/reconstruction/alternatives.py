"""Sentences on other possible courses: the sides from which the parties come in the likeliest hypotheses.

A report seldom names the side from which a vehicle came. The share of a side is its posterior probability; the sum
lacks the sides that were not kept and hypotheses that were not considered.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Final

import numpy as np

from trace_dag.common.messages.wording import count_of
from trace_dag.common.units import wrap_angle
from trace_dag.crash.parties import party_in_words
from trace_dag.reconstruction.ranking import ambiguity, first_of_groups, likelihood
from trace_dag.simulation.states import Hypothesis, ParticipantState, StateEstimate

_GUESSED: Final = 0.25
"""Ambiguity above which other sides are named: one in four is too many not to know of."""
_UNSURE: Final = 0.5
"""Ambiguity above which the best hypothesis is more likely wrong than right."""
_MOVED_M: Final = 2.0  # of travel, from which on a course is known
_LEAST_SHARE: Final = 0.05  # of an approach that is named
_SAME_APPROACH_RAD: Final = math.radians(45)
_OCTANTS: Final = ("east", "north-east", "north", "north-west", "west", "south-west", "south", "south-east")


@dataclass(frozen=True)
class Approached:
    """The share (0 to 1) of the likely courses in which a party comes from one side, an octant of the compass."""

    party: int
    side: str
    share: float


@dataclass(frozen=True)
class Alternatives:
    """Other likely courses as a clause, and the shares of each side from which a party can have come.

    None if the other courses differ only in lanes or speeds.
    """

    clause: str
    sides: tuple[Approached, ...] = ()


def alternatives(estimate: StateEstimate) -> Alternatives | None:
    """Return other possible courses, or None.

    These are other sides with a total share of a quarter or more, or other courses from the same sides with half or
    more.

    >>> from dataclasses import replace
    >>> alternatives(replace(state_estimate, ambiguity=0.63)).clause.split(":")[0]
    '2 other courses, in other lanes or at other speeds, have 63 % together'
    """
    if estimate.ambiguity <= _GUESSED:
        return None
    clauses: list[str] = []
    sides: list[Approached] = []
    for state in estimate.best.participants:
        possible = _approaches(estimate, state.vehicle_number)
        if len(possible) > 1:
            named = [f"from the {each.side} ({100 * each.share:.0f} %)" for each in possible]
            clauses.append(f"{party_in_words(state.vehicle_number)} {' or '.join(named)}")
            sides += possible
    if clauses:
        return Alternatives(f"{'; '.join(clauses)}: the report does not say", tuple(sides))
    if estimate.ambiguity <= _UNSURE:
        return None
    others = count_of(len(estimate.hypotheses) - 1, "other course")
    share = f"{100 * estimate.ambiguity:.0f} % together"
    have = "has" if len(estimate.hypotheses) == 2 else "have"
    return Alternatives(f"{others}, in other lanes or at other speeds, {have} {share}: the report does not say")


def ambiguity_of(hypotheses: Sequence[Hypothesis]) -> float:
    """Return the posterior share of sides other than those of the first hypothesis, 0 to 1."""
    best = hypotheses[0].score
    return ambiguity(best, (min(each.score, best) for each in first_of_groups(hypotheses, _sides)))


def _sides(hypothesis: Hypothesis) -> tuple[tuple[int, int | None], ...]:
    """Return the compass octant from which each party comes; None for a standing one."""
    bearings = {state.vehicle_number: bearing_from_rad(state) for state in hypothesis.participants}
    return tuple(
        (number, None if bearing is None else _octant(bearing)) for number, bearing in sorted(bearings.items())
    )


def _octant(bearing_rad: float) -> int:
    return round(bearing_rad / (math.pi / 4)) % len(_OCTANTS)


def _approaches(estimate: StateEstimate, number: int) -> list[Approached]:
    """Return the sides from which a party can have come, the likeliest first.

    Directions less than 45 degrees apart count as one side. Hypotheses from the same sides have the share of their
    first.
    """
    shares: list[tuple[float, float]] = []  # bearing (rad), share
    for each in first_of_groups(estimate.hypotheses, _sides):
        share = (1.0 - estimate.ambiguity) * min(likelihood(each.score, estimate.best.score), 1.0)
        for state in each.participants:
            bearing = bearing_from_rad(state) if state.vehicle_number == number else None
            if bearing is None:
                continue
            same = next(
                (i for i, (b, _) in enumerate(shares) if abs(wrap_angle(b - bearing)) < _SAME_APPROACH_RAD), None
            )
            if same is None:
                shares.append((bearing, share))
            else:
                shares[same] = (shares[same][0], shares[same][1] + share)
    likely = sorted((each for each in shares if each[1] >= _LEAST_SHARE), key=lambda each: -round(each[1], 6))
    return [Approached(number, _OCTANTS[_octant(bearing)], round(share, 4)) for bearing, share in likely]


def bearing_from_rad(state: ParticipantState) -> float | None:
    """Return the direction from which a party comes (rad, counter-clockwise from east); None if it stands.

    >>> [round(math.degrees(bearing_from_rad(each))) for each in hypothesis.participants]
    [-173, 7]
    """
    path = state.trajectory
    gone_m = np.hypot(path.x_m - path.x_m[0], path.y_m - path.y_m[0])
    far = np.flatnonzero(gone_m >= _MOVED_M)
    if not len(far):
        return None
    k = far[0]
    return math.atan2(float(path.y_m[0] - path.y_m[k]), float(path.x_m[0] - path.x_m[k]))
