"""Fixed objects as bodies, by the type in the report, with the dimensions of the simulation.

Axes: x along the object, y left, z up from the ground, metres, the origin in its middle.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Final

import numpy as np
import shapely

from trace_dag.pages.solid.gltf import Material
from trace_dag.pages.solid.roadside import tree_parts
from trace_dag.pages.solid.shapes import Mesh, ball, bar, box, cylinder, flat, join_shapes, loft, prism
from trace_dag.pages.solid.vehicle_shapes import Parts
from trace_dag.scenario.drawn_shapes import OBJECT_COLOUR
from trace_dag.simulation.objects import FixedObject, slope_profile_m

_STEEL, _CONCRETE = Material("#A7ABAE", roughness=0.5), Material("#B5B2AA")
_WOOD, _BROWN = Material("#7B6247"), Material(OBJECT_COLOUR)
_RED, _YELLOW, _BLACK = Material("#B8322B"), Material("#D9B02B"), Material("#202327")
_WALL, _ROOF, _STONE = Material("#C9BBA8"), Material("#8D7A6A"), Material("#8B8880")
_EARTH, _GREEN, _SNOW = Material("#7E6B4E", roughness=1.0), Material("#5F7F4C", roughness=1.0), Material("#F3F5F7")
_TOP_M: Final = 4.0  # of an embankment, level
_POST_EVERY_M: Final = 1.905  # posts of a strong-post W-beam guardrail: 6 ft 3 in

Maker = Callable[[FixedObject], Parts]


def object_parts(item: FixedObject) -> Parts:
    """Build a fixed object."""
    return _MAKERS.get(item.code, _block(_BROWN))(item)


def _block(material: Material) -> Maker:
    def made(item: FixedObject) -> Parts:
        return [(material, _box(item))]

    return made


def _box(item: FixedObject, low_m: float = 0.0) -> Mesh:
    a, b = item.length_m / 2, item.width_m / 2
    return box((-a, -b, low_m), (a, b, item.height_m))


def _round(material: Material) -> Maker:
    def made(item: FixedObject) -> Parts:
        return [(material, cylinder(max(item.length_m, item.width_m) / 2, -0.3, item.height_m, 10))]

    return made


def _posts(item: FixedObject, every_m: float, width_m: float) -> list[Mesh]:
    half = item.length_m / 2
    count = max(2, round(item.length_m / every_m) + 1)
    return [
        box((x - width_m / 2, -width_m / 2, -0.3), (x + width_m / 2, width_m / 2, item.height_m))
        for x in np.linspace(-half, half, count)
    ]


def _rails(item: FixedObject, heights: tuple[float, ...], tall_m: float, deep_m: float) -> list[Mesh]:
    half = item.length_m / 2
    return [
        box((-half, -deep_m / 2, share * item.height_m - tall_m), (half, deep_m / 2, share * item.height_m))
        for share in heights
    ]


def _guardrail(item: FixedObject) -> Parts:
    rail = _rails(item, (1.0, 0.80), 0.13, item.width_m)
    return [(_WOOD, join_shapes(_posts(item, _POST_EVERY_M, 0.15))), (_STEEL, join_shapes(rail))]


def _bridge_rail(item: FixedObject) -> Parts:
    posts = join_shapes(_posts(item, 2.5, 0.2))
    return [(_CONCRETE, join_shapes([posts, *_rails(item, (1.0, 0.65), 0.2, item.width_m), _foot(item)]))]


def _foot(item: FixedObject) -> Mesh:
    half, b = item.length_m / 2, item.width_m / 2
    return box((-half, -b, 0.0), (half, b, 0.15))


def _barrier(item: FixedObject) -> Parts:
    """Return a concrete barrier with a broad foot."""
    a, b, h = item.length_m / 2, item.width_m / 2, item.height_m
    ring = np.array(
        [(-b, 0.0), (b, 0.0), (b, 0.08), (0.55 * b, 0.33), (0.3 * b, h), (-0.3 * b, h), (-0.55 * b, 0.33), (-b, 0.08)]
    )
    return [(_CONCRETE, loft(np.array([-a, a]), np.stack([ring, ring])))]


def _cables(item: FixedObject) -> Parts:
    half = item.length_m / 2
    cables = [bar((-half, 0.0, k * item.height_m), (half, 0.0, k * item.height_m), 0.015, 5) for k in (0.6, 0.8, 1.0)]
    return [(_STEEL, join_shapes([*_posts(item, 3.0, 0.07), *cables]))]


def _fence(item: FixedObject) -> Parts:
    return [(_WOOD, join_shapes([*_posts(item, 2.4, 0.1), *_rails(item, (0.95, 0.6, 0.25), 0.1, 0.05)]))]


def _bank(material: Material) -> Maker:
    """Return a function that makes a bank with the object's width at its foot, and a ridge."""

    def made(item: FixedObject) -> Parts:
        a, b, h = item.length_m / 2, item.width_m / 2, item.height_m
        ring = np.array([(-b, -0.2), (b, -0.2), (b, 0.0), (0.35 * b, h), (-0.35 * b, h), (-b, 0.0)])
        return [(material, loft(np.array([-a, a]), np.stack([ring, ring])))]

    return made


