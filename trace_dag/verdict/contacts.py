"""The verdict of a crash of several contacts between vehicles: each contact of the report against what occurred.

The first contact is judged as that of two vehicles is: where, on which areas, which way both went. Of every other one
the pair, its turn and the areas are: a body that has been struck goes where it was knocked. Two vehicles that no event
has touch, or whose turn has not come, must not; where bodies that have met lie against each other they may touch again.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Final

from trace_dag.crash.aftermath import aftermath_of
from trace_dag.crash.contacts import VehicleContact, order_is_told
from trace_dag.crash.parties import EventKind, party_in_words
from trace_dag.crash.record import CrashRecord, VehicleRecord
from trace_dag.crash.summary import event_named
from trace_dag.crash.zones import Zone, zones_of_first_event
from trace_dag.errors import Reason
from trace_dag.roads.map.network import RoadNetwork
from trace_dag.settings import VerdictSettings
from trace_dag.sim.order import ContactOrder, in_order, pair_of
from trace_dag.sim.types import Contact, SimulationLog
from trace_dag.states.types import Hypothesis
from trace_dag.verdict.metrics import (
    CrashMeasures,
    FirstContact,
    StruckSide,
    clock_error_h,
    compare,
    observe_contact,
    outside_m,
    sides_of,
    speed_error_rel,
    struck_side,
)
from trace_dag.verdict.rules import (
    RULE_SETS,
    at_most,
    clock_criterion,
    direction_criterion,
    reported_of,
    shown,
    speed_criterion,
)
from trace_dag.verdict.strikes import zone_error_m
from trace_dag.verdict.types import Criterion

_ALONG_ONLY: Final = frozenset({Zone.BESIDE, Zone.WALKED, Zone.OUTSIDE})


@dataclass(frozen=True)
class ObservedContacts:
    """Everything that touched in a simulation, in order, before it is set beside any report.

    ``first`` is what led to the first contact; ``outside_m`` how far outside the carriageway each body's centre was
    then, negative within it.
    """

    contacts: tuple[Contact, ...]
    sides: tuple[tuple[StruckSide, StruckSide], ...]
    first: FirstContact | None
    outside_m: dict[int, float]


def observe_contacts(network: RoadNetwork, hypothesis: Hypothesis, log: SimulationLog) -> ObservedContacts:
    """What happened between the vehicles of a simulated hypothesis.

    >>> observed = observe_contacts(judged_queue.network, judged_queue.hypothesis, judged_queue.log)
    >>> [(contact.number_1, contact.number_2) for contact in observed.contacts][:2]  # the first car pushes the second
    [(1, 2), (2, 3)]
    """
    contacts = log.meetings
    sides = []
    for contact in contacts:
        one, two = (struck_side(side, log, contact) for side in sides_of(contact))
        sides.append((one, two))
    first = observe_contact(network, hypothesis, log, contacts[0]) if contacts else None
    outside = {}
    if contacts:
        for side in sides_of(contacts[0]):
            outside[side.number] = outside_m(network, side.pose.x_m, side.pose.y_m)
    return ObservedContacts(contacts, tuple(sides), first, outside)


def contact_criteria(
    observed: ObservedContacts,
    record: CrashRecord,
    log: SimulationLog,
    settings: VerdictSettings,
    contacts: tuple[VehicleContact, ...],
) -> tuple[Criterion, ...]:
    """Every criterion of the rule set, those that reject first, then those that are only shown.

    >>> from trace_dag.crash.contacts import contacts_of
    >>> observed = observe_contacts(judged_queue.network, judged_queue.hypothesis, judged_queue.log)
    >>> told = contacts_of(queue_record)
    >>> found = contact_criteria(observed, queue_record, judged_queue.log, VerdictSettings(), told)
    >>> [criterion.name for criterion in found if criterion.reason and criterion.passed is False]
    []
    """
    event = contacts[0].event_number
    if observed.first is None:
        detail = log.reason
        return (Criterion("contact", 0.0, 1.0, "contacts", False, Reason.NO_COLLISION, detail, None, event),)
    limits = RULE_SETS[settings.rule_set].limits or settings
    told = order_is_told(record)
    order = in_order(observed.contacts, [contact.pair for contact in contacts], told=told)
    rejecting = [Criterion("contact", 1.0, 1.0, "contacts", True, Reason.NO_COLLISION, "", None, event)]
    reported: list[Criterion] = []
    begins = _first(contacts, observed.contacts[0], told=told)
    if begins is None:
        parties = " and ".join(map(party_in_words, pair_of(observed.contacts[0])))
        detail = f"the first contact is between {parties}, which by the report do not touch first"
        rejecting.append(Criterion("right_party", 0.0, 1.0, "", False, Reason.WRONG_PARTY, detail, None, event))
    else:
        measures = compare(observed.first, _with_areas(record, begins))
        rejecting += _of_first(observed, begins, measures, record, limits, settings)
        for vehicle in measures.vehicles:
            reported += reported_of(vehicle, limits, begins.event_number)
    rejecting += _later_speeds(contacts, begins, log, limits, settings)
    rejecting += _sequence(contacts, order, told=told)
    for contact, seen in zip(contacts, order.matched, strict=True):
        if seen is not None:
            sides = observed.sides[observed.contacts.index(seen)]
            rejecting += _clocks(contact, sides, limits, settings)
            reported += _shown(contact, seen, sides, first=contact is begins)
    return (*rejecting, *reported, *_other_events(record, contacts))


def _first(contacts: Sequence[VehicleContact], seen: Contact, *, told: bool) -> VehicleContact | None:
    """The reported contact that the simulation's first contact corresponds to; None if there is none."""
    possible = contacts[:1] if told else contacts
    return next((contact for contact in possible if contact.pair == pair_of(seen)), None)


