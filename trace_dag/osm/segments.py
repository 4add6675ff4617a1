"""A ``.osm.pbf`` in segments of some tens of megabytes, each of which can be read by itself.

Such a file is a row of blobs, the first of which is its header; every other can be read with that header alone
(https://wiki.openstreetmap.org/wiki/PBF_Format). Only the sizes of the blobs are read here, the rest is libosmium's.
"""

from __future__ import annotations

import struct
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import Any, BinaryIO, Final

from trace_dag.osm.plausibility import UnreadableMapError

SEGMENT_BYTES: Final = 2**25
# The format's own limits.
_MOST_IN_BLOB_HEADER: Final = 64 * 1024
_MOST_IN_BLOB: Final = 32 * 1024 * 1024
_DATASIZE: Final = 3  # the field of a BlobHeader


@dataclass(frozen=True)
class Segments:
    """A file as segments. ``ends`` are places in the file, bytes: of the header, then of each segment."""

    path: Path
    ends: tuple[int, ...]

    @classmethod
    def of(cls, path: Path) -> Segments:
        """The segments of a file, of :data:`SEGMENT_BYTES` and the rest of a blob.

        Raises :class:`UnreadableMapError` for a file that is not a row of blobs.
        """
        with path.open("rb") as file:
            size = path.stat().st_size
            ends = [at := _end_of_blob(file, path, 0, size)]
            while at < size:
                at = _end_of_blob(file, path, at, size)
                if at - ends[-1] >= SEGMENT_BYTES or at == size:
                    ends.append(at)
        return cls(path, tuple(ends))

    def __len__(self) -> int:
        return len(self.ends) - 1

    def size(self, index: int) -> int:
        """Bytes of a segment."""
        return self.ends[index + 1] - self.ends[index]

    @contextmanager
    def reader(self, index: int, kinds: Any, threads: Any) -> Iterator[Any]:
        """An :class:`osmium.io.Reader` of one segment."""
        import osmium

        with self.path.open("rb") as file:
            data = file.read(self.ends[0])
            file.seek(self.ends[index])
            data += file.read(self.size(index))
        reader = osmium.io.Reader(osmium.io.FileBuffer(data, "pbf"), kinds, thread_pool=threads)
        try:
            yield reader
        finally:
            reader.close()


def _end_of_blob(file: BinaryIO, path: Path, start: int, size: int) -> int:
    file.seek(start)
    length = file.read(4)
    header_size = struct.unpack(">I", length)[0] if len(length) == 4 else 0
    header = file.read(header_size) if header_size <= _MOST_IN_BLOB_HEADER else b""
    blob_size = _blob_size(header) if header_size and len(header) == header_size else None
    if blob_size is None or blob_size > _MOST_IN_BLOB or start + 4 + header_size + blob_size > size:
        raise UnreadableMapError(f"{path}: cannot be read as OSM data (no whole blob at byte {start}); fetch it again")
    return start + 4 + header_size + blob_size


def _blob_size(header: bytes) -> int | None:
    """What a BlobHeader says (https://protobuf.dev/programming-guides/encoding); None if it is none.

    >>> _blob_size(bytes([0x0A, 7]) + b"OSMData" + bytes([0x18, 0x80, 0x01]))
    128
    """
    at, found = 0, None
    try:
        while at < len(header):
            tag, at = varint(header, at)
            value, at = varint(header, at)
            if tag & 7 == 2:
                at += value
            elif tag & 7 != 0:
                return None
            elif tag >> 3 == _DATASIZE:
                found = value
    except IndexError:
        return None
    return found


def varint(data: bytes, at: int) -> tuple[int, int]:
    """A number as Protocol Buffers writes it, and where it ends.

    >>> varint(bytes([0x96, 0x01]), 0)
    (150, 2)
    """
    value = shift = 0
    while True:
        byte = data[at]
        at += 1
        value |= (byte & 127) << shift
        if byte < 128:
            return value, at
        shift += 7
