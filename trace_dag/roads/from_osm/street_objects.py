"""Objects on streets: islands of crossings and of traffic calming, railway tracks, and the round ends of dead ends."""

from __future__ import annotations

import math
from collections import defaultdict
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import replace
from itertools import count
from typing import Final

from trace_dag.osm.types import OsmExtract
from trace_dag.roads.from_osm.crosswalks import edges_of_carriageway
from trace_dag.roads.from_osm.street_graph import StreetGraph
from trace_dag.roads.from_osm.street_roads import StreetRoads
from trace_dag.roads.from_osm.turning_circles import diameter_m
from trace_dag.roads.map.curves import PlanView
from trace_dag.roads.map.model import Road, RoadObject

_ISLAND_M: Final = (6.1, 1.8)  # 20 ft by 6 ft, the least for people to wait on (MUTCD 2009, 3I.06)
_KERB_M: Final = 0.15
_TRACK_M: Final = 2.6  # a tie of a railway in the US: 8 ft 6 in
_CORNERS: Final = 24


def add_objects(
    roads: Sequence[Road],
    extract: OsmExtract,
    graph: StreetGraph,
    plans: Sequence[PlanView],
    built: Mapping[int, StreetRoads],
) -> tuple[Road, ...]:
    """Return ``roads``, finished, with the objects at nodes of their streets.

    >>> sum(len(road.objects) for road in add_objects(bare_roads, extract, street_graph, plans, street_roads))
    0
    """
    by_id = {road.id: road for road in roads}
    made: dict[str, list[RoadObject]] = defaultdict(list)
    ids = count(sum(len(road.crosswalks) for road in roads))  # after those of the crosswalks
    tagged = {graph.aliases.get(node.id, node.id): node for node in extract.nodes.values() if node.tags}
    for index, of_street in built.items():
        for number, node_id in enumerate(graph.streets[index].node_ids):
            if node_id not in tagged:
                continue
            s_m = plans[index].vertex_s_m[number]
            k = max((k for k, begin_m in enumerate(of_street.begins_m) if begin_m <= s_m), default=0)
            road = by_id[of_street.roads[k].id]
            at_m = s_m - of_street.begins_m[k]
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
