"""Curves of the plan view: sequences of lines and arcs, cut, reversed, joined, and connecting poses.

Plane geometry only, on plain floats: thousands of pieces per map.

Pieces that the road model lacks are converted: spirals to arcs, cubics to ``paramPoly3``. Shapes: ASAM OpenDRIVE 1.7,
section 7.3.

Lines of constant curvature end at the chords of their arcs. The chord of an arc that turns by ``a`` is ``sin(a/2) /
(a/2)`` of its length and points ``a/2`` off its beginning; a straight line is an arc with a turn of 0.
"""

from __future__ import annotations

import math
from bisect import bisect_right
from collections.abc import Iterator, Sequence
from dataclasses import replace
from typing import TYPE_CHECKING, Final, NamedTuple

import numpy as np

from trace_dag.roads.map.model import PlanElement

if TYPE_CHECKING:
    from trace_dag.common.geometry import FloatArray

Point = tuple[float, float]

_FLAT_RAD: Final = 5e-4
_SAME_DIRECTION_RAD: Final = 1e-6
LARGEST_RADIUS_M: Final = 5000.0  # readers that use single precision, such as CARLA, lose arcs that are much flatter
_MIN_LENGTH_M: Final = 1e-6
SHORTEST_ELEMENT_M: Final = 0.1
_AROUND_SLIVER_M: Final = 1.0
_DETOUR_M: Final = 2.0
_ARC_TURN_RAD: Final = 0.005
"""Turn per arc that stands for a piece of a spiral: off the clothoid by less than a millimetre on any road."""
_STRAIGHT_RAD: Final = 1e-9  # half a turn below which chord and arc differ by less than a double can tell


def direction_rad(one: Point, other: Point) -> float:
    """Return the direction from one point to another, counter-clockwise from the x axis.

    >>> direction_rad((0.0, 0.0), (0.0, 2.0)) == math.pi / 2
    True
    """
    return math.atan2(other[1] - one[1], other[0] - one[0])


class PlanPose(NamedTuple):
    """Position (metres) and heading (radians) on a reference line."""

    x_m: float
    y_m: float
    heading_rad: float

    def beside(self, left_m: float) -> PlanPose:
        """Return the pose this far to the left, metres."""
        x, y, heading = self
        return PlanPose(x - left_m * math.sin(heading), y + left_m * math.cos(heading), heading)


class PlanView(NamedTuple):
    """Elements of a reference line, its length, and ``s_m`` of each vertex of the polyline it was fitted to."""

    elements: tuple[PlanElement, ...]
    length_m: float
    vertex_s_m: tuple[float, ...] = ()


def element_pose(element: PlanElement, ds_m: float) -> PlanPose:
    """Return the pose ``ds_m`` along one line or arc.

    >>> element_pose(PlanElement(0.0, 2.0, 3.0, 0.0, 100.0), 25.0)
    PlanPose(x_m=27.0, y_m=3.0, heading_rad=0.0)
    """
    return PlanPose(*along_arc(element.x_m, element.y_m, element.heading_rad, ds_m, element.curvature_1pm))


def plan_pose(plan: PlanView, s_m: float) -> PlanPose:
    """Return the pose at ``s_m``; the first or last element is continued beyond the ends.

    >>> plan_pose(connect(PlanPose(0.0, 0.0, 0.0), PlanPose(100.0, 0.0, 0.0)), 25.0)
    PlanPose(x_m=25.0, y_m=0.0, heading_rad=0.0)
    """
    found = plan.elements[max(bisect_right(plan.elements, s_m, key=lambda element: element.s_m) - 1, 0)]
    return element_pose(found, s_m - found.s_m)


def cut_plan(plan: PlanView, begin_m: float, end_m: float) -> PlanView:
    """Return the stretch from ``begin_m`` to ``end_m``, with ``s_m`` starting at 0 and without vertices.

    >>> cut_plan(connect(PlanPose(0.0, 0.0, 0.0), PlanPose(100.0, 0.0, 0.0)), 10.0, 30.0).length_m
    20.0
    """
    kept: list[PlanElement] = []
    for element in plan.elements:
        if element.s_m >= end_m:
            break
        first = max(begin_m, element.s_m)
        last = min(end_m, element.s_m + element.length_m)
        if last - first <= _MIN_LENGTH_M:
            continue
        pose = element_pose(element, first - element.s_m)
        kept.append(PlanElement(first - begin_m, *pose, last - first, element.curvature_1pm))
    return PlanView(tuple(kept), end_m - begin_m)


