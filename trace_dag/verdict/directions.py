"""Directions of the vehicles and their approach to each other: in the simulation, and as reported.

A direction is measured against the road: the heading of the vehicle's lane at the place of the crash, followed straight
through every junction. So a bend is not a turn, and a turn off a bend is one.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Final

import numpy as np

from trace_dag.common.geometry import FloatArray, Pose
from trace_dag.common.units import wrap_angle
from trace_dag.crash.classes import CollisionType, VehicleTrajectory
from trace_dag.crash.crash_types import EncounterRole, Relation, Turn, crash_type_of
from trace_dag.crash.record import CrashRecord, PreCrashMovement, VehicleRecord
from trace_dag.roads.map.model import LaneRef
from trace_dag.roads.map.network import RoadNetwork
from trace_dag.roads.map.paths import follow
from trace_dag.simulation.states import Trajectory
from trace_dag.simulation.types import VehicleLog

_ROUTE_AFTER_CONTACT_M = 20.0  # a turn begun before the contact is complete this far beyond it
_LANE_REACH_M = 4.0
_ALONG_LANE_RAD = math.radians(50)
_STRAIGHT_ON_RAD = math.radians(50)
_FORK_RAD = math.radians(30)
_CHAIN_MARGIN_M = 60.0
_MAX_LANES = 60
_PLACES_STEP_M = 3.0
_MOUTH_M = 15.0
_LEAST_TURN_DEG = 15.0  # what a junction offers at less than this is the way straight on
_STANDSTILL_MPS = 0.1

_MANNER_DEG: Final = {
    CollisionType.FRONT_TO_FRONT: frozenset({180.0}),
    CollisionType.FRONT_TO_REAR: frozenset({0.0}),
    CollisionType.SIDESWIPE_SAME_DIRECTION: frozenset({0.0}),
    CollisionType.SIDESWIPE_OPPOSITE_DIRECTION: frozenset({180.0}),
    CollisionType.ANGLE: frozenset({90.0, 180.0}),
}
"""Angles between the approaches by ``MAN_COLL``. Of 120 crashes whose ``ACC_TYPE`` says the relation, too, it is this
one in 119; an angle is of crossing paths in 39 and of one who turns or drifts across the other's in 19."""


# --- as reported -------------------------------------------------------------------------------------------------
STRAIGHT_MOVEMENTS = frozenset(
    {
        PreCrashMovement.GOING_STRAIGHT,
        PreCrashMovement.DECELERATING,
        PreCrashMovement.ACCELERATING,
        PreCrashMovement.STARTING,
        PreCrashMovement.STOPPED,
        PreCrashMovement.PASSING,
        PreCrashMovement.NEGOTIATING_CURVE,
        PreCrashMovement.CHANGING_LANES,
        PreCrashMovement.MERGING,
    }
)
TURNS_BY_MOVEMENT = {
    PreCrashMovement.TURNING_LEFT: 90.0,
    PreCrashMovement.TURNING_RIGHT: -90.0,
    PreCrashMovement.U_TURN: 180.0,
}
TURN_DEG = {Turn.LEFT: 90.0, Turn.RIGHT: -90.0, Turn.U_TURN: 180.0}
_RELATION_DEG = {
    Relation.SAME_LANE: 0.0,
    Relation.SAME_DIRECTION: 0.0,
    Relation.OPPOSITE_DIRECTION: 180.0,
    Relation.CROSSING: 90.0,
}


def reported_turns_deg(vehicle: VehicleRecord) -> frozenset[float]:
    """Return the turns (degrees to the left) that ``P_CRASH1`` and ``ACC_TYPE`` allow, which may disagree.

    Empty if neither is reported.

    >>> [reported_turns_deg(vehicle) for vehicle in record.vehicles]  # one turned left, the other went straight on
    [frozenset({90.0}), frozenset({0.0})]
    """
    turns = set()
    if vehicle.movement in TURNS_BY_MOVEMENT:
        turns.add(TURNS_BY_MOVEMENT[vehicle.movement])
    elif vehicle.movement in STRAIGHT_MOVEMENTS:
        turns.add(0.0)
    kind = crash_type_of(vehicle)
    open_who_turned = kind.trajectory is VehicleTrajectory.TURNING and kind.role is EncounterRole.UNDETERMINED
    if kind.turned_across is not None:
        turns.add(TURN_DEG[kind.turned_across])
    elif not turns and kind.relation is not None and not open_who_turned:
        turns.add(0.0)
    return frozenset(turns)


