"""The verdict of a crash in which a vehicle leaves the road: where it left, what it struck there, in which order.

Objects are placed by us, so that this shows agreement with the codes of the report and no more: the side, the zone, the
station along the road, the area of impact and the order of the objects. The reported point of such a crash lies on the
road (2.9 m from the centre line in the median of 61), so that the distance is measured along the road where the object
stands beside it.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Final

import numpy as np

from trace_dag.crash.codes.events import OVERTURN
from trace_dag.crash.departures import Departure, DepartureSide, ObjectStruck, departure_of
from trace_dag.crash.record import CrashRecord
from trace_dag.crash.summary import event_named
from trace_dag.errors import Failure, Reason
from trace_dag.geometry import contact_clock_h
from trace_dag.roads.map.network import RoadNetwork
from trace_dag.roads.map.roadside import RoadsidePlace, RoadZone, roadside_at
from trace_dag.settings import VerdictSettings
from trace_dag.sim.leaving_road import left_road
from trace_dag.sim.types import Contact, SimulationLog, overturned_at
from trace_dag.states.types import Hypothesis
from trace_dag.verdict.departed_street import NO_STREET, DepartedStreet, departed_street, street_criterion
from trace_dag.verdict.metrics import (
    ObservedVehicle,
    VehicleMeasures,
    clock_error_h,
    compared_vehicle,
    observed_vehicle,
    sides_of,
)
from trace_dag.verdict.rules import (
    RULE_SETS,
    at_most,
    clock_criterion,
    reported_of,
    shown,
    speed_criterion,
)
from trace_dag.verdict.types import Criterion

_ZONES: Final = {
    **dict.fromkeys((1, 11), RoadZone.ROADWAY),
    2: RoadZone.SHOULDER,
    **dict.fromkeys((3, 10, 12), RoadZone.MEDIAN),
    **dict.fromkeys((4, 6, 7), RoadZone.ROADSIDE),
    5: RoadZone.OUTSIDE,
    8: RoadZone.GORE,
}
"""``REL_ROAD``: where the first harmful event was."""
_IN_WORDS: Final = {
    DepartureSide.LEFT: "to the left",
    DepartureSide.RIGHT: "to the right",
    DepartureSide.AHEAD: "straight ahead",
}
_WIDEST_SHOULDER_M: Final = 4.0


@dataclass(frozen=True)
class ObservedObject:
    """A contact of the vehicle with an object, before it is set beside any report. ``along_m`` is the distance from the
    reported point along the road where the contact is beside it, the whole distance where it is on it."""

    contact: Contact
    clock_h: float
    place: RoadsidePlace | None
    along_m: float

    @property
    def angle_to_road_rad(self) -> float | None:
        """The angle between the vehicle's course before the contact and the road, 0 to pi / 2; None if there is no
        road near it."""
        if self.place is None:
            return None
        vx, vy = self.contact.velocity_1_mps
        return abs(math.remainder(math.atan2(vy, vx) - self.place.along_rad, math.pi))


@dataclass(frozen=True)
class ObservedDeparture:
    """What a vehicle did: when it left the carriageway (None if it did not before the first contact) and to where,
    which can be called a side or ahead, the objects it struck in order, and its measures at the first of them."""

    left_s: float | None
    sides: tuple[DepartureSide, ...]
    objects: tuple[ObservedObject, ...]
    vehicle: ObservedVehicle
    overturned_s: float | None = None  # when it has overturned, if it does
    street: DepartedStreet = NO_STREET

    @property
    def first(self) -> ObservedObject:
        """The first object struck."""
        return self.objects[0]


def observe_departure(network: RoadNetwork, hypothesis: Hypothesis, log: SimulationLog) -> ObservedDeparture | None:
    """What happened in a simulated hypothesis; None if no object was struck.

    >>> observed = observe_departure(judged_tree.network, judged_tree.hypothesis, judged_tree.log)
    >>> struck = judged_tree.log.object_of(observed.first.contact.number_2)
    >>> [side.value for side in observed.sides], struck.name
    (['right'], 'tree')
    """
    struck = sorted((c for c in log.contacts if log.object_of(c.number_2)), key=lambda contact: contact.time_s)
    if not struck:
        return None
    first = struck[0]
    number = first.number_1
    body = log.bodies[number]
    state = next((each for each in hypothesis.participants if each.vehicle_number == number), None)
    driven = next((each for each in log.vehicles if each.number == number), None)
    if state is None or driven is None:
        raise Failure(f"the log has vehicle {number}, which the hypothesis does not have; simulate again")
    side, _ = sides_of(first)
    vehicle = observed_vehicle(network, side, state, driven, log, first)
    left_s, sides = left_road(network, driven, body, first.time_s)
    objects = tuple(_object(network, contact, log) for contact in struck if contact.number_1 == number)
    over = overturned_at(driven)
    overturned_s = None if over is None else float(driven.time_s[over])
    street = departed_street(network, driven, first.time_s if left_s is None else left_s)
    return ObservedDeparture(left_s, sides, objects, vehicle, overturned_s, street)


def _object(network: RoadNetwork, contact: Contact, log: SimulationLog) -> ObservedObject:
    point = np.array([contact.x_m, contact.y_m])
    place = roadside_at(network, contact.x_m, contact.y_m, z_m=contact.z_m)
    along_m = along_road_m(network, contact.x_m, contact.y_m, place)
    clock_h = contact_clock_h(*log.clock_body(contact, contact.number_1), point)
    return ObservedObject(contact, clock_h, place, along_m)


def reported_zone(record: CrashRecord) -> RoadZone | None:
    """Where across the road the first harmful event was (``REL_ROAD``); None if that is not known.

    >>> tree_record.road_relation_code, reported_zone(tree_record).value
    (4, 'roadside')
    """
    return _ZONES.get(record.road_relation_code or 0)


def along_road_m(network: RoadNetwork, x_m: float, y_m: float, place: RoadsidePlace | None) -> float:
    """Distance from the reported point: along the road for what is beside it, to its end for what is beyond that; the
    whole one for what is on the road.

    >>> along_road_m(network, 5.0, 0.0, roadside_at(network, 5.0, 0.0))  # on the road: the distance itself
    5.0
    """
    if place is None or place.zone is RoadZone.ROADWAY:
        return math.hypot(x_m, y_m)
    beside = network.pose(place.lane.lane, place.lane.s_m)
    return abs(beside.x_m * math.cos(place.along_rad) + beside.y_m * math.sin(place.along_rad))


# --- criteria ----------------------------------------------------------------------------------------------------
def departure_criteria(
    observed: ObservedDeparture | None, record: CrashRecord, log: SimulationLog, settings: VerdictSettings
) -> tuple[Criterion, ...]:
    """Every criterion of the rule set, those that reject first, then those that are only shown.

    >>> observed = observe_departure(judged_tree.network, judged_tree.hypothesis, judged_tree.log)
    >>> found = departure_criteria(observed, tree_record, judged_tree.log, VerdictSettings())
    >>> found[1].name, found[1].passed, found[2].name, found[2].passed
    ('departure', True, 'departure_side', True)
    """
    departure = departure_of(record)
    if departure is None or not departure.objects:
        raise Failure(
            f"{record.key}: judged as a departure from the road, but its report tells of none; judge it again"
        )
    first = departure.objects[0]
    number, event = departure.vehicle.number, departure.event_number
    if observed is None:
        detail = log.reason
        return (Criterion("contact", 0.0, 1.0, "contacts", False, Reason.NO_COLLISION, detail, number, event),)
    rules = RULE_SETS[settings.rule_set]
    limits = rules.limits or settings
    measures = compared_vehicle(observed.vehicle, replace(departure.vehicle, impact=first.area), record)
    return (
        Criterion("contact", 1.0, 1.0, "contacts", True, Reason.NO_COLLISION, "", number, event),
        *_party(observed, log, first, number),
        *departing(observed.left_s, observed.sides, observed.first.place, departure, record, settings),
        street_criterion(observed.street, record, number, event),
        at_most(
            "station_distance",
            observed.first.along_m,
            limits.max_contact_distance_m,
            "m",
            Reason.WRONG_LOCATION,
            None,
            event,
        ),
        clock_criterion(rules.clock_error(measures), limits, number, event),
        _order(observed, departure),
        speed_criterion(measures.initial_speed_error_rel, rules, limits, number, event),
        *_later(observed, departure, record, strict=rules.speeds_reject),
        *_shown(observed, measures, limits, event),
    )


def _party(observed: ObservedDeparture, log: SimulationLog, first: ObjectStruck, number: int) -> list[Criterion]:
    """Says if another kind of object is struck than reported."""
    item = log.object_of(observed.first.contact.number_2)
    if item is None or item.code == first.code:
        return []
    detail = f"vehicle {number} strikes a {item.name} (SOE {item.code}), reported is SOE {first.code}"
    return [Criterion("right_party", 0.0, 1.0, "", False, Reason.WRONG_PARTY, detail, number, first.event_number)]


def departing(
    left_s: float | None,
    sides: tuple[DepartureSide, ...],
    place: RoadsidePlace | None,
    departure: Departure,
    record: CrashRecord,
    settings: VerdictSettings,
) -> list[Criterion]:
    """Whether, to which side and into which zone the vehicle left the road before the first harmful event.

    >>> departure = departure_of(tree_record)  # to the right
    >>> found = departing(2.0, (DepartureSide.LEFT,), None, departure, tree_record, VerdictSettings())
    >>> [(criterion.name, criterion.passed) for criterion in found]
    [('departure', True), ('departure_side', False), ('zone_error', False)]
    """
    number, event = departure.vehicle.number, departure.event_number
    zone = reported_zone(record)
    on_road = zone is RoadZone.ROADWAY or (departure.side is DepartureSide.AHEAD and zone is None)
    left = left_s is not None
    detail = "" if left or on_road else "the vehicle had not left the carriageway at the first harmful event"
    found = [Criterion("departure", float(left), 1.0, "", left or on_road, Reason.NO_DEPARTURE, detail, number, event)]
    told = departure.side
    right = told in sides or (told is DepartureSide.AHEAD and not left)
    detail = ""
    if told is None:
        on_it = zone is RoadZone.ROADWAY
        detail = "the first harmful event was on the roadway" if on_it else "the report does not say to which side"
    elif not right:
        went = f"left the road {_IN_WORDS[sides[0]]}" if sides else "did not leave the road"
        detail = f"the vehicle {went}, reported is {told}"
    held = None if told is None else right
    found.append(
        Criterion("departure_side", float(right), 1.0, "", held, Reason.WRONG_SIDE, detail, number, event),
    )
    error = _zone_error_m(place, zone)
    found.append(at_most("zone_error", error, settings.max_zone_error_m, "m", Reason.WRONG_ZONE, number, event))
    return found


def _zone_error_m(place: RoadsidePlace | None, zone: RoadZone | None) -> float | None:
    """How far a place is from the reported zone; None if none is reported.

    A map that shows no median or gore there cannot contradict one: then it has to be beside the carriageway.
    """
    if zone is None:
        return None
    if place is None:
        return 0.0 if zone is RoadZone.OUTSIDE else math.inf
    if zone is RoadZone.ROADWAY:
        return max(place.beyond_m, 0.0)
    inside_m = max(-place.beyond_m, 0.0)
    if zone is RoadZone.SHOULDER:
        return max(inside_m, place.beyond_m - max(place.shoulder_m, _WIDEST_SHOULDER_M), 0.0)
    return inside_m


def _order(observed: ObservedDeparture, departure: Departure) -> Criterion:
    """The first object is the first one reported, and no object is struck before one that came before it."""
    numbers = [each.contact.number_2 for each in observed.objects]
    seen = list(dict.fromkeys(numbers))
    wanted = [struck.party for struck in departure.objects if struck.party in seen]
    held = seen == wanted and seen[0] == departure.objects[0].party
    names = ", ".join(f"event {number - 2000}" for number in seen)
    detail = "" if held else f"objects are struck in the order of {names}, which the report does not say"
    event = departure.objects[0].event_number
    return Criterion("object_order", float(held), 1.0, "", held, Reason.WRONG_SEQUENCE, detail, None, event)


def _later(observed: ObservedDeparture, departure: Departure, record: CrashRecord, *, strict: bool) -> list[Criterion]:
    """Events after the first: objects that are struck too, with their areas; what is not simulated."""
    first = departure.objects[0].event_number
    by_event: dict[int, ObjectStruck] = {struck.event_number: struck for struck in departure.objects}
    found: list[Criterion] = []
    for event in record.events:
        if event.number <= first:
            continue
        struck = by_event.get(event.number)
        seen = None
        if struck is not None:
            seen = next((each for each in observed.objects if each.contact.number_2 == struck.party), None)
        if event.code == OVERTURN:
            over = observed.overturned_s is not None
            detail = "" if over else f"the vehicle does not overturn, which event {event.number} says"
            reason = Reason.NO_OVERTURN if strict else None
            found.append(Criterion("later_overturn", float(over), 1.0, "", over, reason, detail, None, event.number))
            continue
        if struck is None:
            detail = f"{event_named(event.number, event.code)}: not simulated"
            found.append(Criterion("later_event", None, 1.0, "", None, None, detail, None, event.number))
            continue
        occurred = seen is not None
        detail = "" if occurred else f"{event_named(event.number, event.code)}: the object is not struck"
        reason = Reason.WRONG_SEQUENCE if strict else None
        found.append(Criterion("later_object", float(occurred), 1.0, "", occurred, reason, detail, None, event.number))
        if seen is not None:
            error = clock_error_h(seen.clock_h, struck.area)
            found.append(shown("later_clock_error", error, "h", departure.vehicle.number, event.number))
    return found


def _shown(
    observed: ObservedDeparture, measures: VehicleMeasures, limits: VerdictSettings, event: int
) -> Sequence[Criterion]:
    first = observed.first
    beyond = first.place.beyond_m if first.place is not None else None
    angle = None if first.angle_to_road_rad is None else math.degrees(first.angle_to_road_rad)
    return [
        shown("closing_speed", first.contact.closing_speed_mps, "mps", None, event),
        *reported_of(measures, limits, event),
        shown("outside_carriageway", beyond, "m", measures.number, event),
        shown("angle_to_road", angle, "deg", measures.number, event),
        shown("departure_time", observed.left_s, "s", measures.number, event),
    ]
