"""Pairs of paths from two sides: crossing, turning into each other's path, out of driveways, backing."""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import replace

from trace_dag.crash.crash_types import Side, Turn
from trace_dag.states.encounters import Encounter
from trace_dag.states.manoeuvres import back_up
from trace_dag.states.pairs import (
    OPPOSITE_HEADING_RAD,
    SAME_HEADING_RAD,
    Pair,
    speed_of,
    turning_streams,
    ways,
)
from trace_dag.states.scene import ON_ROAD_M, Scene
from trace_dag.states.streams import Stream
from trace_dag.units import wrap_angle

CROSSING_RAD = (math.radians(15), math.radians(165))
CROSSING_SIGMA_RAD = math.radians(40)


def crossing(scene: Scene, encounter: Encounter) -> Iterator[Pair]:
    """From the side: straight across or turning into the other's path.

    >>> from trace_dag.states.encounters import encounters, party
    >>> one, two = (party(record, vehicle) for vehicle in record.vehicles)
    >>> pairs = list(crossing(scene, encounters(record, one, two)[0]))
    >>> {pair.parallel for pair in pairs}  # the paths cross
    {False}
    """
    mover, other = encounter.mover, encounter.other
    others = _usable(scene.streams, other.turn)
    for stream in _usable(scene.streams, mover.turn):
        for target in others:
            angle = wrap_angle(stream.heading_rad - target.heading_rad)
            if not CROSSING_RAD[0] <= abs(angle) <= CROSSING_RAD[1]:
                continue
            # Heading to the left of the other's means coming from its right.
            side = Side.RIGHT if angle > 0 else Side.LEFT
            if encounter.mover_from not in (side, None):
                continue
            askew = (abs(angle) - math.pi / 2) / CROSSING_SIGMA_RAD
            terms = {"angle of the crossing": -0.5 * askew**2}
            mover_speed, other_speed = speed_of(mover, stream, crossing=True), speed_of(other, target, crossing=True)
            for option in ways(mover, stream, mover_speed):
                for steady in ways(other, target, other_speed):
                    yield Pair(option, steady, mover_speed, other_speed, False, terms)


def _usable(streams: tuple[Stream, ...], turn: Turn | None) -> list[Stream]:
    through = [stream for stream in streams if stream.turn is None and abs(stream.offset_m) <= 2 * ON_ROAD_M]
    return through if turn is None else turning_streams(streams, turn) or through


def backing(scene: Scene, encounter: Encounter) -> Iterator[Pair]:
    """Backward along the road into the one behind, or out of a driveway or side road into its traffic.

    >>> pairs = list(backing(scene, solution.candidate.encounter))  # had the first backed up
    >>> {pair.mover.manoeuvre.value for pair in pairs}
    {'backing'}
    """
    mover, other = encounter.mover, encounter.other
    roads = scene.on_road(scene.through)[:6]
    if not roads:
        return
    backward = _backward(scene, roads)
    speed = speed_of(mover, roads[0])
    if other.backing:
        others = [(back_up(stream, speed_of(other, stream).speed_mps), terms) for stream, terms in backward]
    else:
        others = [(option, {}) for stream in roads for option in ways(other, stream, speed_of(other, stream))]
    for stream, terms in backward:
        option = back_up(stream, speed.speed_mps)
        for steady, more in others:
            apart = abs(wrap_angle(stream.heading_rad - steady.stream.heading_rad))
            if apart < SAME_HEADING_RAD:
                continue
            other_speed = speed_of(other, steady.stream)
            along_road = apart >= OPPOSITE_HEADING_RAD and bool(stream.lanes)
            yield Pair(option, steady, speed, other_speed, along_road, {**more, **terms})


def _backward(scene: Scene, roads: list[Stream]) -> list[tuple[Stream, dict[str, float]]]:
    """The lines along which a vehicle can back, with the evidence for or against each."""
    found: list[tuple[Stream, dict[str, float]]] = []
    for stream in roads:
        if stream.extended:  # a side road that ends here: out of it, the body facing into it
            found.append((replace(stream, extended=False), {}))
        else:
            back = replace(scene.finder.against(stream), wrong_way=False)
            out_of_driveway = back.road is not None and back.road.highway == "service"
            found.append((back, {} if out_of_driveway else {"backing along a through road": -0.7}))
    return found
