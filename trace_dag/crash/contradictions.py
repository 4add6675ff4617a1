"""Fields of one report that do not agree with each other: listed as sentences, never hidden or settled here."""

from __future__ import annotations

import re
from collections.abc import Callable, Iterator, Mapping
from typing import Final

from trace_dag.common.messages.wording import count_of
from trace_dag.common.units import mps_to_mph
from trace_dag.crash.codes import elements as codes
from trace_dag.crash.codes.table import CodeTable
from trace_dag.crash.crash_types import Side, crash_type, crash_type_of, trajectories_disagree
from trace_dag.crash.derive import (
    CORNER_H,
    SAME_AREA_H,
    UNSAID_MOVEMENTS,
    agrees_with_manner,
    area_in,
    impact_area,
    implied_movement,
    is_near,
    is_on_side,
)
from trace_dag.crash.parties import EventKind, PartyKind
from trace_dag.crash.record import (
    STOPPED_MOVEMENTS,
    CrashRecord,
    EventRecord,
    PreCrashMovement,
    VehicleRecord,
    first_vehicle_contact,
)
from trace_dag.crash.summary import event_in_words
from trace_dag.crash.zones import ZONES_OF_BIKEPOS, ZONES_OF_LOCATION, ZONES_OF_PEDPOS

_TURNS: Final = frozenset({PreCrashMovement.TURNING_LEFT, PreCrashMovement.TURNING_RIGHT})
_MAY_STAND: Final = STOPPED_MOVEMENTS | {
    PreCrashMovement.NO_DRIVER,
    PreCrashMovement.STARTING,
    PreCrashMovement.DECELERATING,
    PreCrashMovement.LEAVING_PARKING,
    PreCrashMovement.ENTERING_PARKING,
}
_TWO_WAY_UNDIVIDED: Final = frozenset({1, 5})  # VTRAFWAY
_INTERSTATE_CLASS: Final = 1  # FUNC_SYS
_MINOR_CLASSES: Final = frozenset({6, 7})  # FUNC_SYS: minor collector, local road
_NUMBERED: Final = re.compile(r"\b(?P<system>INTERSTATE|IH|IR|I|US|SR|CR)[\s-]*\d+", re.IGNORECASE)
_SIGNS: Final[Mapping[str, frozenset[int]]] = {
    "I": frozenset({1}),
    "U": frozenset({2}),
    "S": frozenset({3, 12}),
    "C": frozenset({4, 5, 12}),
}
"""``ROUTE`` by the first letter of the system in a road's number; secondary routes (12) are numbered by either."""
_BESIDE_A_ROUTE: Final = frozenset({7, 10, 11})  # frontage, forest and business routes bear the number of another
_RAMP: Final = re.compile(r"\bRAMP\b", re.IGNORECASE)
_SHOWN_SIDE_H: Final[Mapping[Side, float]] = {Side.RIGHT: 2.0, Side.LEFT: 10.0}
"""The middle of what a vehicle shows another one that it has on one side or ahead."""
_SHOWN_REACH_H: Final = 3.5
"""From the front and a side's middle: the other corner of the front, and all of that side."""
_STOPPED_MAX_MPS: Final = 2.3
"""A vehicle coded as stopped may still have been rolling at walking pace (5 mph)."""


def contradictions_of(record: CrashRecord) -> tuple[str, ...]:
    """Return every disagreement found, as sentences that name the fields and their values.

    >>> contradictions_of(record)
    ()
    """
    return tuple(sentence for _, sentence in name_contradictions(record))


def name_contradictions(record: CrashRecord) -> Iterator[tuple[str, str]]:
    """Yield every contradiction: its subject, in one or two fixed words, and its sentence.

    >>> list(name_contradictions(record))
    []
    """
    for about, check in _CHECKS.items():
        for sentence in check(record):
            yield about, sentence


def _named(table: CodeTable, code: int | None) -> str:
    return f"{table.element} {code} ({table.meaning(code)})"


def _crash_type(vehicle: VehicleRecord) -> str:
    return _named(codes.ACC_TYPE, vehicle.crash_type_code)


def _vehicle_counts(record: CrashRecord) -> Iterator[str]:
    stated, listed = record.vehicles_in_transport, sum(vehicle.in_transport for vehicle in record.vehicles)
    if stated is not None and stated != listed:
        yield f"VE_FORMS says {count_of(stated, 'vehicle')} in transport, but the report lists {listed}"


def _crash_types(record: CrashRecord) -> Iterator[str]:
    pair = record.colliding_vehicles
    if pair and trajectories_disagree([vehicle.crash_type_code for vehicle in pair]):
        classes = " and ".join(f"{crash_type_of(vehicle).trajectory} ({vehicle.crash_type_code})" for vehicle in pair)
        yield f"ACC_TYPE puts vehicles {pair[0].number} and {pair[1].number} into different classes: {classes}"


