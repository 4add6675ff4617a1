"""Crush of two vehicles by each other: the force over the depth of crush, the absorbed energy, and the rebound.

Both outlines stay as they are, and their overlap is the crushed part.

* Size of the force: the overlap's area times the stiffness of both faces in series, N per metre of crush and metre of
  width.
* Place: the middle of the area, so that the point of contact moves inward. If the bodies rotate against each other, it
  is the middle of the part that still closes, because crush does not spring back.
* Direction: normal to the line through the two points where the outlines cross. That is the side's normal if a front
  strikes a side, and between both normals if two fronts meet at an angle. This surface stays and rotates with both.
* Rebound: the force falls so fast that the returned energy matches the restitution.
* Friction: Coulomb's, which stops the sliding along the surface.

The forces on both vehicles are equal and opposite, at one point, so that momentum is kept.

Stiffness by class and side, linear and proportional to the mass:

* Fronts: a car strikes a rigid wall at 15.6 m/s with 0.55 m of dynamic crush (0.5 to 0.65 in NHTSA's frontal tests at
  35 mph), which is 1.2 MN/m for 1500 kg. Objects take the same table, :mod:`trace_dag.simulation.obstacles`.
* Sides and rears: 0.6 and 0.8 of it. CRASH3's tables (McHenry and Lynch, DOT HS 805 732, 1981) have a slope of 320 to
  460 kN per metre of crush and of width for sides of compact and larger cars, 240 to 390 for fronts; modern fronts have
  some 650.

Restitution falls with the closing speed v, m/s:

* in collisions of bumpers 0.5992 exp(-0.2508 v + 0.01934 v^2 - 0.001279 v^3) (Antonetti, SAE 980552);
* at higher speeds two vehicles separate at some 2.5 m/s, whatever the crush: a restitution of about 0.1 at medium and
  high speeds (SAE 931842), 0.126 and 0.089 in oblique tests, whose closing speeds along the normal were 23.4 and
  24.1 m/s (Rose et al., SAE 2006-01-0908);
* one vehicle rebounds from a rigid object at some 2 m/s.
"""

from __future__ import annotations

import math
from typing import Final, NamedTuple

from trace_dag.crash.record import VehicleClass
from trace_dag.simulation.dynamics import Vehicle
from trace_dag.simulation.outlines import Outline, overlap_polygon, separation
from trace_dag.simulation.types import Body

WALL_TEST_MPS: Final = 15.6
WALL_CRUSH_M: Final = {
    VehicleClass.CAR: 0.55,
    VehicleClass.SUV: 0.53,
    VehicleClass.PICKUP: 0.57,
    VehicleClass.VAN: 0.50,
    VehicleClass.LIGHT_TRUCK: 0.50,
    VehicleClass.TRUCK: 0.45,
    VehicleClass.TRACTOR_TRAILER: 0.45,
    VehicleClass.BUS: 0.45,
    VehicleClass.MOTORCYCLE: 0.40,
    VehicleClass.OTHER: 0.55,
    VehicleClass.TRAILER: 0.45,
}
"""Dynamic crush into a wall at :data:`WALL_TEST_MPS`."""

_SIDE, _REAR = 0.6, 0.8  # of a front's stiffness
_SPRINGS_BACK = 0.05
"""Share of the greatest crush, at least, while they still press: so pulses last 80 to 120 ms at changes of 30 to 70
km/h."""
FROM_WALL_MPS: Final = 2.0
"""Restitution of a vehicle against a wall."""
_FROM_VEHICLE_MPS, _MOST_REBOUND = 2.5, 0.3
_SETTLED_M = 0.3  # from this overlap on the surface between both has its direction
_BOTTOMS_M = 2.4  # of both: engines and cells, which hardly give way; twice as stiff there, and rising steeply
_AGAIN_S = 0.05  # who presses again later presses another place
_ON_CORNER_M = 1e-6
_LEAST_AREA_M2 = 1e-12


class Pressed(NamedTuple):
    """The effect of one part of a step: force x, y (N) on the second vehicle, and the moments (Nm) on both."""

    fx: float
    fy: float
    moment_1: float
    moment_2: float


def restitution_at(closing_mps: float, rebound_mps: float = _FROM_VEHICLE_MPS) -> float:
    """Return the restitution of two vehicles that close at a speed along the normal.

    For one vehicle alone, pass the speed of its structure's rebound.

    >>> [round(restitution_at(speed), 2) for speed in (0.0, 2.0, 5.0, 16.0, 32.0)]
    [0.6, 0.39, 0.3, 0.16, 0.08]
    >>> round(restitution_at(16.0, FROM_WALL_MPS), 3)
    0.125
    """
    v = max(closing_mps, 0.0)
    bumpers = 0.5992 * math.exp(-0.2508 * v + 0.01934 * v**2 - 0.001279 * v**3)
    return max(bumpers, rebound_mps / max(v, rebound_mps / _MOST_REBOUND))


