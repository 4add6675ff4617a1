"""The streets around the reported point, and the cross-section of a street at a place.

Streets have their distance, and whether they have a reported name; cross-sections the lanes each way, the other
carriageway, and whether they are divided.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, field
from typing import Final

from trace_dag.common.units import wrap_angle
from trace_dag.crash.record import CrashRecord
from trace_dag.osm.road_classes import SERVICE_HIGHWAYS
from trace_dag.roads.crash_site.street_names import SAME_STREET, best_similarity
from trace_dag.roads.from_osm.tags import LEFT_TURNS, RIGHT_TURNS
from trace_dag.roads.map.model import Lane, LaneMatch, LaneType, Road
from trace_dag.roads.map.network import RoadNetwork
from trace_dag.roads.report import NearStreet

_REACHES_M: Final = (100.0, 400.0)  # the second is used if there is no street within the first
_TURNING_LANE_M: Final = 1.5  # a turn belongs to its street a little less than a straight movement does: judgement


@dataclass
class Nearness:
    """The lanes of a road, and of its movements through junctions, near a point, and the distance to their surface."""

    distance_m: float = math.inf
    matches: list[LaneMatch] = field(default_factory=list)

    @property
    def nearest(self) -> LaneMatch:
        """Return the nearest lane."""
        return min(self.matches, key=lambda match: match.outside_m)


def roads_near(network: RoadNetwork, x_m: float, y_m: float, reach_m: float) -> dict[str, Nearness]:
    """Return roads around a point, by id.

    A movement through a junction counts for the roads that it joins.

    >>> sorted({network.road_by_id[road_id].name for road_id in roads_near(network, 0.0, 0.0, 10.0)})
    ['Elder Street', 'Main Street']
    """
    near: dict[str, Nearness] = {}
    for match in network.nearest_lanes(x_m, y_m, reach_m):
        road = network.road_by_id[match.lane.road_id]
        if road.junction_id is None:
            owners, extra_m = [road.id], 0.0
        else:
            owners = [end.id for end in joined_by(network, road)]
            extra_m = 0.0 if road.turn in (None, "straight") else _TURNING_LANE_M
        for owner in owners:
            entry = near.setdefault(owner, Nearness())
            entry.distance_m = min(entry.distance_m, match.outside_m + extra_m)
            entry.matches.append(match)
    return near


def joined_by(network: RoadNetwork, connecting: Road) -> tuple[Road, ...]:
    """Return the roads that a movement through a junction joins.

    >>> through = network.road_by_id[map_report.placement.lane.lane.road_id]  # a movement through the crossing
    >>> through.turn, [road.name for road in joined_by(network, through)]
    ('straight', ['Main Street', 'Main Street'])
    """
    return tuple(network.road_by_id[road_id] for road_id in connecting.linked_roads)


def near_streets(network: RoadNetwork, record: CrashRecord) -> tuple[NearStreet, ...]:
    """Return the streets within 100 m of the reported point, nearest first; if there are none, those within 400 m.

    >>> [(street.name, street.distance_m, street.bears_reported_name) for street in near_streets(network, record)]
    [('Main Street', 0.0, True), ('Elder Street', 0.0, True), ('East Main Street', 67.83, True)]
    """
    x_m, y_m = (float(value) for value in network.frame.to_local(record.latitude_deg, record.longitude_deg))
    for reach_m in _REACHES_M:
        streets: dict[str, dict[str, Nearness]] = {}
        for road_id, near in roads_near(network, x_m, y_m, reach_m).items():
            streets.setdefault(network.road_by_id[road_id].name or road_id, {})[road_id] = near
        if streets:
            break
    found = [_street(network, record, roads) for roads in streets.values()]
    return tuple(sorted(found, key=lambda street: street.distance_m))


def _street(network: RoadNetwork, record: CrashRecord, roads: dict[str, Nearness]) -> NearStreet:
    nearest_id = min(roads, key=lambda road_id: roads[road_id].distance_m)
    road, near = network.road_by_id[nearest_id], roads[nearest_id]
    match = near.nearest
    half_m = network.width_m(match.lane, match.s_m) / 2
    pose = network.pose(match.lane, match.s_m, min(max(match.offset_m, -half_m), half_m))
    names = {name for each in roads for name in network.road_by_id[each].names}
    reported = (record.trafficway_1, record.trafficway_2)
    likeness = best_similarity(reported, names)
    return NearStreet(
        name=road.name,
        highway=road.highway,
        distance_m=round(near.distance_m, 2),
        nearest_xy_m=(round(pose.x_m, 2), round(pose.y_m, 2)),
        bears_reported_name=None if likeness is None else likeness >= SAME_STREET,
    )


# --- the cross-section of a street -----------------------------------------------------------------------------------
_OTHER_CARRIAGEWAY_M: Final = 60.0  # how far apart the carriageways of one divided road may be
_OPPOSED_RAD: Final = math.radians(150)
_TURNS: Final = LEFT_TURNS | RIGHT_TURNS
_APPROACH_M: Final = 60.0  # lanes are counted on this much road either way: turn lanes begin and end


@dataclass(frozen=True)
class LaneCount:
    """Traffic lanes of a road object: along its reference line, against it, and turn lanes in the middle.

    A cross-section with lanes that only turn is counted twice, with and without them. ``VNUM_LAN`` includes them if
    they belong to the vehicle's roadway, which the map does not show.
    """

    along: int
    against: int
    centre: int = 0

    @property
    def total(self) -> int:
        """Return all lanes of the road object."""
        return self.along + self.against + self.centre


@dataclass(frozen=True)
class Carriageway:
    """A road object at a place, and the other carriageway of the same street if it is divided."""

    road: Road
    counts: tuple[LaneCount, ...]  # every count of every cross-section within the approach, nearest first
    median: bool  # the road object itself has a median lane
    opposite: Road | None
    opposite_counts: tuple[LaneCount, ...] = ()

    @property
    def one_way(self) -> bool:
        """Return whether the road object carries one direction only."""
        return self.road.one_way

    @property
    def divided(self) -> bool:
        """Return whether a median or a gap lies between the street's two directions."""
        return self.opposite is not None or self.median


