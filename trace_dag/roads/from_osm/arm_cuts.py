"""Cuts of a junction's arms that make room for the turns.

An arm is a street where it meets the junction. It is cut back until its carriageway is clear of every other arm's, plus
room for the corner. Does not belong here: finding the streets of a junction
(:mod:`~trace_dag.roads.from_osm.junction_areas`).
"""

from __future__ import annotations

import math
from collections import Counter
from collections.abc import Mapping, Sequence
from itertools import pairwise
from types import MappingProxyType
from typing import Final, NamedTuple

from trace_dag.roads.from_osm.street_graph import Street
from trace_dag.roads.from_osm.tags import CrossSection, WayProfile
from trace_dag.roads.from_osm.turn_curves import CORNER_RADIUS_M, TIGHTEST_RADIUS_M
from trace_dag.roads.map.curves import PlanView

# Lengths set by judgement carry what they meet in practice; what they were measured on stands in junction_areas.
_REACH_M: Final = 45.0
"""Judgement. Arms that still overlap beyond it (ramps along a motorway) are left overlapping: 25 pairs of 14,736. Half
of all cuts are shorter than 5.5 m, 99 in 100 shorter than 19 m."""
_GAP_M: Final = 5.0  # an arm counts as clear once it has been clear over this length, about a car's. Judgement
_OVERLAP_M: Final = 0.5  # overlap of carriageways that still counts as clear: lanes are wider than cars. Judgement
LEAST_STREET_M: Final = 1.0
"""Length that must remain of a street between two junctions. Judgement."""
_CORNER_M: Final = {True: 3.0, False: 5.0}
"""Room for the corner where a service road is one of the two, and else. Judgement."""
_MAJOR_CORNER_M: Final = 6.5  # the same where both are secondary roads or greater. Judgement
_EDGE_LANE_M: Final = 1.3  # from the edge of a road to the middle of its outer lane, at least: half a narrow lane
_CORNER_RAD: Final = (0.6, 2.6)  # 34 to 149 degrees between arms: they form a corner; beyond, one continues the other
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


class Cut(NamedTuple):
    """Lengths to cut off an arm: to be clear of the other arms, and to leave room for the corners as well."""

    clear_m: float
    wanted_m: float


def end_profile(street: Street, at_start: bool) -> WayProfile:
    """Return the profile of the street at one end, in the street's direction.

    >>> street = street_graph.streets[0]
    >>> end_profile(street, True) == street.spans[0].profile, end_profile(street, False) == street.spans[-1].profile
    (True, True)
    """
    return (street.spans[0] if at_start else street.spans[-1]).profile


def _extents(section: CrossSection) -> tuple[float, float]:
    """Return the extent of the road to the left and right of the way's geometry."""
    left = section.offset_m + math.fsum(lane.width_m for lane in section.left)
    right = -section.offset_m + math.fsum(lane.width_m for lane in section.forward)
    return left, right


