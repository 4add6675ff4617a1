"""OpenStreetMap tags for certain hours (``no_left_turn @ (Mo-Fr 07:00-09:00)``), and for certain users."""

from __future__ import annotations

import re
from collections.abc import Iterable, Mapping
from dataclasses import replace
from datetime import datetime
from typing import Final

from trace_dag.osm.types import OsmRelation

_FOR_CARS: Final = ("restriction:motorcar", "restriction:motor_vehicle", "restriction:vehicle", "restriction")
_CARS: Final = frozenset({"motorcar", "motor_vehicle", "vehicle"})
_ON_RED: Final = "_on_red"  # when to turn, not whether: drivers wait for green
_CONDITION: Final = re.compile(r"([^;@\s]+)\s*@\s*(?:\(([^)]*)\)|([^;]+))")


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
