"""The graph on which heights of roads are found: nodes along every street road, shared where roads meet."""

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
from trace_dag.roads.map.model import ContactPoint, Road
from trace_dag.roads.map.network import RoadNetwork

_RAMP_FACTOR: Final = 1.5  # ramps and driveways may be this much steeper: 12 % where others may have 8 %

NodeId = int


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
        factor = _RAMP_FACTOR if _is_minor(road) else 1.0
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


def _is_minor(road: Road) -> bool:
    """Return ramps, driveways and other service roads."""
    return road.highway.endswith("_link") or road.highway == "service"
