"""What every later pass over a large map file needs to know, found when the file is first read: its long ways
(:mod:`trace_dag.osm.long_ways`), where its nodes end, and whether it is sorted as it says.

The file is read in segments. What was found is noted on the way, so that a reading that was interrupted goes on.
"""

from __future__ import annotations

import io
import os
import time
from dataclasses import dataclass
from typing import Final

import numpy as np

from trace_dag.file_locks import locked
from trace_dag.osm.copying import locations_in, may_be_long, reading, threads
from trace_dag.osm.extraction import LOCATED_TO_FILE, check_room
from trace_dag.osm.large_map import LargeMap
from trace_dag.osm.long_ways import COLUMNS, LongWayFinder, LongWays
from trace_dag.osm.near_nodes import ROWS
from trace_dag.osm.plausibility import UnreadableMapError
from trace_dag.osm.segments import Segments
from trace_dag.osm.work_folder import WorkFolder
from trace_dag.progress import MapListener, MapProgress, unheard

NOTE_EVERY_S: Final = 5.0
_NAME: Final = "first-look.npz"


@dataclass(frozen=True)
class FirstLook:
    """``nodes_end`` is the place in the file, bytes, behind the segment with its last node. ``sorted`` is False where
    nodes are not in order or come after ways, whatever the file says; the rest then means nothing."""

    long: LongWays
    nodes_end: int
    sorted: bool


def first_look(large: LargeMap, tell: MapListener = unheard) -> FirstLook:
    """The first look at a file, taken now if it was not before.

    Raises :class:`UnreadableMapError` for a file that cannot be read to its end, :class:`trace_dag.errors.UserError` if
    there is no room for the places of its nodes.

    >>> import osmium, tempfile
    >>> from pathlib import Path
    >>> from trace_dag.osm.extraction import read_header
    >>> nodes = '<node id="1" lat="41" lon="-101"/><node id="2" lat="41" lon="-100.999"/>'
    >>> way = '<way id="7"><nd ref="1"/><nd ref="2"/><tag k="highway" v="primary"/></way>'
    >>> from trace_dag.storage import Storage
    >>> with tempfile.TemporaryDirectory() as folder:
    ...     xml, file = Path(folder) / "town.osm", Path(folder) / "town.osm.pbf"
    ...     _ = xml.write_text(f'<osm version="0.6">{nodes}{way}</osm>')
    ...     with osmium.SimpleWriter(str(file)) as writer:
    ...         osmium.apply(str(xml), writer)
    ...     first_look(LargeMap(file, read_header(file), "0" * 64, Storage(folder))).sorted
    True
    """
    work = large.work_folder("first-look")
    work.parent.mkdir(mode=0o700, parents=True, exist_ok=True)
    with locked(work.with_suffix(".lock")), reading(large.path):
        found = _noted(large)
        if found is None:
            large.remove_of_other_code()
            found = _taken(large, tell)
            stream = io.BytesIO()
            np.savez_compressed(stream, long=found.long, facts=np.array([found.nodes_end, found.sorted]))
            large.storage.write(large.name(_NAME), stream.getvalue())
    return found


def _noted(large: LargeMap) -> FirstLook | None:
    try:
        with np.load(io.BytesIO(large.storage.read(large.name(_NAME))), allow_pickle=False) as noted:
            nodes_end, in_order = noted["facts"].tolist()
            return FirstLook(noted["long"], nodes_end, bool(in_order))
    except (FileNotFoundError, OSError, ValueError, KeyError, EOFError):
        return None


def _taken(large: LargeMap, tell: MapListener) -> FirstLook:
    import osmium

    check_room(large.path, LOCATED_TO_FILE, large.work_folder("first-look").parent)
    segments = Segments.of(large.path)
    with WorkFolder(large.work_folder("first-look"), f"{large.name('')} {segments.ends}") as work:
        located = work.path("locations")
        locations, table = locations_in(f"sparse_file_array,{located}")
        finder, maybe_long = LongWayFinder(), may_be_long()
        facts = {"nodes_end": segments.ends[0], "ways": False, "last": -1, "sorted": True, **work.facts}
        noted_s = time.monotonic()
        for index in range(work.done, len(segments)):
            before, finder.seen = table.used_memory(), False
            kinds = osmium.osm.NODE | osmium.osm.WAY | osmium.osm.RELATION
            with segments.reader(index, kinds, threads(os.getpid())) as reader:
                osmium.apply(reader, *maybe_long, locations, finder)
            if (after := table.used_memory()) > before:
                ids = np.memmap(located, ROWS, mode="r")[before // ROWS.itemsize : after // ROWS.itemsize]["id"]
                in_order = int(ids[0]) > facts["last"] and bool((ids[1:] > ids[:-1]).all())
                facts["sorted"] &= in_order and not facts["ways"]
                facts |= {"last": int(ids[-1]), "nodes_end": segments.ends[index + 1]}
            facts["ways"] |= finder.seen
            if finder.negative:
                raise UnreadableMapError(f"{large.path}: has ids below 0; save it as .osm, where they are read")
            work.append("long", finder.take().tobytes())
            if not facts["sorted"]:
                break
            tell(MapProgress(large.path.name, segments.ends[index + 1], segments.ends[-1]))
            if index + 1 == len(segments) or time.monotonic() - noted_s >= NOTE_EVERY_S:
                work.note(index + 1, facts, {"locations": after} if after else {})
                noted_s = time.monotonic()
        del locations, table
        long = np.fromfile(work.path("long"), COLUMNS) if work.path("long").exists() else np.empty(0, COLUMNS)
        found = FirstLook(long, facts["nodes_end"], bool(facts["sorted"]))
        work.remove()
    return found