def _impact_against_crash_type(record: CrashRecord) -> Iterator[str]:
    for vehicle in record.colliding_vehicles or ():
        expected = impact_area(crash_type_of(vehicle).impact_code)
        reported = impact_area(vehicle.initial_impact_code) or vehicle.impact
        if expected and reported and not is_near(reported, expected.clock_h, CORNER_H):
            said = "IMPACT1" if impact_area(vehicle.initial_impact_code) else "the event"
            yield (
                f"vehicle {vehicle.number}: {said} says {reported.code}, but {_crash_type(vehicle)} "
                f"means {expected.code}"
            )


def _impact_against_event(record: CrashRecord) -> Iterator[str]:
    collision = first_vehicle_contact(record.events)
    if collision is None or "events" in record.implied:
        return
    for vehicle in record.vehicles:
        in_event, initial = area_in(collision, vehicle.number), impact_area(vehicle.initial_impact_code)
        if in_event and initial and not is_near(initial, in_event.clock_h) and "impact" not in vehicle.implied:
            yield (
                f"vehicle {vehicle.number}: IMPACT1 says {initial.code}, but the collision (event "
                f"{collision.number}) says {in_event.code}"
            )


def _manner_against_impacts(record: CrashRecord) -> Iterator[str]:
    pair = record.colliding_vehicles
    if pair is None or record.first_harmful_event_code != codes.MOTOR_VEHICLE_IN_TRANSPORT:
        return
    first, second = pair[0].impact, pair[1].impact
    if first and second and agrees_with_manner(record.manner_of_collision_code, first, second) is False:
        yield (
            f"{_named(codes.MAN_COLL, record.manner_of_collision_code)} does not agree with the impacts at "
            f"{first.clock_h:g} and {second.clock_h:g} o'clock of vehicles {pair[0].number} and {pair[1].number}"
        )


def _movements(record: CrashRecord) -> Iterator[str]:
    for vehicle in record.vehicles:
        said, implied = vehicle.movement, implied_movement(vehicle)
        if "movement" in vehicle.implied or said in UNSAID_MOVEMENTS or implied is None:
            continue
        # Only a turn to the other side is a contradiction: a turning vehicle may well have been slowing or stopped.
        if {said, implied} == _TURNS:
            yield (
                f"vehicle {vehicle.number}: P_CRASH1 says it {codes.P_CRASH1.meaning(said)}, but ACC_TYPE "
                f"{vehicle.crash_type_code} or P_CRASH2 {vehicle.critical_event_code} that it "
                f"{codes.P_CRASH1.meaning(implied)}"
            )


def _speeds(record: CrashRecord) -> Iterator[str]:
    for vehicle in record.vehicles:
        speed_mps = vehicle.travel_speed_mps
        if speed_mps is None:
            continue
        if vehicle.movement in STOPPED_MOVEMENTS and speed_mps > _STOPPED_MAX_MPS:
            yield (
                f"vehicle {vehicle.number}: P_CRASH1 says it {codes.P_CRASH1.meaning(vehicle.movement)}, but TRAV_SP "
                f"{mps_to_mph(speed_mps):.0f} mph"
            )
        elif speed_mps == 0 and vehicle.movement not in _MAY_STAND | UNSAID_MOVEMENTS:
            yield (
                f"vehicle {vehicle.number}: TRAV_SP says stopped, but it {codes.P_CRASH1.meaning(vehicle.movement)} "
                f"(ACC_TYPE {vehicle.crash_type_code})"
            )


def _junction(record: CrashRecord) -> Iterator[str]:
    intersection, junction = record.intersection_type_code, record.junction_relation_code
    if codes.TYP_INT.known(intersection) is None or junction is None:
        return
    if junction in codes.AT_INTERSECTION if intersection == 1 else junction == codes.AWAY_FROM_JUNCTION:
        yield (
            f"TYP_INT says {codes.TYP_INT.meaning(intersection)} ({intersection}), but RELJCT2 that the crash was "
            f"{codes.RELJCT2.meaning(junction)} ({junction})"
        )


def _first_event_against_sequence(record: CrashRecord) -> Iterator[str]:
    first = record.first_harmful_event_code
    harmful = [event for event in record.events if event.is_harmful]
    # In a sequence put together from the vehicles' own it is the first of one of them, it cannot be told of which.
    if "events" in record.implied:
        of_vehicle: dict[int | None, EventRecord] = {}
        for event in harmful:
            for number in (event.party_1, event.party_2):
                of_vehicle.setdefault(number, event)
        harmful = list(of_vehicle.values())
    else:
        harmful = harmful[:1]
    if first is not None and harmful and first not in {event.code for event in harmful}:
        said = harmful[0]
        yield (
            f"HARM_EV {first} says that the first harmful event is that a vehicle {codes.HARM_EV.meaning(first)}, "
            f"but the sequence begins with event {said.number}, {event_in_words(said)} (SOE {said.code})"
        )


