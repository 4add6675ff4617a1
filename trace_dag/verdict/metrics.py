"""Measures of vehicles, people and places beside the report. Nothing here passes or fails: :mod:`rules` judges."""

from __future__ import annotations

import math
from typing import Final

from trace_dag.common.units import clock_difference_h, wrap_angle
from trace_dag.crash.classes import RoadTopology
from trace_dag.crash.crash_types import DepartureSide, Turn
from trace_dag.crash.record import CrashRecord, ImpactArea, Moment, NonMotorist, PreCrashMovement, VehicleRecord
from trace_dag.crash.zones import Zone
from trace_dag.reconstruction.motion.walking import COMPASS_DEG, RELATIVE_DEG, Course, reported_directions
from trace_dag.roads.map.roadside import RoadsidePlace, RoadZone
from trace_dag.verdict.directions import relation_error_deg, reported_relations_deg, reported_turns_deg, turn_error_deg
from trace_dag.verdict.observation import LEAST_SPEED_MPS, ObservedPerson, ObservedVehicle

_SKEWED = frozenset({RoadTopology.Y, RoadTopology.ROUNDABOUT, RoadTopology.FIVE_POINT_OR_MORE})
_COMPASS_DEG: Final = 45.0  # a coded direction is a quarter of the compass
_LANE_BESIDE_M: Final = 0.5  # the edge of a carriageway is drawn no better than so
_BESIDE_M: Final = 4.0  # a full shoulder (AASHTO: 3.0 to 3.6 m) and its edge
_BEYOND_M: Final = 12.0
_ZONES: Final = {
    **dict.fromkeys((1, 11), RoadZone.ROADWAY),
    2: RoadZone.SHOULDER,
    **dict.fromkeys((3, 10, 12), RoadZone.MEDIAN),
    **dict.fromkeys((4, 6, 7), RoadZone.ROADSIDE),
    5: RoadZone.OUTSIDE,
    8: RoadZone.GORE,
}
"""``REL_ROAD``: where the first harmful event was."""
SIDES_IN_WORDS: Final = {
    DepartureSide.LEFT: "to the left",
    DepartureSide.RIGHT: "to the right",
    DepartureSide.AHEAD: "straight ahead",
}
_WIDEST_SHOULDER_M: Final = 4.0


def relation_error(
    one: ObservedVehicle, two: ObservedVehicle, first: VehicleRecord, second: VehicleRecord, record: CrashRecord
) -> float | None:
    """Return the difference of the angle between two approaches from the reported one (degrees).

    Crossing or joining streets imply a right angle, unless other angles are reported. Within the corner of an L,
    vehicles that meet head-on or follow each other may have any angle between them: None.

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
    """Return the difference of a vehicle's turn from the reported one.

    None if the report's words have another meaning here: a backing vehicle may back in any direction, at a roundabout
    only entering and leaving are turns, and at an L a report calls the road's own bend a turn.

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

    None without a report, and for a vehicle that backed.

    For a vehicle that turned, the direction may be that before or after the turn, unless the report distinguishes them.

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
    """Return the signed relative difference of a speed from the reported one; None without a report.

    >>> round(speed_error_rel(33 * 0.44704, record.vehicles[1]), 6)  # 33 mph, reported are 30
    0.1
    """
    if reported is None or reported.travel_speed_mps is None:
        return None
    error = (abs(simulated_mps) - reported.travel_speed_mps) / max(reported.travel_speed_mps, LEAST_SPEED_MPS)
    return min(error, 0.0) if reported.travel_speed_is_lower_bound else error


# --- people ----------------------------------------------------------------------------------------------------------
def zone_error_m(outside_m: float, zones: frozenset[Zone]) -> float | None:
    """Return the distance of a person from the nearest reported zone; None if none is reported.

    ``outside_m`` is measured from the carriageway's edge, negative within it.

    >>> zone_error_m(5.0, frozenset({Zone.BESIDE})), zone_error_m(5.0, frozenset({Zone.OUTSIDE}))
    (1.0, 0.0)
    """
    inside_m = -outside_m
    errors = {
        Zone.CARRIAGEWAY: outside_m,
        Zone.BESIDE: max(inside_m - _LANE_BESIDE_M, outside_m - _BESIDE_M),
        Zone.WALKED: max(inside_m, outside_m - _BEYOND_M),
        Zone.OUTSIDE: inside_m,
    }
    return min((max(errors[zone], 0.0) for zone in zones), default=None)


def course_error_deg(
    drove: ObservedVehicle, walked: ObservedPerson, person: NonMotorist, turn: Turn | None
) -> float | None:
    """Return the least angle between the person's course, seen from the vehicle, and one that the report allows.

    None if it allows any course, or if the person stood.

    For a turning vehicle, the road that is crossed is the one it came from or the one it enters, as reported
    (``PEDSNR``).

    >>> from trace_dag.verdict.observation import observe_crash
    >>> observed = observe_crash(judged_pedestrian.network, judged_pedestrian.hypothesis, judged_pedestrian.log)
    >>> strike = observed.events[0]
    >>> person = pedestrian_record.non_motorists[0]
    >>> round(course_error_deg(strike.vehicles[1], strike.person, person, None))  # he walks straight across
    0
    """
    allowed = reported_directions(person, turn)
    if not allowed or (Course.STANDING in allowed and not walked.moves):
        return None
    if not walked.moves:
        return 180.0
    came = drove.approach_rad
    roads = [came] if turn is None else [came, came + math.radians(drove.turn_deg)]
    if turn is not None and person.at_near_side is not None:
        roads = roads[:1] if person.at_near_side else roads[1:]
    angles = [
        abs(math.degrees(wrap_angle(walked.heading_rad - road)) - RELATIVE_DEG[course]) % 360.0
        for road in roads
        for course in allowed
        if course in RELATIVE_DEG
    ]
    return min((min(angle, 360.0 - angle) for angle in angles), default=180.0)


def compass_error_deg(heading_rad: float | None, code: int | None) -> float | None:
    """Return the deviation of a heading from the coded quarter of the compass.

    None if none is coded, or if the person stood.

    >>> round(compass_error_deg(math.radians(90), 1), 6)  # north, as coded
    0.0
    """
    if heading_rad is None or code is None or code not in COMPASS_DEG:
        return None
    apart = abs(math.degrees(wrap_angle(heading_rad - math.radians(COMPASS_DEG[code]))))
    return max(apart - _COMPASS_DEG, 0.0)


# --- beside the road -------------------------------------------------------------------------------------------------
def reported_zone(record: CrashRecord) -> RoadZone | None:
    """Return the zone of the first harmful event (``REL_ROAD``); None if unknown.

    >>> tree_record.road_relation_code, reported_zone(tree_record).value
    (4, 'roadside')
    """
    return _ZONES.get(record.road_relation_code or 0)


def roadside_error_m(place: RoadsidePlace | None, zone: RoadZone | None) -> float | None:
    """Return the distance of a place from the reported zone; None if none is reported.

    A map without a median or gore there cannot contradict one; the place then only has to be beside the carriageway.
    """
    if zone is None:
        return None
    if place is None:
        return 0.0 if zone is RoadZone.OUTSIDE else math.inf
    if zone is RoadZone.ROADWAY:
        return max(place.beyond_m, 0.0)
    inside_m = max(-place.beyond_m, 0.0)
    if zone is RoadZone.SHOULDER:
        return max(inside_m, place.beyond_m - max(place.shoulder_m, _WIDEST_SHOULDER_M), 0.0)
    return inside_m
