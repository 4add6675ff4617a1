"""The sheet of a picture: two windows of the ground side by side, north up, a headline above and a legend below."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING, Final

import numpy as np

from trace_dag.scenario.map_panel import Panel
from trace_dag.scenario.map_scene import Window
from trace_dag.scenario.picture_legend import INK, Signs, Words, draw_legend, sign_column, vehicle_column, write

if TYPE_CHECKING:
    from PIL.Image import Image

_WIDTH_IN, _HEIGHT_IN, _PANEL_IN, _EDGE_IN = 13.0, 7.2, 6.36, 0.02
_LEGEND_IN: Final = 0.36
_LEFT_IN: Final = (_EDGE_IN, _WIDTH_IN - _PANEL_IN - _EDGE_IN)


class Sheet:
    """A sheet of 13 by 7.2 inches with a resolution in pixels per inch. ``words`` are written on it last."""

    def __init__(self, dpi: int) -> None:
        from matplotlib.backends.backend_agg import FigureCanvasAgg
        from matplotlib.figure import Figure

        self.words: list[Words] = []
        self._dpi = dpi
        self._figure = Figure(figsize=(_WIDTH_IN, _HEIGHT_IN), dpi=dpi)
        self._canvas = FigureCanvasAgg(self._figure)

    def panel(self, column: int, title: str, window: Window) -> Panel:
        """The left (0) or the right (1) panel, framed, with a scale."""
        left_in = _LEFT_IN[column]
        place = left_in / _WIDTH_IN, _LEGEND_IN / _HEIGHT_IN, _PANEL_IN / _WIDTH_IN, _PANEL_IN / _HEIGHT_IN
        panel = Panel.on_figure(self._figure, window, place)
        self.words.append(_draw_scale(panel, left_in, title))
        return panel

    def write_at(self, panel: Panel, xy_m: tuple[float, float], text: str) -> None:
        """Write beside a place of a panel; nothing if the place is outside."""
        west, south, east, north = panel.window
        if west < xy_m[0] < east and south < xy_m[1] < north:
            x_px, y_px = panel.to_pixels.transform(xy_m)
            rightmost = 2 * xy_m[0] > west + east
            x_in = x_px / self._dpi + (-0.08 if rightmost else 0.08)
            anchor = "rm" if rightmost else "lm"
            self.words.append(Words(x_in, _HEIGHT_IN - y_px / self._dpi, text, anchor=anchor, backed=True))

    def legend(self, left: Signs, right: Signs) -> None:
        """Draw the legend: the parties below the left panel, the meaning of the signs below the right one."""
        columns = (_LEFT_IN[0], vehicle_column(left), left), (_LEFT_IN[1], sign_column(right), right)
        self.words += draw_legend(self._figure, _HEIGHT_IN - _LEGEND_IN, columns)

    def picture(self) -> Image:
        """The finished picture."""
        from PIL import Image

        self._canvas.draw()  # type: ignore[no-untyped-call]
        pixels = np.asarray(self._canvas.buffer_rgba())  # type: ignore[no-untyped-call]
        picture = Image.fromarray(pixels).convert("RGB")
        write(picture, self.words, self._dpi)
        return picture


def square(centre: tuple[float, float], half_m: float) -> Window:
    """A window around a place.

    >>> square((10.0, 20.0), 5.0)
    (5.0, 15.0, 15.0, 25.0)
    """
    x, y = centre
    return x - half_m, y - half_m, x + half_m, y + half_m


def around(one: Window, other: Window) -> Window:
    """The smallest window that contains both.

    >>> around((0.0, 0.0, 10.0, 10.0), (5.0, -5.0, 20.0, 5.0))
    (0.0, -5.0, 20.0, 10.0)
    """
    west, south = (min(one[i], other[i]) for i in (0, 1))
    east, north = (max(one[i], other[i]) for i in (2, 3))
    return west, south, east, north


def _draw_scale(panel: Panel, left_in: float, title: str) -> Words:
    """Draw a frame, a scale bar of a round number of metres, the direction of north, and their labels."""
    from matplotlib.collections import PolyCollection
    from matplotlib.patches import Rectangle

    west, south, east, north = panel.window
    unit = (east - west) / 100
    bar_m = _round_length(17 * unit)
    x, y = west + 2 * unit, south + 1.7 * unit
    shapes = (
        np.array([(-1.1, -1), (21.5, -1), (21.5, 4.1), (-1.1, 4.1)]) * unit,
        np.array([(0, 0), (bar_m, 0), (bar_m, 0.5 * unit), (0, 0.5 * unit)]),
        np.array([(18.4, 0), (19.4, 0.7), (20.4, 0), (19.4, 3.2)]) * unit,
    )
    drawn = PolyCollection(
        [shape + np.array([x, y]) for shape in shapes], facecolors=[("white", 0.85), INK, INK], lw=0, zorder=49
    )
    panel.add(drawn)
    panel.add(Rectangle((west, south), east - west, north - south, fill=False, edgecolor=INK, lw=1.6, zorder=48))
    up_in = _LEGEND_IN + 0.042 * _PANEL_IN
    return Words(left_in + 0.02 * _PANEL_IN, _HEIGHT_IN - up_in, f"{title}   {bar_m:g} m")


def _round_length(length_m: float) -> float:
    """The largest of 1, 2, 5, 10, 20, ... that is no longer."""
    power = 10.0 ** math.floor(math.log10(length_m))
    return power * max(step for step in (1, 2, 5) if step * power <= length_m)
