"""First contact of two bodies moving along paths: its time, place, and areas on both bodies.

The bodies are rectangles, two for a vehicle with a trailer. Paths and speeds do not determine how far one body is ahead
of the other (the timing). :func:`first_contacts` examines a whole range of timings at once. It moves both bodies
forward from positions apart, so that every contact it returns is a first one: they touch, do not overlap, and have not
touched before. Frame: the local frame.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from functools import cached_property
from itertools import product
from typing import Final

import numpy as np
from numpy.typing import NDArray

from trace_dag.common.geometry import FloatArray, Poses, gaps_m
from trace_dag.common.paths import Path
from trace_dag.crash.record import ImpactArea, VehicleRecord
from trace_dag.crash.trailer import Trailer

TOUCH_M = 0.10  # corners this close belong to the contact: parallel faces touch along a length, bodies give a little
_LAST_BITS_M = 1e-6  # widths of 1.84 and 2.04 m differ by twice TOUCH_M: their last bits must not decide
GRID_STEP_M = 0.5  # farthest a body moves between two tests for contact
MAX_GRID_STEPS = 400
MAX_TIMING_RANGE_S = 8.0
STANDING_MPS = 0.05
_STEPS_AT_ONCE = 8
_PATHS_BEND = 1.01  # margin, as a path's points can be nearer to each other than the distances along it say
_FRONT_RAD: Final = math.radians(45)
_REAR_RAD: Final = math.radians(135)
_EDGE: Final = 0.85  # share of half the width: what moves along and is struck at a side is caught by the corner


@dataclass(frozen=True, eq=False)
class Shape:
    """Rectangles over time: poses of any shape, length and width (m).

    It also has the middle and length of the body to which clock positions refer: for a combination vehicle, the
    combination in line with this part.
    """

    poses: Poses
    size_m: tuple[float, float]
    middle: Poses
    middle_length_m: float


def shapes(
    poses: Poses, size_m: tuple[float, float], trailer: Trailer | None, trailer_heading_rad: FloatArray | None
) -> tuple[Shape, ...]:
    """Return the rectangles of a vehicle: its own, and its trailer's.

    >>> (alone,) = shapes((np.zeros(1), np.zeros(1), np.zeros(1)), (4.8, 1.8), None, None)
    >>> alone.size_m
    (4.8, 1.8)
    """
    if trailer is None or trailer_heading_rad is None:
        return (Shape(poses, size_m, poses, size_m[0]),)
    behind, whole_m = trailer.behind(poses, size_m[0], trailer_heading_rad), trailer.combination_length_m
    return (
        Shape(poses, size_m, trailer.middle_by_puller(poses, size_m[0]), whole_m),
        Shape(behind, (trailer.length_m, trailer.width_m), trailer.middle_by_trailer(behind), whole_m),
    )


def shape_gaps_m(one: tuple[Shape, ...], two: tuple[Shape, ...]) -> FloatArray:
    """Return the least gaps between any rectangles of two vehicles, as :func:`trace_dag.common.geometry.gaps_m`.

    >>> here, there = ((np.array([x]), np.zeros(1), np.zeros(1)) for x in (0.0, 10.0))
    >>> one, two = (shapes(poses, (4.0, 2.0), None, None) for poses in (here, there))
    >>> shape_gaps_m(one, two).tolist()  # 10 m less half a length on each side
    [6.0]
    """
    gaps = [gaps_m(a.poses, a.size_m, b.poses, b.size_m) for a, b in product(one, two)]
    least = gaps[0]
    for gap in gaps[1:]:
        least = np.minimum(least, gap)
    return least


@dataclass(frozen=True, eq=False)
class Mover:
    """A rectangle whose centre moves along a path at constant speed; it is at ``station_m`` at its time 0.

    ``backing``: the body faces against its motion. A ``trailer`` follows as it does at low speed.
    """

    path: Path
    station_m: float
    speed_mps: float
    length_m: float
    width_m: float
    backing: bool = False
    trailer: Trailer | None = None

    @classmethod
    def of(cls, vehicle: VehicleRecord, path: Path, station_m: float, speed_mps: float, *, backing: bool) -> Mover:
        """Return a mover for a vehicle of a report, with its trailer."""
        return cls(path, station_m, speed_mps, vehicle.length_m, vehicle.width_m, backing, vehicle.trailer)

    @property
    def reach_m(self) -> float:
        """Return the distance from the centre to the farthest corner."""
        behind_m = 0.0 if self.trailer is None else self.trailer.combination_length_m - self.length_m
        return math.hypot(self.length_m / 2 + behind_m, self.width_m / 2)

    def at(self, time_s: FloatArray) -> tuple[FloatArray, FloatArray, FloatArray]:
        """Return x, y and heading of the body at times of any shape."""
        x, y, heading = self.path.plan(self.station_m + self.speed_mps * np.asarray(time_s, float))
        return x, y, heading + math.pi if self.backing else heading

    def shapes_at(self, time_s: FloatArray) -> tuple[Shape, ...]:
        """Return its rectangles at times of any shape."""
        poses, size_m = self.at(time_s), (self.length_m, self.width_m)
        if self.trailer is None:
            return shapes(poses, size_m, None, None)
        stations = self.station_m + self.speed_mps * np.asarray(time_s, float)
        return shapes(poses, size_m, self.trailer, poses[2] if self.backing else self._trailing(stations))

    def _trailing(self, stations_m: FloatArray) -> FloatArray:
        return np.asarray(np.interp(stations_m, self.path.s_m, self._following))

    @cached_property
    def _following(self) -> FloatArray:
        assert self.trailer is not None
        return self.trailer.following((self.path.x_m, self.path.y_m, self.path.heading_rad), self.length_m)


@dataclass(frozen=True, eq=False)
class Contacts:
    """First contacts, arrays of equal length n, one entry per timing that leads to a contact.

    ``time_1_s`` and ``time_2_s`` are each mover's own time at the contact; ``x_m``, ``y_m`` the contact point;
    ``bearing_*_rad`` its direction on each body as in :func:`trace_dag.common.geometry.body_bearing_rad`.
    """

    time_1_s: FloatArray
    time_2_s: FloatArray
    x_m: FloatArray
    y_m: FloatArray
    bearing_1_rad: FloatArray
    bearing_2_rad: FloatArray

    def __len__(self) -> int:
        return len(self.time_1_s)


def first_contacts(one: Mover, two: Mover, *, timings: int, span_s: float = 0.0) -> Contacts:
    """Return the first contacts for ``timings`` timings around the one at which both reach their stations.

    With ``timings`` 1 only that timing is examined. Timings without a contact, or with bodies touching from the
    beginning, are left out. The examined time span is the time in which the bodies pass each other, at least
    ``span_s``.
    """
    moving = [mover.speed_mps for mover in (one, two) if mover.speed_mps > STANDING_MPS]
    if not moving:
        return _nothing()
    reach = one.reach_m + two.reach_m
    crossing_time = min(reach / min(moving), MAX_TIMING_RANGE_S)
    before, after = max(2 * crossing_time, span_s), max(1.5 * crossing_time, span_s / 2)
    step = max(GRID_STEP_M / max(moving), (before + after) / MAX_GRID_STEPS)
    time = np.arange(-before, after + step, step)
    if timings == 1:
        ahead = np.zeros(1)
    else:
        widest = min(math.fsum(reach / speed for speed in moving), MAX_TIMING_RANGE_S)
        ahead = np.linspace(-widest, widest, timings)
    rows, index = _first_touching(one, two, time, ahead)
    rows, index = rows[index > 0], index[index > 0]
    if len(rows) == 0:
        return _nothing()
    last_apart = time[index - 1]
    width = np.full(len(rows), step)
    for _ in range(5):  # multisection: each round narrows the bracket eightfold, to a few micrometres
        inner = last_apart[:, None] + width[:, None] * np.arange(1, 9)[None, :] / 8
        gap = shape_gaps_m(one.shapes_at(inner + ahead[rows, None] / 2), two.shapes_at(inner - ahead[rows, None] / 2))
        first = np.argmax(gap <= 0, axis=1)
        first = np.where((gap <= 0).any(axis=1), first, 7)
        width = width / 8
        last_apart = last_apart + first * width
    time_1, time_2 = last_apart + ahead[rows] / 2, last_apart - ahead[rows] / 2
    return _describe(one, two, time_1, time_2)


def _first_touching(
    one: Mover, two: Mover, time_s: FloatArray, ahead_s: FloatArray
) -> tuple[NDArray[np.intp], NDArray[np.intp]]:
    """Return the timings at which the bodies touch, each with the index into ``time_s`` of the first touch.

    Each mover gets half of the timing, so that both stay near their stations. Only the distance of the centres is
    tested every few steps; the bodies are tested if they are near enough to touch within these steps.
    """
    half_s = ahead_s[:, None] / 2
    coarse_s = time_s[::_STEPS_AT_ONCE]
    x_1, y_1, _ = one.at(coarse_s + half_s)
    x_2, y_2, _ = two.at(coarse_s - half_s)
    travel_m = _STEPS_AT_ONCE * float(time_s[1] - time_s[0]) * (abs(one.speed_mps) + abs(two.speed_mps))
    row, block = np.nonzero(np.hypot(x_2 - x_1, y_2 - y_1) <= (one.reach_m + two.reach_m + travel_m) * _PATHS_BEND)
    column = np.minimum(block[:, None] * _STEPS_AT_ONCE + np.arange(_STEPS_AT_ONCE), len(time_s) - 1)
    fine_s, half_s = time_s[column], half_s[row]
    gap = shape_gaps_m(one.shapes_at(fine_s + half_s), two.shapes_at(fine_s - half_s))
    found, step = np.nonzero(gap <= 0)  # by timing, then in the order of time
    timings, first = np.unique(row[found], return_index=True)
    return timings, column[found[first], step[first]]


def _describe(one: Mover, two: Mover, time_1: FloatArray, time_2: FloatArray) -> Contacts:
    touch = _touching_shapes(one.shapes_at(time_1), two.shapes_at(time_2))
    keep = touch.found
    return Contacts(
        time_1[keep],
        time_2[keep],
        touch.x_m[keep],
        touch.y_m[keep],
        touch.bearing_1_rad[keep],
        touch.bearing_2_rad[keep],
    )


@dataclass(frozen=True, eq=False)
class ContactPoints:
    """Contacts of pairs of rectangles, arrays of equal length n.

    Each has a point, its direction on each body as in :func:`trace_dag.common.geometry.body_bearing_rad`, and a flag
    for whether there is a contact.
    """

    x_m: FloatArray
    y_m: FloatArray
    bearing_1_rad: FloatArray
    bearing_2_rad: FloatArray
    found: NDArray[np.bool_]


def find_contact_points(
    state_1: Poses, size_1_m: tuple[float, float], state_2: Poses, size_2_m: tuple[float, float]
) -> ContactPoints:
    """Find the contact of bodies that have just met: the mean of each body's corners that touch the other.

    Args: state_1: x, y and heading of the first bodies, each of shape (n,). size_1_m: length and width of the first
    bodies. state_2: as ``state_1``, of the second ones. size_2_m: as ``size_1_m``, of the second ones.

    >>> one, two = ((np.array([x]), np.zeros(1), np.zeros(1)) for x in (0.0, 4.0))  # head to tail, 4 m long
    >>> touch = find_contact_points(one, (4.0, 2.0), two, (4.0, 2.0))
    >>> touch.x_m.tolist(), touch.y_m.tolist()
    ([2.0], [0.0])
    """
    corners_1, corners_2 = _corners(state_1, size_1_m), _corners(state_2, size_2_m)
    inside_2 = _within(corners_1, state_2, size_2_m)
    inside_1 = _within(corners_2, state_1, size_1_m)
    corners = np.concatenate([corners_1, corners_2], axis=1)
    weight = np.concatenate([inside_2, inside_1], axis=1).astype(float)
    count = np.maximum(weight.sum(axis=1), 1.0)
    x = (corners[..., 0] * weight).sum(axis=1) / count
    y = (corners[..., 1] * weight).sum(axis=1) / count
    bearing_1, bearing_2 = _bearing(x, y, state_1, size_1_m), _bearing(x, y, state_2, size_2_m)
    return ContactPoints(x, y, bearing_1, bearing_2, np.asarray(weight.any(axis=1)))


def _touching_shapes(one: tuple[Shape, ...], two: tuple[Shape, ...]) -> ContactPoints:
    """Find the contact of vehicles that may have trailers and have just met.

    It is between the parts that are nearest to each other. Poses have shape (n,).
    """
    pairs = list(product(one, two))
    nearest = np.argmin([gaps_m(a.poses, a.size_m, b.poses, b.size_m) for a, b in pairs], axis=0)
    found = [_touching_parts(a, b) for a, b in pairs]
    if len(found) == 1:
        return found[0]

    def of_nearest(values: list[FloatArray]) -> FloatArray:
        return np.asarray(np.choose(nearest, values))

    return ContactPoints(
        of_nearest([touch.x_m for touch in found]),
        of_nearest([touch.y_m for touch in found]),
        of_nearest([touch.bearing_1_rad for touch in found]),
        of_nearest([touch.bearing_2_rad for touch in found]),
        np.asarray(np.choose(nearest, [touch.found for touch in found])),
    )


def _touching_parts(one: Shape, two: Shape) -> ContactPoints:
    touch = find_contact_points(one.poses, one.size_m, two.poses, two.size_m)
    bearing_1, bearing_2 = (
        _bearing(touch.x_m, touch.y_m, part.middle, (part.middle_length_m, part.size_m[1])) for part in (one, two)
    )
    return ContactPoints(touch.x_m, touch.y_m, bearing_1, bearing_2, touch.found)


def _corners(state: Poses, size_m: tuple[float, float]) -> FloatArray:
    x, y, heading = (value[:, None] for value in state)
    u = np.array([1, -1, -1, 1]) * size_m[0] / 2
    v = np.array([1, 1, -1, -1]) * size_m[1] / 2
    c, s = np.cos(heading), np.sin(heading)
    return np.stack([x + u * c - v * s, y + u * s + v * c], axis=-1)


def _within(points: FloatArray, state: Poses, size_m: tuple[float, float]) -> FloatArray:
    x, y, heading = (value[:, None] for value in state)
    dx, dy = points[..., 0] - x, points[..., 1] - y
    c, s = np.cos(heading), np.sin(heading)
    ahead, left = np.abs(dx * c + dy * s), np.abs(dy * c - dx * s)
    within_m = TOUCH_M + _LAST_BITS_M
    return np.asarray((ahead <= size_m[0] / 2 + within_m) & (left <= size_m[1] / 2 + within_m))


def _bearing(x: FloatArray, y: FloatArray, state: Poses, size_m: tuple[float, float]) -> FloatArray:
    dx, dy = x - state[0], y - state[1]
    c, s = np.cos(state[2]), np.sin(state[2])
    return np.asarray(np.arctan2((dy * c - dx * s) / size_m[1], (dx * c + dy * s) / size_m[0]))


def _nothing() -> Contacts:
    empty = np.zeros(0)
    return Contacts(empty, empty, empty, empty, empty, empty)


# --- points of a reported area ---------------------------------------------------------------------------------------
@dataclass(frozen=True)
class ContactPoint:
    """A point of a vehicle's outline, in its own axes, with the outward normal of the face."""

    ahead_m: float
    left_m: float
    normal: tuple[float, float]


