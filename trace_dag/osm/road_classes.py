"""Road classes: the defaults that OSM's ``highway`` implies without other tags.

There is one row per class, links (ramps and slip roads) included in their class. Widths and speeds are those common on
US roads of a class, used if nothing is tagged or posted. Lanes of public roads are AASHTO's Green Book widths of 3.35
to 3.65 m (11 to 12 ft); that of service roads, the lanes of a one-way carriageway and the speeds are judgement.
"""

from __future__ import annotations

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
