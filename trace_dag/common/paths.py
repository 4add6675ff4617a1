"""Paths a body's centre can follow: smooth lane centres, lateral shifts, turns.

A path is geometry without time. Everything here keeps the heading continuous and the curvature free of jumps, so that a
vehicle model with limited steering rate can follow it. Frame: the local frame; headings radians CCW from east,
unwrapped along the path; curvature positive to the left.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from functools import cached_property

import numpy as np

from trace_dag.common.geometry import FloatArray, Pose, arc_lengths

STEP_M = 0.5  # spacing of path points: at a radius of 6 m the chord is 5 mm off the arc


@dataclass(frozen=True, eq=False)
class Path:
    """Points along a path, arrays of equal length n; ``s_m`` is the distance travelled, strictly increasing."""

    s_m: FloatArray
    x_m: FloatArray
    y_m: FloatArray
    z_m: FloatArray
    heading_rad: FloatArray

    @property
    def length_m(self) -> float:
        """Return the length of the path."""
        return float(self.s_m[-1])

    @cached_property
    def curvature_1pm(self) -> FloatArray:
        """Return the curvature at each point, shape (n,), 1/m."""
        return np.asarray(np.gradient(self.heading_rad, self.s_m))

    def plan(self, s_m: FloatArray) -> tuple[FloatArray, FloatArray, FloatArray]:
        """Return x, y and heading at distances ``s_m`` of any shape, extended straight beyond both ends."""
        s = np.asarray(s_m, float)
        heading = np.interp(s, self.s_m, self.heading_rad)
        x, y = np.interp(s, self.s_m, self.x_m), np.interp(s, self.s_m, self.y_m)
        first, last = float(self.s_m[0]), float(self.s_m[-1])
        if s.size and (float(s.min()) < first or float(s.max()) > last):
            beyond = np.minimum(s - first, 0.0) + np.maximum(s - last, 0.0)
            x, y = x + beyond * np.cos(heading), y + beyond * np.sin(heading)
        return x, y, heading

    def at(self, s_m: FloatArray) -> tuple[FloatArray, FloatArray, FloatArray, FloatArray]:
        """Return x, y, z and heading at distances ``s_m`` of any shape, straight and level beyond both ends."""
        x, y, heading = self.plan(s_m)
        return x, y, np.interp(np.asarray(s_m, float), self.s_m, self.z_m), heading

    def pose(self, s_m: float) -> Pose:
        """Return the pose at one distance; :meth:`at` takes many."""
        if not float(self.s_m[0]) <= s_m < float(self.s_m[-1]):
            x, y, z, heading = (float(value) for value in self.at(np.array(s_m)))
            return Pose(x, y, math.remainder(heading, math.tau), z)
        i = int(self.s_m.searchsorted(s_m, side="right")) - 1
        before, after = float(self.s_m[i]), float(self.s_m[i + 1])

        def between(values: FloatArray) -> float:
            first, second = float(values[i]), float(values[i + 1])
            return (second - first) / (after - before) * (s_m - before) + first

        heading = math.remainder(between(self.heading_rad), math.tau)
        return Pose(between(self.x_m), between(self.y_m), heading, between(self.z_m))

    def project(self, x_m: float, y_m: float, *, near_s_m: float | None = None) -> tuple[float, float]:
        """Return a point's closest distance along the path, and its offset to the left (metres).

        ``near_s_m`` limits the search to 60 m around it, for paths that pass the same place twice.
        """
        squared = (self.x_m - x_m) ** 2 + (self.y_m - y_m) ** 2
        if near_s_m is not None:
            squared = np.where(np.abs(self.s_m - near_s_m) <= 60.0, squared, np.inf)
        return self._beside(int(np.argmin(squared)), x_m, y_m)

    def project_all(self, x_m: FloatArray, y_m: FloatArray) -> FloatArray:
        """Return distances along the path and offsets to the left of points of shape (n, 2), as :meth:`project`."""
        squared = (self.x_m - x_m[:, None]) ** 2 + (self.y_m - y_m[:, None]) ** 2
        nearest = zip(squared.argmin(axis=1).tolist(), x_m.tolist(), y_m.tolist(), strict=True)
        return np.array([self._beside(*each) for each in nearest])

    def _beside(self, i: int, x_m: float, y_m: float) -> tuple[float, float]:
        """Return a point's distance along the path and offset to the left, given the nearest point of the path."""
        c, s = math.cos(self.heading_rad[i]), math.sin(self.heading_rad[i])
        dx, dy = x_m - float(self.x_m[i]), y_m - float(self.y_m[i])
        return float(self.s_m[i]) + dx * c + dy * s, dy * c - dx * s

    def reversed(self) -> Path:
        """Return the same line in the opposite direction."""
        return Path(
            self.s_m[-1] - self.s_m[::-1],
            self.x_m[::-1],
            self.y_m[::-1],
            self.z_m[::-1],
            self.heading_rad[::-1] + math.pi,
        )


