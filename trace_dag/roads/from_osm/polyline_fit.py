"""Reference lines from polylines: an arc at every vertex, as wide as the lanes need.

Each vertex becomes an arc tangent to both its segments: the simplest curve with continuous heading. Its arc length is
exact (OpenDRIVE 1.7, 7.3) and its distance from the vertex has a formula. If the vertices of a bend are too close
together for the radius that its lanes need, they become one. If a corner is so sharp that its arc would pass far inside
it, the line swings out before it, as drivers do.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from itertools import pairwise
from typing import Final, NamedTuple

from trace_dag.roads.map.curves import LARGEST_RADIUS_M, PlanView, Point, direction_rad, join_plans
from trace_dag.roads.map.model import PlanElement

_TOLERANCE_M: Final = 0.12  # deviation accepted at a vertex for the sake of a wide curve
_MAX_DEVIATION_M: Final = 2.95  # deviation accepted to keep the inner lanes of a sharp bend drivable
_MERGE_DEVIATION_M: Final = 1.5  # by which a bend may miss the vertices it was drawn with
_NEGLIGIBLE_TURN_RAD: Final = 0.02
_WIDEST_CORNER_RAD: Final = 2.4  # a larger turn cannot be one arc between two tangents
_STRAIGHT_RAD: Final = 4e-6  # turns below it count as straight: 0.4 mm in 100 m
_ENOUGH_ROOM: Final = 0.95  # share of the needed tangent; corners with less are merged
_END_SHARE: Final = 0.7  # share of its first and last segment that arcs may use: a plan begins and ends with a line
_MIN_LENGTH_M: Final = 1e-6
_SWING_M: Final = 0.95  # farthest that the line swings out before a corner
_LEAST_SWING_M: Final = 0.1  # a smaller swing is not made
_SWING_LENGTH_M: Final = 7.0  # length over which it swings out if there is room,
_SHORTEST_SWING_M: Final = 4.0  # and at least
_SWING_BENDS: Final = 2.5  # tangents that a swing needs for its two bends, with a small margin


def fit_plan(points: Sequence[Point], min_radius_m: float, *, keep_ends: bool = False) -> PlanView:
    """Return lines and arcs through a polyline of at least two distinct points, tangent everywhere.

    Sharp bends get the radius ``min_radius_m``, if there is room and no vertex is missed by more than 3 m. Bends with
    several vertices too close for that radius become one arc. With ``keep_ends`` the line begins and ends exactly in
    the direction of the first and last segment.

    >>> fit_plan([(0.0, 0.0), (30.0, 40.0)], 10.0).length_m
    50.0
    """
    if len(points) == 2:
        length = math.dist(*points)
        return PlanView((PlanElement(0.0, *points[0], direction_rad(*points), length),), length, (0.0, length))
    corners = [_Corner(point, (index,)) for index, point in enumerate(points)]
    shape = _shape(corners, min_radius_m)
    frozen: set[tuple[int, ...]] = set()
    room = [_room(shape, index, frozen) for index in range(len(corners))]
    while (least := min(room)) < _ENOUGH_ROOM:
        tightest = room.index(least)
        merged = _merged(points, shape, tightest, min_radius_m, keep_ends)
        if merged is None:
            frozen.add(shape.corners[tightest].sources)
            room[tightest] = math.inf
        else:
            first, corner = merged
            del room[first]
            for index in _merge(shape, first, corner, min_radius_m):
                room[index] = _room(shape, index, frozen)
    swung = _swung_out(shape, min_radius_m)
    if swung is not None:
        shape = _shape(swung, min_radius_m)
    elements, length, corner_s = _rounded(shape)
    return PlanView(elements, length, _vertex_s(points, shape.corners, corner_s))


class _Corner(NamedTuple):
    """A vertex of the polyline to be rounded, with the original vertices that it replaces and its shift."""

    point: Point
    sources: tuple[int, ...]
    swing_m: float = 0.0


class _Shape(NamedTuple):
    """A polyline and its corners' arcs: segments, turns (of inner corners), and tangents: needed, wanted, and given."""

    corners: list[_Corner]
    lengths: list[float]
    directions: list[float]
    turns: list[float]
    limits: list[tuple[float, float]]
    tangents: list[float]


def _shape(corners: list[_Corner], min_radius_m: float) -> _Shape:
    segments = list(pairwise(corner.point for corner in corners))
    lengths = [math.dist(*segment) for segment in segments]
    directions = [direction_rad(*segment) for segment in segments]
    turns = [math.remainder(b - a, math.tau) for a, b in pairwise(directions)]
    inner = (
        _tangent_lengths(turn, min_radius_m, corner.swing_m) for turn, corner in zip(turns, corners[1:], strict=False)
    )
    limits = [(0.0, 0.0), *inner, (0.0, 0.0)]
    return _Shape(corners, lengths, directions, turns, limits, _share_segments(limits, lengths))


