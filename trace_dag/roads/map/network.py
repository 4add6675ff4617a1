"""A road network: all roads and junctions around one crash, with the queries of later stages.

A network read from any OpenDRIVE file (this program's, the published benchmark's, Osm2Odr's) has the same queries.
Frame and lane ids are those of :mod:`trace_dag.roads.map.model`.
"""

from __future__ import annotations

from bisect import bisect
from dataclasses import dataclass, fields
from functools import cached_property
from typing import TYPE_CHECKING, Final

import numpy as np

from trace_dag.common.geometry import FloatArray, LocalFrame, Pose
from trace_dag.roads.map.areas import Area, LaneAreas
from trace_dag.roads.map.lane_geometry import LaneGeometry, RoadGeometry
from trace_dag.roads.map.lane_index import LaneIndex
from trace_dag.roads.map.lane_links import LaneLinks
from trace_dag.roads.map.model import Controller, Junction, Lane, LaneMatch, LaneRef, Road

if TYPE_CHECKING:
    from collections.abc import Callable, Iterable, Iterator, Mapping

SAME_LEVEL_M: Final = 2.5
"""Surfaces further apart than this in height are different levels: half of the usual clearance of 4.9 m."""


@dataclass(frozen=True)
class RoadNetwork:
    """All roads and junctions around one crash, in its local frame."""

    frame: LocalFrame
    roads: tuple[Road, ...]
    junctions: tuple[Junction, ...] = ()
    converter: str = ""  # name and version of the program that made it
    attribution: str = ""
    controllers: tuple[Controller, ...] = ()

    @cached_property
    def road_by_id(self) -> dict[str, Road]:
        """Return roads by OpenDRIVE id."""
        return {road.id: road for road in self.roads}

    @cached_property
    def junction_by_id(self) -> dict[str, Junction]:
        """Return junctions by OpenDRIVE id."""
        return {junction.id: junction for junction in self.junctions}

    def junction_of(self, lane: LaneRef) -> Junction | None:
        """Return the junction of a lane's road; None for a road between junctions."""
        return self.junction_by_id.get(self.road_by_id[lane.road_id].junction_id or "")

    # --- lanes -----------------------------------------------------------------------------------------------
    @cached_property
    def _geometry(self) -> _Roads:
        return _Roads(self.road_by_id)

    @cached_property
    def _lanes(self) -> _Lanes:
        return _Lanes(self._geometry)

    @cached_property
    def _lane_areas(self) -> LaneAreas:
        return LaneAreas()

    @cached_property
    def _drivable(self) -> tuple[LaneRef, ...]:
        return tuple(ref for road in self.roads for ref in self.drivable_lanes_of(road))

    @cached_property
    def _drivable_of(self) -> dict[str, tuple[LaneRef, ...]]:
        lane_of = self._lane_by_ref
        return {road.id: tuple(ref for ref in _lanes_of(road) if lane_of[ref].type.drivable) for road in self.roads}

    @cached_property
    def _links(self) -> LaneLinks:
        return LaneLinks(self.roads, self.junctions, self._lane_by_ref, self._drivable_of)

    @cached_property
    def _index(self) -> LaneIndex:
        # Of the lanes, not of this map: with a circle of references it would wait for the garbage collector, all of it.
        lanes, drivable_of = self._lanes, self._drivable_of
        return LaneIndex(self.roads, lambda road: [(ref, lanes[ref]) for ref in drivable_of[road.id]])

    def drivable_lanes(self) -> tuple[LaneRef, ...]:
        """Return every drivable lane of all roads, junctions included."""
        return self._drivable

    def drivable_lanes_of(self, road: Road) -> tuple[LaneRef, ...]:
        """Return the drivable lanes of one road."""
        return self._drivable_of[road.id]

    def is_drivable(self, ref: LaneRef) -> bool:
        """Return whether the lane exists and traffic drives in it."""
        lane = self._lane_by_ref.get(ref)
        return lane is not None and lane.type.drivable

    def lanes(self) -> tuple[LaneRef, ...]:
        """Return every lane but the centre ones, drivable or not."""
        return tuple(ref for road in self.roads for ref in _lanes_of(road))

    def lane(self, ref: LaneRef) -> Lane:
        """Return the lane itself."""
        return self._lane_by_ref[ref]

    @cached_property
    def _lane_by_ref(self) -> dict[LaneRef, Lane]:
        return {
            LaneRef(road.id, index, lane.id): lane
            for road in self.roads
            for index, section in enumerate(road.lane_sections)
            for lane in section.lanes
            if lane.id != 0
        }

    def lane_span(self, ref: LaneRef) -> tuple[float, float]:
        """Return ``s_m`` of the lane's beginning and end along its road's reference line (begin < end always)."""
        geometry = self._lanes[ref]
        return geometry.begin_m, geometry.end_m

    def direction(self, ref: LaneRef) -> int:
        """Return +1 if the lane's traffic goes along the reference line, -1 if against it."""
        return self.road_by_id[ref.road_id].direction(ref.lane_id)

    def successors(self, ref: LaneRef) -> tuple[LaneRef, ...]:
        """Return lanes that follow at the lane's end, in its direction of travel (several at a junction)."""
        return self._links.successors(ref)

    def predecessors(self, ref: LaneRef) -> tuple[LaneRef, ...]:
        """Return lanes that lead to the lane's begin, in the direction of travel."""
        return self._links.predecessors(ref)

    def neighbours(self, ref: LaneRef) -> tuple[LaneRef | None, LaneRef | None]:
        """Return the drivable lanes directly left and right, seen in the direction of travel.

        Their traffic may go either way.
        """
        outward = 1 if ref.lane_id > 0 else -1
        inner_id = ref.lane_id - outward if abs(ref.lane_id) > 1 else -outward
        left = LaneRef(ref.road_id, ref.section, inner_id)
        right = LaneRef(ref.road_id, ref.section, ref.lane_id + outward)
        if self.road_by_id[ref.road_id].left_hand:
            left, right = right, left
        return (left if self.is_drivable(left) else None, right if self.is_drivable(right) else None)

    # --- places ----------------------------------------------------------------------------------------------
    def geometry(self, ref: LaneRef) -> LaneGeometry:
        """Return the centre, borders, width and height of a lane, for repeated use of the same lane."""
        return self._lanes[ref]

    def road_geometry(self, road_id: str) -> RoadGeometry:
        """Return the reference line, lane offset and elevation of a road."""
        return self._geometry[road_id]

    def pose(self, ref: LaneRef, s_m: float, offset_m: float = 0.0) -> Pose:
        """Return the pose at ``s_m`` on the lane's centre, ``offset_m`` to its left, in its direction of travel.

        The offset is measured at right angles to the reference line, as OpenDRIVE's ``t`` is.
        """
        return self._lanes[ref].pose(s_m, offset_m)

    def poses(self, ref: LaneRef, s_m: FloatArray, offset_m: float = 0.0) -> FloatArray:
        """Return poses like :meth:`pose` for ``s_m`` of shape (n,).

        They have shape (n, 4): x, y, z (metres), heading (radians).
        """
        return self._lanes[ref].sample(np.asarray(s_m, float), offset_m)

    def width_m(self, ref: LaneRef, s_m: float) -> float:
        """Return the width of the lane at ``s_m``."""
        return self._lanes[ref].width.at(s_m)

    def centreline(self, ref: LaneRef, step_m: float = 1.0) -> FloatArray:
        """Return the centre of the lane in its direction of travel, shape (n, 4): x, y, z (metres), heading (radians).

        Points are at most ``step_m`` apart along the reference line, ends included; headings are continuous. The array
        is shared and read-only.
        """
        return self._lanes[ref].centreline(step_m)

    @cached_property
    def drivable_area(self) -> Area:
        """Return everything traffic drives on, junctions included, seen from above."""
        return self._area(self.drivable_lanes_of, lambda _: True)

    @cached_property
    def paved_area(self) -> Area:
        """Return the traffic lanes with the paved lanes beside them.

        These are shoulders, and lanes for parking, cycling and walking.
        """
        return self._area(self._paved_lanes_of, lambda _: True)

    def carriageway_near(self, x_m: float, y_m: float, reach_m: float, *, z_m: float) -> Area:
        """Return the area of traffic lanes within some distance of a place, on roads at its level."""
        return self._area(self.drivable_lanes_of, self._is_near(x_m, y_m, reach_m, z_m))

    def kept_clear_near(self, x_m: float, y_m: float, reach_m: float, *, z_m: float) -> Area:
        """Return :meth:`carriageway_near` with the lanes beside it that are kept clear.

        These are shoulders, and lanes for parking and cycling.
        """
        return self._area(
            lambda road: [ref for ref in _lanes_of(road) if self._lane_by_ref[ref].type.kept_clear],
            self._is_near(x_m, y_m, reach_m, z_m),
        )

    def paved_near(
        self, x_m: float, y_m: float, reach_m: float, *, z_m: float, of: Callable[[Road], bool] | None = None
    ) -> Area:
        """Return :meth:`carriageway_near` with the paved lanes beside it.

        These are shoulders, and lanes for parking, cycling and walking. ``of`` chooses the roads.
        """
        is_near = self._is_near(x_m, y_m, reach_m, z_m)
        counts = is_near if of is None else lambda road: of(road) and is_near(road)
        return self._area(self._paved_lanes_of, counts)

    def _paved_lanes_of(self, road: Road) -> list[LaneRef]:
        return [ref for ref in _lanes_of(road) if self._lane_by_ref[ref].type.paved]

    def _is_near(self, x_m: float, y_m: float, reach_m: float, z_m: float) -> Callable[[Road], bool]:
        """Return a test whether a road may be within some distance of a place, at its level."""
        near = {road.id for road in self.roads_within((x_m - reach_m, y_m - reach_m, x_m + reach_m, y_m + reach_m))}

        def is_near(road: Road) -> bool:
            if road.id not in near:
                return False
            geometry = self._geometry[road.id]
            s_m, _, _ = geometry.line.project(x_m, y_m)
            return abs(geometry.height_at(s_m) - z_m) <= SAME_LEVEL_M

        return is_near

    def _area(self, lanes_of: Callable[[Road], Iterable[LaneRef]], counts: Callable[[Road], bool]) -> Area:
        """Return the area of the lanes of the counted roads.

        Each road is tested once, on the first query near it.
        """
        counted: dict[str, bool] = {}

        def within(box_m: tuple[float, float, float, float]) -> Iterator[tuple[LaneRef, LaneGeometry]]:
            for road in self.roads_within(box_m):
                if road.id not in counted:
                    counted[road.id] = counts(road)
                if counted[road.id]:
                    yield from ((ref, self._lanes[ref]) for ref in lanes_of(road))

        return Area(self._lane_areas, within)

    def project(self, ref: LaneRef, x_m: float, y_m: float) -> LaneMatch:
        """Return a point in a given lane's coordinates, the inverse of :meth:`pose` within the lane's span."""
        return LaneMatch(ref, *self._lanes[ref].project(x_m, y_m))

    def nearest_lanes(
        self, x_m: float, y_m: float, max_distance_m: float, *, z_m: float | None = None
    ) -> list[LaneMatch]:
        """Return the drivable lanes within ``max_distance_m`` of a point, nearest first (inside before outside).

        The distance is measured to the lane's surface; lanes that contain the point are ordered by distance from their
        centres. With ``z_m``, lanes whose surface is more than :data:`SAME_LEVEL_M` above or below are left out.
        """
        matches = []
        for ref, geometry in self._index.near(x_m, y_m, max_distance_m):
            match = LaneMatch(ref, *geometry.project(x_m, y_m))
            level = z_m is None or abs(geometry.road.height_at(match.s_m) - z_m) <= SAME_LEVEL_M
            if match.outside_m <= max_distance_m and level:
                matches.append(match)
        matches.sort(key=lambda match: (match.outside_m, abs(match.offset_m), match.lane))
        return matches

    def roads_within(self, box_m: tuple[float, float, float, float]) -> list[Road]:
        """Return roads that may have a lane in a box (west, south, east, north; m), in their order.

        There may be too many, never too few.
        """
        return self._index.roads_within(box_m)

    def __getstate__(self) -> dict[str, object]:
        """Return the fields only; cached results of queries are not sent to other processes."""
        return {field.name: getattr(self, field.name) for field in fields(self)}


