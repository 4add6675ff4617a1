"""The roads and streets around the reported point, with their distances and whether they have a reported name."""

from __future__ import annotations

import math
from dataclasses import dataclass, field
from typing import Final

from trace_dag.crash.record import CrashRecord
from trace_dag.roads.crash_site.street_names import SAME_STREET, similarity
from trace_dag.roads.map.model import LaneMatch, Road
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
    links = (connecting.predecessor, connecting.successor)
    return tuple(
        network.road_by_id[link.element_id] for link in links if link is not None and link.element_type == "road"
    )


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
    likeness = [value for each in reported if (value := similarity(each, names)) is not None]
    return NearStreet(
        name=road.name,
        highway=road.highway,
        distance_m=round(near.distance_m, 2),
        nearest_xy_m=(round(pose.x_m, 2), round(pose.y_m, 2)),
        bears_reported_name=max(likeness) >= SAME_STREET if likeness else None,
    )
