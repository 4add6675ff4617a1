"""Points of impact on people: the spot on the vehicle, and where along the vehicle's path that spot meets the place.

Frame: the local frame; stations along the vehicle's path.
"""

from __future__ import annotations

import math
from dataclasses import replace
from typing import Final, NamedTuple

import numpy as np
import shapely
from shapely.geometry.base import BaseGeometry

from trace_dag.common.geometry import FloatArray
from trace_dag.common.paths import Path
from trace_dag.crash.event_sequence import CrashEvent
from trace_dag.crash.record import NonMotorist
from trace_dag.crash.zones import is_in_crosswalk, may_have_crossed_in_crosswalk
from trace_dag.reconstruction import evidence
from trace_dag.reconstruction.motion.contact import ContactPoint, contact_points_of
from trace_dag.reconstruction.motion.manoeuvres import Option
from trace_dag.reconstruction.motion.solver import TURN_SLIDE_SIGMA_M
from trace_dag.reconstruction.motion.walking import RELATIVE_DEG, Course
from trace_dag.reconstruction.scene.scene import Scene
from trace_dag.roads.crash_site.placement import is_at_intersection
from trace_dag.roads.map.people import crosswalks_near, find_unmarked_crosswalks

_MEETS_MPS: Final = 0.3  # at a lower closing speed a face is not touched
_REACH_M: Final = 12.0  # farthest along the path from where it is nearest to the place
_SPOT_REACH_M: Final = 4.0  # and so far beyond where a spot far behind puts the vehicle
_STATION_STEP_M: Final = 0.25
_TURN_SLIDES_M: Final = tuple(float(slide) for slide in range(-14, 15, 2))
_CROSSWALK_M: Final = 8.0  # farthest from the place: on another leg of the intersection it would be another crosswalk
_CROSSWALK_SIGMA_M: Final = 0.7  # people in a crosswalk also walk beside its lines
_IN_CROSSWALK_SIGMA_M: Final = 0.1  # but are in it where the report says so
_UNDRAWN_M: Final = 2.0  # where nobody drew one it may lie so far to either side of the end of the road
_BESIDE_SHARE: Final = 0.07
"""Share of pedestrians struck elsewhere in an intersection that has a crosswalk: 50 of 683 (PEDLOC 1, PBCWALK 1, by
PEDPOS; the national typing of 2016)."""
_LEAST: Final = -200.0  # log-likelihood far from every crosswalk
_TURNED: Final = 0.4  # a vehicle that struck on the far side had completed at least this share of its turn


# --- where on the vehicle ------------------------------------------------------------------------------------------
def contact_point_of(
    strike: CrashEvent, option: Option, impact_mps: float, course: Course, speed_mps: float
) -> ContactPoint | None:
    """Return the contact point of the reported area, or the nearest possible one; None if there is none.

    A trailer is assumed in line.
    """
    vehicle = strike.vehicle
    half_length, half_width = (vehicle.length_m + vehicle.behind_m) / 2, vehicle.width_m / 2
    ahead = -impact_mps if option.backing else impact_mps
    closing = _relative(course, speed_mps, option.backing) - np.array([ahead, 0.0])
    for point in contact_points_of(strike.area, half_length, half_width):
        if float(closing @ np.array(point.normal)) < -_MEETS_MPS:
            return replace(point, ahead_m=point.ahead_m - vehicle.behind_m / 2)
    return None


def _relative(course: Course, speed_mps: float, backing: bool) -> FloatArray:
    """Return the velocity of the person in the vehicle's axes, as planned."""
    if course is Course.STANDING:
        return np.zeros(2)
    angle = math.radians(RELATIVE_DEG[course] + (180.0 if backing else 0.0))
    return np.array([speed_mps * math.cos(angle), speed_mps * math.sin(angle)])


# --- where along the path -------------------------------------------------------------------------------------------
def is_far_side(person: NonMotorist, option: Option) -> bool:
    """Return whether a turning vehicle struck the person on the far side, on leaving the intersection."""
    return option.turn is not None and not person.at_near_side


