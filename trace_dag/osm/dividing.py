"""The pieces of a large map file around many sites, in one pass over it that goes on where it was interrupted.

The nodes come first in the file: libosmium locates them, and numpy finds those near a site
(:mod:`trace_dag.osm.near_nodes`). Of the ways behind them only those that have such a node or are long
(:mod:`trace_dag.osm.long_ways`) are copied and looked at. What overlaps the boxes of a site is its piece: the lines
from which its extract is cut as from a file of its own (:mod:`trace_dag.osm.collecting`), so that no later reading
needs more than the piece. Memory holds the set of near nodes (at most 1.6 GB for ids as OpenStreetMap has them) and
what lies around some hundred sites, whatever the size of the file and the number of sites.
"""

from __future__ import annotations

import json
import os
import re
import time
from collections.abc import Sequence
from dataclasses import astuple
from itertools import chain, groupby
from operator import itemgetter
from pathlib import Path
from typing import Any, Final

import numpy as np
import osmium

from trace_dag.file_locks import locked
from trace_dag.osm import first_look, opl
from trace_dag.osm.copying import Filters, copy, locations_in, reading, threads
from trace_dag.osm.extraction import LOCATED_TO_FILE, check_room
from trace_dag.osm.large_map import Around, LargeMap
from trace_dag.osm.long_ways import nodes_of_overlapping
from trace_dag.osm.near_lines import NearLines
from trace_dag.osm.near_nodes import near_node_ids, set_of
from trace_dag.osm.opl import IntArray, Lines
from trace_dag.osm.segments import Segments
from trace_dag.osm.types import BoundingBox
from trace_dag.osm.work_folder import WorkFolder
from trace_dag.progress import MapListener, MapProgress, unheard

_TOGETHER: Final = 500  # sites whose pieces are held in memory
_LINES_TO_FILE: Final = 2  # size of the lines kept to that of the file; 1 is usual for a region full of sites
_ROWS_PER_DEG: Final = 5
# Files of the work folder.
_LOCATED, _COPY, _RESTRICTIONS, _SITES = "locations", "copy.opl", "restrictions", "sites"
_WAY_MEMBER: Final = re.compile(rb"[M,]w(\d+)@")


def divide(large: LargeMap, sites: Sequence[Around], *, service_roads: bool, tell: MapListener = unheard) -> bool:
    """Store the piece of the file around each site that has none. False where the file is not sorted as it says: then
    nothing is stored.

    Raises as :func:`trace_dag.osm.first_look.first_look`.

    >>> import tempfile
    >>> from trace_dag.osm.extraction import read_header
    >>> from trace_dag.osm.large_map import collected
    >>> nodes = '<node id="1" lat="41" lon="-101"/><node id="2" lat="41" lon="-100.999"/>'
    >>> way = '<way id="7"><nd ref="1"/><nd ref="2"/><tag k="highway" v="primary"/></way>'
    >>> from trace_dag.storage import Storage
    >>> with tempfile.TemporaryDirectory() as folder:
    ...     xml, file = Path(folder) / "town.osm", Path(folder) / "town.osm.pbf"
    ...     _ = xml.write_text(f'<osm version="0.6">{nodes}{way}</osm>')
    ...     with osmium.SimpleWriter(str(file)) as writer:
    ...         osmium.apply(str(xml), writer)
    ...     large = LargeMap(file, read_header(file), "0" * 64, Storage(folder))
    ...     box = BoundingBox(40.99, -101.01, 41.01, -100.99)
    ...     done = divide(large, [Around("2023-319003", box, box)], service_roads=True)
    ...     done, list(collected(large, [Around("2023-319003", box, box)], service_roads=True).ways[0])
    (True, [7])
    """
    look = first_look.first_look(large, tell)
    if not look.sorted:
        return False
    work = large.work_folder("pieces")
    with locked(work.with_suffix(".lock")), reading(large.path):
        wanted = large.without_piece(sites, service_roads=service_roads)
        if wanted:
            check_room(large.path, LOCATED_TO_FILE + _LINES_TO_FILE, work.parent)
            segments = Segments.of(large.path)
            with WorkFolder(work, f"{large.name('')} {segments.ends} {service_roads}") as folder:
                _Division(large, look, segments, folder, _sites_of(folder, wanted), service_roads, tell).run()
    return True


