"""All sites of a batch out of one OSM file, in one pass over it.

Any format libosmium reads (``.osm``, ``.osm.gz``, ``.osm.bz2``, ``.osm.pbf``), sorted or not. libosmium filters and
locates in C++, before Python sees an object; Python sees only ways with a ``highway`` tag, tests their bounding box
against a grid of the sites and keeps the few that touch one. The time is therefore close to that of reading the file
and hardly depends on how many sites there are. What is kept of a file in memory is its node locations (16 bytes
each) and the ways around the sites.

Cutting the ways at the boxes is :mod:`trace_dag.osm.cutting`'s task, choosing the file :mod:`trace_dag.osm.catalog`'s.
"""

from __future__ import annotations

import gc
import math
import struct
import tempfile
from collections.abc import Iterable, Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass, field
from math import floor
from pathlib import Path
from typing import Any, Final, NamedTuple

from trace_dag.errors import UserError
from trace_dag.osm import opl
from trace_dag.osm.drivable import is_drivable
from trace_dag.osm.types import BoundingBox, OsmRelation

# Nodes keep their tags, all of them, if they have one of these keys: what stands on a road or lifts it. Gates,
# addresses and trees that share a node with a way say nothing about the road.
_NODE_KEYS: Final = ("highway", "traffic_signals", "traffic_sign", "traffic_calming", "railway", "junction", "ele")
_CELL_DEG: Final = 0.005
_LONG_WAY_CELLS: Final = 400  # a way whose box covers more cells than this is compared with every site instead
_WKB_HEADER_BYTES: Final = 9  # byte order, geometry type, number of points

_Bounds = tuple[float, float, float, float]  # west, south, east, north, degrees


@dataclass(frozen=True, eq=False)
class RawWay:
    """A drivable way as the file has it, WGS84 degrees; NaN where the file lacks the node."""

    id: int
    node_ids: tuple[int, ...]
    longitudes_deg: tuple[float, ...]
    latitudes_deg: tuple[float, ...]
    bounds_deg: _Bounds
    tags: dict[str, str]


@dataclass(eq=False)
class FilePass:
    """What one pass found: for each box the ways whose bounds overlap it, by id; node tags; restriction relations.

    ``road_bounds`` is the box of all ``highway`` ways, None if there is none or the file itself says what it covers.
    """

    ways: list[dict[int, RawWay]]
    node_tags: dict[int, dict[str, str]] = field(default_factory=dict)
    restrictions: dict[int, OsmRelation] = field(default_factory=dict)
    road_bounds: BoundingBox | None = None


@dataclass(frozen=True)
class FileHeader:
    """What a file says about itself. ``box`` is None if it does not say what it covers."""

    box: BoundingBox | None
    timestamp: str
    sorted_by_type: bool


def read_header(path: Path) -> FileHeader:
    """The header of an OSM file. Raises :class:`UserError` if the file is none."""
    import osmium

    with _reading(path), osmium.io.Reader(str(path), osmium.osm.NOTHING) as reader:
        header = reader.header()
        box = header.box()
        timestamp = header.get("osmosis_replication_timestamp") or header.get("timestamp")
        return FileHeader(
            box=BoundingBox(box.bottom_left.lat, box.bottom_left.lon, box.top_right.lat, box.top_right.lon)
            if box.valid()
            else None,
            timestamp=timestamp,
            sorted_by_type=header.get("sorting") == "Type_then_ID",
        )


