"""Lines of points in fewer points."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from trace_dag.geometry import FloatArray


def worth_keeping(lines: Sequence[FloatArray], by_m: float) -> list[int]:
    """Which points to keep of lines that are simplified together, so that no point of any is farther than ``by_m``
    from what is kept of it (Douglas and Peucker, The Cartographer 10(2), 1973).

    ``lines`` have one length n, each shape (n, 2) or (n, 3), metres. Indices in order, both ends among them.
    """
    last_of_all = len(lines[0]) - 1
    keep = {0, last_of_all}
    waiting = [(0, last_of_all)]
    while waiting:
        first, last = waiting.pop()
        if last - first < 2:
            continue
        away = np.max([_off_chord_m(line[first : last + 1]) for line in lines], axis=0)
        farthest = int(away.argmax())
        if away[farthest] > by_m:
            middle = first + 1 + farthest
            keep.add(middle)
            waiting += [(first, middle), (middle, last)]
    return sorted(keep)


def _off_chord_m(line: FloatArray) -> FloatArray:
    """How far the inner points are from the straight line through the ends, shape (n - 2,)."""
    along, offsets = line[-1] - line[0], line[1:-1] - line[0]
    length_m = float(np.linalg.norm(along))
    if length_m:
        unit = along / length_m
        offsets = offsets - np.outer(offsets @ unit, unit)
    return np.asarray(np.linalg.norm(offsets, axis=1))
