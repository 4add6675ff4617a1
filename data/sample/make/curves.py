"""Plane curves: polylines with rounded corners, offset curves, lateral drifts, turns. Metres and radians throughout."""

from __future__ import annotations

import itertools
import math
from dataclasses import dataclass
from functools import cached_property

import numpy as np

from make.plane import FloatArray

STEP_M = 0.25


@dataclass(frozen=True, eq=False)
class Curve:
    """A densely sampled curve, shape (n, 2), parametrised by arc length."""

    xy: FloatArray

    @cached_property
    def s(self) -> FloatArray:
        """Arc length at each sample."""
        return np.concatenate([[0.0], np.cumsum(np.linalg.norm(np.diff(self.xy, axis=0), axis=1))])

    @property
    def length(self) -> float:
        """Total arc length."""
        return float(self.s[-1])

    @cached_property
    def _heading(self) -> FloatArray:
        step = np.diff(self.xy, axis=0)
        of_segments = np.unwrap(np.arctan2(step[:, 1], step[:, 0]))
        middles = np.concatenate([[of_segments[0]], (of_segments[:-1] + of_segments[1:]) / 2, [of_segments[-1]]])
        return np.asarray(middles)

    def heading(self, s: float) -> float:
        """Direction of the curve at ``s``."""
        return float(np.interp(s, self.s, self._heading))

    def point(self, s: float) -> FloatArray:
        """Point at ``s``; before the start and after the end the curve goes on straight."""
        if s < 0 or s > self.length:
            end = 0.0 if s < 0 else self.length
            h = self.heading(end)
            return self.point(end) + (s - end) * np.array([math.cos(h), math.sin(h)])
        return np.array([np.interp(s, self.s, self.xy[:, 0]), np.interp(s, self.s, self.xy[:, 1])])

    def station(self, point: FloatArray) -> float:
        """Arc length of the place nearest to ``point``."""
        a, b = self.xy[:-1], self.xy[1:]
        ab = b - a
        t = np.clip(((point - a) * ab).sum(1) / np.maximum((ab**2).sum(1), 1e-12), 0, 1)
        distance = np.linalg.norm(a + t[:, None] * ab - point, axis=1)
        i = int(distance.argmin())
        return float(self.s[i] + t[i] * np.linalg.norm(ab[i]))

    def distance(self, point: FloatArray) -> float:
        """Distance of ``point`` from the curve."""
        return float(np.linalg.norm(self.point(self.station(point)) - point))

    def part(self, s0: float, s1: float) -> Curve:
        """The piece from ``s0`` to ``s1``; reversed if ``s1`` is smaller."""
        low, high = min(s0, s1), max(s0, s1)
        inside = self.s[(self.s > low + 1e-6) & (self.s < high - 1e-6)]
        piece = np.array([self.point(s) for s in [low, *inside, high]])
        return Curve(piece if s1 >= s0 else piece[::-1])

    def reversed(self) -> Curve:
        """The same curve driven the other way."""
        return Curve(self.xy[::-1])

    def offset(self, left_m: float | FloatArray) -> Curve:
        """The parallel curve ``left_m`` to the left (a number, or one per sample)."""
        normal = np.stack([-np.sin(self._heading), np.cos(self._heading)], axis=1)
        return Curve(self.xy + np.broadcast_to(left_m, self.s.shape)[:, None] * normal)

    def drifting(self, knots: list[tuple[float, float]]) -> Curve:
        """The curve left of itself by an offset that moves smoothly between ``knots`` (arc length, metres left)."""
        stations = np.array([k[0] for k in knots])
        offsets = np.array([k[1] for k in knots])
        left = np.full(self.s.shape, offsets[0])
        for i in range(len(knots) - 1):
            t = np.clip((self.s - stations[i]) / (stations[i + 1] - stations[i]), 0, 1)
            # Quintic: no jump in curvature, as a steered wheel has none.
            left = np.where(
                self.s >= stations[i], offsets[i] + (offsets[i + 1] - offsets[i]) * t**3 * (10 + t * (6 * t - 15)), left
            )
        return self.offset(left)


def corners(points: FloatArray, radii: dict[int, float] | float = 0.0, sagitta_m: float | None = None) -> FloatArray:
    """A polyline, shape (n, 2), whose inner corners are replaced by arcs of the given radii (by index; 0 stays sharp).

    Arcs are sampled every :data:`STEP_M`, or, as a mapper draws them, as sparsely as ``sagitta_m`` of error allows.
    """
    pieces: list[FloatArray] = [points[:1]]
    for i in range(1, len(points) - 1):
        radius = radii if isinstance(radii, float) else radii.get(i, 0.0)
        before, after = points[i] - points[i - 1], points[i + 1] - points[i]
        before, after = before / np.linalg.norm(before), after / np.linalg.norm(after)
        turn = math.atan2(before[0] * after[1] - before[1] * after[0], float(before @ after))
        if radius == 0 or abs(turn) < 1e-9:
            pieces.append(points[i : i + 1])
            continue
        tangent = radius * math.tan(abs(turn) / 2)
        start = points[i] - tangent * before
        centre = start + math.copysign(radius, turn) * np.array([-before[1], before[0]])
        step = STEP_M if sagitta_m is None else math.sqrt(8 * radius * sagitta_m)
        angles = np.linspace(0, turn, max(2, math.ceil(abs(turn) * radius / step) + 1))
        c, s = np.cos(angles), np.sin(angles)
        x, y = start - centre
        pieces.append(centre + np.stack([c * x - s * y, s * x + c * y], axis=1))
    pieces.append(points[-1:])
    return np.concatenate(pieces)


def dense(points: FloatArray, step_m: float = STEP_M) -> Curve:
    """A polyline sampled every ``step_m`` or closer."""
    pieces: list[FloatArray] = []
    for a, b in itertools.pairwise(points):
        n = max(1, math.ceil(float(np.linalg.norm(b - a)) / step_m - 1e-9))
        pieces.append(a + (b - a) * (np.arange(n) / n)[:, None])
    return Curve(np.concatenate([*pieces, points[-1:]]))


def rounded(points: FloatArray, radii: dict[int, float] | float = 0.0) -> Curve:
    """The densely sampled polyline with rounded corners."""
    return dense(corners(points, radii))


def turning(incoming: Curve, outgoing: Curve, radius_m: float, near: FloatArray) -> Curve:
    """Along ``incoming``, round an arc, along ``outgoing``: the turn a driver makes near the crossing at ``near``."""
    s_in, s_out = incoming.station(near), outgoing.station(near)
    p, h = incoming.point(s_in), incoming.heading(s_in)
    q, k = outgoing.point(s_out), outgoing.heading(s_out)
    a, b = np.array([math.cos(h), math.sin(h)]), np.array([math.cos(k), math.sin(k)])
    t, r = np.linalg.solve(np.stack([a, -b], axis=1), q - p)
    corner = p + t * a
    tangent = radius_m * math.tan(abs(math.remainder(k - h, math.tau)) / 2)
    before = incoming.part(0, s_in + t - tangent)
    after = outgoing.part(s_out + r + tangent, outgoing.length)
    bend = rounded(np.stack([before.xy[-1], corner, after.xy[0]]), radius_m)
    return Curve(np.concatenate([before.xy[:-1], bend.xy[:-1], after.xy]))
