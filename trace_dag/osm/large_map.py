"""A large map file, as the public servers have them, and what is kept of it: its first look, pieces around sites.

Both are stored with the crashes, below ``cache/maps``, by the file's SHA-256 and the version of the code that made
them, so that all workers find them. What is not needed any more is deleted (:func:`unused`), and all of it can be.
"""

from __future__ import annotations

import hashlib
import io
import time
import zlib
from collections.abc import Collection, Iterable, Sequence
from contextlib import suppress
from dataclasses import astuple, dataclass
from functools import cache
from itertools import chain
from pathlib import Path
from typing import TYPE_CHECKING, Final, NamedTuple

from trace_dag.code_versions import code_version
from trace_dag.osm.collecting import Collector, FilePass
from trace_dag.osm.types import BoundingBox

if TYPE_CHECKING:
    from trace_dag.osm.extraction import FileHeader
    from trace_dag.storage import Storage

FOLDER: Final = "cache/maps"
_WORK: Final = "cache/map-work"  # of the local folder: what passes under way have so far
_DIGITS: Final = 24  # of a SHA-256
_PIECE: Final = ".piece"
_LEFT_ALONE_S: Final = 7 * 86_400.0
_FASTEST: Final = 1  # level of zlib: a piece is read once


class Around(NamedTuple):
    """A site, the box around it in which roads are wanted, and the nearer one for things beside them."""

    key: str
    box: BoundingBox
    nearer: BoundingBox


@dataclass(frozen=True)
class LargeMap:
    """A large file that is sorted and says what it covers. ``digest`` is its SHA-256, ``storage`` where pieces lie."""

    path: Path
    header: FileHeader
    digest: str
    storage: Storage

    def work_folder(self, what: str) -> Path:
        """Where a pass over it keeps what it has so far, on this machine."""
        return self.storage.local_folder / _WORK / f"{self.digest[:_DIGITS]}-{what}"

    def name(self, what: str) -> str:
        """The name in storage of something that is kept of it."""
        return f"{FOLDER}/{self.digest[:_DIGITS]}-{_code()}-{what}"

    def remove_of_other_code(self) -> None:
        """Delete what other versions of the code have kept of it."""
        start = f"{FOLDER}/{self.digest[:_DIGITS]}-"
        for name in self.storage.list(FOLDER):
            if name.startswith(start) and not name.startswith(self.name("")):
                self.storage.delete(name)

    def keep_piece(self, around: Around, lines: Iterable[bytes], *, service_roads: bool) -> None:
        """Store the lines around a site."""
        data = zlib.compress(b"".join(lines), _FASTEST)
        self.storage.write(self._piece(around, service_roads=service_roads), data)

    def pieces(self, sites: Sequence[Around], *, service_roads: bool) -> list[list[bytes]]:
        """The lines around those of some sites whose pieces are stored."""
        names = [self._piece(each, service_roads=service_roads) for each in sites]
        found = []
        for data in self.storage.read_many(names).values():
            with suppress(zlib.error):  # damaged: it is made again
                found.append(zlib.decompress(data).splitlines(keepends=True))
        return found

    def without_piece(self, sites: Iterable[Around], *, service_roads: bool) -> list[Around]:
        """Those of some sites whose pieces are not stored."""
        there = self.storage.list(FOLDER, (_PIECE,))
        return [each for each in sites if self._piece(each, service_roads=service_roads) not in there]

    def _piece(self, around: Around, *, service_roads: bool) -> str:
        holds = f"{astuple(around.box)} {astuple(around.nearer)} {service_roads}"
        return self.name(f"{around.key}-{hashlib.sha256(holds.encode()).hexdigest()[:8]}{_PIECE}")


def collected(large: LargeMap, sites: Sequence[Around], *, service_roads: bool) -> FilePass | None:
    """What a pass over the file finds around some sites, from their pieces; None if one has none.

    >>> import tempfile
    >>> from trace_dag.storage import Storage
    >>> with tempfile.TemporaryDirectory() as folder:
    ...     large = LargeMap(Path("no-such-map.osm.pbf"), None, "0" * 64, Storage(folder))
    ...     collected(large, [Around("2023-319003", extract.box, extract.box)], service_roads=True)
    """
    pieces = large.pieces(sites, service_roads=service_roads)
    if len(pieces) < len(sites):
        return None
    collector = Collector(
        [each.box for each in sites],
        [each.nearer for each in sites],
        measure_bounds=False,
        service_roads=service_roads,
    )
    collector.read(io.BytesIO(b"".join(dict.fromkeys(chain.from_iterable(pieces)))))  # neighbours share lines
    return collector.found()


def remove_pieces(storage: Storage, keys: Collection[str]) -> None:
    """Delete the pieces of some sites, out of all maps: their extracts are stored, or will never be asked for.

    >>> import tempfile
    >>> from trace_dag.storage import Storage
    >>> with tempfile.TemporaryDirectory() as folder:
    ...     large = LargeMap(Path("no-such-map.osm.pbf"), None, "0" * 64, Storage(folder))
    ...     sites = [Around("2023-319003", extract.box, extract.box)]
    ...     large.keep_piece(sites[0], [], service_roads=True)
    ...     remove_pieces(large.storage, {"2023-319003"})
    ...     len(large.without_piece(sites, service_roads=True))
    1
    """
    for name in storage.list(FOLDER, (_PIECE,)):
        if name.rsplit("/", 1)[-1].split("-", 2)[2].rpartition("-")[0] in keys:
            storage.delete(name)


def unused(storage: Storage, digests: Collection[str]) -> tuple[list[str], list[Path]]:
    """What was kept of maps that have none of these digests, or by passes that nobody went on with for a week: names in
    storage, and files and folders here.

    >>> import tempfile
    >>> from trace_dag.storage import Storage
    >>> with tempfile.TemporaryDirectory() as folder:
    ...     unused(Storage(folder), [])
    ([], [])
    """
    starts = {digest[:_DIGITS] for digest in digests}
    names = [name for name in storage.list(FOLDER) if name.rsplit("/", 1)[-1].partition("-")[0] not in starts]
    work = storage.local_folder / _WORK
    found = sorted(work.iterdir()) if work.is_dir() else []
    old_s = time.time() - _LEFT_ALONE_S
    return names, [
        each
        for each in found
        if each.name.partition("-")[0] not in starts or (each.is_dir() and each.stat().st_mtime < old_s)
    ]


@cache
def _code() -> str:
    return code_version(("trace_dag.osm.dividing",)).digest[-8:]
