"""Streets from ways: the pieces of road between junctions, and the junctions.

OSM ways are cut arbitrarily. A street here runs from one junction (a node where three or more arms meet) or dead end to
the next. Nodes where one way just continues another do not end it, and each stretch keeps the profile of its way. Real
data have errors: nodes may be missing, doubled, or at the same place; ways may touch themselves, overlap, or run
against each other's direction.
"""

from __future__ import annotations

import math
from collections import defaultdict
from collections.abc import Callable, Iterable
from dataclasses import dataclass, field
from itertools import groupby, pairwise
from typing import Final

import numpy as np

from trace_dag.common.geometry import LocalFrame
from trace_dag.osm.road_classes import blocks_cars, is_drivable
from trace_dag.osm.types import OsmExtract, OsmNode, OsmWay
from trace_dag.roads.from_osm.tags import WayProfile
from trace_dag.roads.map.curves import Point, direction_rad

_SAME_PLACE_M: Final = 0.05
_FARTHEST_M: Final = 1e5  # from the crash; beyond it coordinates are wrong
_CLIPPED_M: Final = 12.0  # least length of a road from its junction to the border of the box
STUB_M: Final = 3.0
"""Dead ends shorter than this are errors of drawing or cutting."""
_BEHIND: Final = -(10**12)  # ids of nodes behind barriers lie below all others
_HOOK_RAD: Final = math.radians(5)
_SAME_ROAD_RAD: Final = math.radians(100)  # a way that turns more sharply at its end is not continued by the next


@dataclass(frozen=True)
class Span:
    """Points ``first`` to ``last`` of a street, and the profile of their way seen in the street's direction."""

    profile: WayProfile
    first: int
    last: int


@dataclass
class Street:
    """A piece of road between two junction nodes (or dead ends). One-way stretches all run along it.

    ``start_node`` and ``end_node`` are junction nodes, or None at a dead end. If two arms meet but cannot be one
    street (a hairpin, one-ways head-on, the seam of a closed ring), that node is a junction too."""

    node_ids: list[int]
    points: list[Point]
    spans: list[Span]
    start_node: int | None = None
    end_node: int | None = None


@dataclass
class StreetGraph:
    """All streets, the positions of the junction nodes, and for each merged OSM node its new node."""

    streets: list[Street]
    positions: dict[int, Point]
    aliases: dict[int, int] = field(default_factory=dict)

    def nodes_by_place(self, nodes: Iterable[OsmNode]) -> dict[int, OsmNode]:
        """Return nodes by the node into which each was merged, or by their own ids."""
        return {self.aliases.get(node.id, node.id): node for node in nodes}


@dataclass
class _Edge:
    """A stretch of a way between two nodes at which ways begin, end or meet."""

    profile: WayProfile
    node_ids: list[int]


def build_street_graph(
    extract: OsmExtract, frame: LocalFrame, profile_of: Callable[[OsmWay], WayProfile]
) -> StreetGraph:
    """Return streets of all drivable ways of ``extract`` in the local frame; empty if no way is usable."""
    positions = _local_positions(extract, frame)
    aliases: dict[int, int] = {}
    ways: list[_Edge] = []
    for way in extract.ways:
        if not is_drivable(way.tags, service_roads=True):
            continue
        node_ids = _usable_nodes(way, positions, aliases)
        if len(node_ids) > 1:
            ways.append(_Edge(profile_of(way), node_ids))
    for edge in ways:
        edge.node_ids = [node for node, _ in groupby(_canonical(node, aliases) for node in edge.node_ids)]
    pieces = _without_overlaps(ways)
    blocked = {_canonical(node.id, aliases) for node in extract.nodes.values() if blocks_cars(node.tags)}
    pieces = _cut_at_barriers(pieces, blocked, positions)
    arms = _count_arms(pieces)
    clipped = {_canonical(node.id, aliases) for node in extract.nodes.values() if node.clipped}
    for piece in pieces:
        _prolong(piece, arms, positions, clipped)
    pieces = [piece for piece in pieces if _without_hook(piece, arms, positions)]
    arms = _count_arms(pieces)
    edges = _split_at_junctions(pieces, arms, positions)
    streets = _chain(edges, arms, positions)
    return StreetGraph(streets, positions, aliases)


