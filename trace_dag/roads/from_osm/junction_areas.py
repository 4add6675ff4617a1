"""Where junctions are and how far they reach: crossings joined, streets cut back to make room for the turns.

Each street that meets a junction is an arm. It is cut back to where its carriageway is clear of every other arm's,
plus room for the corner. Junctions whose arms would be used up that way, and the two crossings a divided road makes
with one cross street, become one.
"""

from __future__ import annotations

import math
from collections import Counter, defaultdict
from collections.abc import Sequence
from dataclasses import dataclass, field
from itertools import pairwise
from typing import Final, NamedTuple

from trace_dag.roads.from_osm.street_graph import Street
from trace_dag.roads.from_osm.tags import CrossSection, WayProfile
from trace_dag.roads.from_osm.turn_curves import CORNER_RADIUS_M, TIGHTEST_RADIUS_M
from trace_dag.roads.map.curves import PlanView, Point

# Lengths set by judgement carry what they meet in practice: measured on the 82 extracts around fatal crashes of two
# cohorts (Virginia 2023, FARS 2012 to 2016), which have 1,747 junctions, 104 of them joined of several nodes.
_REACH_M: Final = 45.0
"""Judgement. Arms that still overlap beyond it (ramps along a motorway) are left overlapping: 25 pairs of 14,736. Half
of all cuts are shorter than 5.5 m, 99 in 100 shorter than 19 m."""
_JOIN_M: Final = 30.0
"""Longest street that may vanish inside a joined crossing. Judgement: of the 154 that did, half are shorter than 9 m,
99 in 100 shorter than 27 m."""
_DIVIDED_JOIN_M: Final = 35.0
"""Widest divided road, between the middles of its carriageways, whose two crossings are one. Judgement: half of the 63
found are 16 m wide, the widest 30 m."""
_LARGEST_CROSSING_M: Final = 45.0
"""Farthest apart two nodes of one crossing may be, so that car parks do not become one. Judgement: half of the joined
ones are smaller than 10 m; the largest, of 44 m, comes near it."""
_GAP_M: Final = 5.0  # an arm counts as clear once it has been clear over this length, about a car's. Judgement
_OVERLAP_M: Final = 0.5  # overlap of carriageways that still counts as clear: lanes are wider than cars. Judgement
_LEAST_STREET_M: Final = 1.0  # what must remain of a street between two junctions. Judgement
_LEAST_CORNERS_M: Final = 2.6
"""Room for the corners at both ends of a street together, or its junctions are one: set so that the tightest corners
that a lane's centre may take fit in (``CORNER_RADIUS_M``)."""
_CORNER_M: Final = {True: 3.0, False: 5.0}
"""Room for the corner where a service road is one of the two, and else. Judgement."""
_MAJOR_CORNER_M: Final = 6.5  # the same where both are secondary roads or greater. Judgement
_EDGE_LANE_M: Final = 1.3  # from the edge of a road to the middle of its outer lane, at least: half a narrow lane
_CORNER_RAD: Final = (0.6, 2.6)  # 34 to 149 degrees between arms: they form a corner; beyond, one continues the other
_ACROSS_SINE: Final = 0.5  # a street at 30 degrees or more to a divided road crosses its median. Judgement
_OPPOSITE_COSINE: Final = -0.85  # carriageways at 148 degrees or more belong to one divided road. Judgement
_PARALLEL_RAD: Final = 0.12  # 7 degrees: carriageways of a divided road, not a fork. Judgement
_FORK_M: Final = 20.0  # farthest that the fork of a divided road is cut back. Judgement
_HAIRPIN_RAD: Final = 0.6  # 34 degrees between its sides. Judgement
_HAIRPIN_CUT_M: Final = 2.5  # the point of a hairpin stays where mappers put it, even if its sides overlap. Judgement
_FOLD_DEVIATION_M: Final = 2.9  # farthest that the curve of a fold passes from its point. Judgement
_SHIFT_RATIO: Final = 2.0  # room ahead and behind for lanes that shift sideways, per metre of shift. Judgement


class StreetEnd(NamedTuple):
    """One end of a street: ``at_start`` is its first point."""

    street: int
    at_start: bool


@dataclass
class JunctionArea:
    """One junction: its OSM nodes, the ends of the streets that connect there, and the streets inside it."""

    node_ids: list[int]
    ends: list[StreetEnd] = field(default_factory=list)
    inner_streets: list[int] = field(default_factory=list)


