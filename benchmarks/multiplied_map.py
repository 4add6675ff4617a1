"""A map file of any size: copies of small ones beside each other, with ids and places of their own.

Works on the blocks of the PBF format (https://wiki.openstreetmap.org/wiki/PBF_Format): a block of nodes is moved by its
offsets of latitude and longitude and the first of its ids, which all others are differences to; of each way and
relation the first ids are written anew. These have room for any id, so that numpy writes those of a copy over those of
the one before, and a gigabyte takes some 20 CPU s. Before that the ids of each file are brought closer together, with
gaps of at most 64, so that those of all copies are as many as OpenStreetMap's are. Files that are not sorted by type
are left out: nodes have to come before ways.
"""

from __future__ import annotations

import struct
import zlib
from collections.abc import Callable, Iterator, Sequence
from pathlib import Path
from typing import BinaryIO

import deflate
import numpy as np
import numpy.typing as npt
import osmium

from trace_dag.osm.extraction import read_header
from trace_dag.osm.segments import varint
from trace_dag.osm.types import BoundingBox

_WIDEST_GAP = 64  # between ids
_NANODEGREES = 10**9
_ROWS = 12  # and more where there is no room for the copies else
_ROW_DEG = 340.0  # length of a row
_PRIMITIVE_GROUP, _LAT_OFFSET, _LON_OFFSET = 2, 19, 20  # PrimitiveBlock
_DENSE, _WAYS, _RELATIONS = 2, 3, 4  # PrimitiveGroup
_REFS = {_WAYS: 8, _RELATIONS: 9}  # packed ids, each the difference to the one before
_ID = 1
_HEADER_BOX = 1  # of the HeaderBlock
_ID_BYTES = 6  # of a number of 42 bits: twice an id

_Field = tuple[int, int, bytes]  # number, wire type, value as it stands (with its length where it has one)


