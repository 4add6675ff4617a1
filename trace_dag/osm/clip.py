"""From the raw ways around a site to its extract: ways cut at the box, with nodes made on the border.

Files of neighbouring states end at their border, so several are joined around one site. Two files are neighbours if
they share some nodes, at the same places, and most of their nodes are in one of them alone. Files that cover the same
ground, perhaps at different times, are not joined.
"""

from __future__ import annotations

from collections.abc import Container, Iterable, Iterator, Mapping, Sequence
from itertools import pairwise
from operator import attrgetter
from typing import Final

import numpy as np

from trace_dag.common.geometry import FloatArray
from trace_dag.osm.road_classes import is_walkway
from trace_dag.osm.types import NO_TAGS, BoundingBox, OsmExtract, OsmMember, OsmNode, OsmRelation, OsmWay, RawWay

_ID: Final = attrgetter("id")
_RESOLUTION_DIGITS: Final = 7  # OSM stores coordinates as multiples of 1e-7 degrees
Ways = Mapping[int, RawWay]

_SAME_PLACE_DEG: Final = 1e-5  # about a metre
_SAME_GROUND: Final = 0.5  # share of the nodes of the smaller one that both have


def clip_roads(
    box: BoundingBox,
    ways: Iterable[RawWay],
    node_tags: Mapping[int, Mapping[str, str]],
    restrictions: Iterable[OsmRelation],
) -> OsmExtract:
    """Cut roads and walkways at ``box``; return them by ascending id, with the restrictions that are complete.

    If a way crosses the border a node is made there (``clipped``, negative id). A way that enters the box several
    times, or lacks nodes in the source, becomes several ways: the first keeps the id, the others get negative ones, and
    restrictions refer to the right part. All new ids depend only on the data and the box.

    >>> from trace_dag.osm.types import RawWay
    >>> way = RawWay(7, np.array([1, 2]), np.array([0.5, 1.5]), np.array([0.5, 0.5]), {"highway": "primary"})
    >>> cut = clip_roads(BoundingBox(0.0, 0.0, 1.0, 1.0), [way], {}, [])
    >>> sorted(node.longitude_deg for node in cut.nodes.values())  # the way leaves the box on its east side
    [0.5, 1.0]
    """
    ordered = sorted(ways, key=_ID)
    roads = _Clipper(box, [way for way in ordered if not is_walkway(way.tags)], node_tags)
    roads.cut()
    # After the roads, so that the ids made for those do not depend on what is mapped beside them.
    walkways = _Clipper(box, [way for way in ordered if is_walkway(way.tags)], node_tags, after=roads)
    walkways.cut()
    return OsmExtract(
        box,
        {**roads.nodes, **walkways.nodes},
        tuple(sorted(roads.ways, key=_ID)),
        roads.relations(restrictions),
        tuple(sorted(walkways.ways, key=_ID)),
    )