def reported_relations_deg(record: CrashRecord, one: VehicleRecord, two: VehicleRecord) -> frozenset[float]:
    """Return angles between the approaches of a pair that its crash types (``ACC_TYPE``) allow.

    Without them, they are those of the manner of collision (``MAN_COLL``), which is that of the first harmful event.

    >>> reported_relations_deg(record, *record.vehicles)  # ACC_TYPE 68 and 69: they came from opposite directions
    frozenset({180.0})
    """
    relations = {crash_type_of(vehicle).relation for vehicle in (one, two)} - {None}
    if relations:
        return frozenset(_RELATION_DEG[relation] for relation in relations if relation is not None)
    return _MANNER_DEG.get(record.collision_type, frozenset())


def turn_error_deg(
    measured_deg: float, allowed_deg: frozenset[float], offered_deg: frozenset[float] = frozenset()
) -> float | None:
    """Return the least angle between the measured turn and an allowed one, 0 to 180.

    None if the report allows anything.

    A turn to the left or right depends on the junction: at a Y, a skewed or a five-leg crossing, the turns to that side
    which the map offers (``offered_deg``) are allowed as well as the right angle.

    >>> turn_error_deg(-170.0, frozenset({180.0}))
    10.0
    >>> turn_error_deg(60.0, frozenset({90.0})), turn_error_deg(60.0, frozenset({90.0}), frozenset({60.0}))
    (30.0, 0.0)
    """
    allowed = set(allowed_deg)
    for side in allowed_deg & {90.0, -90.0}:
        allowed |= {
            turn for turn in offered_deg if turn * side > 0 and _LEAST_TURN_DEG < abs(turn) < 180 - _LEAST_TURN_DEG
        }
    return min((abs(math.remainder(measured_deg - turn, 360.0)) for turn in allowed), default=None)


def relation_error_deg(measured_deg: float, allowed_deg: frozenset[float]) -> float | None:
    """Return the least difference between an angle of approach (0 to 180) and an allowed one.

    None if nothing is reported.

    >>> relation_error_deg(75.0, frozenset({0.0, 90.0}))
    15.0
    """
    return min((abs(measured_deg - allowed) for allowed in allowed_deg), default=None)


# --- as simulated ------------------------------------------------------------------------------------------------
@dataclass(frozen=True)
class Direction:
    """``approach_rad``: direction of the vehicle's road at the place of the crash.

    ``turn_deg``: the turn of its route from that direction, positive to the left; ``offered_turns_deg``: the turns that
    its lane offered; ``road_id``: the last road on which it drove in that direction, or None.
    """

    approach_rad: float
    turn_deg: float
    offered_turns_deg: frozenset[float] = frozenset()
    road_id: str | None = None


def direction(
    network: RoadNetwork, driven: VehicleLog, contact: Pose, contact_s: float, trajectory: Trajectory
) -> Direction:
    """Return the direction of a vehicle from its motion up to the contact and the rest of its planned route.

    A vehicle may be hit in the middle of its turn. So the rest of the turn is the plan's heading some metres beyond the
    contact, relative to that at the contact.
    """
    approach, offered = _approach(network, driven, contact, contact_s)
    remaining = _heading_beyond(trajectory, contact_s) - float(
        np.interp(contact_s, trajectory.time_s, np.unwrap(trajectory.heading_rad))
    )
    turn = wrap_angle(contact.heading_rad - approach) + remaining
    road_id = _approach_road(network, driven, contact_s, approach)
    return Direction(approach, math.degrees(wrap_angle(turn)), offered, road_id)


