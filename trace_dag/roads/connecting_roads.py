"""The curves of a junction: connecting roads for its movements.

Lanes that go straight on side by side share one connecting road whose reference line continues the OSM geometry;
every other lane gets a connecting road of its own whose reference line is the lane's centre.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from itertools import pairwise
from typing import Final, NamedTuple

from trace_dag.roads.junctions import ArmLane, Movement
from trace_dag.roads.network import (
    Connection,
    ContactPoint,
    Cubic,
    Lane,
    LaneSection,
    LaneType,
    Road,
    RoadLink,
    RoadMark,
)
from trace_dag.roads.plan_fit import Plan, PlanPose, connect, cut_plan, join_plans, plan_pose, reverse_plan
from trace_dag.roads.polyline_fit import fit_plan

_NO_MARK: Final = RoadMark("none", "standard", "both")
_STRAIGHT_RADIUS_M: Final = 25.0
_MOST_CURVED: Final = 0.19  # lane offset over radius
_STRAIGHT_PATH_RAD: Final = 1.2
_SHORTEST_M: Final = 0.05  # below it two arms touch and there is nothing to connect


class _Link(NamedTuple):
    """Lanes next to each other that share a connecting road, left to right.

    ``plan`` is the streets' own geometry through the junction where the lanes follow it.
    """

    movement: Movement
    lanes: tuple[tuple[ArmLane, ArmLane], ...]
    plan: Plan | None = None
    kind: LaneType = LaneType.DRIVING


def build_connections(
    movements: Sequence[Movement], junction_id: str, new_road_id: Callable[[], str]
) -> tuple[list[Road], list[Connection]]:
    """Connecting roads and connections of one junction."""
    roads: list[Road] = []
    connections: list[Connection] = []
    for link in _links(movements):
        geometry = _geometry(link)
        if geometry is None or geometry[0].length_m < _SHORTEST_M:
            continue
        plan, offsets = geometry
        road_id = new_road_id()
        roads.append(_road(link, plan, offsets, road_id, junction_id))
        connections.append(
            Connection(
                id=str(len(connections)),
                incoming_road=link.movement.origin.road_id,
                connecting_road=road_id,
                contact_point=ContactPoint.START,
                lane_links=tuple((lane.id, -index - 1) for index, (lane, _) in enumerate(link.lanes)),
            )
        )
    return roads, connections


def _links(movements: Sequence[Movement]) -> list[_Link]:
    links: list[_Link] = []
    for movement in movements:
        plan = _along_streets(movement) if movement.turn == "straight" else None
        if plan is None or _is_sharp(movement, plan):
            links.extend(_Link(movement, (pair,)) for pair in movement.lanes)
            continue
        run: list[tuple[ArmLane, ArmLane]] = []
        for pair in movement.lanes:
            if run and not (_adjacent(run[-1][0], pair[0]) and _adjacent(run[-1][1], pair[1])):
                links.append(_Link(movement, tuple(run), plan))
                run = []
            run.append(pair)
        links.append(_Link(movement, tuple(run), plan))
        origin, target = movement.origin, movement.target
        if origin.centre and target.centre and origin.road_id <= target.road_id:
            middle = (origin.centre, _seen_outbound(target.centre))
            links.append(_Link(movement, (middle,), plan, LaneType.BIDIRECTIONAL))
    return links


def _is_sharp(movement: Movement, plan: Plan) -> bool:
    """Whether going straight on bends so much that lanes side by side would differ in length by a fifth."""
    outermost = max(max(abs(a.offset_m), abs(b.offset_m)) for a, b in movement.lanes)
    return max(abs(element.curvature_1pm) for element in plan.elements) * outermost > _MOST_CURVED


def _adjacent(left: ArmLane, right: ArmLane) -> bool:
    return abs(left.offset_m - left.width_m / 2 - right.offset_m - right.width_m / 2) < 1e-6


def _seen_outbound(lane: ArmLane) -> ArmLane:
    return ArmLane(lane.id, lane.type, -lane.offset_m, lane.width_m, lane.turns)


def _shifted(pose: PlanPose, left_m: float) -> PlanPose:
    return PlanPose(
        pose.x_m - left_m * math.sin(pose.heading_rad),
        pose.y_m + left_m * math.cos(pose.heading_rad),
        pose.heading_rad,
    )


def _geometry(link: _Link) -> tuple[Plan, tuple[float, float]] | None:
    """Reference line, and where the left border of the leftmost lane lies left of it at its start and end.

    None where no sensible curve leads from one lane to the other.
    """
    movement = link.movement
    (first_in, first_out) = link.lanes[0]
    if link.plan is not None:
        return link.plan, (first_in.offset_m + first_in.width_m / 2, first_out.offset_m + first_out.width_m / 2)
    start = _shifted(movement.origin.inbound, first_in.offset_m)
    end = _shifted(movement.target.outbound, first_out.offset_m)
    plan = connect(start, end)
    return None if plan is None else (plan, (first_in.width_m / 2, first_out.width_m / 2))


def _along_streets(movement: Movement) -> Plan | None:
    """The streets' own geometry through the junction, or None where it bends back on itself."""
    head, first = _split_last_line(movement.origin.rest)
    tail, last = _split_last_line(movement.target.rest)
    points = [first, *_distinct(movement, first, last), last]
    middle = _drop_repeats(points)
    if len(middle) < 2:
        return None
    directions = [math.atan2(b[1] - a[1], b[0] - a[0]) for a, b in pairwise(middle)]
    if any(abs(math.remainder(b - a, math.tau)) > _STRAIGHT_PATH_RAD for a, b in pairwise(directions)):
        return None
    plan = fit_plan(middle, _STRAIGHT_RADIUS_M, keep_ends=True)
    return join_plans([p for p in (head, plan, reverse_plan(tail)) if p.elements])


