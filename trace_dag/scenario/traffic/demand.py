"""Vehicles and their routes through a network for SUMO: arrivals at its edges by volume, and turns."""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Collection, Mapping
from dataclasses import dataclass
from functools import cached_property
from typing import Final

import numpy as np
from lxml import etree

from trace_dag.crash.parties import SURROUNDING
from trace_dag.crash.record import VehicleClass
from trace_dag.roads.map.network import RoadNetwork
from trace_dag.scenario.traffic.sumo_network import origin_of
from trace_dag.scenario.traffic.surrounding import body_of_class
from trace_dag.scenario.traffic.volumes import (
    MIXED,
    MOST_PER_HOUR,
    Hour,
    TrafficClass,
    hourly_volume,
    traffic_class,
    vehicle_mix,
)
from trace_dag.simulation.types import Body

_MOST_EDGES: Final = 200  # of a route: nobody goes round in circles for ever
_LEAST_ENTRY_M: Final = 25.0  # of an edge that a vehicle appears on: longer than any is
_SECONDS_PER_HOUR: Final = 3600.0
_MERGING: Final = {"jmTimegapMinor": "0.3", "impatience": "0.5"}  # judgement; SUMO has 1 s and 0
_VCLASSES: Final = {
    VehicleClass.MOTORCYCLE: "motorcycle",
    VehicleClass.BUS: "bus",
    VehicleClass.TRUCK: "truck",
    VehicleClass.TRACTOR_TRAILER: "trailer",
}


@dataclass(frozen=True)
class Edge:
    """A directed road of a network: its class, lanes open to traffic, their length (m) and limit (m/s)."""

    traffic_class: TrafficClass | None
    lanes: int
    length_m: float
    limit_mps: float


@dataclass(frozen=True)
class Trip:
    """A vehicle: its departure (s of the crash's clock), its class, and its edges in order."""

    number: int
    depart_s: float
    vehicle_class: VehicleClass
    edges: tuple[str, ...]


class Streets:
    """The edges of a network, each with its successors."""

    def __init__(self, net: etree._Element, network: RoadNetwork) -> None:
        self._follow: dict[str, set[str]] = defaultdict(set)
        self.edges: dict[str, Edge] = {}
        ends = {}
        for edge in net.iterfind("edge[@priority]"):
            lanes = [lane for lane in edge.iterfind("lane") if lane.get("type") != "bidirectional"]
            if not lanes:
                continue
            name, lane = edge.get("id", ""), lanes[0]
            ends[name] = edge.get("from"), edge.get("to")
            highway = network.road_by_id[origin_of(lane)[0]].highway
            length_m, limit_mps = (float(lane.get(each, "0")) for each in ("length", "speed"))
            self.edges[name] = Edge(traffic_class(highway), len(lanes), length_m, limit_mps)
        for link in net.iterfind("connection"):
            before, after = link.get("from", ""), link.get("to", "")
            if before in self.edges and after in self.edges and ends[before] != ends[after][::-1]:
                self._follow[before].add(after)

    @cached_property
    def entries(self) -> list[str]:
        """Return the edges without a predecessor: at the border of the map, and at dead ends."""
        led_to = {after for follow in self._follow.values() for after in follow}
        return [name for name in self.edges if name not in led_to]

    def volume(self, name: str, at: Hour) -> float:
        """Return the vehicles an hour on all lanes of an edge, by the tables."""
        edge = self.edges[name]
        return 0.0 if edge.traffic_class is None else edge.lanes * hourly_volume(edge.traffic_class, at)

    def trips(self, at: Hour, *, from_s: float, until_s: float, factor: float, seed: int) -> list[Trip]:
        """Return random arrivals (Poisson) at every entry; at junctions vehicles turn by the roads' volumes.

        ``factor`` scales the volumes, up to a lane's capacity. Equal arguments give equal trips.
        """
        random = np.random.default_rng(seed)
        found: list[tuple[float, VehicleClass, tuple[str, ...]]] = []
        for name in self.entries:
            edge = self.edges[name]
            if edge.traffic_class is None:
                continue
            mix = vehicle_mix(edge.traffic_class, at)
            per_s = min(factor * self.volume(name, at), edge.lanes * MOST_PER_HOUR) / _SECONDS_PER_HOUR
            arrivals = random.uniform(from_s, until_s, random.poisson(per_s * (until_s - from_s)))
            for depart_s in sorted(arrivals):
                vehicle_class = list(mix)[random.choice(len(mix), p=list(mix.values()))]
                route = self._route(name, at, random)
                begin = next((k for k, each in enumerate(route) if self.edges[each].length_m >= _LEAST_ENTRY_M), None)
                if begin is not None:
                    found.append((round(float(depart_s), 1), vehicle_class, route[begin:]))
        found.sort(key=lambda trip: trip[0])
        return [Trip(number, *trip) for number, trip in enumerate(found, SURROUNDING + 1)]

    def _route(self, entry: str, at: Hour, random: np.random.Generator) -> tuple[str, ...]:
        route = [entry]
        while len(route) < _MOST_EDGES:
            ways = sorted(self._follow[route[-1]])
            carried = np.array([self.volume(name, at) for name in ways])
            if not carried.any():
                break
            route.append(ways[random.choice(len(ways), p=carried / carried.sum())])
        return tuple(route)


def types_xml(types: Mapping[str, Body]) -> bytes:
    """Return SUMO's vehicle types: of each class, and ``types``, all with SUMO's default behaviour.

    Only merging from ramps and side streets accepts smaller gaps (:data:`_MERGING`), because queues grow by default.
    """
    root = etree.Element("additional")
    for name, body in ({each.value: body_of_class(each) for each in MIXED} | dict(types)).items():
        size = {"length": body.length_m, "width": body.width_m, "height": body.height_m}
        kind = {"id": name, "vClass": _VCLASSES.get(body.vehicle_class, "passenger"), **_MERGING}
        etree.SubElement(root, "vType", kind | {key: f"{m:.2f}" for key, m in size.items()})
    return etree.tostring(root)


def routes_xml(trips: Collection[Trip], *, begins_s: float) -> bytes:
    """Return the trips for SUMO, whose clock is 0 at ``begins_s``."""
    root = etree.Element("routes")
    for trip in trips:
        vehicle = etree.SubElement(
            root,
            "vehicle",
            {"id": str(trip.number), "type": trip.vehicle_class.value, "depart": f"{trip.depart_s - begins_s:.1f}"}
            | {"departLane": "best", "departPos": "base", "departSpeed": "max"},
        )
        etree.SubElement(vehicle, "route", edges=" ".join(trip.edges))
    return etree.tostring(root)
