"""The names of streets on a drawn map, each once, along the street and clear of the middle and of each other."""

from __future__ import annotations

import math
from collections import defaultdict
from typing import TYPE_CHECKING, Final, NamedTuple

import numpy as np
import shapely

from trace_dag.roads.map.lane_geometry import LANE_STEP_M
from trace_dag.scenario.canvas import Canvas, Ink, length_pt
from trace_dag.scenario.map_scene import MapScene, Window, inside

if TYPE_CHECKING:
    from trace_dag.geometry import FloatArray

_SIZE_PT: Final = 6.5
_INK: Final = "#1D2024"
_LEAST_SHARE: Final = 0.12  # share of the window's width: a shorter stretch of street is not named


class _Label(NamedTuple):
    text: str
    x_m: float
    y_m: float
    angle_rad: float  # within a quarter turn, so that it is read from below


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
        taken: list[shapely.LineString] = []
        for label in self._labels(canvas.window):
            half_m = length_pt(label.text, _SIZE_PT) / canvas.points_per_m / 2
            along = half_m * np.array([math.cos(label.angle_rad), math.sin(label.angle_rad)])
            place = np.array([label.x_m, label.y_m])
            room = shapely.LineString([place - along, place + along])
            if any(shapely.dwithin(room, other, 1.6 * height_m) for other in taken):
                continue
            taken.append(room)
            ground = Ink(stroke=backing, width_pt=1.5 * _SIZE_PT, opacity=0.75, round_caps=True)
            canvas.lines([shapely.get_coordinates(room)], ground, z)
            canvas.text(label.text, label.x_m, label.y_m, _SIZE_PT, _INK, z + 0.1, angle_rad=label.angle_rad)

    def _labels(self, window: Window) -> list[_Label]:
        """Each name on its longest stretch in the window, the longest first."""
        span_m = max(window[2] - window[0], window[3] - window[1])
        longest: dict[str, FloatArray] = {}
        for name, line in self._lines:
            shown = line[inside(line, window)]
            if len(shown) > max(len(longest.get(name, ())), _LEAST_SHARE * span_m / LANE_STEP_M):
                longest[name] = shown
        centre = np.array([window[0] + window[2], window[1] + window[3]]) / 2
        labels = []
        for name, line in sorted(longest.items(), key=lambda each: -len(each[1])):
            # The crash is in the middle: the name stands on the longer side of it.
            nearest = int(np.hypot(*(line[:, :2] - centre).T).argmin())
            side = line[: nearest + 1] if nearest > len(line) / 2 else line[nearest:]
            x, y, heading, _ = side[len(side) // 2].tolist()
            labels.append(_Label(name, x, y, math.remainder(heading, math.pi)))
        return labels