class Crosswalks(NamedTuple):
    """The crosswalks near the place as one shape, and the share of people who are struck beside them.

    The share is 0 if the report places the person in one.
    """

    shape: BaseGeometry
    beside_share: float

    def log_likelihood(self, x_m: FloatArray, y_m: FloatArray) -> FloatArray:
        """Score strikes at some places by their distances from the crosswalks (m); the arrays have one shape.

        >>> stripes, x_m, y_m = shapely.box(0.0, 0.0, 3.0, 10.0), np.array([1.0, 3.7, 9.0]), np.full(3, 5.0)
        >>> Crosswalks(stripes, 0.0).log_likelihood(x_m, y_m)[:2].round(3) + 0.0  # within, and 0.7 m beside them
        array([  0. , -24.5])
        >>> Crosswalks(stripes, 0.07).log_likelihood(x_m, y_m).round(3) + 0.0  # seldom beside them
        array([ 0.   , -0.456, -2.659])
        """
        off_m = shapely.distance(self.shape, shapely.points(x_m, y_m))
        sigma_m = _CROSSWALK_SIGMA_M if self.beside_share else _IN_CROSSWALK_SIGMA_M
        inside = (1.0 - self.beside_share) * np.exp(-0.5 * (off_m / sigma_m) ** 2)
        with np.errstate(divide="ignore"):
            return np.maximum(np.log(inside + self.beside_share), _LEAST)


def crosswalks_of(scene: Scene, person: NonMotorist) -> Crosswalks | None:
    """Return the map's crosswalks near the place, or None.

    They count if the report places the person in one, or at an intersection without a place on the road.

    If none is mapped, people are taken to cross at the meeting of the roads.
    """
    told = is_in_crosswalk(person)
    if not told and not (is_at_intersection(scene.record) and may_have_crossed_in_crosswalk(person)):
        return None
    within = (scene.network, *scene.place_xy_m, _CROSSWALK_M)
    drawn = [shapely.Polygon(place.corners_m) for place in crosswalks_near(*within)]
    if drawn:
        return Crosswalks(shapely.union_all(drawn), 0.0 if told else _BESIDE_SHARE)
    ends = find_unmarked_crosswalks(*within)
    return Crosswalks(shapely.union_all(ends).buffer(_UNDRAWN_M), _BESIDE_SHARE) if ends else None


def place_impact(
    scene: Scene, path: Path, option: Option, point: ContactPoint, far_side: bool, crosswalks: Crosswalks | None
) -> tuple[Path, float, float]:
    """Return the path, the station at the strike, and the shift of the turn along the road.

    The shift moves the strike to the place.

    >>> drive, place = strike_plan.drive, pedestrian_scene.place_xy_m
    >>> front = ContactPoint(strike_plan.strike.vehicle.length_m / 2, 0.0, (1.0, 0.0))
    >>> path, station_m, slid_m = place_impact(pedestrian_scene, drive.path, drive.option, front, False, None)
    >>> touched = path.pose(station_m).to_world(np.array([front.ahead_m, 0.0]))
    >>> bool(math.dist(touched, place) < 4.0), slid_m  # beside the reported point, in its lane; it does not turn
    (True, 0.0)
    """
    if option.turn is None:
        return path, _station(scene, path, option, point, far_side, 0.0, crosswalks)[0], 0.0
    found = []
    for slide_m in _TURN_SLIDES_M:
        turned = option.path(slide_m)
        station_m, score = _station(scene, turned, option, point, far_side, slide_m, crosswalks)
        score -= 0.5 * (slide_m / TURN_SLIDE_SIGMA_M) ** 2
        found.append((round(score, 6), -abs(slide_m), turned, station_m, slide_m))
    _, _, turned, station_m, slide_m = max(found, key=lambda each: each[:2])
    return turned, station_m, slide_m


def _station(
    scene: Scene,
    path: Path,
    option: Option,
    point: ContactPoint,
    far_side: bool,
    slide_m: float,
    crosswalks: Crosswalks | None,
) -> tuple[float, float]:
    """Return the station at which the contact point is nearest to the place, and its log-likelihood.

    In a turn it must match the progress of the turn; it must be in the crosswalk if the person was in one.
    """
    x, y = scene.place_xy_m
    near, _ = path.project(x, y)
    reach_m = max(_REACH_M, math.ceil(abs(point.ahead_m)) + _SPOT_REACH_M)
    stations = near + np.arange(-reach_m, reach_m + _STATION_STEP_M, _STATION_STEP_M)
    px, py, heading = path.plan(stations)
    if option.backing:
        heading = heading + math.pi
    contact_x = px + point.ahead_m * np.cos(heading) - point.left_m * np.sin(heading)
    contact_y = py + point.ahead_m * np.sin(heading) + point.left_m * np.cos(heading)
    score = evidence.place_log_likelihood(scene.record, np.hypot(contact_x - x, contact_y - y))
    if crosswalks is not None:
        score = score + crosswalks.log_likelihood(contact_x, contact_y)
    if option.turn is not None:
        start = float(path.plan(np.array([option.turn_start_m + slide_m]))[2][0])
        share = (heading - start) / option.turn.angle_rad
        short = np.maximum(_TURNED - share, 0.0) if far_side else np.maximum(share - _TURNED, 0.0)
        score = score - 2.0 * short / _TURNED
    best = int(np.argmax(np.round(score, 6)))
    return float(stations[best]), float(score[best])
