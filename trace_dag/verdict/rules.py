"""The rules of a verdict: a table of criteria with their events, measures, limits and reasons.

There are three rule sets. "trace-dag" has the paper's three criteria: first contact near the reported location, each
impact within two clock positions, each direction as reported. The impact is measured where the bodies touch, and
thresholds come from settings. "strict" also requires every reported travel speed, later object and overturn.
"published" is the unchanged procedure of the paper, for comparison: contact within 10 m, and the impact as the
direction to the other body's centre.

A crash is accepted if no criterion that can reject it fails, and if each reason required by its first event was
evaluated at least once. Unreported facts are "not evaluated", and without any evaluation there is no evidence for the
crash. Speeds may be unreported.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from typing import Final, TypeAlias

from trace_dag.common.errors import Reason
from trace_dag.common.messages.wording import beside_limit
from trace_dag.common.settings import RuleSetName, VerdictSettings
from trace_dag.common.units import clock_difference_h, wrap_angle
from trace_dag.crash.classes import CollisionType
from trace_dag.crash.crash_types import DepartureSide, turn_of
from trace_dag.crash.event_sequence import OFF_THE_ROAD, CrashEvent, EventSequence
from trace_dag.crash.parties import EventKind, party_in_words
from trace_dag.crash.record import CrashRecord
from trace_dag.crash.road_departure import Departure, departure_of
from trace_dag.crash.summary import event_named
from trace_dag.crash.zones import Zone, reported_zones, zones_of_first_event
from trace_dag.roads.crash_site.street_names import SAME_STREET
from trace_dag.roads.map.roadside import RoadZone, roadside_at
from trace_dag.simulation.matching import Matching, SimulatedEvent, expect_events, happenings_of, match
from trace_dag.verdict.departed_street import street_likeness
from trace_dag.verdict.metrics import (
    SIDES_IN_WORDS,
    clock_error_positions,
    compass_error_deg,
    course_error_deg,
    heading_error,
    relation_error,
    reported_zone,
    roadside_error_m,
    speed_error_rel,
    turn_error,
    zone_error_m,
)
from trace_dag.verdict.observation import LEAST_RECORDED_MPS, ObservedCrash, ObservedEvent, ObservedVehicle, StruckSide
from trace_dag.verdict.types import Criterion

UNITS_IN_WORDS = {"h": "clock positions", "deg": "degrees", "mps": "m/s"}
_INCOMPLETE: Final[Mapping[Reason, tuple[Reason, str]]] = {
    Reason.WRONG_DIRECTION: (
        Reason.INCOMPLETE_TRAJECTORY,
        "The report says neither which way the parties went (P_CRASH1) nor how they approached each other (ACC_TYPE, "
        "MAN_COLL).",
    ),
    Reason.WRONG_SIDE: (
        Reason.INCOMPLETE_TRAJECTORY,
        "The report does not say to which side the vehicle left the road.",
    ),
    Reason.WRONG_IMPACT: (Reason.INCOMPLETE_IMPACT, "The report gives no area of impact (IMPACT1, AOI)."),
}
"""Reasons of a crash whose report has nothing to judge them by, with their sentences."""
_REJECTING = (
    Reason.NO_COLLISION,
    Reason.WRONG_PARTY,
    Reason.NO_DEPARTURE,
    Reason.WRONG_SIDE,
    Reason.NO_OVERTURN,
    Reason.WRONG_LOCATION,
    Reason.WRONG_IMPACT,
    Reason.WRONG_SEQUENCE,
    Reason.WRONG_ZONE,
    Reason.WRONG_DIRECTION,
    Reason.WRONG_SPEED,
)
_TRAFFICWAY_M: Final = 9.0
"""Distance beyond the edge at which a trafficway ends: the clear zone of AASHTO's Roadside Design Guide (2011)."""
_EDGE_M: Final = 0.5  # the edge of a carriageway is drawn no better than so
_OVERTURNING_M: Final = 5.0  # a tripped vehicle slides and turns on before it is over
_LARGEST_ANGLE_DEG: Final = 150.0
"""Between the headings in an angle crash of two fronts: above it the two meet head on (``MAN_COLL`` 2)."""
_OF_STRIKES: Final = frozenset({EventKind.PERSON_STRUCK, EventKind.ANIMAL_STRUCK})
_REQUIRED: Final[Mapping[EventKind, tuple[Reason, ...]]] = {
    EventKind.VEHICLE_CONTACT: (
        Reason.NO_COLLISION,
        Reason.WRONG_LOCATION,
        Reason.WRONG_IMPACT,
        Reason.WRONG_DIRECTION,
    ),
    # A person's direction is coded near intersections only.
    **dict.fromkeys(_OF_STRIKES, (Reason.NO_COLLISION, Reason.WRONG_LOCATION, Reason.WRONG_IMPACT)),
    # The area of impact of an object is not known in 15 % of such crashes (2016).
    EventKind.OBJECT_STRUCK: (Reason.NO_COLLISION, Reason.NO_DEPARTURE, Reason.WRONG_SIDE, Reason.WRONG_LOCATION),
    # Who overturned on the roadway left it to no side.
    EventKind.OVERTURN: (Reason.NO_OVERTURN, Reason.WRONG_LOCATION),
}


