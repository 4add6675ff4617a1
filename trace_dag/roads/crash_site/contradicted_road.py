"""Contradictions between a report and a road of the map that rule the road out."""

from __future__ import annotations

from collections.abc import Collection
from typing import Final

from trace_dag.crash.record import CrashRecord
from trace_dag.osm.road_classes import road_class
from trace_dag.roads.crash_site.reported_road import Trafficway, pair_of, trafficway_of
from trace_dag.roads.crash_site.street_names import OTHER_STREET, SAME_STREET, RouteSystem, parse_street, similarity
from trace_dag.roads.map.model import Road
from trace_dag.roads.map.network import RoadNetwork

_INTERSTATE: Final = 1  # FUNC_SYS and ROUTE
_ON_RAMP: Final = 20  # RELJCT2; 5 is related to a ramp only
_TOWN_STREET: Final = 3  # rank of the most important class that is one: OSM's secondary
_RAMPS_WITHIN_M: Final = 100.0
_SYSTEMS: Final = {1: RouteSystem.INTERSTATE, 2: RouteSystem.US, 3: RouteSystem.STATE, 4: RouteSystem.COUNTY}
"""``ROUTE``: who signs the road, where it is numbered."""


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
    if any((similarity(name, names) or 0.0) >= SAME_STREET for name in reported):
        return False
    around = {name for road in network.roads for name in road.names}
    return (similarity(reported[0], around) or 0.0) >= SAME_STREET


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
    if is_on_ramp(record) and not road.highway.endswith("_link") and _has_ramp_near(network):
        return (
            f"The report is of a ramp, and the map has one within {_RAMPS_WITHIN_M:.0f} m; the road there is {called}."
        )
    return ""


def _has_other_name(record: CrashRecord, names: Collection[str]) -> bool:
    """Return whether a place has names other than those reported, if the first one can be compared."""
    reported = [name for name in (record.trafficway_1, record.trafficway_2) if name]
    if is_on_ramp(record) or similarity(record.trafficway_1, names) is None:
        return False
    likeness = [value for name in reported if (value := similarity(name, names)) is not None]
    return max(likeness) < OTHER_STREET


def _has_ramp_near(network: RoadNetwork) -> bool:
    """Return whether a ramp is near the reported point, which is the origin of the network's frame."""
    matches = network.nearest_lanes(0.0, 0.0, _RAMPS_WITHIN_M)
    return any(network.road_by_id[match.lane.road_id].highway.endswith("_link") for match in matches)
