"""Gaps of OSM filled from the report: lane counts, limits, signals, stop and yield signs, driveways.

OSM's own tags are never changed. Lanes and limits are given to the converter as hints, which it uses for untagged ways
only. A signal or sign becomes a tagged node in a copy of the extract and a driveway a way, as a mapper would have drawn
them.
"""

from __future__ import annotations

import math
from collections.abc import Iterable
from dataclasses import dataclass, replace
from itertools import pairwise
from typing import Final, TypeVar

from trace_dag.crash.record import CrashRecord, VehicleRecord
from trace_dag.osm.types import OsmExtract, OsmNode, OsmWay, count_arms
from trace_dag.roads.crash_site.agreement import CONTROL, LANES, LIMIT, SiteStreets, StreetAtCrash, streets_at
from trace_dag.roads.crash_site.driveways import add_driveways
from trace_dag.roads.crash_site.reported_road import Control, Trafficway, control_of, trafficway_of
from trace_dag.roads.from_osm.converter import WayHints
from trace_dag.roads.from_osm.tags import goes_one_way
from trace_dag.roads.map.model import Road
from trace_dag.roads.map.network import RoadNetwork
from trace_dag.roads.report import CrashPlacement

DRIVEWAY: Final = "driveway"
_SIGN_BEFORE_M: Final = 10.0  # where a stop line is, from the middle of the crossing
_SIGN_TAGS: Final = {Control.STOP: "stop", Control.YIELD: "give_way"}
_DIRECTIONS: Final = {True: "forward", False: "backward"}
_METRES_PER_DEGREE: Final = 111_195.0
_Number = TypeVar("_Number", int, float)


@dataclass(frozen=True)
class GapFilling:
    """The extract with the report's signals, signs and driveways, hints by OSM way id, and the filled attributes."""

    extract: OsmExtract
    hints: dict[int, WayHints]
    attributes: frozenset[str]


def fill_gaps(network: RoadNetwork, extract: OsmExtract, record: CrashRecord, placement: CrashPlacement) -> GapFilling:
    """Fill gaps in the map from the report, for the streets at the crash.

    A street is filled along its whole length on the map. Values on which vehicles contradict each other are not used.

    >>> filling = fill_gaps(network, extract, record, map_report.placement)
    >>> filling.attributes, filling.extract is extract  # the sample's ways have lanes, limits and signals of their own
    (frozenset(), True)
    """
    streets = streets_at(network, record, placement)
    hints: dict[int, WayHints] = {}
    filled: set[str] = set()
    for street in _distinct(streets):
        vehicles = [vehicle for vehicle, own in streets.of_vehicle if own is street]
        limit_mps = _agreed(vehicle.speed_limit_mps for vehicle in vehicles)
        for road in _whole_street(network, street):
            lanes = None if road.lanes_from_tags else _agreed(_lanes_of(road, vehicle) for vehicle in vehicles)
            speed_mps = limit_mps if road.speed_mps is None else None
            if lanes is None and speed_mps is None:
                continue
            filled |= {name for name, value in ((LANES, lanes), (LIMIT, speed_mps)) if value is not None}
            hints.update(dict.fromkeys(road.osm_way_ids, WayHints(lanes, speed_mps)))
    with_controls = _add_controls(network, extract, streets)
    if with_controls is not extract:
        filled.add(CONTROL)
    with_driveways = add_driveways(network, with_controls, record, placement)
    if with_driveways is not with_controls:
        filled.add(DRIVEWAY)
    return GapFilling(with_driveways, hints, frozenset(filled))


def _distinct(streets: SiteStreets) -> Iterable[StreetAtCrash]:
    yield streets.own
    if streets.cross is not None:
        yield streets.cross


def _agreed(values: Iterable[_Number | None]) -> _Number | None:
    """Return the value, if all known values are the same."""
    known = {value for value in values if value}
    return known.pop() if len(known) == 1 else None


def _whole_street(network: RoadNetwork, street: StreetAtCrash) -> Iterable[Road]:
    """Yield the roads of a street at the crash, and those of the same name and class beyond."""
    at_crash = {road.id: road for road in street.roads}
    named = {(road.highway, road.one_way, name) for road in street.roads for name in road.names}
    for road in network.roads:
        if road.id in at_crash or (
            road.junction_id is None and any((road.highway, road.one_way, name) in named for name in road.names)
        ):
            yield road


