"""Rectangles that meet: their gap, the place and time of first touch, and the place of their contact.

Plain scalars and no arrays: these run inside the simulation's loop.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, field

PATCH_DEPTH_M = 0.03
"""Depth of outline that counts as touching. Two flat boxes touch at a corner however small the angle between their
faces; faces of vehicles are round and give way, and what lies this close to the other body is engaged: faces within
a degree of each other meet as faces. More would move the contact away from where rigid boxes are seen to meet."""


@dataclass(slots=True)
class Outline:
    """A rectangle: centre and heading in the local frame, half length and half width.

    It must not be changed once it is made; it is not frozen, because that triples the time of making it.
    """

    x_m: float
    y_m: float
    heading_rad: float
    half_length_m: float
    half_width_m: float
    ahead: tuple[float, float] = field(init=False, repr=False, compare=False)
    """Unit vector along its length."""

    def __post_init__(self) -> None:
        self.ahead = math.cos(self.heading_rad), math.sin(self.heading_rad)

    def grown(self, by_m: float) -> Outline:
        """Return the same rectangle with every face moved outward."""
        return Outline(self.x_m, self.y_m, self.heading_rad, self.half_length_m + by_m, self.half_width_m + by_m)


def separation(one: Outline, two: Outline) -> tuple[float, float, float]:
    """Return the gap (m, negative for overlap) along the axis that separates them most, and that axis.

    The axis points from one to two. The sign is exact, the gap between two corners a lower bound.

    >>> one, two = Outline(0.0, 0.0, 0.0, 2.0, 1.0), Outline(5.0, 0.0, 0.0, 2.0, 1.0)
    >>> separation(one, two)  # 5 m apart less half a length each; along x
    (1.0, 1.0, 0.0)
    """
    dx, dy = two.x_m - one.x_m, two.y_m - one.y_m
    (c1, s1), (c2, s2) = one.ahead, two.ahead
    length_1, width_1, length_2, width_2 = one.half_length_m, one.half_width_m, two.half_length_m, two.half_width_m
    dot, cross = abs(c1 * c2 + s1 * s2), abs(c1 * s2 - s1 * c2)
    # The axes of geometry.face_axes, in its order and one by one: half of a simulation's questions are this one.
    along = dx * c1 + dy * s1
    best, nx, ny, side = abs(along) - length_1 - (length_2 * dot + width_2 * cross), c1, s1, along
    along = dy * c1 - dx * s1
    gap = abs(along) - width_1 - (length_2 * cross + width_2 * dot)
    if gap > best:
        best, nx, ny, side = gap, -s1, c1, along
    along = dx * c2 + dy * s2
    gap = abs(along) - length_2 - (length_1 * dot + width_1 * cross)
    if gap > best:
        best, nx, ny, side = gap, c2, s2, along
    along = dy * c2 - dx * s2
    gap = abs(along) - width_2 - (length_1 * cross + width_1 * dot)
    if gap > best:
        best, nx, ny, side = gap, -s2, c2, along
    return (best, nx, ny) if side >= 0 else (best, -nx, -ny)


def corners(outline: Outline) -> list[tuple[float, float]]:
    """Return the corners of a rectangle in order around it.

    >>> corners(Outline(0.0, 0.0, 0.0, 2.0, 1.0))
    [(2.0, 1.0), (-2.0, 1.0), (-2.0, -1.0), (2.0, -1.0)]
    """
    c, s = outline.ahead
    ax, ay = c * outline.half_length_m, s * outline.half_length_m
    bx, by = -s * outline.half_width_m, c * outline.half_width_m
    x, y = outline.x_m, outline.y_m
    return [
        (x + ax + bx, y + ay + by),
        (x - ax + bx, y - ay + by),
        (x - ax - bx, y - ay - by),
        (x + ax - bx, y + ay - by),
    ]


def overlap_polygon(one: Outline, two: Outline) -> list[tuple[float, float]]:
    """Return corners of the common area of two rectangles (Sutherland-Hodgman), counter-clockwise.

    Empty if they have none.

    >>> one, two = Outline(0.0, 0.0, 0.0, 2.0, 1.0), Outline(3.0, 1.0, 0.0, 2.0, 1.0)
    >>> sorted(overlap_polygon(one, two))
    [(1.0, 0.0), (1.0, 1.0), (2.0, 0.0), (2.0, 1.0)]
    """
    polygon = corners(one)
    clip = corners(two)
    for (x0, y0), (x1, y1) in zip(clip, clip[1:] + clip[:1], strict=True):
        ex, ey = x1 - x0, y1 - y0
        kept: list[tuple[float, float]] = []
        px, py = polygon[-1]
        previous = ex * (py - y0) - ey * (px - x0)
        for x, y in polygon:
            side = ex * (y - y0) - ey * (x - x0)
            if (side >= 0) != (previous >= 0):
                f = previous / (previous - side)
                kept.append((px + f * (x - px), py + f * (y - py)))
            if side >= 0:
                kept.append((x, y))
            px, py, previous = x, y, side
        polygon = kept
        if not polygon:
            break
    return polygon


def contact_point(one: Outline, two: Outline) -> tuple[float, float]:
    """Return the place of the contact of two bodies that just touch, local frame, metres.

    It is the centre of their common area after every face is moved outward by half of :data:`PATCH_DEPTH_M`.

    >>> x_m, y_m = contact_point(Outline(0.0, 0.0, 0.0, 2.0, 1.0), Outline(4.0, 1.0, 0.0, 2.0, 1.0))
    >>> round(x_m, 6), round(y_m, 6)  # the middle of the half of the faces that touch
    (2.0, 0.5)
    """
    polygon = overlap_polygon(one.grown(PATCH_DEPTH_M / 2), two.grown(PATCH_DEPTH_M / 2))
    area = cx = cy = 0.0
    x0, y0 = (one.x_m + two.x_m) / 2, (one.y_m + two.y_m) / 2  # near the polygon: keeps the sums exact
    for (xa, ya), (xb, yb) in zip(polygon, polygon[1:] + polygon[:1], strict=True):
        w = (xa - x0) * (yb - y0) - (xb - x0) * (ya - y0)
        area += w
        cx += w * (xa + xb - 2 * x0)
        cy += w * (ya + yb - 2 * y0)
    return x0 + cx / (3 * area), y0 + cy / (3 * area)


def between(before: Outline, after: Outline, fraction: float) -> Outline:
    """Return the rectangle at a fraction of the time between two moments, by linear interpolation.

    >>> between(Outline(0.0, 0.0, 0.0, 2.0, 1.0), Outline(1.0, 0.0, 0.2, 2.0, 1.0), 0.5)
    Outline(x_m=0.5, y_m=0.0, heading_rad=0.1, half_length_m=2.0, half_width_m=1.0)
    """
    turn = math.remainder(after.heading_rad - before.heading_rad, math.tau)
    return Outline(
        before.x_m + fraction * (after.x_m - before.x_m),
        before.y_m + fraction * (after.y_m - before.y_m),
        before.heading_rad + fraction * turn,
        before.half_length_m,
        before.half_width_m,
    )


def first_touch(before: tuple[Outline, Outline], after: tuple[Outline, Outline]) -> float:
    """Return the fraction of the step from ``before`` (apart) to ``after`` (overlapping) at the first touch.

    It is found by bisection to a millionth of the step, on the side where the two are still apart.

    >>> still, coming, arrived = (Outline(x, 0.0, 0.0, 2.0, 1.0) for x in (0.0, 5.0, 3.0))
    >>> round(first_touch((still, coming), (still, arrived)), 5)  # 1 m of the 2 m it comes nearer
    0.5
    """
    low, high = 0.0, 1.0
    for _ in range(20):
        middle = (low + high) / 2
        if separation(between(before[0], after[0], middle), between(before[1], after[1], middle))[0] > 0:
            low = middle
        else:
            high = middle
    return low
