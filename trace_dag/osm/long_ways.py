"""The long ways of a large map file, found once and noted for all later passes over it.

A way without a node near a site can still pass it, on a stretch without nodes (there are motorways with ten kilometres
of them), or lie around it. Such a way is long. Asking every road of a country for its length takes Python longer than
libosmium takes to read the file, so it is done once, when the file is first read (:mod:`trace_dag.osm.first_look`).
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any, Final

import numpy as np
import numpy.typing as npt
import shapely

from trace_dag.osm.near_nodes import LONG_M
from trace_dag.osm.types import BoundingBox

# A node that a way has, and what the way covers, WGS84 degrees.
COLUMNS: Final = np.dtype(
    [("node", "<i8"), ("west_deg", "<f8"), ("south_deg", "<f8"), ("east_deg", "<f8"), ("north_deg", "<f8")]
)
_ANYWHERE_DEG: Final = (-180.0, -90.0, 180.0, 90.0)

LongWays = npt.NDArray[np.void]
"""(n,) rows of a node and what its way covers."""


class LongWayFinder:
    """Looks at each way, for :func:`osmium.apply`, and drops it; keeps those that are long or not wholly located."""

    def __init__(self) -> None:
        from osmium import InvalidLocationError
        from osmium.geom import WKBFactory, haversine_distance

        self._length_m, self._not_located, self._wkb = haversine_distance, InvalidLocationError, WKBFactory()
        self.seen = False  # a way
        self.negative = False  # a node that is not located has an id below 0
        self._forget()

    def _forget(self) -> None:
        self._nodes: list[int] = []
        self._shapes: list[str] = []
        self._not_located_nodes: list[int] = []

    def way(self, way: Any) -> bool:
        """True, by which it is dropped."""
        self.seen, nodes = True, way.nodes
        try:
            if self._length_m(nodes) >= LONG_M:
                self._shapes.append(self._wkb.create_linestring(way))
                self._nodes.append(nodes[0].ref)
        except self._not_located:
            refs = [node.ref for node in nodes]
            self.negative |= min(refs) < 0
            self._not_located_nodes.append(refs[0])
        return True

    def take(self) -> LongWays:
        """Those seen since the last time."""
        rows = np.empty(len(self._nodes) + len(self._not_located_nodes), COLUMNS)
        rows["node"] = [*self._nodes, *self._not_located_nodes]
        bounds = np.full((len(rows), 4), _ANYWHERE_DEG)
        if self._shapes:
            bounds[: len(self._shapes)] = shapely.bounds(shapely.from_wkb(self._shapes))
        rows["west_deg"], rows["south_deg"], rows["east_deg"], rows["north_deg"] = bounds.T
        self._forget()
        return rows


def nodes_of_overlapping(ways: LongWays, boxes: Sequence[BoundingBox]) -> npt.NDArray[np.uint64]:
    """A node of each of the ways whose bounds overlap a box, (n,).

    >>> ways = np.array([(7, -111.6, 40.0, -111.4, 40.0), (8, -111.3, 40.0, -111.1, 40.0)], COLUMNS)
    >>> nodes_of_overlapping(ways, [BoundingBox(39.99, -111.51, 40.01, -111.49)]).tolist()
    [7]
    """
    areas = shapely.STRtree([shapely.box(box.west_deg, box.south_deg, box.east_deg, box.north_deg) for box in boxes])
    of_ways = shapely.box(ways["west_deg"], ways["south_deg"], ways["east_deg"], ways["north_deg"])
    return np.unique(ways["node"][areas.query(of_ways)[0]]).astype(np.uint64)
