"""Evaluation of a road's reference line: lines, arcs and ``paramPoly3`` by arc length, and projection onto it.

Lines and arcs are exact. A cubic's own parameter is not arc length, so its arc length is tabulated once and inverted,
which keeps ``s`` proportional to the distance travelled as OpenDRIVE demands (ASAM OpenDRIVE 1.7, section 7.3). Beyond
either end the line continues straight.
"""

from __future__ import annotations

import math
from bisect import bisect_right
from functools import cached_property
from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from trace_dag.common.geometry import hermite
from trace_dag.roads.map.cubic_profile import CubicProfile
from trace_dag.roads.map.curves import along_arc, along_arcs

if TYPE_CHECKING:
    from collections.abc import Sequence

    from numpy.typing import NDArray

    from trace_dag.common.geometry import FloatArray, Number
    from trace_dag.roads.map.model import PlanElement

    IntArray = NDArray[np.intp]

SAMPLE_STEP_M = 2.0
"""Spacing of the samples kept for finding where to start an exact projection."""
_TABLE_POINTS = 33


class Projection(NamedTuple):
    """Foot of a point on a reference line: ``s_m``, ``t_m`` to the left, ``beyond_m`` for the distance past its end."""

    s_m: float
    t_m: float
    beyond_m: float


class _ParamPoly3:
    """A ``paramPoly3`` element with its parameter as piecewise cubics over arc length."""

    __slots__ = ("coefficients", "parameter", "scale")

    def __init__(self, element: PlanElement) -> None:
        assert element.poly is not None
        self.coefficients = element.poly
        end = 1.0 if element.poly_normalized else element.length_m
        parameters = np.linspace(0.0, end, _TABLE_POINTS)
        _, b_u, c_u, d_u, _, b_v, c_v, d_v = element.poly
        middle = (parameters[:-1] + parameters[1:]) / 2
        speed = np.hypot(_slope(b_u, c_u, d_u, parameters), _slope(b_v, c_v, d_v, parameters))
        speed_middle = np.hypot(_slope(b_u, c_u, d_u, middle), _slope(b_v, c_v, d_v, middle))
        step = end / (_TABLE_POINTS - 1)
        # Simpson's rule. A curve that stands still is given some length, so that a cubic over it exists.
        pieces = np.maximum(step / 6 * (speed[:-1] + 4 * speed_middle + speed[1:]), 1e-12)
        lengths = np.concatenate([[0.0], np.cumsum(pieces)])
        # The declared length counts: the whole curve takes exactly that length.
        self.scale = float(lengths[-1]) / element.length_m if element.length_m > 0 else 1.0
        # Near a cusp the curve almost stands still: bounded by three times either neighbouring mean rate, the
        # interpolation stays monotone (Fritsch and Carlson, SIAM J. Numer. Anal. 17, 1980).
        means = step / pieces
        bounds = 3.0 * np.minimum(np.append(means, np.inf), np.append(np.inf, means))
        rates = np.minimum(1.0 / np.maximum(speed, 1e-12), bounds)
        cubics = hermite(np.diff(lengths), parameters[:-1], parameters[1:], rates[:-1], rates[1:])
        self.parameter = CubicProfile(lengths[:-1].tolist(), np.stack(cubics, axis=1).tolist())

    def at(self, ds_m: float) -> tuple[float, float, float, float]:
        """Return the u, v, heading and curvature in the element's own axes."""
        u, v, du, dv, bend = self._curve(self.parameter.at(ds_m * self.scale))
        speed = math.hypot(du, dv)
        return u, v, math.atan2(dv, du), bend / speed**3 if speed > 1e-9 else 0.0

    def sample(self, ds_m: FloatArray) -> tuple[FloatArray, FloatArray, FloatArray, FloatArray]:
        u, v, du, dv, bend = self._curve(self.parameter.sample(ds_m * self.scale))
        return u, v, np.arctan2(dv, du), bend / np.maximum(np.hypot(du, dv), 1e-9) ** 3

    def _curve(self, p: Number) -> tuple[Number, Number, Number, Number, Number]:
        """Return u and v, their slopes, and the curvature times the cube of the slope's length."""
        a_u, b_u, c_u, d_u, a_v, b_v, c_v, d_v = self.coefficients
        du, dv = _slope(b_u, c_u, d_u, p), _slope(b_v, c_v, d_v, p)
        return (
            a_u + p * (b_u + p * (c_u + p * d_u)),
            a_v + p * (b_v + p * (c_v + p * d_v)),
            du,
            dv,
            du * (2 * c_v + 6 * d_v * p) - dv * (2 * c_u + 6 * d_u * p),
        )