def through_points(xyz_m: FloatArray, *, sigma_m: float) -> Path:
    """Return a smooth path along a polyline of shape (n, 3): resampled, then smoothed by a Gaussian of ``sigma_m``.

    A Gaussian leaves straight lines alone and moves an arc of radius R inward by ``sigma_m**2 / (2 R)``; it turns
    kinks and jumps of curvature into gradual ones.
    """
    s = arc_lengths(xyz_m)
    keep = np.concatenate([[True], np.diff(s) > 1e-6])
    s, points = s[keep], xyz_m[keep]
    n = max(2, round(float(s[-1]) / STEP_M) + 1)
    at = np.linspace(0.0, float(s[-1]), n)
    step = float(at[1])
    reach = min(math.ceil(3 * sigma_m / step), n - 1)
    offsets = np.arange(-reach, reach + 1) * step
    kernel = np.exp(-0.5 * (offsets / sigma_m) ** 2)
    kernel /= kernel.sum()
    columns = []
    for axis in range(3):
        # Odd reflection continues each end in its direction, so that the ends stay where they are.
        value = np.interp(at, s, points[:, axis])
        reflected = value[::-1]
        padded = np.concatenate([2 * value[0] - value[reach:0:-1], value, 2 * value[-1] - reflected[1 : reach + 1]])
        columns.append(np.convolve(padded, kernel, mode="valid"))
    return from_points(*columns)


def from_points(x_m: FloatArray, y_m: FloatArray, z_m: FloatArray) -> Path:
    """Return a path through dense points, its headings by central differences.

    >>> from_points(np.array([0.0, 3.0, 6.0]), np.array([0.0, 4.0, 8.0]), np.zeros(3)).length_m
    10.0
    """
    s = arc_lengths(np.column_stack([x_m, y_m]))
    heading = np.unwrap(np.arctan2(np.gradient(y_m, s), np.gradient(x_m, s)))
    return Path(s, np.asarray(x_m), np.asarray(y_m), np.asarray(z_m), heading)


def straight(pose: Pose, *, back_m: float, ahead_m: float) -> Path:
    """Return a straight path through ``pose``, which lies at ``s_m == back_m``.

    >>> straight(Pose(0.0, 0.0, 0.0), back_m=10.0, ahead_m=20.0).pose(10.0).xy_m.tolist()
    [0.0, 0.0]
    """
    s = np.linspace(0.0, back_m + ahead_m, max(2, math.ceil((back_m + ahead_m) / STEP_M) + 1))
    x = pose.x_m + (s - back_m) * math.cos(pose.heading_rad)
    y = pose.y_m + (s - back_m) * math.sin(pose.heading_rad)
    return Path(s, x, y, np.full_like(s, pose.z_m), np.full_like(s, pose.heading_rad))


def extended(path: Path, *, back_m: float = 0.0, ahead_m: float = 0.0) -> Path:
    """Return the path with straight pieces added at its ends.

    >>> extended(straight(Pose(0.0, 0.0, 0.0), back_m=10.0, ahead_m=20.0), ahead_m=5.0).length_m
    35.0
    """
    parts = []
    if back_m > 0:
        parts.append(np.arange(-math.ceil(back_m / STEP_M), 0) * STEP_M)
    parts.append(path.s_m)
    if ahead_m > 0:
        parts.append(path.length_m + np.arange(1, math.ceil(ahead_m / STEP_M) + 1) * STEP_M)
    s = np.concatenate(parts)
    x, y, z, heading = path.at(s)
    return Path(s - s[0], x, y, z, heading)


