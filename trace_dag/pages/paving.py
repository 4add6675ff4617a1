"""The asphalt of a junction between its lanes.

A junction has paved places that belong to no lane of the map. Belongs here: finding them. Does not belong here: drawing
them (:mod:`trace_dag.pages.maps`).
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Sequence
from typing import Final, NamedTuple

import numpy as np
import shapely

from trace_dag.common.geometry import FloatArray

LANE_WIDTH_M: Final = 3.66  # AASHTO Green Book, 7th edition, section 4.3: 12 ft
_LEAST_AREA_M2: Final = 0.01
_TOUCHING_M: Final = 0.1


class PavedGap(NamedTuple):
    """A ring, shape (n, 2), m, and the numbers of the lanes that border it."""

    outline_m: FloatArray
    lanes: tuple[int, ...]


def find_paved_gaps(lanes: Sequence[FloatArray], junctions: Iterable[Sequence[int]]) -> Iterator[PavedGap]:
    """Yield the paved places beside the lanes of some junctions.

    ``lanes`` are outlines of lanes on one level, shape (n, 2), m: lanes through junctions, whose numbers are in
    ``junctions``, and lanes of the roads that end there. Inside a junction, which is the convex hull of its lanes, a
    gap is paved where it is narrower than a lane: islands are wider. A separation of carriageways outside is not a gap.

    >>> lane = np.array([[0.0, 0.0], [10.0, 0.0], [10.0, 3.5], [0.0, 3.5]])
    >>> list(find_paved_gaps([lane], [[0]]))  # a single lane leaves nothing between
    []
    """
    outlines = np.array([shapely.make_valid(shapely.Polygon(lane)) for lane in lanes], object)
    tree = shapely.STRtree(outlines)
    for numbers in junctions:
        hull = shapely.convex_hull(shapely.geometrycollections(outlines[list(numbers)]))
        around = shapely.buffer(hull, LANE_WIDTH_M)
        paved = shapely.union_all(shapely.intersection(outlines[tree.query(around, "intersects")], around))
        widened = shapely.buffer(paved, LANE_WIDTH_M / 2)
        closed = shapely.buffer(widened, -LANE_WIDTH_M / 2)
        for gap in shapely.get_parts(shapely.difference(shapely.intersection(closed, hull), paved)):
            if isinstance(gap, shapely.Polygon) and gap.area > _LEAST_AREA_M2:
                bordering = tree.query(gap, "dwithin", distance=_TOUCHING_M)
                yield PavedGap(shapely.get_coordinates(gap.exterior), tuple(bordering.tolist()))
