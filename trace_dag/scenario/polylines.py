"""Lines and motions simplified to fewer points (Douglas and Peucker, The Cartographer 10(2), 1973)."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray

from trace_dag.common.geometry import FloatArray

_Away = Callable[[NDArray[np.intp], NDArray[np.intp], NDArray[np.intp]], FloatArray]


def worth_keeping(groups: Sequence[Sequence[FloatArray]], by_m: float) -> list[list[int]]:
    """Return the points to keep of each group of lines that are simplified together.

    No other point is farther than ``by_m`` from the simplified line.

    Lines have shape (n, 2) or (n, 3), metres; those of a group have one n, and all groups have the same number of
    lines. The result has indices in order, including both ends. All groups are processed at once, in a tenth of the
    time for hundreds of short lines.

    >>> straight, bent = (np.array([[0.0, 0.0], [5.0, aside], [10.0, 0.0]]) for aside in (0.1, 9.0))
    >>> worth_keeping([[straight], [bent]], 0.2)  # the middle of the first is 0.1 m off
    [[0, 2], [0, 1, 2]]
    """
    if not groups:
        return []
    points = np.stack([np.concatenate(lines) for lines in zip(*groups, strict=True)])
    starts = np.cumsum([0, *(len(lines[0]) for lines in groups)])
    ends = np.zeros(points.shape[1], bool)
    ends[starts[:-1]] = ends[starts[1:] - 1] = True

    def away_m(inner: NDArray[np.intp], first: NDArray[np.intp], last: NDArray[np.intp]) -> FloatArray:
        along, offsets = points[:, last] - points[:, first], points[:, inner] - points[:, first]
        length_m = np.sqrt((along * along).sum(axis=2))
        unit = along / np.where(length_m > 0.0, length_m, 1.0)[..., None]
        offsets -= (offsets * unit).sum(axis=2)[..., None] * unit
        farthest_m: FloatArray = np.sqrt((offsets * offsets).sum(axis=2).max(axis=0))
        return farthest_m

    kept = _refined(ends, away_m, by_m)
    return [np.flatnonzero(kept[start:end]).tolist() for start, end in pairwise(starts.tolist())]


def simplify_in_time(
    time_s: FloatArray, values: FloatArray, by: float, *, also: Sequence[int] | NDArray[np.intp] = ()
) -> NDArray[np.intp]:
    """Return the rows of values over time, shape (n, k), to keep in a simplified motion.

    Every other row is within ``by`` of the straight line, over time, between its kept neighbours.

    The result has indices in order, including both ends and those in ``also``.

    >>> time_s = np.array([0.0, 1.0, 2.0, 3.0])
    >>> simplify_in_time(time_s, np.array([[0.0], [1.0], [2.0], [9.0]]), 0.1).tolist()  # even until 2 s
    [0, 2, 3]
    """
    ends = np.zeros(len(time_s), bool)
    ends[[0, -1, *also]] = True

    def away(inner: NDArray[np.intp], first: NDArray[np.intp], last: NDArray[np.intp]) -> FloatArray:
        share = ((time_s[inner] - time_s[first]) / (time_s[last] - time_s[first]))[:, None]
        off: FloatArray = np.abs(values[inner] - values[first] - share * (values[last] - values[first])).max(axis=1)
        return off

    return np.flatnonzero(_refined(ends, away, by))


def _refined(kept: NDArray[np.bool_], away: _Away, by: float) -> NDArray[np.bool_]:
    """Add points until no other is off by more than ``by``.

    ``away`` returns the errors of points, each between two kept ones.
    """
    kept = kept.copy()
    ends = np.flatnonzero(kept)
    first, last = ends[:-1], ends[1:]
    while (wide := last - first > 1).any():
        first, last = first[wide], last[wide]
        counts = last - first - 1
        begins = np.cumsum(counts) - counts
        stretch = np.repeat(np.arange(len(first)), counts)
        inner = np.arange(len(stretch)) + (first + 1 - begins)[stretch]
        off = away(inner, first[stretch], last[stretch])
        most = np.maximum.reduceat(off, begins)
        at = np.flatnonzero((off == most[stretch]) & (off > by))
        split, earliest = np.unique(stretch[at], return_index=True)
        farthest = inner[at[earliest]]
        kept[farthest] = True
        first, last = np.concatenate([first[split], farthest]), np.concatenate([farthest, last[split]])
    return kept
