"""Crosswalks: OSM's crossings, nodes of a road or ways across it, as outlines from edge to edge of that road.

A crosswalk has the direction of the crossing's own way, if there is one, and otherwise leads straight across. Near a
junction, where the road is cut back for the turns, a crosswalk belongs to the road although it is beyond its end.
"""

from __future__ import annotations

import math
from collections import defaultdict
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from itertools import count, pairwise
from typing import Final

import numpy as np
import shapely

from trace_dag.common.geometry import arc_lengths
from trace_dag.osm.road_classes import is_crossing
from trace_dag.osm.types import OsmExtract
from trace_dag.roads.from_osm.street_graph import Street, StreetGraph
from trace_dag.roads.from_osm.street_roads import BuiltStreets, edges_of_carriageway
from trace_dag.roads.from_osm.tag_values import parse_length_m
from trace_dag.roads.map.curves import PlanView, Point, plan_pose
from trace_dag.roads.map.model import Crosswalk, Road

_WIDTH_M: Final = 3.05  # 10 ft; MUTCD 2009, 3B.18, asks for 6 ft at least
_WIDTHS_M: Final = (1.8, 8.0)
_SAME_M: Final = 5.0  # farthest between a crossing's node and its way if they are not joined
_MOST_SKEWED: Final = math.tan(math.radians(50))  # from straight across
_LEAST_ACROSS_M: Final = 2.0


@dataclass
class _Crossing:
    """A crossing of one street: its place, its direction (a unit vector, if known), and its tags."""

    street: int
    s_m: float
    node_id: int | None = None
    direction: Point | None = None
    tags: dict[str, str] = field(default_factory=dict)


def add_crosswalks(
    roads: Sequence[Road], extract: OsmExtract, graph: StreetGraph, built: BuiltStreets
) -> tuple[Road, ...]:
    """Return ``roads``, finished, with OpenStreetMap's crosswalks.

    >>> roads = add_crosswalks(bare_roads, extract, street_graph, street_roads)
    >>> [len(road.crosswalks) for road in roads if road.crosswalks]
    [1]
    """
    crossings = _at_nodes(extract, graph, built)
    _add_ways(crossings, extract, graph, built)
    by_id = {road.id: road for road in roads}
    made: dict[str, list[Crosswalk]] = defaultdict(list)
    ids = count()
    for crossing in sorted(crossings, key=lambda each: (each.street, each.s_m)):
        if crossing.tags.get("crossing") == "no":
            continue
        bare, begin_m = built[crossing.street].road_at(crossing.s_m)
        road = by_id[bare.id]
        crosswalk = _crosswalk(crossing, built[crossing.street].plan, road, begin_m, str(next(ids)))
        if crosswalk is not None:
            made[road.id].append(crosswalk)
    return tuple(replace(road, crosswalks=tuple(made[road.id])) if road.id in made else road for road in roads)


def _at_nodes(extract: OsmExtract, graph: StreetGraph, built: BuiltStreets) -> list[_Crossing]:
    """Return crossings that are nodes of a street.

    Those on a junction are left out, because the arm that they cross is unknown.
    """
    tagged = graph.nodes_by_place(
        node
        for node in extract.nodes.values()
        if node.tags.get("highway") == "crossing"
        or ("crossing" in node.tags and node.tags.get("highway") == "traffic_signals")
    )
    return [
        _Crossing(index, made.plan.vertex_s_m[number], node.id, tags=dict(node.tags))
        for index, made in built.items()
        for number, node_id in enumerate(made.street.node_ids)
        if (node := tagged.get(node_id)) is not None and not _is_junction(made.street, number)
    ]


def _is_junction(street: Street, number: int) -> bool:
    at_start, at_end = number == 0, number == len(street.node_ids) - 1
    return (at_start and street.start_node is not None) or (at_end and street.end_node is not None)