def reverse_plan(plan: PlanView) -> PlanView:
    """Return the same line, beginning at its end.

    >>> plan_pose(reverse_plan(connect(PlanPose(0.0, 0.0, 0.0), PlanPose(100.0, 0.0, 0.0))), 0.0).x_m
    100.0
    """
    reversed_elements = []
    for element in reversed(plan.elements):
        x, y, heading = element_pose(element, element.length_m)
        s = max(plan.length_m - element.s_m - element.length_m, 0.0)
        reversed_elements.append(PlanElement(s, x, y, heading + math.pi, element.length_m, -element.curvature_1pm))
    return PlanView(tuple(reversed_elements), plan.length_m)


def join_plans(plans: Sequence[PlanView]) -> PlanView:
    """Return plans joined in order; each must begin at the last pose of the previous one.

    >>> first, second = (connect(PlanPose(x, 0.0, 0.0), PlanPose(x + 50.0, 0.0, 0.0)) for x in (0.0, 50.0))
    >>> join_plans([first, second]).length_m
    100.0
    """
    elements: list[PlanElement] = []
    offset = 0.0
    for plan in plans:
        for e in plan.elements:
            last = elements[-1] if elements else None
            if last and last.curvature_1pm == e.curvature_1pm == 0.0 and _same_direction(last, e):
                length = last.length_m + e.length_m
                elements[-1] = PlanElement(last.s_m, last.x_m, last.y_m, last.heading_rad, length)
            elif offset == 0.0:
                elements.append(e)
            else:
                elements.append(PlanElement(e.s_m + offset, e.x_m, e.y_m, e.heading_rad, e.length_m, e.curvature_1pm))
        offset += plan.length_m
    return PlanView(tuple(elements), offset)


def _same_direction(a: PlanElement, b: PlanElement) -> bool:
    return abs(math.remainder(a.heading_rad - b.heading_rad, math.tau)) < _SAME_DIRECTION_RAD


def connect(start: PlanPose, end: PlanPose) -> PlanView | None:
    """Return a smooth curve from one pose to another: line, arc and line if one bend is enough, otherwise two arcs.

    None if only a detour would connect them (the end lies behind the start, with the same heading).

    >>> round(connect(PlanPose(0.0, 0.0, 0.0), PlanPose(10.0, 10.0, math.pi / 2)).length_m, 3)  # a quarter of 2 pi 10 m
    15.708
    """
    turn = math.remainder(end.heading_rad - start.heading_rad, math.tau)
    dx, dy = end.x_m - start.x_m, end.y_m - start.y_m
    c0, s0 = math.cos(start.heading_rad), math.sin(start.heading_rad)
    if abs(turn) > 0.03 and abs(turn) < 2.6:
        # Where the two tangents meet: `ahead` from the start, `behind` before the end.
        c1, s1 = math.cos(end.heading_rad), math.sin(end.heading_rad)
        sine = c0 * s1 - s0 * c1
        ahead = (dx * s1 - dy * c1) / sine
        behind = (c0 * dy - s0 * dx) / sine
        tangent = min(ahead, behind)
        if tangent > 0.5:
            return _single_bend(start, end, turn, tangent, ahead, behind)
    elif abs(turn) < 1e-9 and abs(dx * s0 - dy * c0) < 1e-6 and dx * c0 + dy * s0 > 0:
        return _plan_of([(start, math.hypot(dx, dy), 0.0)])
    plan = _biarc(start, end)
    return plan if plan.length_m <= 3 * math.hypot(dx, dy) + _DETOUR_M else None


def _single_bend(start: PlanPose, end: PlanPose, turn: float, tangent: float, ahead: float, behind: float) -> PlanView:
    curvature = math.tan(turn / 2) / tangent
    pieces = [(start, ahead - tangent, 0.0)]
    c, s = math.cos(start.heading_rad), math.sin(start.heading_rad)
    bend = PlanPose(start.x_m + (ahead - tangent) * c, start.y_m + (ahead - tangent) * s, start.heading_rad)
    pieces.append((bend, turn / curvature, curvature))
    c, s = math.cos(end.heading_rad), math.sin(end.heading_rad)
    out = behind - tangent
    pieces.append((PlanPose(end.x_m - out * c, end.y_m - out * s, start.heading_rad + turn), out, 0.0))
    return _plan_of(pieces)


