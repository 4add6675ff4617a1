"""Features beside roads: fixed objects that vehicles strike, signals and signs, buildings and trees of the map."""

from __future__ import annotations

import math
import re
from collections import defaultdict
from collections.abc import Iterator, Sequence
from functools import cache
from typing import TYPE_CHECKING, Final

import numpy as np
import shapely

from trace_dag.common.units import METRES_PER_FOOT
from trace_dag.pages.map_scene import MapScene, Window
from trace_dag.pages.maps import PlacedSign, place_signs
from trace_dag.pages.scenery import local_points, look_of, parts_of
from trace_dag.pages.solid.gltf import Material
from trace_dag.pages.solid.ground import Heights, by_material
from trace_dag.pages.solid.shapes import Mesh, about_z, ball, box, cylinder, flat, join_shapes, prism
from trace_dag.pages.solid.vehicle_shapes import Parts
from trace_dag.roads.map.model import SignalType

if TYPE_CHECKING:
    from trace_dag.common.geometry import FloatArray, LocalFrame
    from trace_dag.osm.types import OsmFeature

_POST: Final = Material("#7C8084", roughness=0.6)
_WHITE, _BLACK = Material("#F4F4F0"), Material("#202327")
_RED: Final = Material("#C1272D")
_LAMPS: Final = (Material("#B23A32", glows=True), Material("#8F7420"), Material("#23633A"))
_WALL, _ROOF = Material("#C9BBA8"), Material("#8D7A6A")
_TRUNK, _CROWN = Material("#6A523A"), Material("#5F7F4C")
_STOREY_M: Final = 3.2
_HOUSE_M: Final = 5.0  # of buildings whose height nobody tagged
_LEAST_BUILDING_M2: Final = 4.0
_TREE_M, _TRUNK_M, _ROW_M = 8.0, 0.35, 8.0  # height, thickness, and how far apart in a row
_SIGN_M: Final = 0.75  # across: MUTCD, 2009, table 2B-1 (30 in)
_MOST_TREES: Final = 400


def signs(scene: MapScene, heights: Heights, window: Window) -> Parts:
    """Return signals and signs in a window, each on its post and facing its traffic."""
    west, south, east, north = window
    made: dict[Material, list[Mesh]] = defaultdict(list)
    for each in place_signs(scene):
        x, y = each.xy_m
        if west < x < east and south < y < north:
            z = float(heights.at(np.array([[x, y]]))[0])
            turn = about_z(each.heading_rad + math.pi)  # the face looks at who comes
            for material, mesh in _sign(each):
                made[material].append(mesh.turned(turn).moved((x, y, z)))
    return by_material(made)


def _sign(each: PlacedSign) -> Iterator[tuple[Material, Mesh]]:
    """Yield a sign or signal on its post, its face to +x."""
    signal = each.signal
    top = signal.z_offset_m + max(signal.height_m, 0.6)
    if signal.type == SignalType.LIGHT:
        low, high = top - 1.05, top
        yield _POST, cylinder(0.09, 0.0, high)
        yield _BLACK, box((0.06, -0.18, low), (0.30, 0.18, high))
        for k, lamp in enumerate(_LAMPS):
            disc = cylinder(0.12, 0.0, 0.03, 12)
            facing = Mesh(disc.points_m[:, [2, 0, 1]], disc.triangles)
            yield lamp, facing.moved((0.29, 0.0, high - 0.18 - 0.34 * k))
        return
    middle = top - _SIGN_M / 2
    yield _POST, cylinder(0.035, 0.0, top)
    if signal.type == SignalType.STOP:
        yield _WHITE, _plate(_polygon(8, _SIGN_M / 2 * 1.08), middle, 0.05)
        yield _RED, _plate(_polygon(8, _SIGN_M / 2), middle, 0.065)
        yield _WHITE, _lettering("STOP", 0.18, middle)
    elif signal.type == SignalType.YIELD:
        yield _RED, _plate(_polygon(3, 0.55), middle, 0.05)
        yield _WHITE, _plate(_polygon(3, 0.33), middle, 0.065)
    else:
        yield _WHITE, _plate(np.array([(-0.30, -0.375), (0.30, -0.375), (0.30, 0.375), (-0.30, 0.375)]), middle, 0.05)
        yield _BLACK, _lettering(each.text, 0.24, middle)


