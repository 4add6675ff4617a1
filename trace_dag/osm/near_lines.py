"""Which of the lines that libosmium copied out of a map file are near which boxes.

Most ways of a town are buildings. To keep them cheap, only the first node of each is read; the rest is read only if
that node is near a site.
"""

from __future__ import annotations

import re
from collections.abc import Iterable, Iterator, Sequence
from itertools import groupby, islice
from operator import itemgetter
from typing import Final, NamedTuple

import numpy as np
import numpy.typing as npt
import shapely

from trace_dag.geometry import FloatArray
from trace_dag.osm import opl
from trace_dag.osm.drivable import DRIVABLE_HIGHWAYS, SERVICE_HIGHWAYS
from trace_dag.osm.types import BoundingBox
from trace_dag.osm.walkways import WALKWAY_TAGS

IntArray = npt.NDArray[np.int64]

_BATCH: Final = 50_000  # lines that are looked at together
_LONGEST_BUILDING_DEG: Final = 0.004  # 440 m to the north; one that begins farther away than this may be missed
_FIRST_NODE: Final = 60  # bytes from the last space of a way's line in which its first node ends


class NearWays(NamedTuple):
    """Lines of ways, and which of them overlaps which box: pairs of the number of a line and that of a box, (n,) each.

    ``roads`` are compared with the boxes, what is no road with the nearer ones.
    """

    roads: bool
    lines: Sequence[bytes]
    nodes: opl.WayNodes
    numbers: IntArray
    sites: IntArray


class NearLines:
    """Compares lines with boxes around sites, and with the nearer boxes in which things beside roads are wanted."""

    def __init__(
        self,
        boxes: Sequence[BoundingBox],
        nearer: Sequence[BoundingBox],
        *,
        service_roads: bool,
        measure_bounds: bool = False,
    ) -> None:
        self.incomplete = False  # some way has a node that was not located
        self.negative = False  # and one of those has an id below 0, which libosmium does not locate
        self.bounds_deg: list[FloatArray] = []  # west, south, east, north of the roads of each batch, where measured
        self._areas = _tree_of(boxes)
        self.nearer_areas = _tree_of(nearer)
        self._begin_areas = _tree_of(nearer, _LONGEST_BUILDING_DEG)
        self._measure_bounds = measure_bounds
        self._may_be_road = re.compile(
            rb"[T,](?:"
            + b"|".join(f"{key}={value}".encode() for key, value in road_tags(service_roads=service_roads))
            + rb")(?:,|$)"
        ).search

    def of_nodes(self, lines: Sequence[bytes]) -> tuple[IntArray, IntArray]:
        """Pairs of the number of a line of a node and that of a site, one of whose boxes holds it, (n,) each."""
        places = shapely.points(*opl.read_places([line[line.rindex(b" x") :] for line in lines]))
        pairs = np.concatenate([self._areas.query(places), self.nearer_areas.query(places)], axis=1)
        numbers, sites = np.unique(pairs, axis=1)
        return numbers, sites

    def of_ways(self, lines: Iterable[bytes]) -> Iterator[NearWays]:
        """Roads, and other things, near sites."""
        roads: list[bytes] = []
        things: list[bytes] = []
        buildings: list[bytes] = []
        begins: list[bytes] = []
        for line in lines:
            end = line.rindex(b" ")
            tags = line[:end]
            if b"highway=" in tags:  # the most of them are for people on foot alone
                if self._may_be_road(tags):
                    roads.append(line)
            elif b"building=" in tags:
                buildings.append(line)
                begins.append(line[end + 2 : end + _FIRST_NODE].partition(b",")[0])
            else:
                things.append(line)
        found, bounds = self._overlapping(roads, self._areas, roads=True)
        if self._measure_bounds and bounds.size:
            self.bounds_deg.append(np.concatenate([bounds[:2].min(axis=1), bounds[2:].max(axis=1)]))
        yield found
        things += self._begun_near(buildings, begins)
        if things:
            yield self._overlapping(things, self.nearer_areas, roads=False)[0]

    def _begun_near(self, buildings: Sequence[bytes], begins: Sequence[bytes]) -> list[bytes]:
        """Those of many buildings that begin near one of the nearer boxes."""
        x_deg, y_deg = opl.read_places(begins)
        self.incomplete |= bool(np.isnan(x_deg).any())
        near = np.unique(self._begin_areas.query(shapely.points(x_deg, y_deg))[0])
        return [buildings[index] for index in near.tolist()]

    def _overlapping(
        self, lines: Sequence[bytes], areas: shapely.STRtree, *, roads: bool
    ) -> tuple[NearWays, FloatArray]:
        """The pairs, and the bounds of all lines that are located, (4, n)."""
        nodes = opl.read_way_nodes(lines)
        missing = np.isnan(nodes.longitudes_deg)
        self.incomplete |= bool(missing.any())
        self.negative |= bool((nodes.ids[missing] < 0).any())
        located, bounds = _bounds_of_ways(nodes)
        near, sites = areas.query(shapely.box(*bounds))
        return NearWays(roads, lines, nodes, located[near], sites), bounds


def in_batches(lines: Iterable[bytes]) -> Iterator[tuple[str, list[bytes]]]:
    """Some lines of one kind after the other: nodes (n), ways (w) and relations (r).

    >>> list(in_batches([b"n1 x1 y1", b"n2 x1 y1", b"w1 Nn1,n2"]))
    [('n', [b'n1 x1 y1', b'n2 x1 y1']), ('w', [b'w1 Nn1,n2'])]
    """
    for kind, run in groupby(lines, key=itemgetter(0)):
        while some := list(islice(run, _BATCH)):
            yield chr(kind), some


def road_tags(*, service_roads: bool) -> list[tuple[str, str]]:
    """Keys and values one of which every road and walkway has.

    >>> [("highway", "service") in road_tags(service_roads=wanted) for wanted in (True, False)]
    [True, False]
    """
    highways = DRIVABLE_HIGHWAYS if service_roads else DRIVABLE_HIGHWAYS - SERVICE_HIGHWAYS
    return [*(("highway", highway) for highway in sorted(highways)), *WALKWAY_TAGS]


def _tree_of(boxes: Sequence[BoundingBox], farther_deg: float = 0.0) -> shapely.STRtree:
    return shapely.STRtree(
        [
            shapely.box(box.west_deg, box.south_deg, box.east_deg, box.north_deg).buffer(
                farther_deg, join_style="mitre"
            )
            for box in boxes
        ]
    )


def _bounds_of_ways(nodes: opl.WayNodes) -> tuple[IntArray, FloatArray]:
    """The numbers of the ways with a node that is located, (n,); their west, south, east and north, degrees, (4, n)."""
    filled = np.flatnonzero(nodes.counts)
    if not len(filled):
        return filled, np.empty((4, 0))
    first = (np.cumsum(nodes.counts) - nodes.counts)[filled]
    places = nodes.longitudes_deg, nodes.latitudes_deg
    # fmin and fmax pass over NaN: the bounds are those of the nodes that are there.
    bounds = np.array([extreme.reduceat(values, first) for extreme in (np.fmin, np.fmax) for values in places])
    located = ~np.isnan(bounds[0])
    return filled[located], bounds[:, located]