def _approach_road(network: RoadNetwork, driven: VehicleLog, contact_s: float, approach_rad: float) -> str | None:
    """Return the last road, outside junctions, on which a vehicle was headed in its direction of approach."""
    before = max(int(np.searchsorted(driven.time_s, contact_s)), 1)
    for i in reversed(_places(driven, before)):
        at = driven.pose_at(i)
        found = _lane_at(network, at, at.heading_rad)
        if found is None or network.road_by_id[found[0].road_id].junction_id is not None:
            continue
        if abs(wrap_angle(at.heading_rad - approach_rad)) <= _ALONG_LANE_RAD:
            return found[0].road_id
    return None


def _heading_beyond(trajectory: Trajectory, contact_s: float) -> float:
    heading = np.unwrap(trajectory.heading_rad)
    after = trajectory.time_s >= contact_s
    if not after.any():
        return float(heading[-1])
    x, y = trajectory.x_m[after], trajectory.y_m[after]
    travelled = np.concatenate([[0.0], np.cumsum(np.hypot(np.diff(x), np.diff(y)))])
    return float(heading[after][min(int(np.searchsorted(travelled, _ROUTE_AFTER_CONTACT_M)), len(travelled) - 1)])


def _approach(
    network: RoadNetwork, driven: VehicleLog, contact: Pose, contact_s: float
) -> tuple[float, frozenset[float]]:
    """Return the heading of a vehicle's lane at the contact, followed straight through every junction.

    It also has the turns (degrees to the left) that the junctions on the way offer.

    The lane is the first one in which it drove, with or against its traffic, or the one before a junction. A vehicle
    that drove in none (it came from beside the road) keeps its initial heading. One that backs up is headed against its
    motion.
    """
    start = driven.pose_at(0)
    before = max(int(np.searchsorted(driven.time_s, contact_s)), 1)  # who is touched at once has its start alone
    backing = bool(driven.speed_mps[before - 1] < -_STANDSTILL_MPS)
    reach_m = math.hypot(contact.x_m - start.x_m, contact.y_m - start.y_m) + _CHAIN_MARGIN_M
    for i in _places(driven, before):
        at = driven.pose_at(i)
        course = wrap_angle(at.heading_rad + (math.pi if backing else 0.0))
        found = _lane_at(network, at, course)
        if found is not None:
            path = np.stack([driven.x_m[:before], driven.y_m[:before]], axis=-1)
            line, offered = _route(network, *_before_junction(network, *found), path, reach_m)
            nearest = int(np.hypot(line[:, 0] - contact.x_m, line[:, 1] - contact.y_m).argmin())
            return wrap_angle(float(line[nearest, 3]) + (math.pi if backing else 0.0)), offered
    return start.heading_rad, frozenset()


def _places(driven: VehicleLog, before: int) -> list[int]:
    """Return indices of the log up to the contact, some metres apart, for the search of the approach lane."""
    if before <= 1:
        return [0]
    travelled = np.cumsum(np.hypot(np.diff(driven.x_m[:before]), np.diff(driven.y_m[:before])))
    steps = np.searchsorted(travelled, np.arange(0.0, travelled[-1], _PLACES_STEP_M))
    return [int(i) for i in steps]


def _lane_at(network: RoadNetwork, at: Pose, course_rad: float) -> tuple[LaneRef, bool] | None:
    """Return the lane of a vehicle, and whether it drives with its traffic; against it only if nothing else fits."""
    best: tuple[float, LaneRef, bool] | None = None
    for match in network.nearest_lanes(at.x_m, at.y_m, _LANE_REACH_M, z_m=at.z_m):
        turned = abs(wrap_angle(network.pose(match.lane, match.s_m).heading_rad - course_rad))
        along = turned <= math.pi / 2
        off = min(turned, math.pi - turned)
        cost = off + match.outside_m * 0.1 + (0.0 if along else 0.2)
        if off <= _ALONG_LANE_RAD and (best is None or cost < best[0]):
            best = cost, match.lane, along
    return None if best is None else best[1:]


