"""Pairs of paths: the type that :mod:`pairs_along` and :mod:`pairs_crossing` make, and the functions they share."""

from __future__ import annotations

import math
from collections.abc import Iterable
from dataclasses import dataclass, field, replace

from trace_dag.common.units import wrap_angle
from trace_dag.crash.crash_types import Side, Turn
from trace_dag.reconstruction.motion.manoeuvres import Option, back_up, follows_turn, keep_lane, make_turn
from trace_dag.reconstruction.motion.speed_prior import likely_travel_speed
from trace_dag.reconstruction.motion.speeds import SpeedProfile, TravelSpeed
from trace_dag.reconstruction.pre_crash_scenarios import Party
from trace_dag.reconstruction.scene.approaches import Approach

SAME_HEADING_RAD = math.radians(25)
OPPOSITE_HEADING_RAD = math.radians(140)


@dataclass(frozen=True, eq=False)
class PathPair:
    """Two options, the mover's first, and their evidence as a pair. ``parallel``: see :class:`Candidate`."""

    mover: Option
    other: Option
    mover_speed: TravelSpeed
    other_speed: TravelSpeed
    parallel: bool
    terms: dict[str, float] = field(default_factory=dict)
    other_profile: SpeedProfile | None = None  # if it differs from the one the record alone gives


def ways(party: Party, approach: Approach, speed: TravelSpeed, *, slides: bool = False) -> list[Option]:
    """Return the options of a vehicle that keeps to its path: straight on, turning, or backing.

    ``slides``: at a cost, a turn may be moved to the place of the crash; otherwise it is where the lanes turn.

    >>> from trace_dag.reconstruction.pre_crash_scenarios import party
    >>> rider, street = party(record, record.vehicles[1]), scene.through[0]
    >>> [option.manoeuvre.value for option in ways(rider, street, speed_of(rider, street))]
    ['straight']
    """
    if party.backing:
        return [back_up(approach, speed.speed_mps)]
    if follows_turn(approach, party.turn):
        return [keep_lane(approach, party.vehicle, speed.speed_mps, turn=party.turn)]
    if party.turn is not None:
        return make_turn(approach, party.vehicle, speed.speed_mps, party.turn, slides=slides)
    return [along(party, approach, speed)]


def along(party: Party, approach: Approach, speed: TravelSpeed) -> Option:
    """Return the ways that keep to the lane.

    >>> from trace_dag.reconstruction.pre_crash_scenarios import party
    >>> rider, street = party(record, record.vehicles[1]), scene.through[0]
    >>> along(rider, street, speed_of(rider, street)).manoeuvre.value  # P_CRASH1 1: going straight
    'straight'
    """
    return keep_lane(approach, party.vehicle, speed.speed_mps)


def speed_of(party: Party, approach: Approach, *, crossing: bool = False) -> TravelSpeed:
    """Return the vehicle's travel speed on this approach, reported or inferred.

    >>> from trace_dag.reconstruction.pre_crash_scenarios import party
    >>> round(speed_of(party(record, record.vehicles[1]), scene.through[0]).speed_mps / 0.44704)  # 30 mph in the report
    30
    """
    return likely_travel_speed(party, approach.road, crossing=crossing)


def apart(one: Approach, two: Approach) -> float:
    """Return the angle between two directions of travel along one road (rad), at the crash or before a turn.

    >>> apart(scene.through[0], scene.through[0])
    0.0
    """
    headings = [approach.course_rad if approach.turn is None else approach.heading_rad for approach in (one, two)]
    return abs(wrap_angle(headings[0] - headings[1]))


def gap_between(one: Approach, two: Approach) -> float:
    """Return how far the path of ``two`` is left of ``one`` at the crash (metres).

    >>> abs(round(gap_between(scene.through[0], scene.through[0]), 6))
    0.0
    """
    pose = two.path.pose(two.station_m)
    return one.path.project(pose.x_m, pose.y_m)[1]


def measure_left_of(one: Approach, two: Approach, side: Side) -> float:
    """Return how far ``one`` is to the given side of ``two`` at the crash (metres).

    >>> one, two = (next(each for each in scene.through if each.name == name) for name in ("7:2>6:2", "7:1>6:1"))
    >>> round(measure_left_of(one, two, Side.RIGHT), 1)  # the next lane to the right
    3.5
    """
    gap = -gap_between(one, two)
    return gap if side is Side.LEFT else -gap


def turning_approaches(approaches: Iterable[Approach], turn: Turn) -> list[Approach]:
    """Return the approaches on which the turn is possible.

    These are the approaches whose lanes turn, and the shared middle lane beside them.

    >>> {approach.turn.value for approach in turning_approaches(scene.approaches, Turn.RIGHT)}
    {'right'}
    """
    approaches = tuple(approaches)
    by_lanes = [approach for approach in approaches if approach.turn is turn]
    centre = [approach for approach in approaches if approach.centre_lane and turn is approach.turn_across]
    return by_lanes + [_turning_from_centre(approach, by_lanes) for approach in centre]


def _turning_from_centre(centre: Approach, by_lanes: list[Approach]) -> Approach:
    """Return the shared middle lane with the exit of the turning lane beside it, if there is one."""
    beside = [approach for approach in by_lanes if apart(centre, approach) <= SAME_HEADING_RAD]
    if not beside:
        return centre
    lane = min(beside, key=lambda approach: (approach.lane_from_centre, approach.name))
    return replace(
        centre,
        name=f"{centre.name} as {lane.name}",
        turn=lane.turn,
        turn_from_m=centre.station_m,
        exit_pose=lane.exit_pose,
        exit_road=lane.exit_road,
    )
