"""The vertices of a trajectory, chosen so that players that leave some of them out show the same crash.

Players merge vertices that lie close together: esmini, with default options, drops vertices within 0.1 m of the last
one kept (``--traj_filter``, its ``PolyLineShape::FinalizeVertices``). After an impact bodies are slow, and the moment
of their overlap would be dropped. So vertices are placed such that the filter keeps the important moments. Before each
of them is a vertex a little more than the filter's radius away, which the filter also keeps; all vertices between the
two lie within that radius. A vertex added for this lies on the motion and changes nothing for a player that keeps all
vertices. Logged steps less than the radius before it are removed: vehicles still drive there, and a straight line to
the next vertex is off by millimetres only.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from trace_dag.common.geometry import FloatArray

FILTER_RADIUS_M = 0.1
_ROUNDED_M = 3e-5  # positions are written to a hundredth of a millimetre
_BEYOND_M = FILTER_RADIUS_M + _ROUNDED_M
_SAME_TIME_S = 1e-5
_WITHIN_M = FILTER_RADIUS_M - _ROUNDED_M


def select_vertices(rows: FloatArray, moments_s: Sequence[tuple[float, ...]]) -> FloatArray:
    """Return the vertices, rows of time, x, y and more, with moments that survive a filter, the earliest first.

    In each group of moments the first possible one is taken. A moment is impossible if the vehicle returns to an
    earlier position within the filter's radius, or has not moved that far since the start or the earlier moment.

    >>> rows = np.column_stack([np.arange(3.0), 10.0 * np.arange(3.0), np.zeros(3)])  # 10 m a second
    >>> select_vertices(rows, [(1.0,)])[:, 0].round(3).tolist()  # one more just outside a radius of 0.1 m
    [0.0, 1.0, 1.01, 2.0]
    """
    kept_s: list[float] = []
    for group in sorted(moments_s):
        for moment_s in group:
            k = int(np.argmin(np.abs(rows[:, 0] - moment_s)))
            changed = _with_kept(rows, k, max(kept_s, default=-1.0))
            if changed is not None:
                rows = changed
                kept_s.append(moment_s)
                break
    distinct: FloatArray = rows[np.diff(rows[:, 0], prepend=-1.0) > _SAME_TIME_S]
    return distinct


def _with_kept(rows: FloatArray, kept: int, after_s: float) -> FloatArray | None:
    """Return the vertices with one of them kept by filters; none up to ``after_s`` is removed for it."""
    away = np.flatnonzero(_distances(rows[:kept], rows[kept]) >= _BEYOND_M)
    if not len(away):
        return None
    last = int(away[-1])
    before, between, after = rows[: last + 1], rows[last + 1 : kept], rows[kept:]
    if (_distances(between, before[-1]) > _WITHIN_M).any():
        added = _at_distance(rows[last], rows[last + 1], rows[kept])
        if (_distances(between, added) > _WITHIN_M).any():
            return None
        before = np.concatenate([before, added[None]])
    near = len(before) - 1
    while near > 1 and before[near - 1, 0] > after_s and _distances(before[near - 1][None], before[-1])[0] < _BEYOND_M:
        near -= 1
    return np.concatenate([before[:near], before[-1:], between, _left_soon(after)])


def _left_soon(rows: FloatArray) -> FloatArray:
    """Insert a vertex where the path leaves the filter's radius, which keeps that stretch short."""
    away = np.flatnonzero(_distances(rows, rows[0]) >= _BEYOND_M)
    if not len(away):
        return rows
    out = int(away[0])
    return np.insert(rows, out, _at_distance(rows[out], rows[out - 1], rows[0]), axis=0)


def _distances(rows: FloatArray, place: FloatArray) -> FloatArray:
    away: FloatArray = np.hypot(rows[:, 1] - place[1], rows[:, 2] - place[2])
    return away


def _at_distance(start: FloatArray, end: FloatArray, place: FloatArray) -> FloatArray:
    """Return the last point beyond a filter's radius from ``place`` on the way from ``start``, which is, to ``end``."""
    low, high = 0.0, 1.0
    for _ in range(40):
        middle = (low + high) / 2
        if _distances((start + middle * (end - start))[None], place)[0] >= _BEYOND_M:
            low = middle
        else:
            high = middle
    point: FloatArray = start + low * (end - start)
    return point