def _ramp(u: FloatArray) -> FloatArray:
    """Return a cubic from 0 to 1 with zero slope at both ends."""
    t = np.clip(u, 0.0, 1.0)
    return np.asarray(t * t * (3 - 2 * t))


def _ramp_integral(u: FloatArray) -> FloatArray:
    """Return the integral of :func:`_ramp` from 0 (1/2 at 1, growing by 1 per unit beyond)."""
    t = np.clip(u, 0.0, 1.0)
    return np.asarray(t**3 - 0.5 * t**4 + np.maximum(u - 1.0, 0.0))


@dataclass(frozen=True)
class LateralShift:
    """A smooth move sideways by ``total_m`` (left positive), anchored where it has reached ``at_anchor_m``.

    The slope rises over ``ramp_m`` to ``slope`` (positive), holds, and falls over ``ramp_m``.
    """

    total_m: float
    at_anchor_m: float
    slope: float
    ramp_m: float

    @property
    def length_m(self) -> float:
        """Return the distance along the road from beginning to end of the move."""
        return abs(self.total_m) / self.slope + self.ramp_m

    def offset(self, s_m: FloatArray, anchor_s_m: float) -> tuple[FloatArray, FloatArray]:
        """Return the offset to the left and its slope at distances along the base path."""
        hold_end = self.length_m - self.ramp_m
        u = np.asarray(s_m, float) - anchor_s_m + self._anchor_from_start()
        rise, fall = u / self.ramp_m, (u - hold_end) / self.ramp_m
        sign = math.copysign(1.0, self.total_m)
        offset = self.slope * self.ramp_m * (_ramp_integral(rise) - _ramp_integral(fall))
        return sign * offset, sign * self.slope * (_ramp(rise) - _ramp(fall))

    def _anchor_from_start(self) -> float:
        """Return the distance from the beginning of the shift to its anchor, by bisection of the monotonic offset."""
        target = abs(self.at_anchor_m)
        if target >= abs(self.total_m) - 1e-9:
            return self.length_m
        u = np.linspace(0.0, self.length_m, 257)
        hold_end = self.length_m - self.ramp_m
        d = self.slope * self.ramp_m * (_ramp_integral(u / self.ramp_m) - _ramp_integral((u - hold_end) / self.ramp_m))
        return float(np.interp(target, d, u))


def shifted(path: Path, shift: LateralShift | None, *, anchor_s_m: float, constant_m: float = 0.0) -> Path:
    """Return the path moved sideways by ``constant_m`` everywhere and by ``shift`` around ``anchor_s_m``.

    On a straight road the result has the shift's own shape; on a curved one the offset is laid along the path's
    normals.

    >>> line = np.linspace(0.0, 20.0, 41)
    >>> east = from_points(line, np.zeros(41), np.zeros(41))
    >>> shifted(east, None, anchor_s_m=10.0, constant_m=1.5).pose(10.0).y_m  # to the left of east is north
    1.5
    """
    if shift is None:
        offset, slope = np.zeros_like(path.s_m), np.zeros_like(path.s_m)
    else:
        offset, slope = shift.offset(path.s_m, anchor_s_m)
    offset = offset + constant_m
    heading = path.heading_rad + np.arctan2(slope, 1.0 - offset * path.curvature_1pm)
    x = path.x_m - offset * np.sin(path.heading_rad)
    y = path.y_m + offset * np.cos(path.heading_rad)
    return Path(arc_lengths(np.column_stack([x, y])), x, y, path.z_m, heading)


