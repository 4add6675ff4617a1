"""Junction areas: crossings joined, streets cut back to make room for the turns.

Each street that meets a junction is an arm, which is cut back (:mod:`~trace_dag.roads.from_osm.arm_cuts`). Junctions
whose arms would be used up by the cuts become one, and so do the two crossings of a divided road with one cross street.
"""

from __future__ import annotations

import math
from collections import Counter, defaultdict
from collections.abc import Sequence
from dataclasses import dataclass, field
from typing import Final

from trace_dag.roads.from_osm.arm_cuts import LEAST_STREET_M, Cut, StreetEnd, cuts_of, end_profile, fit_cuts
from trace_dag.roads.from_osm.street_graph import Street
from trace_dag.roads.map.curves import PlanView, Point, direction_rad

# Lengths set by judgement carry what they meet in practice: measured on the 82 extracts around fatal crashes of two
# cohorts (Virginia 2023, FARS 2012 to 2016), which have 1,747 junctions, 104 of them joined of several nodes.
_JOIN_M: Final = 30.0
"""Longest street that may vanish inside a joined crossing. Judgement: of the 154 that did, half are shorter than 9 m,
99 in 100 shorter than 27 m."""
_DIVIDED_JOIN_M: Final = 35.0
"""Widest divided road, between the middles of its carriageways, whose two crossings are one. Judgement: half of the 63
found are 16 m wide, the widest 30 m."""
_LARGEST_CROSSING_M: Final = 45.0
"""Farthest apart two nodes of one crossing may be, so that car parks do not become one. Judgement: half of the joined
ones are smaller than 10 m; the largest, of 44 m, comes near it."""
_LEAST_CORNERS_M: Final = 2.6
"""Room for the corners at both ends of a street together, or its junctions are one: set so that the tightest corners
that a lane's centre may take fit in (``CORNER_RADIUS_M``)."""
_ACROSS_SINE: Final = 0.5  # a street at 30 degrees or more to a divided road crosses its median. Judgement
_OPPOSITE_COSINE: Final = -0.85  # carriageways at 148 degrees or more belong to one divided road. Judgement


@dataclass
class JunctionArea:
    """One junction: its OSM nodes, the ends of the streets that connect there, and the streets inside it."""

    node_ids: list[int]
    ends: list[StreetEnd] = field(default_factory=list)
    inner_streets: list[int] = field(default_factory=list)


@dataclass
class Layout:
    """All junctions, and the cuts of each street at its start and end (0 at dead ends), metres."""

    junctions: list[JunctionArea]
    trims: list[tuple[float, float]]  # per street: at its start, at its end
    inner: set[int]

    def returning(self) -> set[int]:
        """Return streets that begin and end at the same junction."""
        return {
            street
            for junction in self.junctions
            for street, ends in Counter(end.street for end in junction.ends).items()
            if ends == 2
        }


def lay_out(streets: Sequence[Street], plans: Sequence[PlanView]) -> Layout:
    """Group junction nodes into junctions and find the cuts.

    >>> len(lay_out(street_graph.streets, plans).junctions)
    18
    """
    crossings = _Crossings(streets, plans)
    crossings.join_divided_roads()
    crossings.cut_back_and_join()
    return crossings.layout()


