"""Reading OPL, libosmium's one-line-per-object text format, as far as roads need it.

libosmium writes an object as a line of text faster than Python can ask it for one tag, splitting a line is among the
fastest things Python does, and Arrow reads a hundred thousand coordinates in milliseconds. So
:mod:`trace_dag.osm.extraction` passes what it keeps of a file through OPL, in the form of :data:`WRITING`.

Format: https://osmcode.org/opl-file-format/. Fields are separated by spaces, each begins with a letter that says what
it is: ``w7 Thighway=service,oneway=yes Nn1x-77.5y37.25,n2xy``. In texts, spaces, commas, ``=``, ``@`` and whatever else
would disturb are written as ``%`` hex code ``%``. The functions take lines in UTF-8 with their ends.
"""

from __future__ import annotations

from collections.abc import Sequence
from functools import lru_cache
from typing import Any, Final, NamedTuple

import numpy as np
import numpy.typing as npt

from trace_dag.geometry import FloatArray
from trace_dag.osm.types import OsmMember

# Options for libosmium: ways with the places of their nodes, nothing about who changed an object when.
WRITING: Final = "opl,locations_on_ways=true,add_metadata=false"

_MEMBER_TYPES: Final = {"n": "node", "w": "way", "r": "relation"}
_NODE_COLUMNS: Final = {"id": "int64", "longitude_deg": "float64", "latitude_deg": "float64"}
# Turns ``n1x-77.5y37.25,n2xy`` into rows ``1,-77.5,37.25`` and ``2,,``.
_TO_ROWS: Final = bytes.maketrans(b",xy", b"\n,,")


class WayNodes(NamedTuple):
    """The nodes of many ways, one after the other: (n,) each, WGS84 degrees, NaN where a node is not located."""

    counts: npt.NDArray[np.int64]  # how many of them are whose, for each way
    ids: npt.NDArray[np.int64]
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
    field = _field(line, 1)
    return dict(map(_tag, field.split(","))) if field else {}


def read_members(line: bytes) -> tuple[OsmMember, ...]:
    """The members of a relation.

    >>> [(member.type, member.id, member.role) for member in read_members(b"r7 Ttype=restriction Mw1@from,n2@via\\n")]
    [('way', 1, 'from'), ('node', 2, 'via')]
    """
    field = _field(line, 2)
    if not field:
        return ()
    split = (member.split("@") for member in field.split(","))
    return tuple(OsmMember(_MEMBER_TYPES[ref[0]], int(ref[1:]), _text(role)) for ref, role in split)


def read_way_nodes(way_lines: Sequence[bytes]) -> WayNodes:
    """The nodes of ways.

    >>> nodes = read_way_nodes([b"w7 Thighway=primary Nn1x-77.5y37.25,n2xy"])
    >>> nodes.counts.tolist(), nodes.ids.tolist(), nodes.longitudes_deg.tolist()
    ([2], [1, 2], [-77.5, nan])
    """
    fields = [line[line.rindex(b" ") + 2 :] for line in way_lines]
    counts = np.array([field.count(b"n") for field in fields], dtype=np.int64)
    return WayNodes(counts, *_read_nodes(b"".join(fields)).values())


def read_places(fields: Sequence[bytes]) -> tuple[FloatArray, FloatArray]:
    """Longitudes and latitudes of nodes, (n,) WGS84 degrees, NaN where unknown.

    Each is the end of a node's line from its ``x`` on, or a node out of a way's line, empty if the way has none.

    >>> read_places([b" x-77.4 y37.5\\n", b"n7x-77.5y37.25", b""])[0].tolist()
    [-77.4, -77.5, nan]
    """
    nodes = _read_nodes(b"\n".join(field.strip() or b"xy" for field in fields).replace(b" ", b""))
    return nodes["longitude_deg"], nodes["latitude_deg"]


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


def _field(line: bytes, number: int) -> str:
    """A field without its letter."""
    return line[:-1].split(b" ")[number][1:].decode()


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
