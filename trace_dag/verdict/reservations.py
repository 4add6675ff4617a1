"""Doubts about an accepted crash. A doubt is not outweighed by support (:mod:`trace_dag.verdict.support`).

A reported fact that the simulation lacks prevents verification; doubts about street, course or areas also prevent
corroboration.

A simulation may require facts that no report has: missing streets, spins, walks out of lanes. The criteria test the
reported contact, :mod:`trace_dag.verdict.course_events` the reported course. A hypothesis can satisfy both on an
implausible path: into a leg that the map lacks, turned around so that a side is struck, or over fields. Each such
requirement is a named doubt.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping, Sequence
from itertools import combinations
from typing import Final

import numpy as np
import shapely

from trace_dag.common.geometry import FloatArray, rectangle_corners
from trace_dag.common.units import clock_difference_h, kmh_to_mps, mps_to_kmh, mps_to_mph
from trace_dag.crash.classes import RoadTopology
from trace_dag.crash.codes import elements as codes
from trace_dag.crash.crash_types import SIDE_OF_EVENT
from trace_dag.crash.keys import FARS
from trace_dag.crash.parties import EventKind, is_vehicle, party_in_words
from trace_dag.crash.record import CrashRecord, Severity, VehicleClass
from trace_dag.crash.summary import event_in_words, event_named
from trace_dag.crash.zones import is_in_crosswalk
from trace_dag.roads.crash_site.placement import is_at_intersection
from trace_dag.roads.crash_site.reported_road import has_name_of_another, is_on_ramp
from trace_dag.roads.crash_site.street_names import SAME_STREET, similarity
from trace_dag.roads.map.model import Junction
from trace_dag.roads.map.network import RoadNetwork
from trace_dag.roads.map.people import crosswalks
from trace_dag.roads.report import MapReport
from trace_dag.simulation.objects import PlacedBy
from trace_dag.simulation.states import Manoeuvre
from trace_dag.verdict.course_events import course_doubts
from trace_dag.verdict.observation import LEAST_RECORDED_MPS, ObservedCrash
from trace_dag.verdict.place_facts import names_at
from trace_dag.verdict.rules import Comparison
from trace_dag.verdict.types import Agreement, Doubt, EventOutcome, EventResult, Reservation, Support

_OTHER_ROAD: Final[Mapping[str, tuple[float, str]]] = {
    "speed limit": (-1.0, "the speed limit differs by 14 mph or more"),
    "not on the street named first": (-1.0, "it is not on the street named first"),
    "street not named": (-1.0, "the report does not name that street"),
    "not on the map": (-1.0, "it comes out of a driveway that neither the map nor the report has"),
    "alignment": (-1.5, "it is reported in a curve to the other side"),
    "turn from this lane": (-2.0, "nobody goes where it goes from its lane"),
    "driveway reported": (-1.0, "it comes along a street, and a driveway is reported"),
}
"""Evidence terms of a hypothesis by which a vehicle is on another road than its form says: from which log-likelihood
down, and the sentence."""
_DESCRIPTION: Final = frozenset({"road class", "lanes", "limit", "alignment"})
_DIFFERENCES: Final = 2  # one is often the map's or the agency's: by eye most crashes with one are right
_LEAST_HARM_MPS: Final = {Severity.KILLED: kmh_to_mps(16.0), Severity.SERIOUS: kmh_to_mps(8.0)}
"""Least change of velocity of any vehicle that can have done the harm, by the severity of the crash. A death: 10 mph,
at which the risk is 4 in 10,000 by Joksch (1993), (delta-v / 71 mph)^4. A serious injury: what an event data recorder
has to record (49 CFR 563.5). Lesser injuries come of any impact."""
_ALONG_STREETS: Final = frozenset(
    {Manoeuvre.STRAIGHT, Manoeuvre.CURVE, Manoeuvre.TURN_LEFT, Manoeuvre.TURN_RIGHT, Manoeuvre.U_TURN}
)
_CROSSES: Final = frozenset({Manoeuvre.CROSS_FROM_LEFT, Manoeuvre.CROSS_FROM_RIGHT})
_NO_STREET_M: Final = 6.0  # beyond the edge of every carriageway: a driveway's mouth and a shoulder are nearer
_LEG_M: Final = 40.0  # from the impact
_FOUR_ARMS: Final = frozenset({RoadTopology.FOUR_WAY, RoadTopology.FIVE_POINT_OR_MORE})
_FAR_M: Final = 45.0
"""Beyond the edge. Judgement: five times the clear zone of a freeway (9.1 m, AASHTO Roadside Design Guide)."""
_BACKWARDS_DEG: Final = 120.0  # between heading and course
_DRIVES_MPS: Final = 3.0
_SKIDS_SIDEWAYS: Final = frozenset({3, 4, 5})  # PCRASH4
_CROSSING_DEG: Final = 30.0  # between the lanes of two streets
_AWAY_M: Final = 20.0  # from the middle of a junction
_IN_LANE_M: Final = 0.5  # the edge of a carriageway is drawn no better than so
_CROSSWALK_M: Final = 3.0  # beside its lines: its own width
_STANDS_MPS: Final = 0.5
_RESTS_S: Final = 1.2
_SLOW_MPS: Final = kmh_to_mps(16.0)  # the least that can have killed somebody
_MIDDLES: Final = (3.0, 6.0, 9.0)
_CORNER_H: Final = 1.4
"""From the middle of a side or of the rear to its corner (1.5), less what the outline is known by. Fronts are coded 12
o'clock up to their corners."""