@dataclass
class Layout:
    """All junctions, and by how much each street is cut back at its start and end (0 at dead ends), metres."""

    junctions: list[JunctionArea]
    trims: list[tuple[float, float]]  # per street: at its start, at its end
    inner: set[int]

    def returning(self) -> set[int]:
        """Streets that begin and end at the same junction."""
        return {
            street
            for junction in self.junctions
            for street, ends in Counter(end.street for end in junction.ends).items()
            if ends == 2
        }


class _Cut(NamedTuple):
    """How much of an arm to cut off: to be clear of the other arms, and to leave room for the corners as well."""

    clear_m: float
    wanted_m: float


def end_profile(street: Street, at_start: bool) -> WayProfile:
    """Profile of the street where it ends, in the street's direction."""
    return (street.spans[0] if at_start else street.spans[-1]).profile


def _extents(section: CrossSection) -> tuple[float, float]:
    """How far the road reaches left and right of the way's geometry."""
    left = section.offset_m + sum(lane.width_m for lane in section.left)
    right = -section.offset_m + sum(lane.width_m for lane in section.forward)
    return left, right


def _inner_borders(section: CrossSection) -> tuple[float | None, float | None]:
    """Left border of the lanes along the way and of those against it, left of the geometry as they are driven."""
    centre_m = section.centre.width_m if section.centre else 0.0
    return (section.offset_m if section.forward else None, -section.offset_m - centre_m if section.backward else None)


def lay_out(streets: Sequence[Street], plans: Sequence[PlanView]) -> Layout:
    """Group junction nodes into junctions and find the cuts."""
    crossings = _Crossings(streets, plans)
    crossings.join_divided_roads()
    crossings.cut_back_and_join()
    return crossings.layout()


class _Crossings:
    """Junction nodes grouped into crossings, and how far each crossing cuts its arms back.

    Each depends on the other: if the cuts at a street's two ends use it up, its two crossings become one, and that one
    has other arms to be clear of.
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
        self._cuts = {end: _Cut(0.0, 0.0) for index in range(len(streets)) for end in _both_ends(index)}

    def join_divided_roads(self) -> None:
        """Join the two crossings that a divided road has with one cross street."""
        for index in _divided_crossings(self._streets, self._plans, self._ends):
            a, b = self._roots(index)
            self._joined_to[b] = a

    def cut_back_and_join(self) -> None:
        """Cut arms back and join crossings whose street is used up by that; repeat until no more are joined."""
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
        """The crossings as junctions, and each street's cuts as far as there is room for them."""
        areas: dict[int, JunctionArea] = {}
        for node, ends in self._ends.items():
            area = areas.setdefault(self._root(node), JunctionArea([]))
            area.node_ids.append(node)
            area.ends.extend(end for end in ends if end.street not in self._inner and self._cuts[end].wanted_m > 0.0)
        for index in sorted(self._inner):
            areas[self._roots(index)[0]].inner_streets.append(index)
        trims = [
            _fit_cuts(plan.length_m, *(self._cuts[end] for end in _both_ends(index)))
            for index, plan in enumerate(self._plans)
        ]
        return Layout(list(areas.values()), trims, self._inner)

    def _root(self, node: int) -> int:
        """The node that stands for the crossing a node belongs to."""
        joined_to = self._joined_to
        while joined_to[node] != node:
            joined_to[node] = joined_to[joined_to[node]]
            node = joined_to[node]
        return node

    def _roots(self, index: int) -> tuple[int, int]:
        """The crossings at the two ends of a street that has one at either."""
        street = self._streets[index]
        assert street.start_node is not None
        assert street.end_node is not None
        return self._root(street.start_node), self._root(street.end_node)

    def _is_between_nodes(self, index: int) -> bool:
        street = self._streets[index]
        return street.start_node is not None and street.end_node is not None

    def _is_inside(self, index: int) -> bool:
        """Whether a street lies within one crossing."""
        street = self._streets[index]
        if not self._is_between_nodes(index) or street.start_node == street.end_node:
            return False
        a, b = self._roots(index)
        return a == b and self._plans[index].length_m <= _DIVIDED_JOIN_M

    def _cut_back(self, ends: Sequence[StreetEnd]) -> None:
        """Cut back the arms of one crossing; streets on which no traffic enters or leaves it stay whole."""
        arms = [end for end in ends if end.street not in self._inner]
        self._cuts.update((end, _Cut(0.0, 0.0)) for end in arms)
        arms = [end for end in arms if _connects(end, arms, self._streets)]
        self._cuts.update(zip(arms, _cuts(arms, self._streets, self._plans), strict=True))

    def _join_used_up(self, nodes_of: dict[int, list[int]]) -> set[int]:
        """Join crossings whose street has no room for the corners at both its ends. Returns the joined crossings."""
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
        """Whether too little of a street is left between its cuts; never true for streets of roundabouts."""
        length_m = self._plans[index].length_m
        if length_m > _JOIN_M or self._streets[index].spans[0].profile.roundabout:
            return False
        cut_m = sum(self._cuts[end].clear_m for end in _both_ends(index))
        return cut_m + _LEAST_CORNERS_M + _LEAST_STREET_M > length_m

    def _is_compact(self, nodes: Sequence[int]) -> bool:
        """Whether a joined crossing would still be small enough for one crossing."""
        xs, ys = zip(*(self._positions[node] for node in nodes), strict=True)
        return math.hypot(max(xs) - min(xs), max(ys) - min(ys)) <= _LARGEST_CROSSING_M


