"""The ground beyond the pavement: its height, its slope, and the effect of a change of slope on a vehicle.

The edge of a bridge has a rail, which OpenStreetMap seldom maps, and vehicles do not pass it. Elsewhere OpenStreetMap
has no data of the ground, so usual values are used. Roads of high speed have open sides
(:func:`trace_dag.osm.road_classes.is_high_speed`): beyond the shoulder the ground falls by 1V:6H over 3 m, from which a
driver recovers (AASHTO, Roadside Design Guide, 2011, section 3.2.1: recoverable up to 1V:4H), and continues level.
Streets with kerbs have level ground beside them. A reported ditch or embankment slopes there, to the left of its
heading, and the ground up to it is level:

* a ditch falls by 1V:3H and rises by it again (steeper than the channels that the guide prefers, section 3.2.4); * an
embankment rises by 1V:2H, about the steepest stable slope of earth, and continues level.

Their depth and height are judgement. A vehicle that comes onto rising ground is turned up by it without rebound: it
loses the component of its velocity into the slope. If the slope is steeper than its class clears, or it slides
sideways, it digs in, and loses as much again along the ground. Slopes tip a vehicle whose wheels are held (tan of the
slope = track / (2 height)); one that slides down tips at the same grip as on level ground.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from itertools import pairwise
from typing import Final, NamedTuple

import shapely

from trace_dag.common.geometry import Pose
from trace_dag.crash.record import VehicleClass
from trace_dag.osm.road_classes import is_high_speed
from trace_dag.roads.map.model import Road
from trace_dag.roads.map.network import RoadNetwork
from trace_dag.simulation.objects import FixedObject, Resistance, slope_profile_m

_FORE_SLOPE: Final = 1 / 6
FORE_SLOPE_M: Final = 3.0
"""From the edge on the ground falls so far, beside roads of high speed."""
_REACH_M: Final = 250.0  # farther from the crash nobody slides
_RAIL_M: Final = (
    1.5,
    4.0,
)  # beyond the edge of what is paved: the rail, and so far a vehicle may get before it is held
_APPROACH: Final = {  # tangent of the angle of a slope that the overhangs clear; 28 degrees make a light truck one for
    # rough ground (49 CFR 523.5), cars have 12 to 18
    VehicleClass.CAR: math.tan(math.radians(15)),
    VehicleClass.SUV: math.tan(math.radians(22)),
    VehicleClass.PICKUP: math.tan(math.radians(22)),
    VehicleClass.MOTORCYCLE: math.tan(math.radians(45)),
}
_OTHER_APPROACH: Final = math.tan(math.radians(18))
_AHEAD: Final = math.cos(math.radians(45))  # who goes more across than along its axis slides sideways
_DIGS_IN: Final = 1.0
"""Deceleration of a body that digs into soil, as a share of its load: the least of 1.0 to 2.0 g in tests in
which cars tripped on soil (Cooperrider, Thomas and Hammoud, SAE 900366)."""


class Bank(NamedTuple):
    """The ground at a point relative to the road's surface: its height (m), its slope toward east and north."""

    height_m: float
    slope_x: float
    slope_y: float

    @property
    def level(self) -> bool:
        """Return whether the ground is level."""
        return self.slope_x == 0.0 and self.slope_y == 0.0


LEVEL: Final = Bank(0.0, 0.0, 0.0)
_BELOW_SLOPE: Final = Bank(-_FORE_SLOPE * FORE_SLOPE_M, 0.0, 0.0)


@dataclass(frozen=True)
class _Profile:
    """A ditch or embankment along its pose's heading: heights (m) at distances to the left (m), over its length."""

    pose: Pose
    half_length_m: float
    points_m: tuple[tuple[float, float], ...]

    @classmethod
    def of(cls, item: FixedObject) -> _Profile:
        """Return the profile of an object."""
        return cls(item.pose, item.length_m / 2, slope_profile_m(item))

    def at(self, x_m: float, y_m: float) -> Bank:
        """Return the ground at a point."""
        c, s = math.cos(self.pose.heading_rad), math.sin(self.pose.heading_rad)
        dx, dy = x_m - self.pose.x_m, y_m - self.pose.y_m
        if abs(dx * c + dy * s) > self.half_length_m:
            return LEVEL
        out_m = dy * c - dx * s
        (first_m, low), (last_m, high) = self.points_m[0], self.points_m[-1]
        if out_m <= first_m or out_m >= last_m:
            return Bank(low if out_m <= first_m else high, 0.0, 0.0)
        pieces = pairwise(self.points_m)
        (begin_m, begin_z), (end_m, end_z) = next(piece for piece in pieces if out_m <= piece[1][0])
        slope = (end_z - begin_z) / (end_m - begin_m)
        return Bank(begin_z + slope * (out_m - begin_m), -s * slope, c * slope)