def required_reasons(sequence: EventSequence, record: CrashRecord) -> tuple[Reason, ...]:
    """Return the reasons that must have been evaluated, by the first event and its parties.

    The area of impact is not required for a register without areas.

    >>> [reason.value for reason in required_reasons(tree_sequence, tree_record)]
    ['no_collision', 'no_departure', 'wrong_side', 'wrong_location']
    """
    found = _REQUIRED[sequence.first.kind]
    if "impact" in record.register_lacks:
        found = tuple(reason for reason in found if reason is not Reason.WRONG_IMPACT)
    if sequence.first.kind is EventKind.VEHICLE_CONTACT and (sequence.first.parked or len(sequence.contacts) > 1):
        return tuple(reason for reason in found if reason is not Reason.WRONG_DIRECTION)  # who stood made no turn
    return found


@dataclass(frozen=True)
class RuleSet:
    """A set of rules.

    It has the kind of impact point (direction to the other body's centre, or point of contact), thresholds of its own
    or None for those of the settings, and whether a reported speed that is not kept rejects.
    """

    by_bearing: bool = False
    limits: VerdictSettings | None = None
    speeds_reject: bool = False

    def clock_h(self, side: StruckSide | ObservedVehicle) -> float:
        """Return the clock position that counts."""
        return side.bearing_clock_h if self.by_bearing else side.clock_h


RULE_SETS: dict[RuleSetName, RuleSet] = {
    "trace-dag": RuleSet(),
    "strict": RuleSet(speeds_reject=True),
    "published": RuleSet(
        by_bearing=True,
        limits=VerdictSettings(rule_set="published", max_contact_distance_m=10.0),
    ),
}


def limits_of(record: CrashRecord, settings: VerdictSettings) -> VerdictSettings:
    """Return the limits of a set of rules for one report.

    The limit of the contact's distance is at least the error of the register's points.

    >>> limits_of(record, VerdictSettings()).max_contact_distance_m
    5.0
    """
    limits = RULE_SETS[settings.rule_set].limits or settings
    known_m = max(limits.max_contact_distance_m, record.position_accuracy_m or 0.0)
    return limits.model_copy(update={"max_contact_distance_m": known_m})


@dataclass(frozen=True)
class Judgement:
    """The sum of the criteria: ``reason`` and ``detail`` explain a rejection."""

    accepted: bool
    reason: Reason | None
    detail: str


