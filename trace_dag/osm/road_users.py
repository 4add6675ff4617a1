"""OSM ways by their users: motor vehicles, or people on foot and on bicycles beside and across roads.

Other footways, through parks and to front doors, say nothing about the road.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import Final

from trace_dag.osm.road_classes import ROAD_CLASSES

# The OSM wiki's road classes and links, as osmnx's "drive" network has them. Not in it: ways for feet and wheels
# (footway, cycleway, path, pedestrian, ...), busways, and what is not there (construction, proposed, razed).
PUBLIC_HIGHWAYS: Final = frozenset(highway for highway, row in ROAD_CLASSES.items() if row.public)
SERVICE_HIGHWAYS: Final = frozenset({"service"})
# Unpaved. Those with a name or a number are public roads all the same, as county roads often go on; the others serve
# fields and woods.
TRACK_HIGHWAYS: Final = frozenset({"track"})
DRIVABLE_HIGHWAYS: Final = PUBLIC_HIGHWAYS | SERVICE_HIGHWAYS | TRACK_HIGHWAYS

_VEHICLE_ACCESS_KEYS: Final = ("motorcar", "motor_vehicle", "vehicle", "access")  # the most specific first
_FORBIDDEN: Final = frozenset({"no", "agricultural", "forestry", "military"})
CAR_POOLS: Final = frozenset({"designated", "yes", "only"})
"""Values of ``hov`` that open a way or a lane, closed to others, for cars with passengers."""
WALKWAY_HIGHWAYS: Final = frozenset({"footway", "cycleway", "path"})
WALKWAY_TAGS: Final = (
    ("footway", "crossing"),
    ("footway", "sidewalk"),
    ("cycleway", "crossing"),
    ("path", "crossing"),
)
"""Any of these makes one of :data:`WALKWAY_HIGHWAYS` a walkway beside or across a road."""


def is_drivable(tags: Mapping[str, str], *, service_roads: bool) -> bool:
    """Return whether a way with ``tags`` belongs to the map; ``service_roads`` adds service roads and driveways.

    Private roads are included, because a crash at a driveway needs the driveway. Areas (``area=yes``) are not.
    """
    highway = tags.get("highway")
    if highway in TRACK_HIGHWAYS:
        if "name" not in tags and "ref" not in tags:
            return False
    elif highway not in PUBLIC_HIGHWAYS and not (service_roads and highway in SERVICE_HIGHWAYS):
        return False
    if tags.get("area") == "yes":
        return False
    for key in _VEHICLE_ACCESS_KEYS:
        if key in tags:
            return tags[key] not in _FORBIDDEN or tags.get("hov") in CAR_POOLS
    return True


_CLOSED_BARRIERS: Final = frozenset(
    {"block", "bollard", "chain", "debris", "fence", "guard_rail", "jersey_barrier", "log", "planter", "wall"}
)
_PASSABLE: Final = frozenset({"yes", "permissive", "designated", "destination", "customers", "delivery", "private"})


def blocks_cars(tags: Mapping[str, str]) -> bool:
    """Return whether a node of a way ends it for cars.

    Bollards and similar barriers do, unless their access opens them, and so do gates with ``access=no``. Gates of
    private driveways do not, since residents may pass.

    >>> blocks_cars({"barrier": "bollard"}), blocks_cars({"barrier": "gate"})
    (True, False)
    """
    if "barrier" not in tags:
        return False
    access = next((tags[key] for key in _VEHICLE_ACCESS_KEYS if key in tags), "")
    return access in _FORBIDDEN or (tags["barrier"] in _CLOSED_BARRIERS and access not in _PASSABLE)


def is_walkway(tags: Mapping[str, str]) -> bool:
    """Return whether a way with ``tags`` is a sidewalk or a crossing that is mapped as a way of its own."""
    return tags.get("highway") in WALKWAY_HIGHWAYS and any(tags.get(key) == value for key, value in WALKWAY_TAGS)


def is_crossing(tags: Mapping[str, str]) -> bool:
    """Return whether a walkway leads across a road."""
    return any(tags.get(key) == "crossing" for key, value in WALKWAY_TAGS if value == "crossing")
