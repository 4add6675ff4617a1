"""Road networks drawn from above: surfaces by lane type, marks, crosswalks, turn arrows, signs, names, heights.

Draws in metres of the local frame, everything except names below z-order 15. It draws maps only, no crashes. Built for
many small pictures: geometry is made once for all views, everything of one kind is one collection, and what lies
outside the window is not drawn. What each kind looks like is in the modules ``map_*``.
"""

from __future__ import annotations

import io
from collections.abc import Sequence
from typing import TYPE_CHECKING, Final

import numpy as np

from trace_dag.roads.map.network import RoadNetwork
from trace_dag.scenario.map_arrows import Arrows
from trace_dag.scenario.map_crosswalks import Crosswalks
from trace_dag.scenario.map_marks import Marks
from trace_dag.scenario.map_names import Names
from trace_dag.scenario.map_panel import Panel
from trace_dag.scenario.map_scene import MapScene, Window
from trace_dag.scenario.map_signs import Signs
from trace_dag.scenario.map_surfaces import Shade, Surfaces, height_shades
from trace_dag.scenario.scenery import Scenery, draw_fading, draw_night, map_reach_m

if TYPE_CHECKING:
    from matplotlib.axes import Axes

    from trace_dag.osm.types import OsmFeature

GROUND: Final = "#EFEDE4"
_ARROWS_UP_TO_M: Final = 350.0  # in wider windows arrows are specks
_HIGHEST_LEVEL: Final = 9
NAMES_Z: Final = 22.0
"""Above the paths that vehicles take, below their bodies."""


class MapDrawing:
    """A map ready to be drawn in any windows inside an extent (m).

    ``legal_marks`` shows marks as the law has them, else as written in the map for the reconstruction. ``heights``
    colours the surfaces by height where they differ. ``surroundings`` lie behind the roads, ``dark`` is the night,
    ``fading`` lets a map that was cut out around its origin fade at its edge.
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

    def draw(self, panel: Panel, *, names: bool = True) -> None:
        """Draw what lies in a panel's window."""
        from matplotlib.patches import Rectangle

        west, south, east, north = panel.window
        panel.add(Rectangle((west, south), east - west, north - south, facecolor=GROUND, zorder=0))
        self._scenery.draw(panel)
        if self._reach_m:
            draw_fading(panel, self._reach_m, GROUND)
        if self._dark:
            draw_night(panel)
        for level, (bridge, surfaces, marks, arrows) in enumerate(self._layers):
            z = 1.0 + min(level, _HIGHEST_LEVEL)
            surfaces.draw(panel, z, bridge=bridge)
            marks.draw(panel, z + 0.3)
            if panel.span_m <= _ARROWS_UP_TO_M:
                arrows.draw(panel, z + 0.4)
        self._crosswalks.draw(panel, 12.0)
        self._signs.draw(panel, 13.0)
        if names:
            self._names.draw(panel, NAMES_Z, GROUND)


def draw_network(
    axes: Axes,
    network: RoadNetwork,
    *,
    window_m: Window,
    legal_marks: bool = True,
    names: bool = True,
    heights: bool = False,
) -> None:
    """Draw one window of a map on axes, which are set to it; options as of :class:`MapDrawing`.

    ``heights`` adds a colour bar (metres) where they differ by more than half a metre.

    >>> from matplotlib.figure import Figure
    >>> axes = Figure().add_subplot()
    >>> draw_network(axes, network, window_m=(-30.0, -20.0, 30.0, 20.0))
    >>> [float(end) for end in axes.get_xlim()]
    [-30.0, 30.0]
    """
    drawing = MapDrawing(network, window_m, legal_marks=legal_marks, heights=heights)
    drawing.draw(Panel.on_axes(axes, window_m), names=names)
    if drawing.shade is not None:
        _add_colour_bar(axes, drawing.shade)


def _add_colour_bar(axes: Axes, shade: Shade) -> None:
    from matplotlib.cm import ScalarMappable
    from matplotlib.colors import ListedColormap, Normalize

    bar = ScalarMappable(Normalize(shade.low_m, shade.high_m), ListedColormap(shade.colours))
    axes.figure.colorbar(bar, ax=axes, shrink=0.6, label="height of the surface (m)")


def draw_side_by_side(networks: Sequence[tuple[str, RoadNetwork]], *, window_m: Window, dpi: int = 90) -> bytes:
    """The same window of several maps of one site beside each other, each under its title; PNG.

    Maps whose frames have other origins are shifted into the first one's.

    >>> draw_side_by_side([("as built", network)], window_m=(-30.0, -30.0, 30.0, 30.0), dpi=20)[1:4]
    b'PNG'
    """
    from matplotlib.backends.backend_agg import FigureCanvasAgg
    from matplotlib.figure import Figure

    height = (window_m[3] - window_m[1]) / (window_m[2] - window_m[0])
    figure = Figure(figsize=(6.5 * len(networks), 6.5 * height + 0.5), dpi=dpi, layout="constrained")
    FigureCanvasAgg(figure)
    origin = networks[0][1].frame
    for axes, (title, network) in zip(np.ravel(figure.subplots(1, len(networks))), networks, strict=True):
        east, north = origin.to_local(network.frame.latitude_deg, network.frame.longitude_deg)
        west, south = window_m[0] - east, window_m[1] - north
        shifted = (west, south, west + window_m[2] - window_m[0], south + window_m[3] - window_m[1])
        draw_network(axes, network, window_m=shifted)
        axes.set_title(title, fontsize=10)
        axes.tick_params(labelsize=7)
    stream = io.BytesIO()
    figure.savefig(stream, format="png")
    return stream.getvalue()
