"""The sheet of a picture: two windows of the ground side by side, north up, a headline above and a legend below.

The sheet is measured in points from its lower left corner, x to the right and y upward.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Final, NamedTuple

import numpy as np
import shapely

from trace_dag.pages.canvas import Canvas, Ink, length_pt
from trace_dag.pages.map_scene import Window

INK: Final = "#1D2024"
WIDTH_PT: Final = 936.0
HEIGHT_PT: Final = 518.0
_PANEL_PT, _LEGEND_PT, _EDGE_PT, _MARGIN_PT = 458.0, 26.0, 1.5, 6.0
_LEFT_PT: Final = (_EDGE_PT, WIDTH_PT - _PANEL_PT - _EDGE_PT)
_SIZE_PT: Final = 7.5
_HEADLINE_PT: Final = 10.5
_HEADLINE_AT_PT: Final = (509.0, 495.0)
_SMALLEST: Final = 0.75  # share of its size in which a long line is set; below, it could not be read
_STROKE_PT, _GAP_PT, _ROW_PT = 14.0, 6.0, 13.0
_FRAME_Z, _WORDS_Z = 50.0, 51.0


class Sign(NamedTuple):
    """A sign of the legend: a stroke in its ink, or one of the canvas' symbols, or a "cross"."""

    label: str
    ink: Ink
    symbol: str = ""


class LegendColumn(NamedTuple):
    """The layout of the legend: number of rows, their distance, and width of a column (points)."""

    rows: int
    first_row_pt: float
    row_pt: float
    width_pt: float


_FEW: Final = LegendColumn(2, 8.0, 10.8, 230.0)
_MANY: Final = LegendColumn(3, 5.6, 8.0, 230.0)
_CROWD: Final = LegendColumn(3, 5.6, 8.0, 115.0)


class Sheet:
    """A sheet to draw on; :meth:`svg` returns the drawing."""

    def __init__(self) -> None:
        self._canvas = Canvas((0.0, 0.0, WIDTH_PT, HEIGHT_PT), WIDTH_PT)
        self._canvas.polygons([_box(0.0, 0.0, WIDTH_PT, HEIGHT_PT)], Ink("white"), 0.0)
        self._panels: list[tuple[float, Canvas]] = []

    def headline(self, line: int, text: str) -> None:
        """Write one of the two lines of the headline, in smaller letters or cut if it is too long."""
        if not text:
            return
        room_pt = WIDTH_PT - 2 * _MARGIN_PT
        size_pt = _HEADLINE_PT * max(min(room_pt / length_pt(text, _HEADLINE_PT), 1.0), _SMALLEST)
        while length_pt(text, size_pt) > room_pt and " " in text:
            text = text.removesuffix(" …").rpartition(" ")[0] + " …"
        self._write(text, _MARGIN_PT, _HEADLINE_AT_PT[line], size_pt)

    def panel(self, column: int, title: str, window: Window) -> Canvas:
        """Return the left (0) or the right (1) panel, framed, with a scale and the direction of north."""
        panel = Canvas(window, _PANEL_PT)
        west, south, east, _ = window
        unit_m = (east - west) / 100
        panel.taken.append(shapely.box(west, south, west + 23.5 * unit_m, south + 5.8 * unit_m))  # by the scale
        left = _LEFT_PT[column]
        self._panels.append((left, panel))
        self._draw_frame(left, title, window)
        return panel

    def write_at(self, panel: Canvas, xy_m: tuple[float, float], text: str) -> None:
        """Write beside a position in a panel, on white, without covering it; do nothing if it is outside."""
        west, south, east, north = panel.window
        if west < xy_m[0] < east and south < xy_m[1] < north:
            half_pt = length_pt(text, _SIZE_PT) / 2 + 4.0
            x_m = xy_m[0] + (-1 if 2 * xy_m[0] > west + east else 1) * (half_pt + 3.0) / panel.points_per_m
            y_m, half_m, high_m = xy_m[1], half_pt / panel.points_per_m, 6.0 / panel.points_per_m
            step_m, taken = high_m if 2 * y_m < south + north else -high_m, shapely.union_all(panel.taken)
            while (room := shapely.box(x_m - half_m, y_m - high_m, x_m + half_m, y_m + high_m)).intersects(taken):
                y_m += step_m
            panel.taken.append(room)
            panel.polygons([shapely.get_coordinates(room)], Ink("white"), _FRAME_Z)
            panel.text(text, x_m, y_m, _SIZE_PT, INK, _WORDS_Z)

    def legend(self, left: Sequence[Sign], right: Sequence[Sign]) -> None:
        """Draw the legend: the parties below the left panel, the meaning of the signs below the right one."""
        for left_pt, signs in zip(_LEFT_PT, (left, right), strict=True):
            column = next(each for each in (_FEW, _MANY, _CROWD) if len(signs) <= 2 * each.rows or each is _CROWD)
            for number, sign in enumerate(signs):
                x = left_pt + 4.0 + number // column.rows * column.width_pt
                y = _LEGEND_PT - column.first_row_pt - column.row_pt * (number % column.rows)
                draw_sign(self._canvas, sign, x, y)

    def svg(self) -> str:
        """Return the finished sheet."""
        return self._canvas.with_panels((left, _LEGEND_PT, _PANEL_PT, _PANEL_PT, panel) for left, panel in self._panels)

    def _write(self, text: str, x: float, y: float, size_pt: float) -> None:
        self._canvas.text(text, x, y, size_pt, INK, _WORDS_Z, anchor="start")

    def _draw_frame(self, left: float, title: str, window: Window) -> None:
        """Draw a frame, a scale bar of a round number of metres, the direction of north, and their labels."""
        unit = _PANEL_PT / 100
        bar_m = _round_length(0.17 * (window[2] - window[0]))
        bar_pt = bar_m * _PANEL_PT / (window[2] - window[0])
        x, y = left + 2 * unit, _LEGEND_PT + 1.7 * unit
        draw = self._canvas.polygons
        draw([_box(left, _LEGEND_PT, _PANEL_PT, _PANEL_PT)], Ink(stroke=INK, width_pt=1.2), _FRAME_Z)
        draw([_box(x - 1.1 * unit, y - unit, 22.6 * unit, 5.1 * unit)], Ink("white", opacity=0.85), _FRAME_Z)
        draw([_box(x, y, bar_pt, 0.5 * unit)], Ink(INK), _WORDS_Z)
        north = np.array([(18.4, 0), (19.4, 0.7), (20.4, 0), (19.4, 3.2)]) * unit
        draw([north + np.array([x, y])], Ink(INK), _WORDS_Z)
        self._write(f"{title}   {bar_m:g} m", x, y + 2.4 * unit, _SIZE_PT)


