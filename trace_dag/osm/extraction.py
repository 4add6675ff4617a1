"""All sites of a batch out of one OSM file, in one pass over it, or two over a large one.

Any format libosmium reads (``.osm``, ``.osm.gz``, ``.osm.bz2``, ``.osm.pbf``), sorted or not. libosmium filters
objects, locates their nodes and copies them to a file of lines, all in C++, without a call into Python. Arrow then
reads the places of tens of thousands of ways at once, an index finds those near a site, and only their lines become
objects. So the time is close to that of reading the file and hardly depends on the number of sites. Memory holds what
lies around the sites, and the locations of nodes: 16 bytes each.

Of a large file the locations are in a file of the temporary folder, and nearly all ways are far from every site. A
first pass copies what nodes and relations say, a second one the ways that have a node near a site
(:mod:`trace_dag.osm.near_nodes`) or are long (:mod:`trace_dag.osm.long_ways`): Python sees nothing of what is far.

What is kept of the lines is :mod:`trace_dag.osm.collecting`'s task, cutting the ways at the boxes
:mod:`trace_dag.osm.cutting`'s, choosing the file :mod:`trace_dag.osm.catalog`'s.
"""

from __future__ import annotations

import ctypes
import functools
import os
import shutil
import tempfile
import zlib
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Final

from lxml import etree

from trace_dag.errors import UserError
from trace_dag.garbage import no_garbage_collection
from trace_dag.osm import opl
from trace_dag.osm.collecting import ROAD_NODE_KEYS, Collector, FilePass, road_tags
from trace_dag.osm.long_ways import LongWayFinder, nodes_of_overlapping, note, noted
from trace_dag.osm.near_nodes import fit_into_memory, near_node_ids
from trace_dag.osm.plausibility import UnreadableMapError, with_positive_ids, xml_opener
from trace_dag.osm.rights import OSM_ATTRIBUTION, read_attribution
from trace_dag.osm.surroundings import LARGE_WAY_TAGS, NODE_KEYS, WAY_KEYS
from trace_dag.osm.types import BoundingBox

_SAID: Final = 300  # characters of what libosmium says, which quotes what it does not like
_COPY_TO_FILE: Final = 10  # size of the copy to that of the file; 9 is usual for the densest kind, .osm.pbf
_COPY_OF_LARGE_TO_FILE: Final = 2  # the same where what is far from all sites is not copied; 1 is usual
_LARGE: Final = 5 * 10**7  # bytes of a file whose ways are not all copied, nor its nodes located in memory
_LOCATED_TO_FILE: Final = 3  # size of that file to that of the map; 1.7 is usual for the densest kind, .osm.pbf
_WRITTEN_AT_ONCE: Final = 2**20  # bytes: little enough for threads to write while the file is still being read


@dataclass(frozen=True)
class FileHeader:
    """What a file says about itself. ``box`` is None if it does not say what it covers."""

    box: BoundingBox | None
    timestamp: str
    sorted_by_type: bool
    attribution: str = OSM_ATTRIBUTION


def read_header(path: Path) -> FileHeader:
    """The header of an OSM file. Raises :class:`UserError` if it is not an OSM file.

    >>> read_header(Path("no-such-map.osm.pbf"))  # doctest: +ELLIPSIS
    Traceback (most recent call last):
    trace_dag.osm.plausibility.UnreadableMapError: no-such-map.osm.pbf: cannot be read as OSM data (Open failed ...
    """
    import osmium

    with _reading(path), osmium.io.Reader(str(path), osmium.osm.NOTHING, thread_pool=_threads(os.getpid())) as reader:
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