def place_doubts(
    record: CrashRecord, network: RoadNetwork, report: MapReport, support: Support
) -> tuple[Reservation, ...]:
    """Return the doubts about an accepted crash that arise from its place, and from what supports it.

    >>> place_doubts(record, network, map_report, verdict.support)
    ()
    """
    found = (_other_street(record, network, report), _other_description(support), _no_areas(record))
    return tuple(each for each in found if each is not None)


def simulation_doubts(beside: Comparison, events: Sequence[EventOutcome]) -> tuple[Reservation, ...]:
    """Return the doubts about one simulation: missing events, no harm, other roads, another course.

    >>> simulation_doubts(comparison, verdict.events)
    ()
    """
    record, observed = beside.record, beside.observed
    harmless = _harmless(record, observed)
    return (
        *_missed(record, events),
        *([] if harmless is None else [harmless]),
        *_other_roads(record, observed),
        *course_doubts(beside),
        *way_doubts(beside),
    )


def _other_street(record: CrashRecord, network: RoadNetwork, report: MapReport) -> Reservation | None:
    """Return the doubt that the crash's street has another name while the reported one is elsewhere on the map."""
    here = names_at(record, network, report.placement)
    if not has_name_of_another(record, here, network):
        return None
    found = ", ".join(sorted(here)) or "a street without a name"
    detail = f"the crash stands on {found}; the report names {record.trafficway_1}, which is elsewhere on the map"
    return Reservation(Doubt.OTHER_STREET, detail)


def _other_description(support: Support) -> Reservation | None:
    """Return the doubt that two or more of the road's class, lanes, limit and alignment differ from the report."""
    found = {
        fact.name: f"{fact.name} {fact.found} for {fact.reported}"
        for fact in support.facts
        if fact.agreement is Agreement.DIFFERS and fact.name in _DESCRIPTION
    }
    if len(found) < _DIFFERENCES:
        return None
    return Reservation(Doubt.OTHER_STREET, f"the road differs from the reported one: {', '.join(found.values())}")