def _add_ways(crossings: list[_Crossing], extract: OsmExtract, graph: StreetGraph, built: BuiltStreets) -> None:
    """Add the ways of crossings: they give directions to crossings with nodes, and add crossings without."""
    ways = [way for way in extract.walkways if is_crossing(way.tags)]
    numbers = [index for index, made in built.items() if len(set(made.street.points)) > 1]
    if not ways or not numbers:
        return
    tree = shapely.STRtree([shapely.LineString(built[index].street.points) for index in numbers])
    of_street: dict[int, list[_Crossing]] = defaultdict(list)
    for crossing in crossings:
        of_street[crossing.street].append(crossing)
    for way in ways:
        points = [graph.positions[node] for node in way.node_ids if node in graph.positions]
        for (one, two), ids in zip(pairwise(points), pairwise(way.node_ids), strict=False):
            piece = shapely.LineString([one, two])
            if piece.length < 1e-6:
                continue
            for hit in tree.query(piece, predicate="intersects").tolist():
                index, street = numbers[hit], built[numbers[hit]].street
                place = shapely.get_coordinates(tree.geometries[hit].intersection(piece))
                if not len(place) or _other_level(street, way.tags):
                    continue
                along_m = float(shapely.line_locate_point(tree.geometries[hit], shapely.Point(place[0])))
                s_m = float(np.interp(along_m, arc_lengths(np.array(street.points)), built[index].plan.vertex_s_m))
                direction = ((two[0] - one[0]) / piece.length, (two[1] - one[1]) / piece.length)
                known = next((c for c in of_street[index] if abs(c.s_m - s_m) <= _SAME_M), None)
                if known is None:
                    node_id = next((i for i in ids if i in street.node_ids and i > 0), None)
                    if node_id is not None and _is_junction(street, street.node_ids.index(node_id)):
                        continue
                    known = _Crossing(index, s_m, node_id)
                    crossings.append(known)
                    of_street[index].append(known)
                known.direction = known.direction or direction
                known.tags = {**way.tags, **known.tags}


def _other_level(street: Street, tags: Mapping[str, str]) -> bool:
    """Return whether a crossing's way passes over or under a street instead of across it."""
    raised = any(tags.get(key, "no") != "no" for key in ("bridge", "tunnel"))
    profile = street.spans[0].profile
    return raised and not (profile.bridge or profile.tunnel)


def _crosswalk(crossing: _Crossing, plan: PlanView, road: Road, begin_m: float, crosswalk_id: str) -> Crosswalk | None:
    s_m = min(max(crossing.s_m - begin_m, 0.0), road.length_m)
    at, node = plan_pose(plan, begin_m + s_m), plan_pose(plan, crossing.s_m)
    cosine, sine = math.cos(at.heading_rad), math.sin(at.heading_rad)
    dx, dy = node.x_m - at.x_m, node.y_m - at.y_m
    ahead_m, left_m = dx * cosine + dy * sine, dy * cosine - dx * sine
    skew = 0.0  # metres ahead per metre to the left
    if crossing.direction is not None:
        x, y = crossing.direction
        ahead, left = x * cosine + y * sine, y * cosine - x * sine
        skew = ahead / left if abs(left) > 1e-6 else math.inf
        if abs(skew) > _MOST_SKEWED:
            return None  # the way runs along this street and crosses another
    right_edge_m, left_edge_m = edges_of_carriageway(road, s_m)
    if left_edge_m - right_edge_m < _LEAST_ACROSS_M:
        return None
    tagged_m = parse_length_m(crossing.tags.get("width"))
    half_m = min(max(tagged_m or _WIDTH_M, _WIDTHS_M[0]), _WIDTHS_M[1]) / 2 * math.hypot(1.0, skew)
    corners = tuple(
        (ahead_m + skew * (v - left_m) + u, v)
        for v, u in ((right_edge_m, -half_m), (right_edge_m, half_m), (left_edge_m, half_m), (left_edge_m, -half_m))
    )
    tags = crossing.tags
    return Crosswalk(
        crosswalk_id,
        s_m,
        corners,
        marked=tags.get("crossing") != "unmarked" and tags.get("crossing:markings", "yes") != "no",
        signals=tags.get("crossing") == "traffic_signals" or tags.get("crossing:signals") == "yes",
        osm_node_id=crossing.node_id,
    )