def _lanes_of(road: Road, vehicle: VehicleRecord) -> int | None:
    """Return ``VNUM_LAN`` as the lanes of one road object."""
    lanes, trafficway = vehicle.lanes, trafficway_of(vehicle)
    if lanes is None:
        return None
    if road.one_way:
        if trafficway == Trafficway.UNDIVIDED:
            return lanes // 2 if lanes % 2 == 0 else None
        return lanes
    if trafficway == Trafficway.ONE_WAY:
        return None
    return 2 * lanes if trafficway == Trafficway.DIVIDED else lanes


def _add_controls(network: RoadNetwork, extract: OsmExtract, streets: SiteStreets) -> OsmExtract:
    crossing = streets.crossing
    if crossing is None:
        return extract
    crossing_nodes = {
        node_id
        for junction_id in crossing.junction_ids
        for node_id in network.junction_by_id[junction_id].osm_node_ids
        if node_id in extract.nodes
    }
    for vehicle, street in streets.of_vehicle:
        control = control_of(vehicle)
        if street.controls or control in (None, Control.NONE):
            continue
        if control == Control.SIGNAL:
            extract = _with_signals(extract, crossing_nodes)
        elif control is not None:
            way_ids = {way_id for road in street.roads for way_id in road.osm_way_ids}
            extract = _with_signs(extract, way_ids, crossing_nodes, _SIGN_TAGS[control])
    return extract


def _with_signals(extract: OsmExtract, node_ids: set[int]) -> OsmExtract:
    """Return the extract with signals on nodes of a crossing where ways meet."""
    arms = count_arms(extract.ways)
    new = {
        node_id: node._replace(tags={**node.tags, "highway": "traffic_signals"})
        for node_id in sorted(node_ids)
        if arms[node_id] > 2 and "highway" not in (node := extract.nodes[node_id]).tags
    }
    return replace(extract, nodes={**extract.nodes, **new}) if new else extract


def _with_signs(extract: OsmExtract, way_ids: set[int], crossing_nodes: set[int], tag: str) -> OsmExtract:
    """Return the extract with signs on the ways of a street, before the crossing and facing approaching traffic."""
    nodes = dict(extract.nodes)
    ways = tuple(_way_with_signs(way, nodes, crossing_nodes, tag) if way.id in way_ids else way for way in extract.ways)
    return extract if nodes == extract.nodes else replace(extract, nodes=nodes, ways=ways)


def _way_with_signs(way: OsmWay, nodes: dict[int, OsmNode], crossing_nodes: set[int], tag: str) -> OsmWay:
    one_way = goes_one_way(way.tags)
    node_ids = [way.node_ids[0]]
    for a, b in pairwise(way.node_ids):
        towards_b = b in crossing_nodes and a not in crossing_nodes
        towards_a = a in crossing_nodes and b not in crossing_nodes and not one_way
        if towards_a or towards_b:
            far, crossing = (nodes[a], nodes[b]) if towards_b else (nodes[b], nodes[a])
            sign_id = _add_sign(nodes, far, crossing, {"highway": tag, "direction": _DIRECTIONS[towards_b]})
            if sign_id is not None:
                node_ids.append(sign_id)
        node_ids.append(b)
    return way._replace(node_ids=tuple(node_ids))


def _add_sign(nodes: dict[int, OsmNode], far: OsmNode, crossing: OsmNode, tags: dict[str, str]) -> int | None:
    """Add a sign between two nodes of a way; return the id of its node.

    If there is no room for a new node, tag the far node and return None.
    """
    length_m = _distance_m(far, crossing)
    if length_m <= 2 * _SIGN_BEFORE_M:
        if "highway" not in far.tags:
            nodes[far.id] = far._replace(tags={**far.tags, **tags})
        return None
    share = _SIGN_BEFORE_M / length_m
    sign = OsmNode(
        min(0, *nodes) - 1,
        crossing.latitude_deg + share * (far.latitude_deg - crossing.latitude_deg),
        crossing.longitude_deg + share * (far.longitude_deg - crossing.longitude_deg),
        tags,
    )
    nodes[sign.id] = sign
    return sign.id


def _distance_m(a: OsmNode, b: OsmNode) -> float:
    east = (a.longitude_deg - b.longitude_deg) * math.cos(math.radians(a.latitude_deg))
    return _METRES_PER_DEGREE * math.hypot(east, a.latitude_deg - b.latitude_deg)
