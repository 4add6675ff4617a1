"""The force of a fixed object on a vehicle that strikes it: the crush of the vehicle, and the strength of the object.

MuJoCo moves the vehicle; the force of the object is added here, since a contact of MuJoCo returns the energy and has no
permanent crush. The body is crushed at the face that was struck first, with a stiffness by class, rebounds with the
speed given by the restitution, and slides along the object with friction. The stiffness is proportional to the mass, so
that the depth depends on the speed alone: a car that strikes a pole at 14 m/s is crushed by some 0.8 m (Nystrom and
Kost, SAE 920605), one that strikes a wall squarely as in :mod:`trace_dag.simulation.crush`. An object that yields moves
away under its largest force, and is gone once its energy is spent.

Besides the depth, a pole differs from a wall in two ways. The rebound speed of the whole body depends on the last
force; at the same speed a pole exerts some 0.6 of a wall's force, and so returns less. And a pole makes a pocket, whose
side resists sliding with the same pressure as its floor resists deeper crush, in the ratio of the pocket's depth to the
pole's width.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from functools import cached_property
from typing import Final

from trace_dag.common.geometry import Pose
from trace_dag.common.units import GRAVITY_MPS2
from trace_dag.crash.parties import party_of_body
from trace_dag.crash.record import VehicleClass
from trace_dag.simulation.crush import FROM_WALL_MPS, WALL_CRUSH_M, WALL_TEST_MPS, restitution_at
from trace_dag.simulation.dynamics import Vehicle
from trace_dag.simulation.objects import FixedObject, Resistance
from trace_dag.simulation.outlines import Outline, contact_point, overlap_polygon, separation
from trace_dag.simulation.towing import Towed, whole_kg
from trace_dag.simulation.types import PULSE_S, Contact

POLE_TEST_MPS: Final = 14.0
_POLE_CRUSH_M: Final = {  # at that speed
    VehicleClass.CAR: 0.80,
    VehicleClass.SUV: 0.75,
    VehicleClass.PICKUP: 0.75,
    VehicleClass.VAN: 0.65,
    VehicleClass.LIGHT_TRUCK: 0.65,
    VehicleClass.TRUCK: 0.60,
    VehicleClass.TRACTOR_TRAILER: 0.60,
    VehicleClass.BUS: 0.60,
    VehicleClass.MOTORCYCLE: 0.40,
    VehicleClass.OTHER: 0.75,
    VehicleClass.TRAILER: 0.60,
}
_FRICTION: Final = 0.3  # of sheet metal along steel, concrete or wood: judgement within 0.2 to 0.5
_DEEPEST_POCKET: Final = 1.0  # of the object's width: beyond it the floor gives way before the wall does
_SLIDES_MPS: Final = 0.5  # slower than this, friction along the object fades
_AGAIN_S: Final = 0.2  # bodies that touch again sooner are still in the same contact
_SHRUB_N: Final = 2000.0
_HEAVY_KG: Final = 4536.0  # 10,000 lb: from here on FARS has heavy vehicles
_WOOD_N: Final = {42: 580e3, 30: 245e3}  # by SOE: tree, utility pole
_WOOD_J: Final = 60e3
"""A heavy vehicle breaks trees and poles. A trunk 0.4 m thick, and a pole of 0.3 m, bear so much at a bumper's height
of 0.6 m by the bending strength of green wood, 55 MPa (Wood Handbook, USDA FPL-GTR-190, 2010, table 5-3): stress times
pi d^3 / 32, by 0.6 m. The energy, a tenth of a metre at that force, is judgement."""


def crush_m(vehicle_class: VehicleClass) -> float:
    """Return the crush depth of the class from a pole at :data:`POLE_TEST_MPS`."""
    return _POLE_CRUSH_M[vehicle_class]


@dataclass(frozen=True, eq=False)
class Obstacle:
    """A fixed object of a run."""

    item: FixedObject
    outline: Outline

    @classmethod
    def of(cls, item: FixedObject) -> Obstacle:
        """Return the obstacle at an object's pose."""
        pose = item.pose
        return cls(item, Outline(pose.x_m, pose.y_m, pose.heading_rad, item.length_m / 2, item.width_m / 2))

    @cached_property
    def reach_m(self) -> float:
        """Return the distance from the middle to a corner."""
        return math.hypot(self.outline.half_length_m, self.outline.half_width_m)