def carriageway_at(network: RoadNetwork, road_id: str, x_m: float, y_m: float) -> Carriageway:
    """Return the street at the place on ``road_id`` nearest to a point.

    >>> street = carriageway_at(network, map_report.placement.road_id, 0.0, 0.0)
    >>> street.road.name, street.counts[0], street.divided
    ('Main Street', LaneCount(along=2, against=2, centre=0), False)
    """
    road = network.road_by_id[road_id]
    line = network.road_geometry(road_id).line
    s_m, _, _ = line.project(x_m, y_m)
    at_x, at_y, heading, _ = line.at(s_m)
    opposite = _opposite(network, road, at_x, at_y, heading) if road.one_way else None
    opposite_counts: tuple[LaneCount, ...] = ()
    if opposite is not None:
        other_s_m, _, _ = network.road_geometry(opposite.id).line.project(at_x, at_y)
        opposite_counts = _lane_counts(opposite, other_s_m)
    median = any(lane.type == LaneType.MEDIAN for section in road.lane_sections for lane in section.lanes)
    return Carriageway(road, _lane_counts(road, s_m), median, opposite, opposite_counts)


def _lane_counts(road: Road, s_m: float, reach_m: float = _APPROACH_M) -> tuple[LaneCount, ...]:
    """Return the lanes of the cross-sections within ``reach_m`` of ``s_m``, nearest first, each count once."""
    starts = [section.s_m for section in road.lane_sections]
    ends = [*starts[1:], road.length_m]
    near = []
    for section, start, end in zip(road.lane_sections, starts, ends, strict=True):
        distance = max(start - s_m, s_m - end, 0.0)
        if distance > reach_m:
            continue
        traffic = [lane for lane in section.lanes if lane.type.drivable and lane.type != LaneType.BIDIRECTIONAL]
        through = [lane for lane in traffic if not lane.turns or not _TURNS.issuperset(lane.turns)]
        centre = sum(lane.type == LaneType.BIDIRECTIONAL for lane in section.lanes)
        near.append((distance, start, _count(road, traffic, centre)))
        near.append((distance, start, _count(road, through, 0)))
    return tuple(dict.fromkeys(count for _, _, count in sorted(near, key=lambda item: item[:2])))


def _count(road: Road, lanes: list[Lane], centre: int) -> LaneCount:
    along = sum(road.direction(lane.id) > 0 for lane in lanes)
    return LaneCount(along, len(lanes) - along, centre)


def _opposite(network: RoadNetwork, road: Road, x_m: float, y_m: float, heading_rad: float) -> Road | None:
    """Return the nearest one-way road in the other direction on its side, unless that is clearly another street."""
    for match in network.nearest_lanes(x_m, y_m, _OTHER_CARRIAGEWAY_M):
        other = network.road_by_id[match.lane.road_id]
        if other.id == road.id or other.junction_id is not None or other.highway in SERVICE_HIGHWAYS:
            continue
        if not other.one_way or other.is_ramp != road.is_ramp:
            continue
        if road.names and other.names and not set(road.names) & set(other.names):
            continue
        pose = network.pose(match.lane, match.s_m)
        opposed = abs(wrap_angle(pose.heading_rad - heading_rad)) > _OPPOSED_RAD
        left_of = -(pose.x_m - x_m) * math.sin(heading_rad) + (pose.y_m - y_m) * math.cos(heading_rad)
        if opposed and (left_of > 0) != road.left_hand and (road.names or other.highway == road.highway):
            return other
    return None
