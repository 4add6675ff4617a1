"""All sites of a batch out of one OSM file, in one pass over it.

Any format libosmium reads (``.osm``, ``.osm.gz``, ``.osm.bz2``, ``.osm.pbf``), sorted or not. libosmium filters
objects, locates their nodes and copies them to a file of lines (:mod:`trace_dag.osm.copying`). Arrow then reads the
places of tens of thousands of ways at once, an index finds those near a site, and only their lines become objects
(:mod:`trace_dag.osm.collecting`). So the time is close to that of reading the file and hardly depends on the number of
sites. Memory holds what lies around the sites, and the locations of nodes: 16 bytes each, those of a large file in a
file of the temporary folder.

Of a large file, as the public servers have them, the pieces around all sites are cut first, which takes less time and
memory: :mod:`trace_dag.osm.dividing`. Cutting the ways at the boxes is :mod:`trace_dag.osm.cutting`'s task, choosing
the file :mod:`trace_dag.osm.catalog`'s.
"""

from __future__ import annotations

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
from trace_dag.osm.collecting import Collector, FilePass
from trace_dag.osm.copying import Filters, copy, locations_in, reading, threads
from trace_dag.osm.plausibility import UnreadableMapError, with_positive_ids, xml_opener
from trace_dag.osm.rights import OSM_ATTRIBUTION, read_attribution
from trace_dag.osm.types import BoundingBox

LOCATED_TO_FILE: Final = 3
"""Size of the located nodes to that of the map; 1.7 is usual for the densest kind, ``.osm.pbf``."""
_COPY_TO_FILE: Final = 10  # size of the copy to that of the file; 9 is usual for the densest kind, .osm.pbf
_LARGE: Final = 5 * 10**7  # bytes


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

    with reading(path), _reader(path, osmium.osm.NOTHING) as reader:
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

    times = _COPY_TO_FILE + (LOCATED_TO_FILE if is_large(path) else 0)
    check_room(path, times, Path(tempfile.gettempdir()), "make room, or set TMPDIR to a folder that has it")
    with tempfile.TemporaryDirectory(prefix="trace-dag-") as folder, reading(path), no_garbage_collection():
        collector = Collector(boxes, nearer, measure_bounds=header.box is None, service_roads=service_roads)
        filters = Filters(with_surroundings=bool(nearer), service_roads=service_roads)
        located, copied = Path(folder) / "locations", Path(folder) / "copy.opl"
        locations, _ = locations_in(f"sparse_file_array,{located}" if is_large(path) else "flex_mem")
        with _reader(path, osmium.osm.NODE | osmium.osm.WAY | osmium.osm.RELATION) as reader:
            copy(reader, copied, (filters.ways, filters.relations, locations, filters.nodes))
        with copied.open("rb") as lines:
            collector.read(lines)
        if collector.near.incomplete and not header.sorted_by_type:
            # Again, now that every node of the file is located.
            collector.forget_ways()
            with _reader(path, osmium.osm.WAY) as reader:
                copy(reader, copied, (filters.ways, locations))
            with copied.open("rb") as lines:
                collector.read(lines)
        return collector.found(), collector.near.negative


def is_large(path: Path) -> bool:
    """Whether the nodes of a file are located in a file.

    >>> with tempfile.NamedTemporaryFile() as town:
    ...     is_large(Path(town.name))
    False
    """
    return path.stat().st_size >= _LARGE


def is_divisible(path: Path, header: FileHeader) -> bool:
    """Whether a file is large, and sorted as those of the public servers are: pieces are cut out of it first.

    >>> with tempfile.NamedTemporaryFile(suffix=".osm.pbf") as town:
    ...     is_divisible(Path(town.name), FileHeader(None, "", sorted_by_type=True))
    False
    """
    return is_large(path) and path.name.endswith(".pbf") and header.sorted_by_type and header.box is not None


@contextmanager
def _reader(path: Path, kinds: Any) -> Iterator[Any]:
    import osmium

    reader = osmium.io.Reader(str(path), kinds, thread_pool=threads(os.getpid()))
    try:
        yield reader
    finally:
        reader.close()


def check_room(path: Path, times: float, folder: Path, remedy: str = "make room there") -> None:
    """Raise :class:`UserError` where a folder has no room for so many times the size of a map file.

    libosmium ends the whole process when a disk is full, so that is found out before.

    >>> with tempfile.NamedTemporaryFile() as town:
    ...     check_room(Path(town.name), 10, Path(town.name).parent)  # an empty file needs none
    """
    needed, free = path.stat().st_size * times, shutil.disk_usage(folder).free
    if free < needed:
        raise UserError(
            f"{folder}: {free / 1e6:.0f} MB free, but copying the roads of {path} may take {needed / 1e6:.0f} MB; "
            f"{remedy}"
        )