# --- a report beside a simulation ------------------------------------------------------------------------------------
@dataclass(frozen=True, eq=False)
class Comparison:
    """A report's events matched with those of a simulation, and the applicable limits.

    ``begins`` is the first reported event that happens in the simulation. ``placed_xy_m`` is the place of the crash on
    the map: the reported point unless that is off its road.
    """

    record: CrashRecord
    sequence: EventSequence
    observed: ObservedCrash
    matching: Matching
    settings: VerdictSettings
    placed_xy_m: tuple[float, float] = (0.0, 0.0)

    @classmethod
    def of(
        cls,
        record: CrashRecord,
        sequence: EventSequence,
        observed: ObservedCrash,
        settings: VerdictSettings,
        placed_xy_m: tuple[float, float] = (0.0, 0.0),
    ) -> Comparison:
        """Return a report and its events beside a simulation.

        >>> comparison.begins.number, comparison.seen(comparison.begins).pair
        (1, (1, 2))
        """
        seen = happenings_of(observed.log)
        found = match(seen, expect_events(sequence.events), order_known=sequence.order_known)
        return cls(record, sequence, observed, found, settings, placed_xy_m)

    @property
    def rules(self) -> RuleSet:
        """Return the set of rules."""
        return RULE_SETS[self.settings.rule_set]

    @property
    def limits(self) -> VerdictSettings:
        """Return the settings with the limits."""
        return limits_of(self.record, self.settings)

    def seen(self, event: CrashEvent) -> ObservedEvent | None:
        """Return an event as simulated; None if it does not happen in its turn."""
        return self.observed.of(self.matching.matched[self.sequence.events.index(event)])

    @property
    def begins(self) -> CrashEvent | None:
        """Return the reported event with which the crash begins, or None if none happens."""
        if self.sequence.order_known and self.seen(self.sequence.first) is not None:
            return self.sequence.first
        happening = [(seen.time_s, event) for event in self.sequence.events if (seen := self.seen(event)) is not None]
        return min(happening, key=lambda each: each[0])[1] if happening else None

    @property
    def departure(self) -> Departure:
        """Return the departure of the vehicle of the first event."""
        return departure_of(self.record, self.sequence)


@dataclass(frozen=True, eq=False)
class Beside:
    """One reported event with its simulated counterpart; ``first`` if the crash begins with it."""

    event: CrashEvent
    seen: ObservedEvent
    first: bool
    of: Comparison


Values: TypeAlias = Iterator[tuple[int | None, float | None]]
"""Numbers of parties, None for what is of the event as a whole, and values; None where the report says nothing."""


@dataclass(frozen=True)
class Rule:
    """One criterion: its events, values, limit, and reason to reject; None for one that is only shown."""

    name: str
    applies: Callable[[Beside], bool]
    values: Callable[[Beside], Values]
    unit: str
    limit: Callable[[VerdictSettings], float]
    reason: Reason | None

    def criteria(self, each: Beside) -> Iterator[Criterion]:
        """Yield the criteria of an event, if the rule applies."""
        if not self.applies(each):
            return
        of = each.of
        limit = self.limit(of.settings if self.reason is Reason.WRONG_ZONE else of.limits)
        reason = self.reason if self.reason is not Reason.WRONG_SPEED or of.rules.speeds_reject else None
        for number, value in self.values(each):
            yield at_most(self.name, value, limit, self.unit, reason, number, each.event.number)


def _is_first_contact(each: Beside) -> bool:
    return each.first and each.event.is_contact


def _is_first_off_road(each: Beside) -> bool:
    return each.first and each.event.kind in OFF_THE_ROAD and each.seen.departure is not None  # none after a contact


