"""Throws of struck people: thrown, glanced, carried along or run over.

A body launched at a speed v, under any angle, comes to rest between v^2 / (2 mu g) and that times 1 + mu^2 further on
(Searle, SAE 831622), with mu = 0.66 for people on pavement. The launch speed is at most the vehicle's or the person's
own speed, so a person who lies further away was carried or pushed. A strike that gives a person less than half of the
vehicle's speed is a glance; a person under the vehicle is run over.
"""

from __future__ import annotations

import math
from enum import StrEnum
from typing import Final

import numpy as np

from trace_dag.common.units import GRAVITY_MPS2
from trace_dag.simulation.types import Body, Contact, VehicleLog

_FRICTION: Final = 0.66
_UNDER_M: Final = 0.45  # height of the middle of who comes under a vehicle
_GLANCED: Final = 0.5
_INSIDE_M: Final = 0.3  # and how far inside the vehicle's outline, seen from above


class Throw(StrEnum):
    """The way in which a struck person left the vehicle."""

    THROWN = "thrown"
    GLANCED = "glanced"
    CARRIED = "carried"
    RUN_OVER = "run over"


def throw_bounds_m(speed_mps: float, friction: float = _FRICTION) -> tuple[float, float]:
    """Return the least and greatest distance to rest after a launch, of people on pavement by default.

    >>> [round(bound_m, 1) for bound_m in throw_bounds_m(15.0)]
    [17.4, 25.0]
    """
    least_m = speed_mps**2 / (2 * friction * GRAVITY_MPS2)
    return least_m, least_m * (1 + friction**2)


def throw_of(contact: Contact, vehicle: VehicleLog, body: Body, person: VehicleLog, thrown_m: float) -> Throw:
    """Return the throw of the person in a strike, given the vehicle's body and log and the person's log.

    >>> log = judged_pedestrian.log
    >>> strike = log.contacts[0]
    >>> car, walker = log.vehicle_log(strike.number_1), log.vehicle_log(strike.number_2)
    >>> throw_of(strike, car, log.bodies[1], walker, throw_bounds_m(math.hypot(*strike.velocity_1_mps))[0]).value
    'thrown'
    """
    if _comes_under(contact.time_s, vehicle, body, person):
        return Throw.RUN_OVER
    speed_mps = max(math.hypot(*contact.velocity_1_mps), math.hypot(*contact.velocity_2_mps))
    least_m, most_m = throw_bounds_m(speed_mps)
    if thrown_m < least_m and math.hypot(*contact.delta_v_2_mps) < _GLANCED * speed_mps:
        return Throw.GLANCED
    return Throw.CARRIED if thrown_m > most_m else Throw.THROWN


def _comes_under(since_s: float, vehicle: VehicleLog, body: Body, person: VehicleLog) -> bool:
    rows = slice(int(np.searchsorted(person.time_s, since_s)), min(len(person.time_s), len(vehicle.time_s)))
    cos, sin = np.cos(vehicle.heading_rad[rows]), np.sin(vehicle.heading_rad[rows])
    dx, dy = person.x_m[rows] - vehicle.x_m[rows], person.y_m[rows] - vehicle.y_m[rows]
    ahead_m, left_m = np.abs(dx * cos + dy * sin), np.abs(dy * cos - dx * sin)
    inside = (ahead_m < body.length_m / 2 - _INSIDE_M) & (left_m < body.width_m / 2 - _INSIDE_M)
    return bool((inside & (person.above_road_m[rows] < _UNDER_M)).any())
