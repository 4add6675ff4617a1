"""OSM ways for people on foot and on bicycles beside and across roads: sidewalks and crossings.

Other footways, through parks and to front doors, say nothing about the road.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import Final

WALKWAY_HIGHWAYS: Final = frozenset({"footway", "cycleway", "path"})
WALKWAY_TAGS: Final = (
    ("footway", "crossing"),
    ("footway", "sidewalk"),
    ("cycleway", "crossing"),
    ("path", "crossing"),
)
"""Any of these makes one of :data:`WALKWAY_HIGHWAYS` a walkway beside or across a road."""


def is_walkway(tags: Mapping[str, str]) -> bool:
    """Return whether a way with ``tags`` is a sidewalk or a crossing that is mapped as a way of its own."""
    return tags.get("highway") in WALKWAY_HIGHWAYS and any(tags.get(key) == value for key, value in WALKWAY_TAGS)


def is_crossing(tags: Mapping[str, str]) -> bool:
    """Return whether a walkway leads across a road."""
    return any(tags.get(key) == "crossing" for key, value in WALKWAY_TAGS if value == "crossing")
