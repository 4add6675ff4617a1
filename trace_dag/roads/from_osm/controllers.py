"""Groups of traffic lights that change together: OpenDRIVE's controllers and their junctions.

A controller gives all its signals the same state (ASAM OpenDRIVE 1.7.0, 14.6). The lights of opposing approaches to a
junction have one controller, those of the crossing street another: the two-phase plan of the US Signal Timing Manual
(FHWA-HOP-08-024, 4.1). The simulator chooses the times.
"""

from __future__ import annotations

import math
from collections import defaultdict
from dataclasses import dataclass, replace
from itertools import count
from typing import TYPE_CHECKING, Final

from trace_dag.roads.map.curves import element_pose
from trace_dag.roads.map.model import ContactPoint, Controller

if TYPE_CHECKING:
    from collections.abc import Iterable, Iterator

    from trace_dag.roads.map.model import Road, Signal
    from trace_dag.roads.map.network import RoadNetwork

_FROM_JUNCTION_M: Final = 60.0  # a light farther from a junction stands by itself (a pedestrian crossing)
_OPPOSITE_RAD: Final = math.radians(40)


@dataclass(frozen=True)
class _Approach:
    """A light, with the direction (radians) and street of its traffic at the junction."""

    signal_id: str
    heading_rad: float
    street: str


def add_controllers(network: RoadNetwork) -> RoadNetwork:
    """Return the network with a controller for each group of lights, named by their junctions.

    >>> sorted({controller.name for controller in add_controllers(network).controllers})
    ['Cedar Street', 'Elder Street', 'Main Street']
    """
    approaches: dict[str, list[_Approach]] = defaultdict(list)
    alone: dict[int | str, list[str]] = defaultdict(list)  # by OSM node: both sides of a pedestrian crossing
    for road in network.roads:
        for signal in road.signals:
            if not signal.dynamic:
                continue
            junction_id, approach = _approach(network, road, signal)
            if junction_id is None:
                alone[signal.osm_node_id or signal.id].append(signal.id)
            else:
                approaches[junction_id].append(approach)
    ids = count()
    controllers: list[Controller] = []
    junctions = []
    for junction in network.junctions:
        own = tuple(
            Controller(str(next(ids)), tuple(each.signal_id for each in group), group[0].street, sequence)
            for sequence, group in enumerate(_phases(approaches.get(junction.id, ())))
        )
        controllers += own
        junctions.append(replace(junction, controller_ids=tuple(each.id for each in own)) if own else junction)
    controllers += (Controller(str(next(ids)), tuple(signal_ids)) for signal_ids in alone.values())
    return replace(network, junctions=tuple(junctions), controllers=tuple(controllers))


def _approach(network: RoadNetwork, road: Road, signal: Signal) -> tuple[str | None, _Approach]:
    """Return the next junction of the traffic at a light, if it is near, and the approach to it."""
    street = road.name
    forward = signal.orientation == "+"
    left_m = road.length_m - signal.s_m if forward else signal.s_m
    while True:
        link = road.successor if forward else road.predecessor
        end = road.plan[-1] if forward else road.plan[0]
        heading = element_pose(end, end.length_m).heading_rad if forward else end.heading_rad + math.pi
        approach = _Approach(signal.id, heading, street)
        if link is None or left_m > _FROM_JUNCTION_M:
            return None, approach
        if link.element_type == "junction":
            return link.element_id, approach
        road, forward = network.road_by_id[link.element_id], link.contact_point is ContactPoint.START
        left_m += road.length_m


def _phases(approaches: Iterable[_Approach]) -> Iterator[list[_Approach]]:
    """Yield groups of approaches that are opposite, or of one street and direction; the others one by one."""
    waiting = list(approaches)
    while waiting:
        first = waiting[0]
        phase = [first, *(other for other in waiting[1:] if _together(first, other))]
        yield phase
        waiting = [other for other in waiting if other not in phase]


def _together(first: _Approach, other: _Approach) -> bool:
    apart = abs(math.remainder(other.heading_rad - first.heading_rad, math.tau))
    return apart > math.pi - _OPPOSITE_RAD or (apart < _OPPOSITE_RAD and other.street == first.street)
