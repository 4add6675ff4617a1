"""Coarse zones across the road for a person's place; codes of two tables with one meaning share a zone."""

from __future__ import annotations

from collections.abc import Mapping
from enum import StrEnum
from typing import Final

from trace_dag.crash.parties import PartyKind
from trace_dag.crash.record import CrashRecord, NonMotorist


class Zone(StrEnum):
    """A strip along the road."""

    CARRIAGEWAY = "carriageway"  # where motor vehicles drive
    BESIDE = "beside"  # shoulders, parking and bicycle lanes, unpaved right-of-way, medians
    WALKED = "walked"  # sidewalks, shared-use paths, driveway accesses
    OUTSIDE = "outside"  # off the trafficway


_CARRIAGEWAY, _BESIDE = frozenset({Zone.CARRIAGEWAY}), frozenset({Zone.BESIDE})
ZONES_OF_LOCATION: Final[Mapping[int, frozenset[Zone]]] = {
    **dict.fromkeys((1, 2, 3, 9, 10, 11, 13), _CARRIAGEWAY),
    **dict.fromkeys((14, 16, 20), _BESIDE),
    22: _BESIDE | _CARRIAGEWAY,
    **dict.fromkeys((21, 23, 24), frozenset({Zone.WALKED})),
    25: frozenset({Zone.OUTSIDE}),
}
ZONES_OF_PEDPOS: Final[Mapping[int, frozenset[Zone]]] = {
    **dict.fromkeys((1, 3), _CARRIAGEWAY),
    2: frozenset({Zone.CARRIAGEWAY, Zone.WALKED}),  # in a crosswalk, of a shared-use path too
    **dict.fromkeys((4, 6), _BESIDE),
    5: frozenset({Zone.WALKED, Zone.BESIDE}),
    **dict.fromkeys((7, 8), frozenset({Zone.OUTSIDE, Zone.WALKED})),
}
ZONES_OF_BIKEPOS: Final[Mapping[int, frozenset[Zone]]] = {
    1: _CARRIAGEWAY,
    2: _BESIDE,
    3: frozenset({Zone.WALKED, Zone.CARRIAGEWAY}),
    4: frozenset({Zone.WALKED, Zone.OUTSIDE}),
    **dict.fromkeys((5, 6), frozenset({Zone.OUTSIDE, Zone.WALKED})),
}
_ZONES_OF_REL_ROAD: Final[Mapping[int, frozenset[Zone]]] = {
    **dict.fromkeys((1, 11), _CARRIAGEWAY),
    **dict.fromkeys((2, 3, 4, 6, 7, 8, 10, 12), frozenset({Zone.BESIDE, Zone.WALKED})),
    5: frozenset({Zone.OUTSIDE}),
}


_IN_CROSSWALK: Final = frozenset({1, 2, 10})  # LOCATION
_CROSSWALK: Final = 2  # PEDPOS


def is_in_crosswalk(person: NonMotorist) -> bool:
    """Return whether the report places the person in a crosswalk, marked or not: by the typing or ``LOCATION``."""
    return person.pedestrian_position_code == _CROSSWALK or person.location_code in _IN_CROSSWALK


def may_have_crossed_in_crosswalk(person: NonMotorist) -> bool:
    """Return whether the report allows a person on foot to have crossed in a crosswalk or elsewhere."""
    told = person.pedestrian_position_code in ZONES_OF_PEDPOS or person.location_code in ZONES_OF_LOCATION
    return person.kind is not PartyKind.CYCLIST and not told


def reported_zones(record: CrashRecord, person: NonMotorist) -> frozenset[Zone]:
    """Return the zones in which the person was struck, by the typing, else ``LOCATION``, else ``REL_ROAD``.

    Empty if none is reported.

    >>> sorted(zone.value for zone in reported_zones(pedestrian_record, pedestrian_record.non_motorists[0]))  # PEDPOS 3
    ['carriageway']
    """
    tables = (
        (person.pedestrian_position_code, ZONES_OF_PEDPOS),
        (person.cyclist_position_code, ZONES_OF_BIKEPOS),
        (person.location_code, ZONES_OF_LOCATION),
        (record.road_relation_code, _ZONES_OF_REL_ROAD),
    )
    return next((table[code] for code, table in tables if code is not None and code in table), frozenset())


def zones_of_first_event(record: CrashRecord) -> frozenset[Zone]:
    """Return the zones of the first harmful event (``REL_ROAD``); empty if unknown.

    >>> sorted(zone.value for zone in zones_of_first_event(tree_record))  # REL_ROAD 4: on the roadside
    ['beside', 'walked']
    """
    return _ZONES_OF_REL_ROAD.get(record.road_relation_code or 0, frozenset())
