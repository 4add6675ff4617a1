"""The graph on which heights of roads are found: nodes along every street road, shared where roads meet.

Heights of the ground are known as far as OpenStreetMap tags them: ``ele`` of nodes (metres) and ``incline`` of ways.
"""

from __future__ import annotations

import heapq
import math
from collections import defaultdict
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from itertools import pairwise
from typing import Final

import numpy as np

from trace_dag.common.geometry import FloatArray
from trace_dag.osm.types import OsmExtract
from trace_dag.roads.map.model import ContactPoint, Road
from trace_dag.roads.map.network import RoadNetwork

_RAMP_FACTOR: Final = 1.5  # ramps and driveways may be this much steeper: 12 % where others may have 8 %

NodeId = int
_STEEPEST_TAGGED: Final = 0.30  # a larger ``incline`` is a mistake (stairs are not roads)
_REACH_M: Final = 15.0  # a tagged height counts for height nodes this near to it


@dataclass
class HeightProfile:
    """The height nodes of one road: stations and the graph node at each."""

    road: Road
    s_m: list[float]
    nodes: list[NodeId]


class HeightGraph:
    """Height nodes of all street roads; ends that meet are one node, and so is a whole junction."""

    def __init__(self, network: RoadNetwork, stations: Mapping[str, Sequence[float]]) -> None:
        self.profiles: dict[str, HeightProfile] = {}
        self.edges: dict[NodeId, list[tuple[NodeId, float]]] = defaultdict(list)
        self.junction_nodes: set[NodeId] = set()
        self.shared_ends: dict[NodeId, list[tuple[str, bool]]] = defaultdict(list)
        self._by_end: dict[tuple[str, str], NodeId] = {}
        self._count = 0
        for road in network.roads:
            if road.junction_id is None:
                self._add(road, stations[road.id])

    def __len__(self) -> int:
        return self._count

    def _add(self, road: Road, stations: Sequence[float]) -> None:
        inner = [self._new() for _ in stations[1:-1]]
        nodes = [self._end(road, True), *inner, self._end(road, False)]
        self.profiles[road.id] = HeightProfile(road, list(stations), nodes)
        # Lengths are divided by what the road may be steeper, so that one grade holds for all.
        factor = _RAMP_FACTOR if road.is_ramp or road.highway == "service" else 1.0
        for (a, s_a), (b, s_b) in pairwise(zip(nodes, stations, strict=True)):
            self.edges[a].append((b, (s_b - s_a) * factor))
            self.edges[b].append((a, (s_b - s_a) * factor))
        self.shared_ends[nodes[0]].append((road.id, True))
        self.shared_ends[nodes[-1]].append((road.id, False))

    def _new(self) -> NodeId:
        self._count += 1
        return self._count - 1

    def _end(self, road: Road, at_start: bool) -> NodeId:
        link = road.predecessor if at_start else road.successor
        own = (road.id, ContactPoint.START if at_start else ContactPoint.END)
        if link is not None and link.element_type == "junction":
            key = ("junction", link.element_id)
            self._by_end.setdefault(key, -1)
            if self._by_end[key] < 0:
                self._by_end[key] = self._new()
                self.junction_nodes.add(self._by_end[key])
            return self._by_end[key]
        keys = [own]
        if link is not None and link.contact_point is not None:
            keys.append((link.element_id, link.contact_point))
        node = next((self._by_end[key] for key in keys if key in self._by_end), None)
        if node is None:
            node = self._new()
        for key in keys:
            self._by_end[key] = node
        return node

    def junction_node(self, junction_id: str) -> NodeId | None:
        """Return the node of a junction, if any road ends there."""
        return self._by_end.get(("junction", junction_id))

    def extended(self, values: Mapping[NodeId, float], grade: float) -> FloatArray:
        """Return, at every node, the lowest of ``value + grade * distance`` over all given nodes.

        It is inf for nodes out of reach.
        """
        lowest = np.full(len(self), math.inf)
        queue = [(value, node) for node, value in values.items()]
        heapq.heapify(queue)
        while queue:
            value, node = heapq.heappop(queue)
            if value >= lowest[node]:
                continue
            lowest[node] = value
            for other, length_m in self.edges[node]:
                candidate = value + grade * length_m
                if candidate < lowest[other]:
                    heapq.heappush(queue, (candidate, other))
        return lowest


# --- heights of the ground as tagged ---------------------------------------------------------------------------------
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
        first, last = extract.local_xy_m((way.node_ids[0], way.node_ids[-1]), network.frame)
        line = network.road_geometry(road_id).line.sample(np.array([0.0, profile.road.length_m]))[:, :2]
        forward[road_id] = 1 if float((last - first) @ (line[1] - line[0])) >= 0 else -1
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
