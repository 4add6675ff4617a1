"""Positions beside the road: a point's road, its distance from the edge of the carriageway, and its zone.

OpenStreetMap seldom has shoulders and never has rights-of-way. Without a shoulder lane on the map, the usual width of
the road's class is used (:func:`trace_dag.osm.road_classes.usual_shoulder_m`). The trafficway is assumed to end 15 m
beyond the edge of a freeway and 9 m beyond that of other roads: the clear zone of AASHTO's Roadside Design Guide, 2011.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from enum import StrEnum
from typing import TYPE_CHECKING, Final

import numpy as np

from trace_dag.osm.road_classes import road_class, usual_shoulder_m
from trace_dag.roads.map.model import LaneMatch, LaneRef, LaneType

if TYPE_CHECKING:
    from trace_dag.roads.map.network import RoadNetwork

_LOOK_AROUND_M: Final = 60.0  # farthest that the carriageways of one divided road may be from each other
_OPPOSED_RAD: Final = math.radians(150)
_PARALLEL_RAD: Final = math.radians(40)
_BETWEEN_RAD: Final = math.radians(120)  # least angle between the directions to two roads, for a point between them
_GORE_M: Final = 15.0  # a road and its ramp farther from each other each have their own roadside
_RANK_FREEWAY: Final = 0
_TRAFFICWAY_M: Final = {True: 15.0, False: 9.0}  # distance beyond the edge, for a freeway and for other roads


class RoadZone(StrEnum):
    """Zones across a road that FARS distinguishes (``REL_ROAD``)."""

    ROADWAY = "roadway"
    SHOULDER = "shoulder"
    MEDIAN = "median"
    GORE = "gore"
    ROADSIDE = "roadside"
    OUTSIDE = "outside"  # outside the trafficway


@dataclass(frozen=True)
class RoadsidePlace:
    """A point beside (or on) a road.

    ``lane`` is the nearest one with the point's station on it; ``along_rad`` the direction of its traffic there.
    ``left``: the point is to the left of that lane's centre in its direction of travel. ``beyond_m`` is the distance
    from the carriageway's edge, negative within it. ``shoulder_m`` is the width of the shoulder on that side.
    """

    lane: LaneMatch
    along_rad: float
    left: bool
    beyond_m: float
    shoulder_m: float
    zone: RoadZone


def roadside_at(network: RoadNetwork, x_m: float, y_m: float, *, z_m: float | None = None) -> RoadsidePlace | None:
    """Return the zone of a point relative to the roads of one level (``z_m``, else any); None beyond 60 m.

    >>> roadside_at(network, 0.0, 0.0).zone.value  # the reported point, in the middle of a crossing
    'roadway'
    """
    near = network.nearest_lanes(x_m, y_m, _LOOK_AROUND_M, z_m=z_m)
    if not near:
        return None
    lane = near[0]
    along_rad = network.pose(lane.lane, lane.s_m).heading_rad
    left = lane.offset_m > 0
    inside = lane.outside_m <= 0
    beyond_m = -_to_edge_m(network, lane, x_m, y_m) if inside else lane.outside_m
    shoulder_m = _shoulder_m(network, lane, left=left)
    zone = RoadZone.ROADWAY if inside else _zone(network, near, beyond_m, shoulder_m, (x_m, y_m))
    return RoadsidePlace(lane, along_rad, left, beyond_m, shoulder_m, zone)


def _to_edge_m(network: RoadNetwork, lane: LaneMatch, x_m: float, y_m: float) -> float:
    z_m = network.road_geometry(lane.lane.road_id).height_at(lane.s_m)
    area = network.carriageway_near(x_m, y_m, _LOOK_AROUND_M, z_m=z_m)
    return abs(float(area.beyond_m(np.array([x_m]), np.array([y_m]))[0]))


def _zone(
    network: RoadNetwork, near: list[LaneMatch], beyond_m: float, shoulder_m: float, xy_m: tuple[float, float]
) -> RoadZone:
    if _is_between(network, near, xy_m, opposed=True):
        return RoadZone.SHOULDER if beyond_m <= shoulder_m else RoadZone.MEDIAN
    if beyond_m <= shoulder_m:
        return RoadZone.SHOULDER
    if _is_between(network, near, xy_m, opposed=False):
        return RoadZone.GORE
    freeway = road_class(network.road_by_id[near[0].lane.road_id].highway).rank == _RANK_FREEWAY
    return RoadZone.ROADSIDE if beyond_m <= _TRAFFICWAY_M[freeway] else RoadZone.OUTSIDE


def _is_between(network: RoadNetwork, near: list[LaneMatch], xy_m: tuple[float, float], *, opposed: bool) -> bool:
    """Return whether a point lies between two lanes: in a median or a gore.

    A median is on the inner sides of two lanes in opposite directions (their left sides in right-hand traffic). A gore
    is between a road and a ramp in the same direction.
    """
    first = near[0]
    sees_first, heading = _seen(network, first, xy_m)
    for other in near[1:]:
        sees_other, other_heading = _seen(network, other, xy_m)
        if abs(math.remainder(sees_first - sees_other, math.tau)) < _BETWEEN_RAD:
            continue
        apart = abs(math.remainder(heading - other_heading, math.tau))
        if opposed:
            inwards = -1.0 if network.road_by_id[first.lane.road_id].left_hand else 1.0
            return apart > _OPPOSED_RAD and first.offset_m * inwards > 0 and other.offset_m * inwards > 0
        ramps = [network.road_by_id[each.lane.road_id].is_ramp for each in (first, other)]
        near_each_other = other.outside_m + first.outside_m <= _GORE_M
        return near_each_other and apart < _PARALLEL_RAD and first.offset_m * other.offset_m < 0 and any(ramps)
    return False


def _seen(network: RoadNetwork, match: LaneMatch, xy_m: tuple[float, float]) -> tuple[float, float]:
    """Return the direction from a point to a lane's centre, and the lane's own direction."""
    pose = network.pose(match.lane, match.s_m)
    return math.atan2(pose.y_m - xy_m[1], pose.x_m - xy_m[0]), pose.heading_rad


def _shoulder_m(network: RoadNetwork, match: LaneMatch, *, left: bool) -> float:
    """Return the width of the shoulder beside a lane (metres): as mapped, or usual for the road's class."""
    mapped = _mapped_shoulder_m(network, match, left=left)
    if mapped is not None:
        return mapped
    road = network.road_by_id[match.lane.road_id]
    return usual_shoulder_m(road.highway, left=left != road.left_hand)


def _mapped_shoulder_m(network: RoadNetwork, match: LaneMatch, *, left: bool) -> float | None:
    ref = match.lane
    on_left = left == (network.direction(ref) > 0)  # left of the reference line
    lanes = network.road_by_id[ref.road_id].lane_sections[ref.section].lanes
    for lane in lanes:
        if lane.type is LaneType.SHOULDER and (lane.id > 0) == on_left:
            return network.width_m(LaneRef(ref.road_id, ref.section, lane.id), match.s_m)
    return None