def _first_event(record: CrashRecord) -> Iterator[str]:
    manner, first = record.manner_of_collision_code, record.first_harmful_event_code
    if codes.MAN_COLL.known(manner) is None or first is None:
        return
    if (first == codes.MOTOR_VEHICLE_IN_TRANSPORT) == (manner == 0):
        yield f"{_named(codes.MAN_COLL, manner)} does not agree with HARM_EV {first}"


def _pair_of_crash_types(record: CrashRecord) -> Iterator[str]:
    """Yield a sentence if the two crash types do not form a configuration.

    A vehicle that turns across a path has type 68, the vehicle on that path 69.
    """
    if record.colliding_vehicles is None:
        return
    one, two = (vehicle.crash_type_code for vehicle in record.colliding_vehicles)
    if trajectories_disagree([one, two]):
        return  # said by another check
    of_one, of_two = crash_type(one).counterpart, crash_type(two).counterpart
    if of_one not in (None, two) and of_two not in (None, one):
        yield f"ACC_TYPE {one} and {two} are not a pair: {one} goes with {of_one}"


def _single_driver(record: CrashRecord) -> Iterator[str]:
    pair = record.colliding_vehicles
    for vehicle in pair or ():
        if crash_type_of(vehicle).single_driver and pair and all(each.in_transport for each in pair):
            said = f"{_crash_type(vehicle)} is that of a single vehicle"
            yield f"vehicle {vehicle.number}: {said}, but it collided with another"


def _second_street(record: CrashRecord) -> Iterator[str]:
    """Yield a sentence if a ``TWAY_ID2`` is given away from intersections.

    It occurs in 99.8 % of the two-vehicle crashes of 2015 at intersections, and in 1.4 % of those away from any
    junction.
    """
    intersection, junction = codes.TYP_INT.known(record.intersection_type_code), record.junction_relation_code
    if intersection is None or not record.trafficway_1:
        return
    if intersection == 1 and junction == codes.AWAY_FROM_JUNCTION and record.trafficway_2:
        yield f"TYP_INT and RELJCT2 say no intersection, but TWAY_ID2 names one with {record.trafficway_2}"
    elif intersection != 1 and not record.trafficway_2:
        said = f"{codes.TYP_INT.meaning(intersection)} ({intersection})"
        yield f"TYP_INT says {said}, but TWAY_ID2 names no second street"


def _route(record: CrashRecord) -> Iterator[str]:
    """Yield a sentence if a road's number contradicts its system (``ROUTE``) or class (``FUNC_SYS``).

    In two-vehicle crashes of 2015 whose ``TWAY_ID`` names an interstate, US or state route, ``ROUTE`` is another system
    in 0.5 to 2 % of the crashes. Interstates by name have the class of an interstate in 98.7 %; US routes have that of
    a minor collector or local road in 0.4 %.
    """
    if _RAMP.search(record.trafficway_1):
        return  # it bears the number of the road it leads to, and is signed by whoever keeps it
    systems = {match["system"].upper()[0] for match in _NUMBERED.finditer(record.trafficway_1)}
    by_class = record.function_class_code
    signs = frozenset().union(*(_SIGNS[system] for system in systems)) | _BESIDE_A_ROUTE
    if systems and record.route_code is not None and record.route_code not in signs:
        yield f"TWAY_ID is {record.trafficway_1}, but ROUTE says {codes.ROUTE.meaning(record.route_code)}"
    if by_class is None or not record.trafficway_1:
        return
    is_interstate = "I" in systems
    if by_class == _INTERSTATE_CLASS and not is_interstate:
        yield f"FUNC_SYS says an interstate, but TWAY_ID is {record.trafficway_1}"
    elif (by_class != _INTERSTATE_CLASS and systems == {"I"}) or (by_class in _MINOR_CLASSES and systems == {"U"}):
        yield f"TWAY_ID is {record.trafficway_1}, but FUNC_SYS {codes.FUNC_SYS.meaning(by_class)}"


def _one_lane(record: CrashRecord) -> Iterator[str]:
    for vehicle in record.vehicles:
        if vehicle.lanes == 1 and vehicle.trafficway_code in _TWO_WAY_UNDIVIDED:
            yield f"vehicle {vehicle.number}: VTRAFWAY says two-way undivided, but VNUM_LAN one lane for both ways"