class _Clipper:
    """Cuts the ways of one box. Their nodes lie in one row, way after way, so that numpy sees them all at once."""

    def __init__(
        self,
        box: BoundingBox,
        ways: Sequence[RawWay],
        node_tags: Mapping[int, Mapping[str, str]],
        *,
        after: _Clipper | None = None,
    ) -> None:
        self.ways: list[OsmWay] = []
        self._raw_ways = ways
        self._parts: dict[int, list[OsmWay]] = {}
        self._made_nodes: int = after._made_nodes if after else 0
        self._made_ways: int = after._made_ways if after else 0
        ids = np.concatenate([way.node_ids for way in ways] or [np.empty(0, np.int64)])
        x_deg = np.concatenate([way.longitudes_deg for way in ways] or [np.empty(0)])
        y_deg = np.concatenate([way.latitudes_deg for way in ways] or [np.empty(0)])
        # A segment begins at each node but the last of a way: from there a segment would lead to the next way.
        sizes = np.array([len(way.node_ids) for way in ways], dtype=np.int64)
        lasts = np.cumsum(sizes) - 1
        enters, leaves = _inside_spans(x_deg, y_deg, box)
        inside = enters < leaves
        inside[lasts] = False
        whole = inside & (enters == 0) & (leaves == 1)
        whole[lasts] = True
        kept = inside & (enters == 0)
        kept[1:] |= (inside & (leaves == 1))[:-1]
        kept_ids = ids[kept].tolist()
        tags = [node_tags.get(node_id, NO_TAGS) for node_id in kept_ids]
        missing = np.isnan(x_deg)
        ends = np.zeros(len(missing), bool)  # beside a node that the source lacks
        ends[1:] |= missing[:-1]
        ends[lasts + 1 - sizes] = False
        before = np.append(missing[1:], False)
        before[lasts] = False
        ends |= before
        nodes = map(OsmNode, kept_ids, y_deg[kept].tolist(), x_deg[kept].tolist(), tags, ends[kept].tolist())
        self.nodes = dict(zip(kept_ids, nodes, strict=True))
        self._whole = np.logical_and.reduceat(whole, lasts + 1 - sizes).tolist() if ways else []
        self._ids, self._x_deg, self._y_deg = ids.tolist(), x_deg.tolist(), y_deg.tolist()
        self._inside, self._enters, self._leaves = inside.tolist(), enters.tolist(), leaves.tolist()

    def cut(self) -> None:
        """Add the cut ways to ``ways``, and the nodes made on the border to ``nodes``."""
        end = 0
        for way, is_whole in zip(self._raw_ways, self._whole, strict=True):
            start, end = end, end + len(way.node_ids)
            for ids in (tuple(self._ids[start:end]),) if is_whole else self._pieces(start, end):
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
        return tuple(sorted(kept, key=_ID))

    def _member(self, member: OsmMember, relation: OsmRelation) -> OsmMember:
        parts = self._parts[member.id] if member.type == "way" else []
        if len(parts) < 2:
            return member
        via_ids = {other.id for other in relation.members if other.role == "via" and other.type == "node"}
        touching = [part for part in parts if not via_ids.isdisjoint(part.node_ids)]
        return OsmMember("way", (touching or parts)[0].id, member.role)

    def _pieces(self, start: int, end: int) -> Iterator[tuple[int, ...]]:
        """Yield the parts of a way inside the box as node ids; its nodes are those from ``start`` to before ``end``."""
        piece: list[int] = []
        for index in range(start, end):
            if not self._inside[index]:
                if piece:
                    yield tuple(piece)
                piece = []
                continue
            enters, leaves = self._enters[index], self._leaves[index]
            if not piece:
                piece.append(self._ids[index] if enters == 0 else self._made_node(index, enters))
            if leaves == 1:
                piece.append(self._ids[index + 1])
            else:
                piece.append(self._made_node(index, leaves))
                yield tuple(piece)
                piece = []

    def _made_node(self, index: int, fraction: float) -> int:
        """Return a new node on the segment that begins at ``index``."""
        self._made_nodes += 1
        node_id = -self._made_nodes
        longitude_deg, latitude_deg = (
            round(values[index] + (values[index + 1] - values[index]) * fraction, _RESOLUTION_DIGITS)
            for values in (self._x_deg, self._y_deg)
        )
        self.nodes[node_id] = OsmNode(node_id, latitude_deg, longitude_deg, clipped=True)
        return node_id


