"""The one frame of the project and the plane geometry everything else uses.

Local transverse Mercator at the crash's reported point: x east, y north, metres; headings in radians
counter-clockwise from east. Latitude and longitude exist only at the boundaries, through :class:`LocalFrame`.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from functools import cached_property
from typing import TYPE_CHECKING, TypeVar

import numpy as np
from numpy.typing import NDArray

from trace_dag.common.units import bearing_to_clock_h

if TYPE_CHECKING:
    from pyproj import Transformer

FloatArray = NDArray[np.float64]
Number = TypeVar("Number", float, FloatArray)
"""A value, or an array of them."""
Poses = tuple[FloatArray, FloatArray, FloatArray]
"""Centres and headings of many bodies: x, y (metres) and heading (radians), arrays of one shape."""


@dataclass(frozen=True)
class LocalFrame:
    """Transverse Mercator on WGS84 with its origin, scale 1, at (``latitude_deg``, ``longitude_deg``)."""

    latitude_deg: float
    longitude_deg: float

    @property
    def proj(self) -> str:
        """Return the PROJ string, as written into OpenDRIVE's ``geoReference``."""
        return (
            f"+proj=tmerc +lat_0={self.latitude_deg:.9f} +lon_0={self.longitude_deg:.9f} "
            "+k=1 +x_0=0 +y_0=0 +datum=WGS84 +units=m"
        )

    @cached_property
    def _transformer(self) -> Transformer:
        from pyproj import Transformer  # costs 0.2 s of start-up

        # WGS84 on both sides: what PROJ would find in its database, in a thirtieth of the time.
        return Transformer.from_pipeline(
            f"+proj=pipeline +step +proj=unitconvert +xy_in=deg +xy_out=rad +step {self.proj}"
        )

    def to_local(self, latitude_deg: FloatArray | float, longitude_deg: FloatArray | float) -> FloatArray:
        """Convert geographic degrees, scalars or shape (n,), to local metres, shape (2,) or (n, 2)."""
        x_m, y_m = self._transformer.transform(longitude_deg, latitude_deg)
        return np.stack([np.asarray(x_m, float), np.asarray(y_m, float)], axis=-1)

    def to_geographic(self, xy_m: FloatArray) -> FloatArray:
        """Return local metres, shape (..., 2), to (latitude, longitude) in degrees, shape (..., 2)."""
        points = np.asarray(xy_m, float)
        lon, lat = self._transformer.transform(points[..., 0], points[..., 1], direction="INVERSE")
        return np.stack([np.asarray(lat, float), np.asarray(lon, float)], axis=-1)


@dataclass(frozen=True)
class Pose:
    """Position (metres, local frame; z is the road surface) and heading (radians, CCW from east)."""

    x_m: float
    y_m: float
    heading_rad: float
    z_m: float = 0.0

    @property
    def xy_m(self) -> FloatArray:
        """Return the position, shape (2,)."""
        return np.array([self.x_m, self.y_m])

    @property
    def forward(self) -> FloatArray:
        """Return the unit vector ahead, shape (2,)."""
        return np.array([math.cos(self.heading_rad), math.sin(self.heading_rad)])

    def to_world(self, local_xy_m: FloatArray) -> FloatArray:
        """Convert points from this pose's axes (ahead, left), shape (..., 2), to the local frame."""
        return np.asarray(local_xy_m, float) @ _rotation(self.heading_rad).T + self.xy_m

    def to_body(self, world_xy_m: FloatArray) -> FloatArray:
        """Convert points of the local frame, shape (..., 2), to this pose's axes (ahead, left)."""
        return (np.asarray(world_xy_m, float) - self.xy_m) @ _rotation(self.heading_rad)


def _rotation(angle_rad: float) -> FloatArray:
    c, s = math.cos(angle_rad), math.sin(angle_rad)
    return np.array([[c, -s], [s, c]])


def rectangle_corners(pose: Pose, length_m: float, width_m: float) -> FloatArray:
    """Return corners of a body centred on ``pose``, shape (4, 2), counter-clockwise from front left.

    >>> rectangle_corners(Pose(10.0, 0.0, 0.0), 4.0, 2.0).tolist()
    [[12.0, 1.0], [8.0, 1.0], [8.0, -1.0], [12.0, -1.0]]
    """
    half = np.array([[1, 1], [-1, 1], [-1, -1], [1, -1]]) * (length_m / 2, width_m / 2)
    return pose.to_world(half)


def face_axes(
    ahead_1: tuple[Number, Number],
    half_1_m: tuple[Number | float, Number | float],
    ahead_2: tuple[Number, Number],
    half_2_m: tuple[Number | float, Number | float],
) -> tuple[tuple[Number, Number, Number | float, Number | float], ...]:
    """Return the four axes on which two rectangles are compared, by the separating axis theorem.

    The rectangles are apart if and only if they are apart on one of these axes, the normals of their faces. ``ahead_*``
    is the unit vector along each rectangle's length, ``half_*_m`` its half length and half width: floats for one pair,
    arrays of shape (n,) for many. Each axis is its x and y, then the extents of both rectangles from their centres
    along it, metres: first that of the rectangle whose face it is normal to.

    >>> [(x, y, own + other) for x, y, own, other in face_axes((1.0, 0.0), (2.0, 1.0), (0.0, 1.0), (3.0, 0.5))]
    [(1.0, 0.0, 2.5), (-0.0, 1.0, 4.0), (0.0, 1.0, 4.0), (-1.0, 0.0, 2.5)]
    """
    (c1, s1), (c2, s2) = ahead_1, ahead_2
    (length_1, width_1), (length_2, width_2) = half_1_m, half_2_m
    dot, cross = abs(c1 * c2 + s1 * s2), abs(c1 * s2 - s1 * c2)
    return (
        (c1, s1, length_1, length_2 * dot + width_2 * cross),
        (-s1, c1, width_1, length_2 * cross + width_2 * dot),
        (c2, s2, length_2, length_1 * dot + width_1 * cross),
        (-s2, c2, width_2, length_1 * cross + width_1 * dot),
    )


