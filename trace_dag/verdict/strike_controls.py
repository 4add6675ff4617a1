"""Negative controls of crashes with people: another person's report, the person late, and the side mirrored.

As of two vehicles (:mod:`trace_dag.verdict.controls`), judged by the same rules as the true pairing. Whoever goes along
the road is in the vehicle's way a little later as well: such a person comes so late that the two meet ten metres away.
"""

from __future__ import annotations

import math
from dataclasses import replace
from typing import Final

import numpy as np

from trace_dag.crash.crash_types import turn_of
from trace_dag.crash.parties import PartyKind, person_party
from trace_dag.crash.record import CrashRecord
from trace_dag.crash.strikes import strikes_of
from trace_dag.crash.zones import reported_zones
from trace_dag.settings import VerdictSettings
from trace_dag.states.courses import COMPASS_DEG, CROSSING, told_courses
from trace_dag.states.types import Hypothesis, Manoeuvre, ParticipantState
from trace_dag.verdict.controls import LEAST_SHIFT_S, STANDING_MPS, Shift, delayed
from trace_dag.verdict.directions import reported_turns_deg
from trace_dag.verdict.metrics import clock_error_h

_CROSSES: Final = frozenset({Manoeuvre.CROSS_FROM_LEFT, Manoeuvre.CROSS_FROM_RIGHT})
_STANDING_MPS: Final = 0.3
_MISS_BY_M: Final = 10.0


def in_place_of(other: CrashRecord, own: CrashRecord) -> CrashRecord | None:
    """The other report with its parties numbered as the own one's; None where as many strikes do not correspond.

    >>> same = in_place_of(pedestrian_record, pedestrian_record)
    >>> same.non_motorists[0].number, in_place_of(record, pedestrian_record)  # that one tells of no strike
    (1, None)
    """
    theirs, ours = strikes_of(other), strikes_of(own)
    if not theirs or len(theirs) != len(ours):
        return None
    pairs = [(their.pair, our.pair) for their, our in zip(theirs, ours, strict=True)]
    renamed = {old: new for their, our in pairs for old, new in zip(their, our, strict=True)}
    if len(set(renamed.values())) != len(renamed):
        return None
    vehicles = tuple(replace(strike.vehicle, number=renamed[strike.vehicle.number]) for strike in theirs)
    persons = {strike.person.party: strike.person for strike in theirs}
    # A report may list a strike and not the person: then the event names nobody.
    struck = {number: strike.person.party for strike in theirs for number in (strike.event_number, *strike.going_on)}
    events = tuple(
        replace(
            event,
            party_1=renamed.get(event.party_1 or 0),
            party_2=renamed.get(struck.get(event.number, event.party_2) or 0, event.party_2),
        )
        for event in other.events
    )
    return replace(
        other,
        vehicles=tuple({vehicle.number: vehicle for vehicle in vehicles}.values()),
        vehicles_in_transport=None,
        non_motorists=tuple(
            replace(person, number=renamed[party] - person_party(0))
            for party, person in persons.items()
            if person.kind is not PartyKind.ANIMAL  # those follow from the events
        ),
        events=events,
    )


def strikes_differ(one: CrashRecord, two: CrashRecord, settings: VerdictSettings) -> bool:
    """Whether two reports contradict each other in an area of impact by more than the threshold, in a turn, in the
    course, zone or compass direction of the person: else no simulation of the one can be told from one of the other.
    """
    for mine, other in zip(strikes_of(one), strikes_of(two), strict=True):
        apart_h = clock_error_h(mine.area.clock_h, other.area) if mine.area else None
        if apart_h is not None and apart_h > settings.max_clock_error_h:
            return True
        if _apart(reported_turns_deg(mine.vehicle), reported_turns_deg(other.vehicle)):
            return True
        courses = (told_courses(strike.person, turn_of(strike.vehicle)) for strike in (mine, other))
        if _apart(*courses):
            return True
        if _apart(reported_zones(one, mine.person), reported_zones(two, other.person)):
            return True
        codes = ("pedestrian_direction_code", "motorist_direction_code")
        if any(_opposite(getattr(mine.person, code), getattr(other.person, code)) for code in codes):
            return True
    return False