def _contact_distance(each: Beside) -> Values:
    """Yield the distance from the reported point to the contact.

    It is measured from the placed crash if that is nearer, provided that this is within the limit of the point.

    It is measured along the road if the report places the person or the parked vehicle off the carriageway, since the
    reported point is then on the road.
    """
    contact, parked = each.seen.contact, each.event.parked
    zones = frozenset[Zone]()
    if each.event.kind in _OF_STRIKES:
        zones = reported_zones(each.of.record, each.event.person)
    elif parked is not None:
        zones = zones_of_first_event(each.of.record)
    if not zones or Zone.CARRIAGEWAY in zones:
        placed, moved_m = each.of.placed_xy_m, math.hypot(*each.of.placed_xy_m)
        share = min(1.0, each.of.limits.max_contact_distance_m / moved_m) if moved_m else 0.0
        yield None, min(math.dist((contact.x_m, contact.y_m), (s * placed[0], s * placed[1])) for s in (0.0, share))
        return
    drives = next((v for number, v in each.seen.vehicles.items() if parked is None or number != parked.number), None)
    yield None, math.hypot(contact.x_m, contact.y_m) if drives is None else abs(contact.along_m(drives.approach_rad))


def _station_distance(each: Beside) -> Values:
    assert each.seen.departure is not None
    yield None, each.seen.departure.along_m


def _across_distance(each: Beside) -> Values:
    """Yield the event's distance beyond the carriageway's edge, less the reported point's and the zone's width."""
    left = each.seen.departure
    if left is None or left.place is None or reported_zone(each.of.record) is RoadZone.MEDIAN:
        return
    point = roadside_at(each.of.observed.network, 0.0, 0.0)
    allowed_m = max(point.beyond_m, 0.0) if point is not None else 0.0
    if reported_zone(each.of.record) is RoadZone.OUTSIDE:
        allowed_m = max(allowed_m, _TRAFFICWAY_M)
    if each.event.kind is EventKind.OVERTURN:
        allowed_m += _OVERTURNING_M
    yield None, max(left.place.beyond_m - allowed_m - _EDGE_M, 0.0)


def _head_on_angle(each: Beside) -> Values:
    """Yield the angle between the headings of two vehicles struck at their fronts in a reported angle crash."""
    if each.of.record.collision_type is not CollisionType.ANGLE:
        return
    fronts = [clock_difference_h(each.of.rules.clock_h(side), 12.0) <= 1.0 for side in each.seen.sides.values()]
    if len(fronts) == 2 and all(fronts):
        contact = each.seen.contact
        yield None, abs(math.degrees(wrap_angle(contact.pose_1.heading_rad - contact.pose_2.heading_rad)))


def _zone_error(each: Beside) -> Values:
    """Yield the distance of the event from the reported part of the road."""
    event, seen, record = each.event, each.seen, each.of.record
    if seen.person is not None:
        yield event.party, zone_error_m(seen.person.outside_m, reported_zones(record, event.person))
    elif seen.departure is not None:
        yield event.vehicle.number, roadside_error_m(seen.departure.place, reported_zone(record))
    elif event.parked is not None and (outside_m := seen.outside_m.get(event.parked.number)) is not None:
        yield event.parked.number, zone_error_m(outside_m, zones_of_first_event(record))


def _clock_errors(each: Beside) -> Values:
    for vehicle in each.event.vehicles:
        side = each.seen.sides.get(vehicle.number)
        if side is not None:
            yield vehicle.number, clock_error_positions(each.of.rules.clock_h(side), vehicle.impact)


def _direction_errors(each: Beside) -> Values:
    for vehicle in each.event.vehicles:
        went = each.seen.vehicles.get(vehicle.number)
        if went is not None:
            yield vehicle.number, turn_error(went, vehicle, each.of.record.road_topology)


def _relation_error(each: Beside) -> Values:
    one, two = each.event.vehicles
    went = each.seen.vehicles
    if each.event.parked is not None:  # it came from nowhere
        yield None, None
        return
    if one.number in went and two.number in went:
        yield None, relation_error(went[one.number], went[two.number], one, two, each.of.record)


def _course_error(each: Beside) -> Values:
    person = each.event.person
    assert each.seen.person is not None
    drove = each.seen.vehicles[each.event.vehicle.number]
    yield person.party, course_error_deg(drove, each.seen.person, person, turn_of(each.event.vehicle))


