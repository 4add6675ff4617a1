"""Crosswalks on a drawn map: bars along the traffic where lines are painted, a dashed outline where none are."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING, Final

import numpy as np

from trace_dag.roads.map.people import crosswalks
from trace_dag.scenario.canvas import Canvas, Ink
from trace_dag.scenario.map_marks import WHITE
from trace_dag.scenario.map_scene import MapScene, Shapes

if TYPE_CHECKING:
    from trace_dag.geometry import FloatArray
    from trace_dag.roads.map.people import CrosswalkPlace

_BAR_M: Final = 0.6  # MUTCD 2009, 3B.18: bars of 12 to 24 in, gaps of 12 to 60 in
_OUTLINE_PT: Final = 0.9


class Crosswalks:
    """The crosswalks of the roads in sight: painted bars, and the outlines of those without paint."""

    def __init__(self, scene: MapScene) -> None:
        seen = {section.road.id for section in scene.sections}
        places = [place for place in crosswalks(scene.network) if place.road_id in seen]
        bars = [bar for place in places if place.crosswalk.marked for bar in _bars(place)]
        self.bars = Shapes(bars)
        self.outlines = Shapes([place.corners_m for place in places if not place.crosswalk.marked])

    def draw(self, canvas: Canvas, z: float) -> None:
        """Draw what the window shows."""
        canvas.polygons(self.bars.seen(canvas.window), Ink(WHITE), z)
        canvas.polygons(
            self.outlines.seen(canvas.window), Ink(stroke=WHITE, width_pt=_OUTLINE_PT, dash_pt=(2.7, 1.8)), z
        )


def _bars(place: CrosswalkPlace) -> list[FloatArray]:
    """Bars from end to end of a crosswalk of four corners; an outline of another shape is filled as it is."""
    corners = place.corners_m
    if len(corners) != 4:
        return [corners]
    right, left = corners[[0, 1]], corners[[3, 2]]  # as our maps have them: each end from its rear to its front
    across_m = float(np.hypot(*(left - right).mean(axis=0)))
    count = max(1, math.floor(across_m / (2 * _BAR_M)))
    shares = (np.arange(count)[:, None] + np.array([0.25, 0.75])) / count
    bars = []
    for begin, end in shares.tolist():
        one, two = right + begin * (left - right), right + end * (left - right)
        bars.append(np.array([one[0], one[1], two[1], two[0]]))
    return bars