def _swung_out(shape: _Shape, min_radius_m: float) -> list[_Corner] | None:
    """Return the corners, with those moved outwards that their arcs would miss by more than a metre.

    None for a line without corners.
    """
    corners = shape.corners
    swung: list[_Corner] = [corners[0]]
    taken_m = 0.0  # of the segment before a corner, by the corner before it
    for index in range(1, len(corners) - 1):
        rooms_m = shape.lengths[index - 1] - taken_m, shape.lengths[index] - shape.tangents[index + 1]
        swing = _swing(shape, index, rooms_m, min_radius_m)
        swung += swing.corners if swing else [corners[index]]
        taken_m = swing.taken_m if swing else shape.tangents[index]
    swung.append(corners[-1])
    return swung if len(swung) > len(corners) else None


class _Swing(NamedTuple):
    """Corners that lead a line out beside a street, and the length of the last segment that they use."""

    corners: list[_Corner]
    taken_m: float


def _swing(shape: _Shape, index: int, rooms_m: tuple[float, float], min_radius_m: float) -> _Swing | None:
    """Return the corners that replace one corner; None if it can stay or there is no room.

    The line runs beside the street before and behind the corner, or on one of its sides if the other is too short.
    ``rooms_m`` are the available lengths of the segments before and behind.
    """
    corner, turn = shape.corners[index], abs(shape.turns[index - 1])
    missed_m = shape.tangents[index] * math.tan(min(turn, 3.1) / 4)
    out_m = min((missed_m - 1.0) * math.cos(turn / 2), _SWING_M)
    if out_m <= _LEAST_SWING_M or len(corner.sources) != 1 or turn > _WIDEST_CORNER_RAD:
        return None
    bend_m = min_radius_m * math.tan(math.atan2(out_m, _SHORTEST_SWING_M) / 2)  # tangent of the bends there and back
    back, ahead = shape.directions[index - 1] + math.pi, shape.directions[index]
    right = math.copysign(1.0, shape.turns[index - 1])  # the outside of a left turn, seen looking ahead
    for before_m, behind_m in ((out_m, out_m), (out_m, 0.0), (0.0, out_m)):
        moved_m = min(before_m, behind_m) / math.cos(turn / 2)
        tangent_m = _tangent_lengths(turn, min_radius_m, moved_m)[0]
        # The lines beside the street meet so far beyond the vertex, seen along either.
        beyond_before_m = (behind_m - before_m * math.cos(turn)) / math.sin(turn)
        beyond_behind_m = (before_m - behind_m * math.cos(turn)) / math.sin(turn)
        before = _way_out(corner.point, back, -right * before_m, tangent_m - beyond_before_m, bend_m, rooms_m[0])
        behind = _way_out(corner.point, ahead, right * behind_m, tangent_m - beyond_behind_m, bend_m, rooms_m[1])
        if before and behind:
            vertex = _beside(corner.point, back, -beyond_before_m, -right * before_m)
            moved = _Corner(vertex, corner.sources, moved_m)
            return _Swing([*reversed(before.corners), moved, *behind.corners], behind.taken_m)
    return None


def _way_out(
    vertex: Point, heading_rad: float, right_m: float, arc_end_m: float, bend_m: float, room_m: float
) -> _Swing | None:
    """Return the line from beside a street back onto it, seen from the corner; None without room."""
    if right_m == 0.0:
        return _Swing([], arc_end_m) if arc_end_m <= room_m else None
    length_m = min(room_m - arc_end_m - _SWING_BENDS * bend_m, _SWING_LENGTH_M)
    if length_m < _SHORTEST_SWING_M:
        return None
    near_m = arc_end_m + bend_m
    far_m = near_m + length_m
    places = _beside(vertex, heading_rad, near_m, right_m), _beside(vertex, heading_rad, far_m, 0.0)
    return _Swing([_Corner(place, ()) for place in places], far_m + (_SWING_BENDS - 1.0) * bend_m)


def _beside(point: Point, heading_rad: float, along_m: float, right_m: float) -> Point:
    """Return the position at given distances from a point, along a heading and to the right of it."""
    c, s = math.cos(heading_rad), math.sin(heading_rad)
    return point[0] + along_m * c + right_m * s, point[1] + along_m * s - right_m * c


