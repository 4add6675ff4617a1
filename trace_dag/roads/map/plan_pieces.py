"""Pieces of plan view that the road model lacks, converted: spirals to arcs, cubics to ``paramPoly3``.

Shapes: ASAM OpenDRIVE 1.7, section 7.3.
"""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import replace
from typing import Final

from trace_dag.roads.map.arcs import along_arc
from trace_dag.roads.map.model import PlanElement

_ARC_TURN_RAD: Final = 0.005
"""Turn per arc that stands for a piece of a spiral: off the clothoid by less than a millimetre on any road."""


def spiral_as_arcs(start: PlanElement, curvature_start: float, curvature_end: float) -> Iterator[PlanElement]:
    """Yield a clothoid as short arcs of its mean curvature, so that headings are exact.

    >>> arcs = list(spiral_as_arcs(PlanElement(0.0, 0.0, 0.0, 0.0, 50.0), 0.0, 0.02))
    >>> round(sum(arc.length_m * arc.curvature_1pm for arc in arcs), 6)  # turned by the mean curvature times the length
    0.5
    """
    sharpest = max(abs(curvature_start), abs(curvature_end))
    count = max(4, math.ceil(sharpest * start.length_m / _ARC_TURN_RAD))
    step = start.length_m / count
    x, y, heading = start.x_m, start.y_m, start.heading_rad
    for index in range(count):
        curvature = curvature_start + (curvature_end - curvature_start) * (index + 0.5) / count
        yield PlanElement(start.s_m + index * step, x, y, heading, step, curvature)
        x, y, heading = along_arc(x, y, heading, step, curvature)


def poly3_as_param_poly3(start: PlanElement, a: float, b: float, c: float, d: float) -> PlanElement:
    """Return the cubic v(u) = a + b u + c u**2 + d u**3 along the length of ``start``, as a normalized ``paramPoly3``.

    >>> poly3_as_param_poly3(PlanElement(0.0, 0.0, 0.0, 0.0, 5.0), 0.0, 0.75, 0.0, 0.0).poly  # 4 along, 3 across
    (0.0, 4.0, 0.0, 0.0, 0.0, 3.0, 0.0, 0.0)
    """
    reach = _poly3_reach(b, c, d, start.length_m)
    poly = (0.0, reach, 0.0, 0.0, a, b * reach, c * reach**2, d * reach**3)
    return replace(start, poly=poly, poly_normalized=True)


def _poly3_reach(b: float, c: float, d: float, length_m: float) -> float:
    """Return ``u`` at which the cubic v(u) has the given arc length, by bisection."""

    def arc_length(u_end: float) -> float:
        count = 64
        step = u_end / count
        slopes = (b + u * (2 * c + 3 * d * u) for u in (step * (i + 0.5) for i in range(count)))
        return math.fsum(math.hypot(1.0, slope) for slope in slopes) * step

    low, high = 0.0, length_m
    for _ in range(60):
        middle = (low + high) / 2
        low, high = (middle, high) if arc_length(middle) < length_m else (low, middle)
    return (low + high) / 2
