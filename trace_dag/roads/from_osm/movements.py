"""The movements that a junction permits, and their lanes; each becomes a connecting road.

A movement is permitted if a path along the junction's own ways leads from one arm to the other without going against a
one-way street or a turn restriction. Its lanes are those of ``turn:lanes`` if tagged. Otherwise they follow US custom:
left from the left lane, right from the right lane, straight on from every lane. Straight movements follow the OSM
geometry with all their lanes side by side; turns are curves between lane centres, each lane its own road, so that
distances along them are distances driven.
"""

from __future__ import annotations

import heapq
import math
from collections import defaultdict
from collections.abc import Sequence
from dataclasses import dataclass, replace
from itertools import takewhile
from typing import Final

from trace_dag.roads.from_osm.lanes import EndLane
from trace_dag.roads.from_osm.tags import LEFT_TURNS, RIGHT_TURNS, WayProfile, only_left
from trace_dag.roads.from_osm.turn_curves import TIGHTEST_RADIUS_M
from trace_dag.roads.from_osm.turn_restrictions import TurnRestrictions
from trace_dag.roads.map.curves import PlanPose, PlanView, Point
from trace_dag.roads.map.model import ContactPoint, LaneType, RoadLink

# Angles set by judgement; measured on the 82 extracts around fatal crashes of two cohorts (Virginia 2023, FARS 2012 to
# 2016), which have 11,742 movements.
_STRAIGHT_RAD: Final = math.radians(45)
"""The straightest movement of an arm is straight on up to here: 95 in 100 of those turn by less than 23 degrees, and of
all movements 90 lie within 5 degrees of the border."""
_DIVERGE_RAD: Final = math.radians(30)
"""Roads part rather than meet below this: 12 of 7,654 turns lie within 5 degrees of it."""
_U_TURN_RAD: Final = math.radians(155)
"""Half of the 152 turns beyond it go round by 178 degrees or more; 25 movements lie within 5 degrees of it."""
# Of several movements the straightest goes straight on. Judgement: a road of the same name may turn by 14 degrees more,
# a ramp has to turn by 11 degrees less, and a road of another class by 2 degrees less for each class between.
_SAME_NAME_RAD: Final = 0.25
_ONTO_RAMP_RAD: Final = 0.2
_PER_CLASS_RAD: Final = 0.03
_ARROW_REACH_RAD: Final = 1.1  # an arrow allows no movement that differs from it by more than 63 degrees. Judgement
# Angle that an arrow means if the junction has no turn of its name: 90 degrees, 135 for sharp ones, 35 for slight ones.
# Judgement.
_TURN_ANGLES: Final = {
    "reverse": math.pi,
    "sharp_left": math.radians(135),
    "left": math.radians(90),
    "slight_left": math.radians(35),
    "merge_to_left": 0.0,
    "through": 0.0,
    "merge_to_right": 0.0,
    "slight_right": math.radians(-35),
    "right": math.radians(-90),
    "sharp_right": math.radians(-135),
}


@dataclass(frozen=True)
class ArmLane:
    """A lane of an arm as a driver sees it; ``offset_m`` is that of its centre to the left of the arm's line."""

    id: int
    type: LaneType
    offset_m: float
    width_m: float
    turns: tuple[str, ...]


@dataclass(frozen=True)
class JunctionArm:
    """A road where it meets a junction. ``inbound`` is its reference line's pose there, heading into the junction.

    ``incoming`` and ``outgoing`` are its lanes, each from left to right as the driver sees them; ``rest`` is the
    piece of street cut off, from the pose to the node, and ``way_ids`` the OSM ways along it.
    """

    road_id: str
    contact: ContactPoint
    node: int
    profile: WayProfile  # in the direction into the junction
    inbound: PlanPose
    rest: PlanView
    incoming: tuple[ArmLane, ...]
    outgoing: tuple[ArmLane, ...]
    centre: ArmLane | None  # centre turn lane, seen inbound
    way_ids: tuple[int, ...] = ()

    @property
    def link(self) -> RoadLink:
        """Return the link to the road's end here."""
        return RoadLink("road", self.road_id, self.contact)

    @property
    def outbound(self) -> PlanPose:
        """Return the pose heading out of the junction."""
        return PlanPose(self.inbound.x_m, self.inbound.y_m, self.inbound.heading_rad + math.pi)


@dataclass(frozen=True)
class InnerWay:
    """A street inside a joined junction: its OSM ways, and the nodes at their ends, in order."""

    oneway: bool
    way_ids: tuple[int, ...]
    node_ids: tuple[int, ...]
    points: tuple[Point, ...]
    length_m: float