@dataclass(frozen=True)
class TurnShape:
    """Clothoid, arc, clothoid: a turn by ``angle_rad`` (left positive) with radius ``radius_m`` at its tightest."""

    angle_rad: float
    radius_m: float
    ramp_m: float

    @property
    def peak_curvature_1pm(self) -> float:
        """Return the curvature of the arc; less than 1 / radius if the ramps alone turn by the angle."""
        return min(1.0 / self.radius_m, abs(self.angle_rad) / self.ramp_m)

    @property
    def length_m(self) -> float:
        """Return the length of the whole turn."""
        return abs(self.angle_rad) / self.peak_curvature_1pm + self.ramp_m

    def heading_change(self, u_m: FloatArray) -> FloatArray:
        """Return the heading gained after ``u_m`` of the turn."""
        peak, total, ramp = self.peak_curvature_1pm, self.length_m, self.ramp_m
        u = np.clip(u_m, 0.0, total)
        rise = np.minimum(u, ramp)
        fall = np.maximum(u - (total - ramp), 0.0)
        change = peak * (rise**2 / (2 * ramp) + np.maximum(u - ramp, 0.0) - fall**2 / (2 * ramp))
        return np.asarray(math.copysign(1.0, self.angle_rad) * change)

    def displacement_m(self) -> tuple[float, float]:
        """Return the end of the turn, ahead and to the left of its beginning."""
        u = np.linspace(0.0, self.length_m, 65)
        mid = (u[1:] + u[:-1]) / 2
        heading = self.heading_change(mid)
        step = float(u[1])
        return float(np.cos(heading).sum() * step), float(np.sin(heading).sum() * step)


def turned(path: Path, shape: TurnShape, *, start_s_m: float, tail_m: float) -> Path:
    """Return the path up to ``start_s_m``, then the turn, then straight on for ``tail_m``.

    >>> line = np.linspace(0.0, 20.0, 41)
    >>> east = from_points(line, np.zeros(41), np.zeros(41))
    >>> path = turned(east, TurnShape(math.pi / 2, 8.0, 2.0), start_s_m=10.0, tail_m=5.0)
    >>> round(math.degrees(path.heading_rad[-1]), 3)  # a quarter turn to the left: north
    90.0
    """
    before = path.s_m[path.s_m < start_s_m - 1e-6]
    x0, y0, z0, h0 = (float(value) for value in path.at(np.array(start_s_m)))
    u = np.linspace(0.0, shape.length_m + tail_m, math.ceil((shape.length_m + tail_m) / STEP_M * 2) + 1)
    step = float(u[1])
    heading = h0 + shape.heading_change((u[1:] + u[:-1]) / 2)
    x = x0 + np.concatenate([[0.0], np.cumsum(np.cos(heading) * step)])
    y = y0 + np.concatenate([[0.0], np.cumsum(np.sin(heading) * step)])
    n = len(before)
    bx, by, bz, bh = path.at(before)
    return Path(
        np.concatenate([before, start_s_m + u]),
        np.concatenate([bx, x]),
        np.concatenate([by, y]),
        np.concatenate([bz, np.full_like(u, z0)]),
        np.concatenate([bh, h0 + shape.heading_change(u)]) if n else h0 + shape.heading_change(u),
    )


def turn_start_to_meet(path: Path, shape: TurnShape, exit_pose: Pose, *, near_s_m: float) -> float | None:
    """Return the distance along a (locally straight) path at which a turn must begin to end on the exit's line.

    The line goes through ``exit_pose``. None if approach and exit are parallel, because then no such turn exists.

    >>> line = np.linspace(0.0, 40.0, 81)
    >>> east = from_points(line, np.zeros(81), np.zeros(81))
    >>> shape = TurnShape(math.pi / 2, 8.0, 2.0)
    >>> start = turn_start_to_meet(east, shape, Pose(30.0, 20.0, math.pi / 2), near_s_m=10.0)
    >>> round(start + shape.displacement_m()[0], 6)  # ends on the line x = 30 m
    30.0
    """
    pose = path.pose(near_s_m)
    ahead_m, left_m = shape.displacement_m()
    end = pose.to_world(np.array([ahead_m, left_m]))
    normal = np.array([-math.sin(exit_pose.heading_rad), math.cos(exit_pose.heading_rad)])
    across = float(normal @ pose.forward)
    if abs(across) < 0.2:
        return None
    return near_s_m + float(normal @ (exit_pose.xy_m - end)) / across