class _Crossings:
    """Junction nodes grouped into crossings, with the cuts of their arms.

    Each depends on the other: if the cuts at a street's two ends use it up, its two crossings become one, which has
    more arms.
    """

    def __init__(self, streets: Sequence[Street], plans: Sequence[PlanView]) -> None:
        self._streets = streets
        self._plans = plans
        self._ends: dict[int, list[StreetEnd]] = defaultdict(list)  # by node
        self._positions: dict[int, Point] = {}
        for index, street in enumerate(streets):
            for end, node in zip(_both_ends(index), (street.start_node, street.end_node), strict=True):
                if node is not None:
                    self._ends[node].append(end)
                    self._positions[node] = street.points[0 if end.at_start else -1]
        self._joined_to = {node: node for node in self._ends}
        self._inner: set[int] = set()
        self._cuts = {end: Cut(0.0, 0.0) for index in range(len(streets)) for end in _both_ends(index)}

    def join_divided_roads(self) -> None:
        """Join the two crossings that a divided road has with one cross street."""
        for index in _divided_crossings(self._streets, self._plans, self._ends):
            a, b = self._roots(index)
            self._joined_to[b] = a

    def cut_back_and_join(self) -> None:
        """Cut arms back and join crossings whose street is used up by the cuts, until no more are joined."""
        changed = {self._root(node) for node in self._ends}
        while changed:
            nodes_of: dict[int, list[int]] = defaultdict(list)
            for node in self._ends:
                nodes_of[self._root(node)].append(node)
            self._inner.update(index for index in range(len(self._streets)) if self._is_inside(index))
            for root in changed:
                self._cut_back([end for node in nodes_of[root] for end in self._ends[node]])
            changed = self._join_used_up(nodes_of)

    def layout(self) -> Layout:
        """Return the crossings as junctions, and each street's cuts as far as there is room."""
        areas: dict[int, JunctionArea] = {}
        for node, ends in self._ends.items():
            area = areas.setdefault(self._root(node), JunctionArea([]))
            area.node_ids.append(node)
            area.ends.extend(end for end in ends if end.street not in self._inner and self._cuts[end].wanted_m > 0.0)
        for index in sorted(self._inner):
            areas[self._roots(index)[0]].inner_streets.append(index)
        trims = [
            fit_cuts(plan.length_m, *(self._cuts[end] for end in _both_ends(index)))
            for index, plan in enumerate(self._plans)
        ]
        return Layout(list(areas.values()), trims, self._inner)

    def _root(self, node: int) -> int:
        """Return the node that represents a node's crossing."""
        joined_to = self._joined_to
        while joined_to[node] != node:
            joined_to[node] = joined_to[joined_to[node]]
            node = joined_to[node]
        return node

    def _roots(self, index: int) -> tuple[int, int]:
        """Return the crossings at the two ends of a street between crossings."""
        street = self._streets[index]
        assert street.start_node is not None
        assert street.end_node is not None
        return self._root(street.start_node), self._root(street.end_node)

    def _is_between_nodes(self, index: int) -> bool:
        street = self._streets[index]
        return street.start_node is not None and street.end_node is not None

    def _is_inside(self, index: int) -> bool:
        """Return whether a street lies within one crossing."""
        street = self._streets[index]
        if not self._is_between_nodes(index) or street.start_node == street.end_node:
            return False
        a, b = self._roots(index)
        return a == b and self._plans[index].length_m <= _DIVIDED_JOIN_M

    def _cut_back(self, ends: Sequence[StreetEnd]) -> None:
        """Cut back the arms of one crossing; streets without traffic to or from the other arms stay whole."""
        arms = [end for end in ends if end.street not in self._inner]
        self._cuts.update((end, Cut(0.0, 0.0)) for end in arms)
        arms = [end for end in arms if _connects(end, arms, self._streets)]
        self._cuts.update(zip(arms, cuts_of(arms, self._streets, self._plans, self._crossovers(ends)), strict=True))

    def _crossovers(self, ends: Sequence[StreetEnd]) -> dict[StreetEnd, StreetEnd]:
        """Return, for each carriageway end that meets nothing else, the end of the street across the median there."""
        found: dict[StreetEnd, StreetEnd] = {}
        for inner in (end for end in ends if end.street in self._inner):
            street = self._streets[inner.street]
            node = street.start_node if inner.at_start else street.end_node
            arms = [end for end in self._ends[node] if end != inner] if node is not None else []
            if len(arms) == 2 and all(
                end.street not in self._inner and end_profile(self._streets[end.street], end.at_start).oneway
                for end in arms
            ):
                found |= dict.fromkeys(arms, inner)
        return found

    def _join_used_up(self, nodes_of: dict[int, list[int]]) -> set[int]:
        """Join crossings whose street has no room for the corners at both ends; return the joined crossings."""
        joined = set()
        for index in range(len(self._streets)):
            if index in self._inner or not self._is_between_nodes(index):
                continue
            a, b = self._roots(index)
            if a != b and self._is_used_up(index) and self._is_compact(nodes_of[a] + nodes_of[b]):
                self._joined_to[b] = a
                nodes_of[a] += nodes_of.pop(b)
                joined.add(a)
        return {self._root(node) for node in joined}

    def _is_used_up(self, index: int) -> bool:
        """Return whether too little of a street is left between its cuts; False for streets of roundabouts."""
        length_m = self._plans[index].length_m
        if length_m > _JOIN_M or self._streets[index].spans[0].profile.roundabout:
            return False
        cut_m = math.fsum(self._cuts[end].clear_m for end in _both_ends(index))
        return cut_m + _LEAST_CORNERS_M + LEAST_STREET_M > length_m

    def _is_compact(self, nodes: Sequence[int]) -> bool:
        """Return whether a joined crossing would still be small enough for one crossing."""
        xs, ys = zip(*(self._positions[node] for node in nodes), strict=True)
        return math.hypot(max(xs) - min(xs), max(ys) - min(ys)) <= _LARGEST_CROSSING_M


