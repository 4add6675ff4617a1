"""All sites of a batch out of one OSM file, in one pass over it.

Any format libosmium reads (``.osm``, ``.osm.gz``, ``.osm.bz2``, ``.osm.pbf``), sorted or not. libosmium filters
objects, locates their nodes and copies them to a file of lines, all in C++, without a call into Python. Arrow then
reads the places of tens of thousands of ways at once, an index finds those near a site, and only their lines become
objects. So the time is close to that of reading the file and hardly depends on the number of sites. Memory holds what
lies around the sites, and the locations of nodes: 16 bytes each, of large files in a file of the temporary folder.

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
from trace_dag.osm.plausibility import UnreadableMapError, with_positive_ids, xml_opener
from trace_dag.osm.rights import OSM_ATTRIBUTION, read_attribution
from trace_dag.osm.surroundings import NODE_KEYS, WAY_KEYS
from trace_dag.osm.types import BoundingBox

_SAID: Final = 300  # characters of what libosmium says, which quotes what it does not like
_COPY_TO_FILE: Final = 4  # size of the copy to that of the file; 2 is usual for the densest kind, .osm.pbf
_LARGE: Final = 10**9  # bytes of a file whose nodes, a hundred million or more, are located in a file
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
    import osmium

    _check_room(path)
    with tempfile.TemporaryDirectory(prefix="trace-dag-") as folder, _reading(path), no_garbage_collection():
        collector = Collector(boxes, nearer, measure_bounds=header.box is None, service_roads=service_roads)
        kept_ways = ("highway", *WAY_KEYS) if nearer else road_tags(service_roads=service_roads)
        kept_nodes = tuple({*ROAD_NODE_KEYS, *NODE_KEYS} if nearer else ROAD_NODE_KEYS)
        kept_in = f"sparse_file_array,{folder}/locations" if _is_large(path) else "flex_mem"
        locations = osmium.NodeLocationsForWays(osmium.index.create_map(kept_in))
        locations.ignore_errors()

        def copy_roads(name: str, kinds: Any) -> Path:
            copy = Path(folder) / name
            threads = _threads(os.getpid())
            reader = osmium.io.Reader(str(path), kinds, thread_pool=threads)
            writer = osmium.SimpleWriter(
                osmium.io.File(str(copy), opl.WRITING), bufsz=_WRITTEN_AT_ONCE, thread_pool=threads
            )
            # The order matters: locations are looked up only for ways that have passed the filter before them, and
            # every node is located before most of them are dropped.
            try:
                osmium.apply(
                    reader,
                    _only_with(kept_ways, osmium.osm.WAY),
                    _only_with(("restriction",), osmium.osm.RELATION),
                    locations,
                    _only_with(kept_nodes, osmium.osm.NODE),
                    writer,
                )
                writer.close()
            except BaseException:
                _end(writer)
                raise
            finally:
                reader.close()
            return copy

        collector.read(copy_roads("first.opl", osmium.osm.ALL))
        if collector.incomplete and not header.sorted_by_type:
            # Again, now that every node of the file is located.
            collector.forget_ways()
            collector.read(copy_roads("again.opl", osmium.osm.WAY))
        return collector.found(), collector.negative


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


def _check_room(path: Path) -> None:
    """libosmium ends the whole process when a disk is full, so that is found out before."""
    folder = Path(tempfile.gettempdir())
    times = _COPY_TO_FILE + (_LOCATED_TO_FILE if _is_large(path) else 0)
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