def _sites_of(folder: WorkFolder, wanted: Sequence[Around]) -> list[Around]:
    """The sites of the pass that was interrupted, if those wanted are among them; else those wanted, neighbours one
    after the other."""
    noted = folder.path(_SITES)
    if folder.done and noted.exists():
        rows = json.loads(noted.read_bytes())
        sites = [Around(key, BoundingBox(*box), BoundingBox(*nearer)) for key, box, nearer in rows]
        by_key = {each.key: each for each in sites}
        if all(by_key.get(each.key) == each for each in wanted):
            return sites
    folder.clear()
    sites = sorted(wanted, key=lambda each: (int(each.box.south_deg * _ROWS_PER_DEG), each.box.west_deg, each.key))
    folder.append(_SITES, json.dumps([(each.key, astuple(each.box), astuple(each.nearer)) for each in sites]).encode())
    return sites


class _Division:
    """One pass: a step for each segment with nodes, then for each with ways or relations, then for some sites each."""

    def __init__(
        self,
        large: LargeMap,
        look: first_look.FirstLook,
        segments: Segments,
        work: WorkFolder,
        sites: Sequence[Around],
        service_roads: bool,
        tell: MapListener,
    ) -> None:
        self._large, self._look, self._segments, self._work, self._sites = large, look, segments, work, sites
        self._service_roads, self._tell = service_roads, tell
        self._with_nodes = sum(start < look.nodes_end for start in segments.ends[:-1])
        self._with_others = [index for index in range(len(segments)) if segments.ends[index + 1] >= look.nodes_end]
        self._filters = Filters(with_surroundings=True, service_roads=service_roads)
        self._near = NearLines(
            [each.box for each in sites], [each.nearer for each in sites], service_roads=service_roads
        )
        self._found = np.zeros(len(sites), dtype=bool)
        if "found" in work.facts:
            self._found[work.facts["found"]] = True

    def run(self) -> None:
        """All steps that are not done yet."""
        self._read()
        restrictions = _Restrictions(self._work.path(_RESTRICTIONS))
        for start in range(0, len(self._sites), _TOGETHER):
            step = self._with_nodes + len(self._with_others) + start // _TOGETHER
            if step >= self._work.done:
                self._store_pieces(start, restrictions)
                self._note(step + 1, located=0)
        self._work.remove()

    def _read(self) -> None:
        """The nodes, then the ways and the restrictions on turns."""
        locations, table = locations_in(f"sparse_file_array,{self._work.path(_LOCATED)}")
        steps = [*range(self._with_nodes), *self._with_others]
        noted_s = time.monotonic()
        for_others: list[Any] = []
        near: Any = None  # has to outlive the filter made of it
        for step in range(self._work.done, len(steps)):
            if step < self._with_nodes:
                self._read_segment(steps[step], osmium.osm.NODE, [locations, self._filters.nodes])
            else:
                if not for_others:
                    near = self._near_nodes()
                    only = []
                    if near is not None:
                        only = [near.contains_filter()]
                        only[0].enable_for(osmium.osm.WAY)  # it would ask restrictions for a near node, too
                    for_others = [self._filters.ways, *only, self._filters.relations, locations]
                self._read_segment(steps[step], osmium.osm.WAY | osmium.osm.RELATION, for_others)
            if step + 1 == len(steps) or time.monotonic() - noted_s >= first_look.NOTE_EVERY_S:
                self._note(step + 1, located=table.used_memory())
                noted_s = time.monotonic()

    def _near_nodes(self) -> Any:
        """libosmium's set of the nodes that a way has to have one of; None where that would be too large."""
        boxes = [box for each in self._sites for box in (each.box, each.nearer)]
        near = near_node_ids(self._work.path(_LOCATED), boxes)
        return set_of(chain(near, [nodes_of_overlapping(self._look.long, boxes)]))

    def _read_segment(self, index: int, kinds: Any, handlers: Sequence[Any]) -> None:
        """Keep those of its lines that are near a site, with the numbers of the sites before each."""
        copied = self._work.path(_COPY)
        with self._segments.reader(index, kinds, threads(os.getpid())) as reader:
            copy(reader, copied, handlers)
        with copied.open("rb") as stream:
            for lines in opl.read_lines(stream):
                nodes = lines.of_kind("n")
                self._keep(nodes, *self._near.of_nodes(nodes))
                for near in self._near.of_ways(lines.of_kind("w")):
                    self._keep(near.lines, near.numbers, near.sites)
                    if near.roads:
                        self._found[near.sites] = True
                self._work.append(_RESTRICTIONS, b"".join(lines.of_kind("r")))
        self._tell(
            MapProgress(
                self._large.path.name,
                self._segments.ends[index + 1],
                self._segments.ends[-1],
                len(self._sites),
                int(self._found.sum()),
            )
        )

    def _keep(self, lines: Lines, numbers: IntArray, sites: IntArray) -> None:
        kept: dict[int, list[bytes]] = {}
        order = np.lexsort((sites, numbers))
        pairs = zip(numbers[order].tolist(), sites[order].tolist(), strict=True)
        for number, of_line in groupby(pairs, key=itemgetter(0)):
            for together, some in groupby((site for _, site in of_line), key=lambda site: site // _TOGETHER):
                kept.setdefault(together, []).append(b"%s %s" % (",".join(map(str, some)).encode(), lines[number]))
        for together, found in kept.items():
            self._work.append(f"sites-{together}", b"".join(found))

    def _note(self, done: int, *, located: int) -> None:
        self._work.note(done, {"found": np.flatnonzero(self._found).tolist()}, {_LOCATED: located})

    def _store_pieces(self, start: int, restrictions: _Restrictions) -> None:
        sites = self._sites[start : start + _TOGETHER]
        lines_of: list[list[bytes]] = [[] for _ in sites]
        kept = self._work.path(f"sites-{start // _TOGETHER}")
        if kept.exists():
            with kept.open("rb") as rows:
                for row in rows:
                    numbers, _, line = row.partition(b" ")
                    for number in numbers.split(b","):
                        lines_of[int(number) - start].append(line)
        for each, lines in zip(sites, lines_of, strict=True):
            ways = np.array([opl.read_id(line) for line in lines if line.startswith(b"w")], dtype=np.int64)
            self._large.keep_piece(each, [*lines, *restrictions.of(ways)], service_roads=self._service_roads)


class _Restrictions:
    """The lines of all restrictions on turns in a file, by the ways they speak of."""

    def __init__(self, path: Path) -> None:
        self._lines = path.read_bytes().splitlines(keepends=True) if path.exists() else []
        ways, rows = [], []
        for row, line in enumerate(self._lines):
            for way in _WAY_MEMBER.findall(line, line.rindex(b" M")):
                ways.append(int(way))
                rows.append(row)
        order = np.argsort(np.array(ways, dtype=np.int64), kind="stable")
        self._ways, self._rows = np.array(ways, dtype=np.int64)[order], np.array(rows, dtype=np.int64)[order]

    def of(self, ways: IntArray) -> list[bytes]:
        """The lines that speak of some of the ways, (n,) ids."""
        first, last = np.searchsorted(self._ways, ways), np.searchsorted(self._ways, ways, side="right")
        rows = {int(row) for a, b in zip(first, last, strict=True) if a < b for row in self._rows[a:b]}
        return [self._lines[row] for row in sorted(rows)]