def _split_last_line(rest: Plan) -> tuple[Plan, tuple[float, float]]:
    """A plan without its last line, and where that line begins."""
    last = rest.elements[-1]
    return cut_plan(rest, 0.0, last.s_m), (last.x_m, last.y_m)


def _distinct(movement: Movement, first: tuple[float, float], last: tuple[float, float]) -> list[tuple[float, float]]:
    start = plan_pose(movement.origin.rest, movement.origin.rest.length_m)
    end = plan_pose(movement.target.rest, movement.target.rest.length_m)
    return [(start.x_m, start.y_m), *movement.waypoints[1:], (end.x_m, end.y_m)]


def _drop_repeats(points: Sequence[tuple[float, float]]) -> list[tuple[float, float]]:
    kept = [points[0]]
    for point in points[1:]:
        if math.hypot(point[0] - kept[-1][0], point[1] - kept[-1][1]) > 1e-3:
            kept.append(point)
    return kept


def _road(link: _Link, plan: Plan, offsets: tuple[float, float], road_id: str, junction_id: str) -> Road:
    movement = link.movement
    length = plan.length_m
    origin, target = movement.origin, movement.target
    lanes: list[Lane] = [Lane(0, LaneType.NONE, (), mark=_NO_MARK)]
    for index, (lane_in, lane_out) in enumerate(link.lanes):
        lanes.append(
            Lane(
                id=-index - 1,
                type=link.kind,
                widths=(_ease(lane_in.width_m, lane_out.width_m, length),),
                predecessor=lane_in.id,
                successor=lane_out.id,
                mark=_NO_MARK,
            )
        )
    return Road(
        id=road_id,
        length_m=length,
        plan=plan.elements,
        lane_sections=(LaneSection(0.0, tuple(lanes)),),
        lane_offset=(_ease(*offsets, length),),
        junction_id=junction_id,
        predecessor=RoadLink("road", origin.road_id, origin.contact),
        successor=RoadLink("road", target.road_id, target.contact),
        highway=origin.profile.highway,
        name=origin.profile.name if movement.turn == "straight" else "",
        speed_mps=_lower(origin.profile.speed_forward_mps, target.profile.speed_backward_mps),
        # Where a junction reaches onto a bridge, what it crosses there is below it.
        layer=max(origin.profile.layer, target.profile.layer, key=abs),
        bridge=origin.profile.bridge and target.profile.bridge,
        tunnel=origin.profile.tunnel and target.profile.tunnel,
        turn=movement.turn,
    )


def _lower(a: float | None, b: float | None) -> float | None:
    return min((speed for speed in (a, b) if speed is not None), default=None)


def _ease(start: float, end: float, length: float) -> Cubic:
    change = end - start
    if abs(change) < 1e-9:
        return Cubic(0.0, start)
    return Cubic(0.0, start, 0.0, 3 * change / length**2, -2 * change / length**3)