def _with_areas(record: CrashRecord, contact: VehicleContact) -> CrashRecord:
    """The record with both vehicles struck where this contact says, which counts as the first."""

    def own(vehicle: VehicleRecord) -> VehicleRecord:
        return contact.vehicle(vehicle.number) if vehicle.number in contact.pair else vehicle

    return replace(record, vehicles=tuple(map(own, record.vehicles)))


def _of_first(
    observed: ObservedContacts,
    contact: VehicleContact,
    measures: CrashMeasures,
    record: CrashRecord,
    limits: VerdictSettings,
    settings: VerdictSettings,
) -> list[Criterion]:
    """Where the first contact was, and which way both went to it."""
    event = contact.event_number
    parked = next((vehicle for vehicle, _ in contact.sides if not vehicle.in_transport), None)
    zones = zones_of_first_event(record) if parked is not None else frozenset()
    distance = measures.contact_distance_m
    if parked is not None and zones and zones <= _ALONG_ONLY:
        distance = _along_m(observed, parked)
    found = [
        at_most("contact_distance", distance, limits.max_contact_distance_m, "m", Reason.WRONG_LOCATION, None, event)
    ]
    if parked is not None:
        error = zone_error_m(observed.outside_m[parked.number], zones)
        limit = settings.max_zone_error_m
        found.append(at_most("zone_error", error, limit, "m", Reason.WRONG_ZONE, parked.number, event))
    for vehicle in measures.vehicles:
        found.append(direction_criterion(vehicle.turn_error_deg, limits, vehicle.number, event))
    most, wrong = limits.max_direction_error_deg, Reason.WRONG_DIRECTION
    found.append(at_most("relation_error", measures.relation_error_deg, most, "deg", wrong, None, event))
    rules = RULE_SETS[settings.rule_set]
    for vehicle in measures.vehicles:
        found.append(speed_criterion(vehicle.initial_speed_error_rel, rules, limits, vehicle.number, event))
    return found