@dataclass(frozen=True)
class Movement:
    """A movement from one arm to another: its kind, its lanes, and the places and OSM ways on its path."""

    origin: JunctionArm
    target: JunctionArm
    angle_rad: float
    turn: str
    waypoints: tuple[Point, ...]
    inner_way_ids: tuple[int, ...] = ()
    lanes: tuple[tuple[ArmLane, ArmLane], ...] = ()
    circle_m: float = 0.0  # radius of the circle at a dead end round which it leads

    @property
    def way_ids(self) -> tuple[int, ...]:
        """Return the OSM ways along which it leads inside the junction."""
        return tuple(dict.fromkeys((*self.origin.way_ids, *self.inner_way_ids, *self.target.way_ids)))


def make_arm(
    road_id: str,
    contact: ContactPoint,
    node: int,
    profile: WayProfile,
    inbound: PlanPose,
    rest: PlanView,
    lanes: Sequence[EndLane],
    way_ids: tuple[int, ...] = (),
) -> JunctionArm:
    """Make an arm of the lanes at a road's end (left to right of its reference line).

    >>> from trace_dag.roads.from_osm.lanes import Stretch, build_sections
    >>> west = tee_arms[0]
    >>> lanes = build_sections([Stretch(west.profile, 0.0, 50.0)])[0].end  # one lane each way
    >>> arm = make_arm("1", ContactPoint.END, 1, west.profile, west.inbound, west.rest, lanes)
    >>> [lane.id for lane in arm.incoming], [lane.id for lane in arm.outgoing]
    ([-1], [1])
    """
    at_end = contact == ContactPoint.END

    def seen(lane: EndLane, along: bool) -> ArmLane:
        return ArmLane(lane.id, lane.type, lane.centre_m if along else -lane.centre_m, lane.width_m, lane.turns)

    right = [lane for lane in lanes if lane.id < 0 and lane.type == LaneType.DRIVING]
    left = [lane for lane in lanes if lane.id > 0 and lane.type == LaneType.DRIVING]
    middle = [lane for lane in lanes if lane.type == LaneType.BIDIRECTIONAL]
    along = tuple(seen(lane, True) for lane in right)
    against = tuple(seen(lane, False) for lane in reversed(left))
    return JunctionArm(
        road_id,
        contact,
        node,
        profile if at_end else profile.reversed(),
        inbound,
        rest,
        incoming=along if at_end else against,
        outgoing=against if at_end else along,
        centre=seen(middle[0], at_end) if middle else None,
        way_ids=way_ids,
    )


def find_movements(
    arms: Sequence[JunctionArm], inner: Sequence[InnerWay], restrictions: TurnRestrictions
) -> list[Movement]:
    """Return every permitted movement of one junction, with its lanes.

    >>> movements = find_movements(tee_arms, [], TurnRestrictions())  # arms from the west, the east and the south
    >>> [(each.origin.road_id, each.turn) for each in movements][:4]
    [('west', 'straight'), ('west', 'right'), ('east', 'left'), ('east', 'straight')]
    """
    steps: dict[int, list[tuple[InnerWay, bool]]] = defaultdict(list)
    for way in inner:
        steps[way.node_ids[0]].append((way, True))
        if not way.oneway:
            steps[way.node_ids[-1]].append((way, False))
    movements: list[Movement] = []
    for origin in arms:
        if not origin.incoming:
            continue
        found = [
            movement
            for target in arms
            if target is not origin
            and target.outgoing
            and (movement := _movement(origin, target, steps, restrictions)) is not None
        ]
        movements.extend(_assign_lanes(origin, _with_turns(found)))
    return _feed_idle_lanes(movements)


def _movement(
    origin: JunctionArm,
    target: JunctionArm,
    steps: dict[int, list[tuple[InnerWay, bool]]],
    restrictions: TurnRestrictions,
) -> Movement | None:
    """Return the shortest permitted path between two arms, or None."""
    count = 0
    queue: list[tuple[float, int, int, tuple[int, ...], tuple[int, ...], tuple[Point, ...]]] = []
    heapq.heappush(queue, (0.0, count, origin.node, (origin.profile.way_id,), (), ()))
    while queue:
        length, _, node, ways, nodes, points = heapq.heappop(queue)
        if node == target.node and restrictions.permits((*ways, target.profile.way_id), (*nodes, node)):
            angle = math.remainder(target.outbound.heading_rad - origin.inbound.heading_rad, math.tau)
            return Movement(origin, target, angle, "", points, ways[1:])
        if len(ways) > 12:
            continue
        for way, along in steps[node]:
            nodes_along = way.node_ids if along else way.node_ids[::-1]
            reached = nodes_along[-1]
            if reached in nodes or reached == origin.node:
                continue
            passed_ways = way.way_ids if along else way.way_ids[::-1]
            longer_ways, longer_nodes = (*ways, *passed_ways), (*nodes, *nodes_along[:-1])
            if not restrictions.permits(longer_ways, longer_nodes):
                continue
            passed = way.points if along else way.points[::-1]
            count += 1
            heapq.heappush(
                queue,
                (length + way.length_m, count, reached, longer_ways, longer_nodes, (*points, *passed[:-1])),
            )
    return None