def _room(shape: _Shape, index: int, frozen: set[tuple[int, ...]]) -> float:
    """Return the tangent of a corner divided by the tangent that its wanted radius needs.

    It is infinite if the corner is straight or must not be changed.
    """
    if not 0 < index < len(shape.corners) - 1 or shape.corners[index].sources in frozen:
        return math.inf
    needed = shape.limits[index][0]
    if abs(shape.turns[index - 1]) < _NEGLIGIBLE_TURN_RAD or needed <= 0.0:
        return math.inf
    return shape.tangents[index] / needed


def _merge(shape: _Shape, first: int, corner: _Corner, min_radius_m: float) -> range:
    """Replace ``first`` and the next corner by one, in place; return the corners with changed tangents.

    Only nearby values are computed anew: a way may have thousands of nodes.
    """
    corners, lengths, directions, turns, limits, tangents = shape
    corners[first : first + 2] = [corner]
    around = list(pairwise(corners[index].point for index in (first - 1, first, first + 1)))
    lengths[first - 1 : first + 2] = [math.dist(*segment) for segment in around]
    directions[first - 1 : first + 2] = [direction_rad(*segment) for segment in around]
    del turns[first - 1], limits[first], tangents[first]
    last = len(corners) - 1
    for index in range(max(first - 1, 1), min(first + 2, last)):
        turns[index - 1] = math.remainder(directions[index] - directions[index - 1], math.tau)
        limits[index] = _tangent_lengths(turns[index - 1], min_radius_m, corners[index].swing_m)
    changed = range(max(first - 2, 0), min(first + 3, last + 1))
    for index in changed:
        tangents[index] = limits[index][1]
        for segment in (index - 1, index):
            if 0 <= segment < last:
                tangents[index] = min(tangents[index], _shares(limits, lengths, segment)[index - segment])
    return changed


def _merged(
    points: Sequence[Point], shape: _Shape, index: int, min_radius_m: float, keep_ends: bool
) -> tuple[int, _Corner] | None:
    """Return one corner in place of a corner and its nearer neighbour, and the first of the two.

    None if it misses the vertices.
    """
    corners, turns = shape.corners, shape.turns
    neighbours = [n for n in (index - 1, index + 1) if 0 < n < len(corners) - 1]
    if not neighbours:
        return None
    other = min(neighbours, key=lambda n: shape.lengths[min(n, index)])
    first, second = min(index, other), max(index, other)
    a, b = corners[first].point, corners[second].point
    before, after = corners[first - 1].point, corners[second + 1].point
    turn = turns[first - 1] + turns[second - 1]
    if turns[first - 1] * turns[second - 1] > 0 and abs(turn) < _WIDEST_CORNER_RAD:
        # Where the segments before and after meet, outside the bend as drawn.
        ux, uy, vx, vy = a[0] - before[0], a[1] - before[1], after[0] - b[0], after[1] - b[1]
        along = ((b[0] - a[0]) * vy - (b[1] - a[1]) * vx) / (ux * vy - uy * vx)
        point = (a[0] + along * ux, a[1] + along * uy)
    elif keep_ends and (first == 1 or second == len(corners) - 2):
        return None
    else:
        point = ((a[0] + b[0]) / 2, (a[1] + b[1]) / 2)
    sources = corners[first].sources + corners[second].sources
    incoming, outgoing = math.dist(before, point), math.dist(point, after)
    if incoming < _MIN_LENGTH_M or outgoing < _MIN_LENGTH_M:
        return None
    tangent = min(_tangent_lengths(turn, min_radius_m)[0], incoming, outgoing)
    drawn = [before, *(points[source] for source in sources), after]
    middles = [((x0 + x1) / 2, (y0 + y1) / 2) for (x0, y0), (x1, y1) in pairwise(drawn)]
    for p in (*drawn[1:-1], *middles):
        if _distance_to_corner(p, before, point, after, tangent) > _MERGE_DEVIATION_M:
            return None
    return first, _Corner(point, sources)


def _distance_to_corner(p: Point, before: Point, corner: Point, after: Point, tangent: float) -> float:
    """Return the distance from a point to two segments whose corner is rounded with the given tangents."""
    u, v = direction_rad(before, corner), direction_rad(corner, after)
    turn = math.remainder(v - u, math.tau)
    dx, dy = p[0] - corner[0], p[1] - corner[1]
    along_in, along_out = dx * math.cos(u) + dy * math.sin(u), dx * math.cos(v) + dy * math.sin(v)
    if along_in <= -tangent:
        return abs(-dx * math.sin(u) + dy * math.cos(u))
    if along_out >= tangent:
        return abs(-dx * math.sin(v) + dy * math.cos(v))
    if abs(turn) < 1e-6:
        return abs(-dx * math.sin(u) + dy * math.cos(u))
    radius = tangent / math.tan(turn / 2)  # signed: the centre lies to the left of a left turn
    centre_x = -tangent * math.cos(u) - radius * math.sin(u)
    centre_y = -tangent * math.sin(u) + radius * math.cos(u)
    return abs(math.hypot(dx - centre_x, dy - centre_y) - abs(radius))


