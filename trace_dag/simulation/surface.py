"""Heights of the road surface near the crash, for frequent cheap queries of the simulation."""

from __future__ import annotations

import math
from functools import cached_property
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from trace_dag.common.geometry import FloatArray
from trace_dag.roads.map.network import RoadNetwork

_SAMPLE_STEP_M = 2.0
_LEVEL_GAP_M = 2.5  # surfaces further apart than this are different levels: a bridge and what is under it
_NEIGHBOURS = 24
_PLANE_M = 2.0
_REACH_M = 40.0  # of a path: farther off it nobody slides
_LOOKED_AT = 64  # points of the paths: some ten metres apart


class Ground(NamedTuple):
    """The surface around a point: its height there (m) and its slope toward east and north (rise over run)."""

    x_m: float
    y_m: float
    z_m: float
    slope_x: float
    slope_y: float

    def height_m(self, x_m: float, y_m: float) -> float:
        """Return the height of the tangent plane."""
        return self.z_m + self.slope_x * (x_m - self.x_m) + self.slope_y * (y_m - self.y_m)

    def reaches(self, x_m: float, y_m: float) -> bool:
        """Return whether a point is so near that the tangent plane is valid."""
        return abs(x_m - self.x_m) < _PLANE_M and abs(y_m - self.y_m) < _PLANE_M


class Surface:
    """The drivable surface: samples along lane centres, shape (n, 3), and the grade along each, shape (n, 2).

    Between samples the nearest one's tangent plane is used, level across the lane; it also extends off the road.
    ``Surface()`` is the plane at height 0.
    """

    def __init__(self, points_m: FloatArray | None = None, slopes: FloatArray | None = None) -> None:
        flat = points_m is None or slopes is None or not len(points_m)
        self._points = np.zeros((0, 3)) if flat else np.asarray(points_m, float)
        self._slopes = np.zeros((0, 2)) if flat else np.asarray(slopes, float)

    def around(self, paths_m: FloatArray) -> Surface:
        """Return the surface near some paths, which is this one."""
        return self

    @property
    def flat(self) -> bool:
        """Return whether this is the plane at height 0."""
        return not len(self._points)

    def at(self, x_m: float, y_m: float, near_z_m: float) -> Ground:
        """Return the surface under a point, on the level nearest to ``near_z_m``."""
        if self.flat:
            return Ground(x_m, y_m, 0.0, 0.0, 0.0)
        squared = (self._points[:, 0] - x_m) ** 2 + (self._points[:, 1] - y_m) ** 2
        chosen = squared.argmin()
        if abs(self._points[chosen, 2] - near_z_m) >= _LEVEL_GAP_M:
            chosen = self._on_other_level(squared, near_z_m)
        x, y, z = self._points[chosen].tolist()
        slope_x, slope_y = self._slopes[chosen].tolist()
        reach = math.hypot(x_m - x, y_m - y)
        scale = min(1.0, 2 * _SAMPLE_STEP_M / reach) if reach > 0 else 0.0  # no climbing on, far beside the road
        height = z + scale * (slope_x * (x_m - x) + slope_y * (y_m - y))
        return Ground(x_m, y_m, height, slope_x, slope_y)

    def _on_other_level(self, squared: FloatArray, near_z_m: float) -> np.intp:
        """Return the nearest sample on the level of a height, by the squared distances of all.

        If there is none, it is the nearest in height.
        """
        near = np.arange(len(squared))
        if len(squared) > _NEIGHBOURS:
            near = np.argpartition(squared, _NEIGHBOURS)[:_NEIGHBOURS]
        nearest = near[np.lexsort((near, squared[near]))]  # where lanes end at one point, in the order of the map
        off_m = np.abs(self._points[nearest, 2] - near_z_m)
        on_level = np.flatnonzero(off_m < _LEVEL_GAP_M)
        found: np.intp = nearest[on_level[0] if len(on_level) else off_m.argmin()]
        return found


class NetworkSurface:
    """The surface of a road network, sampled on use; a network without elevation is a plane."""

    def __init__(self, network: RoadNetwork) -> None:
        self._network = network
        self._flat = not any(c.a or c.b or c.c or c.d for road in network.roads for c in road.elevation)
        self._covered: frozenset[str] = frozenset()
        self._surface = Surface()

    def around(self, paths_m: FloatArray) -> Surface:
        """Return the surface of the roads that pass within reach of any of the points, shape (n, 2)."""
        if self._flat:
            return self._surface
        starts, reach_m, road_ids = self._elements
        points_m = paths_m[:: max(1, len(paths_m) // _LOOKED_AT)]
        beside_m = np.maximum(points_m.min(axis=0) - starts, starts - points_m.max(axis=0)).max(axis=1)
        about = np.flatnonzero(beside_m < reach_m)  # of the rest not even the box around the points is near
        apart_m = np.linalg.norm(points_m[:, None, :] - starts[None, about], axis=2).min(axis=0)
        needed = frozenset(road_ids[about[apart_m < reach_m[about]]].tolist())
        if not needed <= self._covered:
            self._covered |= needed
            self._surface = self._sampled()
        return self._surface

    @cached_property
    def _elements(self) -> tuple[FloatArray, FloatArray, NDArray[np.str_]]:
        """Return starts of all elements of reference lines, the reach within which they matter, and their roads."""
        found = [(e.x_m, e.y_m, e.length_m, road.id) for road in self._network.roads for e in road.plan]
        columns = np.array([each[:3] for each in found]).reshape(-1, 3)
        return columns[:, :2], columns[:, 2] + _REACH_M, np.array([each[3] for each in found])

    def _sampled(self) -> Surface:
        points, slopes = [], []
        for ref in self._network.drivable_lanes():
            if ref.road_id not in self._covered:
                continue
            line = self._network.centreline(ref, _SAMPLE_STEP_M)
            if len(line) < 2:
                continue
            run = np.hypot(np.gradient(line[:, 0]), np.gradient(line[:, 1]))
            grade = np.gradient(line[:, 2]) / np.maximum(run, 1e-6)
            points.append(line[:, :3])
            slopes.append(grade[:, None] * np.stack([np.cos(line[:, 3]), np.sin(line[:, 3])], axis=-1))
        return Surface(np.concatenate(points), np.concatenate(slopes)) if points else Surface()