def _other_roads(record: CrashRecord, observed: ObservedCrash) -> Iterator[Reservation]:
    """Yield a doubt for each evidence term that contradicts the road in a vehicle's report."""
    for name, value in observed.hypothesis.evidence.items():
        term, _, whose = name.partition(" (")
        limit, sentence = _OTHER_ROAD.get(term, (-math.inf, ""))
        if value <= limit:
            yield Reservation(Doubt.OTHER_STREET, f"{whose.rstrip(')') or 'the crash'}: {sentence}")
    named = [name for name in (record.trafficway_1, record.trafficway_2) if name]
    if len(named) < 2 or not is_at_intersection(record) or is_on_ramp(record):
        return
    vehicles = {number: drove for event in observed.events for number, drove in event.vehicles.items()}
    for number, drove in vehicles.items():
        road = observed.network.road_by_id.get(drove.road_id or "")
        if road is None:
            continue
        likeness = [similarity(name, road.names) for name in named]  # None: a number beside a name cannot be compared
        if all(value is not None and value < SAME_STREET for value in likeness) or (
            not road.names and road.highway == "service"
        ):
            called = ", ".join(road.names) or "a service road without a name"
            detail = f"vehicle {number} comes along {called}; the report names {' and '.join(named)}"
            yield Reservation(Doubt.OTHER_STREET, detail)


def _missed(record: CrashRecord, events: Sequence[EventOutcome]) -> Iterator[Reservation]:
    """Yield a doubt for each harmful event of the report that can be modelled and does not happen."""
    by_number = {event.number: event for event in record.events}
    for each in events:
        if each.outcome is EventResult.MISSED:
            event = by_number.get(each.event_number)
            what = event_in_words(event) if event else event_named(each.event_number, each.code)
            detail = f"{what}: does not happen in the simulation ({each.why})"
            yield Reservation(Doubt.EVENT_MISSED, detail)


def _no_areas(record: CrashRecord) -> Reservation | None:
    """Return the doubt that the register has no areas of impact to compare."""
    if "impact" not in record.register_lacks:
        return None
    detail = "the register has no areas of impact: that the bodies meet at other parts would not be noticed"
    return Reservation(Doubt.NO_AREAS, detail)


def _harmless(record: CrashRecord, observed: ObservedCrash) -> Reservation | None:
    """Return the doubt that no event of the simulation can have caused the reported harm.

    No vehicle overturns or changes its velocity enough, and no person outside a vehicle is struck that fast, or by a
    vehicle whose reported speed is lower. Whoever rides a motorcycle that another vehicle strikes falls: the change is
    at least the speed ridden.
    """
    least_mps = _LEAST_HARM_MPS.get(record.severity) if record.severity else None
    if least_mps is None or not observed.events or any(event.overturn for event in observed.events):
        return None
    slow = {each.number for each in record.vehicles if (each.travel_speed_mps or math.inf) < least_mps}
    classes = {state.vehicle_number: state.vehicle_class for state in observed.hypothesis.participants}
    change_mps = 0.0
    for event in observed.events:
        if event.person is not None:
            change_mps = max(change_mps, math.inf if event.pair[0] in slow else event.contact.closing_speed_mps)
        for number, side in event.sides.items():
            falls = classes.get(number) is VehicleClass.MOTORCYCLE and classes.keys() >= set(event.pair)
            change_mps = max(change_mps, side.delta_v_mps, abs(side.impact_speed_mps) if falls else 0.0)
    if change_mps >= least_mps:
        return None
    harm = "a death" if record.severity is Severity.KILLED else "a serious injury"
    detail = (
        f"no velocity changes by more than {mps_to_mph(change_mps):.0f} mph, which does not explain {harm} "
        f"(at least {mps_to_mph(least_mps):.0f} mph)"
    )
    return Reservation(Doubt.HARMLESS, detail)


