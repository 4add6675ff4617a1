"""Reading OPL, libosmium's one-line-per-object text format, as far as roads need it.

libosmium writes an object as a line of text faster than Python can ask it for one tag, and splitting a line is among
the fastest things Python does. So :mod:`trace_dag.osm.extraction` passes what it keeps of a file through OPL.

Format: https://osmcode.org/opl-file-format/. Fields are separated by spaces, each begins with a letter that says what
it is; in texts, spaces, commas, ``=``, ``@`` and whatever else would disturb are written as ``%`` hex code ``%``.
"""

from __future__ import annotations

import re
from typing import Final

from trace_dag.osm.types import OsmMember

_ESCAPED: Final = re.compile("%([0-9a-f]+)%")
_MEMBER_TYPES: Final = {"n": "node", "w": "way", "r": "relation"}


def read_line(line: str) -> tuple[str, int, dict[str, str], str]:
    """Kind ("n", "w" or "r"), id, tags, and the last field: a way's nodes, a relation's members."""
    head, _, rest = line.rstrip("\n").partition(" T")
    tags, _, last = rest.partition(" ")
    return line[0], int(head[1:].partition(" ")[0]), _tags(tags), last.rpartition(" ")[2][1:]


def node_ids(field: str) -> tuple[int, ...]:
    """A way's nodes from its field ``n1,n2,...``, which may carry locations (``n1x-77.0y37.0``)."""
    if not field:
        return ()
    if "x" in field:
        return tuple(int(ref.split("x", 1)[0][1:]) for ref in field.split(","))
    return tuple(map(int, field[1:].split(",n")))


def members(field: str) -> tuple[OsmMember, ...]:
    """A relation's members from its field ``w1@from,n2@via,...``."""
    if not field:
        return ()
    split = (member.partition("@") for member in field.split(","))
    return tuple(OsmMember(_MEMBER_TYPES[ref[0]], int(ref[1:]), _text(role)) for ref, _, role in split)


def _tags(field: str) -> dict[str, str]:
    if not field:
        return {}
    pairs = (pair.partition("=") for pair in field.split(","))
    if "%" in field:
        return {_text(key): _text(value) for key, _, value in pairs}
    return {key: value for key, _, value in pairs}


def _text(text: str) -> str:
    return _ESCAPED.sub(lambda match: chr(int(match[1], 16)), text) if "%" in text else text
