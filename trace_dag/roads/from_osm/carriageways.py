"""Which places lie on the lanes of which roads."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from typing import Final

import numpy as np
import shapely

from trace_dag.geometry import FloatArray
from trace_dag.roads.map.arcs import along_arcs
from trace_dag.roads.map.model import Road

_BESIDE_LENGTH_M: Final = 3.0  # half the length of road that a place of its reference line stands for
_CLEAR_M: Final = 0.1


def on_carriageways(points: FloatArray, roads: Sequence[Road]) -> Iterator[tuple[int, Road]]:
    """Which of the points, (n, 2), may lie on the lanes of which roads: nothing that does is left out.

    Each short piece of a reference line stands for a box about it as wide as the lanes get anywhere on the road.
    """
    pieces = [
        (number, each.x_m, each.y_m, each.heading_rad, each.length_m, each.curvature_1pm)
        for number, road in enumerate(roads)
        for each in road.plan
    ]
    owner, x, y, heading, length, curvature = np.array(pieces).T
    parts = np.maximum(np.ceil(length / (2 * _BESIDE_LENGTH_M)), 1).astype(int)
    rank = np.arange(parts.sum()) - np.repeat(np.cumsum(parts) - parts, parts)
    owner, x, y, heading, length, curvature, count = (
        np.repeat(values, parts) for values in (owner, x, y, heading, length, curvature, parts)
    )
    owner = owner.astype(int)
    half = length / count / 2
    x, y, heading = along_arcs(x, y, heading, (rank + 0.5) * 2 * half, curvature)
    extents = np.array([_extent_m(road) for road in roads])[owner]
    tree = shapely.STRtree(np.asarray(shapely.points(points)))
    reach = np.hypot(np.maximum(np.abs(extents[:, 0]), np.abs(extents[:, 1])) + _CLEAR_M, half + _CLEAR_M)
    box, point = tree.query(shapely.points(x, y), predicate="dwithin", distance=reach)
    dx, dy = (points[point] - np.stack([x[box], y[box]], axis=1)).T
    cosine, sine = np.cos(heading[box]), np.sin(heading[box])
    ahead, left = dx * cosine + dy * sine, dy * cosine - dx * sine
    inside = np.abs(ahead) <= half[box] + _CLEAR_M
    inside &= (left < extents[box, 0] + _CLEAR_M) & (left > extents[box, 1] - _CLEAR_M)
    for number, k in zip(point[inside].tolist(), owner[box[inside]].tolist(), strict=True):
        yield number, roads[k]


def _extent_m(road: Road) -> tuple[float, float]:
    """How far left and right of the reference line its lanes to drive in reach, at most, left positive."""
    offsets = [cubic.a for cubic in road.lane_offset] or [0.0]
    reach = {1: 0.0, -1: 0.0}
    for section in road.lane_sections:
        for side in (1, -1):
            widths = (
                max(c.a for c in lane.widths) for lane in section.lanes if lane.id * side > 0 and lane.type.drivable
            )
            reach[side] = max(reach[side], sum(widths))
    return max(offsets) + reach[1], min(offsets) - reach[-1]
