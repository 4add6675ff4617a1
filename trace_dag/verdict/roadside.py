"""Places of events beside the road, in the simulation beside the report (``REL_ROAD``)."""

from __future__ import annotations

import math
from typing import Final

from trace_dag.crash.departure_side import DepartureSide
from trace_dag.crash.record import CrashRecord
from trace_dag.roads.map.roadside import RoadsidePlace, RoadZone

_ZONES: Final = {
    **dict.fromkeys((1, 11), RoadZone.ROADWAY),
    2: RoadZone.SHOULDER,
    **dict.fromkeys((3, 10, 12), RoadZone.MEDIAN),
    **dict.fromkeys((4, 6, 7), RoadZone.ROADSIDE),
    5: RoadZone.OUTSIDE,
    8: RoadZone.GORE,
}
"""``REL_ROAD``: where the first harmful event was."""
SIDES_IN_WORDS: Final = {
    DepartureSide.LEFT: "to the left",
    DepartureSide.RIGHT: "to the right",
    DepartureSide.AHEAD: "straight ahead",
}
_WIDEST_SHOULDER_M: Final = 4.0


def reported_zone(record: CrashRecord) -> RoadZone | None:
    """Return the zone of the first harmful event (``REL_ROAD``); None if unknown.

    >>> tree_record.road_relation_code, reported_zone(tree_record).value
    (4, 'roadside')
    """
    return _ZONES.get(record.road_relation_code or 0)


def roadside_error_m(place: RoadsidePlace | None, zone: RoadZone | None) -> float | None:
    """Return how far a place is from the reported zone; None if none is reported.

    A map that shows no median or gore there cannot contradict one: then it has to be beside the carriageway.
    """
    if zone is None:
        return None
    if place is None:
        return 0.0 if zone is RoadZone.OUTSIDE else math.inf
    if zone is RoadZone.ROADWAY:
        return max(place.beyond_m, 0.0)
    inside_m = max(-place.beyond_m, 0.0)
    if zone is RoadZone.SHOULDER:
        return max(inside_m, place.beyond_m - max(place.shoulder_m, _WIDEST_SHOULDER_M), 0.0)
    return inside_m
