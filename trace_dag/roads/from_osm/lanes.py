"""Lane sections of a street: the continuation of lanes, and the change of widths and offsets in between.

If one way continues another with other lanes, the new lanes open and the ending ones close over a taper, so that every
lane border is continuous in position and direction. The boundary between two sections has only the lanes that match, at
widths that fit both sides. A section goes from the widths at its start over its full cross-section to the widths at its
end.

Lane markings have a shape, a colour and permitted lane changes. They follow the US Manual on Uniform Traffic Control
Devices (MUTCD), chapter 3B. A ``LEGAL`` mark is the one required by law where the map for reconstruction has another,
since drivers in crashes cross centre lines and edges.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from itertools import pairwise, takewhile
from typing import Final, NamedTuple

from trace_dag.roads.from_osm.tags import CrossSection, LaneSpec, WayProfile, only_left
from trace_dag.roads.map.model import Cubic, Lane, LaneSection, LaneType, RoadMark

_SAME_M: Final = 1e-9
_TAPER_RATIO: Final = 4.0  # a taper is at least this many times as long as lanes shift sideways
BROKEN: Final = RoadMark("broken", "white", "both")
EDGE: Final = RoadMark("solid", "white", "both")
LEGAL_EDGE: Final = RoadMark("solid", "white", "none")
YELLOW_BROKEN: Final = RoadMark("broken", "yellow", "both")
LEGAL_CENTRE_TURN: Final = RoadMark("solid broken", "yellow", "both")
YELLOW_DOUBLE: Final = RoadMark("solid solid", "yellow", "none")
YELLOW_EDGE: Final = RoadMark("solid", "yellow", "none")
UNMARKED: Final = RoadMark("none", "standard", "both")
NOT_CROSSED: Final = RoadMark("none", "standard", "none")
"""Nothing is painted, and nobody changes lanes: beside sidewalks."""


class Stretch(NamedTuple):
    """Part of a street with one cross-section, from ``begin_m`` to ``end_m`` along the street."""

    profile: WayProfile
    begin_m: float
    end_m: float


class EndLane(NamedTuple):
    """A lane where its road ends: its borders left and right of the reference line (metres, left positive)."""

    id: int
    type: LaneType
    left_m: float
    right_m: float
    turns: tuple[str, ...]
    speed_mps: float | None

    @property
    def centre_m(self) -> float:
        """Return its centre, metres left of the reference line."""
        return (self.left_m + self.right_m) / 2

    @property
    def width_m(self) -> float:
        """Return its width, metres."""
        return self.left_m - self.right_m


class _Matched(NamedTuple):
    """A lane that continues across a boundary: its index before and after, and its width there."""

    before: int
    after: int
    width_m: float


_Side = list[_Matched]


class _Boundary(NamedTuple):
    """State between two stretches: the continuing lanes of each side, and the offset of the centre line."""

    left: _Side
    right: _Side
    offset_m: float


@dataclass(frozen=True)
class SectionLanes:
    """One stretch with its lanes built: ``offset`` holds the lane offset, ``s_m`` counted from the stretch's begin.

    ``start`` and ``end`` are the lanes at the two ends, left to right, without lanes of zero width.
    """

    stretch: Stretch
    lanes: tuple[Lane, ...]
    offset: tuple[Cubic, ...]
    start: tuple[EndLane, ...]
    end: tuple[EndLane, ...]

    def section(self, s_m: float) -> LaneSection:
        """Return the lanes as a lane section that begins at ``s_m`` of its road."""
        return LaneSection(s_m, self.lanes)


def build_sections(stretches: Sequence[Stretch]) -> list[SectionLanes]:
    """Return lanes of consecutive stretches of one street, linked to each other (predecessor and successor ids).

    >>> from trace_dag.osm.types import OsmWay
    >>> from trace_dag.roads.from_osm.tags import read_profile
    >>> profile = read_profile(OsmWay(1, (1, 2), {"highway": "secondary", "lanes": "4"}))
    >>> (section,) = build_sections([Stretch(profile, 0.0, 50.0)])
    >>> [lane.id for lane in section.start]  # from left to right
    [2, 1, -1, -2]
    """
    boundaries: list[_Boundary | None] = [None]
    for before, after in pairwise(stretches):
        boundaries.append(_boundary(before.profile.section, after.profile.section))
    boundaries.append(None)
    return [_build(stretch, boundaries[index], boundaries[index + 1]) for index, stretch in enumerate(stretches)]


def _boundary(before: CrossSection, after: CrossSection) -> _Boundary:
    right = _match(before.forward, after.forward, towards_end=True)
    backward = _match(before.backward, after.backward, towards_end=False)
    first, second = (0 if before.centre is None else 1), (0 if after.centre is None else 1)
    left = [(i + first, j + second) for i, j in backward]
    if before.centre and after.centre and before.centre.type == after.centre.type:
        left.insert(0, (0, 0))
    closes = len(right) < len(before.forward) or len(left) < len(before.left)
    opens = len(right) < len(after.forward) or len(left) < len(after.left)

    def side(pairs: list[tuple[int, int]], olds: Sequence[LaneSpec], news: Sequence[LaneSpec]) -> _Side:
        # The side with fewer lanes has them at full width at the boundary.
        return [_Matched(i, j, news[j].width_m if closes else olds[i].width_m) for i, j in pairs]

    right_side, left_side = side(right, before.forward, after.forward), side(left, before.left, after.left)
    if closes and opens:
        drivable_right = math.fsum(lane.width_m for lane in right_side if before.forward[lane.before].type.drivable)
        drivable_left = math.fsum(lane.width_m for lane in left_side if before.left[lane.before].type.drivable)
        offset = (drivable_right - drivable_left) / 2
    else:
        offset = after.offset_m if closes else before.offset_m
    return _Boundary(left_side, right_side, offset)


def _match(before: Sequence[LaneSpec], after: Sequence[LaneSpec], *, towards_end: bool) -> list[tuple[int, int]]:
    """Match lanes before a boundary with lanes after it; both lists run from the centre outwards.

    ``towards_end``: traffic of this side drives from ``before`` to ``after``. Lanes are added and dropped at the outer
    edge unless the painted turns show a change at the centre.
    """
    old = [i for i, lane in enumerate(before) if lane.type.drivable]
    new = [j for j, lane in enumerate(after) if lane.type.drivable]
    surplus = len(new) - len(old)
    if surplus > 0:
        inner = min(_inner_extra(after, new, before, old, ending=not towards_end), surplus)
        pairs = [(i, new[k + inner]) for k, i in enumerate(old)]
    else:
        inner = min(_inner_extra(before, old, after, new, ending=towards_end), -surplus)
        pairs = [(old[k + inner], j) for k, j in enumerate(new)]
    for kind in (LaneType.SHOULDER, LaneType.PARKING):
        old_k = [i for i, lane in enumerate(before) if lane.type == kind]
        new_k = [j for j, lane in enumerate(after) if lane.type == kind]
        pairs.extend(zip(old_k, new_k, strict=False))
    return sorted(pairs)


def _inner_extra(
    many: Sequence[LaneSpec],
    drivable: Sequence[int],
    few: Sequence[LaneSpec],
    few_drivable: Sequence[int],
    *,
    ending: bool,
) -> int:
    """Return the number of lanes next to the centre that only ``many`` has: left-turn pockets, lanes merging right."""

    def is_inner(turns: tuple[str, ...]) -> bool:
        return only_left(turns) or (ending and "merge_to_right" in turns)

    inner = list(takewhile(lambda index: is_inner(many[index].turns), drivable))
    on_both_sides = list(takewhile(lambda index: only_left(few[index].turns), few_drivable))
    return max(len(inner) - len(on_both_sides), 0)


def _taper_m(profile: WayProfile, shift_m: float) -> float:
    """Return the length over which lanes shift by ``shift_m``; 0 without a shift."""
    if shift_m <= _SAME_M:
        return 0.0
    return max({0: 60.0, 1: 60.0, 2: 25.0, 3: 25.0}.get(profile.rank, 15.0), _TAPER_RATIO * shift_m)


def _build(stretch: Stretch, start: _Boundary | None, end: _Boundary | None) -> SectionLanes:
    section = stretch.profile.section
    length = stretch.end_m - stretch.begin_m
    left, right = section.left, section.forward
    left_start, left_before = _state(left, start.left if start else None, second=True)
    right_start, right_before = _state(right, start.right if start else None, second=True)
    left_end, left_after = _state(left, end.left if end else None, second=False)
    right_end, right_after = _state(right, end.right if end else None, second=False)
    offset_start = start.offset_m if start else section.offset_m
    offset_end = end.offset_m if end else section.offset_m
    taper_in = _taper_m(stretch.profile, _shift(section, left_start, right_start, offset_start))
    taper_out = _taper_m(stretch.profile, _shift(section, left_end, right_end, offset_end))
    if taper_in + taper_out > length:
        scale = length / (taper_in + taper_out)
        taper_in, taper_out = taper_in * scale, taper_out * scale

    def side(
        specs: Sequence[LaneSpec],
        first: list[float],
        last: list[float],
        before: dict[int, int],
        after: dict[int, int],
        sign: int,
    ) -> list[Lane]:
        lanes = []
        forward = sign < 0
        for index, spec in enumerate(specs):
            outermost = index == len(specs) - 1
            profile = stretch.profile
            speed = profile.speed_forward_mps if forward else profile.speed_backward_mps
            mark, legal = _marks(specs, index, outermost, sign)
            lanes.append(
                Lane(
                    id=sign * (index + 1),
                    type=spec.type,
                    widths=_profile(first[index], spec.width_m, last[index], taper_in, taper_out, length),
                    predecessor=sign * (before[index] + 1) if index in before else None,
                    successor=sign * (after[index] + 1) if index in after else None,
                    mark=mark,
                    legal_mark=legal,
                    speed_mps=(spec.speed_mps or speed) if spec.type.drivable else None,
                    turns=spec.turns,
                    bus=spec.bus,
                )
            )
        return lanes

    left_lanes = side(left, left_start, left_end, left_before, left_after, 1)
    right_lanes = side(right, right_start, right_end, right_before, right_after, -1)
    centre_mark, centre_legal = _centre_marks(stretch.profile)
    centre = Lane(0, LaneType.NONE, (), mark=centre_mark, legal_mark=centre_legal)
    lanes = (*reversed(left_lanes), centre, *right_lanes)
    return SectionLanes(
        stretch,
        lanes,
        _profile(offset_start, section.offset_m, offset_end, taper_in, taper_out, length),
        _end_lanes(left_lanes, right_lanes, left_start, right_start, offset_start),
        _end_lanes(left_lanes, right_lanes, left_end, right_end, offset_end),
    )


def _state(specs: Sequence[LaneSpec], side: _Side | None, *, second: bool) -> tuple[list[float], dict[int, int]]:
    """Return lane widths at a boundary of stretches, and each continuing lane's index beyond the boundary."""
    if side is None:
        return [spec.width_m for spec in specs], {}
    state = [0.0] * len(specs)
    others: dict[int, int] = {}
    for before, after, width in side:
        mine, other = (after, before) if second else (before, after)
        state[mine] = width
        others[mine] = other
    return state, others