def _polygon(corners: int, radius: float) -> FloatArray:
    """Return a regular polygon that stands on a side, or a triangle on one of its sides."""
    turn = -math.pi / 2 if corners == 3 else math.pi / corners
    angles = turn + np.arange(corners) * math.tau / corners
    return radius * np.column_stack([np.cos(angles), np.sin(angles)])


def _plate(outline: FloatArray, middle_m: float, ahead_m: float) -> Mesh:
    """Return an upright plate; its outline is given as (to its own left, up)."""
    face = flat(shapely.Polygon(outline))
    y, z = face.points_m[:, 0], face.points_m[:, 1]
    front = Mesh(np.column_stack([np.full(len(y), ahead_m), y, z + middle_m]), face.triangles)
    back = Mesh(front.points_m - (0.02, 0.0, 0.0), face.triangles[:, ::-1])
    return join_shapes([front, back])


@cache
def _lettering(text: str, height_m: float, middle_m: float) -> Mesh:
    """Return letters on a sign, upright and to be read from +x."""
    lines = [
        shapely.LineString([((x + _LETTER_STEP * place) * height_m, y * height_m) for x, y in stroke])
        for place, letter in enumerate(text)
        for stroke in _STROKES.get(letter, _STROKES["?"])
    ]
    area = shapely.union_all(shapely.buffer(lines, _STROKE * height_m, cap_style="flat", join_style="mitre"))
    west, south, east, north = area.bounds
    letters = flat(area)
    y = letters.points_m[:, 0] - (west + east) / 2
    z = letters.points_m[:, 1] - (south + north) / 2 + middle_m
    return Mesh(np.column_stack([np.full(len(y), 0.075), y, z]), letters.triangles)


_ROUND: Final = ((0.1, 0), (0.5, 0), (0.6, 0.15), (0.6, 0.85), (0.5, 1), (0.1, 1), (0, 0.85), (0, 0.15), (0.1, 0))
_STROKES: Final[dict[str, tuple[tuple[tuple[float, float], ...], ...]]] = {
    "0": (_ROUND,),
    "O": (_ROUND,),
    "1": (((0.1, 0.8), (0.3, 1), (0.3, 0)),),
    "2": (((0, 0.85), (0.1, 1), (0.5, 1), (0.6, 0.85), (0.6, 0.65), (0, 0), (0.6, 0)),),
    "3": (((0, 1), (0.6, 1), (0.3, 0.6), (0.5, 0.6), (0.6, 0.45), (0.6, 0.15), (0.5, 0), (0.1, 0), (0, 0.15)),),
    "4": (((0.45, 0), (0.45, 1), (0, 0.3), (0.6, 0.3)),),
    "5": (((0.6, 1), (0, 1), (0, 0.55), (0.45, 0.6), (0.6, 0.45), (0.6, 0.15), (0.5, 0), (0.1, 0), (0, 0.15)),),
    "6": (
        ((0.5, 1), (0.1, 0.7), (0, 0.4), (0, 0.15), (0.1, 0), (0.5, 0), (0.6, 0.15), (0.6, 0.4), (0.5, 0.55), (0, 0.5)),
    ),
    "7": (((0, 1), (0.6, 1), (0.2, 0)),),
    "8": (_ROUND, ((0, 0.55), (0.6, 0.55))),
    "9": (
        ((0.1, 0), (0.5, 0.3), (0.6, 0.85), (0.5, 1), (0.1, 1), (0, 0.8), (0, 0.6), (0.1, 0.45), (0.6, 0.5)),
    ),
    "S": (
        (*((0.6, 0.85), (0.5, 1), (0.1, 1), (0, 0.85), (0, 0.65), (0.6, 0.35)),
         *((0.6, 0.15), (0.5, 0), (0.1, 0), (0, 0.15))),
    ),
    "T": (((0, 1), (0.6, 1)), ((0.3, 1), (0.3, 0))),
    "P": (((0, 0), (0, 1), (0.5, 1), (0.6, 0.85), (0.6, 0.6), (0.5, 0.45), (0, 0.45)),),
    "?": (((0, 0.85), (0.1, 1), (0.5, 1), (0.6, 0.85), (0.6, 0.65), (0.3, 0.45), (0.3, 0.25)), ((0.3, 0.1), (0.3, 0))),
}  # fmt: skip
"""The letters of signs as strokes, in a box 0.6 wide and 1 high."""
_LETTER_STEP, _STROKE = 0.85, 0.07