def contact_points_of(area: ImpactArea | None, half_length: float, half_width: float) -> list[ContactPoint]:
    """Return contact points to try: that of the area, then the corner beside it, then the middle of the front.

    >>> contact_points_of(None, 2.4, 0.9)[0]  # nothing reported: the middle of the front
    ContactPoint(ahead_m=2.4, left_m=0.0, normal=(1.0, 0.0))
    """
    bearing = 0.0 if area is None else area.centre_rad
    side = math.copysign(1.0, bearing)

    def front(share: float) -> ContactPoint:
        return ContactPoint(half_length, share * half_width, (1.0, 0.0))

    def rear(share: float) -> ContactPoint:
        return ContactPoint(-half_length, share * half_width, (-1.0, 0.0))

    if abs(bearing) <= _FRONT_RAD:
        first = front(max(-_EDGE, min(_EDGE, math.tan(bearing))))
        return [first, rear(0.0)] if area is None else [first]
    if abs(bearing) >= _REAR_RAD:
        return [rear(max(-_EDGE, min(_EDGE, -math.tan(bearing))))]
    along = half_length / math.tan(abs(bearing))
    beside = ContactPoint(along, side * half_width, (0.0, side))
    return [beside, front(side * _EDGE) if along >= 0 else rear(side * _EDGE), front(side * _EDGE)]
