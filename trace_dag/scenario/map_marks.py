"""The painted lines of a drawn map: borders of lanes, broken or solid, single or double."""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Iterator, Sequence
from typing import TYPE_CHECKING, Final

import numpy as np

from trace_dag.roads.map.model import RoadMark
from trace_dag.scenario.canvas import Canvas, Ink
from trace_dag.scenario.map_scene import SeenSection, Shapes, Window

if TYPE_CHECKING:
    from trace_dag.geometry import FloatArray

WHITE: Final = "#F7F7F2"
_YELLOW: Final = "#F2C230"
_COLOURS: Final = {"yellow": _YELLOW, "white": WHITE, "standard": WHITE}
_DASH_M: Final = 3.05  # MUTCD 2009, section 3A.06: segments of 10 ft, gaps of 30 ft
_PERIOD_M: Final = 12.19
STROKE_M: Final = 0.15
"""Width of a painted line."""
_APART_M: Final = 0.13  # distance of a double line's parts from its middle, if they can be told apart
_NOT_PAINTED: Final = frozenset({"none", "grass", "curb"})


class Marks:
    """The marks of one level. ``legal`` takes the marks as the law has them, else those written in the map."""

    def __init__(self, sections: Sequence[SeenSection], *, legal: bool) -> None:
        found = list(_marks(sections, legal))
        self._lines = Shapes([line for line, _ in found])
        self._kinds = [mark for _, mark in found]

    def draw(self, canvas: Canvas, z: float) -> None:
        """Draw the marks in the window; also at a small scale double lines are told apart and thin lines are
        visible."""
        apart_m = max(_APART_M, 0.8 / canvas.points_per_m)
        width_pt = min(max(STROKE_M * canvas.points_per_m, 0.45), 3.0)
        for colour, lines in self.strokes(canvas.window, apart_m).items():
            canvas.lines(lines, Ink(stroke=colour, width_pt=width_pt), z)

    def strokes(self, window: Window, apart_m: float = _APART_M) -> dict[str, list[FloatArray]]:
        """The painted lines in a window, by colour: lines, shape (n, 2), m; the parts of double ones lie ``apart_m``
        from the middle."""
        found: dict[str, list[FloatArray]] = defaultdict(list)
        for number in self._lines.within(window):
            line, mark = self._lines.points_m[number], self._kinds[number]
            kinds = mark.type.split()
            offsets = (0.0,) if len(kinds) == 1 else (apart_m, -apart_m)
            for kind, offset in zip(kinds, offsets, strict=False):
                if kind in _NOT_PAINTED:
                    continue
                shifted = _shifted(line, offset) if offset else line
                found[_COLOURS.get(mark.colour, mark.colour)] += _dashes(shifted) if kind == "broken" else [shifted]
        return found


def _marks(sections: Sequence[SeenSection], legal: bool) -> Iterator[tuple[FloatArray, RoadMark]]:
    """The lines of marks, shape (n, 2), and their types; junctions have no painted marks."""
    for section in sections:
        if section.road.junction_id is not None:
            continue
        lines = {lane.geometry.lane.id: lane.outer_m[:, :2] for lane in section.lanes} | {0: section.centre_m}
        for lane in section.road.lane_sections[section.index].lanes:
            mark = (lane.legal_mark or lane.mark) if legal else lane.mark
            if mark is not None and mark.type != "none":
                yield lines[lane.id], mark


def _shifted(line: FloatArray, offset_m: float) -> FloatArray:
    step = np.gradient(line, axis=0)
    normal = np.column_stack([-step[:, 1], step[:, 0]]) / np.maximum(np.hypot(step[:, 0], step[:, 1]), 1e-9)[:, None]
    return np.asarray(line + offset_m * normal)


def _dashes(line: FloatArray) -> list[FloatArray]:
    along = np.concatenate([[0.0], np.cumsum(np.hypot(*np.diff(line, axis=0).T))])
    starts = np.arange((_PERIOD_M - _DASH_M) / 2, max(along[-1] - _DASH_M, 0.0), _PERIOD_M)
    at = starts[:, None] + np.array([0.0, _DASH_M / 2, _DASH_M])
    return list(np.stack([np.interp(at, along, line[:, 0]), np.interp(at, along, line[:, 1])], axis=-1))
