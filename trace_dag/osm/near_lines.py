"""Which of the lines that libosmium copied out of a map file are near which boxes.

Most ways of a town are buildings. To keep them cheap, only the first node of each is read; the rest is read only if
that node is near a site.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from typing import Final, NamedTuple

import numpy as np
import shapely

from trace_dag.geometry import FloatArray
from trace_dag.osm import opl
from trace_dag.osm.drivable import DRIVABLE_HIGHWAYS, SERVICE_HIGHWAYS
from trace_dag.osm.opl import IntArray, Lines
from trace_dag.osm.types import BoundingBox
from trace_dag.osm.walkways import WALKWAY_TAGS

_LONGEST_BUILDING_DEG: Final = 0.004  # 440 m to the north; one that begins farther away than this may be missed


class NearWays(NamedTuple):
    """Lines of ways, and which of them overlaps which box: pairs of the number of a line and that of a box, (n,) each.

    ``roads`` are compared with the boxes, what is no road with the nearer ones.
    """

    roads: bool
    lines: Lines
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
        self._with_things = bool(nearer)
        self._values_of_roads: dict[bytes, list[bytes]] = {}
        for key, value in road_tags(service_roads=service_roads):
            self._values_of_roads.setdefault(key.encode(), []).append(value.encode())

    def of_nodes(self, nodes: Lines) -> tuple[IntArray, IntArray]:
        """Pairs of the number of a line of a node and that of a site, one of whose boxes holds it, (n,) each."""
        places = shapely.points(*nodes.node_places())
        pairs = np.concatenate([self._areas.query(places), self.nearer_areas.query(places)], axis=1)
        numbers, sites = np.unique(pairs, axis=1)
        return numbers, sites

    def of_ways(self, ways: Lines) -> Iterator[NearWays]:
        """Roads, and other things, near sites."""
        roads = highways = ways.having(b"highway")
        if self._with_things:  # else nothing but roads was copied
            roads = highways & np.any([ways.having(*tag) for tag in self._values_of_roads.items()], axis=0)
        found, bounds = self._overlapping(ways.some(roads), self._areas, roads=True)
        if self._measure_bounds and bounds.size:
            self.bounds_deg.append(np.concatenate([bounds[:2].min(axis=1), bounds[2:].max(axis=1)]))
        yield found
        if not self._with_things:
            return
        buildings = ~highways & ways.having(b"building")
        near = self._begun_near(ways.some(buildings))
        things = np.concatenate([np.flatnonzero(~highways & ~buildings), np.flatnonzero(buildings)[near]])
        if len(things):
            yield self._overlapping(ways.some(things), self.nearer_areas, roads=False)[0]

    def _begun_near(self, buildings: Lines) -> IntArray:
        """The numbers of those of many buildings that begin near one of the nearer boxes, (n,)."""
        x_deg, y_deg = buildings.first_places()
        self.incomplete |= bool(np.isnan(x_deg).any())
        return np.unique(self._begin_areas.query(shapely.points(x_deg, y_deg))[0])

    def _overlapping(self, lines: Lines, areas: shapely.STRtree, *, roads: bool) -> tuple[NearWays, FloatArray]:
        """The pairs, and the bounds of all lines that are located, (4, n)."""
        nodes = lines.way_nodes()
        missing = np.isnan(nodes.longitudes_deg)
        self.incomplete |= bool(missing.any())
        self.negative |= bool((nodes.ids[missing] < 0).any())
        located, bounds = _bounds_of_ways(nodes)
        near, sites = areas.query(shapely.box(*bounds))
        return NearWays(roads, lines, nodes, located[near], sites), bounds


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
