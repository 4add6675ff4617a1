"""Places a report is set down at: points on the roads around a crash, on its own street or on another."""

from __future__ import annotations

import math
from collections.abc import Iterable, Iterator
from itertools import pairwise
from typing import Final

import numpy as np

from lab.changed_reports.scene import Point
from trace_dag.common.geometry import LocalFrame
from trace_dag.osm.road_classes import PUBLIC_HIGHWAYS
from trace_dag.osm.types import OsmExtract, OsmWay
from trace_dag.roads.crash_site.street_names import SAME_STREET, similarity

LEAST_M: Final = 300.0
"""Least distance of a random point from the crash."""
_NAMES: Final = ("name", "ref", "alt_name", "old_name", "official_name", "loc_name")


def random_point(
    around: OsmExtract,
    frame: LocalFrame,
    names: Iterable[str],
    rng: np.random.Generator,
    *,
    on_same_street: bool,
    most_m: float,
) -> Point | None:
    """Return a point on a public road of an extract, equally likely anywhere along the roads; None if there is none.

    ``frame`` is that of the crash, from which the point is :data:`LEAST_M` or more, and ``most_m`` at most in either
    direction of the frame; ``names`` those of the crash's street and the streets that cross it there. The crash's
    street is any street with one of them; streets without a name that could be compared are drawn for neither.

    >>> names, rng = ("Main Street", "Elder Street"), np.random.default_rng(0)
    >>> point = random_point(extract, network.frame, names, rng, on_same_street=False, most_m=500.0)
    >>> point.distance_m >= LEAST_M, any(is_same_street(names, [name]) for name in point.names)
    (True, False)
    """
    names = tuple(names)
    pieces: list[tuple[OsmWay, np.ndarray]] = []
    for way in around.ways:
        same = is_same_street(names, _names_of(way))
        if way.tags.get("highway") in PUBLIC_HIGHWAYS and same is on_same_street:
            pieces += [(way, piece) for piece in _pieces(around, way, frame) if _in_reach(piece, most_m)]
    if not pieces:
        return None
    lengths = np.array([math.dist(piece[0], piece[1]) for _, piece in pieces])
    way, piece = pieces[int(rng.choice(len(pieces), p=lengths / lengths.sum()))]
    x_m, y_m = (piece[0] + rng.uniform() * (piece[1] - piece[0])).tolist()
    latitude_deg, longitude_deg = frame.to_geographic(np.array([x_m, y_m])).tolist()
    return Point(latitude_deg, longitude_deg, math.hypot(x_m, y_m), _names_of(way), on_same_street)


def is_same_street(names: Iterable[str], others: Iterable[str]) -> bool | None:
    """Return whether any name of the one is a name of the other; None if no two of them can be compared."""
    others = tuple(others)
    found = [value for name in names if (value := similarity(name, others)) is not None]
    return max(found) >= SAME_STREET if found else None


def _names_of(way: OsmWay) -> tuple[str, ...]:
    """Return every name and number a way bears."""
    return tuple(way.tags[key] for key in _NAMES if way.tags.get(key))


_STEP_M: Final = 10.0


def _pieces(around: OsmExtract, way: OsmWay, frame: LocalFrame) -> Iterator[np.ndarray]:
    """Yield a way in pieces of at most ten metres, each of shape (2, 2), metres in the frame."""
    nodes = [around.nodes[node] for node in way.node_ids]
    line = frame.to_local(np.array([n.latitude_deg for n in nodes]), np.array([n.longitude_deg for n in nodes]))
    for start, end in pairwise(line):
        count = max(1, math.ceil(math.dist(start, end) / _STEP_M))
        yield from (np.array(each) for each in pairwise(np.linspace(start, end, count + 1)))


def _in_reach(piece: np.ndarray, most_m: float) -> bool:
    """Return whether both ends are as far away as they have to be; a straight piece between them comes nearer by less
    than its length allows for.
    """
    far = np.hypot(piece[:, 0], piece[:, 1])
    return bool(far.min() >= LEAST_M + _STEP_M / 2 and np.abs(piece).max() <= most_m and np.ptp(piece, axis=0).any())
