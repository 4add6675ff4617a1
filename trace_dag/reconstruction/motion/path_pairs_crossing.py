"""Pairs of paths from two sides: crossing, turning into another's path, out of driveways, backing."""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import replace

from trace_dag.common.units import wrap_angle
from trace_dag.crash.crash_types import Side, Turn
from trace_dag.reconstruction.motion.manoeuvres import back_up
from trace_dag.reconstruction.motion.path_pairs import (
    OPPOSITE_HEADING_RAD,
    SAME_HEADING_RAD,
    PathPair,
    speed_of,
    turning_approaches,
    ways,
)
from trace_dag.reconstruction.pre_crash_scenarios import PreCrashScenario
from trace_dag.reconstruction.scene.approaches import Approach
from trace_dag.reconstruction.scene.scene import Scene

CROSSING_RAD = (math.radians(15), math.radians(165))
CROSSING_SIGMA_RAD = math.radians(40)


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