def _shift(section: CrossSection, left: Sequence[float], right: Sequence[float], offset: float) -> float:
    """Return the largest shift (metres) of a lane border from its place in the full cross-section."""
    most = moved = abs(offset - section.offset_m)
    for specs, widths, sign in ((section.left, left, 1), (section.forward, right, -1)):
        border = sign * (offset - section.offset_m)
        for spec, width in zip(specs, widths, strict=True):
            border += width - spec.width_m
            moved = max(moved, abs(width - spec.width_m))
            most = max(most, abs(border), moved)
    return most


def _profile(
    start: float, middle: float, end: float, taper_in: float, taper_out: float, length: float
) -> tuple[Cubic, ...]:
    """Return cubics from ``start`` over ``middle`` to ``end`` with slope 0 at both ends.

    Their ``s`` begins with the stretch.
    """
    cubics: list[Cubic] = []
    if abs(start - middle) > _SAME_M:
        cubics.append(Cubic.between(0.0, start, middle, taper_in))
        if length - taper_in > 1e-6:
            cubics.append(Cubic(taper_in, middle))
    else:
        cubics.append(Cubic(0.0, middle))
    if abs(end - middle) > _SAME_M:
        if length - taper_out < cubics[-1].s_m + 1e-6:
            cubics.pop()
        cubics.append(Cubic.between(max(length - taper_out, 0.0), middle, end, taper_out))
    return tuple(cubics)


