"""Areas that lanes cover, seen from above, for tests of points and distances from their edges.

The surfaces of all lanes of a large map take a fifth of a second to join, and a crash needs few places of it. So an
area is joined only around the queried places, from the lanes nearby, since a point's position in an area depends on the
lanes around it alone.
"""

from __future__ import annotations

import math
from itertools import compress
from typing import TYPE_CHECKING, Final

import numpy as np
import shapely

from trace_dag.roads.map.lane_geometry import sample_lanes
from trace_dag.roads.map.lane_index import polygon, unite_areas

if TYPE_CHECKING:
    from collections.abc import Callable, Iterable, Iterator

    from numpy.typing import NDArray

    from trace_dag.common.geometry import FloatArray, Pose
    from trace_dag.roads.map.lane_geometry import LaneGeometry
    from trace_dag.roads.map.lane_index import Box
    from trace_dag.roads.map.model import LaneRef

    LanesWithin = Callable[[Box], Iterable[tuple[LaneRef, LaneGeometry]]]

_TILE_M: Final = 32.0
_AROUND_M: Final = 12.0
"""Reach of a tile: ground of lanes this near is part of its piece."""
_WIDEST_M: Final = 30.0  # farther from its edge nobody drives
_TOUCHING_M: Final = 1.0  # more than what closing the slivers between lanes can reach


class LaneAreas:
    """Surfaces of single lanes and of joined lanes, made on first use and kept."""

    def __init__(self) -> None:
        self._surfaces: dict[LaneRef, shapely.Polygon] = {}
        self._areas: dict[tuple[tuple[LaneRef, ...], Box | None], shapely.MultiPolygon] = {}

    def of(
        self, lanes: Iterable[tuple[LaneRef, LaneGeometry]], box: Box, reach_m: float, *, cut: bool = False
    ) -> shapely.MultiPolygon:
        """Return the joined area of the lanes within some distance of a box.

        The lanes are whole, or ``cut`` at that distance, which takes a third of the time for long lanes.
        """
        known = list(lanes)
        new = [(ref, geometry) for ref, geometry in known if ref not in self._surfaces]
        sample_lanes(geometry for _, geometry in new)
        self._surfaces |= {ref: polygon(geometry) for ref, geometry in new}
        surfaces = np.array([self._surfaces[ref] for ref, _ in known], dtype=object)
        if known and reach_m < math.inf:
            near = shapely.dwithin(surfaces, shapely.box(*box), reach_m)
            known, surfaces = list(compress(known, near)), surfaces[near]
        edge = _wider(box, reach_m) if cut else None
        kept = (tuple(ref for ref, _ in known), edge)
        if kept not in self._areas:
            area = unite_areas(surfaces, within=edge)
            shapely.prepare(area)
            self._areas[kept] = area
        return self._areas[kept]