def _compass_errors(each: Beside) -> Values:
    person, walked = each.event.person, each.seen.person
    assert walked is not None
    number = each.event.vehicle.number
    yield number, compass_error_deg(each.seen.vehicles[number].approach_rad, person.motorist_direction_code)
    heading_rad = walked.heading_rad if walked.moves else None
    yield person.party, compass_error_deg(heading_rad, person.pedestrian_direction_code)


def _heading_errors(each: Beside) -> Values:
    """Yield the heading errors of the vehicles and the person with a reported direction of travel."""
    for vehicle in each.event.vehicles:
        went = each.seen.vehicles.get(vehicle.number)
        if went is not None and vehicle.heading is not None:
            yield vehicle.number, heading_error(went, vehicle)
    walked = each.seen.person
    if walked is not None and each.event.person.heading is not None:
        octant_rad = each.event.person.heading.octant.heading_rad
        apart_deg = abs(math.degrees(wrap_angle(walked.heading_rad - octant_rad)))
        yield each.event.person.party, apart_deg if walked.moves else None


def _speed_errors(each: Beside) -> Values:
    """Yield the speed errors of the vehicles that take part for the first time."""
    begun = each.of.sequence.events[: each.of.sequence.events.index(each.event)]
    before = {vehicle.number for event in begun for vehicle in event.vehicles}
    initial = {vehicle.number: float(vehicle.speed_mps[0]) for vehicle in each.of.observed.log.parties}
    for vehicle in each.event.vehicles:
        if vehicle.number not in before and vehicle.number in initial:
            yield vehicle.number, speed_error_rel(initial[vehicle.number], vehicle)


RULES: Final[Sequence[Rule]] = (
    Rule(
        "contact_distance",
        _is_first_contact,
        _contact_distance,
        "m",
        lambda s: s.max_contact_distance_m,
        Reason.WRONG_LOCATION,
    ),
    Rule(
        "station_distance",
        _is_first_off_road,
        _station_distance,
        "m",
        lambda s: s.max_contact_distance_m,
        Reason.WRONG_LOCATION,
    ),
    Rule(
        "across_distance",
        _is_first_off_road,
        _across_distance,
        "m",
        lambda s: s.max_contact_distance_m,
        Reason.WRONG_LOCATION,
    ),
    Rule(
        "head_on_angle",
        lambda e: e.first and e.event.kind is EventKind.VEHICLE_CONTACT,
        _head_on_angle,
        "deg",
        lambda _: _LARGEST_ANGLE_DEG,
        Reason.WRONG_IMPACT,
    ),
    Rule("zone_error", lambda e: e.first, _zone_error, "m", lambda s: s.max_zone_error_m, Reason.WRONG_ZONE),
    Rule(
        "clock_error",
        lambda e: e.event.is_contact or (e.first and e.event.kind is EventKind.OBJECT_STRUCK),
        _clock_errors,
        "h",
        lambda s: s.max_clock_error_positions,
        Reason.WRONG_IMPACT,
    ),
    Rule(
        "direction_error",
        lambda e: e.event.kind in _OF_STRIKES or (e.first and e.event.kind is EventKind.VEHICLE_CONTACT),
        _direction_errors,
        "deg",
        lambda s: s.max_direction_error_deg,
        Reason.WRONG_DIRECTION,
    ),
    Rule(
        "relation_error",
        lambda e: e.first and e.event.kind is EventKind.VEHICLE_CONTACT,
        _relation_error,
        "deg",
        lambda s: s.max_direction_error_deg,
        Reason.WRONG_DIRECTION,
    ),
    Rule(
        "course_error",
        lambda e: e.first and e.event.kind is EventKind.PERSON_STRUCK,
        _course_error,
        "deg",
        lambda s: s.max_direction_error_deg,
        Reason.WRONG_DIRECTION,
    ),
    Rule(
        "compass_error",
        lambda e: e.first and e.event.kind is EventKind.PERSON_STRUCK,
        _compass_errors,
        "deg",
        lambda s: s.max_direction_error_deg,
        Reason.WRONG_DIRECTION,
    ),
    Rule(
        "headed_as_reported",
        lambda e: e.first and e.event.is_contact,
        _heading_errors,
        "deg",
        lambda s: s.max_direction_error_deg,
        Reason.WRONG_DIRECTION,
    ),
    Rule(
        "initial_speed_error", lambda e: True, _speed_errors, "rel", lambda s: s.max_speed_error_rel, Reason.WRONG_SPEED
    ),
)
"""Every criterion on a size. What asks for a thing to happen stands in :func:`criteria`."""