def _before_junction(network: RoadNetwork, lane: LaneRef, along: bool) -> tuple[LaneRef, bool]:
    """Return the lane itself, or the lane from which a vehicle in the middle of a junction entered it."""

    def entered_from(lanes: tuple[LaneRef, ...], behind: Sequence[LaneRef]) -> Sequence[LaneRef]:
        if network.road_by_id[lanes[-1].road_id].junction_id is None or not behind or len(lanes) > _MAX_LANES:
            return ()
        heading = float(_driven(network, lanes[-1], along)[0, 3])
        return [min(behind, key=lambda ref: abs(wrap_angle(float(_driven(network, ref, along)[-1, 3]) - heading)))]

    return follow(network, lane, entered_from, ahead=not along)[0][-1], along


def _route(
    network: RoadNetwork, lane: LaneRef, along: bool, path: FloatArray, length_m: float
) -> tuple[FloatArray, frozenset[float]]:
    """Return the lane's centre line and its straight continuation, shape (n, 4), and the turns beside it.

    Columns are those of the network's centre lines; turns are degrees to the left.

    At a fork the branch is that of ``path``, the driven one, shape (m, 2). In a junction and its mouth the direction is
    that of the road before it, because lanes flare and paths swerve there.
    """
    line = _driven(network, lane, along)
    ahead_m = _length(line[int(np.hypot(line[:, 0] - path[0, 0], line[:, 1] - path[0, 1]).argmin()) :])
    pieces = [line]
    offered: set[float] = set()

    def straight_on(lanes: tuple[LaneRef, ...], following: Sequence[LaneRef]) -> Sequence[LaneRef]:
        nonlocal ahead_m
        if not following or ahead_m >= length_m or len(lanes) > _MAX_LANES:
            return ()
        heading = float(pieces[-1][-1, 3])
        options = [(ref, _driven(network, ref, along)) for ref in following]
        offered.update(math.degrees(wrap_angle(float(option[-1, 3]) - heading)) for _, option in options)
        onward, line = _straight_on(options, heading, path)
        if network.road_by_id[onward.road_id].junction_id is not None:
            pieces[-1] = _without_mouth(pieces[-1])
            if abs(wrap_angle(float(line[-1, 3]) - heading)) > _STRAIGHT_ON_RAD:
                return ()  # the road ends at this junction
            line = line.copy()
            line[:, 3] = pieces[-1][-1, 3]
        pieces.append(line)
        ahead_m += _length(line)
        return [onward]

    follow(network, lane, straight_on, ahead=along)
    return np.concatenate(pieces), frozenset(offered)


def _straight_on(
    options: list[tuple[LaneRef, FloatArray]], heading_rad: float, path: FloatArray
) -> tuple[LaneRef, FloatArray]:
    """Return the straightest continuation; among several nearly straight ones (a fork), the driven one."""

    def turned(option: tuple[LaneRef, FloatArray]) -> float:
        return abs(wrap_angle(float(option[1][-1, 3]) - heading_rad))

    def beside_path(option: tuple[LaneRef, FloatArray]) -> float:
        x, y, _, _ = option[1][-1]
        return float(np.hypot(path[:, 0] - x, path[:, 1] - y).min())

    nearly_straight = [option for option in options if turned(option) < _FORK_RAD]
    return min(nearly_straight, key=beside_path) if len(nearly_straight) > 1 else min(options, key=turned)


def _without_mouth(line: FloatArray) -> FloatArray:
    """Return the line with the heading before its last metres kept over them."""
    travelled = np.concatenate([[0.0], np.cumsum(np.hypot(np.diff(line[:, 0]), np.diff(line[:, 1])))])
    mouth = travelled > travelled[-1] - _MOUTH_M
    straight = line.copy()
    straight[mouth, 3] = line[int(mouth.argmax()), 3]
    return straight


def _driven(network: RoadNetwork, lane: LaneRef, along: bool) -> FloatArray:
    line = network.centreline(lane)
    if along:
        return line
    line = line[::-1].copy()
    line[:, 3] += math.pi
    return line


def _length(line: FloatArray) -> float:
    return float(np.hypot(np.diff(line[:, 0]), np.diff(line[:, 1])).sum())
