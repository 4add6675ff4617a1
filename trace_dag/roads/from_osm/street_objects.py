"""Objects on streets: islands of crossings and of traffic calming, railway tracks, and the round ends of dead ends.

Turning circles and loops at dead ends are junctions with one road, through which cars turn round.
"""

from __future__ import annotations

import math
from collections import defaultdict
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import replace
from itertools import count
from typing import Final, NamedTuple

from trace_dag.osm.types import OsmExtract
from trace_dag.roads.from_osm.arm_cuts import LEAST_STREET_M, StreetEnd, end_profile
from trace_dag.roads.from_osm.junction_areas import Layout
from trace_dag.roads.from_osm.movements import JunctionArm, Movement
from trace_dag.roads.from_osm.street_graph import Street, StreetGraph
from trace_dag.roads.from_osm.street_roads import BuiltStreets, edges_of_carriageway
from trace_dag.roads.from_osm.tag_values import parse_length_m
from trace_dag.roads.from_osm.turn_curves import TIGHTEST_RADIUS_M
from trace_dag.roads.map.curves import PlanView
from trace_dag.roads.map.model import LaneType, Road, RoadObject

_ISLAND_M: Final = (6.1, 1.8)  # 20 ft by 6 ft, the least for people to wait on (MUTCD 2009, 3I.06)
_KERB_M: Final = 0.15
_TRACK_M: Final = 2.6  # a tie of a railway in the US: 8 ft 6 in
_CORNERS: Final = 24
_DIAMETER_M: Final = 24.0  # 80 ft, usual for cul-de-sacs (AASHTO Green Book 2018, 5.3.2.13)
_DIAMETERS_M: Final = (10.0, 60.0)
_STEP_M: Final = 0.5


def add_objects(
    roads: Sequence[Road], extract: OsmExtract, graph: StreetGraph, built: BuiltStreets
) -> tuple[Road, ...]:
    """Return ``roads``, finished, with the objects at nodes of their streets.

    >>> sum(len(road.objects) for road in add_objects(bare_roads, extract, street_graph, street_roads))
    0
    """
    by_id = {road.id: road for road in roads}
    made: dict[str, list[RoadObject]] = defaultdict(list)
    ids = count(sum(len(road.crosswalks) for road in roads))  # after those of the crosswalks
    tagged = graph.nodes_by_place(node for node in extract.nodes.values() if node.tags)
    for made_of in built.values():
        for node_id, s_m in zip(made_of.street.node_ids, made_of.plan.vertex_s_m, strict=True):
            if node_id not in tagged:
                continue
            bare, begin_m = made_of.road_at(s_m)
            road, at_m = by_id[bare.id], s_m - begin_m
            place_m = min(max(at_m, 0.0), road.length_m)  # a road that a junction cuts back ends before its node
            for kind, name, outline, height_m in _things(tagged[node_id].tags, road, place_m):
                moved = tuple((u + at_m - place_m, v) for u, v in outline)
                made[road.id].append(
                    RoadObject(str(next(ids)), kind, name, place_m, moved, height_m, tagged[node_id].id)
                )
    return tuple(replace(road, objects=tuple(made[road.id])) if road.id in made else road for road in roads)


_Outline = list[tuple[float, float]]


def _things(tags: Mapping[str, str], road: Road, s_m: float) -> Iterator[tuple[str, str, _Outline, float]]:
    """Yield type, name, outline about the node, and height of the objects at a node ``s_m`` along a road."""
    right_m, left_m = edges_of_carriageway(road, s_m)
    if tags.get("crossing:island") == "yes" or tags.get("traffic_calming") == "island":
        middle_m = (right_m + left_m) / 2 if road.one_way else 0.0
        yield "trafficIsland", "island", _rectangle(_ISLAND_M[0], middle_m - _ISLAND_M[1] / 2, _ISLAND_M[1]), _KERB_M
    if tags.get("railway") == "level_crossing":
        yield "patch", "railway track", _rectangle(_TRACK_M, right_m, left_m - right_m), 0.0
    if tags.get("highway") == "turning_circle":
        radius_m = diameter_m(tags) / 2
        angles = [math.tau * k / _CORNERS for k in range(_CORNERS)]
        yield "patch", "turning circle", [(radius_m * math.cos(a), radius_m * math.sin(a)) for a in angles], 0.0


def _rectangle(length_m: float, right_m: float, width_m: float) -> _Outline:
    half_m = length_m / 2
    return [(-half_m, right_m), (half_m, right_m), (half_m, right_m + width_m), (-half_m, right_m + width_m)]


# --- turning circles -------------------------------------------------------------------------------------------------
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
    tagged = graph.nodes_by_place(
        node for node in extract.nodes.values() if node.tags.get("highway") in ("turning_circle", "turning_loop")
    )
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