# --- doubts about the ways of vehicles -------------------------------------------------------------------------------
def way_doubts(beside: Comparison) -> Iterator[Reservation]:
    """Yield a doubt for each requirement of a simulation that its report and the map lack.

    >>> list(way_doubts(comparison))
    []
    """
    yield from _missing_legs(beside)
    yield from _strays(beside)
    yield from _other_carriageways(beside)
    yield from _people(beside)
    yield from _other_junction(beside)
    yield from _other_faces(beside)
    yield from _objects_in_one_place(beside)
    yield from _objects_at_rest(beside)


def _missing_legs(beside: Comparison) -> Iterator[Reservation]:
    """Yield a doubt for each vehicle that was going to drive where the map has no street.

    A reported fourth arm is an exception.
    """
    network, record = beside.observed.network, beside.record
    left = {event.party_1 for event in record.events if event.code in SIDE_OF_EVENT}
    for state in beside.observed.hypothesis.participants:
        if state.manoeuvre not in _ALONG_STREETS or state.vehicle_number in left:
            continue
        path, at = state.trajectory, state.impact_pose
        near = np.hypot(path.x_m - at.x_m, path.y_m - at.y_m) <= _LEG_M
        beyond_m = float(network.drivable_area.beyond_m(path.x_m[near], path.y_m[near]).max(initial=0.0))
        here = _junction_at(network, at.x_m, at.y_m)
        arms_missing = here is not None and RoadTopology(here.kind or "others") not in _FOUR_ARMS
        if beyond_m > _NO_STREET_M and not (record.road_topology in _FOUR_ARMS and arms_missing):
            detail = f"vehicle {state.vehicle_number} ({state.manoeuvre.replace('_', ' ')}) was going to drive "
            yield Reservation(Doubt.NO_STREET, f"{detail}{beyond_m:.1f} m beyond every carriageway of the map")


def _strays(beside: Comparison) -> Iterator[Reservation]:
    """Yield a doubt for each vehicle far beyond the carriageways, or backing before the first event."""
    log, network, first = beside.observed.log, beside.observed.network, beside.observed.first
    for state in beside.observed.hypothesis.participants:
        if not is_vehicle(state.vehicle_number):
            continue
        driven = log.vehicle_log(state.vehicle_number)
        far_m = float(network.drivable_area.beyond_m(driven.x_m, driven.y_m).max())
        if far_m > _FAR_M:
            detail = f"vehicle {driven.number} goes {far_m:.1f} m beyond the edge of every carriageway"
            yield Reservation(Doubt.FAR_OFF_ROAD, detail)
        reported = next((v.stability_code for v in beside.record.vehicles if v.number == driven.number), None)
        if first is None or reported in _SKIDS_SIDEWAYS:
            continue
        speeds = np.hypot(driven.velocity_x_mps, driven.velocity_y_mps)
        course = np.arctan2(driven.velocity_y_mps, driven.velocity_x_mps)
        slip_deg = _apart_deg(driven.heading_rad, course)
        before = (speeds >= _DRIVES_MPS) & (driven.time_s <= first.time_s)
        turned_deg = float(slip_deg[before].max(initial=0.0))
        if slip_deg[0] < _BACKWARDS_DEG < turned_deg:  # else it backs
            detail = f"vehicle {driven.number} turns by {turned_deg:.0f} degrees before the first event"
            yield Reservation(Doubt.SPUN, f"{detail}, which the report does not say")


def _other_carriageways(beside: Comparison) -> Iterator[Reservation]:
    """Yield a doubt for each vehicle that leaves its street and then comes onto another one, away from junctions."""
    log, network, record = beside.observed.log, beside.observed.network, beside.record
    for driven in log.vehicles:
        inside = network.drivable_area.contains(driven.x_m, driven.y_m)
        if not is_vehicle(driven.number) or inside.all():
            continue
        own: set[str] = set()
        reported = [name for name in (record.trafficway_1, record.trafficway_2) if name]
        left = int(np.argmin(inside))
        for step in (max(left - 1, 0), *(left + np.flatnonzero(inside[left:]))):
            at = float(driven.x_m[step]), float(driven.y_m[step])
            lanes = [each.lane for each in network.nearest_lanes(*at, 0.0, z_m=float(driven.z_m[step]))]
            streets = {name for lane in lanes for name in network.road_by_id[lane.road_id].names}
            if step < left:
                own = streets
            elif own and streets and not own & streets and not any(network.junction_of(lane) for lane in lanes):
                alike = [similarity(name, streets) for name in reported]
                if all(value is not None and value < SAME_STREET for value in alike):
                    detail = f"vehicle {driven.number} comes onto {' and '.join(sorted(streets))} off its road"
                    yield Reservation(Doubt.OTHER_CARRIAGEWAY, detail)
                break