def front_stiffness_npm2(body: Body) -> float:
    """Return the stiffness of a front: force per metre of crush and metre of width."""
    rate = WALL_TEST_MPS / WALL_CRUSH_M[body.vehicle_class]
    return body.mass_kg * rate * rate / body.width_m


def _of_front(ahead: float, left: float) -> float:
    """Return the stiffness of the face in a direction, as a share of the front's."""
    end = 1.0 if ahead >= 0 else _REAR
    return end * ahead * ahead + _SIDE * left * left


class Crush:
    """The crush of two vehicles that overlap."""

    def __init__(self, one: Vehicle, two: Vehicle, restitution: float | None, friction: float) -> None:
        self._one, self._two = one, two
        self._given_restitution = restitution
        self._friction = friction
        self._front_npm2 = front_stiffness_npm2(one.model.body), front_stiffness_npm2(two.model.body)
        self._last_s = -math.inf  # when they pressed last
        self._apart = False
        self._dent_m2 = 0.0  # overlap that was crushed before this contact
        self._deepest_m2 = 0.0  # and in it, at most
        self._restitution = 0.0
        self._settled_rad: float | None = None  # the normal, as seen by both bodies as they turn
        self.depths_m = (0.0, 0.0)
        """Greatest depth of each."""

    def press(self, outlines: tuple[Outline, Outline], now_s: float, part_s: float) -> Pressed | None:
        """Return the present forces of the outlines, for a part of a step; None if there are none."""
        one, two = self._one, self._two
        polygon = overlap_polygon(*outlines)
        area, px, py = _area_and_middle(polygon)
        if area < _LEAST_AREA_M2:
            return None
        again = now_s - self._last_s > _AGAIN_S
        if again:
            self._part(area)
            if area <= self._dent_m2:
                return None  # it lies in the dent
        nx, ny = self._normal(polygon, *outlines)
        past_x, past_y = self._past(px, py)
        closing = -(past_x * nx + past_y * ny)
        if again:
            given = self._given_restitution
            self._restitution = restitution_at(closing) if given is None else given
        front_1, front_2 = self._front_npm2
        stiffness_1, stiffness_2 = _facing(outlines[0], front_1, nx, ny), _facing(outlines[1], front_2, -nx, -ny)
        stiffness = stiffness_1 * stiffness_2 / (stiffness_1 + stiffness_2)
        deep_m = _extent_m(polygon, nx, ny)
        stiffness *= 1.0 + (deep_m / _BOTTOMS_M) ** 6
        pressed_n, returned_n = self._forces_n(stiffness, area - self._dent_m2)
        if pressed_n <= 0.0:
            return None
        normal_n = pressed_n
        if returned_n < pressed_n:
            stops_in = closing / (pressed_n * self._yielding((px, py), (nx, ny))) / part_s
            share = min(max(stops_in, 0.0), 1.0)
            normal_n = share * pressed_n + (1.0 - share) * returned_n
        self._last_s, self._apart = now_s, False
        share_1 = stiffness_2 / (stiffness_1 + stiffness_2)
        before_1, before_2 = self.depths_m
        self.depths_m = max(before_1, deep_m * share_1), max(before_2, deep_m * (1.0 - share_1))
        tx, ty = -ny, nx
        shift_m = _shift_m(_extent_m(polygon, tx, ty), closing, two.yaw_rate - one.yaw_rate)
        return self._pressed((px + shift_m * tx, py + shift_m * ty), (nx, ny), normal_n, part_s)

    def _part(self, area_m2: float) -> None:
        """End the contact: the overlap becomes a dent, and only overlap beyond it presses again."""
        self._settled_rad, self._deepest_m2 = None, 0.0
        if self._last_s > -math.inf:
            self._dent_m2 = min(self._dent_m2, area_m2) if self._apart else area_m2
            self._apart = True

    def _pressed(
        self, point: tuple[float, float], normal: tuple[float, float], normal_n: float, part_s: float
    ) -> Pressed:
        """Return a normal force at a point with its friction, limited by Coulomb's law and by the stop of sliding."""
        one, two, (nx, ny), (px, py) = self._one, self._two, normal, point
        tx, ty = -ny, nx
        past_x, past_y = self._past(px, py)
        most = self._friction * normal_n
        stopping_n = -(past_x * tx + past_y * ty) / self._yielding(point, (tx, ty)) / part_s
        across_n = min(most, max(-most, stopping_n))
        fx, fy = normal_n * nx + across_n * tx, normal_n * ny + across_n * ty
        x1, y1, x2, y2 = px - one.x, py - one.y, px - two.x, py - two.y
        return Pressed(fx, fy, y1 * fx - x1 * fy, x2 * fy - y2 * fx)

    def _normal(self, polygon: list[tuple[float, float]], one: Outline, two: Outline) -> tuple[float, float]:
        """Return the normal of the surface between both, from the first to the second.

        Once pressed in, the surface stays and rotates with both, because the parts beside it are crushed already.
        """
        turned = (self._one.heading + self._two.heading) / 2
        if self._settled_rad is not None:
            return math.cos(self._settled_rad + turned), math.sin(self._settled_rad + turned)
        nx, ny = _across_crossings(polygon, one, two)
        if _extent_m(polygon, nx, ny) > _SETTLED_M:
            self._settled_rad = math.atan2(ny, nx) - turned
        return nx, ny

    def _yielding(self, point: tuple[float, float], along: tuple[float, float]) -> float:
        """Return the relative velocity at a point per unit of impulse in a direction, 1/kg.

        It is the inverse of the effective mass.
        """
        (px, py), (ux, uy) = point, along
        total = 0.0
        for vehicle in (self._one, self._two):
            lever = (px - vehicle.x) * uy - (py - vehicle.y) * ux
            total += 1.0 / vehicle.model.body.mass_kg + lever * lever / vehicle.model.yaw_inertia_kgm2
        return total

    def _forces_n(self, stiffness: float, area_m2: float) -> tuple[float, float]:
        """Return the normal force at an overlap while it deepens, and the force if it rebounded from now on."""
        energy = self._restitution**2
        back = max(energy, _SPRINGS_BACK)
        if area_m2 >= self._deepest_m2:
            self._deepest_m2 = area_m2
            return stiffness * area_m2, energy / back * stiffness * area_m2
        returned_n = energy / back * stiffness * (self._deepest_m2 - (self._deepest_m2 - area_m2) / back)
        return returned_n, returned_n

    def _past(self, x_m: float, y_m: float) -> tuple[float, float]:
        """Return the velocity of the second vehicle relative to the first, at a point."""
        one, two = self._one, self._two
        return (
            two.vx - two.yaw_rate * (y_m - two.y) - one.vx + one.yaw_rate * (y_m - one.y),
            two.vy + two.yaw_rate * (x_m - two.x) - one.vy - one.yaw_rate * (x_m - one.x),
        )


