"""The curves of a junction: connecting roads for its movements.

Lanes that go straight on side by side share one connecting road whose reference line continues the OSM geometry;
every other lane gets a connecting road of its own whose reference line is the lane's centre.
"""

from __future__ import annotations

import math
from collections import Counter
from collections.abc import Callable, Sequence
from dataclasses import replace
from itertools import pairwise
from typing import Final, NamedTuple

from trace_dag.roads.from_osm.lanes import UNMARKED
from trace_dag.roads.from_osm.movements import ArmLane, Movement
from trace_dag.roads.from_osm.polyline_fit import fit_plan
from trace_dag.roads.from_osm.turn_curves import (
    CORNER_RADIUS_M,
    TIGHTEST_RADIUS_M,
    drivable_turn,
    tightest_radius_m,
    turn_of_radius,
)
from trace_dag.roads.map.curves import (
    PlanView,
    Point,
    connect,
    cut_plan,
    direction_rad,
    drop_slivers,
    join_plans,
    plan_pose,
    reverse_plan,
)
from trace_dag.roads.map.model import (
    Connection,
    ContactPoint,
    Cubic,
    Lane,
    LaneSection,
    LaneType,
    Road,
    RoadLink,
)

_STRAIGHT_RADIUS_M: Final = 25.0
_MOST_CURVED: Final = 0.19  # lane offset over radius
_STRAIGHT_PATH_RAD: Final = 1.2
_SHORTEST_M: Final = 0.05  # below it two arms touch and there is nothing to connect
_HALF_CAR_M: Final = 0.95
_OVERRUN_M: Final = 0.3  # how far a car that turns round may leave the ground between the ends of the roads
_STEP_M: Final = 0.5
_SHIFT_RADIUS_M: Final = 3.7


class _Link(NamedTuple):
    """Lanes next to each other that share a connecting road, left to right.

    ``offsets_m``: distance of the leftmost lane's left border to the left of the reference line, at start and end.
    """

    movement: Movement
    lanes: tuple[tuple[ArmLane, ArmLane], ...]
    plan: PlanView
    offsets_m: tuple[float, float]
    kind: LaneType = LaneType.DRIVING


def build_connections(
    movements: Sequence[Movement], junction_id: str, new_road_id: Callable[[], str]
) -> tuple[list[Road], list[Connection]]:
    """Return the connecting roads and connections of one junction.

    >>> from itertools import count
    >>> from trace_dag.roads.from_osm.movements import TurnRestrictions, find_movements
    >>> ids = count(7)
    >>> movements = find_movements(tee_arms, [], TurnRestrictions())  # from the west, the east and the south
    >>> roads, connections = build_connections(movements, "6", lambda: str(next(ids)))
    >>> [(each.incoming_road, each.connecting_road) for each in connections][:3]
    [('west', '7'), ('west', '8'), ('east', '9')]
    """
    roads: list[Road] = []
    connections: list[Connection] = []
    for link in _possible([link for link in _links(movements) if link.plan.length_m >= _SHORTEST_M]):
        road_id = new_road_id()
        roads.append(_road(link, road_id, junction_id))
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
            links.extend(link for pair in movement.lanes if (link := _lane_link(movement, pair)) is not None)
            continue
        run: list[tuple[ArmLane, ArmLane]] = []
        for pair in movement.lanes:
            if run and not (_adjacent(run[-1][0], pair[0]) and _adjacent(run[-1][1], pair[1])):
                links += _side_by_side(movement, run, plan)
                run = []
            run.append(pair)
        links += _side_by_side(movement, run, plan)
        origin, target = movement.origin, movement.target
        if origin.centre and target.centre and origin.road_id <= target.road_id:
            middle = (origin.centre, replace(target.centre, offset_m=-target.centre.offset_m))
            links.append(_street_link(movement, [middle], plan, LaneType.BIDIRECTIONAL))
    return links


