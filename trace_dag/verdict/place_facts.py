"""Reported facts of the place beside the map: its streets, the road, the intersection, the point itself.

Lanes, division, control and limit of each vehicle are compared with the road on which it drives
(:mod:`trace_dag.roads.crash_site.agreement`). Features added to the map from the report alone are no facts here.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from typing import Final

from trace_dag.common.units import wrap_angle
from trace_dag.crash.classes import RoadTopology
from trace_dag.crash.codes.elements import FUNC_SYS, RUR_URB
from trace_dag.crash.record import CrashRecord
from trace_dag.roads.crash_site.agreement import (
    AGREES,
    CONTROL,
    DIVISION,
    INTERSECTION,
    LANES,
    LIMIT,
    NOT_COMPARABLE,
    SiteStreets,
    bend_rad,
    compare,
    streets_at,
)
from trace_dag.roads.crash_site.placement import class_steps, is_at_intersection
from trace_dag.roads.crash_site.reported_road import Trafficway, trafficway_on_map
from trace_dag.roads.crash_site.street_names import OTHER_STREET, SAME_STREET, is_same_street, parse_street, similarity
from trace_dag.roads.map.model import Road
from trace_dag.roads.map.network import RoadNetwork
from trace_dag.roads.report import Comparison, CrashPlacement, MapReport
from trace_dag.verdict.observation import ObservedVehicle
from trace_dag.verdict.types import Agreement, ComparedWith, Fact

_SAME_CLASS: Final = 1.0  # steps between classes: mapper and agency often differ by one,
_NEAR_CLASS: Final = 2.2  # hardly by more than two
_INTERSTATE: Final = 1  # FUNC_SYS
_LAND_USE: Final = frozenset({1, 2})  # RUR_URB: rural, urban
_URBAN: Final = 2
_NEIGHBOURHOOD_M: Final = 300.0
_RURAL_JUNCTIONS: Final = 4
_URBAN_JUNCTIONS: Final = 8
_ON_THE_ROAD_M: Final = 0.5
_BESIDE_THE_ROAD_M: Final = 4.0  # a lane's width
_BEND_REACH_M: Final = 40.0
_STRAIGHT_RAD: Final = math.radians(4)  # over twice the reach: a radius of 1.1 km
_CURVED_RAD: Final = math.radians(8)
_ALONG_RAD: Final = math.radians(50)
_CURVES: Final = {1: 0, 2: -1, 3: 1}  # VALIGN: straight, curve to the right, to the left

_KINDRED: Final = frozenset({RoadTopology.FOUR_WAY, RoadTopology.T, RoadTopology.Y})
"""Kinds of intersection that maps and reports have for each other: a driveway is an arm to the one and not to the
other, a skewed T is a Y."""
_ESSENTIAL_COMPARISONS: Final = frozenset({INTERSECTION})
_FACT_OF: Final = {
    LANES: "lanes",
    INTERSECTION: "intersection",
    DIVISION: "division",
    CONTROL: "control",
    LIMIT: "limit",
}


def place_facts(
    record: CrashRecord, network: RoadNetwork, report: MapReport, seen: Sequence[ObservedVehicle] = ()
) -> Iterator[Fact]:
    """Yield every fact about the place that both report and map have; ``seen`` are the vehicles in the simulation.

    >>> facts = {fact.name: fact for fact in place_facts(record, network, map_report)}
    >>> facts["lanes"].reported, facts["lanes"].found, facts["lanes"].agreement.value
    ('4', '4', 'agrees')
    """
    streets = streets_at(network, record, report.placement)
    yield from _street_names(record, network, report.placement, streets)
    yield from _road_class(record, network, report.placement, streets)
    yield from _land_use(record, network, report.placement)
    yield from _compared_roads(record, network, report, seen)
    yield _moved(report.placement)
    yield from _alignment(record, network, report.placement, seen)


# --- streets -----------------------------------------------------------------------------------------------------
def _street_names(
    record: CrashRecord, network: RoadNetwork, placement: CrashPlacement, streets: SiteStreets
) -> Iterator[Fact]:
    at_intersection = is_at_intersection(record)
    named = (("first street", record.trafficway_1, True), ("second street", record.trafficway_2, at_intersection))
    here = _names_of(network, placement, streets)
    around = {name for road in network.roads for name in road.names}
    on_ramp = network.road_by_id[placement.road_id].highway.endswith("_link")
    on_reported_ramp = on_ramp and any(parse_street(name).ramp for _, name, _ in named)
    for fact, reported, essential in named:
        agreement = _agreement_of_names(reported, here, around, on_reported_ramp=on_reported_ramp)
        if agreement is not None:
            found = ", ".join(sorted(here)) or "no name"
            yield Fact(fact, ComparedWith.MAP, agreement, reported, found, essential)


def names_at(record: CrashRecord, network: RoadNetwork, placement: CrashPlacement) -> set[str]:
    """Return names and numbers of every street at the place of the crash.

    >>> sorted(names_at(record, network, map_report.placement))
    ['Elder Street', 'Main Street', 'NE 411']
    """
    return _names_of(network, placement, streets_at(network, record, placement))


def _names_of(network: RoadNetwork, placement: CrashPlacement, streets: SiteStreets) -> set[str]:
    roads: list[Road] = [*streets.own.roads, network.road_by_id[placement.road_id]]
    roads += streets.cross.roads if streets.cross else ()
    roads += [network.road_by_id[road_id] for road_id in placement.cross_road_ids]
    names = {name for road in roads for name in road.names}
    return names | {name for arm in (streets.crossing.arms if streets.crossing else ()) for name in arm.names}


def _agreement_of_names(reported: str, here: set[str], around: set[str], *, on_reported_ramp: bool) -> Agreement | None:
    """Return the agreement of a reported street with those ``here``; None if it cannot be compared.

    A reported number can only differ on a map with route numbers, and a reported name only on one with street names.
    """
    wanted = parse_street(reported)
    if not wanted.routes and not wanted.names:
        return None
    value = similarity(reported, here)
    if value is not None and value >= SAME_STREET:
        return Agreement.AGREES
    if wanted.ramp:
        return None  # ramps seldom bear a name
    is_around = is_same_street(reported, around)
    if on_reported_ramp and is_around:
        return Agreement.NEAR  # a ramp leads from one street to the other
    if value is not None:
        return Agreement.DIFFERS if value < OTHER_STREET else Agreement.NEAR
    if is_around:
        return Agreement.DIFFERS if here else Agreement.NEAR
    parsed = [parse_street(name) for name in around]
    if wanted.routes and not wanted.names and here:
        return Agreement.DIFFERS if any(name.routes for name in parsed) else None
    return None


# --- road --------------------------------------------------------------------------------------------------------
def _road_class(
    record: CrashRecord, network: RoadNetwork, placement: CrashPlacement, streets: SiteStreets
) -> Iterator[Fact]:
    """Yield ``FUNC_SYS`` compared with OSM's class.

    Classes are a matter of opinion, but carriageways are not, so it also yields whether an interstate is divided (FHWA,
    Highway Functional Classification Concepts).
    """
    road = network.road_by_id[placement.road_id]
    reported = FUNC_SYS.meaning(record.function_class_code)
    steps = class_steps(record, road)
    if steps is not None:
        agreement = Agreement.DIFFERS
        if steps < _SAME_CLASS:
            agreement = Agreement.AGREES
        elif steps < _NEAR_CLASS:
            agreement = Agreement.NEAR
        yield Fact("road class", ComparedWith.MAP, agreement, reported, road.highway)
    if record.function_class_code == _INTERSTATE:
        ways = {trafficway_on_map(way) for way in streets.own.carriageways}
        agreement = Agreement.DIFFERS if ways == {Trafficway.UNDIVIDED} else Agreement.AGREES
        found = ", ".join(sorted(way.value for way in ways))
        yield Fact("carriageways", ComparedWith.MAP, agreement, reported, found, essential=True)


def _land_use(record: CrashRecord, network: RoadNetwork, placement: CrashPlacement) -> Iterator[Fact]:
    """Yield ``RUR_URB`` compared with the density of streets."""
    if record.rural_urban_code not in _LAND_USE:
        return
    junctions = sum(
        junction.centre_xy_m is not None
        and math.dist(junction.centre_xy_m, (placement.x_m, placement.y_m)) <= _NEIGHBOURHOOD_M
        for junction in network.junctions
    )
    urban = record.rural_urban_code == _URBAN
    agreement = Agreement.NEAR
    if junctions >= _URBAN_JUNCTIONS:
        agreement = Agreement.AGREES if urban else Agreement.DIFFERS
    elif junctions <= _RURAL_JUNCTIONS:
        agreement = Agreement.DIFFERS if urban else Agreement.AGREES
    found = f"{junctions} junctions within {_NEIGHBOURHOOD_M:.0f} m"
    yield Fact("land use", ComparedWith.MAP, agreement, RUR_URB.meaning(record.rural_urban_code), found)


def _compared_roads(
    record: CrashRecord, network: RoadNetwork, report: MapReport, seen: Sequence[ObservedVehicle]
) -> Iterator[Fact]:
    """Yield the map's comparisons; those of a vehicle are with the road on which it drives.

    Features that the map only got from the report are not compared.
    """
    driven = {vehicle.number: vehicle.road_id for vehicle in seen if vehicle.road_id is not None}
    own = {each.attribute: each for each in compare(network, record, report.placement, driven)} if driven else {}
    for comparison in report.comparisons:
        known = comparison.attribute != INTERSECTION and comparison.agreement != NOT_COMPARABLE
        yield from _compared(own.get(comparison.attribute, comparison) if known else comparison)


def _compared(comparison: Comparison) -> Iterator[Fact]:
    if comparison.agreement == NOT_COMPARABLE:
        return
    agreement = Agreement.AGREES if comparison.agreement == AGREES else Agreement.DIFFERS
    reported, mapped = comparison.reported or "", comparison.mapped or ""
    if agreement is Agreement.DIFFERS and comparison.attribute == INTERSECTION and {reported, mapped} <= _KINDRED:
        agreement = Agreement.NEAR
    essential = comparison.attribute in _ESSENTIAL_COMPARISONS
    said, found = reported.replace("_", " "), mapped.replace("_", " ")
    yield Fact(_FACT_OF[comparison.attribute], ComparedWith.MAP, agreement, said, found, essential)


def _moved(placement: CrashPlacement) -> Fact:
    agreement = Agreement.DIFFERS
    if placement.moved_m <= _ON_THE_ROAD_M:
        agreement = Agreement.AGREES
    elif placement.moved_m <= _BESIDE_THE_ROAD_M:
        agreement = Agreement.NEAR
    return Fact("point", ComparedWith.MAP, agreement, "on its road", f"moved by {placement.moved_m:.1f} m")


# --- alignment ---------------------------------------------------------------------------------------------------
def _alignment(
    record: CrashRecord, network: RoadNetwork, placement: CrashPlacement, vehicles: Sequence[ObservedVehicle]
) -> Iterator[Fact]:
    """Yield ``VALIGN`` of each vehicle that came along the crash's road, compared with the bend of that road."""
    bend = bend_rad(network, placement, _BEND_REACH_M)
    line = network.road_geometry(placement.road_id).line
    heading = line.at(line.project(placement.x_m, placement.y_m)[0])[2]
    reported = {vehicle.number: vehicle for vehicle in record.vehicles}
    for seen in vehicles:
        vehicle = reported.get(seen.number)
        curve = _CURVES.get(vehicle.alignment_code or 0) if vehicle else None
        turned = _bend_seen(bend, heading, seen)
        if curve is None or turned is None:
            continue
        mapped = 0 if abs(turned) < _STRAIGHT_RAD else int(math.copysign(1, turned))
        agreement = Agreement.AGREES if mapped == curve else Agreement.DIFFERS
        if agreement is Agreement.DIFFERS and curve * mapped == 0 and abs(turned) < _CURVED_RAD:
            agreement = Agreement.NEAR
        words = {0: "straight", -1: "curve to the right", 1: "curve to the left"}
        found = f"{words[mapped]} ({math.degrees(abs(turned)):.0f} deg within {2 * _BEND_REACH_M:.0f} m)"
        yield Fact("alignment", ComparedWith.MAP, agreement, words[curve], found, vehicle_number=seen.number)


def _bend_seen(bend: float, heading: float, seen: ObservedVehicle) -> float | None:
    """Return the bend as seen by a vehicle on that road, positive to its left; None for one from another direction."""
    off = abs(wrap_angle(seen.approach_rad - heading))
    if off < _ALONG_RAD:
        return bend
    return -bend if math.pi - off < _ALONG_RAD else None