class Area:
    """The area of some lanes: those that ``lanes_within`` gives for a box (west, south, east, north; m)."""

    def __init__(self, lane_areas: LaneAreas, lanes_within: LanesWithin) -> None:
        self._lane_areas = lane_areas
        self._lanes_within = lanes_within
        self._tiles: dict[tuple[int, int], shapely.MultiPolygon] = {}
        self._edges: dict[tuple[int, int], shapely.MultiLineString] = {}

    @property
    def is_empty(self) -> bool:
        """Return whether the area has no lane."""
        return next(iter(self._lanes_within((-math.inf, -math.inf, math.inf, math.inf))), None) is None

    def within(self, box: Box, reach_m: float) -> shapely.MultiPolygon:
        """Return the surfaces within some distance of a box, whole."""
        return self._lane_areas.of(self._lanes_within(_wider(box, reach_m)), box, reach_m)

    def has(self, x_m: float, y_m: float) -> bool:
        """Return whether a point lies in the area."""
        return bool(shapely.contains_xy(self._tile(x_m, y_m), x_m, y_m))

    def contains(self, x_m: FloatArray, y_m: FloatArray) -> NDArray[np.bool_]:
        """Return whether points lie in the area."""
        return np.asarray(shapely.contains_xy(self._piece(x_m, y_m), x_m, y_m))

    def beyond_m(self, x_m: FloatArray, y_m: FloatArray) -> FloatArray:
        """Return the distances (m) of points beyond the edge, negative within the area.

        Not a number if there is no area.
        """
        for area, reach_m in self._growing(_box_about(x_m, y_m)):
            from_edge_m = _from_edge_m(x_m, y_m, area.boundary)
            found = np.asarray(np.where(shapely.contains_xy(area, x_m, y_m), -from_edge_m, from_edge_m))
            if bool((np.abs(found) < reach_m).all()):
                break
        return found

    def edge_beside_m(self, here: Pose, side: float) -> float:
        """Return the distance from a pose in it to its edge, to the left (side 1) or right (-1); 0 from one outside.

        >>> in_its_lane = way_past_the_tree.approach.path.pose(way_past_the_tree.station_m)
        >>> tree_scene.carriageway.edge_beside_m(in_its_lane, -1.0)  # half of a lane of 3.5 m
        1.75
        """
        away = np.arange(0.0, _WIDEST_M, 0.25)
        x = here.x_m - math.sin(here.heading_rad) * side * away
        y = here.y_m + math.cos(here.heading_rad) * side * away
        inside = self.contains(x, y)
        return float(away[int(np.argmin(inside))]) if inside[0] and not inside.all() else 0.0

    def nearest(self, x_m: float, y_m: float) -> tuple[float, float]:
        """Return the point of the area nearest to a point (x, y; m), or the point itself without an area."""
        point = shapely.Point(x_m, y_m)
        for area, reach_m in self._growing((x_m, y_m, x_m, y_m)):
            if not area.is_empty and area.distance(point) < reach_m:
                x, y = shapely.get_coordinates(shapely.shortest_line(area, point))[0].tolist()
                return x, y
        return x_m, y_m

    def _growing(self, box: Box) -> Iterator[tuple[shapely.MultiPolygon, float]]:
        """Yield ever larger parts of the area around a box, each with the distance up to which it is complete."""
        for reach_m in (_TILE_M, 4 * _TILE_M, math.inf):
            yield self.within(box, reach_m), reach_m

    def edge_near(self, x_m: float, y_m: float) -> shapely.MultiLineString:
        """Return the edge of the area within twelve metres of a point.

        Lines farther away may be where the area was cut.
        """
        at = _tile_of(x_m, y_m)
        if at not in self._edges:
            self._edges[at] = self._tile(x_m, y_m).boundary
            shapely.prepare(self._edges[at])
        return self._edges[at]

    def _piece(self, x_m: FloatArray, y_m: FloatArray) -> shapely.MultiPolygon:
        """Return the part of the area that may contain some points."""
        west, south, east, north = _box_about(x_m, y_m)
        at = _tile_of(west, south)
        if at == _tile_of(east, north):
            return self._tile(west, south)
        return self.within((west, south, east, north), _TOUCHING_M)

    def _tile(self, x_m: float, y_m: float) -> shapely.MultiPolygon:
        at = _tile_of(x_m, y_m)
        if at not in self._tiles:
            west, south = at[0] * _TILE_M, at[1] * _TILE_M
            tile = (west, south, west + _TILE_M, south + _TILE_M)
            lanes = self._lanes_within(_wider(tile, _AROUND_M))
            self._tiles[at] = self._lane_areas.of(lanes, tile, _AROUND_M, cut=True)
        return self._tiles[at]


def _from_edge_m(x_m: FloatArray, y_m: FloatArray, edge: shapely.Geometry) -> FloatArray:
    """Return the distances of points from an edge with perhaps thousands of segments.

    Not a number without an edge.
    """
    rings = [shapely.get_coordinates(line) for line in shapely.get_parts(edge)]
    if not rings:
        return np.full(len(x_m), np.nan)
    segments = shapely.STRtree(np.concatenate([shapely.linestrings(np.stack([r[:-1], r[1:]], axis=1)) for r in rings]))
    (of_point, _), away_m = segments.query_nearest(
        shapely.points(np.column_stack([x_m, y_m])), return_distance=True, all_matches=False
    )
    found = np.empty(len(x_m))
    found[of_point] = away_m
    return found


def _tile_of(x_m: float, y_m: float) -> tuple[int, int]:
    return math.floor(x_m / _TILE_M), math.floor(y_m / _TILE_M)


def _wider(box: Box, by_m: float) -> Box:
    west, south, east, north = box
    return west - by_m, south - by_m, east + by_m, north + by_m


def _box_about(x_m: FloatArray, y_m: FloatArray) -> Box:
    return float(np.min(x_m)), float(np.min(y_m)), float(np.max(x_m)), float(np.max(y_m))