def criteria(beside: Comparison) -> tuple[Criterion, ...]:
    """Return every criterion of the rule set, those that can reject first, then those that are only shown.

    >>> found = criteria(comparison)
    >>> [criterion.name for criterion in found if criterion.reason and criterion.passed is False]
    []
    """
    first = beside.sequence.first
    begins, nothing = beside.begins, beside.observed.first is None
    happens = _happens(beside, first, begins, nothing=nothing)
    if nothing or (first.kind is EventKind.OVERTURN and begins is None):
        return (happens,)
    found = [happens, *_right_party(beside, begins)]
    pairs = [
        Beside(event, seen, event is begins, beside)
        for event in beside.sequence.events
        if (seen := beside.seen(event)) is not None
    ]
    for each in pairs:
        if _is_first_off_road(each):
            found += _departure(each)
        for rule in RULES:
            found += rule.criteria(each)
    found += _sequence(beside, begins)
    return tuple(found)


def _happens(beside: Comparison, first: CrashEvent, begins: CrashEvent | None, *, nothing: bool) -> Criterion:
    """Return the criterion that there is a crash: a contact, or the overturn."""
    log, number = beside.observed.log, first.number
    if first.kind is EventKind.OVERTURN:
        over = begins is not None
        ended = log.reason.removeprefix("no contact: ")
        says_so = "does not overturn" in ended
        detail = ended if says_so else f"vehicle {first.vehicle.number} does not overturn ({ended})"
        return Criterion(
            "overturn",
            float(over),
            1.0,
            "",
            over,
            Reason.NO_OVERTURN,
            "" if over else detail,
            first.vehicle.number,
            number,
        )
    party = first.vehicle.number if first.kind is EventKind.OBJECT_STRUCK else None
    touched = not nothing and bool(log.contacts)
    detail = "" if touched else log.reason
    return Criterion("contact", float(touched), 1.0, "contacts", touched, Reason.NO_COLLISION, detail, party, number)


def _right_party(beside: Comparison, begins: CrashEvent | None) -> Iterator[Criterion]:
    """Yield a criterion that fails if the first contact is not the first reported one."""
    seen, first = beside.observed.first, beside.sequence.first
    if seen is None or first.kind is EventKind.OVERTURN:
        return
    possible = [first] if beside.sequence.order_known else list(beside.sequence.contacts)
    right_object = first.kind is not EventKind.OBJECT_STRUCK or seen.object_code == first.code
    if seen.pair in [event.pair for event in possible] and right_object:
        return
    if seen.object_code is not None:
        detail = f"an object of SOE {seen.object_code} is struck first"
        if first.kind is EventKind.OBJECT_STRUCK and seen.object_code == first.code:
            detail += f", but not that of event {first.number}"
        else:
            detail += f", reported is SOE {first.code} in event {first.number}"
    else:
        detail = f"the first contact is between {' and '.join(map(party_in_words, seen.pair))}; the report begins with "
        begun = [first] if first.kind is EventKind.OBJECT_STRUCK else possible
        detail += " or ".join(event_named(event.number, event.code) for event in begun)
    yield Criterion("right_party", 0.0, 1.0, "", False, Reason.WRONG_PARTY, detail, None, first.number)


