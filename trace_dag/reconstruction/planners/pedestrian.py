"""A vehicle strikes a person or an animal: as the first event of a crash, or later, where a person lies on the road.

A person who is struck again lies where the strike before threw them. The next vehicle is led over the place once the
person has come to rest there. A driver whom another one follows stops at the side, or else in the lane: wherever the
other one gets past."""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from dataclasses import replace
from itertools import takewhile
from typing import Final

import numpy as np

from trace_dag.common.errors import Reason, Rejection
from trace_dag.common.geometry import FloatArray, Pose
from trace_dag.common.messages.wording import count_of
from trace_dag.common.settings import StateSettings
from trace_dag.crash.animals import Pace, Species, StruckAnimal
from trace_dag.crash.event_sequence import CrashEvent, EventSequence
from trace_dag.reconstruction.course import Course, Plan, Search
from trace_dag.reconstruction.motion.walking_directions import CROSSING
from trace_dag.reconstruction.motion.walking_directions import Course as Walking
from trace_dag.reconstruction.planners.pedestrian_impact.hypothesis import (
    ROOM_M,
    first_states,
    impact_hypothesis,
    later_state,
    least_gap_m,
    next_way,
)
from trace_dag.reconstruction.planners.pedestrian_impact.planner import MANOEUVRES, ImpactPlan, edge_of, impact_plans
from trace_dag.reconstruction.ranking import drawn, leaders_first
from trace_dag.reconstruction.scene.scene import Scene
from trace_dag.roads.map.network import RoadNetwork
from trace_dag.simulation.states import Hypothesis, Manoeuvre

LONGEST_CHAIN_S: Final = 12.0
"""From the first strike to the last."""
_SETTLES_S: Final = 1.0  # after a thrown person has come to rest
_RESTS_M: Final = 0.05  # nearer to where it ends up, a person is at rest
_FAR: Final = 50.0  # of log-likelihoods
_CROSSES: Final = frozenset({Manoeuvre.CROSS_FROM_LEFT, Manoeuvre.CROSS_FROM_RIGHT})
_AT_THE_EDGE_S: Final = 1.0
_LONGEST_LEAD_S: Final = 12.0
_LATER_S: Final = (0.0, 2.0, 4.0, 6.0, 8.0)  # a slower vehicle comes so much later, else it would be in the way


def assume_animal(sequence: EventSequence, settings: StateSettings) -> EventSequence:
    """Return the sequence with what the settings say of an animal.

    >>> from trace_dag.crash.event_sequence import sequence_of
    >>> sequence = sequence_of(pedestrian_record)
    >>> assume_animal(sequence, StateSettings()) == sequence  # there is none
    True
    """

    def assumed(event: CrashEvent) -> CrashEvent:
        if not isinstance(event.partner, StruckAnimal):
            return event
        animal = replace(event.partner, species=Species(settings.animal), pace=Pace(settings.animal_pace))
        return replace(event, partner=animal)

    return replace(sequence, events=tuple(map(assumed, sequence.events)))


def companions_of(sequence: EventSequence) -> tuple[CrashEvent, ...]:
    """Return the strikes that follow the first at once, by the same vehicle: of who goes beside the first person.

    >>> from trace_dag.crash.event_sequence import sequence_of
    >>> companions_of(sequence_of(pedestrian_record))
    ()
    """
    first, *rest = sequence.events
    own = takewhile(lambda e: e.kind is first.kind and e.vehicle.number == first.vehicle.number, rest)
    return tuple(own)


def strike_hypotheses(
    scene: Scene, sequence: EventSequence, settings: StateSettings, *, most: int
) -> tuple[Hypothesis, ...]:
    """Return the ranked hypotheses of a first strike, at most so many.

    If another vehicle comes later there are two of each name: the driver stops at the side, or in the lane.

    Raises :class:`Rejection` (``no_feasible_state``) where no way of the vehicle leads it to them as reported.
    """
    first, together = sequence.first, companions_of(sequence)
    followed = any(event.is_contact and event.vehicle.number != first.vehicle.number for event in sequence.events)
    plans = leaders_first(impact_plans(scene, first), lambda plan: plan.group)
    shown = _drawn_course(scene.record.key, plans)
    plans = sorted(plans, key=lambda plan: plan.walk.reading.course is not shown)
    found: list[Hypothesis] = []
    kept = 0
    for plan in plans:
        made = []
        for pulls_over in (True, False) if followed else (False,):
            states = first_states(scene, plan, together, settings.lead_time_s, pulls_over=pulls_over)
            made.append(impact_hypothesis(plan, states, together, settings.lead_time_s))
        if all(check.passed for check in made[0].checks):
            found += made
            kept += 1
        if kept == most:
            break
    if not found:
        examined = f" in any of {count_of(len(plans), 'plan')} examined" if plans else ""
        why = scene.no_way_that(f"leads the vehicle to whom it struck as reported{examined}")
        raise Rejection(Reason.NO_FEASIBLE_STATE, why, measured=len(plans))
    first_shown = None if shown is None else MANOEUVRES[shown]
    return tuple(sorted(found, key=lambda each: (_walks(each, first) is not first_shown, -each.score, each.name)))


