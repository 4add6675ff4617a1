"""Signals and signs of a drawn map, as symbols of one size at any scale."""

from __future__ import annotations

import math
from collections import defaultdict
from collections.abc import Iterator
from functools import lru_cache
from typing import TYPE_CHECKING, Final, NamedTuple

import numpy as np

from trace_dag.roads.map.model import Signal
from trace_dag.scenario.map_marks import WHITE
from trace_dag.scenario.map_panel import Panel
from trace_dag.scenario.map_scene import MapScene, inside
from trace_dag.units import mps_to_mph

if TYPE_CHECKING:
    from matplotlib.path import Path

    from trace_dag.geometry import FloatArray

_RED: Final = "#C1272D"
_BLACK: Final = "#202327"
_LAMPS: Final = ("#E5443B", "#F2C230", "#3FB35F")
LIGHT, STOP, YIELD, LIMIT = "1000001", "206", "205", "274"
"""Signals by OpenDRIVE type: a traffic light, and the signs that are drawn."""
_NEAR_M: Final = 150.0  # windows wider than this have smaller symbols
_NEAR_HALF_PT, _FAR_HALF_PT = 3.9, 2.75  # of a symbol
_LIMIT_SIZE_PT: Final = 5.5


class Signs:
    """The signals and signs in a scene, by kind; of speed limits, by what they say."""

    def __init__(self, scene: MapScene) -> None:
        kinds: dict[tuple[str, str], list[tuple[float, float]]] = defaultdict(list)
        for each in placed_signs(scene):
            kinds[each.signal.type, each.text].append(each.xy_m)
        self._kinds = {kind: np.array(places) for kind, places in sorted(kinds.items())}

    def draw(self, panel: Panel, z: float) -> None:
        """Draw what the window shows."""
        half_pt = _NEAR_HALF_PT if panel.span_m < _NEAR_M else _FAR_HALF_PT
        for (kind, text), places in self._kinds.items():
            shown = places[inside(places, panel.window)]
            if len(shown) and kind == LIMIT:
                board, digits = _limit_paths(text)
                _stamp(panel, shown, [board], ["white"], z, edge=_BLACK, line=0.7)
                _stamp(panel, shown, [digits], [_BLACK], z + 0.1)
            elif len(shown) and kind == LIGHT:
                _stamp(panel, shown, [_symbol("s", half_pt)], [_BLACK], z, edge=_BLACK)
                # The lamps of a signal head, above each other inside its symbol.
                lamps = [_symbol("o", 0.27 * half_pt, up * 0.6 * half_pt) for up in (1, 0, -1)]
                _stamp(panel, shown, lamps, _LAMPS, z + 0.1)
            elif len(shown):
                marker = (8, 0, 22) if kind == STOP else "v"
                face, edge = (_RED, WHITE) if kind == STOP else (WHITE, _RED)
                _stamp(panel, shown, [_symbol(marker, half_pt)], [face], z, edge=edge)


class PlacedSign(NamedTuple):
    """A signal or sign: its place (m), the direction of the traffic it applies to (rad), and its text."""

    signal: Signal
    xy_m: tuple[float, float]
    heading_rad: float
    text: str


def placed_signs(scene: MapScene) -> Iterator[PlacedSign]:
    """The traffic lights, and the signs of the kinds that are drawn.

    >>> from trace_dag.scenario.map_scene import MapScene
    >>> LIGHT in {each.signal.type for each in placed_signs(MapScene(network, (-60.0, -60.0, 60.0, 60.0)))}
    True
    """
    for road in {section.road.id: section.road for section in scene.sections}.values():
        line = scene.network.road_geometry(road.id).line
        for signal in road.signals:
            if signal.type in (LIGHT, STOP, YIELD, LIMIT):
                x, y, heading, _ = line.at(signal.s_m)
                place = (x - signal.t_m * math.sin(heading), y + signal.t_m * math.cos(heading))
                text = _limit_text(signal) if signal.type == LIMIT else ""
                yield PlacedSign(signal, place, heading + (math.pi if signal.orientation == "-" else 0.0), text)


def _stamp(
    panel: Panel,
    places_m: FloatArray,
    paths: list[Path],
    faces: list[str] | tuple[str, ...],
    z: float,
    *,
    edge: str = "none",
    line: float = 0.9,
) -> None:
    """Paths in points, each with its face, on every place."""
    from matplotlib.collections import PathCollection
    from matplotlib.transforms import Affine2D

    stamps = PathCollection(
        paths,
        offsets=np.repeat(places_m, len(paths), axis=0),
        offset_transform=panel.to_pixels,
        facecolors=faces,
        edgecolors=edge,
        linewidths=line,
        zorder=z,
    )
    stamps.set_transform(Affine2D().scale(1 / 72) + panel.figure.dpi_scale_trans)
    panel.add(stamps)


def _symbol(marker: str | tuple[int, int, int], half_pt: float, up_pt: float = 0.0) -> Path:
    """A marker of matplotlib's as a path in points."""
    from matplotlib.markers import MarkerStyle
    from matplotlib.transforms import Affine2D

    style = MarkerStyle(marker)
    unit = style.get_path().transformed(style.get_transform())
    return unit.transformed(Affine2D().scale(2 * half_pt).translate(0.0, up_pt))  # markers are of half size 0.5


@lru_cache(maxsize=64)
def _limit_paths(text: str) -> tuple[Path, Path]:
    """The board of a speed limit and its number, in points around its middle."""
    from matplotlib.path import Path
    from matplotlib.textpath import TextPath

    digits = TextPath((0.0, 0.0), text, size=_LIMIT_SIZE_PT)
    box = digits.get_extents()
    middle = np.array([box.x0 + box.x1, box.y0 + box.y1]) / 2
    half = np.array([box.width, box.height]) / 2 + 0.25 * _LIMIT_SIZE_PT
    board = np.array([(-1, -1), (1, -1), (1, 1), (-1, 1), (-1, -1)]) * half
    return Path(board, closed=True), Path(digits.vertices - middle, digits.codes)


def _limit_text(signal: Signal) -> str:
    if signal.value is None:
        return "?"
    return f"{mps_to_mph(signal.value):.0f}" if signal.unit == "m/s" else f"{signal.value:.0f}"
