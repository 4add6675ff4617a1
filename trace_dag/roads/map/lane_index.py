"""An index of lanes by place, for ``nearest_lanes``, lane surfaces and the drivable area.

A query on a large map needs few of its lanes. Boxes are made around all roads at once; lines along lanes are made only
for roads near the queried places.
"""

from __future__ import annotations

import math
from typing import TYPE_CHECKING, NamedTuple

import numpy as np
import shapely

from trace_dag.roads.map.curves import along_arcs
from trace_dag.roads.map.lane_geometry import sample_lanes

if TYPE_CHECKING:
    from collections.abc import Callable, Iterable, Iterator, Sequence

    from numpy.typing import NDArray
    from shapely.geometry.base import BaseGeometry

    from trace_dag.common.geometry import FloatArray
    from trace_dag.roads.map.lane_geometry import LaneGeometry
    from trace_dag.roads.map.model import Cubic, LaneRef, Road

    Box = tuple[float, float, float, float]  # west, south, east, north; m
    LanesOf = Callable[[Road], Iterable[tuple[LaneRef, LaneGeometry]]]

_JOIN_M = 0.02
"""Slivers between lanes narrower than this are closed in the drivable area."""
_GRID_M = 1e-6
_SEARCH_M = 1.5
"""Room for what lies between two points of a lane's search line, and for what it cuts off in curves."""


class LaneIndex:
    """The drivable lanes of some roads, found by place. ``lanes_of`` returns the lanes of one road."""

    def __init__(self, roads: Sequence[Road], lanes_of: LanesOf) -> None:
        self._roads = tuple(roads)
        self._lanes_of = lanes_of
        self._boxes = _boxes(self._roads)
        self._looked_up: dict[int, _Lines | None] = {}

    def near(self, x_m: float, y_m: float, distance_m: float) -> Iterator[tuple[LaneRef, LaneGeometry]]:
        """Yield lanes whose surface may lie within ``distance_m`` of a point, in the order of the roads."""
        low_x, low_y, high_x, high_y = self._boxes
        apart_x = np.maximum(np.maximum(low_x - x_m, x_m - high_x), 0.0)
        apart_y = np.maximum(np.maximum(low_y - y_m, y_m - high_y), 0.0)
        near_roads = np.flatnonzero(np.hypot(apart_x, apart_y) <= distance_m).tolist()
        self._look_up(near_roads)
        for number in near_roads:
            lines = self._looked_up[number]
            if lines is None:
                continue
            apart_2 = (lines.points[:, 0] - x_m) ** 2 + (lines.points[:, 1] - y_m) ** 2
            near = np.minimum.reduceat(apart_2, lines.first) <= (distance_m + lines.reach_m) ** 2
            for lane in np.flatnonzero(near).tolist():
                yield lines.lanes[lane]

    def roads_within(self, box_m: Box) -> list[Road]:
        """Return roads that may have a lane in a box (west, south, east, north), in their order."""
        west, south, east, north = box_m
        low_x, low_y, high_x, high_y = self._boxes
        touching = (low_x < east) & (high_x > west) & (low_y < north) & (high_y > south)
        return [self._roads[number] for number in np.flatnonzero(touching)]

    def _look_up(self, numbers: Iterable[int]) -> None:
        """Find the lanes of some roads with their lines; None for a road without drivable lanes."""
        lanes_of = {
            number: list(self._lanes_of(self._roads[number])) for number in numbers if number not in self._looked_up
        }
        sample_lanes(geometry for lanes in lanes_of.values() for _, geometry in lanes)
        for number, lanes in lanes_of.items():
            self._looked_up[number] = _Lines.of(lanes) if lanes else None


class _Lines(NamedTuple):
    """The search lines of a road's lanes, one after the other."""

    lanes: list[tuple[LaneRef, LaneGeometry]]
    points: FloatArray  # (n, 2)
    first: NDArray[np.intp]  # of each lane's points
    reach_m: FloatArray  # farthest distance from the lane's line to its surface, with a margin for the coarse line

    @classmethod
    def of(cls, lanes: list[tuple[LaneRef, LaneGeometry]]) -> _Lines:
        lines = [geometry.samples.centre_m[:, :2] for _, geometry in lanes]
        first = np.cumsum([0, *(len(line) for line in lines[:-1])])
        reach_m = np.array([_widest_m(geometry) / 2 + _SEARCH_M for _, geometry in lanes])
        return cls(lanes, np.concatenate(lines), first, reach_m)


def polygon(geometry: LaneGeometry) -> shapely.Polygon:
    """Return a lane's surface."""
    left, right = geometry.borders()
    return shapely.Polygon(np.concatenate([left, right[::-1]])[:, :2])


