"""Sidewalks and cycle lanes through junctions, on roads of their own.

A sidewalk continues around each corner that has one on both sides, and past a street that joins on the other side. A
cycle lane continues with the traffic beside it, straight on and to the right. Each is a road of the junction with one
lane, whose middle is the reference line. The roads of the traffic do not change.
"""

from __future__ import annotations

import math
from collections import defaultdict
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import replace
from typing import Final, NamedTuple

import numpy as np

from trace_dag.common.geometry import hermite
from trace_dag.roads.from_osm.carriageways import Carriageways
from trace_dag.roads.from_osm.lanes import NOT_CROSSED
from trace_dag.roads.from_osm.turn_curves import tightest_radius_m, turn_of_radius
from trace_dag.roads.map.cubic_profile import CubicProfile
from trace_dag.roads.map.curves import PlanPose, PlanView, connect, drop_slivers, element_pose, plan_pose
from trace_dag.roads.map.model import (
    Connection,
    ContactPoint,
    Cubic,
    Junction,
    Lane,
    LaneSection,
    LaneType,
    Road,
    RoadLink,
)
from trace_dag.roads.map.network import RoadNetwork

_LEAST_WIDTH_M: Final = 0.5  # a lane that has closed before the junction does not go on
_LEAST_M: Final = 0.1
_INNER_EDGE_M: Final = 0.3  # least radius of the inner edge: tighter ones fold, or are no arc to readers that sample
_FARTHEST_M: Final = 60.0  # farthest distance of a corner's ends: as large as the largest junctions
_STEP_M: Final = 1.0


class _Beside(NamedTuple):
    """A sidewalk or cycle lane at the end of its road, ``left_m`` left of the reference line seen into the junction."""

    lane_id: int
    left_m: float
    width_m: float


class _Arm(NamedTuple):
    """The end of a road at a junction, seen into it: its pose, height and slope, and the lanes beside it."""

    road: Road
    contact: ContactPoint
    pose: PlanPose
    height_m: float
    grade: float
    beside: Mapping[tuple[LaneType, int], _Beside]  # by side, +1 for the left

    @property
    def link(self) -> RoadLink:
        """Return the link to the end of the road."""
        return RoadLink("road", self.road.id, self.contact)


class _Path(NamedTuple):
    """A path through a junction, from a lane of one arm to one of another."""

    kind: LaneType
    origin: _Arm
    origin_lane: _Beside
    target: _Arm
    target_lane: _Beside
    plan: PlanView


def add_lanes_through_junctions(
    network: RoadNetwork, carriageways: Carriageways, new_road_id: Callable[[], str]
) -> RoadNetwork:
    """Return the network with a road for every sidewalk and cycle lane that continues through a junction.

    >>> led_on = add_lanes_through_junctions(network, Carriageways(network.roads), lambda: "")
    >>> len(led_on.roads) - len(network.roads)  # at no junction here do two streets with sidewalks meet
    0
    """
    arms = _arms(network.roads)
    followed: dict[str, dict[tuple[RoadLink, RoadLink], str]] = defaultdict(dict)
    for road in network.roads:
        if road.junction_id in arms and road.turn in ("straight", "right") and road.predecessor and road.successor:
            followed[road.junction_id][road.predecessor, road.successor] = road.turn
    found: dict[str, list[_Path]] = {}
    for junction in network.junctions:
        at_junction = arms.get(junction.id, [])
        paths = [*_round_corners(at_junction), *_with_traffic(at_junction, followed[junction.id])]
        if paths:
            found[junction.id] = paths
    clear = _clear_of_traffic(found, carriageways)
    roads: list[Road] = []
    junctions = []
    for junction in network.junctions:
        made = [_road(path, new_road_id(), junction.id) for path in clear.get(junction.id, ())]
        junctions.append(_with_connections(junction, made) if made else junction)
        roads += made
    return replace(network, roads=(*network.roads, *roads), junctions=tuple(junctions))