def _inner_borders(section: CrossSection) -> tuple[float | None, float | None]:
    """Return the left borders of the lanes in both directions, left of the geometry as driven."""
    centre_m = section.centre.width_m if section.centre else 0.0
    return (section.offset_m if section.forward else None, -section.offset_m - centre_m if section.backward else None)


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
        """Return the sideways shift of lanes to or from an opposite arm, metres.

        Either the outer edges shift, or the inner ones: where a street becomes divided, its one lane can become the two
        lanes of a carriageway as wide as the street.
        """
        inner = ((self.incoming, other.outgoing), (self.outgoing, other.incoming))
        return max(
            abs(self.left - other.right),
            abs(self.right - other.left),
            *(abs(a - b) for a, b in inner if a is not None and b is not None),
        )

    def clear_of(self, other: _Strip) -> float:
        """Return the distance along this arm (metres) beyond which its edges are clear of the other arm's ground.

        Ground of the other arm that it reaches again later does not count.
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
    """Return the direction in which the arm leaves, over its first 15 m."""
    _, x0, y0, *_ = segments[0]
    x, y = x0, y0
    for s, sx, sy, c, n, length in segments:
        along = min(length, 15.0 - s)
        if along <= 0:
            break
        x, y = sx + along * c, sy + along * n
    return math.atan2(y - y0, x - x0)


def cuts_of(
    ends: Sequence[StreetEnd],
    streets: Sequence[Street],
    plans: Sequence[PlanView],
    crossovers: Mapping[StreetEnd, StreetEnd] = MappingProxyType({}),
) -> list[Cut]:
    """Return the cut of each arm of one junction, as if streets were long enough.

    ``crossovers`` has the end of a street across the median for an arm that ends there, if nothing else makes room for
    turning into it.

    >>> cuts_of([StreetEnd(0, True)], street_graph.streets, plans)  # one arm alone has none to be clear of
    [Cut(clear_m=0.5, wanted_m=1.0)]
    """
    met = Counter(end.street for end in ends)
    strips = []
    for end in ends:
        # A street that returns to the same junction is two arms, each of them half of it.
        reach = _REACH_M + 15.0 if met[end.street] == 1 else plans[end.street].length_m / 2 - LEAST_STREET_M
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
                reach += _corner_m(strip, other)
            elif angle >= _CORNER_RAD[1]:
                shift_m = strip.shift_to(other)
                # Half the length over which lanes shifted by a cubic bend no tighter than a corner: 6 shift /
                # length**2.
                clear = max(clear, math.sqrt(6 * shift_m * CORNER_RADIUS_M) / 2)
                reach = max(reach, _SHIFT_RATIO * shift_m)
            wanted = max(wanted, reach)
        if ends[i] in crossovers:
            crossover = crossovers[ends[i]]
            other = _Strip(streets[crossover.street], crossover.at_start, _REACH_M)
            reach = strip.clear_of(other)
            clear, wanted = max(clear, reach), max(wanted, reach + _corner_m(strip, other))
        if len(strips) == 2:
            most = _longest_fold_cut_m(_angle(*strips))
            clear, wanted = min(clear, most), min(wanted, most)
        cuts.append(Cut(clear, wanted))
    return cuts


def _corner_m(strip: _Strip, other: _Strip) -> float:
    """Return the room (metres) for the corner between two arms."""
    corner = _CORNER_M["service" in (strip.profile.highway, other.profile.highway)]
    if max(strip.profile.rank, other.profile.rank) <= 3:
        corner = _MAJOR_CORNER_M
    return max(corner, (TIGHTEST_RADIUS_M - _EDGE_LANE_M) / math.tan(_angle(strip, other) / 2))


def _longest_fold_cut_m(angle_rad: float) -> float:
    """Return the longest cut (metres) of both arms of a bend with which the curve stays near the bend's point.

    The arms are ``angle_rad`` apart.
    """
    if angle_rad < _HAIRPIN_RAD:
        return _HAIRPIN_CUT_M
    missed_per_metre = math.tan((math.pi - angle_rad) / 4)  # distance from the point to the arc, per metre of cut
    return _FOLD_DEVIATION_M / missed_per_metre if missed_per_metre > 1e-6 else math.inf


def _angle(a: _Strip, b: _Strip) -> float:
    return abs(math.remainder(a.heading - b.heading, math.tau))


def fit_cuts(length_m: float, start: Cut, end: Cut) -> tuple[float, float]:
    """Return both cuts of a street, shortened if the street is too short: first the room for corners, then the rest.

    >>> fit_cuts(60.0, Cut(4.0, 10.0), Cut(4.0, 6.0))
    (10.0, 6.0)
    >>> fit_cuts(12.0, Cut(4.0, 10.0), Cut(4.0, 6.0))  # 1 m of the street is left
    (6.25, 4.75)
    """
    room = length_m - min(LEAST_STREET_M, length_m / 3)
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