def _both_ends(street: int) -> tuple[StreetEnd, StreetEnd]:
    return StreetEnd(street, True), StreetEnd(street, False)


def _divided_crossings(
    streets: Sequence[Street], plans: Sequence[PlanView], nodes: dict[int, list[StreetEnd]]
) -> list[int]:
    """Return streets across the median of a divided road, with opposite one-ways of one name at their ends."""
    through: dict[int, list[tuple[tuple[str, ...], str, float]]] = {}
    for node, ends in nodes.items():
        through[node] = []
        for end in ends:
            profile = end_profile(streets[end.street], end.at_start)
            if profile.oneway and not profile.roundabout and not profile.is_link:
                through[node].append((profile.names, profile.highway, _bearing(streets[end.street], end.at_start)))
    found = []
    for index, street in enumerate(streets):
        a, b = street.start_node, street.end_node
        if a is None or b is None or a == b or plans[index].length_m > _DIVIDED_JOIN_M:
            continue
        if street.spans[0].profile.roundabout:
            continue
        across = _bearing(street, True)
        for names, highway, bearing in through[a]:
            if math.sin(across - bearing) < _ACROSS_SINE:  # along, not across, or to its right
                continue
            if any(
                other_highway == highway
                and (names == other_names)
                and math.cos(bearing - other_bearing) < _OPPOSITE_COSINE
                for other_names, other_highway, other_bearing in through[b]
            ):
                found.append(index)
                break
    return found


def _bearing(street: Street, at_start: bool) -> float:
    """Return the direction of travel at one end of a street."""
    return direction_rad(*(street.points[:2] if at_start else street.points[-2:]))


def _connects(end: StreetEnd, ends: Sequence[StreetEnd], streets: Sequence[Street]) -> bool:
    """Return whether traffic can go between one arm of a junction and another arm."""
    enters, leaves = _directions(end, streets)
    return any(
        (enters and other_leaves) or (leaves and other_enters)
        for other in ends
        if other != end
        for other_enters, other_leaves in (_directions(other, streets),)
    )


def _directions(end: StreetEnd, streets: Sequence[Street]) -> tuple[bool, bool]:
    """Return whether traffic enters the junction from a street's end, and whether it leaves there."""
    oneway = end_profile(streets[end.street], end.at_start).oneway
    return not (oneway and end.at_start), not (oneway and not end.at_start)
