"""Speeds before the impact: reported ones are kept, others are inferred and marked as such.

A reported travel speed is exactly the speed at the initial state; the share left at the impact is learned from
recorders (:mod:`trace_dag.reconstruction.motion.speed_prior`). Speeds in m/s, accelerations in m/s2.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from trace_dag.common.geometry import FloatArray
from trace_dag.common.units import GRAVITY_MPS2, mph_to_mps
from trace_dag.crash.crash_types import CrashType, Turn
from trace_dag.crash.record import STOPPED_MOVEMENTS, PreCrashMovement, VehicleClass, VehicleRecord
from trace_dag.osm.road_classes import road_class
from trace_dag.reconstruction.motion.speed_coefficients import LIMITS_MPH
from trace_dag.roads.map.model import Road
from trace_dag.simulation.states import SpeedSource

TIME_STEP_S = 0.02
COMFORTABLE_LATERAL_MPS2 = 0.3 * GRAVITY_MPS2  # AASHTO Green Book side friction of low-speed streets, about 0.3
HARDEST_LATERAL_MPS2 = 0.55 * GRAVITY_MPS2  # below the 0.7 to 0.8 a car can hold on dry asphalt

# P_CRASH3 (avoidance) codes that include braking: 2-4, 8, 9 by year, 15 and 16 since 2013.
BRAKING_AVOIDANCE = frozenset({2, 3, 4, 8, 9, 15, 16})
BRAKING_MPS2 = 0.4 * GRAVITY_MPS2
_HARDEST_BRAKING_MPS2 = 0.75 * GRAVITY_MPS2  # tyres on dry asphalt
STARTING_MPS2 = 1.5  # ordinary acceleration from rest

# Speeds while turning where none is reported: NCHRP 659 and AASHTO give 10 to 15 mph for passenger cars.
_TURN_SPEED_MPS = {Turn.LEFT: mph_to_mps(15), Turn.RIGHT: mph_to_mps(12), Turn.U_TURN: mph_to_mps(8)}
_BACKING_SPEED_MPS = mph_to_mps(5)
_PARKING_SPEED_MPS = mph_to_mps(7)
_FROM_STOP_SIGN_MPS = mph_to_mps(15)
_SPEEDING_MPS = mph_to_mps(10)
STOP_CONTROLS = frozenset({20})  # VTRAFCON: a stop sign

_DRIVEN_FIRST_S = 0.5  # of the lead time: a speed was driven before the braking
_STARTING = frozenset({PreCrashMovement.STARTING, PreCrashMovement.ACCELERATING, PreCrashMovement.LEAVING_PARKING})


@dataclass(frozen=True)
class TravelSpeed:
    """Speed at the initial state (m/s) and its source."""

    speed_mps: float
    source: SpeedSource


def travel_speed(
    vehicle: VehicleRecord, crash_type: CrashType, turn: Turn | None, road: Road | None, *, crossing: bool
) -> TravelSpeed:
    """Return the reported speed, or else the most plausible one by manoeuvre, limit and road, in that order.

    >>> from trace_dag.crash.crash_types import crash_type_of
    >>> told = travel_speed(record.vehicles[1], crash_type_of(record.vehicles[1]), None, None, crossing=False)
    >>> round(told.speed_mps / 0.44704), told.source.value  # 30 mph in the report
    (30, 'reported')
    """
    if vehicle.travel_speed_mps is not None:
        return TravelSpeed(vehicle.travel_speed_mps, SpeedSource.REPORTED)
    if vehicle.movement in STOPPED_MOVEMENTS or crash_type.stopped:
        return TravelSpeed(0.0, SpeedSource.INFERRED_MANOEUVRE)
    if vehicle.movement is PreCrashMovement.STARTING:
        return TravelSpeed(0.0, SpeedSource.INFERRED_MANOEUVRE)
    if vehicle.movement is PreCrashMovement.BACKING or crash_type.backing:
        return TravelSpeed(_BACKING_SPEED_MPS, SpeedSource.INFERRED_MANOEUVRE)
    if vehicle.movement in (PreCrashMovement.LEAVING_PARKING, PreCrashMovement.ENTERING_PARKING):
        return TravelSpeed(_PARKING_SPEED_MPS, SpeedSource.INFERRED_MANOEUVRE)
    if turn is not None:
        return TravelSpeed(_TURN_SPEED_MPS[as_on_the_right(turn, road)], SpeedSource.INFERRED_MANOEUVRE)
    if crossing and vehicle.traffic_control_code in STOP_CONTROLS:
        return TravelSpeed(_FROM_STOP_SIGN_MPS, SpeedSource.INFERRED_MANOEUVRE)
    extra = _SPEEDING_MPS if vehicle.speeding else 0.0
    limit = vehicle.speed_limit_mps or (road.speed_mps if road is not None else None)
    if limit:
        return TravelSpeed(limit + extra, SpeedSource.INFERRED_LIMIT)
    return TravelSpeed(class_speed_mps(road) + extra, SpeedSource.INFERRED_CLASS)


def as_on_the_right(turn: Turn, road: Road | None) -> Turn:
    """Return the equivalent turn in right-hand traffic: across oncoming traffic, or close around the corner.

    >>> from dataclasses import replace
    >>> as_on_the_right(Turn.LEFT, replace(network.roads[0], left_hand=True)).value
    'right'
    """
    if road is None or not road.left_hand:
        return turn
    return {Turn.LEFT: Turn.RIGHT, Turn.RIGHT: Turn.LEFT}.get(turn, turn)


def class_speed_mps(road: Road | None) -> float:
    """Return the usual speed on a road of its class (m/s), for a road without a limit on map and report.

    It is the median limit in fatal crashes on such roads.
    """
    highway = road.highway if road is not None else ""
    limit_mph = LIMITS_MPH.get(highway)
    return road_class(highway).speed_mps if limit_mph is None else mph_to_mps(limit_mph)


def brakes(vehicle: VehicleRecord) -> bool:
    """Return whether the record reports braking before the impact.

    >>> from dataclasses import replace
    >>> brakes(record.vehicles[0]), brakes(replace(record.vehicles[0], avoidance_code=16))  # P_CRASH3 16: braking
    (False, True)
    """
    return vehicle.movement is PreCrashMovement.DECELERATING or vehicle.avoidance_code in BRAKING_AVOIDANCE


def starts(vehicle: VehicleRecord, speed_mps: float) -> bool:
    """Return whether the vehicle starts from rest: the movement is a start and its initial speed is zero."""
    return speed_mps == 0.0 and vehicle.movement in _STARTING


@dataclass(frozen=True)
class SpeedProfile:
    """Constant speed up to ``change_time_s`` before the impact, then a constant rate to the speed at impact.

    A ``change_time_s`` of 0 belongs to equal speeds. A vehicle whose start is longer ago than the lead time is already
    moving at the initial state.
    """

    initial_mps: float
    impact_mps: float
    change_time_s: float = 0.0

    def sample(self, lead_time_s: float, after_s: float) -> tuple[FloatArray, FloatArray, FloatArray]:
        """Return times from 0, distances from the impact (negative before it) and speeds.

        The impact is one of the samples.

        After the impact the speed stays constant. A vehicle that brakes begins within the lead time, and loses no more
        speed in it than tyres allow.

        >>> _, _, speeds = SpeedProfile(30.0, 12.0, 4.0).sample(2.5, 0.0)
        >>> float(speeds[0]), round(float(speeds[-1]), 1)  # 2 s at 0.75 g
        (30.0, 15.3)
        """
        n = math.ceil(lead_time_s / TIME_STEP_S - 1e-9)
        step = lead_time_s / n
        time = np.arange(n + math.ceil(after_s / step) + 1) * step
        until = lead_time_s - time
        change, lost = self.change_time_s, self.initial_mps - self.impact_mps
        if change <= 0:
            return np.asarray(time), np.asarray(-self.impact_mps * until), np.full_like(time, self.impact_mps)
        within_s = max(lead_time_s - _DRIVEN_FIRST_S, lead_time_s / 2)
        if lost > 0 and change > within_s:
            change = within_s
            lost = min(lost, _HARDEST_BRAKING_MPS2 * change)
        impact_mps = self.initial_mps - lost
        within = np.clip(until, 0.0, change)
        speed = impact_mps + lost * within / change
        distance = impact_mps * until + lost * (0.5 * within**2 / change + np.maximum(until - change, 0.0))
        return np.asarray(time), np.asarray(-distance), np.asarray(speed)


def least_turn_radius_m(vehicle_class: VehicleClass, length_m: float) -> float:
    """Return the radius of the tightest path of a body's centre, metres (AASHTO design vehicles, centreline radii).

    >>> least_turn_radius_m(VehicleClass.CAR, 4.85), least_turn_radius_m(VehicleClass.BUS, 12.0)
    (6.0, 11.0)
    """
    if vehicle_class is VehicleClass.MOTORCYCLE:
        return 4.0
    if vehicle_class in (VehicleClass.TRUCK, VehicleClass.BUS, VehicleClass.TRACTOR_TRAILER) or length_m > 8:
        return 11.0
    return 6.0