def _people(beside: Comparison) -> Iterator[Reservation]:
    """Yield a doubt for each person who begins to cross in a lane, or is struck outside the reported crosswalk."""
    network = beside.observed.network
    struck = {event.pair[1]: event for event in beside.observed.events if event.person is not None}
    persons = {person.party: person for person in beside.record.non_motorists}
    for state in beside.observed.hypothesis.participants:
        number, start = state.vehicle_number, state.initial_pose
        if is_vehicle(number):
            continue
        inside_m = -float(network.drivable_area.beyond_m(np.array([start.x_m]), np.array([start.y_m]))[0])
        if state.manoeuvre in _CROSSES and inside_m > _IN_LANE_M:
            detail = f"{party_in_words(number)} begins {inside_m:.1f} m within the carriageway"
            yield Reservation(Doubt.STARTS_IN_LANE, detail)
        drawn = crosswalks(network) if number in persons and is_in_crosswalk(persons[number]) else []
        if drawn and number in struck:
            away_m = min(each.distance_m(*struck[number].xy_m) for each in drawn)
            if away_m > _CROSSWALK_M:
                detail = f"{party_in_words(number)} is struck {away_m:.1f} m from the nearest crosswalk of the map"
                yield Reservation(Doubt.OTHER_ZONE, f"{detail}, reported is a crosswalk")


def _other_junction(beside: Comparison) -> Iterator[Reservation]:
    """Yield the doubt that the first contact is in a junction but not by the report, or the reverse.

    ``RELJCT2`` and ``TYP_INT`` report it.
    """
    first, record, network = beside.observed.first, beside.record, beside.observed.network
    if first is None or first.happening.contact is None or first.departure is not None:
        return
    relation = record.junction_relation_code
    away = relation == codes.AWAY_FROM_JUNCTION and record.road_topology is RoadTopology.NOT_AN_INTERSECTION
    stand = [state.impact_pose for state in beside.observed.hypothesis.participants if not state.impact_speed_mps]
    places = [first.xy_m, *((pose.x_m, pose.y_m) for pose in stand)]
    if (away or relation == codes.INTERSECTION_RELATED) and any(_streets_cross(network, *xy_m) for xy_m in places):
        said = codes.RELJCT2.meaning(relation)
        detail = f"the first contact, or a vehicle that stands, is where streets cross, reported is {said}"
        yield Reservation(Doubt.OTHER_JUNCTION, detail)
    elif record.road_topology is RoadTopology.L or relation != codes.IN_INTERSECTION:  # a map has an L for a bend
        return
    elif _junction_at(network, *first.xy_m) is None:
        detail = f"no junction of the map is within {_AWAY_M:.0f} m of the first contact, reported is an intersection"
        yield Reservation(Doubt.OTHER_JUNCTION, detail)


def _streets_cross(network: RoadNetwork, x_m: float, y_m: float) -> bool:
    """Return whether lanes of two streets of an intersection overlap at a point."""
    headings = []
    for lane in network.nearest_lanes(x_m, y_m, 0.0):
        junction = network.junction_of(lane.lane)
        if junction is not None and junction.kind != RoadTopology.NOT_AN_INTERSECTION:
            headings.append(network.pose(lane.lane, lane.s_m).heading_rad)
    return any(abs(math.degrees(math.remainder(a - b, math.pi))) > _CROSSING_DEG for a, b in combinations(headings, 2))


