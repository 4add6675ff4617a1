"""Reads one OSM file for all sites of a batch.

Any format libosmium reads (``.osm``, ``.osm.gz``, ``.osm.bz2``, ``.osm.pbf``). libosmium locates the nodes of ways and
drops objects without the wanted tags; Python examines the others that begin near a site. A file whose nodes come first
is read once, any other twice. Memory has the objects around the sites, and the locations of nodes; for a large file
these are on disk (``osm.node_memory_mb``).

Cutting the ways at the boxes is :mod:`trace_dag.osm.clip`'s task, choosing the file :mod:`trace_dag.osm.catalog`'s.
"""

from __future__ import annotations

import functools
import logging
import math
import os
import shutil
import tempfile
import time
import zlib
from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager, nullcontext
from dataclasses import dataclass, field
from itertools import product
from pathlib import Path
from typing import Any, Final, NamedTuple

import numpy as np
import shapely
from lxml import etree

from trace_dag.common.errors import UserError
from trace_dag.common.gc_pause import gc_paused
from trace_dag.common.messages.logs import print_problem
from trace_dag.common.settings import OsmSettings
from trace_dag.osm.plausibility import UnreadableMapError, xml_opener
from trace_dag.osm.road_classes import DRIVABLE_HIGHWAYS, is_drivable, is_walkway
from trace_dag.osm.surroundings import NODE_KEYS, WAY_KEYS, feature_of_node, features_of_ways, is_thing
from trace_dag.osm.types import (
    OSM_ATTRIBUTION,
    BoundingBox,
    OsmFeature,
    OsmMember,
    OsmRelation,
    RawWay,
    read_attribution,
)
from trace_dag.osm.xml import as_plain_xml

# Nodes keep their tags, all of them, if they have one of these keys: what stands on a road or lifts it. Addresses
# and trees that share a node with a way say nothing about the road.
ROAD_NODE_KEYS: Final = frozenset(
    {"highway", "traffic_signals", "traffic_sign", "traffic_calming", "railway", "junction", "ele", "barrier"}
)
RESTRICTION_KEYS: Final = tuple(
    f"restriction{users}{hours}"
    for users in ("", ":motorcar", ":motor_vehicle", ":vehicle")
    for hours in ("", ":conditional")
)
LOCATED_TO_FILE: Final = 3
"""Size of the node locations to that of the map; 1.7 is usual for the densest kind, ``.osm.pbf``."""
_SAID: Final = 300  # characters of what libosmium says, which quotes what it does not like
_UNITS_PER_DEG: Final = 10**7  # OSM stores coordinates as multiples of 1e-7 degrees
_NOWHERE: Final = 2**31 - 1  # the coordinate of a node that is not located
_CELL: Final = _UNITS_PER_DEG // 100  # 0.01 degrees, 1.1 km to the north
_LONG_M: Final = 500.0
_LONG_DEG: Final = _LONG_M / 110_000.0  # of latitude, where a degree has 110.6 km and more
_MIN_COS_LATITUDE: Final = 1e-3
_LOOKED_AT: Final = 100_000  # objects, after which the clock is looked at
TOLD_EVERY_S: Final = 10.0
MOST_THREADS: Final = 8
_LOCATED_WAYS: Final = "LocationsOnWays"  # as osmium add-locations-to-ways writes it
_MOST_FEATURES: Final = 8
_MEMBER_TYPES: Final = {"n": "node", "w": "way", "r": "relation"}


@dataclass(frozen=True)
class FileHeader:
    """The header of a file.

    ``box`` is None if the file does not state its bounds.
    """

    box: BoundingBox | None
    timestamp: str
    sorted_by_type: bool
    attribution: str = OSM_ATTRIBUTION
    located_ways: bool = False  # positions are in the ways, untagged nodes left out


class Around(NamedTuple):
    """A site with two boxes: one for roads, and a smaller one for features beside them."""

    key: str
    box: BoundingBox
    nearer: BoundingBox


@dataclass(eq=False)
class FilePass:
    """Objects around some sites.

    For each site these are the roads and walkways that overlap its box, by id; the ways and nodes that are features
    beside roads in its smaller box; node tags; and restriction relations.

    ``restrictions_of`` has the relations by the id of each way in them. ``road_bounds`` is the box of all roads of the
    file, None if it has no roads or states its bounds.
    """

    sites: Sequence[Around]
    ways: list[dict[int, RawWay]]
    things: list[dict[int, RawWay]]
    points: list[list[OsmFeature]]
    node_tags: dict[int, dict[str, str]] = field(default_factory=dict)
    restrictions_of: dict[int, list[OsmRelation]] = field(default_factory=dict)
    road_bounds: BoundingBox | None = None

    def surroundings(self, index: int) -> tuple[OsmFeature, ...]:
        """Return the features beside the roads of a site."""
        return (*self.points[index], *features_of_ways([*self.things[index].values()], self.sites[index].nearer))