def _with_turns(movements: Sequence[Movement]) -> list[Movement]:
    """Return movements of one arm from left to right, each named."""
    ordered = sorted(movements, key=lambda movement: -movement.angle_rad)
    straight = min(ordered, key=_straightness, default=None)
    named = []
    for movement in ordered:
        if movement is straight and abs(movement.angle_rad) <= _STRAIGHT_RAD:
            turn = "straight"
        elif abs(movement.angle_rad) >= _U_TURN_RAD:
            turn = "u_turn"
        else:
            turn = "left" if movement.angle_rad > 0 else "right"
        named.append(replace(movement, turn=turn))
    # A U-turn goes left in right-hand traffic, also if its angle is just over 180 degrees the other way.
    return sorted(named, key=lambda movement: -(math.pi if movement.turn == "u_turn" else movement.angle_rad))


def _straightness(movement: Movement) -> tuple[float, int]:
    """Return the sorting key, with the smallest turn first.

    A road of another class or name has to be clearly straighter than the same road.
    """
    same = movement.target.profile.names and movement.target.profile.names == movement.origin.profile.names
    change = abs(movement.target.profile.rank - movement.origin.profile.rank)
    link = movement.target.profile.is_link and not movement.origin.profile.is_link
    named_rad, ramp_rad = _SAME_NAME_RAD if same else 0.0, _ONTO_RAMP_RAD if link else 0.0
    return abs(movement.angle_rad) - named_rad + ramp_rad + _PER_CLASS_RAD * change, change


def _assign_lanes(origin: JunctionArm, movements: list[Movement]) -> list[Movement]:
    if not movements:
        return []
    lanes = origin.incoming
    chosen: list[list[ArmLane]] = [[] for _ in movements]
    straight = next((m for m in movements if m.turn == "straight"), None)
    painted = any(lane.turns for lane in lanes)
    if painted and straight is not None and _continues(origin, straight.target):
        painted = False
    if painted:
        for lane in lanes:
            for index in _painted_movements(lane, movements):
                chosen[index].append(lane)
    if not painted or not any(chosen):
        chosen = _customary(lanes, movements)
    elif len(lanes) == 1:  # there is no other lane to turn from
        movements = [m for m, c in zip(movements, chosen, strict=True) if c]
        chosen = [c for c in chosen if c]
    for index, movement in enumerate(movements):
        if not chosen[index]:  # permitted, though no lane is painted for it
            chosen[index] = [lanes[0] if movement.angle_rad > 0 else lanes[-1]]
    for lane in lanes:  # a lane without a movement goes straight on, or turns with the lanes beside it
        if not any(lane in lanes_of for lanes_of in chosen):
            nearest = straight if straight is not None else movements[0 if lane is lanes[0] else -1]
            chosen[movements.index(nearest)].append(lane)
    return [replace(m, lanes=_pair(m, sorted(c, key=lanes.index))) for m, c in zip(movements, chosen, strict=True)]


def _continues(origin: JunctionArm, target: JunctionArm) -> bool:
    """Return whether the same turn lanes continue beyond a minor junction, with at least one lane straight on."""
    turns = [lane.turns for lane in origin.incoming]
    return turns == [lane.turns for lane in target.outgoing] and any(not each or "through" in each for each in turns)


def _painted_movements(lane: ArmLane, movements: Sequence[Movement]) -> set[int]:
    """Return the movements that the arrows of a lane allow.

    An unmarked lane among marked ones goes straight on.
    """
    found: set[int] = set()
    for turn in lane.turns or ("through",):
        wanted = _TURN_ANGLES.get(turn)
        if wanted is None:
            continue
        if turn == "reverse":
            found.update(i for i, m in enumerate(movements) if m.turn == "u_turn")
            continue
        kind = "left" if turn in LEFT_TURNS else "right" if turn in RIGHT_TURNS else "straight"
        same_kind = [i for i, m in enumerate(movements) if m.turn == kind]
        if turn in ("left", "right") and same_kind:
            found.update(same_kind)
            continue
        candidates = same_kind or [
            i for i, m in enumerate(movements) if abs(math.remainder(m.angle_rad - wanted, math.tau)) < _ARROW_REACH_RAD
        ]
        if candidates:
            found.add(min(candidates, key=lambda i: abs(math.remainder(movements[i].angle_rad - wanted, math.tau))))
    return found


