"""Road classes: the defaults that OSM's ``highway`` implies without other tags, and who uses a way.

There is one row per class, links (ramps and slip roads) included in their class. Widths and speeds are those common on
US roads of a class, used if nothing is tagged or posted. Lanes of public roads are AASHTO's Green Book widths of 3.35
to 3.65 m (11 to 12 ft); that of service roads, the lanes of a one-way carriageway and the speeds are judgement.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Final

from trace_dag.common.units import mph_to_mps


@dataclass(frozen=True)
class RoadClass:
    """``rank``: 0 for motorways to 6 for residential streets, 7 for the rest.

    ``public``: by its class alone, so not service roads and tracks. ``driveways``: whether any may join it.
    ``lanes_one_way``: of one carriageway. ``opendrive_type``: OpenDRIVE's ``e_roadType`` (ASAM OpenDRIVE 1.7, section
    8.3).
    """

    rank: int
    lane_width_m: float = 3.35
    lanes_one_way: int = 1
    speed_mps: float = mph_to_mps(35)
    opendrive_type: str = "town"
    driveways: bool = True
    public: bool = True


ROAD_CLASSES: Final[dict[str, RoadClass]] = {
    "motorway": RoadClass(0, 3.65, 2, mph_to_mps(65), "motorway", driveways=False),
    "motorway_link": RoadClass(0, 3.65, 1, mph_to_mps(40), "motorway", driveways=False),
    "trunk": RoadClass(1, 3.65, 2, mph_to_mps(55), "rural"),
    "trunk_link": RoadClass(1, 3.65, 1, opendrive_type="rural", driveways=False),
    "primary": RoadClass(2, 3.5, 2, mph_to_mps(45)),
    "primary_link": RoadClass(2, 3.5),
    "secondary": RoadClass(3, 3.5, 2, mph_to_mps(45)),
    "secondary_link": RoadClass(3, 3.5),
    "tertiary": RoadClass(4),
    "tertiary_link": RoadClass(4),
    "unclassified": RoadClass(5),
    "residential": RoadClass(6, speed_mps=mph_to_mps(25), opendrive_type="lowSpeed"),
    "living_street": RoadClass(6, speed_mps=mph_to_mps(15), opendrive_type="lowSpeed"),
    "road": RoadClass(6),  # one that nobody has classified yet
    "service": RoadClass(7, 2.75, speed_mps=mph_to_mps(10), opendrive_type="lowSpeed", public=False),
    "track": RoadClass(7, public=False),
}
_OTHER: Final = RoadClass(7, public=False)


def road_class(highway: str) -> RoadClass:
    """Return the row of a ``highway``; the commonest row for other values and None.

    >>> road_class("primary").rank, road_class("primary_link").lanes_one_way
    (2, 1)
    """
    return ROAD_CLASSES.get(highway, _OTHER)


HIGH_SPEED_MPS: Final = mph_to_mps(50)
"""From which limit on a road has shoulders and open sides rather than kerbs: AASHTO calls 50 mph and more high speeds,
and has no kerb beside roads of such (A Policy on Geometric Design of Highways and Streets, 2018, sections 2.3.6 and
4.7.3)."""
_SHOULDERS_M: Final = {0: 3.0, 3: 2.4, 4: 1.5}  # by the lowest class that has them
_LOCAL_SHOULDER_M: Final = 0.6
_LEFT_SHOULDER_M: Final = 1.2


def is_high_speed(highway: str, limit_mps: float | None) -> bool:
    """Return whether traffic on a road is fast: a freeway, or a road with a high posted or usual limit.

    >>> is_high_speed("motorway_link", None), is_high_speed("primary", None), is_high_speed("primary", 24.6)
    (True, False, True)
    """
    row = road_class(highway)
    return row.rank == 0 or (row.public and (limit_mps or row.speed_mps) >= HIGH_SPEED_MPS - 1e-6)


def usual_shoulder_m(highway: str, *, left: bool) -> float:
    """Return the usual width of the shoulder on one side of a road class.

    AASHTO, ibid., chapters 4 to 8: 3.0 m right of freeways, 2.4 m of arterials, 1.5 m of collectors, 0.6 m of local
    roads; left of one-way carriageways 1.2 m at most.

    >>> usual_shoulder_m("motorway", left=True), usual_shoulder_m("tertiary", left=False)
    (1.2, 1.5)
    """
    rank = road_class(highway).rank
    width_m = next((width_m for most, width_m in _SHOULDERS_M.items() if rank <= most), _LOCAL_SHOULDER_M)
    return min(width_m, _LEFT_SHOULDER_M) if left else width_m


# --- users -----------------------------------------------------------------------------------------------------------
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
