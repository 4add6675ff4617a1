"""The map against the report, at the crash: lanes, limit, division, traffic control, and kind of intersection.

Each attribute agrees, differs, or cannot be compared because one of the two lacks it. If both have it, the map keeps
OSM's value and the difference is recorded. Each vehicle is compared with its street, which is the road on which it
drives in a simulation, if there is one. At a crossing the report does not name the vehicle's street. The street that
fits its lanes, limit, trafficway and control better is taken, or the crash's own street if both fit equally well. Gaps
in OSM are filled from the report in :mod:`trace_dag.roads.crash_site.gap_filling`.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass
from types import MappingProxyType
from typing import Final, TypeAlias

from trace_dag.common.units import mps_to_mph, wrap_angle
from trace_dag.crash.classes import RoadTopology
from trace_dag.crash.record import CrashRecord, VehicleRecord
from trace_dag.osm.road_classes import road_class
from trace_dag.roads.crash_site.crossings import Crossing, find_crossings
from trace_dag.roads.crash_site.placement import is_at_intersection, is_named
from trace_dag.roads.crash_site.reported_road import (
    MOST_LANES,
    Control,
    control_of,
    lanes_as_reported,
    pair_of,
    trafficway_of,
    trafficway_on_map,
)
from trace_dag.roads.crash_site.streets import Carriageway, carriageway_at
from trace_dag.roads.map.model import ContactPoint, Road
from trace_dag.roads.map.network import RoadNetwork
from trace_dag.roads.report import Comparison, CrashPlacement

AGREES: Final = "agrees"
DIFFERS: Final = "differs"
NOT_COMPARABLE: Final = "not comparable"

LANES: Final = "lanes"
INTERSECTION: Final = "intersection type"
DIVISION: Final = "trafficway"
CONTROL: Final = "traffic control"
LIMIT: Final = "speed limit"

_NOBODY: Final[Mapping[int, str]] = MappingProxyType({})
_SIGNAL_TYPES: Final = {"1000001": Control.SIGNAL, "206": Control.STOP, "205": Control.YIELD}
_CROSSING_CONTROL_M: Final = 60.0  # a signal or sign this near to a crossing applies to it
_CRASH_CONTROL_M: Final = 20.0  # between crossings: one this near to the crash
_SAME_LIMIT_MPS: Final = 0.5  # posted limits come in steps of 5 mph (2.2 m/s)
_INTERSECTION_RADIUS_M: Final = 15.0  # within the kerb lines, as FARS has it; the map's junctions reach farther
_BEND_REACH_M: Final = 20.0
_BEND_RAD: Final = math.radians(60)  # a road that turns by this much within twice the reach is an L


@dataclass(frozen=True)
class StreetAtCrash:
    """The roads of one street at the crash: its carriageways, on both sides of a crossing."""

    carriageways: tuple[Carriageway, ...]
    controls: frozenset[Control]

    @property
    def roads(self) -> tuple[Road, ...]:
        """Return its road objects."""
        return tuple(way.road for way in self.carriageways)


@dataclass(frozen=True)
class SiteStreets:
    """The crash's own street, its crossing one (None between crossings), and the street of each vehicle."""

    own: StreetAtCrash
    cross: StreetAtCrash | None
    crossing: Crossing | None
    of_vehicle: tuple[tuple[VehicleRecord, StreetAtCrash], ...]


_MappedOf: TypeAlias = Callable[[VehicleRecord, StreetAtCrash], tuple[str, ...]]


def compare(
    network: RoadNetwork,
    record: CrashRecord,
    placement: CrashPlacement,
    driven: Mapping[int, str] = MappingProxyType({}),
) -> tuple[Comparison, ...]:
    """Compare the attributes that report and map have in common, in a fixed order.

    ``driven`` has the roads of vehicles in a simulation, by number; they replace the streets that fit the report best.

    >>> [(each.attribute, each.reported, each.mapped) for each in compare(network, record, map_report.placement)][:2]
    [('lanes', '4', '4'), ('intersection type', 'four_way', 'four_way')]
    """
    streets = streets_at(network, record, placement, driven)
    return (
        _per_vehicle(LANES, streets),
        _intersection(network, record, placement, streets.crossing),
        *(_per_vehicle(attribute, streets) for attribute in (DIVISION, CONTROL, LIMIT)),
    )


