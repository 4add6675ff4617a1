"""The true motion of two vehicles: each follows its path at its own speed until their bodies first touch.

Poses are of the body's centre, headings radians counter-clockwise from east, in the town plane. A vehicle's heading is
that of its path, or the reverse when it backs.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from functools import cached_property
from typing import NamedTuple

import numpy as np
import shapely

from make.curves import Curve
from make.plane import FloatArray

MPS_PER_MPH = 0.44704
LEAD_TIME_S = 5.0
# Bodies closer than this touch. They never overlap in what is stored.
TOUCH_M = 0.002
# What crushes within the first instant: faces this near to each other belong to one contact.
CRUSH_M = 0.06
TRAILS_M = 400.0


@dataclass(frozen=True)
class Pulled:
    """A semitrailer: outer dimensions, and how far behind its front its kingpin and the middle of its axles are; how
    far behind the front of its tractor it is coupled (metres)."""

    length_m: float
    width_m: float
    kingpin_m: float
    axle_m: float
    coupled_m: float

    @property
    def whole_m(self) -> float:
        """Length of both in line."""
        return self.coupled_m - self.kingpin_m + self.length_m


@dataclass(frozen=True)
class Body:
    """A vehicle's outer dimensions (metres), its FARS body type, and a make and model with their FARS codes. With a
    trailer ``length_m`` is that of what pulls it."""

    kind: str
    length_m: float
    width_m: float
    height_m: float
    mass_kg: float
    body_type: int
    make: tuple[int, str]
    model: tuple[int, str]
    trailers: int = 0
    pulled: Pulled | None = None


class State(NamedTuple):
    """Where a body is, how it points, how fast it goes (negative backward), and how its trailer points."""

    x_m: float
    y_m: float
    heading_rad: float
    speed_mps: float
    trailer_rad: float = 0.0


@dataclass(frozen=True)
class Speed:
    """Speed along the path as a function of time, zero time being when the vehicle would reach its anchor.

    ``change_mps2`` acts from ``change_s`` seconds before that time on (braking negative); a vehicle with ``mph`` 0
    and a positive change is at rest before.
    """

    mph: float
    change_mps2: float = 0.0
    change_s: float = 0.0

    @property
    def initial_mps(self) -> float:
        """Speed before any change."""
        return self.mph * MPS_PER_MPH

    def at(self, t: float) -> float:
        """Speed (m/s) at ``t``."""
        since = max(0.0, t + self.change_s)
        if self.change_mps2 < 0:
            since = min(since, self.initial_mps / -self.change_mps2)
        return self.initial_mps + (self.change_mps2 * since if self.change_mps2 else 0.0)

    def travelled(self, t: float) -> float:
        """Distance along the path from the anchor, metres."""

        def since_change(t: float) -> float:
            since = max(0.0, t + self.change_s)
            if self.change_mps2 < 0:
                stop = self.initial_mps / -self.change_mps2
                return self.change_mps2 * min(since, stop) ** 2 / 2 - self.initial_mps * max(0.0, since - stop)
            return self.change_mps2 * since**2 / 2

        if not self.change_mps2:
            return self.initial_mps * t
        return self.initial_mps * t + since_change(t) - since_change(0.0)


@dataclass(frozen=True, eq=False)
class Driving:
    """One vehicle's motion: the path of its centre, the station of its anchor on it, its speed, forward or backing."""

    body: Body
    path: Curve
    anchor_s: float
    speed: Speed
    backing: bool = False

    def station(self, t: float) -> float:
        """Where on its path the vehicle is at ``t``."""
        return self.anchor_s + self.speed.travelled(t)

    def state(self, t: float) -> State:
        """The vehicle at ``t``."""
        s = self.station(t)
        x, y = self.path.point(s)
        heading = self.path.heading(min(max(s, 0.0), self.path.length))
        v = self.speed.at(t)
        if self.backing:
            return State(x, y, math.remainder(heading + math.pi, math.tau), -v)
        return State(x, y, math.remainder(heading, math.tau), v, self._trailer_rad(s, heading))

    def _trailer_rad(self, s: float, heading_rad: float) -> float:
        if self.body.pulled is None:
            return heading_rad
        return float(np.interp(s, *self._trailing))

    @cached_property
    def _trailing(self) -> tuple[FloatArray, FloatArray]:
        """Stations of the path, and where the trailer points there: it follows the path of its kingpin without sliding
        sideways, from far behind."""
        pulled = self.body.pulled
        assert pulled is not None
        behind, drawbar = pulled.coupled_m - self.body.length_m / 2, pulled.axle_m - pulled.kingpin_m
        stations = np.arange(self.anchor_s - TRAILS_M, self.anchor_s + TRAILS_M, 0.25)
        axle: FloatArray | None = None
        points = []
        for at in stations:
            course = self.path.heading(min(max(at, 0.0), self.path.length))
            pin = np.array(self.path.point(at)) - behind * np.array([math.cos(course), math.sin(course)])
            if axle is None:
                axle = pin - drawbar * np.array([math.cos(course), math.sin(course)])
            way = pin - axle
            axle = pin - way * drawbar / math.hypot(*way)
            points.append(math.atan2(way[1], way[0]))
        return stations, np.unwrap(points)