def _junction_at(network: RoadNetwork, x_m: float, y_m: float) -> Junction | None:
    """Return the junction that contains a point, or one with its middle nearby, or None."""
    for lane in network.nearest_lanes(x_m, y_m, 0.0):
        junction = network.junction_of(lane.lane)
        if junction is not None:
            return junction
    near = [(math.dist(each.centre_xy_m, (x_m, y_m)), each) for each in network.junctions if each.centre_xy_m]
    distance_m, junction = min(near, key=lambda found: found[0], default=(math.inf, None))
    return junction if distance_m <= _AWAY_M else None


def _other_faces(beside: Comparison) -> Iterator[Reservation]:
    """Yield a doubt for each vehicle struck at another face or a corner than reported.

    It concerns the reported middle of a side or the rear, within the criterion's two clock positions. Narratives and
    most other tables name a whole side, so only FARS is compared.
    """
    if beside.record.register != FARS:
        return
    for event in beside.sequence.events:
        seen = beside.seen(event)
        for number, side in seen.sides.items() if seen is not None else ():
            object_struck = event.kind is EventKind.OBJECT_STRUCK
            area = event.area if object_struck else event.as_struck(number).impact
            if area is None or area.clock_h not in _MIDDLES:
                continue
            if clock_difference_h(beside.rules.clock_h(side), area.clock_h) >= _CORNER_H:
                detail = f"vehicle {number} is struck at {beside.rules.clock_h(side):.1f} o'clock"
                yield Reservation(Doubt.OTHER_FACE, f"{detail}, reported is the middle of {area.clock_h:g} o'clock")


def _objects_in_one_place(beside: Comparison) -> Iterator[Reservation]:
    """Yield a doubt for each pair of placed objects that overlap."""
    placed = [item for item in beside.observed.hypothesis.objects if item.placed_by is PlacedBy.PROGRAM]
    for one, two in combinations(placed, 2):
        shapes = [shapely.Polygon(rectangle_corners(item.pose, item.length_m, item.width_m)) for item in (one, two)]
        if shapes[0].intersects(shapes[1]):
            detail = f"the {one.name} of event {one.event_number} and the {two.name} of event {two.event_number}"
            yield Reservation(Doubt.OBJECTS_OVERLAP, f"{detail} are placed over each other")


def _objects_at_rest(beside: Comparison) -> Iterator[Reservation]:
    """Yield a doubt for each placed later object that a vehicle touches slowly where it would come to rest anyway."""
    for event in beside.sequence.events:
        seen = beside.seen(event)
        if event is beside.begins or seen is None or seen.object_code is None:
            continue
        item = beside.observed.log.object_of(seen.pair[1])
        driven = beside.observed.log.vehicle_log(seen.pair[0])
        moves = np.hypot(driven.velocity_x_mps, driven.velocity_y_mps) >= _STANDS_MPS
        rests_s = float(driven.time_s[moves].max(initial=0.0)) - seen.time_s
        killed = beside.record.severity is Severity.KILLED
        slow = seen.contact.closing_speed_mps < (_SLOW_MPS if killed else LEAST_RECORDED_MPS)
        if item is not None and item.placed_by is PlacedBy.PROGRAM and slow and rests_s < _RESTS_S:
            speed_kmh = mps_to_kmh(seen.contact.closing_speed_mps)
            detail = f"vehicle {driven.number} touches the {item.name} of event {event.number} at {speed_kmh:.0f} km/h"
            yield Reservation(Doubt.OBJECT_AT_REST, f"{detail}, where it comes to rest")


def _apart_deg(one_rad: FloatArray, two_rad: FloatArray) -> FloatArray:
    """Return the angles between directions."""
    return np.asarray(np.abs(np.degrees(np.angle(np.exp(1j * (one_rad - two_rad))))))
