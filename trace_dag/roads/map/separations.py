"""Overpasses: reference lines that cross while their roads do not meet."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import replace
from typing import Final, NamedTuple

import numpy as np
import shapely

from trace_dag.roads.map.curves import element_pose
from trace_dag.roads.map.model import Road
from trace_dag.roads.map.network import RoadNetwork
from trace_dag.roads.map.reference_line import ReferenceLine

_PARALLEL_RAD: Final = math.radians(8.0)  # lines this close to parallel count as side by side, not as crossing
_STEP_M: Final = 2.0
_GROUND: Final = (0, False, False)


class Separation(NamedTuple):
    """Two roads whose lines cross at (``x_m``, ``y_m``), at ``s_m`` of each, without a common junction or link."""

    roads: tuple[Road, Road]
    s_m: tuple[float, float]
    x_m: float
    y_m: float
    angle_rad: float  # between the lines, (0, pi/2]

    @property
    def levels_differ(self) -> bool:
        """Return whether one road passes over the other by OSM's layers."""
        return _level(self.roads[0]) != _level(self.roads[1])


def find_separations(network: RoadNetwork, *, between_levels: bool = False) -> list[Separation]:
    """Return all crossings of roads that do not meet, in order; ``between_levels`` limits them to two levels.

    >>> find_separations(network)  # no bridge or tunnel near the crash
    []
    """
    roads = _around_structures(network.roads) if between_levels else list(network.roads)
    asked = [i for i, road in enumerate(roads) if not between_levels or _level(road) != _GROUND]
    if not asked:
        return []
    corners = [_corners(road) for road in roads]
    owners = np.repeat(np.arange(len(roads)), [len(points) for points in corners])
    shapes = np.asarray(shapely.linestrings(np.concatenate(corners), indices=owners), dtype=object)
    touching = shapely.STRtree(shapes).query(shapes[asked], predicate="intersects").T.tolist()
    found = []
    for i, j in sorted({(min(asked[k], other), max(asked[k], other)) for k, other in touching}):
        a, b = roads[i], roads[j]
        if i == j or _roads_meet(a, b) or (between_levels and _level(a) == _level(b)):
            continue
        if not shapely.crosses(shapes[i], shapes[j]):  # dear, and most that touch meet
            continue
        for point in shapely.get_parts(shapely.intersection(shapes[i], shapes[j])):
            centre = point.centroid
            lines = [network.road_geometry(road.id).line for road in (a, b)]
            feet = [line.project(centre.x, centre.y) for line in lines]
            directions = [line.at(foot.s_m)[2] for line, foot in zip(lines, feet, strict=True)]
            angle_rad = abs(math.remainder(directions[0] - directions[1], math.pi))
            if angle_rad >= _PARALLEL_RAD:
                found.append(Separation((a, b), (feet[0].s_m, feet[1].s_m), centre.x, centre.y, angle_rad))
    return found


def _level(road: Road) -> tuple[int, bool, bool]:
    return road.layer, road.bridge, road.tunnel


def _around_structures(roads: Sequence[Road]) -> list[Road]:
    """Return the bridges, tunnels and roads on other layers, and the roads within reach of them."""
    starts = np.array([(road.plan[0].x_m, road.plan[0].y_m) for road in roads]).reshape(-1, 2)
    lengths = np.array([road.length_m for road in roads])
    near = np.zeros(len(roads), dtype=bool)
    for index, road in enumerate(roads):
        if _level(road) != _GROUND:
            near |= np.hypot(*(starts - starts[index]).T) <= lengths + road.length_m
    return [roads[index] for index in np.flatnonzero(near).tolist()]


def _corners(road: Road) -> list[tuple[float, float]]:
    """Return a road's reference line as a polyline: ends of its straight pieces, and points along its curves."""
    points: list[tuple[float, float]] = []
    for element in road.plan:
        points.append((element.x_m, element.y_m))
        pieces = math.ceil(element.length_m / _STEP_M)
        if element.poly is not None:
            line = ReferenceLine((replace(element, s_m=0.0),), element.length_m)
            points.extend(line.at(element.length_m * k / pieces)[:2] for k in range(1, pieces + 1))
        elif element.curvature_1pm:
            points.extend(element_pose(element, element.length_m * k / pieces)[:2] for k in range(1, pieces))
    if road.plan[-1].poly is None:
        points.append(element_pose(road.plan[-1], road.plan[-1].length_m)[:2])
    return points


def _roads_meet(a: Road, b: Road) -> bool:
    """Return whether two roads belong to one junction or are linked to each other."""
    of_a, of_b = ({road.junction_id, *road.linked_junctions} - {None} for road in (a, b))
    return bool(of_a & of_b) or b.id in a.linked_roads or a.id in b.linked_roads