def unite_areas(surfaces: Iterable[shapely.Polygon], *, within: Box | None = None) -> shapely.MultiPolygon:
    """Unite surfaces of lanes, which may cross themselves, without slivers.

    With a box ``within`` (west, south, east, north; m), only the parts in it count.

    >>> unite_areas([shapely.box(0.0, 0.0, 5.0, 3.5), shapely.box(0.0, 3.51, 5.0, 7.0)]).area  # 1 cm apart
    35.0
    >>> unite_areas([shapely.box(0.0, 0.0, 5.0, 3.5)], within=(0.0, 0.0, 2.0, 9.0)).area
    7.0
    """
    made = shapely.make_valid(np.array(list(surfaces), dtype=object))
    if within is not None:
        made = shapely.make_valid(shapely.clip_by_rect(made, *within))  # GEOS promises no valid pieces
    area = _union(made)
    with np.errstate(divide="ignore", invalid="ignore"):  # GEOS divides by zero here, with a correct result
        closed = shapely.buffer(shapely.buffer(area, _JOIN_M, join_style="mitre"), -_JOIN_M, join_style="mitre")
    # Where borders cross at sharp angles GEOS may lose a piece.
    sound = closed if closed.is_valid and closed.area >= area.area else _valid(_union([area, _valid(closed)]))
    return shapely.MultiPolygon([part for part in shapely.get_parts(sound) if part.geom_type == "Polygon"])


def _union(areas: Sequence[shapely.Geometry] | NDArray[np.object_]) -> BaseGeometry:
    """Unite areas, on a grid if almost parallel borders are too much for exact arithmetic."""
    try:
        return shapely.union_all(areas)
    except shapely.errors.GEOSException:
        return shapely.union_all(areas, grid_size=_GRID_M)


def _valid(area: shapely.Geometry) -> shapely.Geometry:
    """Make an area valid, without the lines that its borders would leave."""
    try:
        return shapely.make_valid(area, method="structure", keep_collapsed=False)
    except shapely.errors.GEOSException:
        return shapely.make_valid(area)


def _widest_m(geometry: LaneGeometry) -> float:
    if geometry.width.constant is not None:
        return geometry.width.constant
    return float(np.max(geometry.width.sample(np.linspace(geometry.begin_m, geometry.end_m, 9))))


def _boxes(roads: Sequence[Road]) -> FloatArray:
    """Return boxes that contain all lanes of each road, shape (4, n): low x, low y, high x, high y."""
    if not roads:
        return np.zeros((4, 0))
    pieces = [
        (number, each.x_m, each.y_m, each.heading_rad, each.length_m, each.curvature_1pm, each.poly is not None)
        for number, road in enumerate(roads)
        for each in road.plan
    ]
    owner, x, y, heading, length, curvature, cubic = np.array(pieces, dtype=float).T
    end_x, end_y, _ = along_arcs(x, y, heading, length, curvature)
    turn = curvature * length
    # An arc rises above its chord by less than this; a cubic of this length stays within it of its beginning.
    rise = np.where(cubic > 0, length, length * np.minimum(np.abs(turn), math.tau) / 8)
    rise += np.array([_farthest_lane_m(road) for road in roads])[owner.astype(int)]
    first = np.flatnonzero(np.diff(owner, prepend=-1.0))
    return np.stack(
        [
            np.minimum.reduceat(np.minimum(x, end_x) - rise, first),
            np.minimum.reduceat(np.minimum(y, end_y) - rise, first),
            np.maximum.reduceat(np.maximum(x, end_x) + rise, first),
            np.maximum.reduceat(np.maximum(y, end_y) + rise, first),
        ]
    )


def _farthest_lane_m(road: Road) -> float:
    """Return a distance from the reference line that contains all lanes of a road."""
    widths_m = (
        math.fsum(_bound_m(lane.widths, road.length_m) for lane in section.lanes) for section in road.lane_sections
    )
    return _bound_m(road.lane_offset, road.length_m) + max(widths_m, default=0.0)


def _bound_m(cubics: Sequence[Cubic], length_m: float) -> float:
    """Return an upper bound of piecewise cubics over a length, from the largest value of each term."""
    if len(cubics) == 1 and not (cubics[0].b or cubics[0].c or cubics[0].d):
        return abs(cubics[0].a)
    bound = 0.0
    for number, cubic in enumerate(cubics):
        end_m = cubics[number + 1].s_m if number + 1 < len(cubics) else length_m
        ds = max(end_m - cubic.s_m, 0.0)
        bound = max(bound, abs(cubic.a) + ds * (abs(cubic.b) + ds * (abs(cubic.c) + ds * abs(cubic.d))))
    return bound