def _slope(item: FixedObject) -> Parts:
    """Return a ditch or embankment with the simulated profile; an embankment ends behind its top."""
    profile = slope_profile_m(item)
    (last_m, high_m) = profile[-1]
    if high_m > 0:
        profile = *profile, (last_m + _TOP_M, high_m), (last_m + _TOP_M + item.width_m, 0.0)
    n = len(profile)
    across = np.array(profile)
    points = np.concatenate([np.column_stack([np.full(n, x), across]) for x in (-item.length_m / 2, item.length_m / 2)])
    a = np.arange(n - 1)
    faces = [np.column_stack([a, a + n, a + n + 1]), np.column_stack([a, a + n + 1, a + 1])]
    fan = np.column_stack([np.zeros_like(a[1:]), a[1:], a[1:] + 1])  # its two ends, to be seen from both sides
    ends = [fan, fan[:, ::-1], fan + n, fan[:, ::-1] + n]
    return [(_EARTH, Mesh(points, np.concatenate([*faces, *ends]).astype(np.int64)))]


def _patch(item: FixedObject) -> Parts:
    """Return a flat patch of unpaved ground."""
    a, b = item.length_m / 2, item.width_m / 2
    return [(_EARTH, flat(shapely.box(-a, -b, a, b), 0.02))]


def _utility_pole(item: FixedObject) -> Parts:
    arm = box((-0.06, -1.1, item.height_m - 0.9), (0.06, 1.1, item.height_m - 0.75))
    return [(_WOOD, join_shapes([cylinder(item.length_m / 2, -0.5, item.height_m, 10, 0.3 * item.length_m), arm]))]


def _signal_pole(item: FixedObject) -> Parts:
    post = cylinder(item.length_m / 2, -0.3, item.height_m, 10, 0.3 * item.length_m)
    head = box((-0.18, 0.15, item.height_m - 1.1), (0.18, 0.45, item.height_m - 0.05))
    return [(_STEEL, post), (_BLACK, head)]


def _sign_post(item: FixedObject) -> Parts:
    board = box((-0.02, -0.375, item.height_m - 0.75), (0.02, 0.375, item.height_m))
    return [(_STEEL, join_shapes([cylinder(item.length_m / 2, -0.3, item.height_m, 8), board]))]


def _tree(item: FixedObject) -> Parts:
    return tree_parts(item.length_m, item.height_m)


def _shrub(item: FixedObject) -> Parts:
    return [(_GREEN, ball(item.length_m / 2, item.height_m / item.length_m).moved((0.0, 0.0, item.height_m / 2)))]


def _boulder(item: FixedObject) -> Parts:
    return [(_STONE, ball(item.length_m / 2, item.height_m / item.length_m, 3, 6).moved((0.0, 0.0, item.height_m / 2)))]


def _hydrant(item: FixedObject) -> Parts:
    radius = item.length_m / 2
    cap = ball(radius, 0.8).moved((0.0, 0.0, 0.8 * item.height_m))
    return [(_RED, join_shapes([cylinder(0.75 * radius, -0.2, 0.8 * item.height_m), cap]))]


def _mailbox(item: FixedObject) -> Parts:
    a, b, h = item.length_m / 2, item.width_m / 2, item.height_m
    return [(_WOOD, cylinder(0.05, -0.3, h - 0.2)), (_BLACK, box((-a, -b * 0.7, h - 0.25), (a, b * 0.7, h)))]


def _building(item: FixedObject) -> Parts:
    a, b, h = item.length_m / 2, item.width_m / 2, item.height_m
    corners = np.array([(-a, -b), (a, -b), (a, b), (-a, b)])
    return [(_WALL, prism(corners, -0.5, h)), (_ROOF, flat(shapely.Polygon(corners), h))]


_MAKERS: Final[dict[int, Maker]] = {
    17: _boulder,
    19: _building,
    20: _block(_YELLOW),
    21: _round(_CONCRETE),
    23: _bridge_rail,
    24: _guardrail,
    25: _barrier,
    26: _guardrail,
    30: _utility_pole,
    31: _round(_STEEL),
    32: _block(_CONCRETE),
    33: _block(_CONCRETE),
    34: _slope,
    35: _slope,
    38: _fence,
    39: _block(_STONE),
    40: _hydrant,
    41: _shrub,
    42: _tree,
    44: _patch,
    46: _signal_pole,
    48: _bank(_SNOW),
    50: _round(_CONCRETE),
    52: _guardrail,
    53: _mailbox,
    57: _cables,
    58: _patch,
    59: _sign_post,
}
"""By ``SOE`` code, as :data:`trace_dag.simulation.objects.KINDS`; others are blocks of their size."""
