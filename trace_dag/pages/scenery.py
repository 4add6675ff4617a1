"""Scenery behind the roads of a drawn map: woods, water, parking, buildings, railways, trees; night; the map's edge.

It draws OpenStreetMap's features beside the roads, in z-orders below them, so that a place is recognised. It does not
depend on crashes.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from typing import TYPE_CHECKING, Final, NamedTuple

import numpy as np
import shapely

from trace_dag.pages.canvas import Canvas, Ink
from trace_dag.pages.map_scene import Shapes, Window

if TYPE_CHECKING:
    from shapely.geometry.base import BaseGeometry

    from trace_dag.common.geometry import FloatArray, LocalFrame
    from trace_dag.osm.types import OsmFeature
    from trace_dag.roads.map.network import RoadNetwork

_NIGHT: Final = ("#0B1026", 0.32)  # over the map, below vehicles and paths
_NIGHT_Z: Final = 17.0
_FADE_Z: Final = 16.0
_FADE_SHARE: Final = 0.13  # of the way from the middle to the edge
_FADE_STEPS: Final = 14
_TREE_RADIUS_M: Final = 2.0
_TREE: Final = "#A3BE96"


class Appearance(NamedTuple):
    """The look of an area or a line: drawn from the lowest ``z`` up, lines ``width_m`` wide."""

    z: float
    colour: str
    edge: str = "none"
    width_m: float = 0.0


_WATER: Final = "#A9CBE0"
_LOOKS: Final = {
    ("landuse", "farmland"): Appearance(0.1, "#EDE8CF"),
    ("landuse", "meadow"): Appearance(0.1, "#DFE8CB"),
    ("landuse", "grass"): Appearance(0.2, "#DCE7C9"),
    ("natural", "grassland"): Appearance(0.1, "#DFE8CB"),
    ("landuse", "orchard"): Appearance(0.2, "#D3E2BC"),
    ("landuse", "vineyard"): Appearance(0.2, "#D3E2BC"),
    ("natural", "scrub"): Appearance(0.3, "#CFDDB8"),
    ("landuse", "forest"): Appearance(0.3, "#C2D7B0"),
    ("natural", "wood"): Appearance(0.3, "#C2D7B0"),
    ("natural", "wetland"): Appearance(0.3, "#CBDFD6"),
    ("natural", "tree_row"): Appearance(0.4, _TREE, width_m=3.0),
    ("natural", "water"): Appearance(0.4, _WATER),
    ("landuse", "basin"): Appearance(0.4, _WATER),
    ("landuse", "reservoir"): Appearance(0.4, _WATER),
    ("waterway", ""): Appearance(0.4, _WATER, width_m=3.0),
    ("amenity", "parking"): Appearance(0.5, "#DAD7D1", "#C6C2BA"),
    ("railway", ""): Appearance(0.7, "#8C8680", width_m=1.8),
    ("barrier", ""): Appearance(0.75, "#A89F90", width_m=0.4),
    ("building", ""): Appearance(0.8, "#D2C5B4", "#B0A18D"),
}
"""By key and value of a tag; a value of "" is any other one. The first that fits, from above."""


class Scenery:
    """Features beside the roads, ready to be drawn in any windows inside an extent (m, local frame)."""

    def __init__(self, features: Sequence[OsmFeature], frame: LocalFrame, extent_m: Window) -> None:
        areas: dict[Appearance, list[FloatArray]] = {}
        lines: dict[Appearance, list[FloatArray]] = {}
        trees: list[tuple[float, float]] = []
        for feature in features:
            look = look_of(feature)
            if feature.tags.get("natural") == "tree":
                trees += [tuple(place) for place in local_points(feature.geometry, frame)]
            elif look is not None:
                for part in parts_of(feature.geometry):
                    if isinstance(part, shapely.Polygon):
                        areas.setdefault(look, []).append(local_points(part.exterior, frame))
                    elif isinstance(part, shapely.LineString) and look.width_m:
                        lines.setdefault(look, []).append(local_points(part, frame))
        self._areas = [(look, Shapes(rings)) for look, rings in sorted(areas.items())]
        self._lines = [(look, Shapes(each)) for look, each in sorted(lines.items())]
        west, south, east, north = extent_m
        self._trees = np.array([(x, y) for x, y in trees if west < x < east and south < y < north]).reshape(-1, 2)

    def draw(self, canvas: Canvas) -> None:
        """Draw the features in the canvas' window, between z-orders 0.1 and 0.9."""
        for look, shapes in self._areas:
            edge = look.colour if look.edge == "none" else look.edge
            canvas.polygons(shapes.seen(canvas.window), Ink(look.colour, edge, 0.5), look.z)
        for look, shapes in self._lines:
            width_pt = max(look.width_m * canvas.points_per_m, 0.5)
            canvas.lines(shapes.seen(canvas.window), Ink(stroke=look.colour, width_pt=width_pt), look.z)
        if len(self._trees):
            canvas.discs(self._trees, _TREE_RADIUS_M, Ink(_TREE), 0.9)