def _side_by_side(movement: Movement, run: Sequence[tuple[ArmLane, ArmLane]], plan: PlanView) -> list[_Link]:
    """Return lanes as one connecting road, or each as its own if they shift sideways faster than a car can steer."""
    shift_m = abs(run[0][1].offset_m - run[0][0].offset_m)
    if 6 * shift_m * _SHIFT_RADIUS_M > plan.length_m**2:  # the curvature at the ends of a cubic from level to level
        return [link for pair in run if (link := _lane_link(movement, pair)) is not None]
    return [_street_link(movement, run, plan)]


def _street_link(
    movement: Movement, lanes: Sequence[tuple[ArmLane, ArmLane]], plan: PlanView, kind: LaneType = LaneType.DRIVING
) -> _Link:
    """Return lanes that follow the streets' own geometry through the junction."""
    first_in, first_out = lanes[0]
    offsets_m = first_in.offset_m + first_in.width_m / 2, first_out.offset_m + first_out.width_m / 2
    return _Link(movement, tuple(lanes), plan, offsets_m, kind)


def _lane_link(movement: Movement, pair: tuple[ArmLane, ArmLane]) -> _Link | None:
    """Return a lane as a road of its own; None if no sensible curve connects its ends."""
    lane_in, lane_out = pair
    start = movement.origin.inbound.beside(lane_in.offset_m)
    end = movement.target.outbound.beside(lane_out.offset_m)
    circle_m = movement.circle_m
    plan = turn_of_radius(start, end, circle_m) if circle_m else connect(start, end)
    if plan is None:
        return None
    if tightest_radius_m(plan) < TIGHTEST_RADIUS_M:
        plan = max(plan, drivable_turn(start, end) or plan, key=tightest_radius_m)
    return _Link(movement, (pair,), plan, (lane_in.width_m / 2, lane_out.width_m / 2))


def _possible(links: list[_Link]) -> list[_Link]:
    """Return the drivable links; others only as U-turns of lanes with no other way on or in.

    A car cannot drive U-turns that leave the junction's ground (to turn around a narrow median it has to swing out
    first), nor corners that are too tight even after swinging out.
    """
    links = [link for link in links if tightest_radius_m(link.plan) >= CORNER_RADIUS_M * 0.999]
    undrivable = [link for link in links if link.movement.turn == "u_turn" and not _fits(link, links)]
    if not undrivable:
        return links
    ways: Counter[tuple[RoadLink, int]] = Counter(end for link in links for end in _lane_ends(link))
    impossible = []
    for link in undrivable:
        if all(ways[end] > 1 for end in _lane_ends(link)):
            ways.subtract(_lane_ends(link))
            impossible.append(link)
    return [link for link in links if not any(link is other for other in impossible)]


def _lane_ends(link: _Link) -> list[tuple[RoadLink, int]]:
    movement = link.movement
    return [
        *((movement.origin.link, lane.id) for lane, _ in link.lanes),
        *((movement.target.link, lane.id) for _, lane in link.lanes),
    ]


def _fits(link: _Link, links: Sequence[_Link]) -> bool:
    """Return whether a car on a link stays between the ends of the junction's roads."""
    import shapely

    if tightest_radius_m(link.plan) < TIGHTEST_RADIUS_M * 0.999:
        return False
    arms = {arm.link: arm for each in links for arm in (each.movement.origin, each.movement.target)}
    corners = [
        (corner.x_m, corner.y_m)
        for arm in arms.values()
        for sign, lanes in ((1, arm.incoming), (-1, arm.outgoing))
        for lane in lanes
        for side in (1, -1)
        for corner in (arm.inbound.beside(sign * lane.offset_m + side * lane.width_m / 2),)
    ]
    ground = shapely.MultiPoint(corners).convex_hull.buffer(_OVERRUN_M)
    count = math.ceil(link.plan.length_m / _STEP_M) + 1
    path = [plan_pose(link.plan, link.plan.length_m * i / (count - 1))[:2] for i in range(count)]
    return bool(ground.covers(shapely.LineString(path).buffer(_HALF_CAR_M, cap_style="flat")))


