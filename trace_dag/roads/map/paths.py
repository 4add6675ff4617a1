"""Paths through the lane network: following lanes from one to the next.

A path follows lanes in their direction of travel. A path has no lane changes: a driver who changes lanes leaves one
path for another.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from functools import cache
from typing import TYPE_CHECKING

import numpy as np

if TYPE_CHECKING:
    from collections.abc import Callable, Sequence

    from trace_dag.common.geometry import FloatArray
    from trace_dag.roads.map.model import LaneRef
    from trace_dag.roads.map.network import RoadNetwork

MAX_PATHS = 64


@dataclass(frozen=True, eq=False)
class LanePath:
    """A drive along lanes.

    ``points`` has shape (n, 4): x, y, z (metres), heading (radians, continuous); ``stations_m``, shape (n,), the
    distance driven at each point, starting at 0. ``complete`` is false if the map ends before the requested distance.
    """

    lanes: tuple[LaneRef, ...]
    points: FloatArray
    stations_m: FloatArray
    complete: bool

    @property
    def length_m(self) -> float:
        """Return the distance driven."""
        return float(self.stations_m[-1])

    @property
    def turn_rad(self) -> float:
        """Return the sum of the absolute changes of heading along the path."""
        return float(np.abs(np.diff(self.points[:, 3])).sum())


def follow(
    network: RoadNetwork,
    start: LaneRef,
    choose: Callable[[tuple[LaneRef, ...], Sequence[LaneRef]], Sequence[LaneRef]],
    *,
    ahead: bool = True,
    most: int = MAX_PATHS,
) -> list[tuple[LaneRef, ...]]:
    """Return paths from lane to lane, each from ``start`` on; against the direction of travel if not ``ahead``.

    ``choose`` takes the lanes of a path so far and the lanes that follow, and returns the lanes in which to continue:
    none ends the path, several split it. The search is depth first, so the paths of the first choice come first. At
    most ``most`` paths are returned, to limit the time on networks with very many.

    >>> start = map_report.placement.lane.lane
    >>> ways = follow(network, start, lambda way, following: following[:1] if len(way) < 3 else [])
    >>> [len(way) for way in ways], ways[0][0] == start  # the first lane of those that follow, twice
    ([3], True)
    """
    ways: list[tuple[LaneRef, ...]] = []
    pending: list[tuple[LaneRef, ...]] = [(start,)]
    while pending and len(ways) < most:
        lanes = pending.pop()
        chosen = choose(lanes, network.successors(lanes[-1]) if ahead else network.predecessors(lanes[-1]))
        if not chosen:
            ways.append(lanes)
        pending += [(*lanes, lane) for lane in reversed(chosen)]
    return ways


def trace_forward(
    network: RoadNetwork,
    ref: LaneRef,
    s_m: float,
    distance_m: float,
    *,
    step_m: float = 1.0,
    max_paths: int = MAX_PATHS,
) -> tuple[LanePath, ...]:
    """Return every path for ``distance_m`` on from ``s_m`` of a lane, straightest first.

    No path uses a lane twice.

    >>> lane = map_report.placement.lane
    >>> straightest = trace_forward(network, lane.lane, lane.s_m, 50.0)[0]
    >>> straightest.lanes[0] == lane.lane, float(straightest.stations_m[-1]), straightest.complete
    (True, 50.0, True)
    """
    geometry = network.geometry(ref)
    s = min(max(s_m, geometry.begin_m), geometry.end_m)
    low, high = (s, geometry.end_m) if geometry.direction > 0 else (geometry.begin_m, s)
    room_m = _length_m(geometry.between(low, high, 1.0))
    length_m = cache(lambda lane: _length_m(network.centreline(lane)))

    def covered_m(lanes: tuple[LaneRef, ...]) -> float:
        return math.fsum((room_m, *map(length_m, lanes[1:])))

    def onward(lanes: tuple[LaneRef, ...], following: Sequence[LaneRef]) -> Sequence[LaneRef]:
        return [lane for lane in following if lane not in lanes] if covered_m(lanes) < distance_m else ()

    first = geometry.between(low, high, step_m)
    paths = []
    for lanes in follow(network, ref, onward, most=max_paths):
        points = np.concatenate([first, *(network.centreline(lane, step_m) for lane in lanes[1:])])
        paths.append(_path(lanes, points, distance_m, complete=covered_m(lanes) >= distance_m))
    return tuple(sorted(paths, key=lambda path: (not path.complete, round(path.turn_rad, 6))))


def _length_m(line: FloatArray) -> float:
    return float(np.hypot(*np.diff(line[:, :2], axis=0).T).sum()) if len(line) > 1 else 0.0


def _path(lanes: tuple[LaneRef, ...], points: FloatArray, distance_m: float, *, complete: bool) -> LanePath:
    # Lanes meet end to start: the doubled point at each seam is dropped.
    points = points[np.concatenate([[True], np.hypot(*np.diff(points[:, :2], axis=0).T) > 1e-6])]
    points[:, 3] = np.unwrap(points[:, 3])
    stations = np.concatenate([[0.0], np.cumsum(np.hypot(*np.diff(points[:, :2], axis=0).T))])
    end_m = min(distance_m, float(stations[-1]))
    cut = np.concatenate([[0.0], stations[(stations > 1e-9) & (stations < end_m - 1e-9)], [end_m]])
    return LanePath(lanes, np.column_stack([np.interp(cut, stations, column) for column in points.T]), cut, complete)
