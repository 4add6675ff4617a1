"""Turning of ways so that one-way traffic goes along them, before other facts are read from them.

A way with ``oneway=-1`` is reversed, with every tag that has a side or a direction. All lanes of a reversible or
alternating road go one way at a time. ``oneway:conditional`` and the time of the crash determine the direction. If they
do not, it is the direction of the way, and the tag :data:`REVERSIBLE_TAG` records that it may have been the other one.
Later steps do not see these values.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace
from datetime import datetime
from typing import Final

from trace_dag.osm.types import OsmExtract, OsmWay
from trace_dag.roads.from_osm.conditions import restrictions_at, value_at

REVERSIBLE_TAG: Final = "trace_dag:reversible"
"""On roads whose lanes go one way at a time: "by the hour" where the hour tells which way it was, else "unknown"."""
TURNED_TAG: Final = "trace_dag:turned"
"""On ways that were reversed: ``direction`` of their nodes is that of the way as OpenStreetMap has it."""
_AGAINST: Final = frozenset({"-1", "reverse"})
_IN_TURN: Final = frozenset({"reversible", "alternating"})
_OTHER: Final = {"forward": "backward", "backward": "forward", "left": "right", "right": "left"}
_SIDED: Final = frozenset({"sidewalk", "cycleway", "footway", "shoulder", "parking", "busway", "verge", "kerb"})


def along_traffic(extract: OsmExtract, when: datetime | None = None) -> OsmExtract:
    """Return the extract with every one-way road along its traffic at ``when`` (local time).

    Its turn restrictions are those for cars at that time.

    >>> from trace_dag.osm.types import BoundingBox
    >>> way = OsmWay(7, (1, 2), {"highway": "primary", "oneway": "-1", "parking:right": "lane"})
    >>> turned = along_traffic(OsmExtract(BoundingBox(0.0, 0.0, 1.0, 1.0), {}, (way,))).ways[0]
    >>> turned.node_ids, turned.tags
    ((2, 1), {'highway': 'primary', 'oneway': 'yes', 'parking:left': 'lane', 'trace_dag:turned': 'yes'})
    """
    ways = tuple(_along(way, when) for way in extract.ways)
    return replace(extract, ways=ways, relations=restrictions_at(extract.relations, when))


def _along(way: OsmWay, when: datetime | None) -> OsmWay:
    oneway = way.tags.get("oneway")
    if oneway in _IN_TURN:
        decided = _at_the_time(way.tags.get("oneway:conditional", ""), when)
        tags = {**way.tags, "oneway": decided or "yes", REVERSIBLE_TAG: "by the hour" if decided else "unknown"}
        return _along(way._replace(tags=tags), when)
    if oneway in _AGAINST:
        return OsmWay(way.id, way.node_ids[::-1], {**reverse_tags(way.tags), "oneway": "yes", TURNED_TAG: "yes"})
    return way


def _at_the_time(conditional: str, when: datetime | None) -> str | None:
    """Return "yes" or "-1" by the conditions that hold; None if none does or one cannot be read."""
    value = value_at(conditional, when)
    return "-1" if value in _AGAINST else "yes" if value in ("yes", "1") else None


def reverse_tags(tags: Mapping[str, str]) -> dict[str, str]:
    """Return tags of a way seen from its other end.

    Lists with one entry per lane and a direction go from left to right as drivers see them and stay so. Those without a
    direction go along the way and are reversed, unless that would paint left turns right of right turns.
    """
    turned = {_swapped(key, ":"): value for key, value in tags.items()}
    as_driven = _is_as_driven(tags.get("turn:lanes", ""))
    for key, value in turned.items():
        if key.partition(":")[0] in _SIDED or key.endswith("direction"):
            turned[key] = _OTHER.get(value, value)
        elif key == "incline":
            turned[key] = {"up": "down", "down": "up"}.get(value) or _negated(value)
        elif key.endswith(":lanes") and not as_driven:
            turned[key] = "|".join(value.split("|")[::-1])
    return turned


def _swapped(text: str, separator: str) -> str:
    return separator.join(_OTHER.get(part, part) for part in text.split(separator))


def _is_as_driven(turns: str) -> bool:
    entries = turns.split("|")
    left = [k for k, entry in enumerate(entries) if "left" in entry]
    right = [k for k, entry in enumerate(entries) if "right" in entry]
    return bool(left and right) and max(left) < min(right)


def _negated(value: str) -> str:
    return value[1:] if value.startswith("-") else f"-{value.removeprefix('+')}"