def extract_raw(
    path: Path,
    header: FileHeader,
    boxes: Sequence[BoundingBox],
    *,
    service_roads: bool,
    nearer: Sequence[BoundingBox] = (),
) -> FilePass:
    """Everything a road map around each of ``boxes`` needs, from one pass over ``path``; and what stands and lies
    beside the roads in each of the ``nearer`` boxes.

    Only a file that has ways before their nodes and does not say how it is sorted has its ways read a second time.

    Objects with ids below 0, which editors give to what is new, get others.

    Raises :class:`UnreadableMapError` if the file cannot be read to its end as OSM data, :class:`UserError` if its
    roads find no room on the disk.

    >>> from trace_dag.osm.xml import write_osm
    >>> with tempfile.TemporaryDirectory() as folder:
    ...     path = Path(folder) / "town.osm"
    ...     _ = path.write_bytes(write_osm(extract))
    ...     (in_box,) = extract_raw(path, read_header(path), [extract.box], service_roads=True).ways
    >>> len(in_box) == len(extract.ways) + len(extract.walkways)
    True
    """
    found, negative = _one_pass(path, header, boxes, nearer, service_roads=service_roads)
    if not negative:
        return found
    with tempfile.TemporaryDirectory(prefix="trace-dag-") as folder:
        renumbered = Path(folder) / "renumbered.osm"
        if not with_positive_ids(path, renumbered):
            raise UnreadableMapError(f"{path}: has ids below 0; save it as .osm, where they are read")
        return _one_pass(renumbered, header, boxes, nearer, service_roads=service_roads)[0]


def _one_pass(
    path: Path,
    header: FileHeader,
    boxes: Sequence[BoundingBox],
    nearer: Sequence[BoundingBox],
    *,
    service_roads: bool,
) -> tuple[FilePass, bool]:
    """What one pass finds, and whether nodes were not found because their ids are below 0."""
    far_left_out = _is_large(path) and header.sorted_by_type and header.box is not None
    _check_room(path, far_left_out=far_left_out)
    with tempfile.TemporaryDirectory(prefix="trace-dag-") as folder, _reading(path), no_garbage_collection():
        collector = Collector(boxes, nearer, measure_bounds=header.box is None, service_roads=service_roads)
        copying = _Copying(path, Path(folder), with_surroundings=bool(nearer), service_roads=service_roads)
        if far_left_out:
            _read_what_is_near(copying, collector, [*boxes, *nearer])
        else:
            collector.read(copying.copy(ways=True, others=True))
            if collector.incomplete and not header.sorted_by_type:
                # Again, now that every node of the file is located.
                collector.forget_ways()
                collector.read(copying.copy(ways=True))
        return collector.found(), collector.negative


def _read_what_is_near(copying: _Copying, collector: Collector, boxes: Sequence[BoundingBox]) -> None:
    """Read a large file, sorted by type, without copying the ways that are far from all ``boxes``."""
    from osmium import IdTracker

    long = noted(copying.path)
    if long is None:
        collector.read(copying.copy(others=True, finder=(finder := LongWayFinder())))
        collector.negative = finder.negative
        note(copying.path, long := finder.found())
    else:
        collector.read(copying.copy(others=True))
    if not boxes or collector.negative:
        return
    near = [*near_node_ids(copying.located, boxes), nodes_of_overlapping(long, boxes)]
    if not fit_into_memory(near):
        _check_room(copying.path, far_left_out=False)
        collector.read(copying.copy(ways=True))
        return
    tracker = IdTracker()
    for ids in near:
        for node_id in ids.tolist():
            tracker.add_node(node_id)
    collector.read(copying.copy(ways=True, only=(tracker.contains_filter(),)))


