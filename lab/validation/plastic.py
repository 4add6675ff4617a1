"""Planar plastic momentum: the plainest rule there is for two vehicles that meet, and the peer of every figure.

Both leave with one velocity; nothing turns and nothing rebounds. Into what does not give way, a vehicle stops.
"""

from __future__ import annotations

import math


def plastic_delta_v(
    masses_kg: tuple[float, float], velocity_1_mps: tuple[float, float], velocity_2_mps: tuple[float, float]
) -> tuple[tuple[float, float], tuple[float, float]]:
    """Return the change of velocity (x, y) of both.

    >>> plastic_delta_v((1000.0, 3000.0), (20.0, 4.0), (0.0, 0.0))
    ((-15.0, -3.0), (5.0, 1.0))
    """
    m1, m2 = masses_kg
    past_x, past_y = velocity_2_mps[0] - velocity_1_mps[0], velocity_2_mps[1] - velocity_1_mps[1]
    share_1, share_2 = m2 / (m1 + m2), -m1 / (m1 + m2)
    return (share_1 * past_x, share_1 * past_y), (share_2 * past_x, share_2 * past_y)


def in_body(vector: tuple[float, float], heading_rad: float) -> tuple[float, float]:
    """Return a vector of the frame, ahead and to the left of a body.

    >>> in_body((0.0, 5.0), math.pi / 2)[0]
    5.0
    """
    (x, y), c, s = vector, math.cos(heading_rad), math.sin(heading_rad)
    return x * c + y * s, y * c - x * s