def look_of(feature: OsmFeature) -> Appearance | None:
    """Return the look of a feature beside the roads, or None if it is not drawn."""
    for (key, value), look in _LOOKS.items():
        if key in feature.tags and value in ("", feature.tags[key]):
            return look
    return None


def parts_of(geometry: BaseGeometry) -> Iterator[BaseGeometry]:
    """Yield the single points, lines and polygons of a geometry.

    >>> [part.x for part in parts_of(shapely.MultiPoint([(1.0, 2.0), (3.0, 4.0)]))]
    [1.0, 3.0]
    """
    yield from getattr(geometry, "geoms", (geometry,))


def local_points(geometry: BaseGeometry, frame: LocalFrame) -> FloatArray:
    """Return the coordinates of a geometry in WGS84 in the local frame, shape (n, 2), m.

    >>> here = shapely.Point(network.frame.longitude_deg, network.frame.latitude_deg)
    >>> (local_points(here, network.frame).round(6) + 0.0).tolist()  # the origin of the frame
    [[0.0, 0.0]]
    """
    places = shapely.get_coordinates(geometry)
    return frame.to_local(places[:, 1], places[:, 0])


def draw_night(canvas: Canvas) -> None:
    """Darken the map."""
    colour, opacity = _NIGHT
    canvas.polygons([corners_of(canvas.window)], Ink(colour, opacity=opacity), _NIGHT_Z)


def corners_of(window: Window) -> FloatArray:
    """Return the four corners of a window, shape (4, 2), m.

    >>> corners_of((0.0, 0.0, 2.0, 1.0)).tolist()
    [[0.0, 0.0], [2.0, 0.0], [2.0, 1.0], [0.0, 1.0]]
    """
    west, south, east, north = window
    return np.array([(west, south), (east, south), (east, north), (west, north)])


def map_reach_m(network: RoadNetwork) -> float:
    """Return the distance (m) from the map's origin to each side: extracts are squares around the reported point."""
    ends = [
        network.road_geometry(road.id).line.sample(np.array([0.0, road.length_m]))[:, :2]
        for road in network.roads
        if road.junction_id is None
    ]
    return float(np.abs(np.concatenate(ends)).max()) if ends else 0.0


def draw_fading(canvas: Canvas, reach_m: float, ground: str) -> None:
    """Fade the map into the ground at its edge, if that is in the window."""
    fade_m = _FADE_SHARE * reach_m
    if max(map(abs, canvas.window)) < reach_m - fade_m:
        return
    far_m = reach_m + 10 * canvas.span_m
    for step in range(_FADE_STEPS):
        inner_m = reach_m - fade_m * (1 - (step + 0.5) / _FADE_STEPS)
        west, east = (-far_m, -inner_m), (inner_m, far_m)
        sides = [(west, (-far_m, far_m)), (east, (-far_m, far_m))]
        sides += [((-inner_m, inner_m), west), ((-inner_m, inner_m), east)]
        rings = [corners_of((left, low, right, high)) for (left, right), (low, high) in sides]
        # Each step lets some of the map through; all of them together hardly any.
        canvas.polygons(rings, Ink(ground, opacity=0.3), _FADE_Z)