def multiply_map(
    files: Sequence[Path], target: Path, least_bytes: int, last_id: int = 0, *, first_in_place: bool = False
) -> list[BoundingBox]:
    """Write ``target`` with as many copies of all the files as make it that large; where each copy lies.

    With ``last_id`` the copies are spread over the ids up to there, as a country's are over all ids there are. With
    ``first_in_place`` the first copy of each file is not moved: crashes find their maps in it.
    """
    sources = [(file, header.box) for file in files if (header := read_header(file)).sorted_by_type and header.box]
    copies = -(-least_bytes // sum(file.stat().st_size for file, _ in sources))
    blocks = {file: _Blocks(file) for file, _ in sources}
    # From each copy to the next, a little more than the largest file covers.
    apart_deg = 1.1 * max(max(box.north_deg - box.south_deg, box.east_deg - box.west_deg) for _, box in sources)
    rows = max(_ROWS, -(-copies * len(sources) // int(_ROW_DEG / apart_deg)))
    apart = last_id // (copies * len(sources))
    moves = [_moved(at, box, rows, apart_deg) for at, (_, box) in enumerate(sources * copies)]
    if first_in_place:
        moves[: len(sources)] = [(0.0, 0.0)] * len(sources)
    places = [_box_moved(box, *move) for (_, box), move in zip(sources * copies, moves, strict=True)]
    with target.open("wb") as out:
        _write_blob(out, b"OSMHeader", _header(places))
        for kind in (_DENSE, _WAYS, _RELATIONS):
            ids = 0
            for (file, _), move in zip(sources * copies, moves, strict=True):
                for block in blocks[file].of_kind(kind):
                    _write_blob(out, b"OSMData", block(ids, *move))
                ids += max(blocks[file].ids, apart)
    return places


def as_sorted_pbf(file: Path, folder: Path) -> Path:
    """A file, or the same as ``.osm.pbf`` with a header that says so where it is XML."""
    if file.name.endswith(".pbf"):
        return file
    box = read_header(file).box
    if box is None:
        raise ValueError(f"{file} does not say what it covers")
    header = osmium.io.Header()
    header.set("sorting", "Type_then_ID")
    header.add_box(osmium.osm.Box(box.west_deg, box.south_deg, box.east_deg, box.north_deg))
    made = folder / f"{file.name.partition('.')[0]}.osm.pbf"
    with osmium.SimpleWriter(str(made), header=header) as writer:
        osmium.apply(str(file), writer)
    return made


def _moved(at: int, box: BoundingBox, rows: int, apart_deg: float) -> tuple[float, float]:
    """How far to the north and east a copy has to go for its place on a chessboard."""
    column, row = divmod(at, rows)
    south_deg, west_deg = (row - rows / 2) * apart_deg, -179.0 + column * apart_deg
    return round(south_deg - box.south_deg, 6), round(west_deg - box.west_deg, 6)


def _box_moved(box: BoundingBox, north_deg: float, east_deg: float) -> BoundingBox:
    return BoundingBox(
        box.south_deg + north_deg, box.west_deg + east_deg, box.north_deg + north_deg, box.east_deg + east_deg
    )


_Moving = Callable[[int, float, float], bytes]
_Ids = npt.NDArray[np.int64]


class _Blocks:
    """The blocks of a file, as functions of ids to add and degrees north and east.

    ``ids`` is how many ids they span.
    """

    def __init__(self, file: Path) -> None:
        parsed = [list(_fields(data)) for data in _data_blobs(file)]
        known = np.unique(np.concatenate([ids for fields in parsed for ids in _all_ids(fields)]))
        closer = np.cumsum(np.minimum(np.diff(known, prepend=0), _WIDEST_GAP))
        self.ids = int(closer[-1])
        self._by_kind: dict[int, list[_Moving]] = {}
        for fields in parsed:
            self._by_kind.setdefault(_kind(fields), []).append(
                _moving(fields, lambda ids: closer[np.searchsorted(known, ids)])
            )

    def of_kind(self, kind: int) -> list[_Moving]:
        """Those that hold one type."""
        return self._by_kind.get(kind, [])


def _all_ids(fields: Sequence[_Field]) -> Iterator[_Ids]:
    for number, _, group in fields:
        if number == _PRIMITIVE_GROUP:
            for kind, _, value in _fields(_content(group)):
                for field, wire, of_it in _fields(_content(value)):
                    if field == _ID:
                        yield _differences(_content(of_it)).cumsum() if wire == 2 else np.array([varint(of_it, 0)[0]])
                    elif field == _REFS.get(kind):
                        yield _differences(_content(of_it)).cumsum()


def _differences(packed: bytes) -> _Ids:
    """The numbers of a packed field of zigzag numbers."""
    data = np.frombuffer(packed, np.uint8)
    starts = np.flatnonzero(np.concatenate([[True], data[:-1] < 128])) if len(data) else np.empty(0, np.int64)
    places = np.arange(len(data)) - np.repeat(starts, np.diff(starts, append=len(data)))
    parts = (data & 127).astype(np.uint64) << (7 * places).astype(np.uint64)
    values = np.add.reduceat(parts, starts) if len(data) else parts
    return (values >> np.uint64(1)).astype(np.int64) ^ -(values & np.uint64(1)).astype(np.int64)


def _kind(fields: Sequence[_Field]) -> int:
    group = next(_content(value) for number, _, value in fields if number == _PRIMITIVE_GROUP)
    return next(number for number, _, _ in _fields(group))


def _moving(fields: Sequence[_Field], closer: Callable[[_Ids], _Ids]) -> _Moving:
    body = _Template()
    offsets = {_LAT_OFFSET: 0, _LON_OFFSET: 0}
    for number, wire, value in fields:
        if number == _PRIMITIVE_GROUP:
            group = _Template()
            for kind, _, message in _fields(_content(value)):
                group.add_long(kind, _with_places(kind, _content(message), closer))
            body.add_long(number, group)
        elif number in offsets:
            offsets[number] = varint(value, 0)[0]
        else:
            body.add(_tag(number, wire) + value)
    made = body.writer()

    def moved(ids: int, north_deg: float, east_deg: float) -> bytes:
        after = b""
        for number, degrees in ((_LAT_OFFSET, north_deg), (_LON_OFFSET, east_deg)):
            offset = offsets[number] + round(degrees * _NANODEGREES)
            after += _tag(number, 0) + _written(offset % 2**64)
        return made(ids) + after

    return moved


class _Template:
    """A message in which numbers stand that ids are added to, each written in as many bytes as any id needs."""

    def __init__(self) -> None:
        self.data = bytearray()
        self.places: list[int] = []
        self.numbers: list[int] = []
        self.zigzag: list[bool] = []

    def add(self, data: bytes) -> None:
        self.data += data

    def add_id(self, number: int, *, zigzag: bool) -> None:
        self.places.append(len(self.data))
        self.numbers.append(number)
        self.zigzag.append(zigzag)
        self.data += bytes(_ID_BYTES)

    def add_long(self, number: int, message: _Template) -> None:
        """Add another as a field."""
        self.data += _tag(number, 2) + _written(len(message.data))
        self.places += [len(self.data) + place for place in message.places]
        self.numbers += message.numbers
        self.zigzag += message.zigzag
        self.data += message.data

    def writer(self) -> Callable[[int], bytes]:
        """The message as a function of the number that is added to its ids."""
        data = np.frombuffer(self.data, np.uint8).copy()
        numbers, places = np.array(self.numbers, np.int64), np.array(self.places, np.int64)
        times = np.where(self.zigzag, 2, 1)  # zigzag doubles what is not negative

        def made(ids: int) -> bytes:
            left = (numbers + ids) * times
            for place in range(_ID_BYTES):
                more = 128 if place + 1 < _ID_BYTES else 0
                data[places + place] = left & 127 | more
                left >>= 7
            return data.tobytes()

        return made


def _with_places(kind: int, message: bytes, closer: Callable[[_Ids], _Ids]) -> _Template:
    """A message of a group, with places for the ids in it."""
    made = _Template()
    packed_field = _ID if kind == _DENSE else _REFS[kind]
    for number, wire, value in _fields(message):
        if number == packed_field and _content(value):
            first, *others = np.diff(closer(_differences(_content(value)).cumsum()), prepend=0).tolist()
            ids = _Template()
            ids.add_id(first, zigzag=True)
            ids.add(b"".join(map(_written, map(_zigzag, others))))
            made.add_long(number, ids)
        elif number == _ID:
            made.add(_tag(number, wire))
            made.add_id(int(closer(np.array([varint(value, 0)[0]]))[0]), zigzag=False)
        else:
            made.add(_tag(number, wire) + value)
    return made


def _header(places: Sequence[BoundingBox]) -> bytes:
    """What the blocks cover, that they are as they are, and sorted."""
    edges = (
        min(box.west_deg for box in places),
        max(box.east_deg for box in places),
        max(box.north_deg for box in places),
        min(box.south_deg for box in places),
    )
    box = b"".join(
        _tag(number, 0) + _written(_zigzag(round(edge * _NANODEGREES))) for number, edge in enumerate(edges, start=1)
    )
    features = [(4, b"OsmSchema-V0.6"), (4, b"DenseNodes"), (5, b"Sort.Type_then_ID"), (16, b"trace-dag benchmarks")]
    return _long(_HEADER_BOX, box) + b"".join(_long(number, text) for number, text in features)


def _write_blob(out: BinaryIO, kind: bytes, data: bytes) -> None:
    blob = _tag(2, 0) + _written(len(data)) + _long(3, bytes(deflate.zlib_compress(data, 1)))
    header = _long(1, kind) + _tag(3, 0) + _written(len(blob))
    out.write(struct.pack(">I", len(header)) + header + blob)


def _data_blobs(file: Path) -> Iterator[bytes]:
    with file.open("rb") as stream:
        while size := stream.read(4):
            header = {number: value for number, _, value in _fields(stream.read(struct.unpack(">I", size)[0]))}
            blob = {number: value for number, _, value in _fields(stream.read(varint(header[3], 0)[0]))}
            if _content(header[1]) == b"OSMData":
                yield zlib.decompress(_content(blob[3])) if 3 in blob else _content(blob[1])


# --- Protocol buffers (https://protobuf.dev/programming-guides/encoding) ---------------------------------------------
def _fields(message: bytes) -> Iterator[_Field]:
    at = 0
    while at < len(message):
        tag, at = varint(message, at)
        start = at
        value, at = varint(message, at)
        if tag & 7 == 2:
            at += value
        yield tag >> 3, tag & 7, message[start:at]


def _content(value: bytes) -> bytes:
    return value[varint(value, 0)[1] :]


def _long(number: int, content: bytes) -> bytes:
    return _tag(number, 2) + _written(len(content)) + content


def _tag(number: int, wire: int) -> bytes:
    return _written(number << 3 | wire)


def _written(value: int) -> bytes:
    out = bytearray()
    while value > 127:
        out.append(value & 127 | 128)
        value >>= 7
    out.append(value)
    return bytes(out)


def _zigzag(value: int) -> int:
    return value << 1 if value >= 0 else (-value << 1) - 1