def read_header(path: Path) -> FileHeader:
    """Return the header of an OSM file.

    Raises :class:`UserError` if it is not an OSM file.

    >>> read_header(Path("no-such-map.osm.pbf"))  # doctest: +ELLIPSIS
    Traceback (most recent call last):
    trace_dag.osm.plausibility.UnreadableMapError: no-such-map.osm.pbf: cannot be read as OSM data (Open failed ...
    """
    import osmium

    with reading(path):
        header = osmium.FileProcessor(str(path), osmium.osm.NOTHING, thread_pool=_threads(os.getpid())).header
        if header.has_multiple_object_versions and xml_opener(path) is None:
            raise UnreadableMapError(
                f"{path}: a history file, with every version of its objects; cut today's out of it: "
                "osmium time-filter -o map.osm.pbf, and its name"
            )
        box = header.box()
        timestamp = header.get("osmosis_replication_timestamp") or header.get("timestamp")
        return FileHeader(
            box=BoundingBox(box.bottom_left.lat, box.bottom_left.lon, box.top_right.lat, box.top_right.lon)
            if box.valid()
            else None,
            timestamp=timestamp,
            sorted_by_type=header.get("sorting") == "Type_then_ID",
            attribution=_attribution(path),
            located_ways=any(header.get(f"pbf_optional_feature_{k}") == _LOCATED_WAYS for k in range(_MOST_FEATURES)),
        )


def _attribution(path: Path) -> str:
    """Return the attribution on the root element of an XML file, which libosmium drops; binary files have none."""
    opener = xml_opener(path)
    if opener is None:
        return OSM_ATTRIBUTION
    try:
        with opener(path, "rb") as stream:
            _, root = next(etree.iterparse(stream, events=("start",), resolve_entities=False, no_network=True))
    except (etree.XMLSyntaxError, StopIteration, EOFError, OSError, zlib.error):
        return OSM_ATTRIBUTION  # what is wrong with the file is said by the pass over it
    return read_attribution({str(name): str(value) for name, value in root.attrib.items()})


def read_around(
    path: Path, header: FileHeader, sites: Sequence[Around], settings: OsmSettings, *, surroundings: bool = True
) -> FilePass:
    """Return all data for a road map around each site, with the features beside the roads.

    Without ``surroundings`` there are only roads and walkways: two of three ways in a town are buildings.

    Raises :class:`UnreadableMapError` if the file cannot be read to its end as OSM data, :class:`UserError` if there is
    no disk space for the locations of its nodes.
    """
    import osmium

    with (
        as_plain_xml(path) as plain,
        reading(path),
        nullcontext() if header.located_ways else _node_locations(path, settings) as located,
        gc_paused(),
    ):
        finder = _Finder(
            path.name,
            sites,
            measure_bounds=header.box is None,
            service_roads=settings.service_roads,
            surroundings=surroundings,
        )
        finder.look_at(plain, osmium.osm.ALL, located)
        if finder.incomplete and (finder.unsorted or not header.sorted_by_type):
            finder.forget_ways()  # they are read again, now that every node of the file is located
            finder.look_at(plain, osmium.osm.WAY, located)
        return finder.found()


def _filters(*, surroundings: bool) -> Iterator[Any]:
    """Return filters that drop objects without any of the keys asked for."""
    import osmium

    node, way, relation = osmium.osm.NODE, osmium.osm.WAY, osmium.osm.RELATION
    for kind, keys in (
        (way, ("highway", *(WAY_KEYS if surroundings else ()))),
        (node, {*ROAD_NODE_KEYS, *(NODE_KEYS if surroundings else ())}),
        (relation, RESTRICTION_KEYS),
    ):
        only = osmium.filter.KeyFilter(*keys)
        only.enable_for(kind)
        yield only


@contextmanager
def _node_locations(path: Path, settings: OsmSettings) -> Iterator[Any]:
    """Return the locator of a file's nodes: in memory, or for a large file in the temporary folder."""
    import osmium

    def kept_in(table: str) -> Any:
        located = osmium.NodeLocationsForWays(osmium.index.create_map(table))
        located.ignore_errors()
        return located

    size = path.stat().st_size * LOCATED_TO_FILE
    if size <= settings.node_memory_mb * 1e6:
        yield kept_in("flex_mem")
        return
    # libosmium ends the whole process when a disk is full, so that is found out before.
    folder = Path(tempfile.gettempdir())
    if (free := shutil.disk_usage(folder).free) < size:
        raise UserError(
            f"{folder}: {free / 1e6:,.0f} MB free, but the nodes of {path} may take {size / 1e6:,.0f} MB; make room, "
            "set TMPDIR to a folder that has it, or raise osm.node_memory_mb"
        )
    with tempfile.TemporaryDirectory(prefix="trace-dag-") as temporary:
        yield kept_in(f"sparse_file_array,{temporary}/locations")


