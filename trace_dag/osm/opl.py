"""Reading OPL, libosmium's one-line-per-object text format, as far as roads need it.

libosmium writes an object as a line of text faster than Python can ask it for one tag, numpy finds what is in a million
lines, and Arrow reads a hundred thousand coordinates in milliseconds. So :mod:`trace_dag.osm.extraction` passes what it
keeps of a file through OPL, in the form of :data:`WRITING`. Only lines that are near a site become Python's.

Format: https://osmcode.org/opl-file-format/. Fields are separated by spaces, each begins with a letter that says what
it is: ``w7 Thighway=service,oneway=yes Nn1x-77.5y37.25,n2xy``. In texts, spaces, commas, ``=``, ``@`` and whatever else
would disturb are written as ``%`` hex code ``%``. Lines are in UTF-8 and have their ends.
"""

from __future__ import annotations

from collections.abc import Collection, Iterator
from dataclasses import dataclass, replace
from functools import lru_cache
from typing import Any, BinaryIO, Final, NamedTuple

import numpy as np
import numpy.typing as npt

from trace_dag.geometry import FloatArray
from trace_dag.osm.types import OsmMember

# Options for libosmium: ways with the places of their nodes, nothing about who changed an object when.
WRITING: Final = "opl,locations_on_ways=true,add_metadata=false"

IntArray = npt.NDArray[np.int64]
BoolArray = npt.NDArray[np.bool_]

_AT_ONCE: Final = 2**24  # bytes of lines that are looked at together
_NEWLINE, _SPACE, _COMMA, _EQUALS = b"\n ,="
_MEMBER_TYPES: Final = {"n": "node", "w": "way", "r": "relation"}
_NODE_COLUMNS: Final = {"id": "int64", "longitude_deg": "float64", "latitude_deg": "float64"}
# Turns ``n1x-77.5y37.25,n2xy`` into rows ``1,-77.5,37.25`` and ``2,,``.
_TO_ROWS: Final = bytes.maketrans(b",xy", b"\n,,")


class WayNodes(NamedTuple):
    """The nodes of many ways, one after the other: (n,) each, WGS84 degrees, NaN where a node is not located."""

    counts: IntArray  # how many of them are whose, for each way
    ids: IntArray
    longitudes_deg: FloatArray
    latitudes_deg: FloatArray


def read_id(line: bytes) -> int:
    """The id of an object.

    >>> read_id(b'n42 x-77.4 y37.5')
    42
    """
    return int(line[1 : line.index(b" ")])


def read_tags(line: bytes) -> dict[str, str]:
    """The tags of an object.

    >>> read_tags(b'w7 Thighway=primary,name=Main%20%Street Nn1,n2')
    {'highway': 'primary', 'name': 'Main Street'}
    """
    field = line.split(b" ", 2)[1][1:].decode()
    return dict(map(_tag, field.split(","))) if field else {}


def read_members(line: bytes) -> tuple[OsmMember, ...]:
    """The members of a relation.

    >>> [(member.type, member.id, member.role) for member in read_members(b"r7 Ttype=restriction Mw1@from,n2@via\\n")]
    [('way', 1, 'from'), ('node', 2, 'via')]
    """
    field = line[line.rindex(b" ") + 2 : -1].decode()
    if not field:
        return ()
    split = (member.split("@") for member in field.split(","))
    return tuple(OsmMember(_MEMBER_TYPES[ref[0]], int(ref[1:]), _text(role)) for ref, role in split)