def _both_ends(street: int) -> tuple[StreetEnd, StreetEnd]:
    return StreetEnd(street, True), StreetEnd(street, False)


def _divided_crossings(
    streets: Sequence[Street], plans: Sequence[PlanView], nodes: dict[int, list[StreetEnd]]
) -> list[int]:
    """Streets that run across the median of a divided road: opposite one-ways of one name at their two ends."""
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
            if abs(math.sin(bearing - across)) < _ACROSS_SINE:  # along, not across
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
    """Direction of travel at one end of a street."""
    (x0, y0), (x1, y1) = street.points[:2] if at_start else street.points[-2:]
    return math.atan2(y1 - y0, x1 - x0)


class _Strip:
    """The ground an arm covers near its junction: its first segments, outwards, with its extents."""

    def __init__(self, street: Street, at_start: bool, reach_m: float) -> None:
        profile = end_profile(street, at_start)
        left, right = _extents(profile.section)
        self.left, self.right = (left, right) if at_start else (right, left)
        self.profile = profile
        forward, backward = _inner_borders(profile.section)
        self.outgoing, self.incoming = (forward, backward) if at_start else (backward, forward)
        points = street.points if at_start else street.points[::-1]
        self.segments: list[tuple[float, float, float, float, float, float]] = []
        s = 0.0
        for (x0, y0), (x1, y1) in pairwise(points):
            length = math.hypot(x1 - x0, y1 - y0)
            self.segments.append((s, x0, y0, (x1 - x0) / length, (y1 - y0) / length, length))
            s += length
            if s > reach_m:
                break
        self.heading = _chord_heading(self.segments)

    def shift_to(self, other: _Strip) -> float:
        """How far lanes shift sideways on the way to or from an opposite arm, metres.

        Either the outer edges shift, or the inner ones: where a street becomes divided, its one lane can become the two
        lanes of a carriageway that is as wide as the street was.
        """
        inner = ((self.incoming, other.outgoing), (self.outgoing, other.incoming))
        return max(
            abs(self.left - other.right),
            abs(self.right - other.left),
            *(abs(a - b) for a, b in inner if a is not None and b is not None),
        )

    def clear_of(self, other: _Strip) -> float:
        """Distance along this arm (metres) beyond which neither of its edges is on the other arm's ground.

        Ground that the arm reaches again after having been clear of it does not count.
        """
        clear = 0.0
        for s, x, y, c, n, length in self.segments:
            if s > clear + _GAP_M:
                break
            covered: list[tuple[float, float]] = []
            for edge in (self.left - _OVERLAP_M, _OVERLAP_M - self.right):
                px, py = x - edge * n, y + edge * c
                for _, ox, oy, oc, on, olength in other.segments:
                    # The part of the edge, a line in the other segment's axes, inside its rectangle.
                    dx, dy = px - ox, py - oy
                    u, v = dx * oc + dy * on, -dx * on + dy * oc
                    du, dv = c * oc + n * on, -c * on + n * oc
                    low, high = 0.0, length
                    for value, slope, least, most in (
                        (u, du, 0.0, olength),
                        (v, dv, _OVERLAP_M - other.right, other.left - _OVERLAP_M),
                    ):
                        if abs(slope) < 1e-9:
                            if not least <= value <= most:
                                high = -1.0
                            continue
                        first, second = (least - value) / slope, (most - value) / slope
                        if first > second:
                            first, second = second, first
                        low, high = max(low, first), min(high, second)
                    if high >= low:
                        covered.append((s + low, s + high))
            for low, high in sorted(covered):
                if low > clear + _GAP_M:
                    break
                clear = max(clear, high)
        return min(clear, _REACH_M)


