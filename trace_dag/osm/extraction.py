"""All sites of a batch out of one OSM file, in one pass over it.

Any format libosmium reads (``.osm``, ``.osm.gz``, ``.osm.bz2``, ``.osm.pbf``), sorted or not. libosmium filters,
locates and copies what passed to a file of lines, all in C++; Python is called once per way with a ``highway`` tag, for
its geometry alone. Which of them come near a site is found out for ten thousands of ways at once, and only the lines of
those are read. The time is therefore close to that of reading the file and hardly depends on how many sites
there are. What is kept of a file in memory is its node locations (16 bytes each) and the ways around the sites.

Cutting the ways at the boxes is :mod:`trace_dag.osm.cutting`'s task, choosing the file :mod:`trace_dag.osm.catalog`'s.
"""

from __future__ import annotations

import bz2
import gzip
import math
import tempfile
import zlib
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, Final, NamedTuple

import numpy as np
import numpy.typing as npt
import shapely
from lxml import etree

from trace_dag.errors import UserError
from trace_dag.garbage import no_garbage_collection
from trace_dag.geometry import FloatArray
from trace_dag.osm import opl
from trace_dag.osm.drivable import is_drivable
from trace_dag.osm.rights import OSM_ATTRIBUTION, read_attribution
from trace_dag.osm.types import BoundingBox, OsmRelation

# Nodes keep their tags, all of them, if they have one of these keys: what stands on a road or lifts it. Gates,
# addresses and trees that share a node with a way say nothing about the road.
_NODE_KEYS: Final = ("highway", "traffic_signals", "traffic_sign", "traffic_calming", "railway", "junction", "ele")
_WKB_HEADER_BYTES: Final = 9  # byte order, geometry type, number of points
_WKB_POINT_BYTES: Final = 16
# libosmium tells formats by the same endings.
_XML_OPENERS: Final[Mapping[str, Callable[..., Any]]] = {".osm": open, ".osm.gz": gzip.open, ".osm.bz2": bz2.open}
_BATCH: Final = 50_000  # ways whose geometry is held at a time

_IntArray = npt.NDArray[np.int64]
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
    attribution: str = OSM_ATTRIBUTION


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
            attribution=_attribution(path),
        )


def _attribution(path: Path) -> str:
    """libosmium drops these attributes of a root element; binary files have no place for them."""
    opener = next((opener for suffix, opener in _XML_OPENERS.items() if path.name.endswith(suffix)), None)
    if opener is None:
        return OSM_ATTRIBUTION
    try:
        with opener(path, "rb") as stream:
            _, root = next(etree.iterparse(stream, events=("start",), resolve_entities=False, no_network=True))
    except (etree.XMLSyntaxError, StopIteration, EOFError, OSError, zlib.error):
        return OSM_ATTRIBUTION  # what is wrong with the file is said by the pass over it
    return read_attribution({str(name): str(value) for name, value in root.attrib.items()})


def extract_raw(path: Path, header: FileHeader, boxes: Sequence[BoundingBox], *, service_roads: bool) -> FilePass:
    """Everything a road map around each of ``boxes`` needs, from one pass over ``path``.

    Only a file that has ways before their nodes and does not say how it is sorted has its ways read a second time.

    Raises :class:`UserError` if the file cannot be read to its end as OSM data.
    """
    import osmium

    with tempfile.TemporaryDirectory(prefix="trace-dag-") as folder, _reading(path), no_garbage_collection():
        kept = Path(folder) / "kept.opl"
        collector = _Collector(boxes, measure_bounds=header.box is None)
        locations = osmium.NodeLocationsForWays(osmium.index.create_map("flex_mem"))
        locations.ignore_errors()
        writer = osmium.WriteHandler(str(kept))
        # The order matters: locations are looked up only for ways that have passed the filter before them, and every
        # node is located before most of them are dropped.
        handlers = (
            _only_with(("highway",), osmium.osm.WAY),
            _only_with(("restriction",), osmium.osm.RELATION),
            locations,
            _only_with(_NODE_KEYS, osmium.osm.NODE),
            writer,
            collector,
        )
        osmium.apply(osmium.io.Reader(str(path)), *handlers)
        if collector.incomplete and not header.sorted_by_type:
            # Again, now that every node of the file is located.
            collector.restart()
            osmium.apply(osmium.io.Reader(str(path), osmium.osm.WAY), *handlers)
        writer.close()
        return _read_kept(kept, collector, service_roads=service_roads)


def _read_kept(kept: Path, collector: _Collector, *, service_roads: bool) -> FilePass:
    places = collector.near_sites()
    found = FilePass([{} for _ in range(collector.sites)], road_bounds=collector.road_bounds)
    node_lines: list[str] = []
    way_number = -collector.way_lines_before
    with kept.open(encoding="utf-8", newline="\n") as lines:
        for line in lines:
            if line[0] == "n":
                node_lines.append(line)
            elif line[0] == "w":
                if (place := places.get(way_number)) is not None:
                    _keep_way(line, place, found, service_roads=service_roads)
                way_number += 1
            elif line[0] == "r":
                _, object_id, tags, last = opl.read_line(line)
                found.restrictions[object_id] = OsmRelation(object_id, opl.members(last), tags)
    wanted = {f"n{node_id}" for ways in found.ways for way in ways.values() for node_id in way.node_ids}
    for line in node_lines:
        if line[: line.index(" ")] in wanted:
            _, object_id, tags, _ = opl.read_line(line)
            found.node_tags[object_id] = tags
    return found