def _departure(each: Beside) -> list[Criterion]:
    """Return the criteria of the first departure: whether it happens, its side, and its street."""
    departure, left = each.of.departure, each.seen.departure
    assert left is not None
    number, event = departure.vehicle.number, each.event.number
    zone = reported_zone(each.of.record)
    on_road = zone is RoadZone.ROADWAY or (departure.side is DepartureSide.AHEAD and zone is None)
    gone = left.left_s is not None
    detail = "" if gone or on_road else "the vehicle had not left the carriageway at the first harmful event"
    found = [Criterion("departure", float(gone), 1.0, "", gone or on_road, Reason.NO_DEPARTURE, detail, number, event)]
    told = departure.side
    right = told in left.sides or (told is DepartureSide.AHEAD and not gone)
    detail = ""
    if told is None:
        on_it = zone is RoadZone.ROADWAY
        detail = "the first harmful event was on the roadway" if on_it else "the report does not say to which side"
    elif not right:
        went = f"left the road {SIDES_IN_WORDS[left.sides[0]]}" if left.sides else "did not leave the road"
        detail = f"the vehicle {went}, reported is {told}"
    held = None if told is None else right
    found.append(Criterion("departure_side", float(right), 1.0, "", held, Reason.WRONG_SIDE, detail, number, event))
    likeness, held, detail = street_likeness(left.street, each.of.record)
    found.append(
        Criterion("departed_street", likeness, SAME_STREET, "", held, Reason.WRONG_LOCATION, detail, number, event)
    )
    return found


def _sequence(beside: Comparison, begins: CrashEvent | None) -> Iterator[Criterion]:
    """Yield criteria that every contact comes in its turn, without other contacts before.

    Only the strict rules require later objects and overturns.
    """
    strict, sequence = beside.rules.speeds_reject, beside.sequence
    told = "after what came before it" if sequence.order_known else "at all"
    for event in sequence.events:
        if event is begins or (event is sequence.first and begins is None):
            continue
        happens = beside.seen(event) is not None
        both = f"{party_in_words(event.vehicle.number)} and {party_in_words(event.party)}"
        if event.is_contact:
            detail = "" if happens else f"{both} do not touch {told}, which event {event.number} says"
            yield _held("next_contact", event, happens, Reason.WRONG_SEQUENCE, detail)
        elif event.kind is EventKind.OVERTURN:
            detail = "" if happens else f"the vehicle does not overturn, which event {event.number} says"
            yield _held("later_overturn", event, happens, Reason.NO_OVERTURN if strict else None, detail)
        else:
            detail = "" if happens else "the object is not struck"
            yield _held("later_object", event, happens, Reason.WRONG_SEQUENCE if strict else None, detail)
    early = [event for event in sequence.events if not event.is_contact and _out_of_turn(beside, event)]
    if sequence.first.kind is EventKind.OBJECT_STRUCK:
        numbers = ", ".join(f"event {event.number}" for event in early)
        detail = f"the object of {numbers} is struck in an order that the report does not say" if early else ""
        yield _held("object_order", sequence.first, not early, Reason.WRONG_SEQUENCE, detail)
    required = [seen.time_s for event in sequence.contacts if (seen := beside.seen(event)) is not None]
    last_s = max(required, default=0.0)
    strange = [
        each
        for each in beside.matching.strange
        if each.time_s < last_s or not sequence.contacts or _collide(beside.observed, each)
    ]
    if strange:
        parties = " and ".join(map(party_in_words, strange[0].pair))
        detail = f"{parties} touch at {strange[0].time_s:.2f} s, which no event says by then"
        count = float(len(strange))
        yield Criterion("unreported_contact", count, 0.0, "contacts", False, Reason.WRONG_SEQUENCE, detail)


