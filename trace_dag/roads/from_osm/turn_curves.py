"""Curves that a car can drive from one pose to another: lines, and arcs no tighter than its turning circle.

The shortest curves of bounded curvature (L. E. Dubins, American Journal of Mathematics 79, 1957): arc, line, arc or
three arcs, all arcs of the one radius. A turn between two places too close for its radius swings out before or after,
as drivers do.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from typing import Final

from trace_dag.roads.map.curves import PlanPose, PlanView, Point, element_pose, join_plans
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

_Piece = tuple[float, float]  # length in metres (of a line) or angle in radians (of an arc); 0, or an arc's side: 1, -1


def tightest_radius_m(plan: PlanView) -> float:
    """Radius of the tightest arc of a line, infinite where it is straight.

    >>> line, arc = PlanElement(0.0, 0.0, 0.0, 0.0, 50.0), PlanElement(50.0, 50.0, 0.0, 0.0, 10.0, 0.05)
    >>> tightest_radius_m(PlanView((line, arc), 60.0))
    20.0
    """
    curvature = max((abs(element.curvature_1pm) for element in plan.elements), default=0.0)
    return 1.0 / curvature if curvature else math.inf


def drivable_turn(start: PlanPose, end: PlanPose) -> PlanView | None:
    """The shortest curve from pose to pose with arcs as wide as there is room for; None if every such curve is a loop.

    The radius is the widest one, from a car's turning circle down to that of a corner, that needs little swinging out;
    if none does, a corner's radius with more swinging out.

    >>> drivable_turn(PlanPose(0.0, 0.0, 0.0), PlanPose(50.0, 0.0, 0.0)).length_m  # straight on
    50.0
    """
    for radius_m in _RADII_M:
        plan = _shortest(start, end, radius_m, _MOST_BACK_RAD)
        if plan is not None:
            return plan
    return _shortest(start, end, CORNER_RADIUS_M, _MOST_BACK_IN_A_FOLD_RAD)


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
    return sum(size * radius_m if side else size for size, side in pieces)


def _turns_by(pieces: Sequence[_Piece], turn_rad: float, most_back_rad: float) -> bool:
    """Whether a curve turns as far as it has to and not far the other way before and after."""
    turns = [size * side for size, side in pieces if side]
    net = sum(turns)
    if abs(math.remainder(net - turn_rad, math.tau)) > _SAME_RAD or abs(net) > math.pi + 0.5:
        return False
    return sum(abs(angle) for angle in turns if angle * net < 0) <= most_back_rad


def _candidates(start: PlanPose, end: PlanPose, radius_m: float) -> Iterator[list[_Piece]]:
    """Those of Dubins' six kinds of curve that exist."""
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
    """Centre of the circle that leaves a pose to its left (1) or right (-1)."""
    sine, cosine = math.sin(pose.heading_rad), math.cos(pose.heading_rad)
    return pose.x_m - side * radius_m * sine, pose.y_m + side * radius_m * cosine


def _arcs(
    start: PlanPose, end: PlanPose, first: tuple[int, float, float], last: int, middle: tuple[int, float] | None = None
) -> list[_Piece]:
    """An arc up to a heading, a line, perhaps another arc up to a heading, and an arc to the end's heading."""
    side, heading, along = first
    pieces = [_arc(side, start.heading_rad, heading), (along, 0.0)]
    if middle is not None:
        pieces.append(_arc(middle[0], heading, middle[1]))
        heading = middle[1]
    return [*pieces, _arc(last, heading, end.heading_rad)]


def _arc(side: int, before_rad: float, after_rad: float) -> _Piece:
    angle = (side * (after_rad - before_rad)) % math.tau
    return (0.0 if math.tau - angle < _SAME_RAD else angle), float(side)
