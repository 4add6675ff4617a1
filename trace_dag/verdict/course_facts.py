"""Reported facts of a crash's course beside the simulated one: parties, areas, and approaches.

The estimator chooses the course that fits the report best, so the agreement of a single field is weak evidence; one
course that fits all fields is strong evidence.

Strikes on people and departures from the road have the facts of two vehicles under other names, since the weight of a
fact is fitted to crashes of its kind: going straight is weak evidence if nearly all vehicles that strike people do so.
Objects are placed by the program, so that their facts are weaker evidence than those of the place.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator
from dataclasses import replace
from typing import Final

from trace_dag.common.units import clock_difference_h, wrap_angle
from trace_dag.crash.classes import CollisionType, RoadTopology
from trace_dag.crash.codes.elements import ACC_TYPE, HARM_EV, MOTDIR, P_CRASH2, PBCWALK, PEDDIR
from trace_dag.crash.crash_types import CrashType, EncounterRole, Relation, Side, crash_type_of, critical_event, turn_of
from trace_dag.crash.event_sequence import CrashEvent
from trace_dag.crash.parties import EventKind, party_in_words
from trace_dag.crash.record import CrashRecord, PreCrashMovement, VehicleRecord
from trace_dag.crash.zones import reported_zones
from trace_dag.reconstruction.motion.walking import reported_directions
from trace_dag.roads.map.people import crosswalks, crosswalks_near
from trace_dag.roads.report import CrashPlacement
from trace_dag.verdict.directions import STRAIGHT_MOVEMENTS, TURN_DEG, TURNS_BY_MOVEMENT, turn_error_deg
from trace_dag.verdict.metrics import (
    clock_error_positions,
    compass_error_deg,
    course_error_deg,
    reported_zone,
    roadside_error_m,
    speed_error_rel,
    zone_error_m,
)
from trace_dag.verdict.observation import ObservedEvent, ObservedPerson, ObservedVehicle
from trace_dag.verdict.rules import Comparison
from trace_dag.verdict.types import Agreement, ComparedWith, Fact

_SAME_CLOCK_H: Final = 0.5
_NEAR_CLOCK_H: Final = 2.0
_TO_THE_CORNER_H: Final = 2.0  # from the middle of a side of the body; a corner belongs to both of its sides
_DAMAGED_ALL_AROUND: Final = 9  # clock positions damaged from which on they do not tell where the first contact was
_TURN_DEG: Final = 45.0
_ACROSS_DEG: Final = (45.0, 135.0)  # between two courses that cross; less is one direction, more the opposite one
_STANDING_MPS: Final = 2.3  # 5 mph
_KEPT_REL: Final = 0.1
_LEFT, _RIGHT, _FRONT, _REAR = 9.0, 3.0, 12.0, 6.0
_ANY_ANGLE: Final = frozenset(
    {RoadTopology.L, RoadTopology.Y, RoadTopology.ROUNDABOUT, RoadTopology.FIVE_POINT_OR_MORE}
)
_COURSE_DEG: Final = 45.0
_IN_ZONE_M: Final = 1.0
_CROSSWALK_M: Final = 20.0  # a marked crosswalk of the intersection or block that the typing speaks of
_PRESENT, _NONE_NOTED = 1, 0
_IN_PART_M: Final = 1.0


def course_facts(beside: Comparison) -> Iterator[Fact]:
    """Yield every reported fact about the course to the first contact of two vehicles.

    >>> {fact.agreement.value for fact in course_facts(comparison)}
    {'agrees'}
    """
    record, first = beside.record, beside.observed.first
    if first is None or len(first.vehicles) != 2:
        return
    yield from _first_harm(beside)
    one, two = (first.vehicles[number] for number in first.vehicles)
    event = beside.begins
    reported = {} if event is None else {vehicle.number: vehicle for vehicle in event.vehicles}
    for seen, other in ((one, two), (two, one)):
        vehicle = reported.get(seen.number)
        if vehicle is not None:
            yield from _crash_type(record, vehicle, seen, other)
            yield from _critical_event(record, vehicle, seen, other)
            found = (movement_fact(record, vehicle, seen), impact_fact(vehicle, seen), _damage(vehicle, seen))
            yield from (fact for fact in (*found, speed_fact(vehicle, seen)) if fact is not None)
    yield from _manner(record, one, two)


# --- what happened -----------------------------------------------------------------------------------------------
def _first_harm(beside: Comparison) -> Iterator[Fact]:
    """Yield ``HARM_EV`` beside the event that the sequence begins with."""
    code, first = beside.record.first_harmful_event_code, beside.sequence.first
    if code is not None:
        agreement, found = Agreement.of(code == first.code), HARM_EV.meaning(first.code)
        yield Fact("first harmful event", ComparedWith.COURSE, agreement, HARM_EV.meaning(code), found, essential=True)


def _manner(record: CrashRecord, one: ObservedVehicle, two: ObservedVehicle) -> Iterator[Fact]:
    """Yield ``MAN_COLL`` beside the parts of the bodies that met first."""
    parts = _PARTS.get(record.collision_type)
    if parts is not None:
        met = parts(one.clock_h, two.clock_h) or parts(two.clock_h, one.clock_h)
        found = f"{one.clock_h:.1f} and {two.clock_h:.1f} o'clock"
        yield Fact(
            "manner of collision",
            ComparedWith.COURSE,
            Agreement.of(met),
            record.collision_type.value.replace("_", " "),
            found,
        )


def _is_on(part_h: float, clock_h: float) -> bool:
    return clock_difference_h(part_h, clock_h) <= _TO_THE_CORNER_H


def _side(clock_h: float) -> bool:
    return _is_on(_LEFT, clock_h) or _is_on(_RIGHT, clock_h)


_PARTS: Final[dict[CollisionType, Callable[[float, float], bool]]] = {
    CollisionType.FRONT_TO_REAR: lambda a, b: _is_on(_FRONT, a) and _is_on(_REAR, b),
    CollisionType.FRONT_TO_FRONT: lambda a, b: _is_on(_FRONT, a) and _is_on(_FRONT, b),
    CollisionType.REAR_TO_REAR: lambda a, b: _is_on(_REAR, a) and _is_on(_REAR, b),
    CollisionType.REAR_TO_SIDE: lambda a, b: _is_on(_REAR, a) and _side(b),
    CollisionType.ANGLE: lambda a, b: _side(a) or _side(b),
    CollisionType.SIDESWIPE_SAME_DIRECTION: lambda a, b: _side(a) or _side(b),
    CollisionType.SIDESWIPE_OPPOSITE_DIRECTION: lambda a, b: _side(a) or _side(b),
}


# --- how they met ------------------------------------------------------------------------------------------------
def _crash_type(
    record: CrashRecord, vehicle: VehicleRecord, seen: ObservedVehicle, other: ObservedVehicle
) -> Iterator[Fact]:
    """Yield ``ACC_TYPE``: the approach of the two, their turns, and the struck parts.

    Types 1 to 16 are those of a crash with one vehicle's driver alone. Types 98 and 99, and those that leave the
    configuration open, give no fact.
    """
    code = vehicle.crash_type_code
    if code is None or "crash_type_code" in vehicle.implied:
        return
    kind = crash_type_of(vehicle)
    if kind.single_driver:
        agrees = False
    elif kind.relation is None:
        return
    else:
        agrees = (
            _is_relation(kind.relation, record, seen, other)
            and _makes_turn(kind, seen)
            and _is_struck_so(kind, seen)
            and _comes_from(kind.other_from, kind.relation, seen, other)
        )
    found = f"{_relation_deg(seen, other):.0f} deg between the courses, turned {seen.turn_deg:+z.0f} deg, struck at "
    found += f"{seen.clock_h:.1f} o'clock"
    reported = ACC_TYPE.meaning(code)
    yield Fact("crash type", ComparedWith.COURSE, Agreement.of(agrees), reported, found, True, vehicle.number)


def _relation_deg(seen: ObservedVehicle, other: ObservedVehicle) -> float:
    return abs(math.degrees(wrap_angle(seen.approach_rad - other.approach_rad)))


def _is_relation(relation: Relation, record: CrashRecord, seen: ObservedVehicle, other: ObservedVehicle) -> bool:
    angle_deg = _relation_deg(seen, other)
    low, high = _ACROSS_DEG
    if relation is Relation.CROSSING:
        return low <= angle_deg <= high or record.road_topology in _ANY_ANGLE
    if record.road_topology is RoadTopology.L:
        return True
    return angle_deg > high if relation is Relation.OPPOSITE_DIRECTION else angle_deg < low


def _makes_turn(kind: CrashType, seen: ObservedVehicle) -> bool:
    allowed = frozenset({TURN_DEG[kind.turn]} if kind.turn else {0.0})
    error = turn_error_deg(seen.turn_deg, allowed, seen.offered_turns_deg)
    return error is None or error <= _TURN_DEG


def _is_struck_so(kind: CrashType, seen: ObservedVehicle) -> bool:
    if kind.role not in (EncounterRole.STRIKING, EncounterRole.STRUCK) or kind.impact_code is None:
        return True
    return _is_on(kind.impact_code, seen.clock_h)


def _comes_from(side: Side | None, relation: Relation, seen: ObservedVehicle, other: ObservedVehicle) -> bool:
    if side is None or relation is not Relation.CROSSING:
        return True
    to_the_left = wrap_angle(other.approach_rad - seen.approach_rad) > 0  # who comes from the right goes to the left
    return to_the_left is (side is Side.RIGHT)


def _critical_event(
    record: CrashRecord, vehicle: VehicleRecord, seen: ObservedVehicle, other: ObservedVehicle
) -> Iterator[Fact]:
    """Yield ``P_CRASH2``: the direction from which the other vehicle came."""
    relation = critical_event(vehicle.critical_event_code).relation
    if relation is not None:
        agrees = _is_relation(relation, record, seen, other)
        reported = P_CRASH2.meaning(vehicle.critical_event_code)
        found = f"{_relation_deg(seen, other):.0f} deg between the courses"
        yield Fact(
            "critical event", ComparedWith.COURSE, Agreement.of(agrees), reported, found, vehicle_number=vehicle.number
        )


def movement_fact(record: CrashRecord, vehicle: VehicleRecord, seen: ObservedVehicle) -> Fact | None:
    """Return ``P_CRASH1``: turning, going straight, standing, backing; None for other movements.

    >>> fact = movement_fact(record, record.vehicles[0], first_contact.vehicles[1])
    >>> fact.reported, fact.agreement.value
    ('turning left', 'agrees')
    """
    movement = vehicle.movement
    if "movement" in vehicle.implied:
        return None
    found = f"turned {seen.turn_deg:+z.0f} deg, {seen.impact_speed_mps:z.1f} m/s at the impact"
    if movement is PreCrashMovement.BACKING:
        agrees = seen.impact_speed_mps < 0
    elif movement is PreCrashMovement.STOPPED:
        agrees = abs(seen.impact_speed_mps) <= _STANDING_MPS
    elif movement in TURNS_BY_MOVEMENT or movement in STRAIGHT_MOVEMENTS:
        allowed = {TURNS_BY_MOVEMENT.get(movement, 0.0)}
        if record.road_topology in (RoadTopology.L, RoadTopology.ROUNDABOUT):
            allowed |= {0.0}  # a bend of the road may be called a turn there
        error = turn_error_deg(seen.turn_deg, frozenset(allowed), seen.offered_turns_deg)
        agrees = error is None or error <= _TURN_DEG
    else:
        return None
    reported = movement.name.lower().replace("_", " ")
    return Fact("movement", ComparedWith.COURSE, Agreement.of(agrees), reported, found, vehicle_number=vehicle.number)


# --- each vehicle ------------------------------------------------------------------------------------------------
def impact_fact(vehicle: VehicleRecord, seen: ObservedVehicle) -> Fact | None:
    """Return the area of impact, by the clock; None if none is reported.

    >>> fact = impact_fact(record.vehicles[0], first_contact.vehicles[1])
    >>> fact.reported, fact.found, fact.agreement.value
    ("3 o'clock", "2.9 o'clock", 'agrees')
    """
    error = clock_error_positions(seen.clock_h, vehicle.impact)
    if vehicle.impact is None or error is None:
        return None
    agreement = Agreement.DIFFERS
    if error <= _SAME_CLOCK_H:
        agreement = Agreement.AGREES
    elif error <= _NEAR_CLOCK_H:
        agreement = Agreement.NEAR
    reported, found = f"{vehicle.impact.clock_h:g} o'clock", f"{seen.clock_h:.1f} o'clock"
    return Fact("impact", ComparedWith.COURSE, agreement, reported, found, vehicle_number=vehicle.number)


def _damage(vehicle: VehicleRecord, seen: ObservedVehicle) -> Fact | None:
    """Return ``DAMAGE`` (``MDAREAS``): whether the struck part is damaged."""
    hours = [area for area in vehicle.damaged_areas if 1 <= area <= 12]
    if not hours or len(hours) >= _DAMAGED_ALL_AROUND:
        return None
    off_h = min(clock_difference_h(float(hour), seen.clock_h) for hour in hours)
    agreement = Agreement.DIFFERS
    if off_h <= 2 * _SAME_CLOCK_H:
        agreement = Agreement.AGREES
    elif off_h <= _NEAR_CLOCK_H:
        agreement = Agreement.NEAR
    reported = ", ".join(f"{hour}" for hour in hours) + " o'clock damaged"
    found = f"struck at {seen.clock_h:.1f} o'clock"
    return Fact("damage", ComparedWith.COURSE, agreement, reported, found, vehicle_number=vehicle.number)


def speed_fact(vehicle: VehicleRecord, seen: ObservedVehicle) -> Fact | None:
    """Return the travel speed; None if none is reported.

    >>> fact = speed_fact(record.vehicles[1], first_contact.vehicles[2])  # 30 mph
    >>> fact.reported, fact.found, fact.agreement.value
    ('13.4 m/s', '13.4 m/s', 'agrees')
    """
    error = speed_error_rel(seen.initial_speed_mps, vehicle)
    if error is None or vehicle.travel_speed_mps is None:
        return None
    agreement = Agreement.of(abs(error) <= _KEPT_REL)
    reported, found = f"{vehicle.travel_speed_mps:.1f} m/s", f"{seen.initial_speed_mps:z.1f} m/s"
    return Fact("travel speed", ComparedWith.COURSE, agreement, reported, found, vehicle_number=vehicle.number)


# --- strikes on people, and departures -------------------------------------------------------------------------------
def pedestrian_facts(beside: Comparison) -> Iterator[Fact]:
    """Yield every reported fact about the strikes; nothing without a contact.

    >>> fact = next(pedestrian_facts(pedestrian_comparison))
    >>> fact.name, fact.reported, fact.agreement.value
    ('striking vehicle', 'vehicle 1 and person 1', 'agrees')
    """
    if beside.observed.first is None:
        return
    yield _first_pair(beside, beside.observed.first)
    for event in beside.sequence.events:
        seen = beside.seen(event)
        if seen is not None and seen.person is not None:
            yield from _of_vehicle(beside.record, event, seen)
            if event is beside.begins:  # afterwards it lies where it was thrown
                yield from _of_person(beside.record, event, seen, seen.person)


def crosswalk_facts(beside: Comparison, placement: CrashPlacement) -> Iterator[Fact]:
    """Yield ``PBCWALK`` compared with the map, if the map has any crosswalks; in most towns they are not mapped."""
    network = beside.observed.network
    if not crosswalks(network):
        return
    near = bool(crosswalks_near(network, placement.x_m, placement.y_m, _CROSSWALK_M))
    for event in beside.sequence.events:
        code = event.person.crosswalk_code if event.kind is EventKind.PERSON_STRUCK else None
        if code in (_PRESENT, _NONE_NOTED):
            agreement = Agreement.of((code == _PRESENT) is near)
            found = f"{'a' if near else 'no'} crosswalk within {_CROSSWALK_M:.0f} m"
            yield Fact("crosswalk", ComparedWith.MAP, agreement, PBCWALK.meaning(code), found)


def _first_pair(beside: Comparison, first: ObservedEvent) -> Fact:
    contacts = beside.sequence.contacts
    expected = contacts[:1] if beside.sequence.order_known else contacts
    agreement = Agreement.of(first.pair in {event.pair for event in expected})
    said = " or ".join(" and ".join(party_in_words(number) for number in event.pair) for event in expected)
    found = " and ".join(map(party_in_words, first.pair))
    return Fact("striking vehicle", ComparedWith.COURSE, agreement, said, found, essential=True)


def _of_vehicle(record: CrashRecord, event: CrashEvent, seen: ObservedEvent) -> Iterator[Fact]:
    vehicle = event.as_struck(event.vehicle.number)
    drove = seen.vehicles[vehicle.number]
    yield from _motion_facts(record, vehicle, drove, struck="strike", before="strike")


def _motion_facts(
    record: CrashRecord, vehicle: VehicleRecord, drove: ObservedVehicle, *, struck: str, before: str
) -> Iterator[Fact]:
    facts = (
        (f"impact of the {struck}", impact_fact(vehicle, drove) if struck else None),
        (f"movement before the {before}", movement_fact(record, vehicle, drove)),
        (f"speed before the {before}", speed_fact(vehicle, drove)),
    )
    yield from (replace(found, name=name) for name, found in facts if found is not None)


def _of_person(record: CrashRecord, event: CrashEvent, seen: ObservedEvent, walked: ObservedPerson) -> Iterator[Fact]:
    person, turn, drove = event.person, turn_of(event.vehicle), seen.vehicles[event.vehicle.number]
    course = course_error_deg(drove, walked, person, turn)
    if course is not None:
        told = ", ".join(sorted(each.value.replace("_", " ") for each in reported_directions(person, turn)))
        found = f"{course:.0f} deg off"
        yield _fact("course of the person", Agreement.of(course <= _COURSE_DEG), told, found, person.party)
    zones = reported_zones(record, person)
    outside = zone_error_m(walked.outside_m, zones)
    if outside is not None:
        agreement = Agreement.of(outside <= _IN_ZONE_M)
        said = ", ".join(sorted(zones))
        side = "outside" if walked.outside_m > 0 else "within"
        where = f"{abs(walked.outside_m):.1f} m {side} the carriageway's edge"
        yield _fact("zone of the person", agreement, said, where, person.party)
    heading = walked.heading_rad if walked.moves else None
    for party, table, code, headed in (
        (event.vehicle.number, MOTDIR, person.motorist_direction_code, drove.approach_rad),
        (person.party, PEDDIR, person.pedestrian_direction_code, heading),
    ):
        error = compass_error_deg(headed, code)
        if error is not None:
            found = f"{error:.0f} deg outside that quarter"
            yield _fact("compass direction", Agreement.of(error <= _COURSE_DEG), table.meaning(code), found, party)


def _fact(name: str, agreement: Agreement, reported: str, found: str, party: int) -> Fact:
    return Fact(name, ComparedWith.COURSE, agreement, reported, found, vehicle_number=party)


# --- departures from the road ----------------------------------------------------------------------------------------
def departure_facts(beside: Comparison) -> Iterator[Fact]:
    """Yield every reported fact about a vehicle's departure from the road; nothing if none happened.

    >>> facts = departure_facts(tree_comparison)
    >>> {fact.name: fact.agreement.value for fact in facts}["side of the departure"]
    'agrees'
    """
    event = beside.begins
    seen = None if event is None else beside.seen(event)
    if event is None or seen is None or seen.departure is None:
        return
    record, number, left = beside.record, event.vehicle.number, seen.departure
    side = beside.departure.side
    if side is not None:
        found = " or ".join(left.sides) or "on the road"
        yield _fact("side of the departure", Agreement.of(side in left.sides), side.value, found, number)
    zone = reported_zone(record)
    error_m = roadside_error_m(left.place, zone)
    if zone is not None and error_m is not None:
        found = "nowhere near a road" if left.place is None else left.place.zone.value
        yield _fact("part of the road", Agreement.of(error_m <= _IN_PART_M), zone.value, found, number)
    drove = seen.vehicles.get(number)
    if drove is None:
        return
    struck = "object" if event.kind is EventKind.OBJECT_STRUCK else ""
    yield from _motion_facts(record, event.as_struck(number), drove, struck=struck, before="departure")
