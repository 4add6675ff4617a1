"""Arcs by their chords, for the ends of lines of constant curvature.

The chord of an arc that turns by ``a`` is ``sin(a/2) / (a/2)`` of its length and points ``a/2`` off its beginning; a
straight line is an arc with a turn of 0.
"""

from __future__ import annotations

import math
from typing import TYPE_CHECKING, Final

import numpy as np

if TYPE_CHECKING:
    from trace_dag.common.geometry import FloatArray

_STRAIGHT_RAD: Final = 1e-9  # half a turn below which chord and arc differ by less than a double can tell


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