@dataclass(frozen=True, eq=False)
class Lines:
    """Some of the lines of a text, (n,), each from ``starts`` to before ``ends``, where its end of line stands.

    Of the whole text there are the places of all ``separators`` (spaces, commas and line ends), which of these are
    ``spaces``, the places of all ``equals`` signs, and the four letters that end with each of them as one number.

    >>> ways = Lines.of(b"w7 Thighway=primary Nn1x-77.5y37.25,n2xy\\nw8 Tbuilding=yes N\\n")
    >>> ways.having(b"building").tolist(), ways[1]
    ([False, True], b'w8 Tbuilding=yes N\\n')
    """

    text: bytes
    starts: IntArray
    ends: IntArray
    separators: IntArray
    spaces: IntArray
    equals: IntArray
    before_equals: npt.NDArray[np.uint32]

    @classmethod
    def of(cls, text: bytes) -> Lines:
        """All lines of a text."""
        data = np.frombuffer(text, np.uint8)
        maybe = np.flatnonzero(data <= _COMMA)
        found = data[maybe]
        ends = maybe[found == _NEWLINE]
        separator = (found == _COMMA) | (found == _SPACE) | (found == _NEWLINE)
        equals = np.flatnonzero(data == _EQUALS)
        fours = np.ndarray(max(len(text) - 3, 0), "<u4", text, strides=(1,))
        return cls(
            text,
            np.concatenate([[0], ends + 1])[:-1],
            ends,
            maybe[separator],
            np.flatnonzero(found[separator] == _SPACE),
            equals,
            fours[equals - 3],
        )

    def __len__(self) -> int:
        return len(self.ends)

    def __getitem__(self, index: int) -> bytes:
        return self.text[self.starts[index] : self.ends[index] + 1]

    def __iter__(self) -> Iterator[bytes]:
        return iter(self._cut(self.starts, self.ends + 1))

    def some(self, which: IntArray | BoolArray) -> Lines:
        """Those of some numbers, or for which it is true."""
        return replace(self, starts=self.starts[which], ends=self.ends[which])

    def of_kind(self, letter: str) -> Lines:
        """Nodes (n), ways (w) or relations (r).

        >>> list(Lines.of(b"n1 T x1 y1\\nw1 T Nn1,n2\\n").of_kind("w"))
        [b'w1 T Nn1,n2\\n']
        """
        return self.some(np.frombuffer(self.text, np.uint8)[self.starts] == ord(letter))

    def having(self, key: bytes, values: Collection[bytes] = ()) -> BoolArray:
        """Whether each has a tag with that key, (n,), and with one of the values where there are any.

        >>> lines = Lines.of(b"w7 Thighway=primary,name=A N\\nw8 Thighway=footway N\\n")
        >>> lines.having(b"highway", [b"primary", b"foot"]).tolist()
        [True, False]
        """
        data = np.frombuffer(self.text, np.uint8)
        at = self.equals[self.before_equals == int.from_bytes((key + b"=")[-4:], "little")]
        at = at[at > len(key)]
        for back, letter in enumerate(reversed(b"," + key), start=1):
            found = data[at - back]
            at = at[(found == letter) | (found == ord("T")) if back > len(key) else found == letter]
        if values:
            at = at[self._values_are(at, values)]
        found = np.zeros(len(self), dtype=bool)
        line = np.searchsorted(self.ends, at)
        inside = line < len(self)
        line, at = line[inside], at[inside]
        found[line[at >= self.starts[line]]] = True
        return found

    def _values_are(self, at: IntArray, values: Collection[bytes]) -> BoolArray:
        """Whether the text from behind each place to the next separator is one of the values."""
        sizes = self.separators[np.searchsorted(self.separators, at)] - at - 1
        longest = max(map(len, values))
        data = np.frombuffer(self.text, np.uint8)
        column = np.arange(longest)
        letters = data[np.minimum(at[:, None] + 1 + column, len(data) - 1)]
        letters[column >= sizes[:, None]] = 0
        return np.isin(letters.view(f"S{longest}")[:, 0], list(values)) & (sizes <= longest)

    def way_nodes(self) -> WayNodes:
        """The nodes of ways.

        >>> nodes = Lines.of(b"w7 Thighway=primary Nn1x-77.5y37.25,n2xy\\n").way_nodes()
        >>> nodes.counts.tolist(), nodes.ids.tolist(), nodes.longitudes_deg.tolist()
        ([2], [1, 2], [-77.5, nan])
        """
        space = self._last_space()
        starts = self.separators[space] + 2
        counts = np.where(starts < self.ends, np.searchsorted(self.separators, self.ends) - space, 0)
        return WayNodes(counts, *_read_nodes(b"".join(self._cut(starts, self.ends + 1))).values())

    def first_places(self) -> tuple[FloatArray, FloatArray]:
        """Longitudes and latitudes of the first nodes of ways, (n,) WGS84 degrees, NaN where unknown.

        >>> Lines.of(b"w7 T Nn1x-77.5y37.25,n2xy\\nw8 T N\\n").first_places()[0].tolist()
        [-77.5, nan]
        """
        space = self._last_space()
        fields = self._cut(self.separators[space] + 2, self.separators[space + 1])
        nodes = _read_nodes(b"\n".join([field or b"xy" for field in fields]))
        return nodes["longitude_deg"], nodes["latitude_deg"]

    def node_places(self) -> tuple[FloatArray, FloatArray]:
        """Longitudes and latitudes of nodes, (n,) WGS84 degrees, NaN where unknown.

        >>> Lines.of(b"n7 T x-77.5 y37.25\\nn8 T x y\\n").node_places()[0].tolist()
        [-77.5, nan]
        """
        last = np.searchsorted(self.separators, self.ends)
        nodes = _read_nodes(b"".join(self._cut(self.separators[last - 2] + 1, self.ends + 1)).replace(b" ", b""))
        return nodes["longitude_deg"], nodes["latitude_deg"]

    def _last_space(self) -> IntArray:
        """The number of the separator before the last field of each line."""
        spaces: IntArray = self.spaces[np.searchsorted(self.separators[self.spaces], self.ends) - 1]
        return spaces

    def _cut(self, starts: IntArray, ends: IntArray) -> list[bytes]:
        text = self.text
        return [text[start:end] for start, end in zip(starts.tolist(), ends.tolist(), strict=True)]


def read_lines(stream: BinaryIO) -> Iterator[Lines]:
    """The lines of a file, some megabytes at a time.

    >>> from io import BytesIO
    >>> [list(lines) for lines in read_lines(BytesIO(b"n1 T x1 y1\\n"))]
    [[b'n1 T x1 y1\\n']]
    """
    while text := stream.read(_AT_ONCE):
        yield Lines.of(text if text.endswith(b"\n") else text + stream.readline())


def _read_nodes(fields: bytes) -> dict[str, npt.NDArray[Any]]:
    """The columns of nodes, one after the other as in the field of a way's nodes."""
    import pyarrow as pa
    from pyarrow import csv

    rows = fields.translate(_TO_ROWS, b"n")
    if not rows.strip():  # Arrow takes it for an error
        return {name: np.empty(0, kind) for name, kind in _NODE_COLUMNS.items()}
    table = csv.read_csv(
        pa.py_buffer(rows),
        read_options=csv.ReadOptions(column_names=list(_NODE_COLUMNS)),
        convert_options=csv.ConvertOptions(column_types=_NODE_COLUMNS),
    )
    return {name: table.column(name).to_numpy() for name in _NODE_COLUMNS}


@lru_cache(maxsize=2**16)  # nearly all tags of a file are among a few thousand
def _tag(text: str) -> tuple[str, str]:
    key, value = text.split("=")
    return _text(key), _text(value)


def _text(text: str) -> str:
    if "%" not in text:
        return text
    parts = text.split("%")  # plain and escaped in turn
    parts[1::2] = [chr(int(code, 16)) for code in parts[1::2]]
    return "".join(parts)
