"""Pairs of paths along one road: from behind, side by side, oncoming."""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import replace
from typing import Final

from trace_dag.common.paths import shifted
from trace_dag.common.units import GRAVITY_MPS2
from trace_dag.crash.crash_types import Side
from trace_dag.reconstruction.motion.manoeuvres import (
    Option,
    follows_turn,
    keep_lane,
    lateral_shift,
    make_turn,
    move_sideways,
    steepest_slope,
)
from trace_dag.reconstruction.motion.path_pairs import (
    OPPOSITE_HEADING_RAD,
    SAME_HEADING_RAD,
    PathPair,
    along,
    apart,
    gap_between,
    measure_left_of,
    speed_of,
    turning_approaches,
    ways,
)
from trace_dag.reconstruction.motion.speed_prior import speed_profile
from trace_dag.reconstruction.motion.speeds import SpeedProfile, TravelSpeed
from trace_dag.reconstruction.pre_crash_scenarios import CROSS_MEDIAN, Party, PreCrashScenario
from trace_dag.reconstruction.scene.approaches import Approach
from trace_dag.reconstruction.scene.scene import Scene
from trace_dag.simulation.states import Manoeuvre, SpeedSource

MEDIAN_M = 12.0  # lanes farther apart than this have a median between them
FARTHEST_CARRIAGEWAY_M = 60.0
LEAST_GAP_M = 1.0
PASSING_OFFSET_M = 3.3  # beside the lane where no other lane is
_BEYOND_M: Final = 1.4  # a car's width, less what the two overlap
_OFF_CENTRE: Final = 0.2  # sine of the bearing of an area
_BESIDE_S, _PASSING_LATERAL_G, _LEAST_PASSING_MPS = 2.0, 0.15, 7.0  # how a vehicle moves out to pass
LEAST_CLOSING_MPS = 1.0
SLOWING_MPS2 = 2.0
CLOSING_MPS = 6.0  # least difference if one of two unreported speeds must have been higher


def same_lane(scene: Scene, scenario: PreCrashScenario) -> Iterator[PathPair]:
    """Yield pairs of a rear end: the mover runs into the other from behind."""
    mover, other = scenario.mover, scenario.other
    offsets = [0.0]
    if _off_centre(mover) or _off_centre(other):
        width = (mover.vehicle.width_m + other.vehicle.width_m) / 2
        offsets += [share * width for share in (0.4, -0.4, 0.85, -0.85)]
    for approach in _lanes_of_both(scene, scenario):
        ahead = speed_of(other, approach)
        behind = _faster(speed_of(mover, approach), ahead)
        slowed, terms = _slowed(mover, behind, other, ahead)
        followers = [keep_lane(approach, mover.vehicle, behind.speed_mps, offset_m=offset) for offset in offsets]
        if _both_turn(scenario):
            followers = ways(mover, approach, behind)
        for follower in followers:
            for leader in ways(other, approach, ahead, slides=not _both_turn(scenario)):
                yield PathPair(follower, leader, behind, ahead, True, terms, slowed)


def _both_turn(scenario: PreCrashScenario) -> bool:
    """Return whether both make the same turn, one behind or beside the other."""
    return scenario.mover.turn is not None and scenario.mover.turn is scenario.other.turn


def _lanes_of_both(scene: Scene, scenario: PreCrashScenario) -> list[Approach]:
    """Return the possible lanes of two vehicles on one road; those of a common turn, if the map has any."""
    turn = scenario.other.turn
    turning = turning_approaches(scene.approaches, turn) if turn is not None and _both_turn(scenario) else []
    return scene.on_road(turning) or scene.on_road(scene.through)


def _slowed(
    mover: Party, behind: TravelSpeed, other: Party, ahead: TravelSpeed
) -> tuple[SpeedProfile | None, dict[str, float]]:
    """Return the speed of a leader that is reported as no slower than its follower, after the least slowing needed."""
    follower, leader = (speed_profile(party, speed.speed_mps) for party, speed in ((mover, behind), (other, ahead)))
    if leader.impact_mps <= follower.impact_mps - LEAST_CLOSING_MPS:
        return None, {}
    impact = max(follower.impact_mps - LEAST_CLOSING_MPS, 0.0)
    change_s = max((leader.initial_mps - impact) / SLOWING_MPS2, 1.0)
    return SpeedProfile(leader.initial_mps, impact, change_s), {"slowing not reported": -1.0}


