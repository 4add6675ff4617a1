"""Lanes by place: the spatial index behind ``nearest_lanes``, lane surfaces and the drivable area."""

from __future__ import annotations

from functools import cached_property
from typing import TYPE_CHECKING

import numpy as np
import shapely

if TYPE_CHECKING:
    from collections.abc import Iterator, Mapping

    from trace_dag.roads.lane_geometry import LaneGeometry
    from trace_dag.roads.network import LaneRef

_JOIN_M = 0.02
"""Slivers between lanes narrower than this are closed in the drivable area."""


class LaneIndex:
    """A spatial index of lanes by their centres."""

    def __init__(self, lanes: Mapping[LaneRef, LaneGeometry]) -> None:
        self._lanes = list(lanes.items())

    @cached_property
    def _tree(self) -> shapely.STRtree:
        lines = [geometry.search_line for _, geometry in self._lanes]
        owners = np.repeat(np.arange(len(lines)), [len(line) for line in lines])
        geometries = np.asarray(shapely.linestrings(np.concatenate(lines), indices=owners), dtype=object)
        return shapely.STRtree(geometries)

    @cached_property
    def _half_width_m(self) -> float:
        """Half of the widest lane, with room for what the coarse search line cuts off in curves."""
        widths = (
            geometry.width.constant
            if geometry.width.constant is not None
            else float(np.max(geometry.width.sample(np.linspace(geometry.begin_m, geometry.end_m, 9))))
            for _, geometry in self._lanes
        )
        return max(widths, default=0.0) / 2 + 0.5

    def near(self, x_m: float, y_m: float, distance_m: float) -> Iterator[tuple[LaneRef, LaneGeometry]]:
        """Candidates whose surface may lie within ``distance_m`` of a point, in no order."""
        if not self._lanes:
            return
        reach = distance_m + self._half_width_m
        for number in self._tree.query(shapely.Point(x_m, y_m), predicate="dwithin", distance=reach):
            yield self._lanes[int(number)]

    @staticmethod
    def polygon(geometry: LaneGeometry, step_m: float) -> shapely.Polygon:
        """A lane's surface."""
        left = geometry.border(True, step_m)[:, :2]
        right = geometry.border(False, step_m)[:, :2]
        return shapely.Polygon(np.concatenate([left, right[::-1]]))

    def drivable_area(self, step_m: float = 2.0) -> shapely.MultiPolygon:
        """Union of all lanes' surfaces."""
        surfaces = np.array([self.polygon(geometry, step_m) for _, geometry in self._lanes], dtype=object)
        area = shapely.union_all(shapely.make_valid(surfaces)) if len(surfaces) else shapely.MultiPolygon()
        closed = shapely.buffer(shapely.buffer(area, _JOIN_M, join_style="mitre"), -_JOIN_M, join_style="mitre")
        parts = [part for part in shapely.get_parts(closed) if part.geom_type == "Polygon"]
        return shapely.MultiPolygon(parts)