def streets_at(
    network: RoadNetwork,
    record: CrashRecord,
    placement: CrashPlacement,
    driven: Mapping[int, str] = MappingProxyType({}),
) -> SiteStreets:
    """Return the streets at the crash, and the street of each vehicle, which is that of its ``driven`` road if given.

    >>> streets = streets_at(network, record, map_report.placement)
    >>> {road.name for road in streets.own.roads}, {road.name for road in streets.cross.roads}
    ({'Main Street'}, {'Elder Street'})
    """
    crossing = None
    if placement.junction_id is not None:
        crossings = (c for c in find_crossings(network) if placement.junction_id in c.junction_ids)
        crossing = next((c for c in crossings if c.kind is not None), None)
    cross_ids: list[str] = []
    own_ids: Sequence[str] = (placement.road_id,)
    if crossing is not None:
        cross_ids = [road_id for road_id in placement.cross_road_ids if road_id in crossing.road_ids]
        own_ids = [road_id for road_id in crossing.street_of(placement.road_id) if road_id not in cross_ids]
    own = _street(network, placement, own_ids, crossing)
    cross = _street(network, placement, cross_ids, crossing) if cross_ids else None

    def street_of(vehicle: VehicleRecord) -> StreetAtCrash:
        road_id = driven.get(vehicle.number)
        if road_id is None:
            return _street_by_form(vehicle, own, cross)
        road = network.road_by_id[road_id]
        for street in (own, cross):
            if street and any(road is each or set(road.names) & set(each.names) for each in street.roads):
                return street
        return _street(network, placement, crossing.street_of(road_id) if crossing else (road_id,), crossing)

    return SiteStreets(own, cross, crossing, tuple((vehicle, street_of(vehicle)) for vehicle in pair_of(record)))


def _street_by_form(vehicle: VehicleRecord, own: StreetAtCrash, cross: StreetAtCrash | None) -> StreetAtCrash:
    if cross is None:
        return own
    gain = _fit(vehicle, cross) - _fit(vehicle, own)
    if gain == 0 and control_of(vehicle) in (Control.STOP, Control.YIELD):
        return cross if _is_minor(cross, own) else own  # the street that gives way is the lesser one
    return cross if gain > 0 else own


def _is_minor(street: StreetAtCrash, other: StreetAtCrash) -> bool:
    """Return whether a street ends here, or has a lower class than the other."""
    ranks = [min((road_class(road.highway).rank for road in s.roads), default=math.inf) for s in (street, other)]
    return len(street.roads) < len(other.roads) if ranks[0] == ranks[1] else ranks[0] > ranks[1]


def _street(
    network: RoadNetwork, placement: CrashPlacement, road_ids: Iterable[str], crossing: Crossing | None
) -> StreetAtCrash:
    carriageways = tuple(carriageway_at(network, road_id, placement.x_m, placement.y_m) for road_id in road_ids)
    return StreetAtCrash(carriageways, _controls(network, placement, [way.road for way in carriageways], crossing))


def _controls(
    network: RoadNetwork, placement: CrashPlacement, roads: list[Road], crossing: Crossing | None
) -> frozenset[Control]:
    """Return signals of the whole crossing, stop and yield signs of the street itself."""
    found: set[Control] = set()
    at_x, at_y = crossing.centre_xy_m if crossing else (placement.x_m, placement.y_m)
    reach_m = _CROSSING_CONTROL_M if crossing else _CRASH_CONTROL_M
    own = {road.id for road in roads}
    members = set(crossing.junction_ids) if crossing else set()
    around = own | set(crossing.road_ids) if crossing else own
    for road in network.roads:
        inside = road.junction_id is not None and road.junction_id in members
        if not inside and road.id not in around:
            continue
        for signal in road.signals:
            control = _SIGNAL_TYPES.get(signal.type)
            x_m, y_m = network.road_geometry(road.id).line.at(signal.s_m)[:2]
            if control is None or math.hypot(x_m - at_x, y_m - at_y) > reach_m:
                continue
            if control == Control.SIGNAL or road.id in own or (inside and not own.isdisjoint(road.linked_roads)):
                found.add(control)
    return frozenset(found)