def areas_of(
    features: Sequence[OsmFeature], frame: LocalFrame, window: Window
) -> list[tuple[Material, shapely.Geometry]]:
    """Return the areas of the ground in a window, later ones above earlier ones: water, woods, parking.

    >>> areas_of([], network.frame, (-60.0, -60.0, 60.0, 60.0))  # nothing but grass
    []
    """
    border = shapely.box(*window)
    found: list[tuple[float, Material, shapely.Geometry]] = []
    for feature in features:
        look = look_of(feature)
        if look is None or "building" in feature.tags:
            continue
        for part in parts_of(feature.geometry):
            if isinstance(part, shapely.Polygon):
                area = shapely.make_valid(shapely.Polygon(local_points(part.exterior, frame)))
                if shapely.intersects(area, border):
                    found.append((look.z, Material(_planted(look.colour), roughness=1.0), area))
    return [(material, area) for _, material, area in sorted(found, key=lambda row: row[0])]


def beside_roads(features: Sequence[OsmFeature], frame: LocalFrame, heights: Heights, window: Window) -> Parts:
    """Return the buildings and trees of the map in a window."""
    border = shapely.box(*window)
    made: dict[Material, list[Mesh]] = defaultdict(list)
    trees: list[FloatArray] = []
    for feature in features:
        for part in parts_of(feature.geometry):
            if "building" in feature.tags and isinstance(part, shapely.Polygon):
                outline = local_points(part.exterior, frame)
                area = shapely.Polygon(outline)
                if area.is_valid and area.area > _LEAST_BUILDING_M2 and shapely.intersects(area, border):
                    for material, mesh in _building(area, outline, _height_m(feature), heights):
                        made[material].append(mesh)
            elif feature.tags.get("natural") == "tree":
                trees += list(local_points(part, frame))
            elif feature.tags.get("natural") == "tree_row" and isinstance(part, shapely.LineString):
                row = shapely.LineString(local_points(part, frame))
                trees += [shapely.get_coordinates(row.interpolate(s))[0] for s in np.arange(0.0, row.length, _ROW_M)]
    west, south, east, north = window
    standing = [place for place in trees if west < place[0] < east and south < place[1] < north]
    for k, place in enumerate(standing[:_MOST_TREES]):
        at = (*place, float(heights.at(np.array([place]))[0]))
        for material, mesh in tree_parts(_TRUNK_M, _TREE_M * (0.8 + 0.4 * (k * 0.618 % 1.0))):  # of various heights
            made[material].append(mesh.moved(at))
    return by_material(made)


def _planted(colour: str) -> str:
    """Return the colour of an area on a map, darkened for the 3D view."""
    return "#" + "".join(f"{int(int(colour[k : k + 2], 16) * 0.78):02X}" for k in (1, 3, 5))


def _height_m(feature: OsmFeature) -> float:
    """Return the height of a building from its OpenStreetMap tags, in metres or feet, or by its storeys."""
    found = re.match(r"\s*([\d.]+)\s*(m|ft|')?", feature.tags.get("height", ""))
    try:
        if found:
            return float(found[1]) * (METRES_PER_FOOT if found[2] in ("ft", "'") else 1.0)
        return max(1.0, float(feature.tags["building:levels"])) * _STOREY_M
    except (KeyError, ValueError):
        return _HOUSE_M


def _building(
    area: shapely.Polygon, outline: FloatArray, height_m: float, heights: Heights
) -> Iterator[tuple[Material, Mesh]]:
    ground = float(heights.at(outline).min())
    yield _WALL, prism(outline, ground - 1.0, ground + height_m)
    yield _ROOF, flat(area, ground + height_m)


def tree_parts(trunk_m: float, height_m: float) -> Parts:
    """Return a tree with a trunk of a given thickness (m), from half a metre below the ground up.

    >>> min(float(mesh.points_m[:, 2].min()) for _, mesh in tree_parts(0.3, 10.0))
    -0.5
    """
    crown = ball(0.30 * height_m, 1.15, 4, 8).moved((0.0, 0.0, 0.64 * height_m))
    return [(_TRUNK, cylinder(trunk_m / 2, -0.5, 0.5 * height_m, 8, 0.35 * trunk_m)), (_CROWN, crown)]