def _local_positions(extract: OsmExtract, frame: LocalFrame) -> dict[int, Point]:
    local = extract.local_xy_m(extract.nodes, frame)
    usable = np.abs(np.nan_to_num(local, nan=np.inf)).max(axis=1) < _FARTHEST_M
    return {i: (x, y) for i, (x, y), ok in zip(extract.nodes, local.tolist(), usable.tolist(), strict=True) if ok}


def _canonical(node: int, aliases: dict[int, int]) -> int:
    while node in aliases:
        node = aliases[node]
    return node


def _usable_nodes(way: OsmWay, positions: dict[int, Point], aliases: dict[int, int]) -> list[int]:
    """Return the existing nodes of a way, with nodes at one place merged."""
    kept: list[int] = []
    for node in way.node_ids:
        if node not in positions:
            continue
        if kept:
            (x0, y0), (x1, y1) = positions[kept[-1]], positions[node]
            if abs(x1 - x0) < _SAME_PLACE_M and abs(y1 - y0) < _SAME_PLACE_M:
                a, b = _canonical(kept[-1], aliases), _canonical(node, aliases)
                if a != b:
                    aliases[b] = a
                continue
        kept.append(node)
    return kept


def _without_overlaps(ways: list[_Edge]) -> list[_Edge]:
    """Return ways cut where they repeat a segment of an earlier way or of themselves."""
    seen: set[tuple[int, int]] = set()
    pieces: list[_Edge] = []
    for way in ways:
        run: list[int] = way.node_ids[:1]
        for a, b in pairwise(way.node_ids):
            segment = (a, b) if a < b else (b, a)
            if segment in seen:
                if len(run) > 1:
                    pieces.append(_Edge(way.profile, run))
                run = [b]
                continue
            seen.add(segment)
            run.append(b)
        if len(run) > 1:
            pieces.append(_Edge(way.profile, run))
    return pieces


def _cut_at_barriers(pieces: list[_Edge], blocked: set[int], positions: dict[int, Point]) -> list[_Edge]:
    """Return ways cut at barriers between two of their ends; the part behind a barrier begins at a new node."""
    arms = _count_arms(pieces)
    cut: list[_Edge] = []
    met: set[int] = set()
    for piece in pieces:
        nodes = piece.node_ids
        inner = [k for k in range(1, len(nodes) - 1) if nodes[k] in blocked and arms[nodes[k]] == 2]
        for first, last in pairwise([0, *inner, len(nodes) - 1]):
            part = nodes[first : last + 1]
            for end in (0, -1):
                node = part[end]
                if node in blocked and arms[node] == 2:
                    if node in met:
                        part[end] = _BEHIND - node
                        positions[part[end]] = positions[node]
                    met.add(node)
            cut.append(_Edge(piece.profile, part))
    return cut


def _count_arms(pieces: list[_Edge]) -> dict[int, int]:
    """Count the ways that leave each node, one that passes through counting twice."""
    arms: dict[int, int] = defaultdict(int)
    for piece in pieces:
        for node in piece.node_ids[1:-1]:
            arms[node] += 2
        arms[piece.node_ids[0]] += 1
        arms[piece.node_ids[-1]] += 1
    return arms


def _prolong(piece: _Edge, arms: dict[int, int], positions: dict[int, Point], clipped: set[int]) -> None:
    """Prolong roads that the box cuts off just after a junction, straight on, since they continue in reality."""
    for nodes in (piece.node_ids, piece.node_ids[::-1]):
        if nodes[-1] not in clipped or arms[nodes[-1]] != 1:
            continue
        length = 0.0
        for a, b in pairwise(nodes[::-1]):
            length += math.dist(positions[a], positions[b])
            if arms[b] > 2 or length > _CLIPPED_M:
                break
        if length < _CLIPPED_M:
            (x0, y0), (x1, y1) = positions[nodes[-2]], positions[nodes[-1]]
            share = (_CLIPPED_M - length) / math.hypot(x1 - x0, y1 - y0)
            positions[nodes[-1]] = (x1 + share * (x1 - x0), y1 + share * (y1 - y0))


