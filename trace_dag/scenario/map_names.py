"""The names of streets on a drawn map, each once and whole, along the street, clear of the middle and of each other."""

from __future__ import annotations

import math
from collections import defaultdict
from typing import TYPE_CHECKING, Final

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
        """Each name with places on its longest stretch in the window, shape (n, 4), the longest stretch first."""
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