def _apart(one: frozenset[object], two: frozenset[object]) -> bool:
    return bool(one and two and not one & two)


def _opposite(one: int | None, two: int | None) -> bool:
    """Whether two compass directions are opposite: neighbouring ones can both be said of the same road."""
    if one not in COMPASS_DEG or two not in COMPASS_DEG:
        return False
    assert one is not None
    assert two is not None
    return abs(math.remainder(COMPASS_DEG[one] - COMPASS_DEG[two], 360.0)) > 135.0


def late_person(hypothesis: Hypothesis) -> Shift | None:
    """The hypothesis with its first person late: two seconds if it crosses, longer if it goes along the road; None if
    the person or the vehicle stands where they meet.

    >>> shift = late_person(judged_pedestrian.hypothesis)  # he crosses the road
    >>> shift.vehicle_number, shift.shift_s
    (1001, 2.0)
    """
    person = _first_person(hypothesis)
    if person is None or abs(person.impact_speed_mps) < _STANDING_MPS:
        return None
    striking = hypothesis.planned[0].party_1
    vehicle = next(state for state in hypothesis.participants if state.vehicle_number == striking)
    if abs(vehicle.impact_speed_mps) < STANDING_MPS:
        return None
    shift_s = LEAST_SHIFT_S
    if person.manoeuvre not in _CROSSES:
        shift_s = max(shift_s, (_MISS_BY_M + (person.length_m + vehicle.length_m) / 2) / abs(person.impact_speed_mps))
    return _with(hypothesis, delayed(person, shift_s), shift_s)


def mirrored(record: CrashRecord, hypothesis: Hypothesis) -> Shift | None:
    """The hypothesis with its first person coming from the other side; None where the report does not say the side.

    The person's motion is mirrored at the line along which the vehicle strikes it.
    """
    (strike, *_) = strikes_of(record) or (None,)
    person = _first_person(hypothesis)
    if strike is None or person is None:
        return None
    told = told_courses(strike.person, turn_of(strike.vehicle))
    if len(told) != 1 or not told <= CROSSING or abs(person.impact_speed_mps) < _STANDING_MPS:
        return None
    vehicle = next(each for each in hypothesis.participants if each.vehicle_number == strike.vehicle.number)
    axis, at = vehicle.impact_pose.heading_rad, person.impact_pose

    def pose_mirrored(x: np.ndarray, y: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        c, s = math.cos(axis), math.sin(axis)
        ahead, left = (x - at.x_m) * c + (y - at.y_m) * s, (y - at.y_m) * c - (x - at.x_m) * s
        return at.x_m + ahead * c + left * s, at.y_m + ahead * s - left * c

    t = person.trajectory
    x, y = pose_mirrored(t.x_m, t.y_m)
    heading = 2 * axis - t.heading_rad
    start = replace(
        person.initial_pose, x_m=float(x[0]), y_m=float(y[0]), heading_rad=math.remainder(float(heading[0]), math.tau)
    )
    moved = replace(person, initial_pose=start, trajectory=replace(t, x_m=x, y_m=y, heading_rad=heading))
    return _with(hypothesis, moved, 0.0)


def _first_person(hypothesis: Hypothesis) -> ParticipantState | None:
    """The person of the first planned strike."""
    if not hypothesis.planned:
        return None
    number = hypothesis.planned[0].party_2
    return next((state for state in hypothesis.participants if state.vehicle_number == number), None)


def _with(hypothesis: Hypothesis, person: ParticipantState, shift_s: float) -> Shift:
    states = tuple(
        person if state.vehicle_number == person.vehicle_number else state for state in hypothesis.participants
    )
    return Shift(replace(hypothesis, participants=states), person.vehicle_number, shift_s)
