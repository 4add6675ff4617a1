"""Triangles and the simple shapes that everything else is put together from.

Axes of a shape are those of its body: x ahead, y left, z up, metres. Triangles are counter-clockwise seen from outside.
Normals are left out, so that glTF shades every triangle flat, as intended.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Sequence
from typing import NamedTuple

import numpy as np
import shapely
from numpy.typing import NDArray

from trace_dag.common.geometry import FloatArray


class Mesh(NamedTuple):
    """Points, shape (n, 3), m, and triangles as numbers of points, shape (k, 3)."""

    points_m: FloatArray
    triangles: NDArray[np.int64]

    def moved(self, by_m: Sequence[float]) -> Mesh:
        """Return the shape moved by a vector."""
        return Mesh(self.points_m + np.asarray(by_m), self.triangles)

    def turned(self, matrix: FloatArray) -> Mesh:
        """Return the same shape turned by a matrix, shape (3, 3)."""
        return Mesh(self.points_m @ matrix.T, self.triangles)


def join_shapes(meshes: Iterable[Mesh]) -> Mesh:
    """Return several shapes as one.

    >>> tile = flat(shapely.box(0.0, 0.0, 1.0, 1.0))
    >>> len(join_shapes([tile, tile]).points_m)
    8
    """
    parts = [mesh for mesh in meshes if len(mesh.triangles)]
    if not parts:
        return Mesh(np.zeros((0, 3)), np.zeros((0, 3), np.int64))
    starts = np.cumsum([0, *(len(mesh.points_m) for mesh in parts[:-1])])
    return Mesh(
        np.concatenate([mesh.points_m for mesh in parts]),
        np.concatenate([mesh.triangles + start for mesh, start in zip(parts, starts, strict=True)]),
    )


def box(low: Sequence[float], high: Sequence[float]) -> Mesh:
    """Return a box from its lowest to its highest corner.

    >>> box((0.0, 0.0, 0.0), (2.0, 1.0, 1.0)).points_m.max(axis=0).tolist()
    [2.0, 1.0, 1.0]
    """
    (x0, y0, z0), (x1, y1, z1) = low, high
    ring = np.array([(y0, z0), (y1, z0), (y1, z1), (y0, z1)])
    return loft(np.array([x0, x1]), np.stack([ring, ring]))


def loft(stations: FloatArray, rings: FloatArray) -> Mesh:
    """Return a body along x with closed ends.

    Rings, shape (n, k, 2), of (y, z) at stations, shape (n,), from rear to front, each counter-clockwise seen from the
    front.

    >>> ring = np.array([[1.0, 0.0], [0.0, 1.0], [-1.0, 0.0]])
    >>> len(loft(np.array([0.0, 1.0]), np.stack([ring, ring])).triangles)  # three sides of two each, two ends
    8
    """
    n, k, _ = rings.shape
    points = np.concatenate([np.repeat(stations, k)[:, None], rings.reshape(-1, 2)], axis=1)
    near = np.arange(k)
    triangles = []
    for i in range(n - 1):
        a, b = i * k + near, i * k + (near + 1) % k
        c, d = a + k, b + k
        triangles += [np.stack([a, b, d], axis=1), np.stack([a, d, c], axis=1)]
    # Ends have points of their own, so that they are flat and their edges sharp.
    points = np.concatenate([points, points[:k], points[-k:]])
    fan = np.stack([np.zeros(k - 2, int), np.arange(1, k - 1), np.arange(2, k)], axis=1)
    triangles += [n * k + fan[:, ::-1], n * k + k + fan]
    return Mesh(points, np.concatenate(triangles).astype(np.int64))


def cylinder(radius_m: float, low_m: float, high_m: float, sides: int = 10, top_m: float | None = None) -> Mesh:
    """Return an upright cylinder between two heights; with another radius at the top, a cone.

    >>> mesh = cylinder(2.0, 0.0, 5.0, sides=4)
    >>> mesh.points_m.min(axis=0).round(6).tolist(), mesh.points_m.max(axis=0).round(6).tolist()
    ([-2.0, -2.0, 0.0], [2.0, 2.0, 5.0])
    """
    angles = np.arange(sides) * math.tau / sides
    ring = np.column_stack([np.cos(angles), np.sin(angles)])  # x ahead becomes up once it is turned
    upper = radius_m if top_m is None else max(top_m, 1e-3)
    lying = loft(np.array([low_m, high_m]), np.stack([ring * radius_m, ring * upper]))
    return Mesh(lying.points_m[:, [1, 2, 0]], lying.triangles)


def across(mesh: Mesh) -> Mesh:
    """Return an upright shape laid on its side: its up axis points left.

    >>> across(Mesh(np.array([[0.0, 0.0, 1.0]]), np.zeros((0, 3), np.int64))).points_m.tolist()
    [[0.0, 1.0, 0.0]]
    """
    return Mesh(mesh.points_m[:, [1, 2, 0]], mesh.triangles)


def ball(radius_m: float, stretch: float = 1.0, rings: int = 5, sides: int = 9) -> Mesh:
    """Return a ball around the origin, stretched along z.

    >>> [float(each.points_m[:, 2].max()) for each in (ball(2.0), ball(2.0, stretch=1.5))]
    [2.0, 3.0]
    """
    up = np.linspace(-math.pi / 2, math.pi / 2, rings + 2)[1:-1]
    heights = np.array([-1.0, *np.sin(up), 1.0]) * radius_m * stretch
    radii = np.array([0.02, *np.cos(up), 0.02]) * radius_m
    return revolve(heights, radii, sides)


def revolve(heights_m: FloatArray, radii_m: FloatArray, sides: int = 8) -> Mesh:
    """Return a body of revolution around the z axis, from radii at heights, lowest first.

    >>> post = revolve(np.array([0.0, 3.0]), np.array([0.1, 0.1]))
    >>> float(post.points_m[:, 2].max())
    3.0
    """
    angles = np.arange(sides) * math.tau / sides
    ring = np.column_stack([np.cos(angles), np.sin(angles)])
    lying = loft(heights_m, radii_m[:, None, None] * ring[None])
    return Mesh(lying.points_m[:, [1, 2, 0]], lying.triangles)


def bar(start: Sequence[float], end: Sequence[float], radius_m: float, sides: int = 6) -> Mesh:
    """Return a round bar from one point to another.

    >>> points = bar((0.0, 0.0, 1.0), (0.0, 4.0, 1.0), 0.5).points_m
    >>> [float(each.round(6)) for each in (points[:, 1].min(), points[:, 1].max())]
    [0.0, 4.0]
    """
    one, two = np.asarray(start, float), np.asarray(end, float)
    length_m = float(np.linalg.norm(two - one))
    return cylinder(radius_m, 0.0, length_m, sides).turned(_turned_to((two - one) / length_m)).moved(one.tolist())


def _turned_to(up: FloatArray) -> FloatArray:
    """Return a rotation that turns the z axis to a direction, shape (3, 3)."""
    side = np.array([0.0, 1.0, 0.0]) if abs(up[1]) < 0.9 else np.array([1.0, 0.0, 0.0])
    x = np.cross(side, up)
    x /= np.linalg.norm(x)
    return np.column_stack([x, np.cross(up, x), up])


def about_z(heading_rad: float) -> FloatArray:
    """Return the rotation to a heading, shape (3, 3).

    >>> (about_z(math.pi / 2) @ (1.0, 0.0, 0.0)).round(6).tolist()  # ahead becomes left
    [0.0, 1.0, 0.0]
    """
    c, s = math.cos(heading_rad), math.sin(heading_rad)
    return np.array([(c, -s, 0.0), (s, c, 0.0), (0.0, 0.0, 1.0)])


def flat(area: shapely.Geometry, z_m: float = 0.0) -> Mesh:
    """Return an area seen from above as triangles that face up.

    >>> len(flat(shapely.box(0.0, 0.0, 1.0, 1.0)).triangles)
    2
    """
    parts = shapely.get_parts(area)
    found = shapely.get_parts(shapely.constrained_delaunay_triangles(parts[shapely.get_type_id(parts) == 3]))
    corners = shapely.get_coordinates(shapely.get_parts(found)).reshape(-1, 4, 2)[:, :3]
    # Points stay in the order of their rings: neighbours in a file are near each other, which compresses. As complex
    # numbers they are sorted in a fifth of the time that rows take.
    border = shapely.get_coordinates(parts)
    places, first = np.unique(border[:, 0] + 1j * border[:, 1], return_index=True)
    order = np.argsort(first)
    points = border[first[order]]
    numbers = np.empty(len(order), np.int64)
    numbers[order] = np.arange(len(order))
    triangles = numbers[np.searchsorted(places, corners[..., 0] + 1j * corners[..., 1])]
    one, two = corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0]
    clockwise = one[:, 0] * two[:, 1] < one[:, 1] * two[:, 0]
    triangles[clockwise] = triangles[clockwise][:, ::-1]
    return Mesh(np.column_stack([points, np.full(len(points), z_m)]), _in_order(triangles))


def _in_order(triangles: NDArray[np.int64]) -> NDArray[np.int64]:
    """Return the same triangles, each from its lowest number on, by that number."""
    turns = (triangles.argmin(axis=1)[:, None] + np.arange(3)) % 3
    turned = np.take_along_axis(triangles, turns, axis=1)
    ordered: NDArray[np.int64] = turned[np.lexsort(turned.T[::-1])]
    return ordered


def prism(outline: FloatArray, low_m: FloatArray | float, high_m: FloatArray | float) -> Mesh:
    """Return the upright walls on an outline, shape (n, 2), without floor and roof.

    A height is one number, or one for each corner.

    >>> len(prism(np.array([[0.0, 0.0], [1.0, 0.0], [0.0, 1.0]]), 0.0, 2.0).triangles)  # three walls of two each
    6
    """
    ring = shapely.get_coordinates(shapely.orient_polygons(shapely.Polygon(outline)))[:-1]
    n = len(ring)
    low, high = np.broadcast_to(low_m, n), np.broadcast_to(high_m, n)
    points = np.concatenate([np.column_stack([ring, low]), np.column_stack([ring, high])])
    a = np.arange(n)
    b = (a + 1) % n
    return Mesh(points, np.concatenate([np.stack([a, b, b + n], axis=1), np.stack([a, b + n, a + n], axis=1)]))


def ribbons(lines: Sequence[FloatArray], width_m: float) -> Mesh:
    """Return strips along lines of points, shape (n, 3) each, level across and facing up.

    >>> line = np.array([[0.0, 0.0, 0.0], [10.0, 0.0, 0.0]])
    >>> strips = ribbons([line, line + 5.0], 0.2)
    >>> len(strips.triangles), np.unique(strips.points_m[:, 1].round(6)).tolist()
    (4, [-0.1, 0.1, 4.9, 5.1])
    """
    if not lines:
        return join_shapes([])
    points = np.concatenate(lines)
    count = len(points)
    number = np.arange(count)
    ends = np.cumsum([len(line) for line in lines])
    after, before = np.minimum(number + 1, count - 1), np.maximum(number - 1, 0)
    after[ends - 1] = ends - 1
    before[ends[:-1]] = ends[:-1]
    step = (points[after] - points[before])[:, :2]
    left = np.column_stack([-step[:, 1], step[:, 0]]) / np.maximum(np.hypot(step[:, 0], step[:, 1]), 1e-9)[:, None]
    beside = np.column_stack([left * width_m / 2, np.zeros(count)])
    a = np.delete(number, ends - 1)
    triangles = np.concatenate(
        [np.stack([a, a + 1, a + count + 1], axis=1), np.stack([a, a + count + 1, a + count], axis=1)]
    )
    return Mesh(np.concatenate([points - beside, points + beside]), triangles)