def _without_hook(piece: _Edge, arms: dict[int, int], positions: dict[int, Point]) -> bool:
    """Remove the last metres of a dead end if they bend away.

    Return False if nothing else would be left of the way.
    """
    nodes = piece.node_ids
    for last in (-1, 0):
        taken = 0.0
        while arms[nodes[last]] == 1 and len(nodes) > 2:
            a, b, c = nodes[-3:] if last else nodes[2::-1]
            taken += math.dist(positions[b], positions[c])
            if taken > STUB_M or arms[b] > 2:
                break
            if _bend(positions[a], positions[b], positions[c]) < _HOOK_RAD:
                break
            nodes.pop(last)
            arms[b] = 1
    met = sorted((arms[nodes[0]], arms[nodes[-1]]))
    length = math.fsum(math.dist(positions[a], positions[b]) for a, b in pairwise(nodes))
    return length > STUB_M or met[0] != 1 or met[1] < 3


def _split_at_junctions(pieces: list[_Edge], arms: dict[int, int], positions: dict[int, Point]) -> list[_Edge]:
    """Return ways cut where three or more arms meet, and where a way turns back on itself."""
    edges: list[_Edge] = []
    for piece in pieces:
        nodes = piece.node_ids
        begin = 0
        for index in range(1, len(nodes)):
            if (
                index == len(nodes) - 1
                or arms[nodes[index]] > 2
                or _bend(*(positions[node] for node in nodes[index - 1 : index + 2])) > _SAME_ROAD_RAD
            ):
                edges.append(_Edge(piece.profile, nodes[begin : index + 1]))
                begin = index
    return edges


def _chain(edges: list[_Edge], arms: dict[int, int], positions: dict[int, Point]) -> list[Street]:
    """Return edges joined where one way continues another.

    One-way edges come first, since they set the direction.
    """
    ends: dict[int, list[int]] = defaultdict(list)
    for index, edge in enumerate(edges):
        ends[edge.node_ids[0]].append(index)
        ends[edge.node_ids[-1]].append(index)
    used = [False] * len(edges)

    def next_to(edge: _Edge, *, ahead: bool) -> _Edge | None:
        """Return the edge that continues one ahead, or leads to it from behind."""
        inward, node = edge.node_ids[-2:] if ahead else edge.node_ids[1::-1]
        for number in ends[node] if arms[node] == 2 else ():
            other = edges[number]
            is_along = other.node_ids[0 if ahead else -1] == node
            if used[number] or (other.profile.oneway and not is_along):
                continue
            other = other if is_along else _Edge(other.profile.reversed(), other.node_ids[::-1])
            beyond = other.node_ids[1 if ahead else -2]
            if _bend(positions[inward], positions[node], positions[beyond]) <= _SAME_ROAD_RAD:
                used[number] = True
                return other
        return None

    streets: list[Street] = []
    for index in sorted(range(len(edges)), key=lambda number: not edges[number].profile.oneway):
        if used[index]:
            continue
        used[index] = True
        chain = [edges[index]]
        while (after := next_to(chain[-1], ahead=True)) is not None:
            chain.append(after)
        while (before := next_to(chain[0], ahead=False)) is not None:
            chain.insert(0, before)
        streets.append(_street(chain, arms, positions))
    return streets


def _bend(before: Point, at: Point, after: Point) -> float:
    return abs(math.remainder(direction_rad(at, after) - direction_rad(before, at), math.tau))


def _street(chain: list[_Edge], arms: dict[int, int], positions: dict[int, Point]) -> Street:
    node_ids = list(chain[0].node_ids)
    spans = [Span(chain[0].profile, 0, len(node_ids) - 1)]
    for edge in chain[1:]:
        first = len(node_ids) - 1
        node_ids.extend(edge.node_ids[1:])
        spans.append(Span(edge.profile, first, len(node_ids) - 1))
    start, end = node_ids[0], node_ids[-1]
    return Street(
        node_ids,
        [positions[node] for node in node_ids],
        spans,
        start_node=start if arms[start] >= 2 else None,
        end_node=end if arms[end] >= 2 else None,
    )