def _biarc(start: PlanPose, end: PlanPose) -> PlanView:
    """Return two arcs with a common tangent, of equal tangent length at both ends (Bolton, CAD 7(1), 1975)."""
    vx, vy = end.x_m - start.x_m, end.y_m - start.y_m
    c0, s0 = math.cos(start.heading_rad), math.sin(start.heading_rad)
    c1, s1 = math.cos(end.heading_rad), math.sin(end.heading_rad)
    tx, ty = c0 + c1, s0 + s1
    vv, vt = vx * vx + vy * vy, vx * tx + vy * ty
    denominator = 2 * (1 - (c0 * c1 + s0 * s1))
    if denominator > 1e-9:
        d = (-vt + math.sqrt(max(vt * vt + denominator * vv, 0.0))) / denominator
    elif abs(vt) > 1e-9:
        d = vv / (2 * vt)
    else:
        d = math.sqrt(vv) / 2
    mx = (start.x_m + end.x_m + d * (c0 - c1)) / 2
    my = (start.y_m + end.y_m + d * (s0 - s1)) / 2
    first = _arc_to(start, mx, my)
    middle = PlanPose(mx, my, first[0].heading_rad + first[1] * first[2])
    return _plan_of([first, _arc_to(middle, end.x_m, end.y_m)])


def _arc_to(start: PlanPose, x_m: float, y_m: float) -> tuple[PlanPose, float, float]:
    """Return the arc that leaves ``start`` and passes through a point: its start, length and curvature.

    If the arc is too flat for single precision it is a straight line, at most 0.03 degrees off the start's heading.
    """
    dx, dy = x_m - start.x_m, y_m - start.y_m
    chord = math.hypot(dx, dy)
    if chord < _MIN_LENGTH_M:
        return start, 0.0, 0.0
    angle = math.remainder(math.atan2(dy, dx) - start.heading_rad, math.tau)
    if abs(math.sin(angle)) < min(chord / (2 * LARGEST_RADIUS_M), _FLAT_RAD) and abs(angle) < 1.0:
        return PlanPose(start.x_m, start.y_m, start.heading_rad + angle), chord, 0.0
    return start, chord * angle / math.sin(angle), 2 * math.sin(angle) / chord


def drop_slivers(plan: PlanView) -> PlanView:
    """Return the same line with a smooth curve of about a metre in place of each element under a centimetre.

    It begins, ends and turns as before, within a few millimetres of the original. A reader that samples a line, or
    drops elements below its tolerance, would lose the heading that such an element adds.
    """
    if plan.length_m < 2 * SHORTEST_ELEMENT_M:
        return plan
    elements, at, found = list(plan.elements), 0, False
    for _ in plan.elements:  # fewer are left after each round
        at = next((i for i in range(at, len(elements)) if elements[i].length_m < SHORTEST_ELEMENT_M), len(elements))
        if at == len(elements):
            break
        found = True
        # Nothing but what is near changes, so that a line of many slivers does not take the square of their number.
        first = _index_beyond(elements, at, -1)
        last = _index_beyond(elements, at, 1)
        near = _one_after_the_other(elements[first : last + 1])
        sliver = near.elements[at - first]
        begin_m = _snapped(near, sliver.s_m - _AROUND_SLIVER_M)
        end_m = _snapped(near, sliver.s_m + sliver.length_m + _AROUND_SLIVER_M)
        curve = _biarc(plan_pose(near, begin_m), plan_pose(near, end_m))
        pieces = cut_plan(near, 0.0, begin_m), curve, cut_plan(near, end_m, near.length_m)
        elements[first : last + 1] = join_plans([piece for piece in pieces if piece.elements]).elements
        at = first
    return _one_after_the_other(elements) if found else plan


def _index_beyond(elements: Sequence[PlanElement], at: int, step: int) -> int:
    """Return the index of the next element beyond a replaced sliver, before (-1) or after (1)."""
    away_m = 0.0
    while 0 <= at + step < len(elements) and away_m < _AROUND_SLIVER_M + 2 * SHORTEST_ELEMENT_M:
        at += step
        away_m += elements[at].length_m
    return at


def _one_after_the_other(elements: Sequence[PlanElement]) -> PlanView:
    s_m, placed = 0.0, []
    for element in elements:
        placed.append(replace(element, s_m=s_m))
        s_m += element.length_m
    return PlanView(tuple(placed), s_m)


def _snapped(plan: PlanView, s_m: float) -> float:
    """Return ``s_m`` within the plan, moved onto the border of an element if almost there."""
    borders = (0.0, plan.length_m, *(element.s_m for element in plan.elements))
    nearest = min(borders, key=lambda border: abs(border - s_m))
    return nearest if abs(nearest - s_m) < 2 * SHORTEST_ELEMENT_M else min(max(s_m, 0.0), plan.length_m)


def _plan_of(pieces: Sequence[tuple[PlanPose, float, float]]) -> PlanView:
    elements: list[PlanElement] = []
    s = 0.0
    for pose, length, curvature in pieces:
        if length > _MIN_LENGTH_M:
            elements.append(PlanElement(s, *pose, length, curvature))
            s += length
    return PlanView(tuple(elements), s)


