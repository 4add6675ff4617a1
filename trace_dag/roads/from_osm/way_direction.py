"""Turning of ways so that one-way traffic goes along them, before other facts are read from them.

A way with ``oneway=-1`` is reversed, with every tag that has a side or a direction. All lanes of a reversible or
alternating road go one way at a time. ``oneway:conditional`` and the time of the crash determine the direction. If they
do not, it is the direction of the way, and the tag :data:`REVERSIBLE_TAG` records that it may have been the other one.
Later steps do not see these values.
"""

from __future__ import annotations

import re
from collections.abc import Iterable, Mapping
from dataclasses import replace
from datetime import datetime
from typing import Final

from trace_dag.osm.types import OsmExtract, OsmRelation, OsmWay

REVERSIBLE_TAG: Final = "trace_dag:reversible"
"""On roads whose lanes go one way at a time: "by the hour" where the hour tells which way it was, else "unknown"."""
TURNED_TAG: Final = "trace_dag:turned"
"""On ways that were reversed: ``direction`` of their nodes is that of the way as OpenStreetMap has it."""
_AGAINST: Final = frozenset({"-1", "reverse"})
_IN_TURN: Final = frozenset({"reversible", "alternating"})
_OTHER: Final = {"forward": "backward", "backward": "forward", "left": "right", "right": "left"}
_SIDED: Final = frozenset({"sidewalk", "cycleway", "footway", "shoulder", "parking", "busway", "verge", "kerb"})
_FOR_CARS: Final = ("restriction:motorcar", "restriction:motor_vehicle", "restriction:vehicle", "restriction")
_CARS: Final = frozenset({"motorcar", "motor_vehicle", "vehicle"})
_ON_RED: Final = "_on_red"  # when to turn, not whether: drivers wait for green
_CONDITION: Final = re.compile(r"([^;@\s]+)\s*@\s*(?:\(([^)]*)\)|([^;]+))")


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
    turned = {":".join(_OTHER.get(part, part) for part in key.split(":")): value for key, value in tags.items()}
    as_driven = _is_as_driven(tags.get("turn:lanes", ""))
    for key, value in turned.items():
        if key.partition(":")[0] in _SIDED or key.endswith("direction"):
            turned[key] = _OTHER.get(value, value)
        elif key == "incline":
            turned[key] = {"up": "down", "down": "up"}.get(value) or _negated(value)
        elif key.endswith(":lanes") and not as_driven:
            turned[key] = "|".join(value.split("|")[::-1])
    return turned


def _is_as_driven(turns: str) -> bool:
    entries = turns.split("|")
    left = [k for k, entry in enumerate(entries) if "left" in entry]
    right = [k for k, entry in enumerate(entries) if "right" in entry]
    return bool(left and right) and max(left) < min(right)


def _negated(value: str) -> str:
    return value[1:] if value.startswith("-") else f"-{value.removeprefix('+')}"


# --- facts that hold at certain hours --------------------------------------------------------------------------------
def value_at(conditional: str, when: datetime | None) -> str | None:
    """Return the value at ``when`` (local time); None if no condition holds or one cannot be read.

    >>> value_at("no_left_turn @ (Mo-Fr 07:00-09:00)", datetime(2023, 5, 5, 8))  # a Friday
    'no_left_turn'
    """
    from opening_hours import OpeningHours, validate

    held = None
    for value, bracketed, bare in _CONDITION.findall(conditional):
        hours = bracketed or bare.strip()
        if when is None or not validate(hours):
            return None
        if OpeningHours(hours).is_open(when):
            held = value  # of several that hold the last one counts
    return held


def restrictions_at(relations: Iterable[OsmRelation], when: datetime | None) -> tuple[OsmRelation, ...]:
    """Return the relations that hold for cars at ``when`` (local time), each reduced to its ``restriction``.

    Those with conditions on the hour (``:conditional``, ``hour_on``) are left out if the time is None.

    >>> relation = OsmRelation(1, (), {"restriction": "no_left_turn", "hour_on": "07:00", "hour_off": "09:00"})
    >>> [len(restrictions_at([relation], datetime(2023, 5, 6, hour))) for hour in (8, 21)]
    [1, 0]
    """
    held = ((relation, _kind_at(relation.tags, when)) for relation in relations)
    return tuple(replace(relation, tags={"restriction": kind}) for relation, kind in held if kind)


def _kind_at(tags: Mapping[str, str], when: datetime | None) -> str:
    if not _CARS.isdisjoint(part.strip() for part in tags.get("except", "").split(";")):
        return ""
    key = next((key for key in _FOR_CARS if key in tags or f"{key}:conditional" in tags), "restriction")
    kind = value_at(tags.get(f"{key}:conditional", ""), when) or tags.get(key, "")
    hours = _hours(tags)
    if hours and value_at(f"{kind} @ ({hours})", when) is None:
        return ""
    return kind if kind != "none" and not kind.endswith(_ON_RED) else ""


def _hours(tags: Mapping[str, str]) -> str:
    """Return the days and hours of tags older than ``:conditional``, in its form."""
    days = "-".join(tags[key][:2] for key in ("day_on", "day_off") if key in tags)
    hours = "-".join(tags[key].zfill(5) for key in ("hour_on", "hour_off") if key in tags)
    return f"{days} {hours}".strip()
