"""libosmium copies what may be kept of a map file to a file of lines: filters, threads, and its ways of failing.

All of it is C++, without a call into Python for each object.
"""

from __future__ import annotations

import ctypes
import functools
import os
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from pathlib import Path
from typing import Any, Final

from trace_dag.osm import opl
from trace_dag.osm.collecting import ROAD_NODE_KEYS
from trace_dag.osm.near_lines import road_tags
from trace_dag.osm.plausibility import UnreadableMapError
from trace_dag.osm.surroundings import LARGE_WAY_TAGS, NODE_KEYS, WAY_KEYS

_SAID: Final = 300  # characters of what libosmium says, which quotes what it does not like
_WRITTEN_AT_ONCE: Final = 2**20  # bytes: little enough for threads to write while the file is still being read


class Filters:
    """What is dropped without being looked at: ways, nodes and relations without the tags that are asked for."""

    def __init__(self, *, with_surroundings: bool, service_roads: bool) -> None:
        import osmium

        roads = road_tags(service_roads=service_roads)
        self.ways = _only_with(("highway", *WAY_KEYS) if with_surroundings else roads, osmium.osm.WAY)
        nodes = {*ROAD_NODE_KEYS, *NODE_KEYS} if with_surroundings else ROAD_NODE_KEYS
        self.nodes = _only_with(tuple(nodes), osmium.osm.NODE)
        self.relations = _only_with(("restriction",), osmium.osm.RELATION)


def may_be_long() -> list[Any]:
    """Filters for the ways that may pass a site, or lie around it, without a node near it.

    >>> len(may_be_long())
    2
    """
    import osmium

    return [
        _only_with(tuple({"highway", *dict(LARGE_WAY_TAGS)}), osmium.osm.WAY),
        _only_with([*road_tags(service_roads=True), *LARGE_WAY_TAGS], osmium.osm.WAY),
    ]


def locations_in(kept_in: str) -> tuple[Any, Any]:
    """What locates the nodes of ways, and its table, of one of libosmium's kinds.

    >>> import osmium
    >>> _, table = locations_in("flex_mem")
    >>> table.set(7, osmium.osm.Location(-101.5, 41.8))
    >>> table.get(7).lat
    41.8
    """
    import osmium

    table = osmium.index.create_map(kept_in)
    locations = osmium.NodeLocationsForWays(table)
    locations.ignore_errors()
    return locations, table


def copy(reader: Any, target: Path, handlers: Sequence[Any]) -> None:
    """Copy what a reader has and no handler drops.

    >>> import osmium, tempfile
    >>> with tempfile.TemporaryDirectory() as folder:
    ...     town, target = Path(folder) / "town.osm", Path(folder) / "town.opl"
    ...     _ = town.write_text('<osm version="0.6"><node id="7" lat="41" lon="-101"/></osm>')
    ...     copy(osmium.io.Reader(str(town)), target, [])
    ...     target.read_bytes().split()[0]
    b'n7'
    """
    import osmium

    target.unlink(missing_ok=True)  # libosmium refuses to write over a file
    writer = osmium.SimpleWriter(
        osmium.io.File(str(target), opl.WRITING), bufsz=_WRITTEN_AT_ONCE, thread_pool=threads(os.getpid())
    )
    try:
        osmium.apply(reader, *handlers, writer)
        writer.close()
    except BaseException:
        _end(writer)
        raise


@functools.cache
def threads(process: int) -> Any:
    """One pool for all files of a process (a forked one has none of its parent's threads): a writer that failed keeps
    its pool, which then is no loss.

    >>> threads(os.getpid()) is threads(os.getpid())
    True
    """
    import osmium

    return osmium.io.ThreadPool(os.cpu_count() or 1)  # left to itself libosmium spares two cores


@contextmanager
def reading(path: Path) -> Iterator[None]:
    """What libosmium and Arrow say of a file they cannot read becomes :class:`UnreadableMapError`.

    >>> with reading(Path("town.osm.pbf")):  # doctest: +ELLIPSIS
    ...     raise RuntimeError("PBF error: truncated data")
    Traceback (most recent call last):
    trace_dag.osm.plausibility.UnreadableMapError: town.osm.pbf: cannot be read as OSM data (PBF error: ...
    """
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


def _end(writer: Any) -> None:
    """Close it, with its thread and its file, after something else has failed.

    One that has itself failed cannot be closed, and libosmium ends the whole process where such a one is destructed,
    so that it is kept for ever.
    """
    try:
        writer.close()
    except (RuntimeError, ValueError, IndexError):
        ctypes.pythonapi.Py_IncRef(ctypes.py_object(writer))


def _only_with(tags: Sequence[str] | Sequence[tuple[str, str]], entity: Any) -> Any:
    """A filter that drops objects of one kind that have none of ``tags`` (keys, or keys with their values)."""
    from osmium.filter import KeyFilter, TagFilter

    only = (KeyFilter if isinstance(tags[0], str) else TagFilter)(*tags)
    only.enable_for(entity)
    return only