# --- pieces that the road model lacks --------------------------------------------------------------------------------
def spiral_as_arcs(start: PlanElement, curvature_start: float, curvature_end: float) -> Iterator[PlanElement]:
    """Yield a clothoid as short arcs of its mean curvature, so that headings are exact.

    >>> arcs = list(spiral_as_arcs(PlanElement(0.0, 0.0, 0.0, 0.0, 50.0), 0.0, 0.02))
    >>> round(sum(arc.length_m * arc.curvature_1pm for arc in arcs), 6)  # turned by the mean curvature times the length
    0.5
    """
    sharpest = max(abs(curvature_start), abs(curvature_end))
    count = max(4, math.ceil(sharpest * start.length_m / _ARC_TURN_RAD))
    step = start.length_m / count
    x, y, heading = start.x_m, start.y_m, start.heading_rad
    for index in range(count):
        curvature = curvature_start + (curvature_end - curvature_start) * (index + 0.5) / count
        yield PlanElement(start.s_m + index * step, x, y, heading, step, curvature)
        x, y, heading = along_arc(x, y, heading, step, curvature)


def poly3_as_param_poly3(start: PlanElement, a: float, b: float, c: float, d: float) -> PlanElement:
    """Return the cubic v(u) = a + b u + c u**2 + d u**3 along the length of ``start``, as a normalized ``paramPoly3``.

    >>> poly3_as_param_poly3(PlanElement(0.0, 0.0, 0.0, 0.0, 5.0), 0.0, 0.75, 0.0, 0.0).poly  # 4 along, 3 across
    (0.0, 4.0, 0.0, 0.0, 0.0, 3.0, 0.0, 0.0)
    """
    reach = _poly3_reach(b, c, d, start.length_m)
    poly = (0.0, reach, 0.0, 0.0, a, b * reach, c * reach**2, d * reach**3)
    return replace(start, poly=poly, poly_normalized=True)


def _poly3_reach(b: float, c: float, d: float, length_m: float) -> float:
    """Return ``u`` at which the cubic v(u) has the given arc length, by bisection."""

    def arc_length(u_end: float) -> float:
        count = 64
        step = u_end / count
        slopes = (b + u * (2 * c + 3 * d * u) for u in (step * (i + 0.5) for i in range(count)))
        return math.fsum(math.hypot(1.0, slope) for slope in slopes) * step

    low, high = 0.0, length_m
    for _ in range(60):
        middle = (low + high) / 2
        low, high = (middle, high) if arc_length(middle) < length_m else (low, middle)
    return (low + high) / 2


# --- arcs ------------------------------------------------------------------------------------------------------------
def along_arc(
    x_m: float, y_m: float, heading_rad: float, length_m: float, curvature_1pm: float
) -> tuple[float, float, float]:
    """Return x, y (metres) and heading (radians) after ``length_m`` of an arc; curvature is positive to the left.

    >>> x, y, heading = along_arc(0.0, 0.0, 0.0, math.pi * 50, 1 / 100)  # a quarter of a circle of 100 m radius
    >>> round(x, 6), round(y, 6), round(math.degrees(heading), 6)
    (100.0, 100.0, 90.0)
    """
    if not curvature_1pm:  # most pieces of a map are straight
        return x_m + length_m * math.cos(heading_rad), y_m + length_m * math.sin(heading_rad), heading_rad
    turn = curvature_1pm * length_m
    half = turn / 2
    chord_m = length_m if abs(half) < _STRAIGHT_RAD else length_m * math.sin(half) / half
    direction = heading_rad + half
    return x_m + chord_m * math.cos(direction), y_m + chord_m * math.sin(direction), heading_rad + turn


def along_arcs(
    x_m: FloatArray, y_m: FloatArray, heading_rad: FloatArray, length_m: FloatArray, curvature_1pm: FloatArray
) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Return the :func:`along_arc` for many arcs, arrays of one shape.

    >>> zero, ahead_m = np.zeros(2), np.array([10.0, 5.0 * math.pi])
    >>> x_m, y_m, _ = along_arcs(zero, zero, zero, ahead_m, np.array([0.0, 0.1]))  # straight on; a quarter to the left
    >>> x_m.round(6).tolist(), y_m.round(6).tolist()
    ([10.0, 10.0], [0.0, 10.0])
    """
    turn = curvature_1pm * length_m
    chord_m = length_m * np.sinc(turn / math.tau)  # numpy's sinc(x) is sin(pi x) / (pi x)
    direction = heading_rad + turn / 2
    return x_m + chord_m * np.cos(direction), y_m + chord_m * np.sin(direction), heading_rad + turn