def _vertex_s(points: Sequence[Point], corners: Sequence[_Corner], corner_s: Sequence[float]) -> tuple[float, ...]:
    """Return ``s_m`` of each original vertex: exact for remaining corners, by distance in between."""
    if all(len(corner.sources) == 1 for corner in corners):
        return tuple(corner_s)
    along = [0.0]
    for a, b in pairwise(points):
        along.append(along[-1] + math.dist(a, b))
    exact = [(corner.sources[0], s) for corner, s in zip(corners, corner_s, strict=True) if len(corner.sources) == 1]
    found: list[float] = []
    for (first, s0), (last, s1) in pairwise(exact):
        scale = (s1 - s0) / (along[last] - along[first])
        found.extend(s0 + scale * (along[index] - along[first]) for index in range(first, last))
    return (*found, corner_s[-1])


def _rounded(shape: _Shape) -> tuple[tuple[PlanElement, ...], float, list[float]]:
    """Return lines between corners and an arc at each: elements, length, and ``s_m`` of each corner."""
    corners, lengths, directions, turns, _, tangents = shape
    elements: list[PlanElement] = []
    corner_s = [0.0]
    s = 0.0
    for index, corner in enumerate(corners[:-1]):
        x, y = corner.point
        direction = directions[index]
        line = lengths[index] - tangents[index] - tangents[index + 1]
        c, si = math.cos(direction), math.sin(direction)
        if line > _MIN_LENGTH_M:
            start = tangents[index]
            elements.append(PlanElement(s, x + start * c, y + start * si, direction, line))
            s += line
        if index == len(corners) - 2:
            break
        tangent, turn = tangents[index + 1], turns[index]
        middle = s
        if tangent > 0.0:
            curvature = math.tan(turn / 2) / tangent
            arc = turn / curvature
            end = lengths[index] - tangent
            elements.append(PlanElement(s, x + end * c, y + end * si, direction, arc, curvature))
            middle = s + arc / 2
            s += arc
        corner_s.append(middle)
    if 0.0 in tangents[1:-1]:  # a vertex that is not a corner: the lines before and after are one
        elements = list(join_plans([PlanView(tuple(elements), s)]).elements)
    return tuple(elements), s, [*corner_s, s]


def _tangent_lengths(turn_rad: float, min_radius_m: float, swing_m: float = 0.0) -> tuple[float, float]:
    """Return the tangent that a corner needs for the wanted radius, and the longer one for a gentle curve.

    The curve may miss a corner that was moved outwards by ``swing_m`` more.
    """
    turn = min(abs(turn_rad), 3.1)  # a full reversal has no arc tangent to both segments
    if turn <= _STRAIGHT_RAD:
        return 0.0, 0.0
    half = math.tan(turn / 2)
    missed_per_metre = math.tan(turn / 4)  # distance from the vertex to the arc, per metre of tangent
    needed = min(min_radius_m * half, (_MAX_DEVIATION_M + swing_m) / missed_per_metre)
    return needed, max(needed, min(_TOLERANCE_M / missed_per_metre, LARGEST_RADIUS_M * half))


def _share_segments(tangents: Sequence[tuple[float, float]], lengths: Sequence[float]) -> list[float]:
    """Return lengths of tangents.

    Two share each segment: first each gets the needed length, then both get as much more as fits.
    """
    shared = [liked for _, liked in tangents]
    for segment in range(len(lengths)):
        a, b = _shares(tangents, lengths, segment)
        shared[segment], shared[segment + 1] = min(shared[segment], a), min(shared[segment + 1], b)
    return shared


def _shares(tangents: Sequence[tuple[float, float]], lengths: Sequence[float], segment: int) -> tuple[float, float]:
    """Return the parts of a segment that the corners at its two ends get."""
    room = lengths[segment] * (_END_SHARE if segment in (0, len(lengths) - 1) else 1.0)
    (need_a, like_a), (need_b, like_b) = tangents[segment], tangents[segment + 1]
    if like_a + like_b <= room:
        return like_a, like_b
    if need_a + need_b >= room:
        scale = room / (need_a + need_b)
        return need_a * scale, need_b * scale
    share = (room - need_a - need_b) / (like_a + like_b - need_a - need_b)
    return need_a + share * (like_a - need_a), need_b + share * (like_b - need_b)
