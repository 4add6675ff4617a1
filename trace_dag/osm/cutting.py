"""From the raw ways around a site to its extract: ways cut at the box, with nodes made on the border."""

from __future__ import annotations

import math
from collections.abc import Container, Iterable, Mapping
from dataclasses import dataclass
from itertools import pairwise

from trace_dag.osm.extraction import RawWay
from trace_dag.osm.types import BoundingBox, OsmMember, OsmNode, OsmRelation, OsmWay

_RESOLUTION_DIGITS = 7  # OSM stores coordinates as multiples of 1e-7 degrees


@dataclass(frozen=True)
class CutRoads:
    """What lies in the box: nodes by id, ways by ascending id, the restrictions whose members are all there."""

    nodes: dict[int, OsmNode]
    ways: tuple[OsmWay, ...]
    relations: tuple[OsmRelation, ...]


def cut_roads(
    box: BoundingBox,
    ways: Iterable[RawWay],
    node_tags: Mapping[int, dict[str, str]],
    restrictions: Iterable[OsmRelation],
) -> CutRoads:
    """Cut ``ways`` at ``box``.

    Where a way crosses the border a node is made there (``clipped``, negative id). A way that comes into the box
    several times, or has nodes the source lacks, becomes several ways: the first keeps the id, the others get negative
    ones, and restrictions are told which part they mean. All ids made here depend on nothing but the data and the box.
    """
    cutter = _Cutter(box, node_tags)
    for way in sorted(ways, key=lambda way: way.id):
        cutter.add(way)
    return CutRoads(cutter.nodes, tuple(sorted(cutter.ways, key=lambda way: way.id)), cutter.relations(restrictions))


class _Cutter:
    def __init__(self, box: BoundingBox, node_tags: Mapping[int, dict[str, str]]) -> None:
        self.nodes: dict[int, OsmNode] = {}
        self.ways: list[OsmWay] = []
        self._box = box
        self._node_tags = node_tags
        self._parts: dict[int, list[OsmWay]] = {}
        self._made_nodes = 0
        self._made_ways = 0

    def add(self, way: RawWay) -> None:
        box = self._box
        west, south, east, north = way.bounds_deg
        whole = west >= box.west_deg and south >= box.south_deg and east <= box.east_deg and north <= box.north_deg
        if whole and not any(map(math.isnan, way.longitudes_deg)):
            pieces = [way.node_ids]
            self._add_nodes(way)
        else:
            pieces = list(self._pieces(way))
        for ids in pieces:
            ids = _without_repetition(ids)
            if len(ids) < 2:
                continue
            parts = self._parts.setdefault(way.id, [])
            if parts:
                self._made_ways += 1
            part = OsmWay(-self._made_ways if parts else way.id, ids, way.tags)
            parts.append(part)
            self.ways.append(part)

    def relations(self, restrictions: Iterable[OsmRelation]) -> tuple[OsmRelation, ...]:
        present: dict[str, Container[int]] = {"node": self.nodes, "way": self._parts, "relation": ()}
        kept = [
            OsmRelation(relation.id, tuple(self._member(m, relation) for m in relation.members), relation.tags)
            for relation in restrictions
            if relation.members and all(member.id in present[member.type] for member in relation.members)
        ]
        return tuple(sorted(kept, key=lambda relation: relation.id))

    def _member(self, member: OsmMember, relation: OsmRelation) -> OsmMember:
        parts = self._parts[member.id] if member.type == "way" else []
        if len(parts) < 2:
            return member
        via_ids = {other.id for other in relation.members if other.role == "via" and other.type == "node"}
        touching = [part for part in parts if not via_ids.isdisjoint(part.node_ids)]
        return OsmMember("way", (touching or parts)[0].id, member.role)

    def _add_nodes(self, way: RawWay) -> None:
        nodes, tags = self.nodes, self._node_tags
        for node_id, x_deg, y_deg in zip(way.node_ids, way.longitudes_deg, way.latitudes_deg, strict=True):
            if node_id not in nodes:
                nodes[node_id] = OsmNode(node_id, y_deg, x_deg, tags.get(node_id, {}))

    def _add_node(self, way: RawWay, index: int) -> int:
        node_id = way.node_ids[index]
        if node_id not in self.nodes:
            self.nodes[node_id] = OsmNode(
                node_id, way.latitudes_deg[index], way.longitudes_deg[index], self._node_tags.get(node_id, {})
            )
        return node_id

    def _make_node(self, x_deg: float, y_deg: float) -> int:
        self._made_nodes += 1
        node_id = -self._made_nodes
        self.nodes[node_id] = OsmNode(
            node_id, round(y_deg, _RESOLUTION_DIGITS), round(x_deg, _RESOLUTION_DIGITS), clipped=True
        )
        return node_id

    def _pieces(self, way: RawWay) -> Iterable[tuple[int, ...]]:
        """The stretches of ``way`` inside the box, as node ids."""
        points = list(zip(way.longitudes_deg, way.latitudes_deg, strict=True))
        piece: list[int] = []
        for index, (a, b) in enumerate(pairwise(points)):
            span = _inside_span(a, b, self._box)
            if span is None:
                if piece:
                    yield tuple(piece)
                piece = []
                continue
            enters, leaves = span
            if not piece:
                piece.append(self._add_node(way, index) if enters == 0 else self._make_node(*_between(a, b, enters)))
            if leaves == 1:
                piece.append(self._add_node(way, index + 1))
            else:
                piece.append(self._make_node(*_between(a, b, leaves)))
                yield tuple(piece)
                piece = []
        if piece:
            yield tuple(piece)


def _inside_span(a: tuple[float, float], b: tuple[float, float], box: BoundingBox) -> tuple[float, float] | None:
    """The part of segment a-b in the box as fractions of it, None if it misses (Liang and Barsky 1984)."""
    west, south, east, north = box.west_deg, box.south_deg, box.east_deg, box.north_deg
    if west <= a[0] <= east and west <= b[0] <= east and south <= a[1] <= north and south <= b[1] <= north:
        return 0.0, 1.0
    if math.isnan(a[0]) or math.isnan(b[0]):
        return None
    enters, leaves = 0.0, 1.0
    for start, end, low, high in (
        (a[0], b[0], west, east),
        (a[1], b[1], south, north),
    ):
        delta = end - start
        if delta == 0:
            if not low <= start <= high:
                return None
            continue
        near, far = sorted(((low - start) / delta, (high - start) / delta))
        enters, leaves = max(enters, near), min(leaves, far)
    return (enters, leaves) if enters < leaves else None


def _between(a: tuple[float, float], b: tuple[float, float], fraction: float) -> tuple[float, float]:
    return a[0] + (b[0] - a[0]) * fraction, a[1] + (b[1] - a[1]) * fraction


def _without_repetition(ids: tuple[int, ...]) -> tuple[int, ...]:
    """``ids`` without the same node twice in a row."""
    if all(a != b for a, b in pairwise(ids)):
        return ids
    return ids[:1] + tuple(b for a, b in pairwise(ids) if a != b)
