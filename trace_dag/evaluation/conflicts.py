"""Two bodies on their way: how long until they touch if neither changes its velocity, and by how long they missed."""

from __future__ import annotations

import math

import numpy as np

from trace_dag.geometry import FloatArray
from trace_dag.sim.outlines import Outline
from trace_dag.sim.types import Body, VehicleLog

Velocity = tuple[float, float]


def time_to_contact_s(one: Outline, velocity_1_mps: Velocity, two: Outline, velocity_2_mps: Velocity) -> float:
    """Time until two rectangles that keep velocity and heading first touch, s; 0 if they do, infinity if they never
    will.

    The separating axis theorem swept over time: on each of the four axes the projections overlap for an interval of
    time, and the bodies touch while all four do.
    """
    dx, dy = two.x_m - one.x_m, two.y_m - one.y_m
    vx, vy = velocity_2_mps[0] - velocity_1_mps[0], velocity_2_mps[1] - velocity_1_mps[1]
    c1, s1 = math.cos(one.heading_rad), math.sin(one.heading_rad)
    c2, s2 = math.cos(two.heading_rad), math.sin(two.heading_rad)
    dot, cross = abs(c1 * c2 + s1 * s2), abs(c1 * s2 - s1 * c2)
    begin, end = 0.0, math.inf
    for ax, ay, reach in (
        (c1, s1, one.half_length_m + two.half_length_m * dot + two.half_width_m * cross),
        (-s1, c1, one.half_width_m + two.half_length_m * cross + two.half_width_m * dot),
        (c2, s2, two.half_length_m + one.half_length_m * dot + one.half_width_m * cross),
        (-s2, c2, two.half_width_m + one.half_length_m * cross + one.half_width_m * dot),
    ):
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
    """Shortest time between one body's leaving a place and the other's coming there, s; None if they share no place.

    The post-encroachment time of Allen, Shin and Cooper (TRR 667, 1978) without a drawn conflict area: the least
    difference between two moments at which the two bodies, each at its own, would overlap. Logs are read in steps of
    0.06 s, so it can come out two of these too long. For two that follow each other it is their time gap.
    """
    boxes_1, times_1 = _boxes(one, body_1)
    boxes_2, times_2 = _boxes(two, body_2)
    apart = np.hypot(boxes_1[:, None, 0] - boxes_2[None, :, 0], boxes_1[:, None, 1] - boxes_2[None, :, 1])
    near = apart < np.hypot(boxes_1[0, 3], boxes_1[0, 4]) + np.hypot(boxes_2[0, 3], boxes_2[0, 4])
    i, j = np.nonzero(near)
    if not len(i):
        return None
    hits = _overlap(boxes_1[i], boxes_2[j])
    if not hits.any():
        return None
    return float(np.abs(times_1[i] - times_2[j])[hits].min())


_PET_STEP_S = 0.06


def _boxes(log: VehicleLog, body: Body) -> tuple[FloatArray, FloatArray]:
    """x, y, heading, half length and half width at every step looked at, shape (n, 5), and the times, shape (n,)."""
    step_s = float(log.time_s[1] - log.time_s[0]) if len(log.time_s) > 1 else _PET_STEP_S
    every = slice(None, None, max(1, round(_PET_STEP_S / step_s)))
    x, y, heading = log.x_m[every], log.y_m[every], log.heading_rad[every]
    size = np.broadcast_to((body.length_m / 2, body.width_m / 2), (len(x), 2))
    return np.column_stack([x, y, heading, size]), log.time_s[every]


def _overlap(one: FloatArray, two: FloatArray) -> np.ndarray[tuple[int], np.dtype[np.bool_]]:
    """Whether rectangles overlap, pair by pair, shapes (n, 5): separating axis theorem."""
    dx, dy = two[:, 0] - one[:, 0], two[:, 1] - one[:, 1]
    c1, s1, c2, s2 = np.cos(one[:, 2]), np.sin(one[:, 2]), np.cos(two[:, 2]), np.sin(two[:, 2])
    dot, cross = np.abs(c1 * c2 + s1 * s2), np.abs(c1 * s2 - s1 * c2)
    hits = np.ones(len(one), bool)
    for ax, ay, reach in (
        (c1, s1, one[:, 3] + two[:, 3] * dot + two[:, 4] * cross),
        (-s1, c1, one[:, 4] + two[:, 3] * cross + two[:, 4] * dot),
        (c2, s2, two[:, 3] + one[:, 3] * dot + one[:, 4] * cross),
        (-s2, c2, two[:, 4] + one[:, 3] * cross + one[:, 4] * dot),
    ):
        hits &= np.abs(dx * ax + dy * ay) < reach
    return hits