def _slope(b: float, c: float, d: float, p: Number) -> Number:
    return b + p * (2 * c + 3 * d * p)


class ReferenceLine:
    """A road's plan view, evaluated by ``s`` (metres from the road's start)."""

    def __init__(self, plan: Sequence[PlanElement], length_m: float) -> None:
        if not plan:
            raise ValueError("a road needs at least one piece of plan view")
        self.length_m = length_m
        self.elements = tuple(plan)
        self._starts = [element.s_m for element in self.elements]
        self._polys: dict[int, _ParamPoly3] = {}
        for index, element in enumerate(self.elements):
            if element.poly is not None:
                self._polys[index] = _ParamPoly3(element)

    def at(self, s_m: float) -> tuple[float, float, float, float]:
        """Return x, y (metres), heading (radians) and curvature (1/m, positive to the left) at ``s_m``."""
        if s_m < 0.0 or s_m > self.length_m:
            end_m = 0.0 if s_m < 0.0 else self.length_m
            x, y, heading, _ = self.at(end_m)
            return x + (s_m - end_m) * math.cos(heading), y + (s_m - end_m) * math.sin(heading), heading, 0.0
        index = bisect_right(self._starts, s_m) - 1 if len(self._starts) > 1 else 0
        return self._at_element(max(index, 0), s_m)

    def _at_element(self, index: int, s_m: float) -> tuple[float, float, float, float]:
        element = self.elements[index]
        ds = s_m - element.s_m
        poly = self._polys.get(index)
        if poly is not None:
            u, v, turn, curvature = poly.at(ds)
            c, s = math.cos(element.heading_rad), math.sin(element.heading_rad)
            return element.x_m + u * c - v * s, element.y_m + u * s + v * c, element.heading_rad + turn, curvature
        curvature = element.curvature_1pm
        return *along_arc(element.x_m, element.y_m, element.heading_rad, ds, curvature), curvature

    @property
    def has_cubics(self) -> bool:
        """Return whether a piece of it is a ``paramPoly3``."""
        return bool(self._polys)

    @cached_property
    def table(self) -> FloatArray:
        """Return ``s``, x, y, heading and curvature at the beginning of each piece, shape (5, n)."""
        return np.array([(e.s_m, e.x_m, e.y_m, e.heading_rad, e.curvature_1pm) for e in self.elements]).T

    @cached_property
    def _curved(self) -> bool:
        return any(element.curvature_1pm for element in self.elements)

    def sample(self, s_m: FloatArray) -> FloatArray:
        """Return x, y, heading and curvature at many ``s``, shape (n, 4); headings are continuous."""
        inside = np.minimum(np.maximum(s_m, 0.0), self.length_m)
        if len(self.elements) == 1:
            index: NDArray[np.intp] | int = 0
        else:
            index = np.maximum(np.searchsorted(self.table[0], inside, side="right") - 1, 0)
        start, x, y, heading, curvature = self.table[:, index]
        ds = inside - start
        out = np.empty((len(s_m), 4))
        if self._curved:
            out[:, 0], out[:, 1], out[:, 2] = along_arcs(x, y, heading, ds, curvature)
        else:
            out[:, 0], out[:, 1], out[:, 2] = x + ds * np.cos(heading), y + ds * np.sin(heading), heading
        out[:, 3] = curvature
        for number, poly in self._polys.items():
            chosen = np.broadcast_to(index == number, len(s_m))
            if chosen.any():
                element = self.elements[number]
                u, v, bend, k = poly.sample(ds[chosen])
                c, s = math.cos(element.heading_rad), math.sin(element.heading_rad)
                out[chosen, 0] = element.x_m + u * c - v * s
                out[chosen, 1] = element.y_m + u * s + v * c
                out[chosen, 2] = element.heading_rad + bend
                out[chosen, 3] = k
        beyond = s_m - inside
        if beyond.any():
            out[:, 0] += beyond * np.cos(out[:, 2])
            out[:, 1] += beyond * np.sin(out[:, 2])
        steps = out[1:, 2] - out[:-1, 2]
        if (np.abs(steps) >= np.pi).any():
            out[:, 2] = np.unwrap(out[:, 2])
        return out

    def stations(self, step_m: float, begin_m: float = 0.0, end_m: float | None = None) -> FloatArray:
        """Return the evenly spaced ``s`` from ``begin_m`` to ``end_m`` at most ``step_m`` apart, both ends included."""
        end = self.length_m if end_m is None else end_m
        pieces = max(1, math.ceil((end - begin_m) / step_m - 1e-9))
        stations = begin_m + np.arange(pieces + 1, dtype=np.float64) * ((end - begin_m) / pieces)
        stations[-1] = end
        return stations

    @cached_property
    def _samples(self) -> tuple[FloatArray, FloatArray]:
        stations = self.stations(SAMPLE_STEP_M)
        return stations, self.sample(stations)

    def project(self, x_m: float, y_m: float, near_s_m: float | None = None) -> Projection:
        """Return the foot of the perpendicular from a point, exact on every element.

        ``near_s_m`` selects a stretch (within two sample steps) if the line passes the point more than once; without it
        the nearest stretch is taken.
        """
        if near_s_m is None:
            stations, points = self._samples
            near_s_m = float(stations[np.argmin((points[:, 0] - x_m) ** 2 + (points[:, 1] - y_m) ** 2)])
        first = max(bisect_right(self._starts, near_s_m - 2 * SAMPLE_STEP_M) - 1, 0)
        last = max(bisect_right(self._starts, near_s_m + 2 * SAMPLE_STEP_M) - 1, 0)
        best, best_distance = near_s_m, math.inf
        for index in range(first, last + 1):
            s = self._foot(index, x_m, y_m, near_s_m)
            x, y, _, _ = self._at_element(index, s)
            distance = math.hypot(x_m - x, y_m - y)
            if distance < best_distance - 1e-12:
                best, best_distance = s, distance
        x, y, heading, _ = self.at(best)
        c, s = math.cos(heading), math.sin(heading)
        t = -(x_m - x) * s + (y_m - y) * c
        along = (x_m - x) * c + (y_m - y) * s
        if (best <= 0.0 and along < 0.0) or (best >= self.length_m and along > 0.0):
            return Projection(best, t, abs(along))
        # Off the perpendicular only on the outside of a kink: there the distance to the kink is the offset.
        return Projection(best, math.copysign(best_distance, t), 0.0)

    def _foot(self, index: int, x_m: float, y_m: float, near_s_m: float) -> float:
        """Return ``s`` of the point of one element nearest to a point."""
        element = self.elements[index]
        low = element.s_m
        high = self._starts[index + 1] if index + 1 < len(self._starts) else self.length_m
        high = max(high, low)
        dx, dy = x_m - element.x_m, y_m - element.y_m
        c, s = math.cos(element.heading_rad), math.sin(element.heading_rad)
        if index in self._polys:
            return self._foot_by_newton(index, x_m, y_m, min(max(near_s_m, low), high), low, high)
        k = element.curvature_1pm
        along = dx * c + dy * s
        if abs(k) < 1e-9:
            return min(max(low + along, low), high)
        # On an arc the foot is where the ray from the centre through the point meets the circle.
        left = -dx * s + dy * c
        turn = math.atan2(k * along, 1.0 - k * left) if k > 0 else math.atan2(-k * along, 1.0 - k * left)
        s_foot = low + (turn / abs(k)) % (math.tau / abs(k))
        if s_foot <= high:
            return s_foot
        start = math.hypot(dx, dy)
        x, y, _, _ = self._at_element(index, high)
        return low if start < math.hypot(x_m - x, y_m - y) else high

    def _foot_by_newton(self, index: int, x_m: float, y_m: float, guess: float, low: float, high: float) -> float:
        s_m = guess
        for _ in range(20):
            x, y, heading, curvature = self._at_element(index, s_m)
            c, s = math.cos(heading), math.sin(heading)
            along = (x_m - x) * c + (y_m - y) * s
            left = -(x_m - x) * s + (y_m - y) * c
            # Beyond the centre of curvature the step would have the wrong sign; there a plain descent step is used.
            step = along / max(1.0 - curvature * left, 0.3)
            moved = min(max(s_m + step, low), high)
            if abs(moved - s_m) < 1e-9:
                return moved
            s_m = moved
        return s_m