def same_direction(scene: Scene, scenario: PreCrashScenario) -> Iterator[PathPair]:
    """Yield adjacent paths: the mover changes to the other's path, or turns across it.

    >>> pairs = list(same_direction(scene, solution.candidate.scenario))  # were they side by side
    >>> {pair.other.manoeuvre.value for pair in pairs}  # the other keeps to its lane
    {'straight'}
    """
    mover = scenario.mover
    lanes = _lanes_of_both(scene, scenario)
    beside_them = lanes if _both_turn(scenario) else scene.through
    for target in lanes:
        for side in (Side.LEFT, Side.RIGHT):
            if scenario.mover_from not in (side, None):
                continue
            beside = [
                approach
                for approach in beside_them
                if apart(approach, target) <= SAME_HEADING_RAD and 2.0 <= measure_left_of(approach, target, side) <= 5.5
            ]
            sources = [(approach, 0.0, measure_left_of(approach, target, side)) for approach in beside]
            if not sources:
                away = PASSING_OFFSET_M if side is Side.LEFT else -PASSING_OFFSET_M
                moving_out = _moving_out(target, away, speed_of(mover, target).speed_mps)
                sources = [(target, away, PASSING_OFFSET_M), (moving_out, 0.0, PASSING_OFFSET_M)]
            for approach, from_offset, gap in sources:
                yield from _coming_over(scenario, approach, target, side, from_offset, gap)


def _moving_out(approach: Approach, away_m: float, speed_mps: float) -> Approach:
    """Return the approach of a vehicle that moved out to pass: first in its lane, beside it at the crash."""
    speed_mps = max(speed_mps, _LEAST_PASSING_MPS)
    lateral_mps2 = _PASSING_LATERAL_G * GRAVITY_MPS2
    shift = lateral_shift(away_m, speed_mps, steepest_slope(away_m, speed_mps, lateral_mps2), lateral_mps2)
    path = shifted(approach.path, shift, anchor_s_m=approach.station_m - _BESIDE_S * speed_mps)
    here = approach.path.pose(approach.station_m)
    station_m, _ = path.project(here.x_m, here.y_m, near_s_m=approach.station_m)
    return replace(approach, name=f"{approach.name} moving out", path=path, station_m=station_m, moves_out=True)


def _coming_over(
    scenario: PreCrashScenario, approach: Approach, target: Approach, side: Side, from_offset: float, gap: float
) -> Iterator[PathPair]:
    mover, other = scenario.mover, scenario.other
    mover_speed, other_speed = speed_of(mover, approach), speed_of(other, target)
    steady = along(other, target, other_speed)
    terms = {"no lane beside": -0.5} if from_offset or approach.moves_out else {}
    if mover.turn is not None:
        others = ways(other, target, other_speed) if _both_turn(scenario) else [steady]
        for option in make_turn(approach, mover.vehicle, mover_speed.speed_mps, mover.turn, slides=True):
            for beside in others:
                yield PathPair(option, beside, mover_speed, other_speed, True, terms)
        return
    towards = -gap if side is Side.LEFT else gap
    manoeuvre = Manoeuvre.LANE_CHANGE_RIGHT if side is Side.LEFT else Manoeuvre.LANE_CHANGE_LEFT
    for option in move_sideways(approach, mover_speed.speed_mps, towards, manoeuvre, from_offset_m=from_offset):
        yield PathPair(option, steady, mover_speed, other_speed, True, terms)