def _drawn_course(key: str, plans: Sequence[ImpactPlan]) -> Walking | None:
    """Return the course of the person that is shown.

    That of the likeliest plan, but of two that cross from either side one that is drawn by their shares, so that over
    many crashes the sides come as often as they are likely.
    """
    best = {plan.walk.reading.course: plan.score for plan in sorted(plans, key=lambda plan: plan.score)}
    if not best:
        return None
    likeliest = max(best, key=lambda course: (best[course], course))
    if likeliest not in CROSSING or not best.keys() >= CROSSING:
        return likeliest
    left, right = best[Walking.FROM_LEFT], best[Walking.FROM_RIGHT]
    share = 1.0 / (1.0 + math.exp(min(right - left, _FAR)))
    return Walking.FROM_LEFT if drawn(key, "side of the person") < share else Walking.FROM_RIGHT


def _walks(hypothesis: Hypothesis, strike: CrashEvent) -> Manoeuvre:
    """Return the motions of the person of a strike in a hypothesis."""
    return next(s.manoeuvre for s in hypothesis.participants if s.vehicle_number == strike.person.party)


def crossing_lead_s(network: RoadNetwork, hypothesis: Hypothesis) -> float:
    """Return how long before the strike (s) the reconstruction has to begin, 0 where nobody crosses.

    Nobody who crosses then begins in a lane.
    """
    longest_s = 0.0
    for state in hypothesis.participants:
        start, at = state.initial_pose, state.impact_pose
        if state.manoeuvre not in _CROSSES or not network.drivable_area.has(start.x_m, start.y_m):
            continue
        back = Pose(at.x_m, at.y_m, at.heading_rad + math.pi / 2)
        from_m = edge_of(network.drivable_area, back, 1.0)
        longest_s = max(longest_s, from_m / state.impact_speed_mps + _AT_THE_EDGE_S if from_m else 0.0)
    return round(min(longest_s, _LONGEST_LEAD_S), 1)


# --- later -----------------------------------------------------------------------------------------------------------
def lying_plans(search: Search, course: Course, event: CrashEvent) -> Iterator[Plan | str]:
    """Yield the ways of one more vehicle over a person who was struck before, each later than the one before it."""
    number = event.person.party
    struck = next((each for each in course.log.contacts if each.number_2 == number), None)
    if struck is None:
        yield f"person {event.person.number} was not struck before"
        return
    lies_at, at_rest_s = _comes_to_lie(course, number)
    for wait_s in _LATER_S:
        at_s = at_rest_s + _SETTLES_S + wait_s
        found = next_way(search.scene, event, lies_at, struck.pose_1.heading_rad, at_s)
        if found is None or at_s > search.lead_s + LONGEST_CHAIN_S:
            if not wait_s:
                yield f"no way of vehicle {event.vehicle.number} leads over the person who lies there in time"
            return
        state = later_state(search.scene, found)
        if min(least_gap_m(state, each, search.lead_s) for each in course.states) <= ROOM_M:
            continue
        terms = {f"way of the next vehicle (vehicle {event.vehicle.number})": round(found.score, 6)}
        yield Plan((*course.states, state), course.objects, found.name, found.score, terms)


def _comes_to_lie(course: Course, number: int) -> tuple[FloatArray, float]:
    """Return where a person ends up (x, y, m), and since when it lies there (s)."""
    person = course.log.vehicle_log(number)
    away_m = np.hypot(person.x_m - person.x_m[-1], person.y_m - person.y_m[-1])
    moving = np.flatnonzero(away_m > _RESTS_M)
    at_rest_s = float(person.time_s[moving[-1]]) if len(moving) else 0.0
    last_s = max((each.time_s for each in course.matching.matched if each is not None), default=0.0)
    return np.array([person.x_m[-1], person.y_m[-1]]), max(at_rest_s, last_s)
