"""Road networks drawn from above: surfaces by lane type, marks, crosswalks, turn arrows, signs, names, heights.

Draws in metres of the local frame, everything except names below z-order 15. It draws maps only, no crashes. Geometry
is made once for all windows, and only the part in a window is drawn.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING, Final

from trace_dag.pages.canvas import Canvas, Ink
from trace_dag.pages.map_ground import (
    ASPHALT,
    SURFACE_NAMES,
    YELLOW,
    Arrows,
    Crosswalks,
    Marks,
    Shade,
    Surfaces,
    height_shades,
)
from trace_dag.pages.map_scene import MapScene, Window, window_of
from trace_dag.pages.map_signs import SIGNS, Names, Signs
from trace_dag.pages.picture_sheet import Sign, with_legend
from trace_dag.pages.scenery import Scenery, corners_of, draw_fading, draw_night, map_reach_m
from trace_dag.roads.map.network import RoadNetwork

if TYPE_CHECKING:
    from trace_dag.osm.types import OsmFeature

GROUND: Final = "#EFEDE4"
_ARROWS_UP_TO_M: Final = 350.0  # in wider windows arrows are specks
_MARKS_FROM_PT: Final = 0.45  # to a metre: below, the lines of a lane are wider than the lane
_WIDTH_PT, _WIDEST_PT = 460.0, 1540.0  # as pixels, 1,200 and 4,000
_M_PER_PT: Final = 2.5  # in the picture of a whole map, as far as these allow
_HIGHEST_LEVEL: Final = 9
NAMES_Z: Final = 22.0
"""Above the paths that vehicles take, below their bodies."""


class MapDrawing:
    """A map ready to be drawn in any windows inside an extent (m).

    ``legal_marks`` shows the marks that the law requires, else those in the map for the reconstruction. ``heights``
    colours the surfaces by height where they differ. ``surroundings`` are drawn behind the roads, ``dark`` means night,
    ``fading`` fades the edge of a map that was cut out around its origin.
    """

    def __init__(
        self,
        network: RoadNetwork,
        extent_m: Window,
        *,
        legal_marks: bool = True,
        heights: bool = False,
        surroundings: Sequence[OsmFeature] = (),
        dark: bool = False,
        fading: bool = False,
    ) -> None:
        scene = MapScene(network, extent_m)
        self.shade: Shade | None = height_shades(scene) if heights else None
        self._layers = [
            (layer > 0, Surfaces(scene, sections, self.shade), Marks(sections, legal=legal_marks), Arrows(sections))
            for layer, sections in scene.sections_by_layer()
        ]
        self._crosswalks = Crosswalks(scene)
        self._signs = Signs(scene)
        self._names = Names(scene)
        self._scenery = Scenery(surroundings, network.frame, extent_m)
        self._dark = dark
        self._reach_m = map_reach_m(network) if fading else 0.0

    def draw(self, canvas: Canvas, *, names: bool = True) -> None:
        """Draw the part of the map in a canvas' window."""
        canvas.polygons([corners_of(canvas.window)], Ink(GROUND), 0.0)
        self._scenery.draw(canvas)
        if self._reach_m:
            draw_fading(canvas, self._reach_m, GROUND)
        if self._dark:
            draw_night(canvas)
        for level, (bridge, surfaces, marks, arrows) in enumerate(self._layers):
            z = 1.0 + min(level, _HIGHEST_LEVEL)
            surfaces.draw(canvas, z, bridge=bridge)
            if canvas.points_per_m >= _MARKS_FROM_PT:
                marks.draw(canvas, z + 0.3)
            if canvas.span_m <= _ARROWS_UP_TO_M:
                arrows.draw(canvas, z + 0.4)
        self._crosswalks.draw(canvas, 12.0)
        self._signs.draw(canvas, 13.0)
        if names:
            self._names.draw(canvas, NAMES_Z, GROUND)

    def legend(self, canvas: Canvas) -> list[Sign]:
        """Return the legend of the features of the map that a canvas of this scale shows."""
        colours = {colour for _, surfaces, _, _ in self._layers for colour in surfaces.colours}
        found = [
            Sign(name, Ink(stroke=colour, width_pt=7.0)) for colour, name in SURFACE_NAMES.items() if colour in colours
        ]
        if canvas.points_per_m >= _MARKS_FROM_PT:
            found.append(Sign("line between directions, or left edge", Ink(stroke=YELLOW, width_pt=1.5)))
        if self._crosswalks.bars.points_m or self._crosswalks.outlines.points_m:
            found.append(Sign("crosswalk", Ink(stroke=ASPHALT, width_pt=7.0, dash_pt=(1.5, 1.5))))
        return found + [
            Sign(name, ink, symbol) for kind, (name, symbol, ink) in SIGNS.items() if kind in self._signs.kinds
        ]


def draw_network(
    network: RoadNetwork,
    window_m: Window,
    *,
    width_pt: float = _WIDTH_PT,
    legal_marks: bool = True,
    names: bool = True,
    heights: bool = False,
) -> str:
    """Return one window of a map as an SVG; options as of :class:`MapDrawing`.

    >>> draw_network(network, (-30.0, -20.0, 30.0, 20.0))[:4]
    '<svg'
    """
    canvas = Canvas(window_m, width_pt)
    MapDrawing(network, window_m, legal_marks=legal_marks, heights=heights).draw(canvas, names=names)
    return canvas.svg()


def draw_whole(network: RoadNetwork) -> str:
    """Return a whole map as an SVG, with a scale and a legend below; large maps are wider.

    >>> "traffic light</text>" in draw_whole(network)
    True
    """
    window_m = window_of(network)
    canvas = Canvas(window_m, whole_width_pt(network))
    drawing = MapDrawing(network, window_m)
    drawing.draw(canvas)
    return with_legend(canvas, drawing.legend(canvas))


def whole_width_pt(network: RoadNetwork) -> float:
    """Return the width of :func:`draw_whole` in points.

    >>> whole_width_pt(network)
    460.0
    """
    west, _, east, _ = window_of(network)
    return min(max(_WIDTH_PT, (east - west) / _M_PER_PT), _WIDEST_PT)