def extract_raw(path: Path, header: FileHeader, boxes: Sequence[BoundingBox], *, service_roads: bool) -> FilePass:
    """Everything a road map around each of ``boxes`` needs, from one pass over ``path``.

    Only a file that has ways before their nodes and does not say how it is sorted has its ways read a second time.

    Raises :class:`UserError` if the file cannot be read to its end as OSM data.
    """
    import osmium

    with tempfile.TemporaryDirectory(prefix="trace-dag-") as folder, _reading(path), no_garbage_collection():
        kept = Path(folder) / "kept.opl"
        with osmium.SimpleWriter(str(kept)) as writer:
            collector = _Collector(boxes, writer, measure_bounds=header.box is None)
            locations = osmium.NodeLocationsForWays(osmium.index.create_map("flex_mem"))
            locations.ignore_errors()
            # The order matters: locations are looked up only for ways that have passed the filter before them, and
            # every node is located before most of them are dropped.
            handlers = (
                _only_with(("highway",), osmium.osm.WAY),
                _only_with(("restriction",), osmium.osm.RELATION),
                locations,
                _only_with(_NODE_KEYS, osmium.osm.NODE),
                collector,
            )
            osmium.apply(osmium.io.Reader(str(path)), *handlers)
            if collector.incomplete and not header.sorted_by_type:
                # Again, now that every node of the file is located.
                osmium.apply(osmium.io.Reader(str(path), osmium.osm.WAY), *handlers)
        return _read_kept(kept, collector, service_roads=service_roads)


def _read_kept(kept: Path, collector: _Collector, *, service_roads: bool) -> FilePass:
    found = FilePass([{} for _ in range(collector.sites)], road_bounds=collector.road_bounds)
    with kept.open(encoding="utf-8", newline="\n") as lines:
        for line in lines:
            kind, object_id, tags, last = opl.read_line(line)
            if kind == "n":
                found.node_tags[object_id] = tags
            elif kind == "r":
                found.restrictions[object_id] = OsmRelation(object_id, opl.members(last), tags)
            elif is_drivable(tags, service_roads=service_roads):
                place = collector.ways[object_id]
                way = RawWay(
                    object_id, opl.node_ids(last), place.longitudes_deg, place.latitudes_deg, place.bounds_deg, tags
                )
                for index in place.sites:
                    found.ways[index][object_id] = way
    return found


def _only_with(keys: Sequence[str], entity: Any) -> Any:
    """A filter that drops objects of one kind that have none of ``keys``, and lets the other kinds pass."""
    from osmium.filter import KeyFilter

    key_filter = KeyFilter(*keys)
    key_filter.enable_for(entity)
    return key_filter


@contextmanager
def _reading(path: Path) -> Iterator[None]:
    import osmium

    try:
        yield
    except (RuntimeError, osmium.InvalidLocationError) as error:  # libosmium's exceptions have no common base
        raise UserError(
            f"{path}: cannot be read as OSM data ({error}); expected .osm, .osm.gz, .osm.bz2 or .osm.pbf, whole"
        ) from error


@contextmanager
def no_garbage_collection() -> Iterator[None]:
    """For building many objects without cycles: else a third of the time goes into looking for some."""
    was_enabled = gc.isenabled()
    gc.disable()
    try:
        yield
    finally:
        if was_enabled:
            gc.enable()


class _WayPlace(NamedTuple):
    longitudes_deg: tuple[float, ...]
    latitudes_deg: tuple[float, ...]
    bounds_deg: _Bounds
    sites: list[int]