def _lanes_of(road: Road) -> Iterator[LaneRef]:
    """Yield every lane of a road but the centre ones: by section, outward on the left, then on the right."""
    for index, section in enumerate(road.lane_sections):
        ids = sorted([lane.id for lane in section.lanes if lane.id])
        first = bisect(ids, 0)
        for lane_id in (*ids[first:], *reversed(ids[:first])):
            yield LaneRef(road.id, index, lane_id)


class _Roads(dict[str, RoadGeometry]):
    """Geometry of roads by id, made on first use."""

    def __init__(self, roads: Mapping[str, Road]) -> None:
        super().__init__()
        self._roads = roads

    def __missing__(self, road_id: str) -> RoadGeometry:
        self[road_id] = geometry = RoadGeometry(self._roads[road_id])
        return geometry


class _Lanes(dict[LaneRef, LaneGeometry]):
    """Geometry of lanes, made for a whole lane section on first use."""

    def __init__(self, roads: _Roads) -> None:
        super().__init__()
        self._roads = roads

    def __missing__(self, ref: LaneRef) -> LaneGeometry:
        for lane_id, geometry in self._roads[ref.road_id].lanes_of(ref.section).items():
            self[ref._replace(lane_id=lane_id)] = geometry
        if ref not in self:
            raise KeyError(ref)
        return self[ref]
