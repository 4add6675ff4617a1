"""Curves that a car can drive from one pose to another: lines, and arcs no tighter than its turning circle.

The shortest curves of bounded curvature (L. E. Dubins, American Journal of Mathematics 79, 1957): arc, line, arc or
three arcs, all arcs of the one radius. A turn between two places too close for its radius swings out before or after,
as drivers do.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from typing import Final

from trace_dag.roads.map.curves import (
    PlanPose,
    PlanView,
    Point,
    connect,
    cut_plan,
    element_pose,
    join_plans,
    plan_pose,
)
from trace_dag.roads.map.model import PlanElement

TIGHTEST_RADIUS_M: Final = 3.7
"""The tightest circle of the middle of a car's rear axle, the point that is led along a lane's centre.

Makers state circles of 10.5 to 12 m from kerb to kerb, which the outer front wheel draws. With a wheelbase of 2.7 m and
a track of 1.55 m the middle of the rear axle draws one of ``sqrt(5.25**2 - 2.7**2) - 1.55 / 2`` = 3.7 m to 4.6 m.
The design car of AASHTO's Green Book (table 2-2, "P") is larger: 6.4 m at the middle of its front axle.
"""
CORNER_RADIUS_M: Final = 2.0
"""The tightest corner of a lane's centre. A car takes it on a circle of 3.7 m: beginning and ending half a lane further
out adds 1.7 m to the radius of a turn by 90 degrees."""

_MOST_BACK_RAD: Final = (
    2.5  # turned the other way in all, at most; two places side by side need 2.1, a loop more than 3.1
)
_MOST_BACK_IN_A_FOLD_RAD: Final = 3.6
_RADII_M: Final = (TIGHTEST_RADIUS_M, 3.2, 2.7, 2.3, CORNER_RADIUS_M)
_SAME_RAD: Final = 1e-6
_ROOM_M: Final = (0.5, 1.0, 2.0, 3.0, 5.0, 8.0, 12.0, 20.0)  # before and behind a bend that is made wider

_Piece = tuple[float, float]  # length in metres (of a line) or angle in radians (of an arc); 0, or an arc's side: 1, -1


def tightest_radius_m(plan: PlanView) -> float:
    """Return the radius of the tightest arc of a line, infinite if it is straight.

    >>> line, arc = PlanElement(0.0, 0.0, 0.0, 0.0, 50.0), PlanElement(50.0, 50.0, 0.0, 0.0, 10.0, 0.05)
    >>> tightest_radius_m(PlanView((line, arc), 60.0))
    20.0
    """
    curvature = max((abs(element.curvature_1pm) for element in plan.elements), default=0.0)
    return 1.0 / curvature if curvature else math.inf


def drivable_turn(start: PlanPose, end: PlanPose) -> PlanView | None:
    """Return the shortest curve from pose to pose with arcs as wide as the room allows.

    None if every such curve is a loop.

    The radius is the widest one, from a car's turning circle down to that of a corner, that needs little swinging out.
    If there is none, it is a corner's radius with more swinging out.

    >>> drivable_turn(PlanPose(0.0, 0.0, 0.0), PlanPose(50.0, 0.0, 0.0)).length_m  # straight on
    50.0
    """
    for radius_m in _RADII_M:
        plan = _shortest(start, end, radius_m, _MOST_BACK_RAD)
        if plan is not None:
            return plan
    return _shortest(start, end, CORNER_RADIUS_M, _MOST_BACK_IN_A_FOLD_RAD)


def turn_of_radius(start: PlanPose, end: PlanPose, radius_m: float) -> PlanView | None:
    """Return the shortest curve from pose to pose with arcs of one radius; None if every such curve is a loop.

    >>> quarter = turn_of_radius(PlanPose(0.0, 0.0, 0.0), PlanPose(10.0, 10.0, math.pi / 2), 4.0)
    >>> round(quarter.length_m, 3)  # an eighth of 2 pi 4 m, a line between circles 8.485 m apart, another eighth
    14.768
    """
    return _shortest(start, end, radius_m, _MOST_BACK_RAD)


def widen_tight_bends(plan: PlanView, radius_m: float) -> PlanView:
    """Return the line with a wider bend in place of each arc tighter than ``radius_m``, if there is room.

    It begins and ends as before. An arc without room for a wider one stays.

    >>> tight = connect(PlanPose(0.0, 0.0, 0.0), PlanPose(20.0, 0.6, math.pi / 2))
    >>> round(tightest_radius_m(tight), 6), round(tightest_radius_m(widen_tight_bends(tight, 2.0)), 6)
    (0.6, 2.0)
    """
    begin_m = 0.0
    while (arc := _first_tight(plan, radius_m, begin_m)) is not None:
        wider = _widened(plan, arc, radius_m)
        begin_m = arc.s_m + arc.length_m
        if wider is not None:
            begin_m += wider.length_m - plan.length_m
            plan = wider
    return plan


def _first_tight(plan: PlanView, radius_m: float, begin_m: float) -> PlanElement | None:
    return next(
        (e for e in plan.elements if e.s_m > begin_m - _SAME_RAD and abs(e.curvature_1pm) * radius_m > 1.0 + 1e-6), None
    )


def _widened(plan: PlanView, arc: PlanElement, radius_m: float) -> PlanView | None:
    for reach_m in _ROOM_M:
        low_m, high_m = max(arc.s_m - reach_m, 0.0), min(arc.s_m + arc.length_m + reach_m, plan.length_m)
        start, end = plan_pose(plan, low_m), plan_pose(plan, high_m)
        curves = [connect(start, end), turn_of_radius(start, end, radius_m)]
        wide = [each for each in curves if each and tightest_radius_m(each) >= radius_m * (1 - 1e-6)]
        if wide:
            curve = min(wide, key=lambda each: each.length_m)
            pieces = cut_plan(plan, 0.0, low_m), curve, cut_plan(plan, high_m, plan.length_m)
            joined = join_plans([piece for piece in pieces if piece.elements])
            scale = curve.length_m / (high_m - low_m)
            vertices = tuple(
                s_m if s_m <= low_m else low_m + (min(s_m, high_m) - low_m) * scale + max(s_m - high_m, 0.0)
                for s_m in plan.vertex_s_m
            )
            return PlanView(joined.elements, joined.length_m, vertices)
    return None


def _shortest(start: PlanPose, end: PlanPose, radius_m: float, most_back_rad: float) -> PlanView | None:
    turn = math.remainder(end.heading_rad - start.heading_rad, math.tau)
    found = [pieces for pieces in _candidates(start, end, radius_m) if _turns_by(pieces, turn, most_back_rad)]
    if not found:
        return None
    pose = start
    plans = []
    for size, side in min(found, key=lambda pieces: _length(pieces, radius_m)):
        length = size * radius_m if side else size
        if length > _SAME_RAD:
            element = PlanElement(0.0, *pose, length, side / radius_m)
            plans.append(PlanView((element,), length))
            pose = element_pose(element, length)
    return join_plans(plans)


def _length(pieces: Sequence[_Piece], radius_m: float) -> float:
    return math.fsum(size * radius_m if side else size for size, side in pieces)


def _turns_by(pieces: Sequence[_Piece], turn_rad: float, most_back_rad: float) -> bool:
    """Return whether a curve has the required turn, with little turning back before and after."""
    turns = [size * side for size, side in pieces if side]
    net = math.fsum(turns)
    if abs(math.remainder(net - turn_rad, math.tau)) > _SAME_RAD or abs(net) > math.pi + 0.5:
        return False
    return math.fsum(abs(angle) for angle in turns if angle * net < 0) <= most_back_rad


def _candidates(start: PlanPose, end: PlanPose, radius_m: float) -> Iterator[list[_Piece]]:
    """Yield the existing curves of Dubins' six kinds."""
    for first in (1, -1):
        x0, y0 = _centre(start, first, radius_m)
        for last in (1, -1):
            x1, y1 = _centre(end, last, radius_m)
            distance, bearing = math.hypot(x1 - x0, y1 - y0), math.atan2(y1 - y0, x1 - x0)
            if first == last:
                yield _arcs(start, end, (first, bearing, distance), last)
            elif distance >= 2 * radius_m:
                along = math.sqrt(distance**2 - 4 * radius_m**2)
                yield _arcs(start, end, (first, bearing + first * math.asin(2 * radius_m / distance), along), last)
            if first == last and 0 < distance < 4 * radius_m:
                spread = math.acos(distance / (4 * radius_m))
                for aside in (spread, -spread):
                    # Directions from the first centre to the middle one and from there to the last give the headings
                    # where arcs meet.
                    there, back = bearing + aside, bearing - aside
                    quarter = first * math.pi / 2
                    yield _arcs(start, end, (first, there + quarter, 0.0), last, (-first, back - quarter))


def _centre(pose: PlanPose, side: int, radius_m: float) -> Point:
    """Return the centre of the circle that leaves a pose to its left (1) or right (-1)."""
    sine, cosine = math.sin(pose.heading_rad), math.cos(pose.heading_rad)
    return pose.x_m - side * radius_m * sine, pose.y_m + side * radius_m * cosine


def _arcs(
    start: PlanPose, end: PlanPose, first: tuple[int, float, float], last: int, middle: tuple[int, float] | None = None
) -> list[_Piece]:
    """Return an arc up to a heading, a line, perhaps another arc up to a heading, and an arc to the end's heading."""
    side, heading, along = first
    pieces = [_arc(side, start.heading_rad, heading), (along, 0.0)]
    if middle is not None:
        pieces.append(_arc(middle[0], heading, middle[1]))
        heading = middle[1]
    return [*pieces, _arc(last, heading, end.heading_rad)]


def _arc(side: int, before_rad: float, after_rad: float) -> _Piece:
    angle = (side * (after_rad - before_rad)) % math.tau
    return (0.0 if math.tau - angle < _SAME_RAD else angle), float(side)
