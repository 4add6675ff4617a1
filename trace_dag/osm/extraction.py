"""All sites of a batch out of one OSM file, in one pass over it.

Any format libosmium reads (``.osm``, ``.osm.gz``, ``.osm.bz2``, ``.osm.pbf``), sorted or not. libosmium filters,
locates and copies what passed to a file of lines, all in C++: Python is called for no object. Arrow then reads the
places of ten thousands of ways at once, an index says which of them come near a site, and only the lines of those
become objects. The time is therefore close to that of reading the file and hardly depends on how many sites there are.
What is kept of a file in memory is its node locations (16 bytes each), its nodes with tags that matter to roads, and
the ways around the sites.

Cutting the ways at the boxes is :mod:`trace_dag.osm.cutting`'s task, choosing the file :mod:`trace_dag.osm.catalog`'s.
"""

from __future__ import annotations

import os
import shutil
import tempfile
import zlib
from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import dataclass, field
from itertools import groupby, islice
from operator import itemgetter
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
from trace_dag.osm.drivable import DRIVABLE_HIGHWAYS, SERVICE_HIGHWAYS, is_drivable
from trace_dag.osm.plausibility import UnreadableMapError, with_positive_ids, xml_opener
from trace_dag.osm.rights import OSM_ATTRIBUTION, read_attribution
from trace_dag.osm.types import BoundingBox, OsmRelation
from trace_dag.osm.walkways import WALKWAY_TAGS, is_walkway

# Nodes keep their tags, all of them, if they have one of these keys: what stands on a road or lifts it. Gates,
# addresses and trees that share a node with a way say nothing about the road.
_NODE_KEYS: Final = ("highway", "traffic_signals", "traffic_sign", "traffic_calming", "railway", "junction", "ele")
_SAID: Final = 300  # characters of what libosmium says, which quotes what it does not like
_BATCH: Final = 50_000  # ways whose geometry is held at a time
_COPY_TO_FILE: Final = 4  # size of the copy to that of the file; 2 is usual for the densest kind, .osm.pbf
_WRITTEN_AT_ONCE: Final = 2**20  # bytes: little enough for threads to write while the file is still being read

_IntArray = npt.NDArray[np.int64]


class RawWay(NamedTuple):
    """A drivable way or a walkway as the file has it: (n,) nodes, WGS84 degrees, NaN where the file lacks the node."""

    id: int
    node_ids: _IntArray
    longitudes_deg: FloatArray
    latitudes_deg: FloatArray
    tags: Mapping[str, str]


@dataclass(eq=False)
class FilePass:
    """What one pass found: for each box the ways whose bounds overlap it, by id; node tags; restriction relations.

    ``restrictions_of`` has them by the id of each way they speak of. ``road_bounds`` is the box of all roads of the
    file, None if there is none or the file itself says what it covers.
    """

    ways: list[dict[int, RawWay]]
    node_tags: dict[int, dict[str, str]] = field(default_factory=dict)
    restrictions_of: dict[int, list[OsmRelation]] = field(default_factory=dict)
    road_bounds: BoundingBox | None = None


@dataclass(frozen=True)
class FileHeader:
    """What a file says about itself. ``box`` is None if it does not say what it covers."""

    box: BoundingBox | None
    timestamp: str
    sorted_by_type: bool
    attribution: str = OSM_ATTRIBUTION


