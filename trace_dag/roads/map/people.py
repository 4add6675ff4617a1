"""What a map has for people on foot and on bicycles: crosswalks, sidewalks and cycle lanes near a place.

A road without them on the map may have them in reality: OpenStreetMap has them for some towns and not for others.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import TYPE_CHECKING, NamedTuple

import numpy as np
import shapely

from trace_dag.roads.map.model import LaneRef, LaneType

if TYPE_CHECKING:
    from trace_dag.geometry import FloatArray
    from trace_dag.roads.map.model import Crosswalk
    from trace_dag.roads.map.network import RoadNetwork

_THERE_M = 0.3  # a lane narrower than this is only beginning or ending


@dataclass(frozen=True, eq=False)
class CrosswalkPlace:
    """A crosswalk in the local frame: corners, shape (n, 2), and the middles of its ends at the right and the left edge
    of its road as seen along the reference line, shape (2, 2), metres."""

    road_id: str
    crosswalk: Crosswalk
    corners_m: FloatArray
    ends_m: FloatArray

    def distance_m(self, x_m: float, y_m: float) -> float:
        """Distance of a point from its outline, 0 inside."""
        return float(shapely.Polygon(self.corners_m).distance(shapely.Point(x_m, y_m)))


class LaneBeside(NamedTuple):
    """A sidewalk or cycle lane at a station: ``t_m`` of its middle left of the reference line, and its width (m)."""

    lane: LaneRef
    t_m: float
    width_m: float


def crosswalks(network: RoadNetwork) -> list[CrosswalkPlace]:
    """Every crosswalk of the map, by road."""
    return [_placed(network, road.id, crosswalk) for road in network.roads for crosswalk in road.crosswalks]


def crosswalks_near(network: RoadNetwork, x_m: float, y_m: float, max_distance_m: float) -> list[CrosswalkPlace]:
    """The crosswalks within a distance of a point, nearest first."""
    found = [(place.distance_m(x_m, y_m), number, place) for number, place in enumerate(crosswalks(network))]
    return [place for distance_m, _, place in sorted(found, key=lambda row: row[:2]) if distance_m <= max_distance_m]


def lanes_beside(network: RoadNetwork, road_id: str, s_m: float, lane_type: LaneType) -> tuple[LaneBeside, ...]:
    """The lanes of one type at a station of a road, from left to right: its sidewalks, or its cycle lanes.

    >>> road_id = map_report.placement.road_id  # Main Street: two lanes each way between two sidewalks
    >>> [beside.lane.lane_id for beside in lanes_beside(network, road_id, 10.0, LaneType.SIDEWALK)]
    [3, -3]
    """
    road = network.road_by_id[road_id]
    section = max((k for k, each in enumerate(road.lane_sections) if each.s_m <= s_m), default=0)
    found = []
    for lane in road.lane_sections[section].lanes:
        if lane.id and lane.type is lane_type:
            ref = LaneRef(road_id, section, lane.id)
            geometry = network.geometry(ref)
            width_m = geometry.width.at(s_m)
            if width_m >= _THERE_M:
                found.append(LaneBeside(ref, geometry.centre.at(s_m), width_m))
    return tuple(sorted(found, key=lambda beside: -beside.t_m))


def sidewalks_at(network: RoadNetwork, road_id: str, s_m: float) -> tuple[LaneBeside | None, LaneBeside | None]:
    """The sidewalk left and the one right of the reference line of a road at a station, where the map has them."""
    found = lanes_beside(network, road_id, s_m, LaneType.SIDEWALK)
    left = next((each for each in found if each.lane.lane_id > 0), None)
    return left, next((each for each in found if each.lane.lane_id < 0), None)


def _placed(network: RoadNetwork, road_id: str, crosswalk: Crosswalk) -> CrosswalkPlace:
    x, y, heading, _ = network.road_geometry(road_id).line.at(crosswalk.s_m)
    outline = np.array(crosswalk.outline_m)
    by_left = outline[np.argsort(outline[:, 1], kind="stable")]
    half = len(outline) // 2
    ends = np.array([by_left[:half].mean(axis=0), by_left[-half:].mean(axis=0)])
    cosine, sine = math.cos(heading), math.sin(heading)
    turn = np.array([[cosine, sine], [-sine, cosine]])
    return CrosswalkPlace(road_id, crosswalk, outline @ turn + (x, y), ends @ turn + (x, y))
