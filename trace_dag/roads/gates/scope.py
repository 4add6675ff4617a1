"""The scope of a crash: the roads that it can use, a map without bad roads elsewhere, and the ends of the data.

A map is rejected for a road that the crash can use. A road that fails a gate farther away is left out, with a note in
the map's report.
"""

from __future__ import annotations

import heapq
from collections import defaultdict
from collections.abc import Collection
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Final

import numpy as np
import shapely

from trace_dag.common.settings import RoadSettings
from trace_dag.roads.from_osm.converter import MapLimits
from trace_dag.roads.gates.gates import check_map
from trace_dag.roads.map.model import ContactPoint, Road, RoadLink
from trace_dag.roads.map.rules import StoredMap
from trace_dag.roads.map.writer import write_opendrive
from trace_dag.roads.report import CrashPlacement, DataEnd, LeftOutRoad, MapGate

if TYPE_CHECKING:
    from trace_dag.osm.types import OsmExtract, OsmWay
    from trace_dag.roads.map.network import RoadNetwork

_IN_USE_M: Final = 200.0  # along the roads: what 40 m/s (90 mph) cover in the 5 s that are reconstructed
_MOST_ROUNDS: Final = 20
_SAME_END_M: Final = 15.0  # a road cut off just behind a junction is prolonged by up to 12 m


@dataclass(frozen=True)
class CheckedMap:
    """A map as converted and as written, its gates, and the roads that were left out of it."""

    network: RoadNetwork
    stored: StoredMap
    gates: tuple[MapGate, ...]
    left_out: tuple[LeftOutRoad, ...]


def check_in_scope(
    network: RoadNetwork,
    extract: OsmExtract,
    placement: CrashPlacement,
    *,
    name: str,
    limits: MapLimits,
    settings: RoadSettings,
) -> CheckedMap:
    """Return the map written and checked, without unusable roads that fail a gate."""
    used: frozenset[str] | None = None
    left_out: list[LeftOutRoad] = []
    while True:
        stored = StoredMap(write_opendrive(network, marks=settings.marks), name=name)
        ways = [way_id for road in left_out for way_id in road.osm_way_ids]
        gates = check_map(network, extract, stored, placement, limits=limits, left_out_ways=ways)
        failed = next((gate for gate in gates if gate.passed is False), None)
        checked = CheckedMap(network, stored, gates, tuple(left_out))
        if failed is None or settings.gate_scope == "all" or len(left_out) >= _MOST_ROUNDS:
            return checked
        used = roads_in_use(network, placement) if used is None else used
        bad = [road_id for road_id in failed.road_ids if road_id not in used]
        far = [way for way in extract.ways if way.id in failed.way_ids and _is_far(way, network, extract, placement)]
        if not bad and not far:
            return checked
        for way in far:
            name = way.tags.get("name", "")
            left_out.append(LeftOutRoad("", name, (way.id,), f"{failed.name}: no road could be made of way {way.id}"))
        for road_id in bad:
            road = network.road_by_id[road_id]
            left_out.append(LeftOutRoad(road_id, road.name, road.osm_way_ids, f"{failed.name}: {failed.detail}"))
        if bad:
            network = drop_roads(network, bad)


def _is_far(way: OsmWay, network: RoadNetwork, extract: OsmExtract, placement: CrashPlacement) -> bool:
    """Return whether a way lies farther from the crash than the beginning of any usable road."""
    line = shapely.LineString(extract.local_xy_m(way.node_ids, network.frame))
    return bool(line.distance(shapely.Point(placement.x_m, placement.y_m)) >= _IN_USE_M)


def roads_in_use(network: RoadNetwork, placement: CrashPlacement) -> frozenset[str]:
    """Return the roads that begin less than 200 m from the crash along the roads, in either direction.

    >>> len(roads_in_use(network, map_report.placement)) < len(network.roads)
    True
    """
    return frozenset(road_id for road_id, begins_m in _distances_m(network, placement).items() if begins_m < _IN_USE_M)


