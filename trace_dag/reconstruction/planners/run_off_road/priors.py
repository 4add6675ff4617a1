"""The ways of leaving the road that a report allows: how sharply, and how far the body is turned from its course.

The sharpness is not reported. Each manner has several lateral accelerations, and what angle to the road each leads
to is weighed by the angles that were measured. A vehicle out of control skids: it goes on along its course and turns
about itself, so far that the area of impact faces the object."""

from __future__ import annotations

import math
from dataclasses import dataclass
from statistics import NormalDist
from typing import Final

import numpy as np

from trace_dag.common.units import GRAVITY_MPS2
from trace_dag.crash.departure_side import DepartureSide
from trace_dag.crash.event_sequence import CrashEvent
from trace_dag.crash.record import ImpactArea, PreCrashMovement, VehicleClass
from trace_dag.crash.road_departure import Departure, DepartureManner
from trace_dag.reconstruction.motion.manoeuvres import Option
from trace_dag.reconstruction.planners.run_off_road.path import SIGN
from trace_dag.simulation.objects import KINDS, ObjectForm

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
    """Return the ways of leaving that the manner, the curve and the area of impact allow.

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
    """Return the log-likelihood of an angle at which a vehicle leaves the road, 0 for the likeliest.

    >>> at = {degrees: angle_log_likelihood(math.radians(degrees)) for degrees in (3, 8, 15, 30)}
    >>> [round(value, 1) for value in at.values()]
    [-1.4, -0.3, -0.0, -0.7]
    """
    root = math.sqrt(math.degrees(abs(angle_rad)))
    return -0.5 * ((root - _ROOT_OF_ANGLE.mean) / _ROOT_OF_ANGLE.stdev) ** 2


def _slip(departure: Departure) -> float:
    """Return the slip angle at the impact.

    So that the area of impact faces ahead, where the report says that the vehicle skidded sideways or the area is one
    that a vehicle going ahead is not struck at.
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
    """Return the angle by which the body has to be turned for an area to face the object.

    Ahead if it is compact, beside if it runs along the road; None if the area is struck without turning.
    """
    sign = SIGN[departure.side or DepartureSide.AHEAD]
    if KINDS[first.code].form is ObjectForm.LINE and sign:
        # A vehicle that leaves at a small angle strikes first with the front corner on that side.
        apart = abs(math.remainder(area.centre_rad - sign * math.pi / 4, math.tau))
        return None if apart <= _CORNER_RAD else sign * math.pi / 2 - area.centre_rad
    at_near_corner = abs(area.centre_rad) <= math.pi / 2 + math.radians(5) and area.centre_rad * sign > 0
    return None if abs(area.centre_rad) < _AREA_REACHED_RAD or at_near_corner else -area.centre_rad