def gaps_m(poses_1: Poses, size_1_m: tuple[float, float], poses_2: Poses, size_2_m: tuple[float, float]) -> FloatArray:
    """Return gaps between rectangles on the axis that separates them most, metres.

    A gap is positive apart, negative for overlap, 0 at touch. ``size_*_m`` are length and width; the result has the
    shape of the arrays. The sign is exact; between two corners the gap is less than their distance.

    >>> at = lambda x_m, y_m: (np.array([x_m]), np.array([y_m]), np.array([0.0]))
    >>> car = (4.0, 2.0)
    >>> gaps_m(at(0.0, 0.0), car, at(5.0, 0.0), car), gaps_m(at(0.0, 0.0), car, at(3.0, 1.0), car)  # apart, overlapping
    (array([1.]), array([-1.]))
    """
    (x1, y1, h1), (x2, y2, h2) = poses_1, poses_2
    dx, dy = x2 - x1, y2 - y1
    half_1, half_2 = ((length_m / 2, width_m / 2) for length_m, width_m in (size_1_m, size_2_m))
    axes = face_axes((np.cos(h1), np.sin(h1)), half_1, (np.cos(h2), np.sin(h2)), half_2)
    gaps = [np.abs(dx * x + dy * y) - own - other for x, y, own, other in axes]
    return np.maximum(np.maximum(gaps[0], gaps[1]), np.maximum(gaps[2], gaps[3]))


def hermite(
    length: Number, start: Number, end: Number, slope_start: Number, slope_end: Number
) -> tuple[Number, Number, Number, Number]:
    """Return coefficients a, b, c, d of the cubic a + b u + c u**2 + d u**3 with given ends and slopes.

    It has ``start`` and ``slope_start`` at u = 0, ``end`` and ``slope_end`` at u = ``length``.

    >>> hermite(2.0, 0.0, 4.0, 0.0, 4.0)  # u squared
    (0.0, 0.0, 1.0, 0.0)
    """
    rise = (end - start) / length
    c = (3 * rise - 2 * slope_start - slope_end) / length
    d = (slope_start + slope_end - 2 * rise) / length**2
    return start, slope_start, c, d


def arc_lengths(xy_m: FloatArray) -> FloatArray:
    """Return the distance along a polyline of shape (n, 2 or 3) at each of its points, shape (n,), starting at 0.

    >>> arc_lengths(np.array([[0.0, 0.0], [3.0, 4.0], [3.0, 10.0]])).tolist()
    [0.0, 5.0, 11.0]
    """
    dx, dy = np.diff(xy_m[:, 0]), np.diff(xy_m[:, 1])
    return np.concatenate([[0.0], np.cumsum(np.sqrt(dx * dx + dy * dy))])


def headings(xy_m: FloatArray) -> FloatArray:
    """Return the direction of travel at each point of a polyline of shape (n, 2), radians, unwrapped, shape (n,).

    >>> np.degrees(headings(np.array([[0.0, 0.0], [0.0, 5.0], [0.0, 10.0]]))).tolist()
    [90.0, 90.0, 90.0]
    """
    step = np.gradient(xy_m, axis=0)
    return np.unwrap(np.arctan2(step[:, 1], step[:, 0]))


def body_bearing_rad(pose: Pose, length_m: float, width_m: float, point_xy_m: FloatArray) -> float:
    """Return the direction of a point as seen from a body's centre, as if the body were square.

    Radians CCW from its front.

    Both axes are scaled by the body's half dimensions, because clock positions are coded by face, not by angle. So the
    front face of a motorcycle and of a 20 m truck alike spans -pi/4 to pi/4 (clock positions 10:30 to 1:30), and the
    corners lie between front and side. Feed the result to :func:`trace_dag.common.units.bearing_to_clock_h`.

    >>> math.degrees(body_bearing_rad(Pose(0.0, 0.0, 0.0), 4.0, 2.0, np.array([2.0, 1.0])))  # the front left corner
    45.0
    """
    ahead_m, left_m = pose.to_body(point_xy_m)
    return math.atan2(left_m / width_m, ahead_m / length_m)


def contact_clock_h(pose: Pose, length_m: float, width_m: float, point_xy_m: FloatArray) -> float:
    """Return the clock position, hours in (0, 12], of a point of the local frame on a body centred on ``pose``.

    It is :func:`body_bearing_rad` as a clock position, shared by the estimator, the verdict and the pictures.

    >>> contact_clock_h(Pose(0.0, 0.0, 0.0), 4.0, 2.0, np.array([0.0, 1.0]))  # the middle of the left side
    9.0
    """
    return bearing_to_clock_h(body_bearing_rad(pose, length_m, width_m, point_xy_m))