def outline(state: State, body: Body) -> shapely.Geometry:
    """The body's rectangle in the plane, with that of its trailer."""
    own = _rectangle(state.x_m, state.y_m, state.heading_rad, body.length_m, body.width_m)
    if body.pulled is None:
        return own
    return own.union(_rectangle(*trailer_of(state, body, body.pulled), body.pulled.length_m, body.pulled.width_m))


def _rectangle(x_m: float, y_m: float, heading_rad: float, length_m: float, width_m: float) -> shapely.Polygon:
    c, s = math.cos(heading_rad), math.sin(heading_rad)
    local = np.array([[1, 1], [-1, 1], [-1, -1], [1, -1]]) * (length_m / 2, width_m / 2)
    return shapely.Polygon(local @ np.array([[c, s], [-s, c]]) + (x_m, y_m))


def trailer_of(state: State, body: Body, pulled: Pulled) -> tuple[float, float, float]:
    """Place of a trailer's centre, and where it points."""
    behind, back = pulled.coupled_m - body.length_m / 2, pulled.length_m / 2 - pulled.kingpin_m
    x = state.x_m - behind * math.cos(state.heading_rad) - back * math.cos(state.trailer_rad)
    y = state.y_m - behind * math.sin(state.heading_rad) - back * math.sin(state.trailer_rad)
    return x, y, state.trailer_rad


@dataclass(frozen=True, eq=False)
class Collision:
    """The crash: when (on the vehicles' own clocks), where, and on which part of each body."""

    t: float
    point: FloatArray
    states: tuple[State, State]
    on_body: tuple[FloatArray, FloatArray]  # contact point in each body's own axes, ahead and left, metres


def collide(one: Driving, two: Driving, clock_shift_s: float = 0.0) -> Collision:
    """The first touch. ``two`` runs ``clock_shift_s`` ahead of ``one``."""

    def gap(t: float) -> float:
        return float(outline(one.state(t), one.body).distance(outline(two.state(t + clock_shift_s), two.body)))

    low = -LEAD_TIME_S - 2.0
    if gap(low) == 0:
        raise ValueError("the bodies overlap from the start")
    step = 0.01
    high = low + step
    while gap(high) > 0:
        low, high = high, high + step
        if high > 6:
            raise ValueError("the vehicles never meet")
    while gap(low) > TOUCH_M:
        middle = (low + high) / 2
        low, high = (middle, high) if gap(middle) > 0 else (low, middle)
    states = one.state(low), two.state(low + clock_shift_s)
    point = touch_point(states[0], one.body, states[1], two.body)
    places = on_whole(point, states[0], one.body), on_whole(point, states[1], two.body)
    return Collision(low, point, states, places)


def touch_point(state_1: State, body_1: Body, state_2: State, body_2: Body) -> FloatArray:
    """Where two bodies that have come to touch do so: the middle of what crushes first."""
    first, second = outline(state_1, body_1), outline(state_2, body_2)
    contact = first.buffer(CRUSH_M).intersection(second.buffer(CRUSH_M)).centroid
    return np.array([contact.x, contact.y])


def on_body(point: FloatArray, state: State) -> FloatArray:
    """A point in a body's own axes, ahead and left, metres."""
    c, s = math.cos(state.heading_rad), math.sin(state.heading_rad)
    return (point - (state.x_m, state.y_m)) @ np.array([[c, -s], [s, c]])


def on_whole(point: FloatArray, state: State, body: Body) -> FloatArray:
    """The same; on a trailer as if tractor and trailer were in line, from the middle of both."""
    if body.pulled is None:
        return on_body(point, state)
    x, y, heading = trailer_of(state, body, body.pulled)
    trailer = _rectangle(x, y, heading, body.pulled.length_m, body.pulled.width_m)
    tractor = _rectangle(state.x_m, state.y_m, state.heading_rad, body.length_m, body.width_m)
    at = shapely.Point(point)
    if at.distance(trailer) <= at.distance(tractor):
        ahead_m = (body.pulled.whole_m - body.pulled.length_m) / 2
        return on_body(point, State(x, y, heading, 0.0)) - np.array([ahead_m, 0.0])
    return on_body(point, state) + np.array([(body.pulled.whole_m - body.length_m) / 2, 0.0])


def clock(on_body: FloatArray, body: Body) -> int:
    """The clock position a coder marks: 12 the front, 3 the right side, 6 the rear, 9 the left side.

    The coding manual's diagram is a clock laid over the outline, its corners half-way between two hours; coders give
    corners to the front and the rear (11, 1, 5, 7), which the shift of 0.15 hours does.
    """
    length_m = body.length_m if body.pulled is None else body.pulled.whole_m
    angle = math.atan2(on_body[1] / (body.width_m / 2), on_body[0] / (length_m / 2))
    hours = -angle * 6 / math.pi
    from_end = abs(hours) if abs(hours) <= 3 else 6 - abs(hours)
    whole = math.floor(from_end + 0.5 - 0.15)
    hour = whole if abs(hours) <= 3 else 6 - whole
    return (hour if hours >= 0 else -hour) % 12 or 12


def separation_before(one: Driving, two: Driving, collision: Collision, clock_shift_s: float = 0.0) -> list[float]:
    """Distances between the bodies over the last five seconds before the crash, every 0.1 s, the last at the crash."""
    times = collision.t - LEAD_TIME_S + 0.1 * np.arange(51)
    times[-1] = collision.t
    return [
        float(outline(one.state(t), one.body).distance(outline(two.state(t + clock_shift_s), two.body))) for t in times
    ]