def _fit(vehicle: VehicleRecord, street: StreetAtCrash) -> int:
    """Return the score of a street: matching attributes of a vehicle's road minus different ones."""
    score = 0
    for reported_of, mapped_of in _OF_VEHICLES.values():
        reported, mapped = reported_of(vehicle), mapped_of(vehicle, street)
        if reported is not None and mapped:
            score += 1 if reported in mapped else -1
    return score


def _per_vehicle(attribute: str, streets: SiteStreets) -> Comparison:
    """Return a comparison that agrees if the map has, for every street, a value that a vehicle on it reports.

    Vehicles on one street may report different values, each for its own direction and place (one counts a turn lane
    that the other has passed). The map then agrees if it has one of the values.
    """
    reported_of, mapped_of = _OF_VEHICLES[attribute]
    reported: dict[str, None] = {}
    mapped: dict[str, None] = {}
    agreed: dict[int, bool] = {}
    for vehicle, street in streets.of_vehicle:
        said, shown = reported_of(vehicle), mapped_of(vehicle, street)
        if said is not None:
            reported[said] = None
        if shown:
            mapped["/".join(shown)] = None
        if said is not None and shown:
            agreed[id(street)] = agreed.get(id(street), False) or said in shown
    agreement = NOT_COMPARABLE if not agreed else AGREES if all(agreed.values()) else DIFFERS
    return Comparison(attribute, ", ".join(reported) or None, ", ".join(mapped) or None, agreement)


def _reported_lanes(vehicle: VehicleRecord) -> str | None:
    return str(min(vehicle.lanes, MOST_LANES)) if vehicle.lanes else None


def _mapped_lanes(vehicle: VehicleRecord, street: StreetAtCrash) -> tuple[str, ...]:
    trafficway = trafficway_of(vehicle)
    values = {
        value for way in street.carriageways if way.road.lanes_from_tags for value in lanes_as_reported(way, trafficway)
    }
    return tuple(str(value) for value in sorted(values))


def _reported_trafficway(vehicle: VehicleRecord) -> str | None:
    trafficway = trafficway_of(vehicle)
    return None if trafficway is None else trafficway.value


def _mapped_trafficways(vehicle: VehicleRecord, street: StreetAtCrash) -> tuple[str, ...]:
    return tuple(sorted({trafficway_on_map(way).value for way in street.carriageways}))


def _reported_control(vehicle: VehicleRecord) -> str | None:
    control = control_of(vehicle)
    return None if control is None else control.value


def _mapped_controls(vehicle: VehicleRecord, street: StreetAtCrash) -> tuple[str, ...]:
    """Return the mapped controls.

    "none" counts only if the report has no control, since OSM lacks many signs.
    """
    if street.controls:
        return tuple(sorted(control.value for control in street.controls))
    return (Control.NONE.value,) if control_of(vehicle) == Control.NONE else ()


def _reported_limit(vehicle: VehicleRecord) -> str | None:
    return _limit(vehicle.speed_limit_mps) if vehicle.speed_limit_mps else None


def _mapped_limits(vehicle: VehicleRecord, street: StreetAtCrash) -> tuple[str, ...]:
    limits = {road.speed_mps for road in street.roads if road.speed_mps is not None}
    reported = vehicle.speed_limit_mps
    # Rounded, so that 25 mph and 40 km/h (24.9 mph) print the same.
    return tuple(
        _limit(reported if reported and abs(limit - reported) < _SAME_LIMIT_MPS else limit) for limit in sorted(limits)
    )


def _limit(speed_mps: float) -> str:
    return f"{mps_to_mph(speed_mps):.0f} mph"


