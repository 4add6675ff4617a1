"""Paths through the lane network: where one can have come from, and where one can drive to.

A path follows lanes in their direction of travel. Lane changes are not paths: a driver who changes lanes leaves one
path for the next lane's.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

if TYPE_CHECKING:
    from trace_dag.geometry import FloatArray
    from trace_dag.roads.map.model import LaneRef
    from trace_dag.roads.map.network import RoadNetwork

MAX_PATHS = 64


@dataclass(frozen=True, eq=False)
class LanePath:
    """A drive along lanes.

    ``points`` has shape (n, 4): x, y, z (metres), heading (radians, continuous); ``stations_m`` shape (n,) the
    distance driven at each point, starting at 0. ``complete`` is false where the map ends before the distance asked
    for.
    """

    lanes: tuple[LaneRef, ...]
    points: FloatArray
    stations_m: FloatArray
    complete: bool

    @property
    def length_m(self) -> float:
        """Distance driven."""
        return float(self.stations_m[-1])

    @property
    def turn_rad(self) -> float:
        """Sum of the absolute changes of heading along the path."""
        return float(np.abs(np.diff(self.points[:, 3])).sum())

    def at(self, station_m: float) -> FloatArray:
        """Point at a distance driven, shape (4,): x, y, z, heading; clamped to the path's ends."""
        return np.array([np.interp(station_m, self.stations_m, column) for column in self.points.T])


def trace_forward(
    network: RoadNetwork,
    ref: LaneRef,
    s_m: float,
    distance_m: float,
    *,
    step_m: float = 1.0,
    max_paths: int = MAX_PATHS,
) -> tuple[LanePath, ...]:
    """Every way to drive ``distance_m`` on from ``s_m`` of a lane, straightest first; starts at that place."""
    return _trace(network, ref, s_m, distance_m, step_m, max_paths, ahead=True)


def trace_backward(
    network: RoadNetwork,
    ref: LaneRef,
    s_m: float,
    distance_m: float,
    *,
    step_m: float = 1.0,
    max_paths: int = MAX_PATHS,
) -> tuple[LanePath, ...]:
    """Every way to have driven the ``distance_m`` before ``s_m`` of a lane, straightest first; ends at that place.

    The paths run in the direction of travel, so the last point is the given place.
    """
    return _trace(network, ref, s_m, distance_m, step_m, max_paths, ahead=False)


def _trace(
    network: RoadNetwork, ref: LaneRef, s_m: float, distance_m: float, step_m: float, max_paths: int, *, ahead: bool
) -> tuple[LanePath, ...]:
    chains: list[tuple[tuple[LaneRef, ...], bool]] = []
    # Depth first, a lane at most once per path; the bound counts paths, so a maze cannot run away.
    pending: list[tuple[tuple[LaneRef, ...], float]] = [((ref,), _room(network, ref, s_m, ahead))]
    while pending and len(chains) < max_paths:
        lanes, covered = pending.pop()
        if covered >= distance_m:
            chains.append((lanes, True))
            continue
        following = network.successors(lanes[-1]) if ahead else network.predecessors(lanes[-1])
        onward = [lane for lane in following if lane not in lanes]
        if not onward:
            chains.append((lanes, False))
        pending += [((*lanes, lane), covered + _arc_length(network, lane)) for lane in reversed(onward)]
    paths = [_path(network, lanes, complete, s_m, distance_m, step_m, ahead) for lanes, complete in chains]
    return tuple(sorted(paths, key=lambda path: (not path.complete, round(path.turn_rad, 6))))


def _arc_length(network: RoadNetwork, ref: LaneRef) -> float:
    line = network.centreline(ref)
    return float(np.hypot(*np.diff(line[:, :2], axis=0).T).sum())


def _room(network: RoadNetwork, ref: LaneRef, s_m: float, ahead: bool) -> float:
    """Length of the part of the first lane that counts."""
    part = _first_part(network, ref, s_m, math.inf, ahead)
    return float(np.hypot(*np.diff(part[:, :2], axis=0).T).sum()) if len(part) > 1 else 0.0


def _first_part(network: RoadNetwork, ref: LaneRef, s_m: float, step_m: float, ahead: bool) -> FloatArray:
    geometry = network.geometry(ref)
    s = min(max(s_m, geometry.begin_m), geometry.end_m)
    upper = (geometry.direction > 0) == ahead
    low, high = (s, geometry.end_m) if upper else (geometry.begin_m, s)
    return geometry.between(low, high, 1.0 if math.isinf(step_m) else step_m)


def _path(
    network: RoadNetwork,
    lanes: tuple[LaneRef, ...],
    complete: bool,
    s_m: float,
    distance_m: float,
    step_m: float,
    ahead: bool,
) -> LanePath:
    pieces = [_first_part(network, lanes[0], s_m, step_m, ahead)]
    pieces += [network.centreline(lane, step_m) for lane in lanes[1:]]
    ordered = pieces if ahead else pieces[::-1]
    points = np.concatenate(ordered)
    # Lanes meet end to start: the doubled point at each seam is dropped.
    keep = np.concatenate([[True], np.hypot(*np.diff(points[:, :2], axis=0).T) > 1e-6])
    if not ahead:
        keep[-1] = True
    points = points[keep]
    points[:, 3] = np.unwrap(points[:, 3])
    stations = np.concatenate([[0.0], np.cumsum(np.hypot(*np.diff(points[:, :2], axis=0).T))])
    total = float(stations[-1])
    low, high = (0.0, min(distance_m, total)) if ahead else (max(total - distance_m, 0.0), total)
    inside = (stations > low + 1e-9) & (stations < high - 1e-9)
    cut = np.concatenate([[low], stations[inside], [high]])
    points = np.column_stack([np.interp(cut, stations, column) for column in points.T])
    return LanePath(lanes if ahead else lanes[::-1], points, cut - low, complete)