def _arms(roads: Sequence[Road]) -> dict[str, list[_Arm]]:
    """Return the ends that have a sidewalk or cycle lane, by junction."""
    arms: dict[str, list[_Arm]] = defaultdict(list)
    for road in roads:
        for contact, _, junction_id in road.ends_at_junctions:
            if beside := _beside(road, contact):
                arms[junction_id].append(_arm(road, contact, beside))
    return arms


def _beside(road: Road, contact: ContactPoint) -> dict[tuple[LaneType, int], _Beside]:
    at_start = contact is ContactPoint.START
    section = road.lane_sections[0 if at_start else -1]
    if not any(lane.type in (LaneType.SIDEWALK, LaneType.BIKING) for lane in section.lanes):
        return {}
    s_m = 0.0 if at_start else road.length_m
    seen = -1 if at_start else 1  # into the junction, left and right change places at the start
    found: dict[tuple[LaneType, int], _Beside] = {}
    for side in (1, -1):
        out_m = 0.0
        for lane in sorted((lane for lane in section.lanes if lane.id * side > 0), key=lambda lane: abs(lane.id)):
            width_m = CubicProfile.of(lane.widths, origin_m=section.s_m).at(s_m)
            if lane.type in (LaneType.SIDEWALK, LaneType.BIKING) and width_m >= _LEAST_WIDTH_M:
                left_m = CubicProfile.of(road.lane_offset).at(s_m) + side * (out_m + width_m / 2)
                found[lane.type, side * seen] = _Beside(lane.id, left_m * seen, width_m)
            out_m += width_m
    return found


def _arm(road: Road, contact: ContactPoint, beside: Mapping[tuple[LaneType, int], _Beside]) -> _Arm:
    elevation = CubicProfile.of(road.elevation)
    if contact is ContactPoint.START:
        x, y, heading = element_pose(road.plan[0], 0.0)
        pose = PlanPose(x, y, heading + math.pi)
        return _Arm(road, contact, pose, elevation.at(0.0), -elevation.slope(0.0), beside)
    pose = element_pose(road.plan[-1], road.plan[-1].length_m)
    return _Arm(road, contact, pose, elevation.at(road.length_m), elevation.slope(road.length_m), beside)


# --- which lead where ------------------------------------------------------------------------------------------------
def _round_corners(arms: Sequence[_Arm]) -> Iterator[_Path]:
    """Yield sidewalks: from the right side of each arm to the left side of the next arm counter-clockwise."""
    if len(arms) < 2:
        return
    middle_x, middle_y = np.mean([arm.pose[:2] for arm in arms], axis=0).tolist()
    around = sorted(arms, key=lambda arm: math.atan2(arm.pose.y_m - middle_y, arm.pose.x_m - middle_x))
    for arm, following in zip(around, (*around[1:], around[0]), strict=True):
        path = _path(LaneType.SIDEWALK, arm, -1, following)
        if path is not None:
            yield path


def _with_traffic(arms: Sequence[_Arm], followed: Mapping[tuple[RoadLink, RoadLink], str]) -> Iterator[_Path]:
    """Yield the cycle lanes along traffic that goes straight or right from one arm to another."""
    for origin in arms:
        for target in arms:
            turn = followed.get((origin.link, target.link))
            if turn is None:
                continue
            # On the left, only of one-way streets: that of others is the right one of the traffic the other way.
            one_way = turn == "straight" and (target.link, origin.link) not in followed
            for side in (-1, 1) if one_way else (-1,):
                path = _path(LaneType.BIKING, origin, side, target)
                if path is not None:
                    yield path


