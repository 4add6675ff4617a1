"""Negative controls: the rate at which verdicts accept wrong reports.

A tolerance of two clock positions lets a random impact pass with 42 % per vehicle, so the value of an acceptance must
be measured. A simulation is judged by the same rules against changed reports: those of other crashes (with its own
place, since another place is miles away and would prove nothing), and its own with an event dropped or two swapped.
Equal reports cannot be distinguished, so each row states whether the two differ. Changed plans are in
:mod:`trace_dag.verdict.changed_plans`.
"""

from __future__ import annotations

import math
from collections.abc import Hashable, Iterable, Iterator
from dataclasses import dataclass, replace
from functools import cached_property
from itertools import pairwise

from trace_dag.common.errors import Reason, Rejection
from trace_dag.common.settings import VerdictSettings
from trace_dag.crash.crash_types import turn_of
from trace_dag.crash.event_sequence import CrashEvent, EventSequence, sequence_of
from trace_dag.crash.parties import EventKind, PartyKind, person_party, thing_party
from trace_dag.crash.record import CrashRecord, EventRecord, NonMotorist
from trace_dag.crash.road_departure import departure_of
from trace_dag.crash.zones import reported_zones
from trace_dag.reconstruction.motion.walking import COMPASS_DEG, reported_directions
from trace_dag.roads.map.network import RoadNetwork
from trace_dag.roads.map.roadside import RoadZone
from trace_dag.simulation.states import Hypothesis
from trace_dag.simulation.types import SimulationLog
from trace_dag.verdict.directions import reported_relations_deg, reported_turns_deg
from trace_dag.verdict.judge import judge_observed
from trace_dag.verdict.metrics import clock_error_positions, reported_zone
from trace_dag.verdict.observation import ObservedCrash, observe_crash
from trace_dag.verdict.types import Verdict


@dataclass(frozen=True, eq=False)
class JudgedCrash:
    """A crash with the hypothesis that its verdict judges."""

    record: CrashRecord
    network: RoadNetwork
    hypothesis: Hypothesis
    log: SimulationLog

    @cached_property
    def observed(self) -> ObservedCrash:
        """Return the observation of its simulation."""
        return observe_crash(self.network, self.hypothesis, self.log)

    @cached_property
    def sequence(self) -> EventSequence:
        """Return the events of its report."""
        return sequence_of(self.record)


@dataclass(frozen=True)
class ControlRow:
    """One judgement of a control.

    ``kind``: "true", "other_report", "shifted", "mirrored" (a person that comes from the other side than reported, a
    vehicle that leaves the road to it), "dropped" or "swapped" (of several contacts), or "moved" (an object, a parked
    vehicle); ``crash_kind`` is the crash's; ``verified`` is None if the control does not apply. Residuals are as in the
    verdict: the worst of all parties, None if not evaluated. ``speeds_kept``, beyond the paper's criteria: every
    reported speed is driven; None without a reported speed.
    """

    kind: str
    key: str
    other_key: str | None = None
    shifted_vehicle: int | None = None
    shift_s: float | None = None
    verified: bool | None = None
    reason: Reason | None = None
    contact_distance_m: float | None = None
    clock_error_max_positions: float | None = None
    direction_error_max_deg: float | None = None
    initial_speed_error_max_rel: float | None = None
    speeds_kept: bool | None = None
    detail: str = ""
    reports_differ: bool | None = None  # other_report: the two reports contradict each other
    crash_kind: str | None = None


def changed_reports(
    crash: JudgedCrash, others: Iterable[JudgedCrash], settings: VerdictSettings
) -> Iterator[ControlRow]:
    """Yield judgements of one simulation against other reports of its kind, and against its own with changed contacts.

    Each contact is dropped, and each two successive ones are swapped.

    >>> rows = changed_reports(judged_queue, [judged_queue, judged_collision], VerdictSettings())
    >>> [(row.kind, row.verified) for row in rows]
    [('dropped', False), ('dropped', False), ('swapped', False)]
    """
    for other in others:
        if other.record.key == crash.record.key or other.record.kind is not crash.record.kind:
            continue
        foreign = in_place_of(other.record, crash.record)
        if foreign is not None:
            verdict = judge_observed(foreign, crash.observed, settings)
            row = row_of("other_report", crash.record.key, verdict, other_key=other.record.key)
            yield replace(row, reports_differ=reports_differ(crash.record, foreign, settings))
    for kind, changed in (("dropped", drop_contact(crash.sequence)), ("swapped", swap_contacts(crash.sequence))):
        for sequence in changed:
            verdict = judge_observed(crash.record, crash.observed, settings, sequence=sequence)
            yield row_of(kind, crash.record.key, verdict)


