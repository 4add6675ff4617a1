"""Reported facts of strikes on people, and of departures from the road, beside the simulated ones.

The facts are those of two vehicles (:mod:`trace_dag.verdict.course_facts`) under names of their own, since the weight
of a fact is fitted to crashes of its kind: that a car went straight tells less where nearly all who strike people do.
Objects are placed by the program, so that their facts tell less than those of the place.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace
from typing import Final

from trace_dag.crash.codes.persons import MOTDIR, PBCWALK, PEDDIR
from trace_dag.crash.crash_types import turn_of
from trace_dag.crash.event_sequence import CrashEvent
from trace_dag.crash.parties import EventKind, party_in_words
from trace_dag.crash.record import CrashRecord, VehicleRecord
from trace_dag.crash.zones import reported_zones
from trace_dag.reconstruction.motion.walking import reported_directions
from trace_dag.roads.map.people import crosswalks, crosswalks_near
from trace_dag.roads.report import CrashPlacement
from trace_dag.verdict.course_facts import impact_fact, movement_fact, speed_fact
from trace_dag.verdict.metrics import compass_error_deg, course_error_deg, reported_zone, roadside_error_m, zone_error_m
from trace_dag.verdict.observation import ObservedEvent, ObservedPerson, ObservedVehicle
from trace_dag.verdict.rules import Comparison
from trace_dag.verdict.types import Agreement, ComparedWith, Fact

_COURSE_DEG: Final = 45.0
_IN_ZONE_M: Final = 1.0
_CROSSWALK_M: Final = 20.0  # a marked crosswalk of the intersection or block that the typing speaks of
_PRESENT, _NONE_NOTED = 1, 0
_IN_PART_M: Final = 1.0


def pedestrian_facts(beside: Comparison) -> Iterator[Fact]:
    """Yield every reported fact about the strikes; nothing without a contact.

    >>> from trace_dag.crash.event_sequence import sequence_of
    >>> from trace_dag.common.settings import VerdictSettings
    >>> from trace_dag.verdict.observation import observe_crash
    >>> observed = observe_crash(judged_pedestrian.network, judged_pedestrian.hypothesis, judged_pedestrian.log)
    >>> told = sequence_of(pedestrian_record)
    >>> fact = next(pedestrian_facts(Comparison.of(pedestrian_record, told, observed, VerdictSettings())))
    >>> fact.name, fact.reported, fact.agreement.value
    ('striking vehicle', 'vehicle 1 and person 1', 'agrees')
    """
    if beside.observed.first is None:
        return
    yield _first_pair(beside, beside.observed.first)
    for event in beside.sequence.events:
        seen = beside.seen(event)
        if seen is not None and seen.person is not None:
            yield from _of_vehicle(beside.record, event, seen)
            if event is beside.begins:  # afterwards it lies where it was thrown
                yield from _of_person(beside.record, event, seen, seen.person)


def crosswalk_facts(beside: Comparison, placement: CrashPlacement) -> Iterator[Fact]:
    """Yield ``PBCWALK`` compared with the map, if the map has any crosswalks; in most towns they are not mapped."""
    network = beside.observed.network
    if not crosswalks(network):
        return
    near = bool(crosswalks_near(network, placement.x_m, placement.y_m, _CROSSWALK_M))
    for event in beside.sequence.events:
        code = event.person.crosswalk_code if event.kind is EventKind.PERSON_STRUCK else None
        if code in (_PRESENT, _NONE_NOTED):
            agreement = Agreement.of((code == _PRESENT) is near)
            found = f"{'a' if near else 'no'} crosswalk within {_CROSSWALK_M:.0f} m"
            yield Fact("crosswalk", ComparedWith.MAP, agreement, PBCWALK.meaning(code), found)


def _first_pair(beside: Comparison, first: ObservedEvent) -> Fact:
    contacts = beside.sequence.contacts
    expected = contacts[:1] if beside.sequence.order_known else contacts
    agreement = Agreement.of(first.pair in {event.pair for event in expected})
    said = " or ".join(" and ".join(party_in_words(number) for number in event.pair) for event in expected)
    found = " and ".join(map(party_in_words, first.pair))
    return Fact("striking vehicle", ComparedWith.COURSE, agreement, said, found, essential=True)


def _of_vehicle(record: CrashRecord, event: CrashEvent, seen: ObservedEvent) -> Iterator[Fact]:
    vehicle = event.as_struck(event.vehicle.number)
    drove = seen.vehicles[vehicle.number]
    yield from _motion_facts(record, vehicle, drove, struck="strike", before="strike")


def _motion_facts(
    record: CrashRecord, vehicle: VehicleRecord, drove: ObservedVehicle, *, struck: str, before: str
) -> Iterator[Fact]:
    facts = (
        (f"impact of the {struck}", impact_fact(vehicle, drove) if struck else None),
        (f"movement before the {before}", movement_fact(record, vehicle, drove)),
        (f"speed before the {before}", speed_fact(vehicle, drove)),
    )
    yield from (replace(found, name=name) for name, found in facts if found is not None)


def _of_person(record: CrashRecord, event: CrashEvent, seen: ObservedEvent, walked: ObservedPerson) -> Iterator[Fact]:
    person, turn, drove = event.person, turn_of(event.vehicle), seen.vehicles[event.vehicle.number]
    course = course_error_deg(drove, walked, person, turn)
    if course is not None:
        told = ", ".join(sorted(each.value.replace("_", " ") for each in reported_directions(person, turn)))
        found = f"{course:.0f} deg off"
        yield _fact("course of the person", Agreement.of(course <= _COURSE_DEG), told, found, person.party)
    zones = reported_zones(record, person)
    outside = zone_error_m(walked.outside_m, zones)
    if outside is not None:
        agreement = Agreement.of(outside <= _IN_ZONE_M)
        said = ", ".join(sorted(zones))
        side = "outside" if walked.outside_m > 0 else "within"
        where = f"{abs(walked.outside_m):.1f} m {side} the carriageway's edge"
        yield _fact("zone of the person", agreement, said, where, person.party)
    heading = walked.heading_rad if walked.moves else None
    for party, table, code, headed in (
        (event.vehicle.number, MOTDIR, person.motorist_direction_code, drove.approach_rad),
        (person.party, PEDDIR, person.pedestrian_direction_code, heading),
    ):
        error = compass_error_deg(headed, code)
        if error is not None:
            found = f"{error:.0f} deg outside that quarter"
            yield _fact("compass direction", Agreement.of(error <= _COURSE_DEG), table.meaning(code), found, party)


def _fact(name: str, agreement: Agreement, reported: str, found: str, party: int) -> Fact:
    return Fact(name, ComparedWith.COURSE, agreement, reported, found, vehicle_number=party)


# --- departures from the road ----------------------------------------------------------------------------------------
def departure_facts(beside: Comparison) -> Iterator[Fact]:
    """Yield every reported fact about a vehicle's departure from the road; nothing if none happened.

    >>> from trace_dag.crash.event_sequence import sequence_of
    >>> from trace_dag.common.settings import VerdictSettings
    >>> from trace_dag.verdict.observation import observe_crash
    >>> observed = observe_crash(judged_tree.network, judged_tree.hypothesis, judged_tree.log)
    >>> facts = departure_facts(Comparison.of(tree_record, sequence_of(tree_record), observed, VerdictSettings()))
    >>> {fact.name: fact.agreement.value for fact in facts}["side of the departure"]
    'agrees'
    """
    event = beside.begins
    seen = None if event is None else beside.seen(event)
    if event is None or seen is None or seen.departure is None:
        return
    record, number, left = beside.record, event.vehicle.number, seen.departure
    side = beside.departure.side
    if side is not None:
        found = " or ".join(left.sides) or "on the road"
        yield _fact("side of the departure", Agreement.of(side in left.sides), side.value, found, number)
    zone = reported_zone(record)
    error_m = roadside_error_m(left.place, zone)
    if zone is not None and error_m is not None:
        found = "nowhere near a road" if left.place is None else left.place.zone.value
        yield _fact("part of the road", Agreement.of(error_m <= _IN_PART_M), zone.value, found, number)
    drove = seen.vehicles.get(number)
    if drove is None:
        return
    struck = "object" if event.kind is EventKind.OBJECT_STRUCK else ""
    yield from _motion_facts(record, event.as_struck(number), drove, struck=struck, before="departure")
