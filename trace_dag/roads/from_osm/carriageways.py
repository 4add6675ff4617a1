"""Carriageways as shapes, for finding the roads at a place."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from functools import cached_property
from typing import Final

import numpy as np
import shapely
from numpy.typing import NDArray

from trace_dag.common.geometry import FloatArray
from trace_dag.roads.map.curves import along_arcs
from trace_dag.roads.map.model import Road

_BESIDE_LENGTH_M: Final = 3.0  # half the length of road that a place of its reference line stands for
_CLEAR_M: Final = 0.1


class Carriageways:
    """The lanes that traffic drives in of finished roads.

    Each short piece of a reference line has a box around it with the largest width of the road's lanes.
    """

    def __init__(self, roads: Sequence[Road]) -> None:
        self._roads = roads

    def at(self, points: FloatArray) -> Iterator[tuple[int, Road]]:
        """Return candidates of the roads with lanes at the points, (n, 2): perhaps too many, never too few."""
        owner, (x, y, heading, half, left_m, right_m) = self._boxes
        tree = shapely.STRtree(np.asarray(shapely.points(points)))
        reach = np.hypot(np.maximum(np.abs(left_m), np.abs(right_m)) + _CLEAR_M, half + _CLEAR_M)
        box, point = tree.query(shapely.points(x, y), predicate="dwithin", distance=reach)
        dx, dy = (points[point] - np.stack([x[box], y[box]], axis=1)).T
        cosine, sine = np.cos(heading[box]), np.sin(heading[box])
        ahead, left = dx * cosine + dy * sine, dy * cosine - dx * sine
        inside = np.abs(ahead) <= half[box] + _CLEAR_M
        inside &= (left < left_m[box] + _CLEAR_M) & (left > right_m[box] - _CLEAR_M)
        for number, k in zip(point[inside].tolist(), owner[box[inside]].tolist(), strict=True):
            yield number, self._roads[k]

    @cached_property
    def _boxes(self) -> tuple[NDArray[np.int_], tuple[FloatArray, ...]]:
        """Return, for each box, its road's number, x, y, heading, half length, and extents to the left and right."""
        pieces = [
            (number, each.x_m, each.y_m, each.heading_rad, each.length_m, each.curvature_1pm)
            for number, road in enumerate(self._roads)
            for each in road.plan
        ]
        owner, x, y, heading, length, curvature = np.array(pieces).T
        parts = np.maximum(np.ceil(length / (2 * _BESIDE_LENGTH_M)), 1).astype(int)
        rank = np.arange(parts.sum()) - np.repeat(np.cumsum(parts) - parts, parts)
        owner, x, y, heading, length, curvature, count = (
            np.repeat(values, parts) for values in (owner, x, y, heading, length, curvature, parts)
        )
        half = length / count / 2
        x, y, heading = along_arcs(x, y, heading, (rank + 0.5) * 2 * half, curvature)
        numbers = owner.astype(int)
        left_m, right_m = np.array([_extent_m(road) for road in self._roads])[numbers].T
        return numbers, (x, y, heading, half, left_m, right_m)


def _extent_m(road: Road) -> tuple[float, float]:
    """Return the extents of the road's drivable lanes left and right of the reference line (metres).

    Left is positive.
    """
    offsets = [cubic.a for cubic in road.lane_offset] or [0.0]
    left_m = right_m = 0.0
    for section in road.lane_sections:
        left = right = 0.0
        for lane in section.lanes:
            if lane.id and lane.type.drivable:
                width_m = max(cubic.a for cubic in lane.widths) if len(lane.widths) > 1 else lane.widths[0].a
                if lane.id > 0:
                    left += width_m
                else:
                    right += width_m
        left_m, right_m = max(left_m, left), max(right_m, right)
    return max(offsets) + left_m, min(offsets) - right_m
