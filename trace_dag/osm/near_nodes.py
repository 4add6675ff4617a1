"""Which nodes of a large map file lie near a site, so that only the ways with one of them need be looked at.

A way that comes into a box has a node near it, or a stretch without nodes that reaches from beyond the margin to the
box and beyond the margin again, or lies around it; then it is longer than twice the margin. So two kinds of ways hold
all that the boxes may need: those with a near node, and the long ones (:mod:`trace_dag.osm.long_ways`).
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Iterator, Sequence
from pathlib import Path
from typing import Any, Final

import numpy as np
import numpy.typing as npt

from trace_dag.osm.types import BoundingBox

LONG_M: Final = 1000.0  # of a way, from its first node to its last
_MARGIN_DEG: Final = 0.0046  # of latitude: 511 m, a little more than half of LONG_M, and more than buildings ask for
_CELLS_PER_DEG: Final = 100
_UNITS_PER_DEG: Final = 10**7  # OSM stores coordinates as multiples of 1e-7 degrees
_UNITS_PER_CELL: Final = _UNITS_PER_DEG // _CELLS_PER_DEG
_AT_ONCE: Final = 2**20  # nodes
# libosmium's set of ids has 4 MB for each run of 2**25 ids one of which is in it, and 8 bytes for each run below.
_BITS_OF_PART: Final = 25
_MOST_PARTS: Final = 512  # those of OpenStreetMap are 400
_BITS_OF_PARTS: Final = 20
_MIN_COS_LATITUDE: Final = 1e-3
ROWS: Final = np.dtype([("id", "<u8"), ("x", "<i4"), ("y", "<i4")])
"""What libosmium writes into a ``sparse_file_array``: one row for each node, in units of 1e-7 degrees."""
Ids = npt.NDArray[np.uint64]
_NOWHERE: Final = 2**31 - 1  # the coordinate of rows that hold no node


def near_node_ids(locations: Path, boxes: Sequence[BoundingBox]) -> Iterator[Ids]:
    """The ids of the nodes within half of :data:`LONG_M` of a box, and of others not much farther, some at a time.

    ``locations`` is libosmium's ``sparse_file_array``.

    >>> import tempfile
    >>> with tempfile.TemporaryDirectory() as folder:
    ...     (file := Path(folder) / "locations").write_bytes(
    ...         np.array([(7, -1_115_000_000, 400_000_000), (8, -1_116_000_000, 400_000_000)], ROWS).tobytes()
    ...     ) and [ids.tolist() for ids in near_node_ids(file, [BoundingBox(39.99, -111.51, 40.01, -111.49)])]
    [[7]]
    """
    if not boxes or not locations.exists() or not (count := locations.stat().st_size // ROWS.itemsize):
        return
    cells = _Cells(boxes)
    rows = np.memmap(locations, ROWS, mode="r", shape=(count,))
    for start in range(0, count, _AT_ONCE):
        part = rows[start : start + _AT_ONCE]
        yield part["id"][cells.hold(part["x"], part["y"])]


def set_of(nodes: Iterable[Ids]) -> Any:
    """libosmium's set of some nodes, given some at a time; None where it would not stay small.

    That of OpenStreetMap's nodes always does.

    >>> set_of([np.array([1, 13_000_000_000], np.uint64)]) is None, set_of([np.array([2**60], np.uint64)])
    (False, None)
    """
    from osmium import IdTracker

    tracker, parts = IdTracker(), set[int]()
    for some in nodes:
        parts.update(np.unique(some >> np.uint64(_BITS_OF_PART)).tolist())
        if len(parts) > _MOST_PARTS or max(parts, default=0) >= 2**_BITS_OF_PARTS:
            return None
        for node_id in some.tolist():
            tracker.add_node(node_id)
    return tracker


class _Cells:
    """The cells of a grid of 0.01 degrees that lie near a box, as a table over the part of the Earth with boxes."""

    def __init__(self, boxes: Sequence[BoundingBox]) -> None:
        edges = np.array([_grown(box) for box in boxes]) * _CELLS_PER_DEG
        first, last = np.floor(edges[:, :2]).astype(np.int64), np.floor(edges[:, 2:]).astype(np.int64)
        self._south, self._west = first.min(axis=0).tolist()
        north, east = last.max(axis=0).tolist()
        self._table = np.zeros((north - self._south + 1, east - self._west + 1), dtype=bool)
        corner = np.array([self._south, self._west])
        for (south, west), (north, east) in zip((first - corner).tolist(), (last - corner).tolist(), strict=True):
            self._table[south : north + 1, west : east + 1] = True

    def hold(self, x: npt.NDArray[np.int32], y: npt.NDArray[np.int32]) -> npt.NDArray[np.bool_]:
        """Whether nodes lie in one of the cells, (n,); ``x`` and ``y`` are multiples of 1e-7 degrees."""
        row, column = y // _UNITS_PER_CELL - self._south, x // _UNITS_PER_CELL - self._west
        rows, columns = self._table.shape
        inside: npt.NDArray[np.bool_] = (row >= 0) & (row < rows) & (column >= 0) & (column < columns) & (x != _NOWHERE)
        inside[inside] = self._table[row[inside], column[inside]]
        return inside


def _grown(box: BoundingBox) -> tuple[float, float, float, float]:
    """South, west, north and east of a box with the margin around it, degrees."""
    farthest_deg = min(max(abs(box.south_deg), abs(box.north_deg)) + _MARGIN_DEG, 90.0)
    east_deg = _MARGIN_DEG / max(math.cos(math.radians(farthest_deg)), _MIN_COS_LATITUDE)
    return (
        box.south_deg - _MARGIN_DEG,
        max(box.west_deg - east_deg, -180.0),
        box.north_deg + _MARGIN_DEG,
        min(box.east_deg + east_deg, 180.0),
    )
