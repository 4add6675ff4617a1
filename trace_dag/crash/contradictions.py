"""Fields of one report that do not agree with each other: listed as sentences, never hidden or settled here."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from typing import Final

from trace_dag.crash.classes import trajectories_disagree, trajectory_of_crash_type
from trace_dag.crash.codes.crash import AT_INTERSECTION, AWAY_FROM_JUNCTION, MAN_COLL, RELJCT2, TYP_INT
from trace_dag.crash.codes.events import HARM_EV, MOTOR_VEHICLE_IN_TRANSPORT
from trace_dag.crash.codes.vehicle import ACC_TYPE, P_CRASH1
from trace_dag.crash.derive import (
    CORNER_H,
    UNSAID_MOVEMENTS,
    agrees_with_manner,
    area_in,
    impact_area,
    implied_impact_of_crash_type,
    implied_movement,
    is_near,
)
from trace_dag.crash.record import CrashRecord, EventRecord, Movement, VehicleRecord, first_contact
from trace_dag.crash.summary import event_in_words
from trace_dag.units import mps_to_mph

_TURNS: Final = frozenset({Movement.TURNING_LEFT, Movement.TURNING_RIGHT})
_STILL: Final = frozenset({Movement.STOPPED, Movement.PARKED_IN_LANE})
_MAY_STAND: Final = _STILL | {
    Movement.NO_DRIVER,
    Movement.STARTING,
    Movement.DECELERATING,
    Movement.LEAVING_PARKING,
    Movement.ENTERING_PARKING,
}
_STOPPED_MAX_MPS: Final = 2.3
"""A vehicle coded as stopped may still have been rolling at walking pace (5 mph)."""


def contradictions_of(record: CrashRecord) -> tuple[str, ...]:
    """Every disagreement found, as sentences that name the fields and their values."""
    return tuple(sentence for check in _CHECKS for sentence in check(record))


def _vehicle_counts(record: CrashRecord) -> Iterator[str]:
    stated, listed = record.vehicles_in_transport, sum(vehicle.in_transport for vehicle in record.vehicles)
    if stated is not None and stated != listed:
        yield f"VE_FORMS says {stated} vehicles in transport, but the report lists {listed}"


def _crash_types(record: CrashRecord) -> Iterator[str]:
    pair = record.colliding_pair
    if pair and trajectories_disagree([vehicle.crash_type_code for vehicle in pair]):
        classes = " and ".join(
            f"{trajectory_of_crash_type(vehicle.crash_type_code)} ({vehicle.crash_type_code})" for vehicle in pair
        )
        yield f"ACC_TYPE puts vehicles {pair[0].number} and {pair[1].number} into different classes: {classes}"


def _impact_against_crash_type(record: CrashRecord) -> Iterator[str]:
    for vehicle in record.colliding_pair or ():
        expected = implied_impact_of_crash_type(vehicle.crash_type_code)
        reported = impact_area(vehicle.initial_impact_code)
        if expected and reported and not is_near(reported, expected.clock_h, CORNER_H):
            yield (
                f"vehicle {vehicle.number}: IMPACT1 says {reported.code}, but ACC_TYPE {vehicle.crash_type_code} "
                f"({ACC_TYPE.meaning(vehicle.crash_type_code)}) means {expected.code}"
            )


def _impact_against_event(record: CrashRecord) -> Iterator[str]:
    collision = first_contact(record.events)
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
    pair = record.colliding_pair
    if pair is None or record.first_harmful_event_code != MOTOR_VEHICLE_IN_TRANSPORT:
        return
    first, second = pair[0].impact, pair[1].impact
    if first and second and agrees_with_manner(record.manner_of_collision_code, first, second) is False:
        yield (
            f"MAN_COLL {record.manner_of_collision_code} ({MAN_COLL.meaning(record.manner_of_collision_code)}) "
            f"does not agree with the impacts at {first.clock_h:g} and {second.clock_h:g} o'clock of vehicles "
            f"{pair[0].number} and {pair[1].number}"
        )


def _movements(record: CrashRecord) -> Iterator[str]:
    for vehicle in record.vehicles:
        said, implied = vehicle.movement, implied_movement(vehicle)
        if "movement" in vehicle.implied or said in UNSAID_MOVEMENTS or implied is None:
            continue
        # Only a turn to the other side is a contradiction: a turning vehicle may well have been slowing or stopped.
        if {said, implied} == _TURNS:
            yield (
                f"vehicle {vehicle.number}: P_CRASH1 says it {P_CRASH1.meaning(said)}, but ACC_TYPE "
                f"{vehicle.crash_type_code} or P_CRASH2 {vehicle.critical_event_code} that it "
                f"{P_CRASH1.meaning(implied)}"
            )


def _speeds(record: CrashRecord) -> Iterator[str]:
    for vehicle in record.vehicles:
        speed_mps = vehicle.travel_speed_mps
        if speed_mps is None:
            continue
        if vehicle.movement in _STILL and speed_mps > _STOPPED_MAX_MPS:
            yield (
                f"vehicle {vehicle.number}: P_CRASH1 says it {P_CRASH1.meaning(vehicle.movement)}, but TRAV_SP "
                f"{mps_to_mph(speed_mps):.0f} mph"
            )
        elif speed_mps == 0 and _moving(vehicle):
            yield (
                f"vehicle {vehicle.number}: TRAV_SP says stopped, but it {P_CRASH1.meaning(vehicle.movement)} "
                f"(ACC_TYPE {vehicle.crash_type_code})"
            )


def _moving(vehicle: VehicleRecord) -> bool:
    return vehicle.movement not in _MAY_STAND and vehicle.movement not in UNSAID_MOVEMENTS


def _junction(record: CrashRecord) -> Iterator[str]:
    intersection, junction = record.intersection_type_code, record.junction_relation_code
    if TYP_INT.known(intersection) is None or junction is None:
        return
    if (intersection == 1 and junction in AT_INTERSECTION) or (intersection != 1 and junction == AWAY_FROM_JUNCTION):
        yield (
            f"TYP_INT says {TYP_INT.meaning(intersection)} ({intersection}), but RELJCT2 that the crash was "
            f"{RELJCT2.meaning(junction)} ({junction})"
        )


def _first_event_against_sequence(record: CrashRecord) -> Iterator[str]:
    first = record.first_harmful_event_code
    harmful = [event for event in record.events if HARM_EV.known(event.code) and event.code in HARM_EV.meanings]
    # In a sequence put together from the vehicles' own it is the first of one of them, it cannot be told of which.
    if "events" in record.implied:
        of_vehicle: dict[int | None, EventRecord] = {}
        for event in harmful:
            for number in (event.vehicle_1, event.vehicle_2):
                of_vehicle.setdefault(number, event)
        harmful = list(of_vehicle.values())
    else:
        harmful = harmful[:1]
    if first is not None and harmful and first not in {event.code for event in harmful}:
        said = harmful[0]
        yield (
            f"HARM_EV {first} says that the first harmful event is that a vehicle {HARM_EV.meaning(first)}, but the "
            f"sequence begins with event {said.number}, {event_in_words(said)} (SOE {said.code})"
        )


def _first_event(record: CrashRecord) -> Iterator[str]:
    collision_first = record.first_harmful_event_code == MOTOR_VEHICLE_IN_TRANSPORT
    if MAN_COLL.known(record.manner_of_collision_code) is None or record.first_harmful_event_code is None:
        return
    if collision_first == (record.manner_of_collision_code == 0):
        yield (
            f"MAN_COLL {record.manner_of_collision_code} ({MAN_COLL.meaning(record.manner_of_collision_code)}) does "
            f"not agree with HARM_EV {record.first_harmful_event_code}"
        )


_CHECKS: Final[tuple[Callable[[CrashRecord], Iterator[str]], ...]] = (
    _vehicle_counts,
    _crash_types,
    _impact_against_crash_type,
    _impact_against_event,
    _manner_against_impacts,
    _movements,
    _speeds,
    _junction,
    _first_event,
    _first_event_against_sequence,
)