def read_header(path: Path) -> FileHeader:
    """The header of an OSM file. Raises :class:`UserError` if it is not an OSM file."""
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
    opener = xml_opener(path)
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

    Objects with ids below 0, which editors give to what is new, get others.

    Raises :class:`UnreadableMapError` if the file cannot be read to its end as OSM data, :class:`UserError` if its
    roads find no room on the disk.
    """
    found, negative = _one_pass(path, header, boxes, service_roads=service_roads)
    if not negative:
        return found
    with tempfile.TemporaryDirectory(prefix="trace-dag-") as folder:
        renumbered = Path(folder) / "renumbered.osm"
        if not with_positive_ids(path, renumbered):
            raise UnreadableMapError(f"{path}: has ids below 0; save it as .osm, where they are read")
        return _one_pass(renumbered, header, boxes, service_roads=service_roads)[0]


def _one_pass(
    path: Path, header: FileHeader, boxes: Sequence[BoundingBox], *, service_roads: bool
) -> tuple[FilePass, bool]:
    """What one pass finds, and whether nodes were not found because their ids are below 0."""
    import osmium

    _check_room(path)
    with tempfile.TemporaryDirectory(prefix="trace-dag-") as folder, _reading(path), no_garbage_collection():
        collector = _Collector(boxes, measure_bounds=header.box is None, service_roads=service_roads)
        locations = osmium.NodeLocationsForWays(osmium.index.create_map("flex_mem"))
        locations.ignore_errors()

        def copy_roads(name: str, kinds: Any) -> Path:
            copy = Path(folder) / name
            threads = osmium.io.ThreadPool(os.cpu_count() or 1)  # left to itself libosmium spares two cores
            writer = osmium.SimpleWriter(
                osmium.io.File(str(copy), opl.WRITING), bufsz=_WRITTEN_AT_ONCE, thread_pool=threads
            )
            # The order matters: locations are looked up only for ways that have passed the filter before them, and
            # every node is located before most of them are dropped.
            osmium.apply(
                osmium.io.Reader(str(path), kinds, thread_pool=threads),
                _only_with(_road_classes(service_roads=service_roads), osmium.osm.WAY),
                _only_with(("restriction",), osmium.osm.RELATION),
                locations,
                _only_with(_NODE_KEYS, osmium.osm.NODE),
                writer,
            )
            writer.close()
            return copy

        collector.read(copy_roads("first.opl", osmium.osm.ALL))
        if collector.incomplete and not header.sorted_by_type:
            # Again, now that every node of the file is located.
            collector.forget_ways()
            collector.read(copy_roads("again.opl", osmium.osm.WAY))
        return collector.found(), collector.negative


def _check_room(path: Path) -> None:
    """libosmium ends the whole process when a disk is full, so that is found out before."""
    folder = Path(tempfile.gettempdir())
    needed, free = path.stat().st_size * _COPY_TO_FILE, shutil.disk_usage(folder).free
    if free < needed:
        raise UserError(
            f"{folder}: {free / 1e6:.0f} MB free, but copying the roads of {path} may take {needed / 1e6:.0f} MB; "
            "make room, or set TMPDIR to a folder that has it"
        )


def _road_classes(*, service_roads: bool) -> list[tuple[str, str]]:
    highways = DRIVABLE_HIGHWAYS if service_roads else DRIVABLE_HIGHWAYS - SERVICE_HIGHWAYS
    return [*(("highway", highway) for highway in sorted(highways)), *WALKWAY_TAGS]


def _only_with(tags: Sequence[str] | Sequence[tuple[str, str]], entity: Any) -> Any:
    """A filter that drops objects of one kind that have none of ``tags`` (keys, or keys with their values)."""
    from osmium.filter import KeyFilter, TagFilter

    only = (KeyFilter if isinstance(tags[0], str) else TagFilter)(*tags)
    only.enable_for(entity)
    return only


@contextmanager
def _reading(path: Path) -> Iterator[None]:
    import osmium

    try:
        yield
    except (RuntimeError, ValueError, OverflowError, osmium.InvalidLocationError) as error:
        # libosmium's exceptions have no common base; Arrow's for ids beyond 64 bits is a ValueError.
        said = str(error)[:_SAID]
        raise UnreadableMapError(
            f"{path}: cannot be read as OSM data ({said}); expected .osm, .osm.gz, .osm.bz2 or .osm.pbf, whole"
        ) from error


class _Collector:
    """Reads what libosmium copied, and keeps the ways near a site and what belongs to them."""

    def __init__(self, boxes: Sequence[BoundingBox], *, measure_bounds: bool, service_roads: bool) -> None:
        self.incomplete = False  # some way has a node that was not located
        self.negative = False  # and one of those has an id below 0, which libosmium does not locate
        self._boxes = boxes
        self._areas = shapely.STRtree(
            [shapely.box(box.west_deg, box.south_deg, box.east_deg, box.north_deg) for box in boxes]
        )
        self._measure_bounds = measure_bounds
        self._service_roads = service_roads
        self._node_lines: list[bytes] = []
        self._restrictions: list[OsmRelation] = []
        self.forget_ways()

    def forget_ways(self) -> None:
        """They will all be read once more."""
        self._ways: list[dict[int, RawWay]] = [{} for _ in self._boxes]
        self._bounds_deg: list[FloatArray] = []  # west, south, east, north of each batch

    def read(self, copy: Path) -> None:
        """Read a copy to its end."""
        way_lines: list[bytes] = []
        with copy.open("rb") as lines:
            for kind, run in groupby(lines, key=itemgetter(0)):
                if kind == ord("w"):
                    while more := list(islice(run, _BATCH - len(way_lines))):
                        way_lines += more
                        if len(way_lines) == _BATCH:
                            self._add_ways(way_lines)
                            way_lines = []
                elif kind == ord("n"):
                    self._node_lines.extend(run)
                else:
                    self._restrictions.extend(
                        OsmRelation(opl.read_id(line), opl.read_members(line), opl.read_tags(line)) for line in run
                    )
        self._add_ways(way_lines)

    def found(self) -> FilePass:
        """Everything that was read."""
        found = FilePass(self._ways)
        in_ways = [way.node_ids for ways in self._ways for way in ways.values()]
        wanted = set(np.concatenate(in_ways).tolist() if in_ways else ())
        for line in self._node_lines:
            if (node_id := opl.read_id(line)) in wanted:
                found.node_tags[node_id] = opl.read_tags(line)
        for relation in self._restrictions:
            for way_id in {member.id for member in relation.members if member.type == "way"}:
                found.restrictions_of.setdefault(way_id, []).append(relation)
        if self._bounds_deg:
            bounds = np.array(self._bounds_deg)
            (west, south), (east, north) = bounds[:, :2].min(axis=0).tolist(), bounds[:, 2:].max(axis=0).tolist()
            found.road_bounds = BoundingBox(south, west, north, east)
        return found

    def _add_ways(self, lines: Sequence[bytes]) -> None:
        """Keep the ways whose bounds overlap a box."""
        nodes = opl.read_way_nodes(lines)
        missing = np.isnan(nodes.longitudes_deg)
        self.incomplete |= bool(missing.any())
        self.negative |= bool((nodes.ids[missing] < 0).any())
        located, bounds = _bounds_of_ways(nodes)
        if not len(located):
            return
        if self._measure_bounds:
            self._bounds_deg.append(np.concatenate([bounds[:2].min(axis=1), bounds[2:].max(axis=1)]))
        near, sites = self._areas.query(shapely.box(*bounds))
        ways = self._read_ways(lines, nodes, np.unique(located[near]))
        for index, site in zip(located[near].tolist(), sites.tolist(), strict=True):
            if (way := ways.get(index)) is not None:
                self._ways[site][way.id] = way

    def _read_ways(self, lines: Sequence[bytes], nodes: opl.WayNodes, wanted: _IntArray) -> dict[int, RawWay]:
        """Those of the wanted ways that are drivable or walkways, by their number among the lines."""
        is_wanted = np.zeros(len(lines), dtype=bool)
        is_wanted[wanted] = True
        of_wanted = np.repeat(is_wanted, nodes.counts)
        # Copies: what is kept of a batch must not keep all of it in memory.
        ids, x_deg, y_deg = nodes.ids[of_wanted], nodes.longitudes_deg[of_wanted], nodes.latitudes_deg[of_wanted]
        ends = np.cumsum(nodes.counts[wanted])
        starts = ends - nodes.counts[wanted]
        ways = {}
        for index, start, end in zip(wanted.tolist(), starts.tolist(), ends.tolist(), strict=True):
            tags = opl.read_tags(lines[index])
            if is_drivable(tags, service_roads=self._service_roads) or is_walkway(tags):
                way_id = opl.read_id(lines[index])
                ways[index] = RawWay(way_id, ids[start:end], x_deg[start:end], y_deg[start:end], tags)
        return ways


def _bounds_of_ways(nodes: opl.WayNodes) -> tuple[_IntArray, FloatArray]:
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