def _is_sharp(movement: Movement, plan: PlanView) -> bool:
    """Return whether a straight movement bends too tightly for a car, or makes some lanes a fifth longer."""
    outermost = max(max(abs(a.offset_m), abs(b.offset_m)) for a, b in movement.lanes)
    return tightest_radius_m(plan) < max(outermost / _MOST_CURVED, TIGHTEST_RADIUS_M + outermost)


def _adjacent(left: ArmLane, right: ArmLane) -> bool:
    return abs(left.offset_m - left.width_m / 2 - right.offset_m - right.width_m / 2) < 1e-6


def _along_streets(movement: Movement) -> PlanView | None:
    """Return the geometry of the streets through the junction; None if it turns back on itself."""
    head, first = _split_last_line(movement.origin.rest)
    tail, last = _split_last_line(movement.target.rest)
    begin, end = (plan_pose(arm.rest, arm.rest.length_m)[:2] for arm in (movement.origin, movement.target))
    middle = _drop_repeats([first, begin, *movement.waypoints[1:], end, last])
    if len(middle) < 2:
        return None
    directions = [direction_rad(*pair) for pair in pairwise(middle)]
    if any(abs(math.remainder(b - a, math.tau)) > _STRAIGHT_PATH_RAD for a, b in pairwise(directions)):
        return None
    plan = fit_plan(middle, _STRAIGHT_RADIUS_M, keep_ends=True)
    return join_plans([p for p in (head, plan, reverse_plan(tail)) if p.elements])


def _split_last_line(rest: PlanView) -> tuple[PlanView, Point]:
    """Return a plan without its last line, and the beginning of that line."""
    last = rest.elements[-1]
    return cut_plan(rest, 0.0, last.s_m), (last.x_m, last.y_m)


def _drop_repeats(points: Sequence[Point]) -> list[Point]:
    kept = [points[0]]
    for point in points[1:]:
        if math.dist(kept[-1], point) > 1e-3:
            kept.append(point)
    return kept


def _road(link: _Link, road_id: str, junction_id: str) -> Road:
    movement = link.movement
    plan = drop_slivers(link.plan)
    length = plan.length_m
    origin, target = movement.origin, movement.target
    limits = (origin.profile.speed_forward_mps, target.profile.speed_backward_mps)
    lanes: list[Lane] = [Lane(0, LaneType.NONE, (), mark=UNMARKED)]
    for index, (lane_in, lane_out) in enumerate(link.lanes):
        lanes.append(
            Lane(
                id=-index - 1,
                type=link.kind,
                widths=(_ease(lane_in.width_m, lane_out.width_m, length),),
                predecessor=lane_in.id,
                successor=lane_out.id,
                mark=UNMARKED,
            )
        )
    return Road(
        id=road_id,
        length_m=length,
        plan=plan.elements,
        lane_sections=(LaneSection(0.0, tuple(lanes)),),
        lane_offset=(_ease(*link.offsets_m, length),),
        junction_id=junction_id,
        predecessor=origin.link,
        successor=target.link,
        highway=origin.profile.highway,
        osm_way_ids=() if origin.profile.inferred or target.profile.inferred else movement.way_ids,
        name=origin.profile.name if movement.turn == "straight" else "",
        speed_mps=min(filter(None, limits), default=None),
        # Where a junction reaches onto a bridge, what it crosses there is below it.
        layer=max(origin.profile.layer, target.profile.layer, key=abs),
        bridge=origin.profile.bridge and target.profile.bridge,
        tunnel=origin.profile.tunnel and target.profile.tunnel,
        turn=movement.turn,
        inferred=origin.profile.inferred or target.profile.inferred,
    )


def _ease(start: float, end: float, length: float) -> Cubic:
    return Cubic(0.0, start) if abs(end - start) < 1e-9 else Cubic.between(0.0, start, end, length)
