"""Limits beyond which a file is not a map of OpenStreetMap, checked before time is spent on it.

Belongs here: the limits and their sources. They are far above the values of any real map.
"""

from __future__ import annotations

import bz2
import gzip
import re
import zlib
from collections import Counter
from collections.abc import Callable, Mapping
from pathlib import Path
from typing import Any, Final

from trace_dag.common.errors import UserError
from trace_dag.osm.types import OsmExtract

XML_OPENERS: Final[Mapping[str, Callable[..., Any]]] = {".osm": open, ".osm.gz": gzip.open, ".osm.bz2": bz2.open}
"""The text formats by the ends of their names, as libosmium tells them apart."""

_MAX_TOKEN: Final = 64 * 1024
"""Bytes of one tag or comment of XML: OSM's longest value has 255 characters (API 0.6). What is longer is parsed again
with every block that is read, which takes hours."""
_MAX_RATIO: Final = 300
"""Size unpacked to size packed; OSM XML has 10 to 20."""
_UNPACKED_ANYWAY: Final = 2**28  # bytes that are read whatever the ratio is
_MAX_WAY_NODES: Final = 2_000
"""Nodes of a way, by OSM's own limit (API 0.6, capabilities)."""
_MAX_ROADS_AT_NODE: Final = 24
"""Ends of roads at one node, a road that goes through counting twice; the largest known junctions have 12."""
_MAX_PER_KM2: Final = {"nodes of roads": 20_000, "places where roads meet": 3_000, "metres of road": 200_000}
"""In the box around a crash. Of 198 boxes in the United States the fullest had 2,400, 670 and 40,000 of them."""
_BLOCK: Final = 2**20
_SPECIAL: Final = re.compile(rb"<!--|<!|<\?")


class UnreadableMapError(UserError):
    """A map file that cannot be read, or is not from OSM; the message names it."""


def xml_opener(path: Path) -> Callable[..., Any] | None:
    """Return the function that opens a file as XML text; None for a binary file.

    >>> xml_opener(Path("town.osm")).__name__, xml_opener(Path("town.osm.pbf"))
    ('open', None)
    """
    return next((opener for suffix, opener in XML_OPENERS.items() if path.name.endswith(suffix)), None)


def check_text(path: Path) -> None:
    """Raise :class:`UnreadableMapError` for XML with an endless tag or comment, or with endless unpacked text."""
    opener = xml_opener(path)
    if opener is None:
        return
    packed, unpacked, length, ends = path.stat().st_size, 0, 0, b""
    try:
        with opener(path, "rb") as stream:
            while block := stream.read(_BLOCK):
                unpacked += len(block)
                if unpacked > max(_UNPACKED_ANYWAY, _MAX_RATIO * packed) and opener is not open:
                    raise UnreadableMapError(
                        f"{path}: unpacks to more than {_MAX_RATIO} times its size; OSM data has 10 to 20 times"
                    )
                length, ends = _longest(block, length, ends)
                if length > _MAX_TOKEN:
                    raise UnreadableMapError(
                        f"{path}: one tag or comment has more than {_MAX_TOKEN} bytes; real OSM data has a few hundred"
                    )
    except (OSError, EOFError, zlib.error):
        return  # said by libosmium, which reads it next


def _longest(block: bytes, begun: int, ends: bytes) -> tuple[int, bytes]:
    """Return the length of the longest token of a block, and the terminator of an unfinished one at its end.

    ``begun`` bytes of an earlier token, which ``ends`` terminates, came before; ``ends`` is empty for any tag.
    """
    at = 0
    while at < len(block):
        if ends:
            end = block.find(ends, at)
            if end < 0 or begun + end - at > _MAX_TOKEN:
                return begun + len(block) - at if end < 0 else begun + end - at, ends
            at, begun, ends = end + len(ends), 0, b""
        special = _SPECIAL.search(block, at)
        stop = special.start() if special else len(block)
        pieces = block[at:stop].split(b"<")
        longest = max(begun + len(pieces[0]), max(map(len, pieces[1:]), default=0))
        if longest > _MAX_TOKEN or special is None:
            return (longest if longest > _MAX_TOKEN else len(pieces[-1]) + (begun if len(pieces) == 1 else 0)), b""
        at, begun = special.end(), 0
        ends = {b"<!--": b"-->", b"<?": b"?>"}.get(special[0], b">")
    return begun, ends


def check_roads(extract: OsmExtract, path: Path, *, area_km2: float, length_m: float) -> None:
    """Raise :class:`UnreadableMapError` for roads of impossible density.

    ``length_m`` is that of all roads of the extract, within ``area_km2``.
    """
    for way in extract.ways:
        if len(way.node_ids) > _MAX_WAY_NODES:
            raise UnreadableMapError(
                f"{path}: way {way.id} has {len(way.node_ids)} nodes; OpenStreetMap's have at most {_MAX_WAY_NODES}"
            )
    ends = Counter(node for way in extract.ways for node in (way.node_ids[0], way.node_ids[-1]))
    ends.update(node for way in extract.ways for node in way.node_ids[1:-1] for _ in range(2))
    for node, count in ends.most_common(1):
        if count > _MAX_ROADS_AT_NODE:
            raise UnreadableMapError(
                f"{path}: {count} roads meet at node {node}; in the largest junctions there are a dozen"
            )
    measured = (len(ends), sum(count > 2 for count in ends.values()), length_m)
    for (what, most), found in zip(_MAX_PER_KM2.items(), measured, strict=True):
        if found > most * area_km2:
            raise UnreadableMapError(
                f"{path}: {found / area_km2:.0f} {what} per square kilometre; the densest towns have less than {most}"
            )
