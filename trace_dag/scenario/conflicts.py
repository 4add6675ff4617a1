"""Conflict measures of two bodies: time to contact at constant velocities, and post-encroachment time."""

from __future__ import annotations

import math

import numpy as np

from trace_dag.common.geometry import FloatArray, Poses, face_axes, gaps_m
from trace_dag.simulation.outlines import Outline
from trace_dag.simulation.types import Body, VehicleLog

Velocity = tuple[float, float]
_PET_STEP_S = 0.06
_ALIKE_RAD = math.radians(45.0)


def time_to_contact_s(one: Outline, velocity_1_mps: Velocity, two: Outline, velocity_2_mps: Velocity) -> float:
    """Return the time until two rectangles with constant velocity and heading first touch, s.

    It is 0 if they touch now, infinity if they never will.

    On each of the four axes that can separate them, their projections overlap for an interval of time; the bodies touch
    while they overlap on all four.
    """
    dx, dy = two.x_m - one.x_m, two.y_m - one.y_m
    vx, vy = velocity_2_mps[0] - velocity_1_mps[0], velocity_2_mps[1] - velocity_1_mps[1]
    begin, end = 0.0, math.inf
    halves_1, halves_2 = ((each.half_length_m, each.half_width_m) for each in (one, two))
    for ax, ay, own_m, other_m in face_axes(one.ahead, halves_1, two.ahead, halves_2):
        reach = own_m + other_m
        apart, rate = dx * ax + dy * ay, vx * ax + vy * ay
        if abs(rate) < 1e-9:
            if abs(apart) >= reach:
                return math.inf
            continue
        first, last = sorted(((-reach - apart) / rate, (reach - apart) / rate))
        begin, end = max(begin, first), min(end, last)
        if begin >= end:
            return math.inf
    return begin


def post_encroachment_time_s(one: VehicleLog, body_1: Body, two: VehicleLog, body_2: Body) -> float | None:
    """Return the shortest time between one body's leaving a place and the other's arrival there, s.

    None if they share no place.

    It is the post-encroachment time of Allen, Shin and Cooper (TRR 667, 1978) without a drawn conflict area: the least
    difference between two moments at which the two bodies, each at its own, would overlap. Logs are read in steps of
    0.06 s, so it may be too long by two of these. For two bodies in line it is their time gap.
    """
    (poses_1, times_1), (poses_2, times_2) = _poses(one), _poses(two)
    size_1, size_2 = ((body.length_m, body.width_m) for body in (body_1, body_2))
    (x1, y1, _), (x2, y2, _) = poses_1, poses_2
    apart = np.hypot(x1[:, None] - x2[None, :], y1[:, None] - y2[None, :])
    i, j = np.nonzero(apart < (math.hypot(*size_1) + math.hypot(*size_2)) / 2)
    if not len(i):
        return None
    x1, y1, h1 = (values[i] for values in poses_1)
    x2, y2, h2 = (values[j] for values in poses_2)
    hits = gaps_m((x1, y1, h1), size_1, (x2, y2, h2), size_2) < 0
    if not hits.any():
        return None
    return float(np.abs(times_1[i] - times_2[j])[hits].min())


def is_ahead(one: tuple[float, float, float], two: tuple[float, float, float]) -> bool:
    """Return whether the second body travels in the direction of the first, ahead of it.

    Each is x, y (m) and heading (rad).

    >>> is_ahead((0.0, 0.0, 0.0), (8.0, 0.5, 0.1)), is_ahead((0.0, 0.0, 0.0), (8.0, 0.5, 1.5))  # crosses
    (True, False)
    """
    (x, y, heading), (other_x, other_y, other_heading) = one, two
    alike = abs(math.remainder(other_heading - heading, math.tau)) < _ALIKE_RAD
    return alike and (other_x - x) * math.cos(heading) + (other_y - y) * math.sin(heading) > 0


def _poses(log: VehicleLog) -> tuple[Poses, FloatArray]:
    """Return the body's poses at every step looked at, and the times, shape (n,)."""
    step_s = float(log.time_s[1] - log.time_s[0]) if len(log.time_s) > 1 else _PET_STEP_S
    every = slice(None, None, max(1, round(_PET_STEP_S / step_s)))
    return (log.x_m[every], log.y_m[every], log.heading_rad[every]), log.time_s[every]
