"""Areas of a map for people on foot and on bicycles: crosswalks, sidewalks and cycle lanes near a place.

A road without them on the map may have them in reality: OpenStreetMap has them only in some towns.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import TYPE_CHECKING, NamedTuple

import numpy as np
import shapely

from trace_dag.roads.map.model import LaneRef, LaneType

if TYPE_CHECKING:
    from trace_dag.common.geometry import FloatArray
    from trace_dag.roads.map.model import Crosswalk
    from trace_dag.roads.map.network import RoadNetwork

_THERE_M = 0.3  # a lane narrower than this is only beginning or ending
_UNMARKED_M = 3.0  # along the road: twice the width of a sidewalk for two (AASHTO, 1.5 m)


@dataclass(frozen=True, eq=False)
class CrosswalkPlace:
    """A crosswalk in the local frame.

    It has corners, shape (n, 2), and the middles of its ends at the right and the left edge of the road seen along the
    reference line, shape (2, 2), metres.
    """

    road_id: str
    crosswalk: Crosswalk
    corners_m: FloatArray
    ends_m: FloatArray

    def distance_m(self, x_m: float, y_m: float) -> float:
        """Return the distance of a point from its outline, 0 inside."""
        return float(shapely.Polygon(self.corners_m).distance(shapely.Point(x_m, y_m)))


class LaneBeside(NamedTuple):
    """A sidewalk or cycle lane at a station: ``t_m`` of its middle left of the reference line, and its width (m)."""

    lane: LaneRef
    t_m: float
    width_m: float


def crosswalks(network: RoadNetwork) -> list[CrosswalkPlace]:
    """Return every crosswalk of the map, by road."""
    return [_placed(network, road.id, crosswalk) for road in network.roads for crosswalk in road.crosswalks]


def crosswalks_near(network: RoadNetwork, x_m: float, y_m: float, max_distance_m: float) -> list[CrosswalkPlace]:
    """Return the crosswalks within a distance of a point, nearest first."""
    found = [(place.distance_m(x_m, y_m), number, place) for number, place in enumerate(crosswalks(network))]
    return [place for distance_m, _, place in sorted(found, key=lambda row: row[:2]) if distance_m <= max_distance_m]


def find_unmarked_crosswalks(
    network: RoadNetwork, x_m: float, y_m: float, max_distance_m: float
) -> list[shapely.Polygon]:
    """Return crossings without a mapped crosswalk within a distance of a point.

    They cross the end of each road at a junction (Uniform Vehicle Code, section 1-118), as one polygon per lane,
    metres.

    >>> across = find_unmarked_crosswalks(network, 0.0, 0.0, 30.0)
    >>> bool(across) and all(shape.area < 15.0 for shape in across)  # 3 m of lanes of 3.5 m or little more
    True
    """
    box = (x_m - max_distance_m, y_m - max_distance_m, x_m + max_distance_m, y_m + max_distance_m)
    found = []
    for road in network.roads_within(box):
        back_m = min(_UNMARKED_M, road.length_m)
        for _, s_m, _ in road.ends_at_junctions:
            between_m = sorted((s_m, s_m - back_m if s_m else back_m))
            lanes = [lane for lane in network.drivable_lanes_of(road) if lane.section == road.section_at(s_m)]
            found += [_cut(network, lane, *between_m) for lane in lanes]
    here = shapely.Point(x_m, y_m)
    return [piece for piece in found if piece.distance(here) <= max_distance_m]


def lanes_beside(network: RoadNetwork, road_id: str, s_m: float, lane_type: LaneType) -> tuple[LaneBeside, ...]:
    """Return the lanes of one type at a station of a road, from left to right: sidewalks, or cycle lanes.

    >>> road_id = map_report.placement.road_id  # Main Street: two lanes each way between two sidewalks
    >>> [beside.lane.lane_id for beside in lanes_beside(network, road_id, 10.0, LaneType.SIDEWALK)]
    [3, -3]
    """
    road = network.road_by_id[road_id]
    section = road.section_at(s_m)
    found = []
    for lane in road.lane_sections[section].lanes:
        if lane.id and lane.type is lane_type:
            ref = LaneRef(road_id, section, lane.id)
            geometry = network.geometry(ref)
            width_m = geometry.width.at(s_m)
            if width_m >= _THERE_M:
                found.append(LaneBeside(ref, geometry.centre.at(s_m), width_m))
    return tuple(sorted(found, key=lambda beside: -beside.t_m))


def _cut(network: RoadNetwork, lane: LaneRef, from_m: float, to_m: float) -> shapely.Polygon:
    """Return the part of a lane between two stations, straight between its corners."""
    halves = [(s_m, network.width_m(lane, s_m) / 2) for s_m in (from_m, to_m)]
    corners = [network.pose(lane, s_m, side * half) for side in (1.0, -1.0) for s_m, half in halves]
    first, second, fourth, third = ((corner.x_m, corner.y_m) for corner in corners)
    return shapely.Polygon([first, second, third, fourth])


def _placed(network: RoadNetwork, road_id: str, crosswalk: Crosswalk) -> CrosswalkPlace:
    x, y, heading, _ = network.road_geometry(road_id).line.at(crosswalk.s_m)
    outline = np.array(crosswalk.outline_m)
    by_left = outline[np.argsort(outline[:, 1], kind="stable")]
    half = len(outline) // 2
    ends = np.array([by_left[:half].mean(axis=0), by_left[-half:].mean(axis=0)])
    cosine, sine = math.cos(heading), math.sin(heading)
    turn = np.array([[cosine, sine], [-sine, cosine]])
    return CrosswalkPlace(road_id, crosswalk, outline @ turn + (x, y), ends @ turn + (x, y))