@functools.cache
def _threads(process: int) -> Any:
    """Return one thread pool for all files of a process; a forked process has none of its parent's threads."""
    import osmium

    # Left to itself libosmium spares two cores; of many, most would wait for Python, each with a stack of 8 MB.
    return osmium.io.ThreadPool(min(os.cpu_count() or 1, MOST_THREADS))


@contextmanager
def reading(path: Path) -> Iterator[None]:
    """Turn libosmium's errors about a file into :class:`UnreadableMapError`.

    >>> with reading(Path("town.osm.pbf")):  # doctest: +ELLIPSIS
    ...     raise RuntimeError("PBF error: truncated data")
    Traceback (most recent call last):
    trace_dag.osm.plausibility.UnreadableMapError: town.osm.pbf: cannot be read as OSM data (PBF error: ...
    """
    import osmium

    try:
        yield
    except (RuntimeError, ValueError, IndexError, OverflowError, osmium.InvalidLocationError) as error:
        # libosmium's exceptions have no common base: text cut off within a character is an IndexError.
        said = str(error)[:_SAID]
        raise UnreadableMapError(
            f"{path}: cannot be read as OSM data ({said}); expected .osm, .osm.gz, .osm.bz2 or .osm.pbf, whole"
        ) from error


class _Finder:
    """Keeps the objects of a file that are near a site.

    Most are not. A way up to :data:`_LONG_M` long can only be near a site if it begins in a cell (0.01 degrees) within
    that distance of it; all others are skipped at once.
    """

    def __init__(
        self,
        name: str,
        sites: Sequence[Around],
        *,
        measure_bounds: bool,
        service_roads: bool,
        surroundings: bool,
    ) -> None:
        from osmium import InvalidLocationError
        from osmium.geom import WKBFactory, haversine_distance, use_nodes

        self.incomplete = False  # some way near a site has a node that was not located
        self.unsorted = False  # a node came after a way
        self._name, self._sites, self._service_roads = name, sites, service_roads
        self._measure_bounds, self._surroundings = measure_bounds, surroundings
        self._length_m, self._not_located = haversine_distance, InvalidLocationError
        self._wkb, self._all_nodes = WKBFactory(), use_nodes.ALL
        self._boxes = _tree_of([each.box for each in sites])
        self._nearer = _tree_of([each.nearer for each in sites])
        self._cells = {cell for each in sites for box in (each.box, each.nearer) for cell in _cells(box)}
        self._points: list[list[OsmFeature]] = [[] for _ in sites]
        self._road_tags: dict[int, dict[str, str]] = {}  # of nodes near sites
        self._restrictions: list[OsmRelation] = []
        self._seen, self._told_s = 0, time.monotonic()
        self._way_seen = False
        self.forget_ways()

    def forget_ways(self) -> None:
        """Forget the ways before all are read once more."""
        self._ways: list[dict[int, RawWay]] = [{} for _ in self._sites]
        self._things: list[dict[int, RawWay]] = [{} for _ in self._sites]
        self._bounds = [math.inf, math.inf, -math.inf, -math.inf]  # west, south, east, north of all roads, 1e-7 degrees

    def look_at(self, path: Path, kinds: Any, located: Any) -> None:
        """Look at the objects of a file of some kinds, with their nodes located."""
        import osmium

        processor = osmium.FileProcessor(str(path), kinds, thread_pool=_threads(os.getpid()))
        for each in (located, *_filters(surroundings=self._surroundings)):
            if each is not None:
                processor.with_filter(each)
        for each in processor:
            self._take(each)

    def _take(self, each: Any) -> None:
        self._seen += 1
        if self._seen % _LOOKED_AT == 0:
            self._tell()
        if each.is_way():
            self._take_way(each)
        elif each.is_node():
            self.unsorted |= self._way_seen
            self._take_node(each)
        else:
            self._restrictions.append(relation_of(each))

    def found(self) -> FilePass:
        """Return everything that was kept."""
        found = FilePass(self._sites, self._ways, self._things, self._points)
        in_ways = [way.node_ids for ways in self._ways for way in ways.values()]
        nodes = np.unique(np.concatenate(in_ways)).tolist() if in_ways else []
        found.node_tags = {node_id: self._road_tags[node_id] for node_id in nodes if node_id in self._road_tags}
        kept = {way_id for ways in self._ways for way_id in ways}
        for relation in self._restrictions:
            for way_id in {member.id for member in relation.members if member.type == "way"} & kept:
                found.restrictions_of.setdefault(way_id, []).append(relation)
        if self._measure_bounds and self._bounds[0] <= self._bounds[2]:
            west_deg, south_deg, east_deg, north_deg = (each / _UNITS_PER_DEG for each in self._bounds)
            found.road_bounds = BoundingBox(south_deg, west_deg, north_deg, east_deg)
        return found

    def _take_node(self, node: Any) -> None:
        x, y = node.location.x, node.location.y
        if (x // _CELL, y // _CELL) not in self._cells:
            return
        place = shapely.Point(x / _UNITS_PER_DEG, y / _UNITS_PER_DEG)
        near_things, near_roads = self._nearer.query(place).tolist(), self._boxes.query(place).tolist()
        if not near_things and not near_roads:
            return
        tags = dict(node.tags)
        if not ROAD_NODE_KEYS.isdisjoint(tags):
            self._road_tags[node.id] = tags
        if self._surroundings and is_thing(tags, way=False):
            for site in near_things:
                self._points[site].append(feature_of_node(node.id, place.x, place.y, tags))

    def _take_way(self, way: Any) -> None:
        self._way_seen, nodes = True, way.nodes
        if self._measure_bounds and way.tags.get("highway") in DRIVABLE_HIGHWAYS:
            self._measure(nodes)
        if len(nodes) < 2 or not self._may_be_near(nodes):
            return
        tree, kept = (self._boxes, self._ways) if "highway" in way.tags else (self._nearer, self._things)
        sites = tree.query(self._line(way)).tolist()
        if not sites or not self._is_wanted(tags := dict(way.tags)):
            return
        ids, x, y = np.array([(node.ref, node.x, node.y) for node in nodes], dtype=np.int64).T
        x_deg, y_deg = (np.where(x != _NOWHERE, each / _UNITS_PER_DEG, np.nan) for each in (x, y))
        raw = RawWay(way.id, ids, x_deg, y_deg, tags)
        for site in sites:
            kept[site][raw.id] = raw

    def _line(self, way: Any) -> shapely.Geometry:
        """Return a way as a line, reduced to its located nodes."""
        try:
            return shapely.from_wkb(self._wkb.create_linestring(way, self._all_nodes))
        except self._not_located:
            self.incomplete = True
            places = [(node.x / _UNITS_PER_DEG, node.y / _UNITS_PER_DEG) for node in way.nodes if node.x != _NOWHERE]
            return shapely.MultiPoint(places)

    def _may_be_near(self, nodes: Any) -> bool:
        first = nodes[0]
        if first.x == _NOWHERE or (first.x // _CELL, first.y // _CELL) in self._cells:
            return True
        try:
            return bool(self._length_m(nodes) > _LONG_M)
        except self._not_located:
            return True

    def _is_wanted(self, tags: Mapping[str, str]) -> bool:
        if "highway" in tags:
            return is_drivable(tags, service_roads=self._service_roads) or is_walkway(tags)
        return is_thing(tags, way=True)

    def _measure(self, nodes: Any) -> None:
        west, south, east, north = self._bounds
        for node in nodes:
            if node.x != _NOWHERE:
                west, east = min(west, node.x), max(east, node.x)
                south, north = min(south, node.y), max(north, node.y)
        self._bounds = [west, south, east, north]

    def _tell(self) -> None:
        if time.monotonic() - self._told_s < TOLD_EVERY_S:
            return
        self._told_s = time.monotonic()
        line = f"{self._name}: {self._seen:,} objects read"
        if self._sites:
            line += f", roads around {sum(map(bool, self._ways)):,} of {len(self._sites):,} crashes found"
        print_problem(line, level=logging.INFO)


def relation_of(read: Any) -> OsmRelation:
    """Return a relation as libosmium reads it."""
    members = tuple(OsmMember(_MEMBER_TYPES[each.type], each.ref, each.role) for each in read.members)
    return OsmRelation(read.id, members, dict(read.tags))


def _tree_of(boxes: Sequence[BoundingBox]) -> shapely.STRtree:
    return shapely.STRtree([shapely.box(box.west_deg, box.south_deg, box.east_deg, box.north_deg) for box in boxes])


def _cells(box: BoundingBox) -> Iterator[tuple[int, int]]:
    """Return the cells within :data:`_LONG_M` of a box."""
    farthest_deg = min(max(abs(box.south_deg), abs(box.north_deg)) + _LONG_DEG, 90.0)
    east_deg = _LONG_DEG / max(math.cos(math.radians(farthest_deg)), _MIN_COS_LATITUDE)
    sides = (
        (box.west_deg - east_deg, box.east_deg + east_deg),
        (box.south_deg - _LONG_DEG, box.north_deg + _LONG_DEG),
    )
    columns, rows = (
        range(*(math.floor(side * _UNITS_PER_DEG / _CELL) + after for after, side in enumerate(ends))) for ends in sides
    )
    return product(columns, rows)
