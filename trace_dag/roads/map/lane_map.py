"""The road for an agent's queries: lanes here, lanes ahead, speed limits, and the route."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from trace_dag.common.geometry import FloatArray, Pose
from trace_dag.common.paths import Path, from_points, through_points
from trace_dag.roads.map.model import LaneMatch, LaneRef
from trace_dag.roads.map.network import RoadNetwork
from trace_dag.roads.map.paths import trace_forward

_LANE_REACH_M = 2.0  # a body's centre this far beside a lane still counts as being in it
_SAME_WAY_RAD = math.radians(60.0)
_SMOOTHING_M = 2.0
_LEAST_PATH_M = 1.0
_COMPARED_EVERY_M = 5.0
_SEARCHED_M = 20.0  # before and behind where one was
_COARSE_M = 2.0


@dataclass(frozen=True, eq=False)
class Route:
    """A route: the path, and its lanes in order, if it follows lanes."""

    path: Path
    lanes: tuple[LaneRef, ...] = ()


@dataclass(frozen=True, eq=False)
class LaneMap:
    """An agent's queries about the road. ``network`` is the whole map, for further queries."""

    network: RoadNetwork

    def lanes_at(self, x_m: float, y_m: float, within_m: float = _LANE_REACH_M) -> list[LaneMatch]:
        """Return the drivable lanes at a point or within some metres of it, nearest first.

        In a junction several lanes overlap.
        """
        return self.network.nearest_lanes(x_m, y_m, within_m)

    def lane_at(self, x_m: float, y_m: float, heading_rad: float) -> LaneMatch | None:
        """Return the lane at a point with traffic in one's direction (within 60 degrees).

        None off the road or in the wrong direction.
        """
        for match in self.lanes_at(x_m, y_m):
            lane_rad = self.network.pose(match.lane, match.s_m).heading_rad
            if abs(math.remainder(lane_rad - heading_rad, math.tau)) <= _SAME_WAY_RAD:
                return match
        return None

    def speed_limit_mps(self, lane: LaneRef) -> float | None:
        """Return the speed limit of a lane, or None."""
        return self.network.lane(lane).speed_mps or self.network.road_by_id[lane.road_id].speed_mps

    def ways_ahead(self, match: LaneMatch, distance_m: float) -> list[Path]:
        """Return every path from a place in a lane for some distance or to the map's end, straightest first."""
        return [route.path for route in self._routes(match, distance_m)]

    def route_along(self, recorded: Path, start: Pose) -> Route:
        """Return the route along lanes nearest to a recorded path, from the start of that path.

        If the start is in no lane of its direction, the path itself is returned.
        """
        match = self.lane_at(start.x_m, start.y_m, start.heading_rad)
        routes = self._routes(match, recorded.length_m) if match is not None else []
        return min(routes, key=lambda route: _mean_distance_m(recorded, route.path), default=Route(recorded))

    def _routes(self, match: LaneMatch, distance_m: float) -> list[Route]:
        ways = trace_forward(self.network, match.lane, match.s_m, distance_m)
        return [
            Route(through_points(way.points[:, :3], sigma_m=_SMOOTHING_M), way.lanes)
            for way in ways
            if way.length_m > _LEAST_PATH_M
        ]


def _mean_distance_m(recorded: Path, way: Path) -> float:
    every = max(1, round(_COMPARED_EVERY_M * len(recorded.s_m) / max(recorded.length_m, _COMPARED_EVERY_M)))
    points = np.column_stack([recorded.x_m, recorded.y_m])[::every]
    line = np.column_stack([way.x_m, way.y_m])[::4]
    return float(np.linalg.norm(points[:, None] - line[None], axis=2).min(axis=1).mean())


def path_through(points_m: FloatArray) -> Path:
    """Return the path through points x, y of shape (n, 2), without repeated points.

    Raises ``ValueError`` unless at least two points differ.
    """
    points = np.asarray(points_m, float)
    keep = np.concatenate([[True], np.hypot(*np.diff(points, axis=0).T) > 1e-6])
    points = points[keep]
    if len(points) < 2:
        raise ValueError("a path needs two points or more")
    return from_points(points[:, 0], points[:, 1], np.zeros(len(points)))


class PathFollower:
    """A search for the nearest place on a path, near the last one found: cheap, and safe on paths that return."""

    def __init__(self, path: Path) -> None:
        self.path = path
        self._points = np.column_stack([path.x_m, path.y_m])
        self._curvature_1pm = np.abs(path.curvature_1pm)
        self._step_m = path.length_m / max(len(path.s_m) - 1, 1)
        self._index: int | None = None

    def locate(self, x_m: float, y_m: float) -> tuple[float, float]:
        """Return the distance along the path (m) nearest to a point, and the point's offset to the left (m)."""
        first = 0
        points = self._points
        if self._index is not None:
            reach = math.ceil(_SEARCHED_M / self._step_m)
            first = max(0, self._index - reach)
            points = points[first : self._index + reach + 1]
        self._index = i = first + int(((points - (x_m, y_m)) ** 2).sum(axis=1).argmin())
        heading = float(self.path.heading_rad[i])
        c, s = math.cos(heading), math.sin(heading)
        dx, dy = x_m - float(self._points[i, 0]), y_m - float(self._points[i, 1])
        return float(self.path.s_m[i]) + dx * c + dy * s, dy * c - dx * s

    def locate_many(self, points_m: FloatArray) -> tuple[FloatArray, FloatArray, FloatArray]:
        """Return distance along the path (m), offset to its left (m) and heading, for points (n, 2).

        Each has shape (n,). The whole path is searched.
        """
        every = max(1, round(_COARSE_M / self._step_m))
        line = self._points[::every]
        nearest = every * ((points_m[:, None] - line) ** 2).sum(axis=2).argmin(axis=1)
        heading = self.path.heading_rad[nearest]
        c, s = np.cos(heading), np.sin(heading)
        dx, dy = (points_m - self._points[nearest]).T
        return self.path.s_m[nearest] + dx * c + dy * s, dy * c - dx * s, heading

    def point(self, s_m: float) -> tuple[float, float]:
        """Return x and y at a distance along the path, extended straight beyond its ends."""
        x, y, _ = self.path.plan(np.array(s_m))
        return float(x), float(y)

    def sharpest_1pm(self, from_m: float, to_m: float) -> float:
        """Return the largest curvature (1/m, absolute) of a stretch of the path; 0 beyond its end."""
        first, last = (round(at_m / self._step_m) for at_m in (from_m, to_m))
        return float(self._curvature_1pm[max(first, 0) : max(last, 0) + 1].max(initial=0.0))