def _inside_spans(x_deg: FloatArray, y_deg: FloatArray, box: BoundingBox) -> tuple[FloatArray, FloatArray]:
    """Return, for each segment between successive points, where it enters and leaves the box, (n,) each.

    Both are fractions of the segment. For a segment that misses the box or lacks an end, such as the one after the last
    point, the entry is not before the exit (Liang and Barsky 1984).
    """
    start = np.array([x_deg, y_deg])
    low = np.array([[box.west_deg], [box.south_deg]])
    high = np.array([[box.east_deg], [box.north_deg]])
    delta = np.diff(start, append=np.nan)
    with np.errstate(divide="ignore", invalid="ignore"):
        to_low, to_high = (low - start) / delta, (high - start) / delta
    near, far = np.minimum(to_low, to_high), np.maximum(to_low, to_high)
    level = delta == 0  # along a border: within it all the way, or never
    if level.any():
        near[level] = np.where((low <= start) & (start <= high), -np.inf, np.inf)[level]
        far[level] = np.inf
    return np.maximum(near.max(axis=0), 0.0), np.minimum(far.min(axis=0), 1.0)


def _without_repetition(ids: tuple[int, ...]) -> tuple[int, ...]:
    """Return ``ids`` without the same node twice in a row."""
    if len(set(ids)) == len(ids):
        return ids
    return ids[:1] + tuple(b for a, b in pairwise(ids) if a != b)


# --- joining ---------------------------------------------------------------------------------------------------------
def neighbours(first: Ways, others: Sequence[Ways]) -> list[int]:
    """Return the numbers of the other files that neighbour ``first``, directly or through each other.

    >>> west = {1: RawWay(1, np.array([1, 2, 3]), np.array([0.0, 0.1, 0.2]), np.zeros(3), {})}
    >>> east = {2: RawWay(2, np.array([3, 4, 5]), np.array([0.2, 0.3, 0.4]), np.zeros(3), {})}
    >>> far = {3: RawWay(3, np.array([6, 7]), np.array([5.0, 5.1]), np.zeros(2), {})}
    >>> neighbours(west, [far, east])
    [1]
    """
    near, found = [_places(first)], []
    left = {number: _places(ways) for number, ways in enumerate(others)}
    while joined := [number for number, places in left.items() if any(_meet(each, places) for each in near)]:
        near += [left.pop(number) for number in joined]
        found += joined
    return sorted(found)


def join_ways(parts: Iterable[Ways]) -> dict[int, RawWay]:
    """Return the ways of several files; of a way in several files, the most complete version."""
    ways: dict[int, RawWay] = {}
    for part in parts:
        for way_id, way in part.items():
            ways[way_id] = _completed(ways[way_id], way) if way_id in ways else way
    return ways


def _completed(way: RawWay, other: RawWay) -> RawWay:
    if not np.array_equal(way.node_ids, other.node_ids):
        return max(way, other, key=lambda each: np.isfinite(each.longitudes_deg).sum())
    x_deg, y_deg = (
        np.where(np.isnan(own), more, own)
        for own, more in ((way.longitudes_deg, other.longitudes_deg), (way.latitudes_deg, other.latitudes_deg))
    )
    return way._replace(longitudes_deg=x_deg, latitudes_deg=y_deg)


def _places(ways: Ways) -> tuple[FloatArray, FloatArray]:
    """Return the located nodes by id, ascending, and their places, (n, 2)."""
    if not ways:
        return np.empty(0, np.int64), np.empty((0, 2))
    ids = np.concatenate([way.node_ids for way in ways.values()])
    places = np.concatenate([np.column_stack([way.longitudes_deg, way.latitudes_deg]) for way in ways.values()])
    is_located = np.isfinite(places[:, 0])
    ids, first = np.unique(ids[is_located], return_index=True)
    return ids, places[is_located][first]


def _meet(a: tuple[FloatArray, FloatArray], b: tuple[FloatArray, FloatArray]) -> bool:
    shared, in_a, in_b = np.intersect1d(a[0], b[0], return_indices=True)
    if not len(shared):
        return False
    same = np.abs(a[1][in_a] - b[1][in_b]).max(axis=1) <= _SAME_PLACE_DEG
    return bool(same.mean() > 0.5 and len(shared) < _SAME_GROUND * min(len(a[0]), len(b[0])))
