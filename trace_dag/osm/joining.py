"""Joining of several map files around one site, since files of neighbouring states end at their border.

Two files are neighbours if they share some nodes, at the same places, and most of their nodes are in one of them alone.
Files that cover the same ground, perhaps at different times, are not joined.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from typing import Final

import numpy as np

from trace_dag.common.geometry import FloatArray
from trace_dag.osm.types import RawWay

Ways = Mapping[int, RawWay]

_SAME_PLACE_DEG: Final = 1e-5  # about a metre
_SAME_GROUND: Final = 0.5  # share of the nodes of the smaller one that both have


def neighbours(first: Ways, others: Sequence[Ways]) -> list[int]:
    """Return the numbers of the other files that neighbour ``first``, directly or through each other.

    >>> west = {1: RawWay(1, np.array([1, 2, 3]), np.array([0.0, 0.1, 0.2]), np.zeros(3), {})}
    >>> east = {2: RawWay(2, np.array([3, 4, 5]), np.array([0.2, 0.3, 0.4]), np.zeros(3), {})}
    >>> far = {3: RawWay(3, np.array([6, 7]), np.array([5.0, 5.1]), np.zeros(2), {})}
    >>> neighbours(west, [far, east])
    [1]
    """
    near, found = [_places(first)], []
    left = {number: _places(ways) for number, ways in enumerate(others)}
    while joined := [number for number, places in left.items() if any(_meet(each, places) for each in near)]:
        near += [left.pop(number) for number in joined]
        found += joined
    return sorted(found)


def join_ways(parts: Iterable[Ways]) -> dict[int, RawWay]:
    """Return the ways of several files; of a way in several files, the most complete version."""
    ways: dict[int, RawWay] = {}
    for part in parts:
        for way_id, way in part.items():
            ways[way_id] = _completed(ways[way_id], way) if way_id in ways else way
    return ways


def _completed(way: RawWay, other: RawWay) -> RawWay:
    if not np.array_equal(way.node_ids, other.node_ids):
        return max(way, other, key=lambda each: np.isfinite(each.longitudes_deg).sum())
    x_deg, y_deg = (
        np.where(np.isnan(own), more, own)
        for own, more in ((way.longitudes_deg, other.longitudes_deg), (way.latitudes_deg, other.latitudes_deg))
    )
    return way._replace(longitudes_deg=x_deg, latitudes_deg=y_deg)


def _places(ways: Ways) -> tuple[FloatArray, FloatArray]:
    """Return the located nodes by id, ascending, and their places, (n, 2)."""
    if not ways:
        return np.empty(0, np.int64), np.empty((0, 2))
    ids = np.concatenate([way.node_ids for way in ways.values()])
    places = np.concatenate([np.column_stack([way.longitudes_deg, way.latitudes_deg]) for way in ways.values()])
    is_located = np.isfinite(places[:, 0])
    ids, first = np.unique(ids[is_located], return_index=True)
    return ids, places[is_located][first]


def _meet(a: tuple[FloatArray, FloatArray], b: tuple[FloatArray, FloatArray]) -> bool:
    shared, in_a, in_b = np.intersect1d(a[0], b[0], return_indices=True)
    if not len(shared):
        return False
    same = np.abs(a[1][in_a] - b[1][in_b]).max(axis=1) <= _SAME_PLACE_DEG
    return bool(same.mean() > 0.5 and len(shared) < _SAME_GROUND * min(len(a[0]), len(b[0])))