_OF_VEHICLES: Final[Mapping[str, tuple[Callable[[VehicleRecord], str | None], _MappedOf]]] = {
    LANES: (_reported_lanes, _mapped_lanes),
    DIVISION: (_reported_trafficway, _mapped_trafficways),
    CONTROL: (_reported_control, _mapped_controls),
    LIMIT: (_reported_limit, _mapped_limits),
}
"""Attributes of a vehicle's road, with the reported value of each and those on the map."""


def _intersection(
    network: RoadNetwork, record: CrashRecord, placement: CrashPlacement, own: Crossing | None
) -> Comparison:
    reported = record.road_topology
    kind = (
        _kind_as_named(network, record, placement, own) if is_at_intersection(record) else _kind_at(network, placement)
    )
    if reported == RoadTopology.OTHERS:
        return Comparison(INTERSECTION, None, kind.value, NOT_COMPARABLE)
    bends = abs(bend_rad(network, placement, _BEND_REACH_M)) > _BEND_RAD
    if kind == RoadTopology.NOT_AN_INTERSECTION and reported == RoadTopology.L and bends:
        kind = RoadTopology.L
    return Comparison(INTERSECTION, reported.value, kind.value, AGREES if kind == reported else DIFFERS)


def _kind_as_named(
    network: RoadNetwork, record: CrashRecord, placement: CrashPlacement, own: Crossing | None
) -> RoadTopology:
    """Return the kind of the reported crossing.

    It is the crash's own crossing, unless only another one has the reported names: a crash on the way to or from a
    crossing may be nearer to another one.
    """
    meant = own
    if own is None or not is_named(own, record):
        named = (c for c in find_crossings(network) if c.kind is not None and is_named(c, record))
        here = (placement.x_m, placement.y_m)
        meant = min(named, key=lambda crossing: math.dist(crossing.centre_xy_m, here), default=own)
    return RoadTopology.NOT_AN_INTERSECTION if meant is None or meant.kind is None else meant.kind


def _kind_at(network: RoadNetwork, placement: CrashPlacement) -> RoadTopology:
    """Return the kind of the crossing that the crash lies in."""
    lane = placement.lane
    junction = network.junction_of(lane.lane) if lane is not None else None
    if junction is None or not junction.kind or junction.centre_xy_m is None:
        return RoadTopology.NOT_AN_INTERSECTION
    distance_m = math.dist(junction.centre_xy_m, (placement.x_m, placement.y_m))
    return RoadTopology(junction.kind) if distance_m <= _INTERSECTION_RADIUS_M else RoadTopology.NOT_AN_INTERSECTION


def bend_rad(network: RoadNetwork, placement: CrashPlacement, reach_m: float) -> float:
    """Return the angle by which the crash's road turns around the crash, radians to the left along its reference line.

    It is measured from ``reach_m`` before the crash to ``reach_m`` behind it.
    """
    s_m = network.road_geometry(placement.road_id).line.project(placement.x_m, placement.y_m)[0]
    before, after = (_heading_along(network, placement.road_id, s_m + reach) for reach in (-reach_m, reach_m))
    return wrap_angle(after - before)


def _heading_along(network: RoadNetwork, road_id: str, s_m: float) -> float:
    """Return the heading of a road at ``s_m``.

    Beyond its end it is that of the linked road, in the same direction.
    """
    road = network.road_by_id[road_id]
    line = network.road_geometry(road_id).line
    on_road_m = min(max(s_m, 0.0), road.length_m)
    beyond_m = abs(s_m - on_road_m)
    link = road.predecessor if s_m < 0.0 else road.successor
    if not beyond_m or link is None or link.element_type != "road":
        return line.at(on_road_m)[2]
    other = network.road_geometry(link.element_id).line
    at_start = link.contact_point == ContactPoint.START
    heading_rad = other.at(min(beyond_m, other.length_m) if at_start else max(other.length_m - beyond_m, 0.0))[2]
    reversed_there = at_start == (s_m < 0.0)
    return heading_rad + math.pi if reversed_there else heading_rad
