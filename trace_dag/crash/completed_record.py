"""A record of any register, completed by the values that its fields imply.

Belongs here: the order of the steps. The rules are those of :mod:`trace_dag.crash.derive`; every implied value is
marked.

Crash types (``ACC_TYPE``) follow from the manner of collision, the movements and the reported directions. FARS codes
them; other registers report the facts behind them. A type is set if only one configuration fits, both
for a turning vehicle's direction from before its turn and from after it. Otherwise the directions are only evidence.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Final

from trace_dag.common.dataclass_tools import replace
from trace_dag.common.units import wrap_angle
from trace_dag.crash.classes import RoadTopology, collision_type, road_topology
from trace_dag.crash.codes.elements import TYP_INT
from trace_dag.crash.contradictions import contradictions_of
from trace_dag.crash.crash_types import Turn, turn_of, vehicle_trajectory
from trace_dag.crash.derive import (
    UNSAID_MOVEMENTS,
    add_crash_types,
    add_impacts,
    implied_movement,
    movement_of_crash,
)
from trace_dag.crash.record import CrashRecord, EventRecord, PreCrashMovement, VehicleRecord, colliding_pair
from trace_dag.crash.summary import summarise

_REAR_END, _ANGLE = 1, 6  # MAN_COLL
_STRUCK_WHILE: Final = {PreCrashMovement.STOPPED: 20, PreCrashMovement.DECELERATING: 28}
"""The type of the vehicle that strikes from behind, by what the one ahead did."""
_TURNING: Final = 24
_STEP_OF_TURN: Final = {Turn.LEFT: 2, Turn.RIGHT: 3}
_STRAIGHT_ON: Final = frozenset({PreCrashMovement.GOING_STRAIGHT, PreCrashMovement.DECELERATING})
_CROSSED_STRAIGHT: Final = 91
_TURNED_LEFT_FROM_RIGHT: Final = 82  # into the opposite direction of the one that came straight on (83)
_TURNED_RIGHT_FROM_LEFT: Final = 80  # likewise (81)


def complete_record(record: CrashRecord) -> CrashRecord:
    """Add implied crash types, areas of impact and movements, coverage classes, contradictions, and the summary.

    >>> silent = [replace(vehicle, movement=PreCrashMovement.UNKNOWN) for vehicle in record.vehicles]
    >>> complete_record(replace(record, vehicles=tuple(silent))).vehicles[0].movement.name  # by ACC_TYPE 68
    'TURNING_LEFT'
    """
    man_coll, typ_int = record.manner_of_collision_code, record.intersection_type_code
    vehicles = record.vehicles
    if "crash_type_code" in record.register_lacks:
        vehicles = add_implied_types(vehicles, record.events, man_coll)
    vehicles = add_impacts(add_crash_types(vehicles, record.events), record.events, man_coll)
    topology = road_topology(typ_int, record.junction_relation_code)
    topology_implied = TYP_INT.known(typ_int) is None and topology is RoadTopology.NOT_AN_INTERSECTION
    completed = replace(
        record,
        vehicles=vehicles,
        collision_type=collision_type(man_coll),
        road_topology=topology,
        implied=(*record.implied, "road_topology") if topology_implied else record.implied,
    )
    completed = replace(completed, vehicles=tuple(_with_movement(completed, vehicle) for vehicle in vehicles))
    crashed = completed.colliding_vehicles or [vehicle for vehicle in completed.vehicles if vehicle.in_transport]
    completed = replace(completed, vehicle_trajectory=vehicle_trajectory([each.crash_type_code for each in crashed]))
    completed = replace(completed, contradictions=(*record.contradictions, *contradictions_of(completed)))
    return replace(completed, summary=summarise(completed))


def drop_headings(record: CrashRecord) -> CrashRecord:
    """Return the record without directions of travel and the values they imply, like a register that lacks them.

    >>> drop_headings(record) == record  # FARS has none
    True
    """
    headings = [vehicle.heading for vehicle in record.vehicles] + [person.heading for person in record.non_motorists]
    if not any(headings):
        return record
    return complete_record(
        replace(
            record,
            vehicles=tuple(map(_as_reported, record.vehicles)),
            non_motorists=tuple(replace(person, heading=None) for person in record.non_motorists),
            implied=tuple(name for name in record.implied if name != "road_topology"),
            contradictions=(),
        )
    )


def _as_reported(vehicle: VehicleRecord) -> VehicleRecord:
    """Return the vehicle before it was completed, without its heading."""
    found = replace(vehicle, heading=None, implied=tuple(name for name in vehicle.implied if name not in _COMPLETED))
    if "crash_type_code" in vehicle.implied:
        found = replace(found, crash_type_code=None)
    if "movement" in vehicle.implied:
        found = replace(found, movement=PreCrashMovement.UNKNOWN)
    return replace(found, impact=None) if vehicle.in_transport else found


_COMPLETED = frozenset({"crash_type_code", "movement", "impact"})


def _with_movement(record: CrashRecord, vehicle: VehicleRecord) -> VehicleRecord:
    if vehicle.movement not in UNSAID_MOVEMENTS or not vehicle.in_transport:
        return vehicle
    implied = implied_movement(vehicle) or movement_of_crash(record, vehicle)
    if implied is None:
        return vehicle
    return replace(vehicle, movement=implied, implied=(*vehicle.implied, "movement"))


# --- crash types that are implied ------------------------------------------------------------------------------------
def add_implied_types(
    vehicles: Sequence[VehicleRecord], events: Sequence[EventRecord], man_coll: int | None
) -> tuple[VehicleRecord, ...]:
    """Return the vehicles with the implied types of the two in the first contact, marked.

    >>> ahead = replace(queue_record.vehicles[1], crash_type_code=None)  # P_CRASH1 5: stopped
    >>> behind = replace(queue_record.vehicles[0], crash_type_code=None)
    >>> [each.crash_type_code for each in add_implied_types([behind, ahead], queue_record.events, 1)]
    [20, 21]
    """
    pair = colliding_pair([vehicle for vehicle in vehicles if vehicle.in_transport], events)
    if pair is None:
        return tuple(vehicles)
    one, two = pair
    types = _types(man_coll, one, two) or _types(man_coll, two, one)
    return tuple(
        replace(vehicle, crash_type_code=types[vehicle.number], implied=(*vehicle.implied, "crash_type_code"))
        if vehicle.number in types
        else vehicle
        for vehicle in vehicles
    )


def _types(man_coll: int | None, one: VehicleRecord, two: VehicleRecord) -> dict[int, int]:
    """Return the types of both, by number, if ``one`` strikes ``two`` from behind or turns; else empty."""
    if man_coll == _REAR_END:
        return _rear_end(one, two)
    if man_coll != _ANGLE or one.heading is None or two.heading is None:
        return {}
    apart_rad = wrap_angle(one.heading.octant.heading_rad - two.heading.octant.heading_rad)
    across = math.isclose(abs(apart_rad), math.pi / 2)
    if across and {one.movement, two.movement} <= _STRAIGHT_ON:
        return {one.number: _CROSSED_STRAIGHT, two.number: _CROSSED_STRAIGHT}
    turn, sign, type_of_turner = (
        (Turn.RIGHT, -1, _TURNED_RIGHT_FROM_LEFT) if one.keeps_left else (Turn.LEFT, 1, _TURNED_LEFT_FROM_RIGHT)
    )
    if across and apart_rad * sign > 0 and turn_of(one) is turn and two.movement in _STRAIGHT_ON:
        # Of who turns left across or into the other's path from any other side no direction, before or after the turn,
        # is to the left of the other's.
        # Where traffic keeps left, it is all in a mirror.
        return {one.number: type_of_turner, two.number: type_of_turner + 1}
    return {}


def _rear_end(behind: VehicleRecord, ahead: VehicleRecord) -> dict[int, int]:
    base, step = _STRUCK_WHILE.get(ahead.movement), 1
    turn = turn_of(ahead)
    if turn in _STEP_OF_TURN:
        base, step = _TURNING, _STEP_OF_TURN[turn]
    slower = behind.movement in _STRUCK_WHILE or turn_of(behind) is not None
    return {} if base is None or slower else {behind.number: base, ahead.number: base + step}