def opposite(scene: Scene, scenario: PreCrashScenario) -> Iterator[PathPair]:
    """Yield pairs of oncoming vehicles.

    The mover crosses the centre line or the median, drives the wrong way, or turns across.

    >>> pairs = list(opposite(scene, solution.candidate.scenario))
    >>> {(pair.mover.manoeuvre.value, pair.other.manoeuvre.value) for pair in pairs}  # vehicle 1 turns across the other
    {('turn_left', 'straight')}
    """
    mover, other = scenario.mover, scenario.other
    for target in scene.on_road(scene.through):
        other_speed = speed_of(other, target)
        facing = [approach for approach in scene.approaches if apart(approach, target) >= OPPOSITE_HEADING_RAD]
        for steady in ways(other, target, other_speed):
            crossing_over = facing
            if mover.turn is not None:
                crossing_over = [approach for approach in facing if follows_turn(approach, mover.turn)]
                yield from _turning_across(mover, steady, other_speed, facing)
            for approach in crossing_over:
                speed = speed_of(mover, approach)
                gap = gap_between(approach.fitted(speed.speed_mps), target.fitted(other_speed.speed_mps))
                across_m = -approach.kerb_sign * gap  # towards oncoming traffic
                if approach.turn is not None or not -PASSING_OFFSET_M <= across_m <= FARTHEST_CARRIAGEWAY_M:
                    continue
                if across_m < LEAST_GAP_M:  # at this speed the corner is cut so far that no line is left to cross
                    cutting = keep_lane(approach, mover.vehicle, speed.speed_mps, turn=mover.turn)
                    yield PathPair(cutting, steady, speed, other_speed, True)
                    continue
                terms = _median_terms(mover, across_m)
                beyond_m = -approach.kerb_sign * _BEYOND_M
                kerb_sides = all(_is_struck_beside(each, approach.kerb_sign) for each in (mover, other))
                for to_m in (gap, gap + beyond_m) if kerb_sides else (gap,):  # then it has crossed the other's way
                    for option in move_sideways(approach, speed.speed_mps, to_m, Manoeuvre.CROSS_CENTRELINE):
                        yield PathPair(option, steady, speed, other_speed, True, terms)
            if target.one_way and mover.turn is None:
                against = scene.finder.against(target)
                speed = speed_of(mover, against)
                terms = {"left its lane": -1.5} if mover.events else {}
                yield PathPair(along(mover, against, speed), steady, speed, other_speed, True, terms)


def _turning_across(
    mover: Party, steady: Option, other_speed: TravelSpeed, facing: list[Approach]
) -> Iterator[PathPair]:
    assert mover.turn is not None
    # To where lanes lead, and anywhere else off the road: into a driveway or a street that the map does not have.
    for approach in (*turning_approaches(facing, mover.turn), *(each for each in facing if each.turn is None)):
        if not -2.0 <= -approach.kerb_sign * gap_between(approach, steady.approach) <= FARTHEST_CARRIAGEWAY_M:
            continue
        speed = speed_of(mover, approach)
        for option in make_turn(approach, mover.vehicle, speed.speed_mps, mover.turn, slides=True):
            yield PathPair(option, steady, speed, other_speed, True)


def _median_terms(mover: Party, gap_m: float) -> dict[str, float]:
    if gap_m <= MEDIAN_M:
        return {}
    if CROSS_MEDIAN in mover.events:
        return {}
    return {"across the median": -2.5}


def _faster(behind: TravelSpeed, ahead: TravelSpeed) -> TravelSpeed:
    """Return the speed of a vehicle that struck one ahead; an unreported speed is raised above the other's."""
    if behind.source is SpeedSource.REPORTED or behind.speed_mps >= ahead.speed_mps + CLOSING_MPS:
        return behind
    return replace(behind, speed_mps=ahead.speed_mps + CLOSING_MPS)


def _is_struck_beside(party: Party, side: float) -> bool:
    """Return whether the vehicle was struck on a side: 1 for its left, -1 for its right."""
    impact = party.vehicle.impact
    return impact is not None and side * math.sin(impact.centre_rad) > _OFF_CENTRE


def _off_centre(party: Party) -> bool:
    """Return whether the vehicle was struck anywhere but in the middle of its front or rear."""
    impact = party.vehicle.impact
    return impact is not None and abs(math.sin(impact.centre_rad)) > _OFF_CENTRE
