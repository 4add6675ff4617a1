"""Motion as key frames: places and rotations of a body, with no more keys than needed to follow the log.

Quaternions are x, y, z, w, as in glTF.
"""

from __future__ import annotations

import math
from typing import Final

import numpy as np
from scipy.spatial.transform import Rotation

from trace_dag.common.geometry import FloatArray
from trace_dag.pages.solid.gltf import Keys
from trace_dag.scenario.polylines import simplify_in_time
from trace_dag.simulation.types import VehicleLog

PLACE_M: Final = 0.003
"""Between key frames a body is off its logged place by so much at most."""
TURN: Final = 0.001
"""And the parts of its quaternion by so much: a turn of 0.1 degrees."""
_LARGEST_TURN_RAD: Final = 1.5  # from key to key: a quaternion knows no more than half a turn


def place_keys(time_s: FloatArray, places_m: FloatArray) -> Keys:
    """Return the key frames of a way, shape (n, 3).

    >>> time_s = np.array([0.0, 1.0, 2.0])
    >>> place_keys(time_s, np.column_stack([time_s, 0 * time_s, 0 * time_s])).time_s.tolist()  # straight at one speed
    [0.0, 2.0]
    """
    kept = simplify_in_time(time_s, places_m, PLACE_M)
    return Keys(time_s[kept], places_m[kept])


def turn_keys(time_s: FloatArray, turns: Rotation) -> Keys:
    """Return the key frames of a rotation over time.

    Two successive rotations must differ by less than half a turn.

    >>> turn_keys(np.array([0.0, 1.0, 2.0]), Rotation.identity(3)).time_s.tolist()  # it does not turn
    [0.0, 2.0]
    """
    values = turns.as_quat()
    flipped = np.cumprod(np.where((values[1:] * values[:-1]).sum(axis=1) < 0.0, -1.0, 1.0))
    values[1:] *= flipped[:, None]  # the same turn has two quaternions: the one nearer to the last
    kept = simplify_in_time(time_s, values, TURN)
    return Keys(time_s[kept], values[kept])


def size_keys(time_s: FloatArray, sizes: FloatArray) -> Keys:
    """Return the key frames of an object that is visible (1) or not (0), shape (n,).

    >>> size_keys(np.array([0.0, 1.0, 2.0]), np.array([0.0, 1.0, 1.0])).time_s.tolist()  # shows from 1 s on
    [0.0, 1.0]
    """
    changes = np.flatnonzero(np.diff(sizes, prepend=np.nan))
    return Keys(time_s[changes], np.repeat(sizes[changes, None], 3, axis=1), step=True)


def rolling_keys(time_s: FloatArray, angles_rad: FloatArray) -> Keys:
    """Return the key frames of a wheel that has rotated by some angles about the axis to its left.

    >>> rolling_keys(np.array([0.0, 1.0]), np.zeros(2)).time_s.tolist()  # it stands
    [0.0]
    """
    turned = np.concatenate([[0.0], np.cumsum(np.abs(np.diff(angles_rad)))])
    steps = math.ceil(turned[-1] / _LARGEST_TURN_RAD)
    if not steps:
        return Keys(time_s[:1], Rotation.identity(1).as_quat())
    times = np.unique(np.interp(np.linspace(0.0, turned[-1], steps + 1), turned, time_s))
    at = np.interp(times, time_s, angles_rad)
    return Keys(times, np.column_stack([0 * at, np.sin(at / 2), 0 * at, np.cos(at / 2)]))


def body_places(log: VehicleLog) -> FloatArray:
    """Return the positions of a body's middle, shape (n, 3)."""
    return np.column_stack([log.x_m, log.y_m, log.z_m + log.above_road_m])


def body_turns(log: VehicleLog) -> Rotation:
    """Return the rotation of a body: heading, pitch and roll in this order about its own axes up, left and ahead."""
    angles = np.column_stack([log.heading_rad, log.pitch_rad, log.roll_rad])
    return Rotation.from_euler("ZYX", angles)