def _turn_away_from_junctions(record: CrashRecord) -> Iterator[str]:
    if record.junction_relation_code != codes.AWAY_FROM_JUNCTION:
        return
    pair = record.colliding_vehicles or ()
    if any(vehicle.movement is PreCrashMovement.U_TURN for vehicle in pair):
        return  # one can turn round anywhere
    for vehicle in pair:
        if crash_type_of(vehicle).needs_junction:
            relation = codes.RELJCT2.meaning(codes.AWAY_FROM_JUNCTION)
            needs = f"{_crash_type(vehicle)} needs a junction or driveway"
            yield f"vehicle {vehicle.number}: {needs}, but RELJCT2 says {relation}"


def _damage_against_impact(record: CrashRecord) -> Iterator[str]:
    for vehicle in record.vehicles:
        hours = [area for area in vehicle.damaged_areas if 1 <= area <= 12]
        reported = impact_area(vehicle.initial_impact_code)
        if hours and reported and not any(is_near(reported, float(hour), CORNER_H) for hour in hours):
            damaged = ", ".join(str(hour) for hour in hours)
            yield f"vehicle {vehicle.number}: IMPACT1 says {reported.code}, but it is damaged at {damaged} o'clock only"


def _impact_against_course(record: CrashRecord) -> Iterator[str]:
    """Yield a sentence if the areas of impact contradict the courses.

    A vehicle that turns across or into a path shows one of its sides. Each vehicle can be struck on its front or on the
    side toward the other. If courses cross, one of the two has a front impact or is struck from behind: two sides do
    not meet.
    """
    pair = record.colliding_vehicles
    for vehicle in pair or ():
        shown, impact = crash_type_of(vehicle).shows, vehicle.impact
        if shown is not None and impact is not None and not is_near(impact, _SHOWN_SIDE_H[shown], _SHOWN_REACH_H):
            yield (
                f"vehicle {vehicle.number}: struck at {impact.clock_h:g} o'clock, but {_crash_type(vehicle)} has the "
                f"other on its {shown} or ahead"
            )
    if pair and all(crash_type_of(vehicle).needs_junction for vehicle in pair):
        impacts = [vehicle.impact for vehicle in pair if vehicle.impact is not None]
        if len(impacts) == 2 and all(is_on_side(impact, SAME_AREA_H) for impact in impacts):
            yield (
                f"courses that cross (ACC_TYPE {pair[0].crash_type_code} and {pair[1].crash_type_code}), but both "
                f"vehicles struck on a side, at {impacts[0].clock_h:g} and {impacts[1].clock_h:g} o'clock"
            )


def _strikes(record: CrashRecord) -> Iterator[str]:
    """Yield a sentence for each person whom a vehicle struck by ``STR_VEH``, but in no event.

    This needs the codes of all events.
    """
    kinds = {event.kind for event in record.events}
    strikes = [event for event in record.events if event.kind is EventKind.PERSON_STRUCK]
    striking = {event.party_1 for event in strikes}
    if not kinds or EventKind.UNKNOWN in kinds or None in striking:
        return
    listed = {vehicle.number for vehicle in record.vehicles}
    for person in record.non_motorists:
        vehicle = person.striking_vehicle
        if person.kind is not PartyKind.OTHER_PERSON and vehicle in listed and vehicle not in striking:
            yield (
                f"person {person.number}: STR_VEH says that vehicle {vehicle} struck it, but no event says that it "
                "struck a person"
            )


def _places_of_persons(record: CrashRecord) -> Iterator[str]:
    """Yield ``LOCATION`` and the typing's position of the same person that cannot both be."""
    for person in record.non_motorists:
        for element, table, code, zones in (
            ("PEDPOS", codes.PEDPOS, person.pedestrian_position_code, ZONES_OF_PEDPOS),
            ("BIKEPOS", codes.BIKEPOS, person.cyclist_position_code, ZONES_OF_BIKEPOS),
        ):
            by_location = ZONES_OF_LOCATION.get(person.location_code or 0)
            if by_location and code is not None and code in zones and not by_location & zones[code]:
                yield (
                    f"person {person.number}: LOCATION says {codes.LOCATION.meaning(person.location_code)} "
                    f"({person.location_code}), but {element} {table.meaning(code)} ({code})"
                )


_CHECKS: Final[Mapping[str, Callable[[CrashRecord], Iterator[str]]]] = {
    "vehicle counts": _vehicle_counts,
    "classes of crash types": _crash_types,
    "pair of crash types": _pair_of_crash_types,
    "single driver": _single_driver,
    "impact and crash type": _impact_against_crash_type,
    "impact and course": _impact_against_course,
    "impact and event": _impact_against_event,
    "impacts and manner": _manner_against_impacts,
    "impact and damage": _damage_against_impact,
    "movement": _movements,
    "speed": _speeds,
    "junction": _junction,
    "second street": _second_street,
    "one lane": _one_lane,
    "route": _route,
    "turn away from junctions": _turn_away_from_junctions,
    "first event": _first_event,
    "first event and sequence": _first_event_against_sequence,
    "strikes": _strikes,
    "places of persons": _places_of_persons,
}