def draw_sign(sheet: Canvas, sign: Sign, x: float, y: float, stroke_pt: float = _STROKE_PT) -> None:
    """Draw a sign of the legend with its label beside it, on a canvas in points."""
    if sign.symbol == "cross":
        sheet.cross(x + stroke_pt / 2, y, 4.5, sign.ink, _WORDS_Z)
    elif sign.symbol:
        sheet.symbol(sign.symbol, x + stroke_pt / 2, y, 4.5, sign.ink, _WORDS_Z)
    else:
        sheet.lines([np.array([(x, y), (x + stroke_pt, y)])], sign.ink, _WORDS_Z)
    sheet.text(sign.label, x + stroke_pt + _GAP_PT, y, _SIZE_PT, INK, _WORDS_Z, anchor="start")


def with_legend(panel: Canvas, signs: Sequence[Sign]) -> str:
    """Return a panel as an SVG, above a scale and a legend in as many rows as these need."""
    west, south, east, north = panel.window
    bar_m = _round_length(0.17 * (east - west))
    x_pt, row = _MARGIN_PT, 0
    placed: list[tuple[Sign, float, int, float]] = []
    for sign in (Sign(f"{bar_m:g} m", Ink(stroke=INK, width_pt=2.3)), *signs):
        stroke_pt = _STROKE_PT if placed else bar_m * panel.points_per_m
        width_pt = stroke_pt + _GAP_PT + length_pt(sign.label, _SIZE_PT)
        if placed and x_pt + width_pt > panel.width_pt - _MARGIN_PT:
            x_pt, row = _MARGIN_PT, row + 1
        placed.append((sign, x_pt, row, stroke_pt))
        x_pt += width_pt + 2 * _GAP_PT
    legend_pt, height_pt = _ROW_PT * (row + 1.5), (north - south) * panel.points_per_m
    sheet = Canvas((0.0, 0.0, panel.width_pt, height_pt + legend_pt), panel.width_pt)
    for sign, x_pt, row, stroke_pt in placed:
        draw_sign(sheet, sign, x_pt, legend_pt - _ROW_PT * (row + 0.75), stroke_pt)
    return sheet.with_panels([(0.0, legend_pt, panel.width_pt, height_pt, panel)])


def square(centre: tuple[float, float], half_m: float) -> Window:
    """Return a window around a place.

    >>> square((10.0, 20.0), 5.0)
    (5.0, 15.0, 15.0, 25.0)
    """
    x, y = centre
    return x - half_m, y - half_m, x + half_m, y + half_m


def around(one: Window, other: Window) -> Window:
    """Return the smallest window that contains both.

    >>> around((0.0, 0.0, 10.0, 10.0), (5.0, -5.0, 20.0, 5.0))
    (0.0, -5.0, 20.0, 10.0)
    """
    west, south = (min(one[i], other[i]) for i in (0, 1))
    east, north = (max(one[i], other[i]) for i in (2, 3))
    return west, south, east, north


def _box(left: float, bottom: float, width: float, height: float) -> np.ndarray:
    right, top = left + width, bottom + height
    return np.array([(left, bottom), (right, bottom), (right, top), (left, top)])


def _round_length(length_m: float) -> float:
    """Return the largest of 1, 2, 5, 10, 20, ... that is no longer."""
    power = 10.0 ** math.floor(math.log10(length_m))
    return power * max(step for step in (1, 2, 5) if step * power <= length_m)