def _chord_heading(segments: Sequence[tuple[float, float, float, float, float, float]]) -> float:
    """Direction in which the arm leaves, over its first 15 m."""
    _, x0, y0, *_ = segments[0]
    x, y = x0, y0
    for s, sx, sy, c, n, length in segments:
        along = min(length, 15.0 - s)
        if along <= 0:
            break
        x, y = sx + along * c, sy + along * n
    return math.atan2(y - y0, x - x0)


def _cuts(ends: Sequence[StreetEnd], streets: Sequence[Street], plans: Sequence[PlanView]) -> list[_Cut]:
    met = Counter(end.street for end in ends)
    strips = []
    for end in ends:
        # A street that returns to the same junction is two arms, each of them half of it.
        reach = _REACH_M + 15.0 if met[end.street] == 1 else plans[end.street].length_m / 2 - _LEAST_STREET_M
        strips.append(_Strip(streets[end.street], end.at_start, reach))
    cuts = []
    for i, strip in enumerate(strips):
        clear, wanted = 0.5, 1.0
        for j, other in enumerate(strips):
            if i == j:
                continue
            angle = _angle(strip, other)
            opposite = strip.profile.oneway and other.profile.oneway and ends[i].at_start != ends[j].at_start
            if opposite and angle < _PARALLEL_RAD:
                continue  # the carriageways of a divided road, however close they are drawn
            reach = strip.clear_of(other)
            if opposite and angle < _HAIRPIN_RAD:
                reach = min(reach, _FORK_M)
            clear = max(clear, reach)
            if _CORNER_RAD[0] < angle < _CORNER_RAD[1]:
                corner = _CORNER_M["service" in (strip.profile.highway, other.profile.highway)]
                if max(strip.profile.rank, other.profile.rank) <= 3:
                    corner = _MAJOR_CORNER_M
                reach += max(corner, (TIGHTEST_RADIUS_M - _EDGE_LANE_M) / math.tan(angle / 2))
            elif angle >= _CORNER_RAD[1]:
                shift_m = strip.shift_to(other)
                # Half the length over which lanes shifted by a cubic bend no tighter than a corner: 6 shift /
                # length**2.
                clear = max(clear, math.sqrt(6 * shift_m * CORNER_RADIUS_M) / 2)
                reach = max(reach, _SHIFT_RATIO * shift_m)
            wanted = max(wanted, reach)
        if len(strips) == 2:
            most = _longest_fold_cut_m(_angle(*strips))
            clear, wanted = min(clear, most), min(wanted, most)
        cuts.append(_Cut(clear, wanted))
    return cuts


def _longest_fold_cut_m(angle_rad: float) -> float:
    """Longest cut (metres) of both arms of a fold, ``angle_rad`` apart, at which the curve between them stays near its
    point."""
    if angle_rad < _HAIRPIN_RAD:
        return _HAIRPIN_CUT_M
    missed_per_metre = math.tan((math.pi - angle_rad) / 4)  # distance from the point to the arc, per metre of cut
    return _FOLD_DEVIATION_M / missed_per_metre if missed_per_metre > 1e-6 else math.inf


def _angle(a: _Strip, b: _Strip) -> float:
    return abs(math.remainder(a.heading - b.heading, math.tau))


def _connects(end: StreetEnd, ends: Sequence[StreetEnd], streets: Sequence[Street]) -> bool:
    """Whether traffic can enter or leave a junction's arm from or to another one."""
    enters, leaves = _directions(end, streets)
    return any(
        (enters and other_leaves) or (leaves and other_enters)
        for other in ends
        if other != end
        for other_enters, other_leaves in (_directions(other, streets),)
    )


def _directions(end: StreetEnd, streets: Sequence[Street]) -> tuple[bool, bool]:
    """Whether traffic enters the junction from a street's end, and whether it leaves by it."""
    oneway = end_profile(streets[end.street], end.at_start).oneway
    return not (oneway and end.at_start), not (oneway and not end.at_start)


def _fit_cuts(length_m: float, start: _Cut, end: _Cut) -> tuple[float, float]:
    """Both cuts of a street, shortened if the street is too short: first the room for corners, then the rest."""
    room = length_m - min(_LEAST_STREET_M, length_m / 3)
    clear, wanted = start.clear_m + end.clear_m, start.wanted_m + end.wanted_m
    if wanted <= room:
        return start.wanted_m, end.wanted_m
    if clear >= room:
        return start.clear_m * room / clear, end.clear_m * room / clear
    share = (room - clear) / (wanted - clear)
    return (
        start.clear_m + share * (start.wanted_m - start.clear_m),
        end.clear_m + share * (end.wanted_m - end.clear_m),
    )