def _collide(observed: ObservedCrash, strange: SimulatedEvent) -> bool:
    """Return whether two vehicles touch hard enough for an event data recorder; no report leaves that out."""
    seen = observed.of(strange)
    changes = [side.delta_v_mps for side in seen.sides.values()] if seen is not None else []
    return len(changes) == 2 and max(changes) >= LEAST_RECORDED_MPS


def _out_of_turn(beside: Comparison, event: CrashEvent) -> bool:
    """Return whether an object is struck, but not in its turn."""
    touched = any(each.pair == event.pair and each.object_code is not None for each in beside.observed.events)
    return touched and beside.seen(event) is None


def _held(name: str, event: CrashEvent, happens: bool, reason: Reason | None, detail: str) -> Criterion:
    return Criterion(name, float(happens), 1.0, "", happens, reason, detail, event.vehicle.number, event.number)


# --- judging ---------------------------------------------------------------------------------------------------------
def at_most(
    name: str,
    value: float | None,
    threshold: float,
    unit: str,
    reason: Reason | None,
    number: int | None = None,
    event: int | None = None,
) -> Criterion:
    """Return a criterion on the size of a value; not evaluated without a value.

    >>> [at_most("contact_distance", each, 5.0, "m", Reason.WRONG_LOCATION).passed for each in (5.0, -6.0, None)]
    [True, False, None]
    """
    if value is None:
        return Criterion(name, None, threshold, unit, None, reason, "not reported", number, event)
    return Criterion(name, value, threshold, unit, abs(value) <= threshold, reason, "", number, event)


def judgement(judged: tuple[Criterion, ...], required: tuple[Reason, ...]) -> Judgement:
    """Return whether the crash is accepted; if not, with the first reason in the order of the flow, and its sentence.

    Each ``required`` reason must have been evaluated.

    >>> found = judgement((at_most("contact_distance", 6.0, 5.0, "m", Reason.WRONG_LOCATION),), ())
    >>> found.reason.value, found.detail
    ('wrong_location', 'contact distance 6.0 m, at most 5 allowed')
    """
    for reason in _REJECTING:
        of_kind = [criterion for criterion in judged if criterion.reason is reason]
        failed = next((criterion for criterion in of_kind if criterion.passed is False), None)
        if failed is not None:
            return Judgement(False, reason, _sentence(failed))
        if reason in required and not any(criterion.passed for criterion in of_kind):
            names = ", ".join(sorted({criterion.name for criterion in of_kind}))
            detail = f"the report gives nothing to judge it by: {names} not evaluated"
            return Judgement(False, *_INCOMPLETE.get(reason, (reason, detail)))
    skipped = [criterion for criterion in judged if criterion.reason is not None and criterion.passed is None]
    named = ", ".join(_name(criterion) for criterion in skipped)
    return Judgement(True, None, f"not evaluated, since not reported: {named}" if skipped else "")


def _name(criterion: Criterion) -> str:
    name = criterion.name.replace("_", " ")
    who = "" if criterion.vehicle_number is None else f" of {party_in_words(criterion.vehicle_number)}"
    return f"{name}{who}" if criterion.event_number is None else f"{name}{who} in event {criterion.event_number}"


def _sentence(criterion: Criterion) -> str:
    if criterion.detail:
        return criterion.detail
    assert criterion.value is not None
    assert criterion.threshold is not None
    size = abs(criterion.value)
    if criterion.unit == "rel":
        sign, value = "-" if criterion.value < 0 else "+", beside_limit(100 * size, 100 * criterion.threshold, 0)
        return f"{_name(criterion)} {sign}{value}%, at most {100 * criterion.threshold:g}% either way allowed"
    value, unit = beside_limit(size, criterion.threshold), UNITS_IN_WORDS.get(criterion.unit, criterion.unit)
    return f"{_name(criterion)} {value} {unit}, at most {criterion.threshold:g} allowed"