def _path(kind: LaneType, origin: _Arm, side: int, target: _Arm) -> _Path | None:
    """Return the path from one side of an arm to the same side of another, seen leaving the junction."""
    lane, onward = origin.beside.get((kind, side)), target.beside.get((kind, -side))
    if lane is None or onward is None or origin is target:
        return None
    start, end = origin.pose.beside(lane.left_m), target.pose.beside(onward.left_m)
    if not _LEAST_M < math.hypot(end.x_m - start.x_m, end.y_m - start.y_m) < _FARTHEST_M:
        return None
    to = PlanPose(end.x_m, end.y_m, end.heading_rad + math.pi)
    plan = connect(start, to)
    least_m = max(lane.width_m, onward.width_m) / 2 + _INNER_EDGE_M
    if plan is not None and tightest_radius_m(plan) < least_m:
        plan = turn_of_radius(start, to, least_m)
    return None if plan is None else _Path(kind, origin, lane, target, onward, plan)


def _clear_of_traffic(paths: Mapping[str, Sequence[_Path]], carriageways: Carriageways) -> dict[str, list[_Path]]:
    """Return the paths, without sidewalks on ground where vehicles drive.

    Cycle lanes may cross turning traffic.
    """
    flat = [(junction_id, path) for junction_id, some in paths.items() for path in some]
    points: list[tuple[float, float]] = []
    owner: list[int] = []
    for number, (_, path) in enumerate(flat):
        if path.kind is LaneType.SIDEWALK:
            count = math.ceil(path.plan.length_m / _STEP_M) + 1
            at = [plan_pose(path.plan, path.plan.length_m * k / (count - 1)) for k in range(count)]
            points += [(pose.x_m, pose.y_m) for pose in at]
            owner += [number] * count
    blocked = set()
    if points:
        level = [path.origin.road.level for _, path in flat]
        for point, road in carriageways.at(np.array(points)):
            if road.level == level[owner[point]]:
                blocked.add(owner[point])
    clear: dict[str, list[_Path]] = defaultdict(list)
    for number, (junction_id, path) in enumerate(flat):
        if number not in blocked:
            clear[junction_id].append(path)
    return clear


# --- their roads -----------------------------------------------------------------------------------------------------
def _road(path: _Path, road_id: str, junction_id: str) -> Road:
    plan = drop_slivers(path.plan)
    length_m = plan.length_m
    origin, target = path.origin, path.target
    rise = hermite(length_m, origin.height_m, target.height_m, origin.grade, -target.grade)
    half = hermite(length_m, path.origin_lane.width_m / 2, path.target_lane.width_m / 2, 0.0, 0.0)
    on_left = path.origin_lane is origin.beside.get((path.kind, 1))
    side = 1 if path.kind is LaneType.BIKING and on_left else -1
    lane = Lane(
        id=side,
        type=path.kind,
        widths=(Cubic(0.0, *(2 * value for value in half)),),
        predecessor=path.origin_lane.lane_id,
        successor=path.target_lane.lane_id,
        mark=NOT_CROSSED,
    )
    centre = Lane(0, LaneType.NONE, (), mark=NOT_CROSSED)
    return Road(
        id=road_id,
        length_m=length_m,
        plan=plan.elements,
        lane_sections=(LaneSection(0.0, tuple(sorted((centre, lane), key=lambda each: -each.id))),),
        elevation=(Cubic(0.0, *rise),) if any(rise) else (),
        lane_offset=(Cubic(0.0, *(-side * value for value in half)),),
        junction_id=junction_id,
        predecessor=origin.link,
        successor=target.link,
        highway=origin.road.highway,
        layer=max(origin.road.layer, target.road.layer, key=abs),
        bridge=origin.road.bridge and target.road.bridge,
        tunnel=origin.road.tunnel and target.road.tunnel,
    )


def _with_connections(junction: Junction, roads: Sequence[Road]) -> Junction:
    connections = list(junction.connections)
    for road in roads:
        assert road.predecessor is not None
        (lane,) = (lane for lane in road.lane_sections[0].lanes if lane.id)
        assert lane.predecessor is not None
        connections.append(
            Connection(
                id=str(len(connections)),
                incoming_road=road.predecessor.element_id,
                connecting_road=road.id,
                contact_point=ContactPoint.START,
                lane_links=((lane.predecessor, lane.id),),
            )
        )
    return replace(junction, connections=tuple(connections))
