"""Departures from the lane: the path off the road, the skid, and how sharply and turned by how much a vehicle leaves.

The sharpness is not reported. Each manner has several lateral accelerations, and what angle to the road each leads
to is weighed by the angles that were measured. A vehicle out of control skids: it goes on along its course and turns
about itself, so far that the area of impact faces the object. Frame: the local frame; stations in metres along a path,
offsets to the left.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from statistics import NormalDist
from typing import Final

import numpy as np

from trace_dag.common.geometry import Pose
from trace_dag.common.paths import LateralShift, Path, shifted
from trace_dag.common.units import GRAVITY_MPS2
from trace_dag.crash.crash_types import DepartureSide
from trace_dag.crash.event_sequence import CrashEvent
from trace_dag.crash.record import ImpactArea, PreCrashMovement, VehicleClass
from trace_dag.crash.road_departure import Departure, DepartureManner
from trace_dag.reconstruction.assemble import round_trajectory
from trace_dag.reconstruction.motion.manoeuvres import Option
from trace_dag.reconstruction.motion.speed_prior import speed_profile
from trace_dag.reconstruction.motion.speeds import SpeedProfile, brakes
from trace_dag.reconstruction.pre_crash_scenarios import Party
from trace_dag.reconstruction.scene.scene import Scene
from trace_dag.simulation.objects import KINDS, ObjectForm
from trace_dag.simulation.states import ParticipantState, Trajectory

_STRAY_RAD: Final = math.radians(20)  # out of control but struck at the front
_UNKNOWN_RAD: Final = math.radians(35)  # out of control, area not known
_AREA_REACHED_RAD: Final = math.radians(75)  # an area this far from the front is struck only by a vehicle that skids
_CORNER_RAD: Final = math.radians(50)  # areas this near to a corner are struck together with it
_CURVE_RAD: Final = math.radians(6)
_CLOCKWISE, _COUNTER_CLOCKWISE = 3, 4  # PCRASH4
_ROOT_OF_ANGLE: Final = NormalDist(3.9, 1.3)
"""Square roots of angles of departure in degrees are normally distributed and independent of the speed (NCHRP Report
665, 2010, chapter 6). Of 877 crashes the mean angle was 16.9 degrees; its standard deviation of 10.5 degrees, from
which the two numbers follow, is from memory."""
_STEEPEST: Final = math.tan(math.radians(30))
FLATTEST: Final = 0.03
_ROOM_M: Final = 0.8  # from a path to the carriageway's edge, at least: nearly half a car
_AWAY_M: Final = 4.0  # longest distance along the road to the edge that the vehicle can have crossed
_EDGE_JUMPS_M: Final = 0.5  # if the edge nearby is this much nearer, a side street opens at the place
_LOOK_AHEAD_M: Final = (-15.0, 45.0)  # from the place: where the end of the road is looked for
SKID_S: Final = 1.2
_BRAKES_G: Final = 0.4  # the most beyond the edge: grass and gravel hold little more
_SKID_G: Final = 0.3  # mean while the slip builds up to sliding sideways
_LEAST_SHARE: Final = 0.4  # least share of the speed that is left after skidding
SIGN: Final = {DepartureSide.LEFT: 1.0, DepartureSide.RIGHT: -1.0, DepartureSide.AHEAD: 0.0}


def sign_of(departure: Departure) -> float:
    """Return the side of a departure as a sign, 1 to the left; the near edge's if none is reported.

    >>> sign_of(departure)  # ACC_TYPE 1: off the right edge
    -1.0
    """
    near = DepartureSide.LEFT if departure.vehicle.keeps_left else DepartureSide.RIGHT
    return SIGN[departure.side or near]


GOES_ON_M: Final = 60.0
"""So far a course off the road is followed beyond the place it is anchored at."""


def slope_of(off_m: float, lateral_mps2: float, speed_mps: float) -> float:
    """Return the slope of a course at a distance from its lane, after a constant lateral acceleration.

    >>> slope_of(3.0, 1.0, 20.0)  # sqrt(2 * 3 * 1 / (1.5 * 20 ** 2))
    0.1
    """
    steep = math.sqrt(2 * off_m * lateral_mps2 / (1.5 * max(speed_mps, 5.0) ** 2))
    return min(max(steep, FLATTEST), _STEEPEST)


def path_aside(
    base: Path, anchor_m: float, off_m: float, slope: float, lateral_mps2: float, speed_mps: float
) -> tuple[Path, float]:
    """Return the path that leaves ``base`` and is ``off_m`` to its left at a station, and that station on it.

    It continues with that slope.

    >>> from trace_dag.common.paths import from_points
    >>> line = np.linspace(0.0, 200.0, 401)
    >>> east = from_points(line, np.zeros(401), np.zeros(401))
    >>> path, station_m = path_aside(east, 100.0, 4.0, 0.1, 3.0, 20.0)
    >>> round(path.pose(station_m).y_m, 2)  # 4 m to the left there
    4.0
    """
    sign, far_m = math.copysign(1.0, off_m), abs(off_m)
    ramp_m = min(1.5 * slope * max(speed_mps, 5.0) ** 2 / max(lateral_mps2, 1e-6), 2 * far_m / slope)
    shift = LateralShift(sign * (far_m + slope * GOES_ON_M), off_m, slope, max(ramp_m, 1.0))
    path = shifted(base, shift, anchor_s_m=anchor_m)
    at = base.pose(anchor_m).to_world(np.array([0.0, off_m]))
    return path, path.project(float(at[0]), float(at[1]), near_s_m=anchor_m)[0]


def skid_profile(who: Party, speed_mps: float, slip_rad: float) -> SpeedProfile:
    """Return the speed up to the impact; a sideways skid brakes.

    >>> from trace_dag.reconstruction.pre_crash_scenarios import party
    >>> alone = party(tree_record, tree_record.vehicles[0])
    >>> skid_profile(alone, 22.0, 0.0).initial_mps  # it does not skid
    22.0
    """
    if not slip_rad or brakes(who.vehicle):
        return speed_profile(who, speed_mps, most_g=_BRAKES_G)
    lost = _SKID_G * GRAVITY_MPS2 * SKID_S * min(abs(math.sin(slip_rad)) + 0.3, 1.0)
    return SpeedProfile(speed_mps, max(speed_mps - lost, _LEAST_SHARE * speed_mps), SKID_S)


def lane_path(scene: Scene, option: Option) -> Path:
    """Return the path before the departure, driven at this speed.

    In a bend so sharp that this path would leave the carriageway, it follows the middle of the lane instead.
    """
    driven_path = option.path()
    if option.turn is not None:
        return driven_path
    here = driven_path.pose(driven_path.project(*scene.place_xy_m)[0])
    if min(scene.carriageway.edge_beside_m(here, 1.0), scene.carriageway.edge_beside_m(here, -1.0)) >= _ROOM_M:
        return driven_path
    return next((approach.path for approach in scene.approaches if approach.name == option.approach.name), driven_path)


def end_of_road_m(scene: Scene, base: Path, place_m: float, left_m: float) -> float | None:
    """Return the station near the place at which a line beside a path leaves the carriageway, or None."""
    s_m = np.arange(place_m + _LOOK_AHEAD_M[0], place_m + _LOOK_AHEAD_M[1], 0.25)
    x, y, heading = base.plan(s_m)
    x, y = x - left_m * np.sin(heading), y + left_m * np.cos(heading)
    off = ~scene.carriageway.contains(x, y)
    began = np.flatnonzero(off[1:] & ~off[:-1])
    return float(s_m[int(began[0]) + 1]) if len(began) else None


def edge_near(scene: Scene, base: Path, place_m: float, sign: float) -> tuple[float, float]:
    """Return the station at which the vehicle crosses the edge of the carriageway, and the edge's distance.

    It is at the place itself, or nearby if a side street opens there.

    >>> path = lane_path(tree_scene, way_past_the_tree)
    >>> place_m, _ = path.project(*tree_scene.place_xy_m)
    >>> station_m, edge_m = edge_near(tree_scene, path, place_m, -1.0)
    >>> edge_m, station_m == place_m  # half of a lane of 3.5 m; no side street opens there
    (1.75, True)
    """
    stations = place_m + np.arange(-_AWAY_M, _AWAY_M + 0.1, 0.5)
    edges = np.array([scene.carriageway.edge_beside_m(base.pose(float(s)), sign) for s in stations])
    usual = float(edges.min())
    near = np.flatnonzero(edges <= usual + _EDGE_JUMPS_M)
    chosen = int(near[np.argmin(np.abs(stations[near] - place_m))])
    return float(stations[chosen]), float(edges[chosen])


def rotate_pose(pose: Pose, slip_rad: float) -> Pose:
    """Return the pose, turned by an angle (rad, counter-clockwise).

    >>> rotate_pose(Pose(1.0, 2.0, 0.5), 0.25).heading_rad
    0.75
    """
    return Pose(pose.x_m, pose.y_m, math.remainder(pose.heading_rad + slip_rad, math.tau), pose.z_m)


def add_skid(state: ParticipantState, slip_rad: float, lead_s: float) -> ParticipantState:
    """Return the same course with the body rotating over the last part, up to its slip angle at the impact.

    >>> car = hypothesis.participants[0]
    >>> skidded = add_skid(car, 0.5, hypothesis.impact_time_s)
    >>> round(skidded.impact_pose.heading_rad - car.impact_pose.heading_rad, 6)
    0.5
    """
    t = state.trajectory
    share = np.clip((t.time_s - (lead_s - SKID_S)) / SKID_S, 0.0, 1.0)
    slip = slip_rad * share**2
    trajectory: Trajectory = round_trajectory(
        t.time_s, t.x_m, t.y_m, t.z_m, t.heading_rad + slip, t.speed_mps * np.cos(slip)
    )
    impact = int(np.argmin(np.abs(t.time_s - lead_s)))
    return replace(
        state,
        trajectory=trajectory,
        impact_pose=rotate_pose(state.impact_pose, slip_rad),
        impact_speed_mps=float(trajectory.speed_mps[impact]),
        skids_from_s=round(lead_s - SKID_S, 6),
    )


# --- the ways that a report allows -----------------------------------------------------------------------------------
@dataclass(frozen=True)
class LeavingCourse:
    """One way of leaving: lateral acceleration (m/s2), slip angle at the impact, and log-likelihood.

    The angle is of the body against its course (rad, counter-clockwise).
    """

    name: str
    lateral_mps2: float
    slip_rad: float
    log_prior: float


def courses_of(departure: Departure, option: Option, speed_mps: float) -> list[LeavingCourse]:
    """Return the departures that the manner, the curve and the area of impact allow.

    >>> [course.name for course in courses_of(departure, way_past_the_tree, 20.0)]  # it drifted off, and did not skid
    ['at 0.08 g', 'at 0.2 g', 'at 0.35 g']
    """
    manner, side = departure.manner, departure.side
    slip = _slip(departure)
    if side is DepartureSide.AHEAD:
        return [LeavingCourse("straight on" if not slip else "skidding", 0.0, slip, 0.0)]
    if slip:
        lost = _LATERAL_G[DepartureManner.CONTROL_LOST]
        return [LeavingCourse(f"skidding, at {g:g} g", g * GRAVITY_MPS2, slip, 0.0) for g in lost]
    found = [LeavingCourse(f"at {g:g} g", g * GRAVITY_MPS2, 0.0, 0.0) for g in _LATERAL_G[manner]]
    sign = SIGN[side] if side is not None else 0.0
    if option.approach.curve_rad * sign < -abs(_CURVE_RAD) and departure.vehicle.movement is _CURVE:
        here = np.abs(option.approach.path.s_m - option.station_m) < 20.0
        sharpest = float(np.abs(option.approach.path.curvature_1pm[here]).max(initial=0.0))
        lateral = min(sharpest * speed_mps**2, 0.5 * GRAVITY_MPS2)
        if lateral > 0.05 * GRAVITY_MPS2:
            found.insert(0, LeavingCourse("straight on in the curve", lateral, 0.0, 0.3))
    return found


_CURVE: Final = PreCrashMovement.NEGOTIATING_CURVE
# Up to what a driver who looks elsewhere or sleeps lets happen; where control is lost or something is avoided, up to
# what tyres hold on a wet road.
_LATERAL_G: Final = {
    DepartureManner.DRIFT: (0.08, 0.2, 0.35),
    DepartureManner.CONTROL_LOST: (0.15, 0.35, 0.5),
    DepartureManner.AVOIDANCE: (0.2, 0.4, 0.5),
    DepartureManner.END_OF_ROAD: (0.08,),
}


def angle_log_likelihood(angle_rad: float) -> float:
    """Return the log-likelihood of a departure angle, 0 for the likeliest.

    >>> at = {degrees: angle_log_likelihood(math.radians(degrees)) for degrees in (3, 8, 15, 30)}
    >>> [round(value, 1) for value in at.values()]
    [-1.4, -0.3, -0.0, -0.7]
    """
    root = math.sqrt(math.degrees(abs(angle_rad)))
    return -0.5 * ((root - _ROOT_OF_ANGLE.mean) / _ROOT_OF_ANGLE.stdev) ** 2


def _slip(departure: Departure) -> float:
    """Return the slip angle at the impact, with which the area of impact faces ahead.

    It is 0 unless a sideways skid is reported, or the area is not struck in forward motion.
    """
    first, vehicle = departure.objects[0], departure.vehicle
    sideways = vehicle.stability_code in (_CLOCKWISE, _COUNTER_CLOCKWISE, 5)
    if vehicle.vehicle_class is VehicleClass.MOTORCYCLE:
        return 0.0  # a motorcycle that skids sideways falls
    turn = -1.0 if vehicle.stability_code == _CLOCKWISE else 1.0
    if first.area is None:
        return turn * _UNKNOWN_RAD if sideways else 0.0
    facing = _facing(departure, first, first.area)
    if facing is None:
        return turn * _STRAY_RAD if sideways else 0.0
    return math.remainder(facing, math.tau) or turn * _STRAY_RAD


def _facing(departure: Departure, first: CrashEvent, area: ImpactArea) -> float | None:
    """Return the angle by which the body has to turn for an area to face the object.

    The area faces ahead for a compact object, sideways for one along the road; None if it is struck without turning.
    """
    sign = SIGN[departure.side or DepartureSide.AHEAD]
    if KINDS[first.code].form is ObjectForm.LINE and sign:
        # A vehicle that leaves at a small angle strikes first with the front corner on that side.
        apart = abs(math.remainder(area.centre_rad - sign * math.pi / 4, math.tau))
        return None if apart <= _CORNER_RAD else sign * math.pi / 2 - area.centre_rad
    at_near_corner = abs(area.centre_rad) <= math.pi / 2 + math.radians(5) and area.centre_rad * sign > 0
    return None if abs(area.centre_rad) < _AREA_REACHED_RAD or at_near_corner else -area.centre_rad