def _later_speeds(
    contacts: Sequence[VehicleContact],
    begins: VehicleContact | None,
    log: SimulationLog,
    limits: VerdictSettings,
    settings: VerdictSettings,
) -> list[Criterion]:
    """Reported speeds of the vehicles that take part later, at the beginning."""
    rules = RULE_SETS[settings.rule_set]
    initial_mps = {vehicle.number: float(vehicle.speed_mps[0]) for vehicle in log.vehicles}
    found, told = [], set(begins.pair if begins else ())
    for contact in contacts:
        for vehicle, _ in contact.sides:
            if vehicle.number not in told and vehicle.number in initial_mps:
                error = speed_error_rel(initial_mps[vehicle.number], vehicle)
                found.append(speed_criterion(error, rules, limits, vehicle.number, contact.event_number))
            told.add(vehicle.number)
    return found


def _along_m(observed: ObservedContacts, parked: VehicleRecord) -> float:
    """From the reported point to the contact along the course of the vehicle that drove: the reported point of a crash
    beside the road lies on the road."""
    assert observed.first is not None
    (course,) = (each.approach_rad for each in observed.first.vehicles if each.number != parked.number)
    contact = observed.first.contact
    return abs(contact.along_m(course))


def _clocks(
    contact: VehicleContact, sides: tuple[StruckSide, StruckSide], limits: VerdictSettings, settings: VerdictSettings
) -> list[Criterion]:
    rules = RULE_SETS[settings.rule_set]
    found = []
    for side in sides:
        area = contact.vehicle(side.number).impact
        error = clock_error_h(side.bearing_clock_h if rules.by_bearing else side.clock_h, area)
        found.append(clock_criterion(error, limits, side.number, contact.event_number))
    return found


def _sequence(contacts: Sequence[VehicleContact], order: ContactOrder, *, told: bool) -> list[Criterion]:
    """Every contact comes in its turn, and no two touch earlier than the report's events say."""
    found = []
    wrong = Reason.WRONG_SEQUENCE
    for contact, seen in zip(contacts[1:], order.matched[1:], strict=True):
        parties = " and ".join(map(party_in_words, contact.pair))
        when = "after the contact before it" if told else "at all"
        detail = "" if seen is not None else f"{parties} do not touch {when}, which event {contact.event_number} says"
        happened = seen is not None
        found.append(
            Criterion("next_contact", float(happened), 1.0, "", happened, wrong, detail, None, contact.event_number)
        )
    if order.strange:
        strange = order.strange[0]
        parties = " and ".join(map(party_in_words, pair_of(strange)))
        detail = f"{parties} touch at {strange.time_s:.2f} s, which no event says by then"
        count = float(len(order.strange))
        found.append(Criterion("unreported_contact", count, 0.0, "contacts", False, wrong, detail))
    return found


def _shown(
    contact: VehicleContact, seen: Contact, sides: tuple[StruckSide, StruckSide], *, first: bool
) -> list[Criterion]:
    event = contact.event_number
    found = [
        shown("contact_time", seen.time_s, "s", None, event),
        shown("closing_speed", seen.closing_speed_mps, "mps", None, event),
    ]
    for side in () if first else sides:  # those of the first contact are shown with what led to it
        area = contact.vehicle(side.number).impact
        found += [
            shown("clock", side.clock_h, "h", side.number, event),
            shown("reported_clock", area.clock_h if area else None, "h", side.number, event),
            shown("bearing_clock", side.bearing_clock_h, "h", side.number, event),
            shown("impact_speed", side.impact_speed_mps, "mps", side.number, event),
            shown("delta_v", side.delta_v_mps, "mps", side.number, event),
            shown("pdof", side.pdof_deg, "deg", side.number, event),
        ]
    return found


def _other_events(record: CrashRecord, contacts: Sequence[VehicleContact]) -> list[Criterion]:
    """Harmful events of the report that are neither contacts of their own nor of the aftermath: what came before, more
    of the same contact."""
    own = {contact.event_number for contact in contacts} | {each.event_number for each in aftermath_of(record)}
    going_on = {number for contact in contacts for number in contact.going_on}
    found = []
    for event in record.events:
        if event.number in own or not event.is_harmful or event.kind is EventKind.NO_HARM:
            continue
        what = "part of the contact before it" if event.number in going_on else "not simulated"
        detail = f"{event_named(event.number, event.code)}: {what}"
        found.append(Criterion("other_event", None, 1.0, "", None, None, detail, None, event.number))
    return found
