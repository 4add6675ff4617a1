"""What lies behind the roads of a drawn map: woods, water, parking, buildings, railways, trees; night; the map's edge.

Draws what OpenStreetMap has beside the roads, in z-orders below them, so that a place is recognised. Knows nothing of
crashes.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from typing import TYPE_CHECKING, Final, NamedTuple

import numpy as np
import shapely

from trace_dag.scenario.map_panel import Panel
from trace_dag.scenario.map_scene import Shapes, Window

if TYPE_CHECKING:
    from shapely.geometry.base import BaseGeometry

    from trace_dag.geometry import FloatArray, LocalFrame
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
    """How an area or a line is drawn: from the lowest ``z`` up, lines ``width_m`` wide."""

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
    """What is beside the roads, ready to be drawn in any windows inside an extent (m, local frame)."""

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

    def shapes(self, window: Window) -> Iterator[tuple[str, float, FloatArray]]:
        """What touches a window, from the lowest up: colour, width of a line (m; 0 of an area) and points (m)."""
        for each in (self._areas, self._lines):
            for look, shapes in each:
                for number in shapes.within(window):
                    yield look.colour, look.width_m if each is self._lines else 0.0, shapes.points_m[number]

    def draw(self, panel: Panel) -> None:
        """Draw what the panel's window shows, between z-orders 0.1 and 0.9."""
        from matplotlib.collections import EllipseCollection, LineCollection, PolyCollection

        for look, shapes in self._areas:
            rings = [shapes.points_m[number] for number in shapes.within(panel.window)]
            if rings:
                edge = look.colour if look.edge == "none" else look.edge
                panel.add(PolyCollection(rings, facecolors=look.colour, edgecolors=edge, linewidths=0.5, zorder=look.z))
        for look, shapes in self._lines:
            seen = [shapes.points_m[number] for number in shapes.within(panel.window)]
            if seen:
                width = max(look.width_m * panel.points_per_m, 0.5)
                panel.add(LineCollection(seen, colors=look.colour, linewidths=width, zorder=look.z))
        if len(self._trees):
            across = np.full(len(self._trees), 2 * _TREE_RADIUS_M * panel.points_per_m)
            trees = EllipseCollection(
                across, across, np.zeros(len(across)), units="points", offsets=self._trees, facecolors=_TREE,
                edgecolors="none", transOffset=panel.to_pixels, zorder=0.9,
            )  # fmt: skip
            trees.set_transform(panel.figure.dpi_scale_trans)
            panel.add(trees)


def look_of(feature: OsmFeature) -> Appearance | None:
    """How something beside the roads is drawn, if it is.

    >>> from trace_dag.osm.types import OsmFeature
    >>> look_of(OsmFeature("n1", shapely.Point(-101.5, 41.8), {"shop": "yes"})) is None  # a shop's point is not drawn
    True
    """
    for (key, value), look in _LOOKS.items():
        if key in feature.tags and value in ("", feature.tags[key]):
            return look
    return None


def parts_of(geometry: BaseGeometry) -> Iterator[BaseGeometry]:
    """The single points, lines and polygons of a geometry.

    >>> [part.x for part in parts_of(shapely.MultiPoint([(1.0, 2.0), (3.0, 4.0)]))]
    [1.0, 3.0]
    """
    yield from getattr(geometry, "geoms", (geometry,))


def local_points(geometry: BaseGeometry, frame: LocalFrame) -> FloatArray:
    """The coordinates of a geometry in WGS84 in the local frame, shape (n, 2), m.

    >>> here = shapely.Point(network.frame.longitude_deg, network.frame.latitude_deg)
    >>> (local_points(here, network.frame).round(6) + 0.0).tolist()  # the origin of the frame
    [[0.0, 0.0]]
    """
    places = shapely.get_coordinates(geometry)
    return frame.to_local(places[:, 1], places[:, 0])


def draw_night(panel: Panel) -> None:
    """Darken the map.

    >>> from matplotlib.figure import Figure
    >>> from trace_dag.scenario.map_panel import Panel
    >>> panel = Panel.on_figure(Figure(), (-60.0, -60.0, 60.0, 60.0), (0.0, 0.0, 1.0, 1.0))
    >>> draw_night(panel)
    >>> [(patch.get_width(), patch.get_height()) for patch in panel.figure.artists]  # one over the whole window
    [(120.0, 120.0)]
    """
    from matplotlib.patches import Rectangle

    west, south, east, north = panel.window
    colour, alpha = _NIGHT
    panel.add(Rectangle((west, south), east - west, north - south, facecolor=(colour, alpha), lw=0, zorder=_NIGHT_Z))


def map_reach_m(network: RoadNetwork) -> float:
    """How far the map goes to each side of its origin: extracts are squares around the reported point (m).

    >>> 100.0 < map_reach_m(network) < 1000.0
    True
    """
    ends = [
        network.road_geometry(road.id).line.sample(np.array([0.0, road.length_m]))[:, :2]
        for road in network.roads
        if road.junction_id is None
    ]
    return float(np.abs(np.concatenate(ends)).max()) if ends else 0.0


def draw_fading(panel: Panel, reach_m: float, ground: str) -> None:
    """Let the map fade into the ground at its edge, if a window shows that.

    >>> from matplotlib.figure import Figure
    >>> from trace_dag.scenario.map_panel import Panel
    >>> panel = Panel.on_figure(Figure(), (-60.0, -60.0, 60.0, 60.0), (0.0, 0.0, 1.0, 1.0))
    >>> draw_fading(panel, 400.0, "white")  # the edge of the map is far outside of this window
    >>> len(panel.figure.artists)
    0
    """
    from matplotlib.collections import PolyCollection

    fade_m = _FADE_SHARE * reach_m
    if max(map(abs, panel.window)) < reach_m - fade_m:
        return
    far_m = reach_m + 10 * panel.span_m
    rings = []
    for step in range(_FADE_STEPS):
        inner_m = reach_m - fade_m * (1 - (step + 0.5) / _FADE_STEPS)
        west, east = (-far_m, -inner_m), (inner_m, far_m)
        for (left, right), (low, high) in (
            (west, (-far_m, far_m)),
            (east, (-far_m, far_m)),
            ((-inner_m, inner_m), west),
            ((-inner_m, inner_m), east),
        ):
            rings.append(np.array([(left, low), (right, low), (right, high), (left, high)]))
    # Each step lets some of the map through; all of them together hardly any.
    panel.add(PolyCollection(rings, facecolors=[(ground, 0.3)], edgecolors="none", linewidths=0.0, zorder=_FADE_Z))
