"""Measures of a vehicle beside its report. Nothing here passes or fails: :mod:`rules` judges."""

from __future__ import annotations

import math

from trace_dag.common.units import clock_difference_h, wrap_angle
from trace_dag.crash.classes import RoadTopology
from trace_dag.crash.record import CrashRecord, ImpactArea, Moment, PreCrashMovement, VehicleRecord
from trace_dag.verdict.directions import relation_error_deg, reported_relations_deg, reported_turns_deg, turn_error_deg
from trace_dag.verdict.observation import LEAST_SPEED_MPS, ObservedVehicle

_SKEWED = frozenset({RoadTopology.Y, RoadTopology.ROUNDABOUT, RoadTopology.FIVE_POINT_OR_MORE})


def relation_error(
    one: ObservedVehicle, two: ObservedVehicle, first: VehicleRecord, second: VehicleRecord, record: CrashRecord
) -> float | None:
    """Return the difference of the angle between two approaches from the reported one (degrees).

    Crossing or joining streets mean a right angle, but not where legs meet at other angles by the report's own words.
    Within the corner of an L those who meet head-on or follow each other may have any angle between them: None.

    >>> one, two = first_contact.vehicles.values()
    >>> relation_error(one, two, *record.vehicles, record) < 20.0  # one turned left across the other's way
    True
    """
    if record.road_topology is RoadTopology.L:
        return None
    allowed = reported_relations_deg(record, first, second)
    if record.road_topology in _SKEWED:
        allowed -= {90.0}
    return relation_error_deg(abs(math.degrees(wrap_angle(one.approach_rad - two.approach_rad))), allowed)


def turn_error(seen: ObservedVehicle, reported: VehicleRecord, topology: RoadTopology) -> float | None:
    """Return the difference of a vehicle's turn from the reported one, where its words mean what they mean elsewhere.

    A vehicle that backs goes backward, whichever way. Round a roundabout only entering and leaving are turns. At an L a
    report calls a turn what on the map is the road's own bend.

    >>> round(turn_error(first_contact.vehicles[2], record.vehicles[1], record.road_topology), 1)  # straight on
    0.0
    """
    allowed = reported_turns_deg(reported)
    if reported.movement is PreCrashMovement.BACKING:
        return 0.0 if seen.impact_speed_mps < 0 else 180.0
    if topology is RoadTopology.ROUNDABOUT and reported.movement is PreCrashMovement.NEGOTIATING_CURVE:
        return None
    if topology is RoadTopology.L:
        allowed |= {0.0}
    return turn_error_deg(seen.turn_deg, allowed, seen.offered_turns_deg)


def heading_error(seen: ObservedVehicle, reported: VehicleRecord) -> float | None:
    """Return the difference of a vehicle's heading from the reported direction of travel (degrees, 0 to 180).

    None if none is reported and of one that backed.

    One that turned is headed as before or as after its turn where the report does not say when.

    >>> heading_error(first_contact.vehicles[1], record.vehicles[0]) is None  # FARS gives none
    True
    """
    heading = reported.heading
    if heading is None or reported.movement is PreCrashMovement.BACKING:
        return None
    ways = []
    if heading.moment is not Moment.AFTER:
        ways.append(seen.approach_rad)
    if heading.moment is not Moment.BEFORE:
        ways.append(seen.approach_rad + math.radians(seen.turn_deg))
    return min(abs(math.degrees(wrap_angle(way - heading.octant.heading_rad))) for way in ways)


def clock_error_positions(clock_h: float, area: ImpactArea | None) -> float | None:
    """Return the clock positions (30 degrees each) from a place on the body to the middle of the reported area.

    None if no area is reported.

    >>> three = record.vehicles[0].impact  # 3 o'clock
    >>> round(clock_error_positions(3.4, three), 6), round(clock_error_positions(5.0, three), 6)
    (0.4, 2.0)
    """
    return None if area is None else clock_difference_h(clock_h, area.clock_h)


def speed_error_rel(simulated_mps: float, reported: VehicleRecord | None) -> float | None:
    """Return the signed difference of a speed from the reported one, relative to that; None where none is reported.

    >>> round(speed_error_rel(33 * 0.44704, record.vehicles[1]), 6)  # 33 mph, reported are 30
    0.1
    """
    if reported is None or reported.travel_speed_mps is None:
        return None
    error = (abs(simulated_mps) - reported.travel_speed_mps) / max(reported.travel_speed_mps, LEAST_SPEED_MPS)
    return min(error, 0.0) if reported.travel_speed_is_lower_bound else error