class Struck:
    """A vehicle and an object that touch or touched: the crush so far, and the contact for the log."""

    def __init__(self, vehicle: Vehicle, obstacle: Obstacle, time_s: float, restitution: float | None) -> None:
        self.obstacle = obstacle
        self.last_s = self.start_s = time_s
        self._vehicle = vehicle
        self._moved_m = self._spent_j = 0.0
        self._deepest_m: dict[tuple[bool, bool], float] = {}  # by the corner that is pressed in, ahead and left
        self._gone = False
        outline = vehicle.outline()
        _, self._nx, self._ny = separation(outline, obstacle.outline)
        ahead = self._nx * math.cos(outline.heading_rad) + self._ny * math.sin(outline.heading_rad)
        left = self._ny * math.cos(outline.heading_rad) - self._nx * math.sin(outline.heading_rad)
        self._on_vehicle = max(abs(ahead), abs(left)) > 1.0 - 1e-6
        self._face = (ahead, left)
        rate, wall_rate = self._rates(outline)
        self._stiffness_npm = vehicle.model.body.mass_kg * rate * rate
        px, py = contact_point(outline, obstacle.outline)
        vx, vy = _velocity_at(vehicle, px, py)
        self._point = px, py
        self._normal = self._nx, self._ny
        self._pose = Pose(outline.x_m, outline.y_m, math.remainder(outline.heading_rad, math.tau), vehicle.z)
        by = vehicle.puller if isinstance(vehicle, Towed) else None
        self._puller_pose: Pose | None = None
        if by is not None:
            front = by.outline()
            self._puller_pose = Pose(front.x_m, front.y_m, math.remainder(front.heading_rad, math.tau), by.z)
        self._velocity = (vehicle.vx, vehicle.vy) if by is None else (by.vx, by.vy)
        self._closing_mps = vx * self._nx + vy * self._ny
        usual = restitution_at(self._closing_mps, FROM_WALL_MPS) * rate / wall_rate
        self._restitution = max(usual if restitution is None else restitution, 0.01)
        self._impulse = [0.0, 0.0]
        item = obstacle.item
        breaks = item.code in _WOOD_N and vehicle.model.body.mass_kg >= _HEAVY_KG
        self._bears = (_WOOD_N[item.code], _WOOD_J) if breaks else (item.force_n, item.energy_j)

    @property
    def over_s(self) -> float:
        """Return the time from which it counts as over unless the two touch again."""
        return self.last_s + _AGAIN_S

    @property
    def crush_m(self) -> float:
        """Return the largest crush depth of the vehicle."""
        return max(self._deepest_m.values(), default=0.0)

    @property
    def moved_m(self) -> float:
        """Return the distance by which the object was moved."""
        return self._moved_m

    def force(self, now_s: float, part_s: float) -> tuple[float, float, float]:
        """Return the force x, y (N) and the moment (Nm) about the centre of gravity on the vehicle, for a part step."""
        vehicle, outline = self._vehicle, self._vehicle.outline()
        if separation(outline, self.obstacle.outline)[0] >= 0:
            return 0.0, 0.0, 0.0
        self.last_s = now_s + part_s
        if self._gone:
            return 0.0, 0.0, 0.0
        if self.obstacle.item.resistance is Resistance.SLOPE:
            return 0.0, 0.0, 0.0  # the ground does it
        if self.obstacle.item.resistance is Resistance.DRIVEN_OVER:
            fx, fy = self._climbing()
            moment = 0.0
        else:
            polygon = overlap_polygon(outline, self.obstacle.outline)
            px, py = contact_point(outline, self.obstacle.outline) if len(polygon) > 2 else self._point
            fx, fy = self._pressing(outline, px, py)
            moment = (px - vehicle.x) * fy - (py - vehicle.y) * fx
        if now_s <= self.start_s + PULSE_S:
            self._impulse[0] += fx * part_s
            self._impulse[1] += fy * part_s
        return fx, fy, moment

    def pushed(self, now_s: float, x_ns: float, y_ns: float) -> None:
        """Count an impulse of the ground on the vehicle (Ns)."""
        if now_s <= self.start_s + PULSE_S:
            self._impulse[0] += x_ns
            self._impulse[1] += y_ns

    def contact(self) -> Contact:
        """Return the contact for the log; the vehicle is the first of the two."""
        (px, py), mass = self._impulse, whole_kg(self._vehicle)
        return Contact(
            time_s=self.start_s,
            duration_s=max(self.last_s - self.start_s, 0.0),
            x_m=self._point[0],
            y_m=self._point[1],
            z_m=self._pose.z_m,
            normal_x=self._normal[0],
            normal_y=self._normal[1],
            impulse_ns=math.hypot(px, py),
            closing_speed_mps=self._closing_mps,
            number_1=party_of_body(self._vehicle.number),
            number_2=self.obstacle.item.number,
            pose_1=self._pose if self._puller_pose is None else self._puller_pose,
            pose_2=self.obstacle.item.pose,
            velocity_1_mps=self._velocity,
            velocity_2_mps=(0.0, 0.0),
            delta_v_1_mps=(px / mass, py / mass),
            delta_v_2_mps=(0.0, 0.0),
            crush_1_m=self.crush_m,
            trailer_pose_1=None if self._puller_pose is None else self._pose,
        )

    # --- forces ------------------------------------------------------------------------------------------------
    def _climbing(self) -> tuple[float, float]:
        """Return the force for driving over the object, which lifts the vehicle by its height and is not returned."""
        vehicle, item = self._vehicle, self.obstacle.item
        speed = math.hypot(vehicle.vx, vehicle.vy)
        if speed < _SLIDES_MPS:
            return 0.0, 0.0
        height_m = min(item.height_m, 0.2)
        force = vehicle.model.body.mass_kg * GRAVITY_MPS2 * height_m / vehicle.model.body.length_m
        force = force if item.height_m <= height_m else _SHRUB_N
        return -force * vehicle.vx / speed, -force * vehicle.vy / speed

    def _pressing(self, outline: Outline, px: float, py: float) -> tuple[float, float]:
        self._turn(outline)
        pressed_m = max(self._depth_m(outline) - self._moved_m, 0.0)
        k = self._stiffness_npm
        corner = (True, True) if self._on_vehicle else self._corner(outline)
        deepest_m = self._deepest_m.get(corner, 0.0)
        if pressed_m >= deepest_m:
            normal_n = k * pressed_m
            most_n, energy_j = self._bears
            if most_n is not None and normal_n > most_n:
                given_m = (normal_n - most_n) / k
                self._moved_m += given_m
                self._spent_j += most_n * given_m
                pressed_m -= given_m
                normal_n = most_n
                self._gone = energy_j is not None and self._spent_j >= energy_j
            self._deepest_m[corner] = max(deepest_m, pressed_m)
        else:  # coming back, with so much less energy
            normal_n = max(k * (deepest_m - (deepest_m - pressed_m) / self._restitution**2), 0.0)
        vx, vy = _velocity_at(self._vehicle, px, py)
        tx, ty = -self._ny, self._nx
        pocket = self.crush_m / (2 * _support_m(self.obstacle.outline, tx, ty))
        friction = _FRICTION + min(pocket, _DEEPEST_POCKET)
        across_n = -friction * normal_n * math.tanh((vx * tx + vy * ty) / _SLIDES_MPS)
        return across_n * tx - normal_n * self._nx, across_n * ty - normal_n * self._ny

    def _turn(self, outline: Outline) -> None:
        """Turn the contact with the vehicle's face."""
        if self._on_vehicle:
            (ahead, left), c, s = self._face, math.cos(outline.heading_rad), math.sin(outline.heading_rad)
            self._nx, self._ny = ahead * c - left * s, ahead * s + left * c

    def _corner(self, outline: Outline) -> tuple[bool, bool]:
        """Return the foremost corner of the vehicle along the normal: whether in front, whether on the left."""
        c, s = math.cos(outline.heading_rad), math.sin(outline.heading_rad)
        return self._nx * c + self._ny * s >= 0, self._ny * c - self._nx * s >= 0

    def _depth_m(self, outline: Outline) -> float:
        """Return the overlap of the two along the normal."""
        other = self.obstacle.outline
        along = (other.x_m - outline.x_m) * self._nx + (other.y_m - outline.y_m) * self._ny
        return _support_m(outline, self._nx, self._ny) + _support_m(other, self._nx, self._ny) - along

    def _rates(self, outline: Outline) -> tuple[float, float]:
        """Return the speed per depth of crush (1/s).

        The first rate is for this object, between pole and wall by its share of the vehicle's face; the second is for a
        wall.
        """
        body, item = self._vehicle.model.body, self.obstacle.outline
        pole_m, wall_m = crush_m(body.vehicle_class), WALL_CRUSH_M[body.vehicle_class]
        tx, ty = -self._ny, self._nx
        along = abs((item.x_m - outline.x_m) * tx + (item.y_m - outline.y_m) * ty)
        own_m, its_m = _support_m(outline, tx, ty), _support_m(item, tx, ty)
        shared_m = max(min(own_m, along + its_m) - max(-own_m, along - its_m), 0.0)
        share = min(shared_m / (2 * own_m), 1.0)
        wall_rate = WALL_TEST_MPS / wall_m
        return (1 - share) * POLE_TEST_MPS / pole_m + share * wall_rate, wall_rate


def _support_m(outline: Outline, nx: float, ny: float) -> float:
    """Return the reach of a rectangle from its middle in a direction."""
    c, s = math.cos(outline.heading_rad), math.sin(outline.heading_rad)
    return outline.half_length_m * abs(nx * c + ny * s) + outline.half_width_m * abs(ny * c - nx * s)


def _velocity_at(vehicle: Vehicle, x_m: float, y_m: float) -> tuple[float, float]:
    return vehicle.vx - vehicle.yaw_rate * (y_m - vehicle.y), vehicle.vy + vehicle.yaw_rate * (x_m - vehicle.x)