def _customary(lanes: Sequence[ArmLane], movements: Sequence[Movement]) -> list[list[ArmLane]]:
    """Return lanes of each movement without markings."""
    count = len(lanes)
    straight = next((i for i, m in enumerate(movements) if m.turn == "straight"), None)
    lefts = [i for i, m in enumerate(movements) if m.turn in ("left", "u_turn")]
    rights = [i for i, m in enumerate(movements) if m.turn == "right"]
    chosen: list[list[ArmLane]] = [[] for _ in movements]
    if straight is None:
        half = (count + 1) // 2
        for i in lefts:
            chosen[i] = list(lanes[:half] if rights and movements[i].turn != "u_turn" else lanes[:count])
        for i in rights:
            chosen[i] = list(lanes[count - max(count - half, 1) :] if lefts else lanes)
        for i in lefts + rights:
            wide = len(movements[i].target.outgoing)
            chosen[i] = chosen[i][:wide] if i in lefts else chosen[i][-wide:]
        return chosen
    through = list(lanes)
    surplus = count - len(movements[straight].target.outgoing)
    while surplus > 0 and (rights or lefts):
        if rights and (not lefts or surplus % 2):
            through.pop()
        else:
            through.pop(0)
        surplus -= 1
    chosen[straight] = through or [lanes[-1]]
    for i in lefts:
        chosen[i] = list(lanes[: _turning_lanes(movements[i], lanes, through, from_left=True)])
    for i in rights:
        chosen[i] = list(lanes[-_turning_lanes(movements[i], lanes, through, from_left=False) :])
    return chosen


def _turning_lanes(movement: Movement, lanes: Sequence[ArmLane], through: Sequence[ArmLane], *, from_left: bool) -> int:
    """Return the number of turning lanes, which cannot go straight on.

    If roads diverge, it is the number of the target's lanes.
    """
    spare = len(list(takewhile(lambda lane: lane not in through, lanes if from_left else reversed(lanes))))
    if abs(movement.angle_rad) < _DIVERGE_RAD:
        return max(1, spare, min(len(movement.target.outgoing), len(lanes)))
    return max(1, min(spare, len(movement.target.outgoing)))


def _pair(movement: Movement, lanes: Sequence[ArmLane]) -> tuple[tuple[ArmLane, ArmLane], ...]:
    """Pair lanes with the lanes of the target that they lead into."""
    targets = movement.target.outgoing
    count, wide = len(lanes), len(targets)
    if movement.turn == "straight":
        shift = 0
        if wide > count:
            pockets = len(list(takewhile(lambda lane: only_left(lane.turns), targets)))
            mine = sum(only_left(lane.turns) for lane in lanes)
            shift = min(max(pockets - mine, 0), wide - count)
        return tuple((lane, targets[min(k + shift, wide - 1)]) for k, lane in enumerate(lanes))
    if movement.turn == "right":
        return tuple((lane, targets[max(wide - count + k, 0)]) for k, lane in enumerate(lanes))
    if movement.turn == "u_turn":
        return tuple((lane, _lane_to_turn_into(movement, lane)) for lane in lanes)
    return tuple((lane, targets[min(k, wide - 1)]) for k, lane in enumerate(lanes))


def _lane_to_turn_into(movement: Movement, lane: ArmLane) -> ArmLane:
    """Return the innermost lane that is a car's turning circle away from the origin lane, or else the outermost."""
    inbound, outbound = movement.origin.inbound, movement.target.outbound
    sine, cosine = math.sin(inbound.heading_rad), math.cos(inbound.heading_rad)
    between_m = (outbound.y_m - inbound.y_m) * cosine - (outbound.x_m - inbound.x_m) * sine
    for target in movement.target.outgoing:
        if between_m - lane.offset_m - target.offset_m >= 2 * TIGHTEST_RADIUS_M:
            return target
    return movement.target.outgoing[-1]


def _feed_idle_lanes(movements: list[Movement]) -> list[Movement]:
    """Add movements to lanes that leave the junction but are not reached, from the nearest lane that goes there."""
    reached: dict[RoadLink, set[int]] = defaultdict(set)
    best: dict[RoadLink, int] = {}
    for index, movement in enumerate(movements):
        key = movement.target.link
        reached[key].update(lane.id for _, lane in movement.lanes)
        if key not in best or abs(movement.angle_rad) < abs(movements[best[key]].angle_rad):
            best[key] = index
    fed = list(movements)
    for key, index in best.items():
        movement = fed[index]
        idle = [lane for lane in movement.target.outgoing if lane.id not in reached[key]]
        if not idle:
            continue
        extra = tuple(
            (min(movement.lanes, key=lambda pair: abs(pair[1].offset_m - lane.offset_m))[0], lane) for lane in idle
        )
        fed[index] = replace(movement, lanes=movement.lanes + extra)
    return fed
