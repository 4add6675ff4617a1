"""Pairs of paths, and those from two sides: crossing, turning into another's path, out of driveways, backing.

Pairs along one road are in :mod:`trace_dag.reconstruction.motion.path_pairs_along`.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Iterator
from dataclasses import dataclass, field, replace

from trace_dag.common.units import wrap_angle
from trace_dag.crash.crash_types import Side, Turn
from trace_dag.reconstruction.motion.manoeuvres import Option, back_up, follows_turn, keep_lane, make_turn
from trace_dag.reconstruction.motion.speed_prior import likely_travel_speed
from trace_dag.reconstruction.motion.speeds import SpeedProfile, TravelSpeed
from trace_dag.reconstruction.pre_crash_scenarios import Party, PreCrashScenario
from trace_dag.reconstruction.scene.approaches import Approach
from trace_dag.reconstruction.scene.scene import Scene

SAME_HEADING_RAD = math.radians(25)
OPPOSITE_HEADING_RAD = math.radians(140)
CROSSING_RAD = (math.radians(15), math.radians(165))
CROSSING_SIGMA_RAD = math.radians(40)


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
    """Return the distance (m) of the path of ``two`` to the left of ``one`` at the crash.

    >>> abs(round(gap_between(scene.through[0], scene.through[0]), 6))
    0.0
    """
    pose = two.path.pose(two.station_m)
    return one.path.project(pose.x_m, pose.y_m)[1]


def measure_left_of(one: Approach, two: Approach, side: Side) -> float:
    """Return the distance (m) of ``one`` to the given side of ``two`` at the crash.

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


# --- crossing and backing --------------------------------------------------------------------------------------------
def crossing(scene: Scene, scenario: PreCrashScenario) -> Iterator[PathPair]:
    """Yield pairs of paths that cross: straight across, or turning into the other's path.

    >>> from trace_dag.reconstruction.pre_crash_scenarios import pre_crash_scenarios, party
    >>> one, two = (party(record, vehicle) for vehicle in record.vehicles)
    >>> pairs = list(crossing(scene, pre_crash_scenarios(record, one, two)[0]))
    >>> {pair.parallel for pair in pairs}  # the paths cross
    {False}
    """
    mover, other = scenario.mover, scenario.other
    others = _usable(scene, other.turn)
    for approach in _usable(scene, mover.turn):
        for target in others:
            angle = wrap_angle(approach.heading_rad - target.heading_rad)
            if not CROSSING_RAD[0] <= abs(angle) <= CROSSING_RAD[1]:
                continue
            # Heading to the left of the other's means coming from its right.
            side = Side.RIGHT if angle > 0 else Side.LEFT
            if scenario.mover_from not in (side, None):
                continue
            askew = (abs(angle) - math.pi / 2) / CROSSING_SIGMA_RAD
            terms = {"angle of the crossing": -0.5 * askew**2}
            mover_speed, other_speed = speed_of(mover, approach, crossing=True), speed_of(other, target, crossing=True)
            for option in ways(mover, approach, mover_speed):
                for steady in ways(other, target, other_speed):
                    yield PathPair(option, steady, mover_speed, other_speed, False, terms)


def _usable(scene: Scene, turn: Turn | None) -> list[Approach]:
    through = [each for each in scene.through if abs(each.offset_m) <= 2 * scene.on_road_m]
    return through if turn is None else turning_approaches(scene.approaches, turn) or through


def backing(scene: Scene, scenario: PreCrashScenario) -> Iterator[PathPair]:
    """Yield pairs with a backing vehicle: into the one behind, or out of a driveway or side road into traffic.

    >>> pairs = list(backing(scene, solution.candidate.scenario))  # had the first backed up
    >>> {pair.mover.manoeuvre.value for pair in pairs}
    {'backing'}
    """
    mover, other = scenario.mover, scenario.other
    roads = scene.on_road(scene.through)[:6]
    if not roads:
        return
    backward = _backward(scene, roads)
    speed = speed_of(mover, roads[0])
    if other.backing:
        others = [(back_up(approach, speed_of(other, approach).speed_mps), terms) for approach, terms in backward]
    else:
        others = [(option, {}) for approach in roads for option in ways(other, approach, speed_of(other, approach))]
    for approach, terms in backward:
        option = back_up(approach, speed.speed_mps)
        for steady, more in others:
            apart = abs(wrap_angle(approach.heading_rad - steady.approach.heading_rad))
            if apart < SAME_HEADING_RAD:
                continue
            other_speed = speed_of(other, steady.approach)
            along_road = apart >= OPPOSITE_HEADING_RAD and bool(approach.lanes)
            yield PathPair(option, steady, speed, other_speed, along_road, {**more, **terms})


def _backward(scene: Scene, roads: list[Approach]) -> list[tuple[Approach, dict[str, float]]]:
    """Return the lines along which a vehicle can back, each with its evidence."""
    found: list[tuple[Approach, dict[str, float]]] = []
    for approach in roads:
        if approach.extended:  # a side road that ends here: out of it, the body facing into it
            found.append((replace(approach, extended=False), {}))
        else:
            back = replace(scene.finder.against(approach), wrong_way=False)
            out_of_driveway = back.road is not None and back.road.highway == "service"
            found.append((back, {} if out_of_driveway else {"backing along a through road": -0.7}))
    return found