class _Collector:
    """The handler libosmium calls with what has passed the filters: hands what is near a site to ``writer``.

    ``way`` is called for every road of the file, so it does the least that tells whether a site is near. ``ways`` holds
    where those are that were written, by id.
    """

    def __init__(self, boxes: Sequence[BoundingBox], writer: Any, *, measure_bounds: bool) -> None:
        import osmium

        self.incomplete = 0  # ways of which some node was not located
        self.ways: dict[int, _WayPlace] = {}
        self.sites = len(boxes)
        self._boxes = [(box.west_deg, box.south_deg, box.east_deg, box.north_deg) for box in boxes]
        self._grid = _grid(self._boxes)
        self._writer = writer
        self._measure_bounds = measure_bounds
        self._bounds: _Bounds = (math.inf, math.inf, -math.inf, -math.inf)
        self._unlocated = (RuntimeError, osmium.InvalidLocationError)
        self._all_nodes = osmium.geom.ALL
        self._create_linestring = osmium.geom.WKBFactory().create_linestring

    @property
    def road_bounds(self) -> BoundingBox | None:
        """The box of all ways seen, if it was to be measured."""
        west, south, east, north = self._bounds
        return BoundingBox(south, west, north, east) if west <= east else None

    def node(self, node: Any) -> None:
        location = node.location
        if location.valid() and (floor(location.lon / _CELL_DEG), floor(location.lat / _CELL_DEG)) in self._grid:
            self._writer.add_node(node)

    def relation(self, relation: Any) -> None:
        self._writer.add_relation(relation)

    def way(self, way: Any) -> None:
        # Well-known binary is by far the fastest way to a way's coordinates: one call instead of one per node.
        try:
            wkb = bytes.fromhex(self._create_linestring(way, self._all_nodes))
        except self._unlocated:  # fewer than two nodes, or one without a location
            x_deg, y_deg = self._partly_located(way)
            known_x, known_y = [x for x in x_deg if x == x], [y for y in y_deg if y == y]
            if not known_x:
                return
            bounds = min(known_x), min(known_y), max(known_x), max(known_y)
        else:
            values = struct.unpack_from(f"<{(len(wkb) - _WKB_HEADER_BYTES) // 8}d", wkb, _WKB_HEADER_BYTES)
            x_deg, y_deg = values[::2], values[1::2]
            bounds = min(x_deg), min(y_deg), max(x_deg), max(y_deg)
        if self._measure_bounds and not _within(bounds, self._bounds):
            self._bounds = _union(bounds, self._bounds)
        near = self._sites_near(bounds)
        if near:
            self._writer.add_way(way)
            self.ways[way.id] = _WayPlace(x_deg, y_deg, bounds, near)

    def _partly_located(self, way: Any) -> tuple[tuple[float, ...], tuple[float, ...]]:
        places = [node.location for node in way.nodes]
        self.incomplete += not all(place.valid() for place in places)
        return (
            tuple(place.lon_without_check() if place.valid() else math.nan for place in places),
            tuple(place.lat_without_check() if place.valid() else math.nan for place in places),
        )

    def _sites_near(self, bounds: _Bounds) -> list[int]:
        """Indices of the boxes that a way's bounds overlap."""
        west, south, east, north = bounds
        first_x, last_x = floor(west / _CELL_DEG), floor(east / _CELL_DEG)
        first_y, last_y = floor(south / _CELL_DEG), floor(north / _CELL_DEG)
        candidates: Iterable[int]
        if first_x == last_x and first_y == last_y:
            candidates = self._grid.get((first_x, first_y), ())
            if not candidates:
                return []
        elif (last_x - first_x + 1) * (last_y - first_y + 1) > _LONG_WAY_CELLS:
            candidates = range(self.sites)
        else:
            cells = ((x, y) for x in range(first_x, last_x + 1) for y in range(first_y, last_y + 1))
            candidates = {index for cell in cells for index in self._grid.get(cell, ())}
        boxes = self._boxes
        return [
            index
            for index in candidates
            if west <= boxes[index][2]
            and east >= boxes[index][0]
            and south <= boxes[index][3]
            and north >= boxes[index][1]
        ]


def _within(inner: _Bounds, outer: _Bounds) -> bool:
    return inner[0] >= outer[0] and inner[1] >= outer[1] and inner[2] <= outer[2] and inner[3] <= outer[3]


def _union(a: _Bounds, b: _Bounds) -> _Bounds:
    return min(a[0], b[0]), min(a[1], b[1]), max(a[2], b[2]), max(a[3], b[3])


def _grid(boxes: Sequence[_Bounds]) -> dict[tuple[int, int], tuple[int, ...]]:
    """Indices of the boxes that touch each cell of a grid of ``_CELL_DEG``."""
    cells: dict[tuple[int, int], tuple[int, ...]] = {}
    for index, (west, south, east, north) in enumerate(boxes):
        for x in range(floor(west / _CELL_DEG), floor(east / _CELL_DEG) + 1):
            for y in range(floor(south / _CELL_DEG), floor(north / _CELL_DEG) + 1):
                cells[x, y] = (*cells.get((x, y), ()), index)
    return cells
