"""Places and directions of people in the simulation beside the report."""

from __future__ import annotations

import math
from typing import Final

from trace_dag.common.units import wrap_angle
from trace_dag.crash.crash_types import Turn
from trace_dag.crash.record import NonMotorist
from trace_dag.crash.zones import Zone
from trace_dag.reconstruction.motion.walking import COMPASS_DEG, RELATIVE_DEG, Course, reported_directions
from trace_dag.verdict.observation import ObservedPerson, ObservedVehicle

_COMPASS_DEG: Final = 45.0  # a coded direction is a quarter of the compass
_LANE_BESIDE_M: Final = 0.5  # the edge of a carriageway is drawn no better than so
_BESIDE_M: Final = 4.0  # a full shoulder (AASHTO: 3.0 to 3.6 m) and its edge
_BEYOND_M: Final = 12.0


def zone_error_m(outside_m: float, zones: frozenset[Zone]) -> float | None:
    """Return how far a person was from the nearest reported zone; None if none is reported.

    ``outside_m``: from the carriageway's edge, negative within it.

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

    None if it allows any, or that the person stood.

    Across is across the road that a turning vehicle came along or turned into, whichever the report says (``PEDSNR``).

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
    """Return how far a heading is outside the coded quarter of the compass.

    None if none is coded, or for a person who stood.

    >>> round(compass_error_deg(math.radians(90), 1), 6)  # north, as coded
    0.0
    """
    if heading_rad is None or code is None or code not in COMPASS_DEG:
        return None
    apart = abs(math.degrees(wrap_angle(heading_rad - math.radians(COMPASS_DEG[code]))))
    return max(apart - _COMPASS_DEG, 0.0)
