"""Signals and signs of a drawn map, as symbols of one size at any scale, and the names of its streets."""

from __future__ import annotations

import math
from collections import defaultdict
from collections.abc import Iterator
from typing import TYPE_CHECKING, Final, NamedTuple

import numpy as np
import shapely

from trace_dag.common.units import mps_to_mph
from trace_dag.pages.canvas import Canvas, Ink, length_pt
from trace_dag.pages.map_ground import WHITE
from trace_dag.pages.map_scene import MapScene, Window, inside
from trace_dag.roads.map.lane_geometry import LANE_STEP_M
from trace_dag.roads.map.model import Signal

if TYPE_CHECKING:
    from trace_dag.common.geometry import FloatArray

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
        for each in place_signs(scene):
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
    """Draw the board of a speed limit with its number."""
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


def place_signs(scene: MapScene) -> Iterator[PlacedSign]:
    """Yield the traffic lights, and the signs of the kinds that are drawn."""
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


# --- names of streets -------------------------------------------------------------------------------------------
_SIZE_PT: Final = 6.5
_INK: Final = "#1D2024"
_LEAST_SHARE: Final = 0.12  # share of the window's width: a shorter stretch of street is not named
_PLACES: Final = (0.5, 0.35, 0.65, 0.2, 0.8)  # along a stretch of street, the first one with room for the name


class Names:
    """The named streets of a scene and where they run."""

    def __init__(self, scene: MapScene) -> None:
        roads: dict[str, list[FloatArray]] = defaultdict(list)
        names: dict[str, str] = {}
        for section in scene.sections:
            if section.road.name and section.road.junction_id is None:
                roads[section.road.id].append(section.line_m)
                names[section.road.id] = section.road.name
        self._lines = [(names[road], np.concatenate(lines)) for road, lines in roads.items()]

    def draw(self, canvas: Canvas, z: float, backing: str) -> None:
        """Name the streets that the window shows, on a ground that keeps the letters readable."""
        height_m = _SIZE_PT / canvas.points_per_m
        taken, whole = [*canvas.taken], shapely.box(*canvas.window).buffer(-height_m)
        ground = Ink(stroke=backing, width_pt=1.5 * _SIZE_PT, opacity=0.75, round_caps=True)
        for name, places in self._places(canvas.window):
            half_m = length_pt(name, _SIZE_PT) / canvas.points_per_m / 2
            for x, y, heading, _ in places.tolist():
                angle = math.remainder(heading, math.pi)  # within a quarter turn, so that it is read from below
                east_m, north_m = half_m * math.cos(angle), half_m * math.sin(angle)
                room = shapely.LineString([(x - east_m, y - north_m), (x + east_m, y + north_m)])
                if whole.contains(room) and not any(shapely.dwithin(room, each, 1.6 * height_m) for each in taken):
                    taken.append(room)
                    canvas.lines([shapely.get_coordinates(room)], ground, z)
                    canvas.text(name, x, y, _SIZE_PT, _INK, z + 0.1, angle_rad=angle)
                    break

    def _places(self, window: Window) -> list[tuple[str, FloatArray]]:
        """Return each name with places on its longest stretch in the window, shape (n, 4), longest first."""
        span_m = max(window[2] - window[0], window[3] - window[1])
        longest: dict[str, FloatArray] = {}
        for name, line in self._lines:
            shown = line[inside(line, window)]
            if len(shown) > max(len(longest.get(name, ())), _LEAST_SHARE * span_m / LANE_STEP_M):
                longest[name] = shown
        centre = np.array([window[0] + window[2], window[1] + window[3]]) / 2
        places = []
        for name, line in sorted(longest.items(), key=lambda each: -len(each[1])):
            # The crash is in the middle: the name stands on the longer side of it.
            nearest = int(np.hypot(*(line[:, :2] - centre).T).argmin())
            side = line[: nearest + 1] if nearest > len(line) / 2 else line[nearest:]
            places.append((name, side[[int(share * len(side)) for share in _PLACES]]))
        return places
