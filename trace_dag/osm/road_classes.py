"""Road classes: what OSM's ``highway`` says of a road by itself, before any other tag does.

One row per class, links (ramps and slip roads) with the class they belong to. Widths and speeds are what US roads of a
class commonly have, for where nothing is tagged or posted. Lanes of public roads are AASHTO's Green Book widths of 3.35
to 3.65 m (11 to 12 ft); that of service roads, the lanes of a one-way carriageway and the speeds are judgement.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Final

from trace_dag.units import mph_to_mps


@dataclass(frozen=True)
class RoadClass:
    """``rank``: 0 for motorways to 6 for residential streets, 7 for the rest. ``public``: by its class alone, so not
    service roads and tracks. ``driveways``: whether any may join it. ``lanes_one_way``: of one carriageway.
    ``opendrive_type``: OpenDRIVE's ``e_roadType`` (ASAM OpenDRIVE 1.7, section 8.3)."""

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
    """The row of a ``highway``; for one that is not a road class, or none at all, what is commonest.

    >>> road_class("primary").rank, road_class("primary_link").lanes_one_way
    (2, 1)
    """
    return ROAD_CLASSES.get(highway, _OTHER)
