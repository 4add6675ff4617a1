"""The axes of roads, and the distances of points from them."""

from __future__ import annotations

from typing import TYPE_CHECKING, Final

import numpy as np
import shapely

from trace_dag.roads.map.model import LaneRef
from trace_dag.roads.map.sampling import Stations, sample_reference_lines

if TYPE_CHECKING:
    from collections.abc import Iterable, Sequence

    from numpy.typing import NDArray

    from trace_dag.common.geometry import FloatArray
    from trace_dag.roads.map.model import Road
    from trace_dag.roads.map.network import RoadNetwork
    from trace_dag.roads.map.reference_line import ReferenceLine

SAMPLE_M: Final = 1.0
"""Points of a curved axis are at most so far apart."""


def distances_to_axes(
    network: RoadNetwork, roads: Sequence[Sequence[Road]], points: Sequence[FloatArray]
) -> list[FloatArray]:
    """Return the distance (m) of each of the points, (n, 2), to the nearest axis of its roads.

    The axes are the reference line and, on one-way roads, the middle of the lanes too.

    >>> road = network.road_by_id[map_report.placement.road_id]
    >>> beginning = np.array([[road.plan[0].x_m, road.plan[0].y_m]])
    >>> [distances.round(6).tolist() for distances in distances_to_axes(network, [[road]], [beginning])]
    [[0.0]]
    """
    if not points:
        return []
    axes = _axes(network, {road.id: road for some in roads for road in some}.values())
    lines = [[line for road in some for line in axes[road.id]] for some in roads]
    places, line = _flat([line for some in lines for line in some])
    owner_of_line = np.repeat(np.arange(len(lines)), [len(some) for some in lines])
    each = np.asarray(shapely.linestrings(places, indices=line))
    together = np.asarray(shapely.multilinestrings(each, indices=owner_of_line))
    every, owner = _flat(points)
    distances = shapely.distance(together[owner], shapely.points(every))
    return np.split(distances, np.cumsum([len(some) for some in points])[:-1])


def _axes(network: RoadNetwork, roads: Iterable[Road]) -> dict[str, list[FloatArray]]:
    """Return the axes of some roads as points, by road id."""
    wanted = list(roads)
    lines = [network.road_geometry(road.id).line for road in wanted]
    one_way = [road.one_way for road in wanted]
    s_m, owner = _flat([_stations(line, everywhere) for line, everywhere in zip(lines, one_way, strict=True)])
    stations = Stations(s_m, owner, np.flatnonzero(np.diff(owner, prepend=-1)))
    sampled = sample_reference_lines(lines, stations)
    found = {}
    for road, has_middle, where in zip(wanted, one_way, stations.slices, strict=True):
        points = sampled[where]
        found[road.id] = [points[:, :2]]
        if has_middle:
            t = _middle_of_lanes(network, road, s_m[where])
            x, y = points[:, 0] - t * np.sin(points[:, 2]), points[:, 1] + t * np.cos(points[:, 2])
            found[road.id].append(np.column_stack([x, y]))
    return found


def _stations(line: ReferenceLine, everywhere: bool) -> FloatArray:
    """Return the stations of a line's pieces, and those metre by metre in curves, or ``everywhere``."""
    starts = line.table[0]
    stations = line.stations(SAMPLE_M)
    if not everywhere and not line.has_cubics:
        piece = np.maximum(np.searchsorted(starts, stations, side="right") - 1, 0)
        stations = stations[(line.table[4][piece] != 0.0) | (stations == line.length_m)]
    return np.union1d(stations, starts)


def _middle_of_lanes(network: RoadNetwork, road: Road, stations_m: FloatArray) -> FloatArray:
    """Return ``t`` of the middle of the drivable lanes."""
    middle = np.zeros(len(stations_m))
    for index, section in enumerate(road.lane_sections):
        here = stations_m >= section.s_m
        borders = []
        for lane in section.lanes:
            if lane.id and lane.type.drivable:
                geometry = network.geometry(LaneRef(road.id, index, lane.id))
                centre, half = geometry.centre.sample(stations_m[here]), geometry.width.sample(stations_m[here]) / 2
                borders += [centre - half, centre + half]
        if borders:
            middle[here] = (np.max(borders, axis=0) + np.min(borders, axis=0)) / 2
    return middle


def _flat(parts: Sequence[FloatArray]) -> tuple[FloatArray, NDArray[np.intp]]:
    """Return the concatenated arrays, and for each row the index of its array."""
    return np.concatenate(parts), np.repeat(np.arange(len(parts)), [len(part) for part in parts])