def data_ends(network: RoadNetwork, extract: OsmExtract, placement: CrashPlacement) -> tuple[DataEnd, ...]:
    """Return the ends of roads where the data end, with their distances along the roads, nearest first.

    >>> data_ends(network, extract, map_report.placement)  # the sample's map reaches beyond the box
    ()
    """
    nodes = [node.id for node in extract.nodes.values() if node.clipped and node.id > 0]
    if not nodes:
        return ()
    places = extract.local_xy_m(nodes, network.frame)
    begins_m = _distances_m(network, placement)
    here = {placement.road_id, *placement.cross_road_ids}
    found = []
    for road in network.roads:
        line = network.road_geometry(road.id).line
        for _, s_m, link in road.ends:
            if link is not None or road.id not in begins_m:
                continue
            end = np.array(line.at(s_m)[:2])
            if np.hypot(*(places - end).T).min() > _SAME_END_M:
                continue
            along_m = abs(s_m - _station_m(network, road.id, placement)) if road.id in here else road.length_m
            distance_m = begins_m[road.id] + along_m
            found.append(DataEnd(road.id, road.name, round(distance_m, 1)))
    return tuple(sorted(found, key=lambda end: end.distance_m))


def _distances_m(network: RoadNetwork, placement: CrashPlacement) -> dict[str, float]:
    """Return the distance from the crash to the beginning of each road along the roads, in either direction.

    It is 0 for the crash's own road.
    """
    next_to: dict[str, set[tuple[ContactPoint | None, str]]] = defaultdict(set)  # by the end where they meet
    for road in network.roads:
        for own, _, link in road.ends:
            if link is not None and link.element_type == "road":
                next_to[road.id].add((own, link.element_id))
                next_to[link.element_id].add((link.contact_point, road.id))
    here = {placement.road_id, *placement.cross_road_ids}
    reached: dict[str, float] = {}
    queue = [(0.0, road_id) for road_id in sorted(here)]
    while queue:
        begins_m, road_id = heapq.heappop(queue)
        if road_id in reached or road_id not in network.road_by_id:
            continue
        reached[road_id] = begins_m
        length_m = network.road_by_id[road_id].length_m
        crash_m = _station_m(network, road_id, placement) if road_id in here else 0.0
        for end, other in next_to[road_id]:
            away_m = crash_m if road_id in here and end == ContactPoint.START else length_m - crash_m
            heapq.heappush(queue, (begins_m + away_m, other))
    return reached


def _station_m(network: RoadNetwork, road_id: str, placement: CrashPlacement) -> float:
    return network.road_geometry(road_id).line.project(placement.x_m, placement.y_m)[0]


def drop_roads(network: RoadNetwork, road_ids: Collection[str]) -> RoadNetwork:
    """Return the network without some roads, their connecting roads, and all links to these.

    >>> corner = next(road for road in network.roads if road.junction_id is not None)
    >>> len(network.roads) - len(drop_roads(network, [corner.id]).roads)
    1
    """
    gone = set(road_ids)
    for road in network.roads:
        if road.junction_id is not None and not gone.isdisjoint(road.linked_roads):
            gone.add(road.id)
    junctions = [
        replace(
            junction,
            connections=tuple(
                each
                for each in junction.connections
                if each.incoming_road not in gone and each.connecting_road not in gone
            ),
        )
        for junction in network.junctions
    ]
    kept = {junction.id: junction for junction in junctions if junction.connections}
    roads = tuple(_unlinked(road, gone, kept.keys()) for road in network.roads if road.id not in gone)
    signals = {signal.id for road in roads for signal in road.signals}
    controllers = tuple(
        replace(each, signal_ids=left)
        for each in network.controllers
        if (left := tuple(signal_id for signal_id in each.signal_ids if signal_id in signals))
    )
    known = {each.id for each in controllers}
    return replace(
        network,
        roads=roads,
        controllers=controllers,
        junctions=tuple(
            replace(each, controller_ids=tuple(number for number in each.controller_ids if number in known))
            for each in kept.values()
        ),
    )


def _unlinked(road: Road, gone: Collection[str], junctions: Collection[str]) -> Road:
    """Return a road without links to removed roads; its lanes end where the link did."""

    def left(link: RoadLink | None) -> RoadLink | None:
        if link is None:
            return None
        is_there = link.element_id not in gone if link.element_type == "road" else link.element_id in junctions
        return link if is_there else None

    before, after = left(road.predecessor), left(road.successor)
    if (before, after) == (road.predecessor, road.successor):
        return road
    sections = list(road.lane_sections)
    if before is None:
        sections[0] = replace(sections[0], lanes=tuple(replace(each, predecessor=None) for each in sections[0].lanes))
    if after is None:
        sections[-1] = replace(sections[-1], lanes=tuple(replace(each, successor=None) for each in sections[-1].lanes))
    return replace(road, predecessor=before, successor=after, lane_sections=tuple(sections))
