"""Heights of the ground as far as OpenStreetMap tags them: ``ele`` of nodes (metres) and ``incline`` of ways."""

from __future__ import annotations

import math
from collections import defaultdict
from collections.abc import Mapping
from itertools import pairwise
from typing import Final

import numpy as np

from trace_dag.common.geometry import FloatArray
from trace_dag.osm.types import OsmExtract
from trace_dag.roads.from_osm.height_graph import HeightGraph, NodeId
from trace_dag.roads.map.network import RoadNetwork

_STEEPEST_TAGGED: Final = 0.30  # a larger ``incline`` is a mistake (stairs are not roads)
_REACH_M: Final = 15.0  # a tagged height counts for height nodes this near to it


def has_height_tags(extract: OsmExtract) -> bool:
    """Return whether any incline, or heights of two places, are tagged; one height alone is not enough."""
    return any(_incline(way.tags) is not None for way in extract.ways) or (
        sum(_metres(node.tags.get("ele")) is not None for node in extract.nodes.values()) >= 2
    )


def ground_heights(network: RoadNetwork, graph: HeightGraph, extract: OsmExtract, steepest: float) -> FloatArray:
    """Return the ground heights from ``incline`` and ``ele``, elsewhere as level as possible (least squares).

    >>> graph = HeightGraph(network, {road.id: (0.0, road.length_m) for road in network.roads})
    >>> float(np.abs(ground_heights(network, graph, extract, 0.1)).max())  # level where nothing is tagged
    0.0
    """
    from scipy.sparse import coo_array
    from scipy.sparse.linalg import lsqr

    rows: list[tuple[list[tuple[NodeId, float]], float]] = []  # coefficients, right-hand side
    inclines = {way.id: slope for way in extract.ways if (slope := _incline(way.tags)) is not None}
    forward = _ways_forward(network, graph, extract, inclines)
    for profile in graph.profiles.values():
        tagged = [inclines[way_id] for way_id in profile.road.osm_way_ids if way_id in inclines]
        slope = tagged[0] * forward[profile.road.id] if len(tagged) == len(profile.road.osm_way_ids) and tagged else 0.0
        weight = 3.0 if tagged else 1.0
        for (a, s_a), (b, s_b) in pairwise(zip(profile.nodes, profile.s_m, strict=True)):
            scale = weight / math.sqrt(s_b - s_a)
            rows.append(([(a, -scale), (b, scale)], scale * slope * (s_b - s_a)))
    surveyed = _surveyed(network, graph, extract)
    datum_m = float(np.median(list(surveyed.values()))) if surveyed else 0.0
    rows.extend(([(node, 3.0)], 3.0 * (height_m - datum_m)) for node, height_m in surveyed.items())
    rows.extend(([(node, 1e-3)], 0.0) for node in range(len(graph)))
    entries = [(i, node, value) for i, (coefficients, _) in enumerate(rows) for node, value in coefficients]
    row, column, value = zip(*entries, strict=True)
    matrix = coo_array((value, (row, column)), shape=(len(rows), len(graph))).tocsr()
    solved = lsqr(matrix, np.array([right for _, right in rows]), atol=1e-9, btol=1e-9)[0]
    # Tags can contradict each other: no steeper than roads are.
    return np.asarray(graph.extended(dict(enumerate(solved.tolist())), steepest))


def _ways_forward(
    network: RoadNetwork, graph: HeightGraph, extract: OsmExtract, inclines: Mapping[int, float]
) -> dict[str, int]:
    """Return +1 for a road along its first tagged way, -1 for a road against it."""
    ways = {way.id: way for way in extract.ways if way.id in inclines}
    forward: dict[str, int] = {}
    for road_id, profile in graph.profiles.items():
        way = next((ways[i] for i in profile.road.osm_way_ids if i in ways), None)
        if way is None:
            forward[road_id] = 1
            continue
        nodes = [extract.nodes[node_id] for node_id in (way.node_ids[0], way.node_ids[-1])]
        along = np.diff([network.frame.to_local(n.latitude_deg, n.longitude_deg) for n in nodes], axis=0)[0]
        line = network.road_geometry(road_id).line.sample(np.array([0.0, profile.road.length_m]))[:, :2]
        forward[road_id] = 1 if float(along @ (line[1] - line[0])) >= 0 else -1
    return forward


def _surveyed(network: RoadNetwork, graph: HeightGraph, extract: OsmExtract) -> dict[NodeId, float]:
    """Return the tagged heights of way nodes, each at the nearest height node of a road of that way."""
    of_node: dict[int, set[int]] = defaultdict(set)
    for way in extract.ways:
        for node_id in way.node_ids:
            of_node[node_id].add(way.id)
    heights: dict[NodeId, float] = {}
    for node in extract.nodes.values():
        height_m = _metres(node.tags.get("ele"))
        if height_m is None:
            continue
        x_m, y_m = network.frame.to_local(node.latitude_deg, node.longitude_deg)
        for road_id, profile in graph.profiles.items():
            if of_node[node.id] & set(profile.road.osm_way_ids):
                foot = network.road_geometry(road_id).line.project(float(x_m), float(y_m))
                index = int(np.argmin(np.abs(np.array(profile.s_m) - foot.s_m)))
                if abs(profile.s_m[index] - foot.s_m) <= _REACH_M:
                    heights[profile.nodes[index]] = height_m
    return heights


def _incline(tags: Mapping[str, str]) -> float | None:
    """Return ``incline`` as rise over run along the way: ``5%``, ``-3.5 %`` or ``4°``.

    "up" and "down" have no number and are ignored.
    """
    text = tags.get("incline", "").replace(" ", "").replace(",", ".")
    try:
        if text.endswith("%"):
            slope = float(text[:-1]) / 100
        elif text.endswith("°"):
            slope = math.tan(math.radians(float(text[:-1])))
        else:
            return None
    except ValueError:
        return None
    return slope if math.isfinite(slope) and abs(slope) <= _STEEPEST_TAGGED else None


def _metres(text: str | None) -> float | None:
    """Return ``ele`` in metres, its unit by definition."""
    try:
        value = float((text or "").removesuffix("m").strip())
    except ValueError:
        return None
    return value if math.isfinite(value) and -500.0 < value < 9000.0 else None
