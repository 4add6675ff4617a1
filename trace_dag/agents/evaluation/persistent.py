"""Traffic that keeps the conflict: an agent cannot avoid it by driving slower or faster.

All others follow their recorded paths on one clock, which is tied to the agent's progress to the place of its recorded
conflict, so that they are there when the agent is. Among themselves they stay as recorded. The clock is the recorded
one while the agent's vehicle is where it was recorded. From its last moment to react on, the agent has no more
influence on the clock.

The clock depends on the party that the agent met: one whose path crosses or meets its own (:func:`pace_to_meet`), one
that it follows (:func:`pace_ahead`), or a person (:func:`pace_on_foot`).
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import Final, NamedTuple

import numpy as np

from trace_dag.agents.evaluation.traffic import Recording
from trace_dag.common.units import GRAVITY_MPS2
from trace_dag.reconstruction.motion.speeds import BRAKING_MPS2
from trace_dag.scenario.cases import Case
from trace_dag.scenario.conflicts import is_ahead
from trace_dag.scenario.progress import FASTEST_PACE, RecordedWay, contact_with
from trace_dag.simulation.driving import BodyState, Driver, Pace, PlanClock
from trace_dag.simulation.types import BodyKind
from trace_dag.simulation.vehicles import vehicle_model

REACTION_S: Final = 0.75
BRAKING_G: Final = 0.774
"""Figures of the careful and competent human driver: UN Regulation No. 157, annex 3, performance model 1."""

FASTEST_ON_FOOT: Final = 1.5
"""Range for people on foot: from usual to fast walking, 1.4 to 2.1 m/s (Bohannon, Age and Ageing 26, 1997)."""
_CATCHES_UP_S: Final = 2.0
_WAITS_S: Final = 0.5
"""A person too early by so much stands still; by less it slows down: it does not start and stop all the time."""
_CYCLISTS_MPS2: Final = 1.0
_AT_LEAST_MPS: Final = 1.0  # shares of a slower speed say nothing
_STANDS: Final = 1e-3
_WALKS: Final = frozenset({BodyKind.PEDESTRIAN, BodyKind.ANIMAL})


class Approach(NamedTuple):
    """An agent on its way to the conflict.

    It has the recorded time of the agent's place (s), its speed as a multiple of the recorded speed, and the time to
    the conflict at that speed (s, negative beyond it).
    """

    recorded_s: float
    pace: float
    left_s: float


def pace_to_meet(left_s: float, agent_left_s: float, most_per_s: float) -> float:
    """Return the present pace of a party that needs ``left_s`` as recorded but has ``agent_left_s``.

    Its pace changes evenly by at most ``most_per_s`` each second, and returns to the recorded pace at the conflict, or
    as near to it as possible.

    >>> pace_to_meet(4.0, 4.0, 0.2), round(pace_to_meet(4.0, 5.0, 0.2), 6)
    (1.0, 0.6)
    """
    mean = left_s / agent_left_s
    last = 1.0 if mean >= 1.0 else min(1.0, mean + most_per_s * agent_left_s / 2)
    return min(max(2 * mean - last, 0.0), FASTEST_PACE)


def pace_ahead(clock_s: float, agent: Approach) -> float:
    """Return the pace of a party that drives ahead of the agent.

    It is the agent's own pace, so that the headway at each place is as recorded.

    >>> pace_ahead(3.0, Approach(recorded_s=3.0, pace=0.6, left_s=5.0))
    0.6
    """
    return min(max(agent.pace + (agent.recorded_s - clock_s) / _CATCHES_UP_S, 0.0), FASTEST_PACE)


def pace_on_foot(left_s: float, agent_left_s: float) -> float:
    """Return the pace of a person, matched to the agent's time.

    The person hurries if the agent is earlier than recorded, and slows down and waits if it is later.

    >>> pace_on_foot(2.0, 3.0), pace_on_foot(2.0, 2.25), pace_on_foot(2.0, 2.0), pace_on_foot(2.0, 1.6)
    (0.0, 0.5, 1.0, 1.25)
    """
    if agent_left_s < left_s:
        return pace_in_step(left_s, agent_left_s)
    return max(1.0 - (agent_left_s - left_s) / _WAITS_S, 0.0)


def pace_in_step(left_s: float, agent_left_s: float) -> float:
    """Return the constant pace at which a person reaches the conflict with the agent, within the fastest pace.

    >>> pace_in_step(2.0, 2.5), pace_in_step(2.0, 1.0)
    (0.8, 1.5)
    """
    return min(max(left_s / agent_left_s, 0.0), FASTEST_ON_FOOT)


def last_moment_s(speed_mps: float, friction: float) -> float:
    """Return the time before the conflict after which an attentive human can no longer stop short of it, s.

    Behind a party ahead, pass the closing speed.

    >>> round(last_moment_s(20.0, 0.8), 2)
    2.07
    """
    return REACTION_S + speed_mps / (2 * min(BRAKING_G, friction) * GRAVITY_MPS2)


class KeptConflict:
    """The clock of all parties but the agent, which drives participant ``ego``."""

    def __init__(self, case: Case, ego: int) -> None:
        self._ego, self._friction = ego, case.friction
        self._recording = Recording(case, ego)
        self._way = RecordedWay(case, ego)
        self._follower = self._way.follower()
        self._clock = PlanClock()
        self._looked_s = 0.0
        self._goes_on_per_s: float | None = None  # how the pace changes after the agent's last moment to react
        other = find_met_party(case, ego)
        self._other = None if other is None else RecordedWay(case, other)
        self._is_ahead = other is not None and _is_ahead(case, ego, other, self._way.conflict_s)
        body = None if other is None else case.bodies[other]
        self._walks = body is not None and body.kind in _WALKS
        is_driven = body is not None and not body.is_figure
        self._accelerates_mps2 = vehicle_model(body).max_acceleration_mps2 if is_driven else _CYCLISTS_MPS2

    def pace(self, time_s: float, states: Mapping[int, BodyState]) -> float:
        """Return the pace of all others from now on; calls at the same time give the same pace."""
        if self._other is not None and self._follower is not None and time_s > self._looked_s:
            at_m, _ = self._follower.locate(states[self._ego].x_m, states[self._ego].y_m)
            if self._recording.is_left(time_s, states):
                agent = self._approach(at_m, abs(states[self._ego].speed_mps))
                self._set_pace(time_s, time_s - self._looked_s, agent, self._other)
            self._looked_s = time_s
        return self._clock.pace

    def _approach(self, at_m: float, speed_mps: float) -> Approach:
        recorded_s = self._way.time_at(at_m)
        pace = speed_mps / max(self._way.speed_mps(recorded_s), _AT_LEAST_MPS)
        return Approach(recorded_s, pace, (self._way.conflict_s - recorded_s) / max(pace, _STANDS))

    def _set_pace(self, time_s: float, since_s: float, agent: Approach, other: RecordedWay) -> None:
        now_s, pace = self._clock.at(time_s), self._clock.pace
        left_s = self._way.conflict_s - now_s
        speed_mps = max(other.speed_mps(now_s), _AT_LEAST_MPS)
        most_per_s = self._accelerates_mps2 / speed_mps
        if self._goes_on_per_s is None and agent.left_s <= self._last_moment_s(agent, pace * other.speed_mps(now_s)):
            evenly_per_s = max(1.0 - pace, 0.0) / max(agent.left_s, since_s)
            self._goes_on_per_s = 0.0 if self._is_ahead or self._walks else min(evenly_per_s, most_per_s)
            if self._walks:
                pace = pace_in_step(left_s, max(agent.left_s, since_s))
        if self._goes_on_per_s is not None:
            wanted = pace + self._goes_on_per_s * since_s if pace < 1.0 else pace
        else:
            wanted = self._wanted(now_s, left_s, agent, most_per_s)
        if not self._walks:
            slower, faster = BRAKING_MPS2 / speed_mps * since_s, most_per_s * since_s
            wanted = min(max(wanted, pace - slower), pace + faster)
        self._clock.set_pace(time_s, wanted)

    def _wanted(self, now_s: float, left_s: float, agent: Approach, most_per_s: float) -> float:
        if self._is_ahead:
            return pace_ahead(now_s, agent)
        if self._walks:
            return pace_on_foot(left_s, agent.left_s)
        return pace_to_meet(left_s, agent.left_s, most_per_s) if left_s > 0 else 1.0

    def _last_moment_s(self, agent: Approach, others_mps: float) -> float:
        speed_mps = agent.pace * max(self._way.speed_mps(agent.recorded_s), _AT_LEAST_MPS)
        return last_moment_s(max(speed_mps - others_mps, 0.0) if self._is_ahead else speed_mps, self._friction)


class BoundDriver:
    """A recorded driver or person on the clock of a kept conflict: a :class:`trace_dag.simulation.driving.Driver`."""

    def __init__(self, conflict: KeptConflict, period_s: float) -> None:
        self.period_s = period_s
        self.has_arrived = True
        self._conflict = conflict

    def drive(self, time_s: float, states: Mapping[int, BodyState]) -> Pace:
        return Pace(self._conflict.pace(time_s, states))


def persistent_drivers(case: Case, ego: int, *, period_s: float) -> dict[int, Driver]:
    """Return drivers, by number, that keep the agent's conflict, for all parties but the agent.

    A vehicle that skids or loses control does so as recorded.
    """
    conflict = KeptConflict(case, ego)
    return {
        each.number: BoundDriver(conflict, period_s)
        for each in case.going_on
        if each.number != ego
        and each.number not in case.parked
        and math.isinf(each.skids_from_s)
        and not each.losses_of_control
    }


def find_met_party(case: Case, number: int) -> int | None:
    """Return the participant that another first met in the recorded crash, or in the plan of a near miss.

    None if it met nobody.
    """
    contact = contact_with(case, number)
    pair = (contact.number_1, contact.number_2) if contact is not None else case.pair
    other = next((each for each in pair if each != number), None) if number in pair else None
    return other if any(each.number == other for each in case.participants) else None


def _is_ahead(case: Case, ego: int, other: int, conflict_s: float) -> bool:
    """Return whether another party travels the agent's path in front of it when they meet."""
    one, two = (
        (
            float(np.interp(conflict_s, plan.time_s, plan.x_m)),
            float(np.interp(conflict_s, plan.time_s, plan.y_m)),
            float(np.interp(conflict_s, plan.time_s, np.unwrap(plan.heading_rad))),
        )
        for plan in (case.participant(number).trajectory for number in (ego, other))
    )
    return is_ahead(one, two)
