"""The reported road of each vehicle, in terms that can be compared with a map, and contradictions that rule one out.

FARS elements, by the FARS Analytical User's Manual: ``VTRAFWAY`` describes the trafficway. ``VNUM_LAN`` counts the
lanes of the roadway the vehicle was on: both directions together where the trafficway is not divided, only the
vehicle's own roadway where it is; turn lanes count if they belong to the vehicle's roadway; 7 means seven or more.
``VTRAFCON`` is the traffic control that applied to the vehicle.
"""

from __future__ import annotations

from collections.abc import Collection
from enum import StrEnum
from typing import Final

from trace_dag.crash.record import CrashRecord, VehicleRecord
from trace_dag.osm.road_classes import road_class
from trace_dag.roads.crash_site.street_names import (
    OTHER_STREET,
    RouteSystem,
    best_similarity,
    is_same_street,
    parse_street,
    similarity,
)
from trace_dag.roads.crash_site.streets import Carriageway
from trace_dag.roads.map.model import Road
from trace_dag.roads.map.network import RoadNetwork

MOST_LANES: Final = 7  # VNUM_LAN: seven or more
_INTERSTATE: Final = 1  # FUNC_SYS and ROUTE
_ON_RAMP: Final = 20  # RELJCT2; 5 is related to a ramp only
_TOWN_STREET: Final = 3  # rank of the most important class that is one: OSM's secondary
_RAMPS_WITHIN_M: Final = 100.0
_SYSTEMS: Final = {1: RouteSystem.INTERSTATE, 2: RouteSystem.US, 3: RouteSystem.STATE, 4: RouteSystem.COUNTY}
"""``ROUTE``: who signs the road, where it is numbered."""


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

    >>> from trace_dag.roads.crash_site.streets import carriageway_at
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

    >>> from trace_dag.roads.crash_site.streets import carriageway_at
    >>> trafficway_on_map(carriageway_at(network, map_report.placement.road_id, 0.0, 0.0)).value
    'undivided'
    """
    if street.road.is_ramp:
        return Trafficway.RAMP
    if street.divided:
        return Trafficway.DIVIDED
    return Trafficway.ONE_WAY if street.one_way else Trafficway.UNDIVIDED


# --- contradictions --------------------------------------------------------------------------------------------------
def is_on_ramp(record: CrashRecord) -> bool:
    """Return whether the report places the crash on a ramp.

    It uses the relation to the junction, the road's name and ``VTRAFWAY``.

    >>> is_on_ramp(record)
    False
    """
    return (
        record.junction_relation_code == _ON_RAMP
        or parse_street(record.trafficway_1).ramp
        or any(trafficway_of(vehicle) == Trafficway.RAMP for vehicle in pair_of(record))
    )


def is_numbered_as_reported(record: CrashRecord, road: Road) -> bool | None:
    """Return whether a road has a number of the system that ``ROUTE`` names.

    None if the report names no system, or if the road has only names and needs no number.

    >>> is_numbered_as_reported(record, network.road_by_id[map_report.placement.road_id])  # ROUTE 3, ref NE 411
    True
    """
    wanted = _SYSTEMS.get(record.route_code or 0)
    systems = {route.system for name in road.names for route in parse_street(name).routes}
    if wanted is None:
        federal = {RouteSystem.INTERSTATE, RouteSystem.US}
        return False if record.route_code is not None and not federal.isdisjoint(systems) else None
    return wanted in systems or RouteSystem.UNKNOWN in systems


def is_town_street_for_interstate(record: CrashRecord, road: Road) -> bool:
    """Return whether the report is of an interstate but the road is a town's street.

    >>> is_town_street_for_interstate(record, network.road_by_id[map_report.placement.road_id])
    False
    """
    interstate = _INTERSTATE in (record.function_class_code, record.route_code) and not is_on_ramp(record)
    return interstate and road_class(road.highway).rank >= _TOWN_STREET


def has_name_of_another(record: CrashRecord, names: Collection[str], network: RoadNetwork) -> bool:
    """Return whether none of a place's ``names`` is reported, and the first reported one is elsewhere.

    A ramp has no name of its own, and is reported under that of its road.

    >>> has_name_of_another(record, {"Elder Street"}, network), has_name_of_another(record, {"Low Road"}, network)
    (False, True)
    """
    reported = [name for name in (record.trafficway_1, record.trafficway_2) if name]
    if not reported or is_on_ramp(record):
        return False
    if any(is_same_street(name, names) for name in reported):
        return False
    return is_same_street(reported[0], {name for road in network.roads for name in road.names})


def contradiction(record: CrashRecord, road: Road, names: Collection[str], network: RoadNetwork) -> str:
    """Return a sentence on a contradiction that rules out a road; empty if there is none.

    ``names`` are those of the road, and at a crossing also of the roads that meet it.

    >>> main_street = network.road_by_id[map_report.placement.road_id]
    >>> contradiction(record, main_street, main_street.names, network)
    ''
    """
    called = road.name or f"a road without a name ({road.highway})"
    if _has_other_name(record, names):
        elsewhere = ", which is elsewhere on the map" if has_name_of_another(record, names, network) else ""
        return f"The report names {record.trafficway_1}{elsewhere}; the road there is {called}."
    if is_town_street_for_interstate(record, road):
        return f"The report is of an interstate; the road there is {called} ({road.highway})."
    if is_on_ramp(record) and not road.is_ramp and _has_ramp_near(network):
        return (
            f"The report is of a ramp, and the map has one within {_RAMPS_WITHIN_M:.0f} m; the road there is {called}."
        )
    return ""


def _has_other_name(record: CrashRecord, names: Collection[str]) -> bool:
    """Return whether a place has names other than those reported, if the first one can be compared."""
    if is_on_ramp(record) or similarity(record.trafficway_1, names) is None:
        return False
    likeness = best_similarity((record.trafficway_1, record.trafficway_2), names)
    return likeness is not None and likeness < OTHER_STREET


def _has_ramp_near(network: RoadNetwork) -> bool:
    """Return whether a ramp is near the reported point, which is the origin of the network's frame."""
    matches = network.nearest_lanes(0.0, 0.0, _RAMPS_WITHIN_M)
    return any(network.road_by_id[match.lane.road_id].is_ramp for match in matches)