class _Copying:
    """Copies what may be kept of a file to files of lines."""

    def __init__(self, path: Path, folder: Path, *, with_surroundings: bool, service_roads: bool) -> None:
        import osmium

        self.path = path
        self.located = folder / "locations"  # nodes of a large file, as libosmium writes them
        self._folder = folder
        self._copies = 0
        kept_in = f"sparse_file_array,{self.located}" if _is_large(path) else "flex_mem"
        self._locations = osmium.NodeLocationsForWays(osmium.index.create_map(kept_in))
        self._locations.ignore_errors()
        roads, way, node = road_tags(service_roads=service_roads), osmium.osm.WAY, osmium.osm.NODE
        self._ways = _only_with(("highway", *WAY_KEYS) if with_surroundings else roads, way)
        self._maybe_long = [  # whatever is asked for this time, since what is found is noted
            _only_with(tuple({"highway", *dict(LARGE_WAY_TAGS)}), way),
            _only_with([*road_tags(service_roads=True), *LARGE_WAY_TAGS], way),
        ]
        self._nodes = _only_with(tuple({*ROAD_NODE_KEYS, *NODE_KEYS} if with_surroundings else ROAD_NODE_KEYS), node)
        self._relations = _only_with(("restriction",), osmium.osm.RELATION)

    def copy(
        self,
        *,
        ways: bool = False,
        others: bool = False,
        only: Sequence[Any] = (),
        finder: LongWayFinder | None = None,
    ) -> Path:
        """A copy of the ways, the others (nodes and relations) or both; ``only`` are filters of ways.

        A ``finder`` sees the ways that may be long, which are not copied.
        """
        import osmium

        kinds = osmium.osm.NOTHING
        if ways or finder:
            kinds |= osmium.osm.WAY
        if others:
            kinds |= osmium.osm.NODE | osmium.osm.RELATION
        self._copies += 1
        target, threads = self._folder / f"{self._copies}.opl", _threads(os.getpid())
        reader = osmium.io.Reader(str(self.path), kinds, thread_pool=threads)
        writer = osmium.SimpleWriter(
            osmium.io.File(str(target), opl.WRITING), bufsz=_WRITTEN_AT_ONCE, thread_pool=threads
        )
        # The order matters: locations are looked up only for ways that have passed the filters before them, and every
        # node is located before most of them are dropped.
        of_ways = (*self._maybe_long,) if finder else (self._ways, *only)
        looked_at = (finder,) if finder else ()
        try:
            osmium.apply(reader, *of_ways, self._relations, self._locations, *looked_at, self._nodes, writer)
            writer.close()
        except BaseException:
            _end(writer)
            raise
        finally:
            reader.close()
        return target


@functools.cache
def _threads(process: int) -> Any:
    """One pool for all files of a process (a forked one has none of its parent's threads): a writer that failed keeps
    its pool, which then is no loss."""
    import osmium

    return osmium.io.ThreadPool(os.cpu_count() or 1)  # left to itself libosmium spares two cores


def _end(writer: Any) -> None:
    """Close it, with its thread and its file, after something else has failed.

    One that has itself failed cannot be closed, and libosmium ends the whole process where such a one is destructed,
    so that it is kept for ever.
    """
    try:
        writer.close()
    except (RuntimeError, ValueError, IndexError):
        ctypes.pythonapi.Py_IncRef(ctypes.py_object(writer))


def _is_large(path: Path) -> bool:
    return path.stat().st_size >= _LARGE


def _check_room(path: Path, *, far_left_out: bool) -> None:
    """libosmium ends the whole process when a disk is full, so that is found out before."""
    folder = Path(tempfile.gettempdir())
    times = _COPY_OF_LARGE_TO_FILE if far_left_out else _COPY_TO_FILE
    times += _LOCATED_TO_FILE if _is_large(path) else 0
    needed, free = path.stat().st_size * times, shutil.disk_usage(folder).free
    if free < needed:
        raise UserError(
            f"{folder}: {free / 1e6:.0f} MB free, but copying the roads of {path} may take {needed / 1e6:.0f} MB; "
            "make room, or set TMPDIR to a folder that has it"
        )


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
    except (RuntimeError, ValueError, IndexError, OverflowError, osmium.InvalidLocationError) as error:
        # libosmium's exceptions have no common base (text cut off within a character is an IndexError); Arrow's for ids
        # beyond 64 bits is a ValueError.
        said = str(error)[:_SAID]
        raise UnreadableMapError(
            f"{path}: cannot be read as OSM data ({said}); expected .osm, .osm.gz, .osm.bz2 or .osm.pbf, whole"
        ) from error