# --- many lines at once ----------------------------------------------------------------------------------------------
class Stations(NamedTuple):
    """Stations ``s_m`` on several lines or lanes, concatenated, (n,), with the owner of each.

    It also has the index of the first station of each line, and the number of all.
    """

    s_m: FloatArray
    owner: IntArray
    first: IntArray

    @property
    def slices(self) -> list[slice]:
        """Return the places of each line's stations."""
        ends = [*self.first[1:].tolist(), len(self.s_m)]
        return [slice(start, end) for start, end in zip(self.first.tolist(), ends, strict=True)]


def stations_between(begin_m: FloatArray, end_m: FloatArray, step_m: float) -> Stations:
    """Return evenly spaced stations of several stretches, (n,) each, at most ``step_m`` apart.

    Both ends are included.

    >>> stations_between(np.array([0.0, 10.0]), np.array([5.0, 11.0]), 2.5).s_m.tolist()
    [0.0, 2.5, 5.0, 10.0, 11.0]
    """
    pieces = np.maximum(np.ceil((end_m - begin_m) / step_m - 1e-9), 1.0).astype(np.intp)
    last = np.cumsum(pieces + 1) - 1
    first = last - pieces
    owner = np.repeat(np.arange(len(pieces)), pieces + 1)
    s_m = begin_m[owner] + (np.arange(len(owner)) - first[owner]) * ((end_m - begin_m) / pieces)[owner]
    s_m[last] = end_m
    return Stations(s_m, owner, first)


