"""A record of any register, completed by the values that its fields imply.

Belongs here: the order of the steps. The rules are those of :mod:`trace_dag.crash.derive`; every implied value is
marked.
"""

from __future__ import annotations

from trace_dag.common.frozen import replace
from trace_dag.crash.classes import RoadTopology, collision_type, road_topology
from trace_dag.crash.codes.crash import TYP_INT
from trace_dag.crash.contradictions import contradictions_of
from trace_dag.crash.crash_types import vehicle_trajectory
from trace_dag.crash.derive import (
    UNSAID_MOVEMENTS,
    add_crash_types,
    add_impacts,
    implied_movement,
    movement_of_crash,
)
from trace_dag.crash.implied_types import add_implied_types
from trace_dag.crash.record import CrashRecord, PreCrashMovement, VehicleRecord
from trace_dag.crash.summary import summarise


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
    completed = replace(completed, vehicle_trajectory=vehicle_trajectory(_crash_types(completed)))
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


def _crash_types(record: CrashRecord) -> list[int | None]:
    vehicles = record.colliding_vehicles or tuple(vehicle for vehicle in record.vehicles if vehicle.in_transport)
    return [vehicle.crash_type_code for vehicle in vehicles]