def true_pairing(crash: JudgedCrash, settings: VerdictSettings) -> ControlRow:
    """Return the crash against its own report, for the rate beside the controls'."""
    return row_of("true", crash.record.key, judge_observed(crash.record, crash.observed, settings))


def row_of(kind: str, key: str, verdict: Verdict, other_key: str | None = None) -> ControlRow:
    """Return a judgement as a row.

    >>> row = row_of("true", record.key, verdict)
    >>> row.verified, round(row.clock_error_max_positions, 1), row.speeds_kept
    (True, 0.5, True)
    """
    return ControlRow(
        kind=kind,
        key=key,
        other_key=other_key,
        verified=verdict.verified,
        reason=verdict.reason,
        contact_distance_m=verdict.worst("contact_distance", "station_distance"),
        clock_error_max_positions=verdict.worst("clock_error"),
        direction_error_max_deg=verdict.worst("direction_error", "relation_error", "course_error"),
        initial_speed_error_max_rel=verdict.worst("initial_speed_error"),
        speeds_kept=verdict.all_hold("initial_speed_error"),
        detail=verdict.detail,
    )


# --- another crash's report ------------------------------------------------------------------------------------------
def in_place_of(other: CrashRecord, own: CrashRecord) -> CrashRecord | None:
    """Return the other report with parties and events numbered as in the own report.

    None if the events do not correspond.

    >>> same = in_place_of(queue_record, queue_record)
    >>> [vehicle.number for vehicle in same.vehicles], in_place_of(tree_record, queue_record)
    ([1, 2, 3], None)
    """
    try:
        theirs, ours = sequence_of(other), sequence_of(own)
    except Rejection:
        return None
    if _kinds(theirs) != _kinds(ours):
        return None
    later = ours.first.number - theirs.first.number
    taking_part, own_parties = _taking_part(theirs), _taking_part(ours)
    if len(taking_part) != len(own_parties):
        return None
    numbers = dict(zip(taking_part, own_parties, strict=True))
    unlisted = {
        event.number: numbers.get(event.party) for event in theirs.contacts if event.kind is EventKind.PERSON_STRUCK
    }

    def renumbered(event: EventRecord) -> EventRecord:
        one, two = numbers.get(event.party_1 or 0), numbers.get(event.party_2 or 0, unlisted.get(event.number))
        if event.party_2 == thing_party(event.number):
            two = thing_party(event.number + later)
        return replace(event, number=event.number + later, party_1=one, party_2=two)

    vehicles = tuple(replace(each, number=numbers[each.number]) for each in other.vehicles if each.number in numbers)
    persons = [event.partner for event in theirs.contacts if isinstance(event.partner, NonMotorist)]
    listed = {person.party: person for person in persons if person.kind is not PartyKind.ANIMAL}
    foreign = replace(
        other,
        vehicles=tuple(sorted(vehicles, key=lambda each: each.number)),
        vehicles_in_transport=None,
        non_motorists=tuple(_numbered(person, numbers[party]) for party, person in listed.items()),
        events=tuple(map(renumbered, other.events)),
    )
    try:
        sequence_of(foreign)
    except Rejection:
        return None
    return foreign


def _taking_part(sequence: EventSequence) -> list[int]:
    """Return numbers of the parties in the order in which they take part.

    They are those of the contacts, or else the vehicle of the first event.
    """
    events = sequence.contacts or (sequence.first,)
    both = [number for event in events for number in (event.vehicle.number, event.party)]
    return list(dict.fromkeys(both if sequence.contacts else both[:1]))


def _kinds(sequence: EventSequence) -> tuple[EventKind, list[EventKind]]:
    return sequence.first.kind, [event.kind for event in sequence.contacts]


def _numbered(person: NonMotorist, party: int) -> NonMotorist:
    return replace(person, number=party - person_party(0))