def _end_lanes(
    left: Sequence[Lane],
    right: Sequence[Lane],
    left_widths: Sequence[float],
    right_widths: Sequence[float],
    offset: float,
) -> tuple[EndLane, ...]:
    found: list[EndLane] = []
    for lanes, widths, sign in ((left, left_widths, 1), (right, right_widths, -1)):
        inner = offset
        for lane, width in zip(lanes, widths, strict=True):
            outer = inner + sign * width
            if width > _SAME_M:
                borders = max(inner, outer), min(inner, outer)
                found.append(EndLane(lane.id, lane.type, *borders, lane.turns, lane.speed_mps))
            inner = outer
    return tuple(sorted(found, key=lambda lane: -lane.id))


def _marks(specs: Sequence[LaneSpec], index: int, outermost: bool, sign: int) -> tuple[RoadMark, RoadMark | None]:
    """Return the mark of a lane's outer border: as written for reconstruction, and the legal one if different.

    After the US Manual on Uniform Traffic Control Devices (MUTCD), chapter 3B, and ``change:lanes``. ``sign`` is that
    of the lanes' ids.
    """
    if outermost or not specs[index + 1].type.drivable:
        return EDGE, LEGAL_EDGE
    if specs[index].type == LaneType.BIDIRECTIONAL:
        return YELLOW_BROKEN, LEGAL_CENTRE_TURN
    if specs[index].type == LaneType.MEDIAN:
        return YELLOW_BROKEN, YELLOW_DOUBLE
    outward = specs[index].change not in ("no", "not_right")
    inward = specs[index + 1].change not in ("no", "not_left")
    return BROKEN, None if outward and inward else lane_line(outward=outward, inward=inward, left=sign > 0)


def _centre_marks(profile: WayProfile) -> tuple[RoadMark, RoadMark]:
    if profile.oneway:
        return YELLOW_BROKEN, YELLOW_EDGE
    centre = profile.section.centre
    if centre is not None and centre.type == LaneType.BIDIRECTIONAL:
        return YELLOW_BROKEN, LEGAL_CENTRE_TURN
    if profile.rank >= 5:  # unclassified, residential, service: commonly unmarked
        return YELLOW_BROKEN, UNMARKED
    return YELLOW_BROKEN, YELLOW_DOUBLE


def lane_line(*, outward: bool, inward: bool, left: bool) -> RoadMark:
    """Return the line between two lanes of one direction that may be crossed ``outward``, ``inward``, or not at all.

    OpenDRIVE orders its parts from the inner to the outer lane. It names the directions of crossing by the ids of the
    lanes, which grow outward on the ``left`` of the road.

    >>> lane_line(outward=True, inward=False, left=True)
    RoadMark(type='broken solid', colour='white', lane_change='increase')
    """
    if not outward and not inward:
        return LEGAL_EDGE
    kind = "broken solid" if outward else "solid broken"
    return RoadMark(kind, "white", "increase" if outward == left else "decrease")
