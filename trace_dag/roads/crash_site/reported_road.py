"""The reported road of each vehicle, in terms that can be compared with a map.

FARS elements, by the FARS Analytical User's Manual: ``VTRAFWAY`` describes the trafficway. ``VNUM_LAN`` counts the
lanes of the roadway the vehicle was on: both directions together where the trafficway is not divided, only the
vehicle's own roadway where it is; turn lanes count if they belong to the vehicle's roadway; 7 means seven or more.
``VTRAFCON`` is the traffic control that applied to the vehicle.
"""

from __future__ import annotations

from enum import StrEnum
from typing import Final

from trace_dag.crash.record import CrashRecord, VehicleRecord
from trace_dag.roads.crash_site.carriageways import Carriageway

MOST_LANES: Final = 7  # VNUM_LAN: seven or more


class Trafficway(StrEnum):
    """Values of ``VTRAFWAY`` that a map can show."""

    UNDIVIDED = "undivided"
    DIVIDED = "divided"
    ONE_WAY = "one_way"
    RAMP = "ramp"


class Control(StrEnum):
    """Values of ``VTRAFCON`` that a map can show."""

    NONE = "none"
    SIGNAL = "signal"
    STOP = "stop"
    YIELD = "yield"


_TRAFFICWAYS: Final = {
    1: Trafficway.UNDIVIDED,
    2: Trafficway.DIVIDED,
    3: Trafficway.DIVIDED,
    4: Trafficway.ONE_WAY,
    5: Trafficway.UNDIVIDED,
    6: Trafficway.RAMP,
    7: Trafficway.DIVIDED,
}
_CONTROLS: Final = {
    0: Control.NONE,
    **dict.fromkeys((1, 2, 3, 4, 8, 9), Control.SIGNAL),
    20: Control.STOP,
    21: Control.YIELD,
}


def trafficway_of(vehicle: VehicleRecord) -> Trafficway | None:
    """Return the trafficway; None if it is a driveway or not reported.

    >>> record.vehicles[0].trafficway_code, trafficway_of(record.vehicles[0]).value
    (1, 'undivided')
    """
    return None if vehicle.trafficway_code is None else _TRAFFICWAYS.get(vehicle.trafficway_code)


def control_of(vehicle: VehicleRecord) -> Control | None:
    """Return the traffic control; None if it is not reported or has no mapped equivalent (a person, a warning sign).

    >>> record.vehicles[0].traffic_control_code, control_of(record.vehicles[0]).value
    (3, 'signal')
    """
    return None if vehicle.traffic_control_code is None else _CONTROLS.get(vehicle.traffic_control_code)


def pair_of(record: CrashRecord) -> tuple[VehicleRecord, ...]:
    """Return the two vehicles that collided; all vehicles if the record names no two.

    >>> [vehicle.number for vehicle in pair_of(record)], [vehicle.number for vehicle in pair_of(tree_record)]
    ([2, 1], [1])
    """
    return record.colliding_vehicles or record.vehicles


def lanes_as_reported(street: Carriageway, trafficway: Trafficway | None) -> frozenset[int]:
    """Return the ``VNUM_LAN`` of a mapped street, counted as ``VTRAFWAY`` implies.

    There are several values if lanes begin, end or only turn near the place, or if the two directions differ. If the
    report does not say whether the trafficway is divided, both counts of a divided one are included.

    >>> from trace_dag.roads.crash_site.carriageways import carriageway_at
    >>> main_street = carriageway_at(network, map_report.placement.road_id, 0.0, 0.0)  # two lanes each way
    >>> lanes_as_reported(main_street, Trafficway.UNDIVIDED), lanes_as_reported(main_street, Trafficway.DIVIDED)
    (frozenset({4}), frozenset({2}))
    """
    values: set[int] = set()
    for count in street.counts:
        if street.one_way:
            both = {count.total + other.total for other in street.opposite_counts}
            if trafficway == Trafficway.UNDIVIDED and both:
                values |= both
            else:
                values |= {count.total} | (both if trafficway is None else set())
        elif trafficway == Trafficway.DIVIDED or (trafficway is None and street.median):
            values.update(side + count.centre for side in (count.along, count.against))
        else:
            values.add(count.total)
    return frozenset(min(value, MOST_LANES) for value in values)


def trafficway_on_map(street: Carriageway) -> Trafficway:
    """Return the ``VTRAFWAY`` of a street of the map.

    >>> from trace_dag.roads.crash_site.carriageways import carriageway_at
    >>> trafficway_on_map(carriageway_at(network, map_report.placement.road_id, 0.0, 0.0)).value
    'undivided'
    """
    if street.road.highway.endswith("_link"):
        return Trafficway.RAMP
    if street.divided:
        return Trafficway.DIVIDED
    return Trafficway.ONE_WAY if street.one_way else Trafficway.UNDIVIDED
