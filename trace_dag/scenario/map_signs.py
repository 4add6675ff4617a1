"""Signals and signs of a drawn map, as symbols of one size at any scale."""

from __future__ import annotations

import math
from collections import defaultdict
from collections.abc import Iterator
from typing import Final, NamedTuple

import numpy as np

from trace_dag.roads.map.model import Signal
from trace_dag.scenario.canvas import Canvas, Ink, length_pt
from trace_dag.scenario.map_marks import WHITE
from trace_dag.scenario.map_scene import MapScene, inside
from trace_dag.units import mps_to_mph

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

    def draw(self, canvas: Canvas, z: float) -> None:
        """Draw what the window shows."""
        half_pt = _NEAR_HALF_PT if canvas.span_m < _NEAR_M else _FAR_HALF_PT
        for (kind, text), places in self._kinds.items():
            for x, y in places[inside(places, canvas.window)].tolist():
                if kind == LIMIT:
                    _draw_limit(canvas, x, y, text, z)
                elif kind == LIGHT:
                    canvas.symbol("square", x, y, half_pt, Ink(_BLACK), z)
                    # The lamps of a signal head, above each other inside its symbol.
                    for up, colour in zip((1, 0, -1), _LAMPS, strict=True):
                        lamp_m = 0.27 * half_pt / canvas.points_per_m
                        canvas.discs([(x, y + 0.6 * up * half_pt / canvas.points_per_m)], lamp_m, Ink(colour), z + 0.1)
                else:
                    shape, face, edge = ("octagon", _RED, WHITE) if kind == STOP else ("triangle down", WHITE, _RED)
                    canvas.symbol(shape, x, y, half_pt, Ink(face, edge, 0.9), z)


def _draw_limit(canvas: Canvas, x_m: float, y_m: float, text: str, z: float) -> None:
    """The board of a speed limit with its number."""
    half_m = np.array([length_pt(text, _LIMIT_SIZE_PT) / 2 + 1.4, 0.75 * _LIMIT_SIZE_PT]) / canvas.points_per_m
    board = np.array([x_m, y_m]) + np.array([(-1, -1), (1, -1), (1, 1), (-1, 1)]) * half_m
    canvas.polygons([board], Ink("white", _BLACK, 0.7), z)
    canvas.text(text, x_m, y_m, _LIMIT_SIZE_PT, _BLACK, z + 0.1)


class PlacedSign(NamedTuple):
    """A signal or sign: its place (m), the direction of the traffic it applies to (rad), and its text."""

    signal: Signal
    xy_m: tuple[float, float]
    heading_rad: float
    text: str


def placed_signs(scene: MapScene) -> Iterator[PlacedSign]:
    """The traffic lights, and the signs of the kinds that are drawn."""
    for road in {section.road.id: section.road for section in scene.sections}.values():
        line = scene.network.road_geometry(road.id).line
        for signal in road.signals:
            if signal.type in (LIGHT, STOP, YIELD, LIMIT):
                x, y, heading, _ = line.at(signal.s_m)
                place = (x - signal.t_m * math.sin(heading), y + signal.t_m * math.cos(heading))
                text = _limit_text(signal) if signal.type == LIMIT else ""
                yield PlacedSign(signal, place, heading + (math.pi if signal.orientation == "-" else 0.0), text)


def _limit_text(signal: Signal) -> str:
    if signal.value is None:
        return "?"
    return f"{mps_to_mph(signal.value):.0f}" if signal.unit == "m/s" else f"{signal.value:.0f}"