class RoadsideTerrain:
    """The ground for the vehicles of a crash.

    It is around the first object, or around the ``end`` of a path, at its level.
    """

    def __init__(self, network: RoadNetwork | None, objects: Sequence[FixedObject], end: Pose) -> None:
        place = objects[0].pose if objects else end
        self._profiles = [_Profile.of(item) for item in objects if item.resistance is Resistance.SLOPE]
        self._paved = self._open = self._kerbed = self._bridges = None
        if network is None:
            return
        self._paved = network.paved_near(place.x_m, place.y_m, _REACH_M, z_m=place.z_m)
        bridges = network.paved_near(place.x_m, place.y_m, _REACH_M, z_m=place.z_m, of=lambda road: road.bridge)
        self._bridges = None if bridges.is_empty else bridges
        if self._profiles:
            return
        opened = network.paved_near(place.x_m, place.y_m, _REACH_M, z_m=place.z_m, of=_is_open)
        if not opened.is_empty:
            closed = network.paved_near(place.x_m, place.y_m, _REACH_M, z_m=place.z_m, of=lambda r: not _is_open(r))
            self._open, self._kerbed = opened, closed

    @property
    def slopes(self) -> bool:
        """Return whether any of it is not level."""
        return bool(self._profiles) or self._open is not None

    def across(self, x_m: float, y_m: float) -> tuple[float, float] | None:
        """Return the direction across the nearest reported ditch or embankment, to its far side, or None."""
        if not self._profiles:
            return None
        pose = min((each.pose for each in self._profiles), key=lambda p: math.hypot(p.x_m - x_m, p.y_m - y_m))
        return -math.sin(pose.heading_rad), math.cos(pose.heading_rad)

    def off_bridge(self, x_m: float, y_m: float) -> tuple[float, float] | None:
        """Return the unit vector away from a bridge with its rail at or before a point; None for other points."""
        if self._bridges is None or self.is_paved(x_m, y_m):
            return None
        point, edge = shapely.Point(x_m, y_m), self._bridges.edge_near(x_m, y_m)
        away_m = _distance_m(edge, point)
        if not _RAIL_M[0] <= away_m <= _RAIL_M[1]:
            return None
        edge_x, edge_y = shapely.get_coordinates(shapely.shortest_line(edge, point))[0].tolist()
        return (x_m - edge_x) / away_m, (y_m - edge_y) / away_m

    def is_paved(self, x_m: float, y_m: float) -> bool:
        """Return whether a point is paved."""
        return self._paved is None or self._paved.has(x_m, y_m)

    def has_kerb(self, x_m: float, y_m: float) -> bool:
        """Return whether the nearest edge of the pavement has a kerb; roads of high speed have none."""
        if self._open is None or self._kerbed is None:
            return self._paved is not None and not self._profiles
        point = shapely.Point(x_m, y_m)
        return _distance_m(self._kerbed.edge_near(x_m, y_m), point) < _distance_m(self._open.edge_near(x_m, y_m), point)

    def at(self, x_m: float, y_m: float, *, paved: bool | None = None) -> Bank:
        """Return the ground at a point; ``paved`` saves a test if it is known."""
        for profile in self._profiles:
            bank = profile.at(x_m, y_m)
            if bank != LEVEL:
                return bank
        if self._open is None or self._kerbed is None:
            return LEVEL
        if self.is_paved(x_m, y_m) if paved is None else paved:
            return LEVEL
        point = shapely.Point(x_m, y_m)
        opened, closed = self._open.edge_near(x_m, y_m), self._kerbed.edge_near(x_m, y_m)
        near = shapely.dwithin([opened, closed], point, FORE_SLOPE_M)  # much sooner said than how near
        if not near.any():
            return _BELOW_SLOPE
        from_open_m, from_kerb_m = _distance_m(opened, point), _distance_m(closed, point)
        edge, away_m = (opened, from_open_m) if from_open_m <= from_kerb_m else (closed, from_kerb_m)
        if away_m < 1e-6:
            return Bank(-_FORE_SLOPE * away_m, 0.0, 0.0)
        x, y = shapely.get_coordinates(shapely.shortest_line(edge, point))[0].tolist()
        fall = -_FORE_SLOPE / away_m
        return Bank(-_FORE_SLOPE * away_m, fall * (x_m - x), fall * (y_m - y))


def _is_open(road: Road) -> bool:
    """Return whether a road has open sides; roads through junctions count as the fastest road there."""
    return is_high_speed(road.highway, road.speed_mps)


def _distance_m(edge: shapely.Geometry, point: shapely.Point) -> float:
    return math.inf if shapely.is_empty(edge) else float(shapely.distance(edge, point))


class Push(NamedTuple):
    """The effect of a change of slope on a vehicle, per mass (m/s): toward east, north and up."""

    x_mps: float
    y_mps: float
    up_mps: float


def onto_slope(
    vehicle_class: VehicleClass, heading_rad: float, velocity_mps: tuple[float, float], before: Bank, after: Bank
) -> Push | None:
    """Return the impulse of coming from one slope onto another; None if the new one falls away.

    The velocity into the new slope is lost. A vehicle that digs in loses as much along it, at most all of it.
    """
    vx, vy = velocity_mps
    speed = math.hypot(vx, vy)
    if speed < 1e-6:
        return None
    ux, uy = vx / speed, vy / speed
    rise_before = before.slope_x * ux + before.slope_y * uy
    rise_after = after.slope_x * ux + after.slope_y * uy
    size = math.sqrt(1 + after.slope_x**2 + after.slope_y**2)
    nx, ny, nz = -after.slope_x / size, -after.slope_y / size, 1 / size
    vz = speed * rise_before
    into_mps = -(vx * nx + vy * ny + vz * nz)
    if into_mps <= 1e-9:
        return None
    tx, ty, tz = vx + into_mps * nx, vy + into_mps * ny, vz + into_mps * nz
    along_mps = math.sqrt(tx * tx + ty * ty + tz * tz)
    turned = (rise_after - rise_before) / (1 + rise_after * rise_before)  # tangent of the angle between both
    rolls = abs(ux * math.cos(heading_rad) + uy * math.sin(heading_rad)) > _AHEAD
    digs = not rolls or turned > _APPROACH.get(vehicle_class, _OTHER_APPROACH)
    held = min(_DIGS_IN * into_mps, along_mps) / max(along_mps, 1e-9) if digs else 0.0
    return Push(into_mps * nx - held * tx, into_mps * ny - held * ty, into_mps * nz - held * tz)
