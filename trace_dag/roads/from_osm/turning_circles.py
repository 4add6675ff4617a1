"""Turning circles and loops at dead ends: junctions with one road, through which cars turn round."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from typing import Final, NamedTuple

from trace_dag.osm.types import OsmExtract
from trace_dag.roads.from_osm.arm_cuts import LEAST_STREET_M, StreetEnd, end_profile
from trace_dag.roads.from_osm.junction_areas import Layout
from trace_dag.roads.from_osm.movements import JunctionArm, Movement
from trace_dag.roads.from_osm.street_graph import Street, StreetGraph
from trace_dag.roads.from_osm.tag_values import parse_length_m
from trace_dag.roads.from_osm.turn_curves import TIGHTEST_RADIUS_M
from trace_dag.roads.map.curves import PlanView
from trace_dag.roads.map.model import LaneType

_DIAMETER_M: Final = 24.0  # 80 ft, usual for cul-de-sacs (AASHTO Green Book 2018, 5.3.2.13)
_DIAMETERS_M: Final = (10.0, 60.0)
_STEP_M: Final = 0.5


class TurningCircle(NamedTuple):
    """A dead end at which cars turn around: its OSM node, and the radius of their circle, metres."""

    node_id: int
    radius_m: float


def diameter_m(tags: Mapping[str, str]) -> float:
    """Return the diameter of a turning circle: as tagged, or the usual one.

    >>> diameter_m({"diameter": "18"}), diameter_m({})
    (18.0, 24.0)
    """
    return min(max(parse_length_m(tags.get("diameter")) or _DIAMETER_M, _DIAMETERS_M[0]), _DIAMETERS_M[1])


def cut_turning_circles(
    extract: OsmExtract, graph: StreetGraph, plans: Sequence[PlanView], layout: Layout
) -> dict[StreetEnd, TurningCircle]:
    """Return the dead ends with a circle, and cut their streets in ``layout`` back to the beginning of the circle."""
    tagged = {
        graph.aliases.get(node.id, node.id): node
        for node in extract.nodes.values()
        if node.tags.get("highway") in ("turning_circle", "turning_loop")
    }
    found = {}
    for index, street in enumerate(graph.streets):
        for at_start in (True, False):
            node_id = street.node_ids[0 if at_start else -1]
            if node_id not in tagged or (street.start_node if at_start else street.end_node) is not None:
                continue
            trims = layout.trims[index]
            room_m = plans[index].length_m - trims[1 if at_start else 0] - LEAST_STREET_M
            radius_m, cut_m = _fitting(street, at_start, diameter_m(tagged[node_id].tags), room_m)
            if radius_m >= TIGHTEST_RADIUS_M:
                layout.trims[index] = (cut_m, trims[1]) if at_start else (trims[0], cut_m)
                found[StreetEnd(index, at_start)] = TurningCircle(tagged[node_id].id, radius_m)
    return found


def _fitting(street: Street, at_start: bool, widest_m: float, room_m: float) -> tuple[float, float]:
    """Return the radius of the widest fitting circle, 0 if none fits, and the distance of the turn before it.

    Cars swing out to the right, go around, and swing back, on arcs of the one radius r. With lanes a to the right and
    left of the middle, the centres of the arcs are r + a aside and 2 r apart.
    """
    section = end_profile(street, at_start).section
    lanes = [[lane for lane in side if lane.type is LaneType.DRIVING] for side in (section.forward, section.backward)]
    if any(len(side) != 1 for side in lanes):
        return 0.0, 0.0
    width_m = max(side[0].width_m for side in lanes)
    aside_m = (lanes[0][0].width_m + lanes[1][0].width_m) / 4 + (section.centre.width_m / 2 if section.centre else 0.0)
    radius_m = (widest_m - width_m) / 2
    while radius_m >= TIGHTEST_RADIUS_M:
        cut_m = math.sqrt(max((2 * radius_m) ** 2 - (radius_m + aside_m) ** 2, 0.0))
        if cut_m <= room_m:
            return radius_m, cut_m
        radius_m -= _STEP_M
    return 0.0, 0.0


def turning_movement(arm: JunctionArm, circle: TurningCircle) -> Movement:
    """Return the movement round a circle, from the arm back into it."""
    lanes = ((arm.incoming[-1], arm.outgoing[-1]),)
    return Movement(arm, arm, math.pi, "u_turn", (), lanes=lanes, circle_m=circle.radius_m)
