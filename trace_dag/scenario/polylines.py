"""Lines simplified to fewer points."""

from __future__ import annotations

from collections.abc import Callable, Sequence

import numpy as np

from trace_dag.geometry import FloatArray


def worth_keeping(lines: Sequence[FloatArray], by_m: float) -> list[int]:
    """Which points to keep of lines that are simplified together, so that no point of any is farther than ``by_m``
    from what is kept of it (Douglas and Peucker, The Cartographer 10(2), 1973).

    ``lines`` have one length n, each shape (n, 2) or (n, 3), metres. Indices in order, both ends among them.

    >>> worth_keeping([np.array([[0.0, 0.0], [5.0, 0.1], [10.0, 0.0]])], 0.2)  # the middle is 0.1 m off
    [0, 2]
    """
    points = np.stack(lines)
    return needed(points.shape[1], lambda first, last: _off_chords_m(points[:, first : last + 1]), by_m)


def needed(count: int, off: Callable[[int, int], FloatArray], by: float) -> list[int]:
    """Which of ``count`` points to keep so that none is off by more than ``by`` (Douglas and Peucker).

    ``off`` says how far the points between two are from what those two alone would give, shape (last - first - 1,).
    Indices in order, both ends among them.

    >>> needed(3, lambda first, last: np.array([0.3]), 0.2)  # the middle is farther off than allowed
    [0, 1, 2]
    """
    keep = {0, count - 1}
    waiting = [(0, count - 1)]
    while waiting:
        first, last = waiting.pop()
        if last - first < 2:
            continue
        away = off(first, last)
        farthest = int(away.argmax())
        if away[farthest] > by:
            middle = first + 1 + farthest
            keep.add(middle)
            waiting += [(first, middle), (middle, last)]
    return sorted(keep)


def _off_chords_m(lines: FloatArray) -> FloatArray:
    """How far the inner points of the line that is farthest are from the straight line through its ends.

    ``lines`` are (lines, n, dimensions), the result (n - 2,).
    """
    along, offsets = lines[:, -1] - lines[:, 0], lines[:, 1:-1] - lines[:, :1]
    length_m = np.sqrt((along * along).sum(axis=1))
    unit = along / np.where(length_m > 0.0, length_m, 1.0)[:, None]
    offsets = offsets - (offsets @ unit[:, :, None]) * unit[:, None]
    farthest_m: FloatArray = np.sqrt((offsets * offsets).sum(axis=2).max(axis=0))
    return farthest_m