def _shift_m(width_m: float, closing_mps: float, turning_rps: float) -> float:
    """Return the offset of the force from the middle of a contact whose sides rotate against each other.

    Crush does not spring back, so only the part that still closes presses.
    """
    across_mps = abs(turning_rps) * width_m
    if across_mps < 1e-9:
        return 0.0
    presses = min(max(0.5 + closing_mps / across_mps, 0.0), 1.0)
    return math.copysign(presses * (1.0 - presses) * width_m, turning_rps)


def _area_and_middle(polygon: list[tuple[float, float]]) -> tuple[float, float, float]:
    """Return the area of a polygon (m2) and the place of its middle."""
    if len(polygon) < 3:
        return 0.0, 0.0, 0.0
    x0, y0 = polygon[0]
    area = cx = cy = 0.0
    xa = ya = 0.0
    for x, y in polygon[1:]:
        xb, yb = x - x0, y - y0
        w = xa * yb - xb * ya
        area += w
        cx += w * (xa + xb)
        cy += w * (ya + yb)
        xa, ya = xb, yb
    if area < 2 * _LEAST_AREA_M2:
        return 0.0, 0.0, 0.0
    return area / 2, x0 + cx / (3 * area), y0 + cy / (3 * area)


def _across_crossings(polygon: list[tuple[float, float]], one: Outline, two: Outline) -> tuple[float, float]:
    """Return the direction from the first to the second, across the line through their crossing outlines.

    If the outlines are flush, or one reaches through the other, it is the normal of the separating face.
    """
    crossings = [point for point in polygon if not _is_corner(point, one) and not _is_corner(point, two)]
    if len(crossings) == 2:
        (xa, ya), (xb, yb) = crossings
        length = math.hypot(xb - xa, yb - ya)
        if length > _ON_CORNER_M:
            nx, ny = (yb - ya) / length, (xa - xb) / length
            return (nx, ny) if nx * (two.x_m - one.x_m) + ny * (two.y_m - one.y_m) >= 0 else (-nx, -ny)
    _, nx, ny = separation(one, two)
    return nx, ny


def _is_corner(point: tuple[float, float], outline: Outline) -> bool:
    dx, dy = point[0] - outline.x_m, point[1] - outline.y_m
    c, s = outline.ahead
    return (
        abs(abs(dx * c + dy * s) - outline.half_length_m) < _ON_CORNER_M
        and abs(abs(dy * c - dx * s) - outline.half_width_m) < _ON_CORNER_M
    )


def _facing(outline: Outline, front_npm2: float, nx: float, ny: float) -> float:
    """Return the stiffness of a vehicle's face in an outward direction, from that of its front."""
    c, s = outline.ahead
    return front_npm2 * _of_front(nx * c + ny * s, ny * c - nx * s)


def _extent_m(polygon: list[tuple[float, float]], nx: float, ny: float) -> float:
    """Return the extent of a polygon along a direction."""
    low, high = math.inf, -math.inf
    for x, y in polygon:
        along = x * nx + y * ny
        if along < low:
            low = along
        if along > high:
            high = along
    return high - low