def _keep_way(line: str, place: _WayPlace, found: FilePass, *, service_roads: bool) -> None:
    _, way_id, tags, last = opl.read_line(line)
    if is_drivable(tags, service_roads=service_roads):
        way = RawWay(way_id, opl.node_ids(last), place.longitudes_deg, place.latitudes_deg, place.bounds_deg, tags)
        for index in place.sites:
            found.ways[index][way_id] = way


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


class _WayPlace(NamedTuple):
    longitudes_deg: tuple[float, ...]
    latitudes_deg: tuple[float, ...]
    bounds_deg: _Bounds
    sites: list[int]


class _Collector:
    """The handler libosmium calls with every road of the file: notes where it is, and which sites it is near.

    Ways are known by their number, in the order in which libosmium passes them on (and writes them).
    """

    def __init__(self, boxes: Sequence[BoundingBox], *, measure_bounds: bool) -> None:
        import osmium

        self.incomplete = 0  # ways of which some node was not located
        self.way_lines_before = 0  # ways passed on before the last restart
        self.sites = len(boxes)
        self._boxes = [(box.west_deg, box.south_deg, box.east_deg, box.north_deg) for box in boxes]
        self._areas = shapely.STRtree([shapely.box(*box) for box in self._boxes])
        self._measure_bounds = measure_bounds
        self._bounds: _Bounds = (math.inf, math.inf, -math.inf, -math.inf)
        self._ways = 0  # passed on since the last restart
        self._numbers: list[int] = []  # of the ways in the batch
        self._lines_wkb: list[str] = []
        self._near: dict[int, _WayPlace] = {}
        self._unlocated = (RuntimeError, osmium.InvalidLocationError)
        self._all_nodes = osmium.geom.ALL
        self._create_linestring = osmium.geom.WKBFactory().create_linestring

    @property
    def road_bounds(self) -> BoundingBox | None:
        """The box of all ways seen, if it was to be measured."""
        west, south, east, north = self._bounds
        return BoundingBox(south, west, north, east) if west <= east else None

    def restart(self) -> None:
        """Forget the ways: they will all be passed on once more."""
        self.way_lines_before += self._ways
        self._ways = 0
        self._numbers, self._lines_wkb, self._near = [], [], {}

    def way(self, way: Any) -> None:
        # Well-known binary is by far the fastest way to a way's coordinates: one call instead of one per node.
        try:
            self._lines_wkb.append(self._create_linestring(way, self._all_nodes))
            self._numbers.append(self._ways)
        except self._unlocated:  # fewer than two nodes, or one without a location
            self._add_partly_located(way)
        self._ways += 1
        if len(self._numbers) >= _BATCH:
            self._look_for_sites()

    def near_sites(self) -> dict[int, _WayPlace]:
        """The ways whose bounds overlap a box, by number."""
        self._look_for_sites()
        return self._near

    def _look_for_sites(self) -> None:
        """Empty the batch, keeping the ways whose bounds overlap a box."""
        if not self._numbers:
            return
        points, first = _read_linestrings(self._lines_wkb)
        low, high = np.minimum.reduceat(points, first), np.maximum.reduceat(points, first)
        if self._measure_bounds:
            self._extend_bounds((*low.min(axis=0).tolist(), *high.max(axis=0).tolist()))
        sites_of: dict[int, list[int]] = {}
        for index, site in self._areas.query(shapely.box(*low.T, *high.T)).T.tolist():
            sites_of.setdefault(index, []).append(site)
        ends = [*first[1:].tolist(), len(points)]
        for index, sites in sites_of.items():
            x_deg, y_deg = points[first[index] : ends[index]].T.tolist()
            (west, south), (east, north) = low[index].tolist(), high[index].tolist()
            self._near[self._numbers[index]] = _WayPlace(tuple(x_deg), tuple(y_deg), (west, south, east, north), sites)
        self._numbers, self._lines_wkb = [], []

    def _add_partly_located(self, way: Any) -> None:
        places = [node.location for node in way.nodes]
        self.incomplete += not all(place.valid() for place in places)
        known = [place for place in places if place.valid()]
        if not known:
            return
        x_deg = tuple(place.lon_without_check() if place.valid() else math.nan for place in places)
        y_deg = tuple(place.lat_without_check() if place.valid() else math.nan for place in places)
        known_x, known_y = [place.lon for place in known], [place.lat for place in known]
        bounds = (min(known_x), min(known_y), max(known_x), max(known_y))
        if self._measure_bounds:
            self._extend_bounds(bounds)
        near = [index for index, box in enumerate(self._boxes) if _overlap(bounds, box)]
        if near:
            self._near[self._ways] = _WayPlace(x_deg, y_deg, bounds, near)

    def _extend_bounds(self, bounds: _Bounds) -> None:
        a, b = self._bounds, bounds
        self._bounds = min(a[0], b[0]), min(a[1], b[1]), max(a[2], b[2]), max(a[3], b[3])


def _read_linestrings(hexadecimal: Sequence[str]) -> tuple[FloatArray, _IntArray]:
    """Points of many lines in well-known binary, (n, 2), and where each line's begin. Much faster than one by one."""
    sizes = np.array([len(text) // 2 for text in hexadecimal])
    starts = np.concatenate([[0], np.cumsum(sizes)[:-1]])
    data = np.frombuffer(bytes.fromhex("".join(hexadecimal)), np.uint8)
    header = (starts[:, None] + np.arange(_WKB_HEADER_BYTES)).ravel()
    points = np.delete(data, header).view("<f8").reshape(-1, 2)
    return points, (starts - _WKB_HEADER_BYTES * np.arange(len(starts))) // _WKB_POINT_BYTES


def _overlap(a: _Bounds, b: _Bounds) -> bool:
    return a[0] <= b[2] and a[2] >= b[0] and a[1] <= b[3] and a[3] >= b[1]
