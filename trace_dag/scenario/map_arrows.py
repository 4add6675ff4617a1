"""The arrows of a drawn map: faint ones in the direction of travel, and the painted turn arrows."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING, Final

import numpy as np

from trace_dag.roads.map.model import LaneType
from trace_dag.scenario.canvas import Canvas, Ink
from trace_dag.scenario.map_marks import WHITE
from trace_dag.scenario.map_scene import SeenSection, Shapes

if TYPE_CHECKING:
    from trace_dag.geometry import FloatArray

_FAINT_WHITE: Final = "#92969A"  # a quarter white on asphalt
_EVERY_M: Final = 35.0
_LEAST_LANE_M: Final = 12.0
_BEFORE_END_M: Final = 6.0
_ARROW: Final = np.array(
    [(-1.6, -0.13), (0.3, -0.13), (0.3, -0.45), (1.6, 0.0), (0.3, 0.45), (0.3, 0.13), (-1.6, 0.13)]
)
# Shafts of the turn arrows in lane axes (ahead, left), metres; the head points along the last piece.
_TURN_SHAFTS: Final = {
    "through": ((-1.5, 0.0), (1.5, 0.0)),
    "left": ((-1.5, 0.0), (0.6, 0.0), (0.9, 0.9)),
    "right": ((-1.5, 0.0), (0.6, 0.0), (0.9, -0.9)),
    "slight_left": ((-1.5, 0.0), (0.3, 0.0), (1.2, 0.6)),
    "slight_right": ((-1.5, 0.0), (0.3, 0.0), (1.2, -0.6)),
    "sharp_left": ((-1.5, 0.0), (0.9, 0.0), (0.3, 0.9)),
    "sharp_right": ((-1.5, 0.0), (0.9, 0.0), (0.3, -0.9)),
    "merge_to_left": ((-1.5, 0.0), (0.3, 0.0), (1.2, 0.6)),
    "merge_to_right": ((-1.5, 0.0), (0.3, 0.0), (1.2, -0.6)),
    "reverse": ((-1.2, 0.0), (0.9, 0.0), (0.9, 0.8), (-0.6, 0.8)),
}


class Arrows:
    """The arrows on the lanes of one level, without those in junctions; ``turns`` are the strokes of painted arrows."""

    def __init__(self, sections: Sequence[SeenSection]) -> None:
        travel: list[FloatArray] = []
        turns: list[FloatArray] = []
        for lane in (lane for section in sections if section.road.junction_id is None for lane in section.lanes):
            geometry = lane.geometry
            if not geometry.lane.type.drivable or geometry.length_m <= _LEAST_LANE_M:
                continue
            if geometry.lane.type is not LaneType.BIDIRECTIONAL:
                count = max(1, round(geometry.length_m / _EVERY_M))
                for share in (np.arange(count) + 0.5) / count:
                    travel.append(geometry.pose(geometry.begin_m + float(share) * geometry.length_m).to_world(_ARROW))
            if geometry.lane.turns:
                ends = (geometry.begin_m + _BEFORE_END_M, geometry.end_m - _BEFORE_END_M)
                pose = geometry.pose(ends[geometry.direction > 0])
                for turn in geometry.lane.turns:
                    turns += [pose.to_world(stroke) for stroke in _strokes(turn)]
        self._travel, self.turns = Shapes(travel), Shapes(turns)

    def draw(self, canvas: Canvas, z: float) -> None:
        """Draw the arrows in the window."""
        canvas.polygons(self._travel.seen(canvas.window), Ink(_FAINT_WHITE), z)
        canvas.lines(self.turns.seen(canvas.window), Ink(stroke=WHITE, width_pt=1.0), z + 0.05)


def _strokes(turn: str) -> list[FloatArray]:
    """Shaft and head of a turn arrow, in lane axes; nothing if the turn has no arrow."""
    if turn not in _TURN_SHAFTS:
        return []
    shaft = np.array(_TURN_SHAFTS[turn])
    ahead = shaft[-1] - shaft[-2]
    ahead /= np.hypot(*ahead)
    aside = np.array([-ahead[1], ahead[0]])
    back = shaft[-1] - 0.55 * ahead
    return [shaft, np.array([back + 0.4 * aside, shaft[-1], back - 0.4 * aside])]