def reports_differ(one: CrashRecord, two: CrashRecord, settings: VerdictSettings) -> bool:
    """Return whether two reports, numbered alike, differ by more than the thresholds.

    The comparison covers parties, areas of impact, turns and courses, sides, parts of the road and kinds of object. If
    they do not differ, a simulation of one cannot be rejected against the other.

    >>> reports_differ(record, record, VerdictSettings())
    False
    """
    mine, theirs = sequence_of(one), sequence_of(two)
    events = zip(mine.contacts or (mine.first,), theirs.contacts or (theirs.first,), strict=False)
    if any(_events_differ(one, two, my, their, settings) for my, their in events):
        return True
    return not mine.contacts and _departures_differ(one, two, mine, theirs)


def _events_differ(
    one: CrashRecord, two: CrashRecord, mine: CrashEvent, other: CrashEvent, settings: VerdictSettings
) -> bool:
    if mine.is_contact and mine.pair != other.pair:
        return True
    theirs = {vehicle.number: vehicle for vehicle in other.vehicles}
    for vehicle in mine.vehicles:
        their = theirs.get(vehicle.number)
        if their is None or mine.kind is EventKind.OVERTURN:
            continue
        apart = clock_error_positions(vehicle.impact.clock_h, their.impact) if vehicle.impact else None
        if apart is not None and apart > settings.max_clock_error_positions:
            return True
        if mine.is_contact and _apart(reported_turns_deg(vehicle), reported_turns_deg(their)):
            return True
    if mine.kind is EventKind.VEHICLE_CONTACT:
        relations = (reported_relations_deg(of, *event.vehicles) for of, event in ((one, mine), (two, other)))
        return _apart(*relations)
    return mine.is_contact and _people_differ(one, two, mine, other)


def _people_differ(one: CrashRecord, two: CrashRecord, mine: CrashEvent, other: CrashEvent) -> bool:
    courses = (reported_directions(event.person, turn_of(event.vehicle)) for event in (mine, other))
    if _apart(*courses) or _apart(reported_zones(one, mine.person), reported_zones(two, other.person)):
        return True
    codes = ("pedestrian_direction_code", "motorist_direction_code")
    return any(_opposite(getattr(mine.person, code), getattr(other.person, code)) for code in codes)


def _departures_differ(one: CrashRecord, two: CrashRecord, mine: EventSequence, theirs: EventSequence) -> bool:
    left, other = departure_of(one, mine), departure_of(two, theirs)
    if left.side and other.side and left.side is not other.side:
        return True
    zones = reported_zone(one), reported_zone(two)
    if all(zones) and (zones[0] is RoadZone.ROADWAY) is not (zones[1] is RoadZone.ROADWAY):
        return True
    return mine.first.kind is EventKind.OBJECT_STRUCK and mine.first.code != theirs.first.code


def _apart(one: frozenset[Hashable], two: frozenset[Hashable]) -> bool:
    return bool(one and two and not one & two)


def _opposite(one: int | None, two: int | None) -> bool:
    """Return whether two compass directions are opposite; neighbouring ones can describe the same road."""
    if one not in COMPASS_DEG or two not in COMPASS_DEG:
        return False
    assert one is not None
    assert two is not None
    return abs(math.remainder(COMPASS_DEG[one] - COMPASS_DEG[two], 360.0)) > 135.0


# --- its own report, changed -----------------------------------------------------------------------------------------
def drop_contact(sequence: EventSequence) -> Iterator[EventSequence]:
    """Yield the sequence without one of its contacts, for each contact whose pair meets only once.

    >>> [[event.pair for event in left.events] for left in drop_contact(sequence_of(queue_record))]
    [[(2, 3)], [(1, 2)]]
    """
    pairs = [event.pair for event in sequence.contacts]
    for left_out in sequence.contacts if len(pairs) > 1 else ():
        if pairs.count(left_out.pair) == 1:
            yield replace(sequence, events=tuple(event for event in sequence.events if event is not left_out))


def swap_contacts(sequence: EventSequence) -> Iterator[EventSequence]:
    """Yield the sequence with two successive contacts swapped, for each two; nothing if the order is unknown.

    >>> [[event.pair for event in left.events] for left in swap_contacts(sequence_of(queue_record))]
    [[(2, 3), (1, 2)]]
    """
    places = [place for place, event in enumerate(sequence.events) if event.is_contact]
    for one, two in pairwise(places) if sequence.order_known else ():
        events = list(sequence.events)
        events[one], events[two] = events[two], events[one]
        yield replace(sequence, events=tuple(events))