def sample_profiles(profiles: Sequence[CubicProfile], stations: Stations) -> FloatArray:
    """Return values of several profiles, each at its stations, (n,).

    >>> from trace_dag.roads.map.cubic_profile import CubicProfile
    >>> constant, rising = (CubicProfile([0.0], [(3.5, slope, 0.0, 0.0)]) for slope in (0.0, 0.5))
    >>> sample_profiles([constant, rising], stations_between(np.zeros(2), np.full(2, 4.0), 2.0)).tolist()
    [3.5, 3.5, 3.5, 3.5, 4.5, 5.5]
    """
    values = np.array([profile.pieces[0][0] for profile in profiles])[stations.owner]
    for profile, where in zip(profiles, stations.slices, strict=True):
        if profile.constant is None:
            values[where] = profile.sample(stations.s_m[where])
    return values


def sample_reference_lines(lines: Sequence[ReferenceLine], stations: Stations) -> FloatArray:
    """Return x, y (metres), heading (radians) and curvature (1/m) of several lines, each at its stations, (n, 4).

    Headings are continuous along each.
    """
    lengths_m = np.array([line.length_m for line in lines])
    inside = np.minimum(np.maximum(stations.s_m, 0.0), lengths_m[stations.owner])
    numbers = {line: number for number, line in enumerate(dict.fromkeys(lines))}
    table = np.concatenate([line.table for line in numbers], axis=1)
    sizes = np.array([len(line.elements) for line in numbers])
    first = np.cumsum(sizes) - sizes
    of_line = np.array([numbers[line] for line in lines])[stations.owner]
    at = first[of_line]
    for step in range(1, int(sizes.max(initial=0))):  # past each piece that ends before the station
        starts_m = np.where(step < sizes, table[0][np.minimum(first + step, table.shape[1] - 1)], np.inf)
        at += inside >= starts_m[of_line]
    start, x, y, heading, curvature = table[:, at]
    out = np.empty((len(at), 4))
    out[:, 0], out[:, 1], out[:, 2] = along_arcs(x, y, heading, inside - start, curvature)
    out[:, 3] = curvature
    beyond = stations.s_m - inside
    if beyond.any():
        out[:, 0] += beyond * np.cos(out[:, 2])
        out[:, 1] += beyond * np.sin(out[:, 2])
    steps = np.abs(np.diff(out[:, 2]))
    steps[stations.first[1:] - 1] = 0.0
    slices = stations.slices
    turned = set(stations.owner[:-1][steps >= np.pi].tolist())
    for number in turned | {number for number, line in enumerate(lines) if line.has_cubics}:
        out[slices[number]] = lines[number].sample(stations.s_m[slices[number]])
    return out
