"""Overturning: tipping of a vehicle that slides sideways, and its further roll.

A vehicle tips about the wheels on the side toward which it slides. The lateral force at the ground, times the height of
its centre of gravity, tips it; its weight, times half of its track, holds it. On level ground it stays upright as long
as the force is less than its static stability factor times its weight (track / (2 height); NHTSA, DOT HS 809 868, 2005:
passenger cars 1.41, SUVs 1.17, pickups 1.18, vans 1.24 and less; trucks tip from 0.35 to 0.6 g, Winkler and Ervin,
UMTRI-99-19). Tyres on pavement have too little friction to tip a car, but wheels that dig into soil or strike a kerb
can tip it. Against a kerb the lateral speed turns into rotation at once; from the critical sliding velocity on,

v = sqrt(2 g (r - h) (k^2 + r^2)) / h, r^2 = h^2 + (track / 2)^2,

the vehicle goes over (Jones, SAE 750461). Once over it slides and rolls, slowed down by 0.5 g (0.4 to 0.6 in tests:
Orlowski, Bundorf and Moffatt, SAE 851734), and comes to rest on a side, its roof or its wheels. A motorcycle that is
out of control falls on its side without any force.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from functools import cached_property
from typing import Final

from trace_dag.common.units import GRAVITY_MPS2
from trace_dag.crash.record import VehicleClass
from trace_dag.simulation.types import OVERTURNED_RAD, Body

_STABILITY: Final = {
    VehicleClass.CAR: 1.41,
    VehicleClass.SUV: 1.17,
    VehicleClass.PICKUP: 1.18,
    VehicleClass.VAN: 1.17,
    VehicleClass.LIGHT_TRUCK: 1.00,
    VehicleClass.TRUCK: 0.60,
    VehicleClass.TRACTOR_TRAILER: 0.45,
    VehicleClass.BUS: 0.60,
    VehicleClass.OTHER: 1.17,
}
_TRACK: Final = 0.84  # of the width
_GYRATION: Final = 0.33  # radius about the long axis, of the width (Garrott, SAE 930897: 0.55 to 0.65 m of cars)
ROLLS_G: Final = 0.5
"""Deceleration of a vehicle that slides and rolls."""
_FALLS_S: Final = 0.7  # a motorcycle onto its side
_SETTLES_RPS: Final = 2.5
_FASTEST_RPS: Final = 9.0  # peaks of 400 to 600 degrees a second in tests; faster it slides more than it rolls
_LEAST_MPS: Final = 0.5
_SETTLED_RAD: Final = 0.03


@dataclass(frozen=True)
class RollModel:
    """The properties of a body for tipping: height of its centre of gravity, half its track, radius of gyration (m)."""

    height_m: float
    half_track_m: float
    gyration_m: float

    @cached_property
    def arm_m(self) -> float:
        """Return the distance from the outer wheels to the centre of gravity."""
        return math.hypot(self.height_m, self.half_track_m)

    @cached_property
    def standing_rad(self) -> float:
        """Return the angle of the arm above the road while the vehicle stands."""
        return math.atan2(self.height_m, self.half_track_m)

    @cached_property
    def inertia_m2(self) -> float:
        """Return the moment of inertia about the outer wheels, per mass."""
        return self.gyration_m**2 + self.arm_m**2

    @property
    def critical_mps(self) -> float:
        """Return the critical sliding velocity; a slower vehicle at a kerb falls back onto its wheels."""
        over = 2 * GRAVITY_MPS2 * (self.arm_m - self.height_m) * self.inertia_m2
        return math.sqrt(over) / self.height_m


def roll_model(body: Body) -> RollModel | None:
    """Return the roll model of a vehicle; None for a motorcycle, which falls."""
    factor = _STABILITY.get(body.vehicle_class)
    if factor is None:
        return None
    half_track_m = _TRACK * body.width_m / 2
    return RollModel(half_track_m / factor, half_track_m, _GYRATION * body.width_m)


class Roll:
    """The roll of one vehicle while it is out of control. Positive to the right."""

    def __init__(self, body: Body) -> None:
        self._model = roll_model(body)
        self._body = body
        self._side = 0.0  # +1: it tips to its right
        self._tilt_rad = self._rate_rps = 0.0
        self._rolled_m = (body.width_m + body.height_m) / math.pi  # of a rolling box: half its girth by pi
        self.over = False
        """True once it has tipped beyond its wheels: from then on it rolls."""

    @property
    def roll_rad(self) -> float:
        """Roll angle, positive to the right, not wrapped."""
        return self._side * self._tilt_rad

    @property
    def above_road_m(self) -> float:
        """Return the height of the body's middle, while the box stands on a corner or lies on a face."""
        tilt, body = self._tilt_rad, self._body
        return (body.width_m * abs(math.sin(tilt)) + body.height_m * abs(math.cos(tilt))) / 2

    @property
    def settled(self) -> bool:
        """Return whether the vehicle stands on its wheels, or lies on a face."""
        apart = math.remainder(self._tilt_rad, math.pi / 2)
        return abs(apart) < _SETTLED_RAD and (self.over or self._tilt_rad < _SETTLED_RAD)

    def trip(self, lateral_mps: float) -> float:
        """Strike a kerb sideways at a speed to the left; return the remaining lateral speed."""
        model = self._model
        if model is None or self.over:
            return lateral_mps
        self._lean(lateral_mps)
        self._rate_rps += abs(lateral_mps) * model.height_m / model.inertia_m2
        return lateral_mps * model.height_m**2 / model.inertia_m2

    def push(self, left_mps: float, up_mps: float, lateral_mps: float) -> None:
        """Apply an impulse per mass on the leading wheels, to the left and up, on coming onto a slope sideways.

        A lateral force tips the vehicle and an upward force rights it: it tips if their ratio is more than its
        stability.
        """
        model = self._model
        if model is None or self.over:
            return
        self._lean(lateral_mps)
        turning = self._side * left_mps * model.height_m - up_mps * model.half_track_m
        self._rate_rps += max(turning, 0.0) / model.inertia_m2

    def advance(
        self,
        lateral_mps2: float,
        lateral_mps: float,
        speed_mps: float,
        step_s: float,
        weight_mps2: float = GRAVITY_MPS2,
    ) -> None:
        """Advance one step under the lateral acceleration of the tyres (to the left), at a lateral and a total speed.

        ``weight_mps2`` is the pressure on the ground per mass, less than gravity on a slope.
        """
        if self._model is None:
            self._fall(lateral_mps, step_s)
        elif self.over:
            self._go_on(speed_mps, step_s)
        else:
            self._tip(self._model, lateral_mps2, step_s, weight_mps2)

    def _lean(self, lateral_mps: float) -> None:
        if self._tilt_rad == 0.0:
            self._side = 1.0 if lateral_mps < 0 else -1.0  # it tips towards where it slides

    def _tip(self, model: RollModel, lateral_mps2: float, step_s: float, weight_mps2: float) -> None:
        # It tips away from where the ground pushes it. On rolling wheels that is to the outside of its curve, although
        # its centre of gravity may move to the inside; where it slides, it is the side to which it slides.
        self._lean(-lateral_mps2)
        pushed = max(self._side * lateral_mps2, 0.0)
        angle = model.standing_rad + self._tilt_rad
        turning = model.arm_m * (pushed * math.sin(angle) - weight_mps2 * math.cos(angle)) / model.inertia_m2
        self._rate_rps += turning * step_s
        self._tilt_rad += self._rate_rps * step_s
        if self._tilt_rad <= 0.0:
            self._tilt_rad, self._rate_rps = 0.0, max(self._rate_rps, 0.0) if turning > 0 else 0.0
        self.over = angle > math.pi / 2 and self._rate_rps > 0

    def _fall(self, lateral_mps: float, step_s: float) -> None:
        self._lean(lateral_mps)
        self._tilt_rad = min(self._tilt_rad + math.pi / 2 * step_s / _FALLS_S, math.pi / 2)
        self.over = self._tilt_rad > OVERTURNED_RAD

    def _go_on(self, speed_mps: float, step_s: float) -> None:
        """Continue the roll at the present rate, and come to rest on the nearest face before the wheels."""
        rolling = min(speed_mps / self._rolled_m, _FASTEST_RPS)
        quarter = math.pi / 2
        if speed_mps > _LEAST_MPS or self._tilt_rad < quarter:
            self._rate_rps += (max(rolling, _SETTLES_RPS if self._tilt_rad < quarter else 0.0) - self._rate_rps) * min(
                step_s / 0.3, 1.0
            )
            self._tilt_rad += self._rate_rps * step_s
            return
        flat = max(round(self._tilt_rad / quarter), 1) * quarter
        most = _SETTLES_RPS * step_s
        self._tilt_rad += max(-most, min(most, flat - self._tilt_rad))
