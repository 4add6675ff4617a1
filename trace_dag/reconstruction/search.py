"""The estimate of a crash: the first event is planned, then event after event from the course so far.

A planner makes plans for one kind of event. Each plan is simulated as long as nothing unexpected happens, and the best
few courses are kept. Contacts with vehicles, people and animals come first, because they determine the parties. Then
strikes of objects and overturns are searched in the best course, in the order of the events. An event without a
successful plan is left out, and the hypothesis has the reason. The simulator always has its default settings, so that
an estimate follows from the record and the map alone.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import replace
from typing import Final, TypeAlias

import numpy as np

from trace_dag.common.errors import Reason, Rejection
from trace_dag.common.geometry import contact_clock_h
from trace_dag.common.settings import StateSettings, VerdictSettings
from trace_dag.common.units import clock_difference_h
from trace_dag.crash.completed_record import drop_headings
from trace_dag.crash.event_sequence import CrashEvent, EventSequence, sequence_of
from trace_dag.crash.parties import EventKind, party_in_words
from trace_dag.crash.record import CrashRecord
from trace_dag.reconstruction.alternatives import ambiguity_of
from trace_dag.reconstruction.analytic_hypotheses import NAME, VERSION, build_scene
from trace_dag.reconstruction.course import Course, Plan, Search, default_simulation
from trace_dag.reconstruction.first_event import FirstEvent, FirstPlanner, plan_first_event
from trace_dag.reconstruction.planners.later_vehicle import LONGEST_WAIT_S, arrival_plans
from trace_dag.reconstruction.planners.parked import standing_plans
from trace_dag.reconstruction.planners.pedestrian import (
    LONGEST_CHAIN_S,
    assume_animal,
    companions_of,
    crossing_lead_s,
    lying_plans,
)
from trace_dag.reconstruction.planners.rollover import later_overturn_plans
from trace_dag.reconstruction.planners.run_off_road import object_plans
from trace_dag.reconstruction.planners.way_after import ways_on
from trace_dag.reconstruction.ranking import leaders_first
from trace_dag.reconstruction.scene.mapped_ground import on_mapped_ground
from trace_dag.roads.map.network import RoadNetwork
from trace_dag.roads.report import MapReport
from trace_dag.simulation.matching import SimulatedEvent
from trace_dag.simulation.objects import Resistance
from trace_dag.simulation.states import EstimateCheck, EstimatorRun, Hypothesis, PlannedEvent, StateEstimate

_FIRSTS: Final = 6  # hypotheses of the first event that are gone on from
_TRIED: Final = 6  # plans of one event that are simulated
_FOLLOWED: Final = 2  # of those in which it happens, how many are gone on from
_ENOUGH: Final = 30  # simulations, after which a search goes on from no other first event, and tries one plan of each
_ASKED_LATER: Final = 2  # hypotheses in which later objects and overturns are looked for
_AS_GOOD: Final = 2.0  # one that is less likely by this (log-likelihood) may come first for more of them
_AFTER_S: Final = 1.0  # an event of parties that were not there before comes so long after the one before it
_CLOCK_POSITIONS: Final = VerdictSettings().max_clock_error_positions
_DECIMALS: Final = 6
_GRAZES_MPS: Final = 1.0  # of a body against an object: slower it bends nothing

Plans: TypeAlias = Iterator[Plan | str]
"""Plans, and sentences that say why there are none, or no more of a kind."""


def estimate_by_record(
    record: CrashRecord,
    network: RoadNetwork,
    report: MapReport,
    settings: StateSettings,
    first_planner: FirstPlanner = plan_first_event,
) -> StateEstimate:
    """Return the ranked hypotheses of a crash: those with more of its events first.

    ``first_planner`` plans the first event; another planner may ask a language model. Raises :class:`Rejection`:
    ``no_feasible_state`` if the reported events are impossible, ``map_too_small`` if the map ends too near.
    """

    if not settings.reported_headings:
        record = drop_headings(record)

    def made_with(lead_s: float, most: int) -> StateEstimate:
        wanted = settings.model_copy(update={"lead_time_s": lead_s, "max_hypotheses": most})
        return _estimate(record, network, report, wanted, first_planner)

    lead_s, most = settings.lead_time_s, settings.max_hypotheses
    found = on_mapped_ground(record, network, report, made_with, lead_s, most)
    longer_s = crossing_lead_s(network, found.best)
    if longer_s <= lead_s or found.best.impact_time_s < lead_s or len(found.best.participants) > 2:
        return found
    try:
        longer = on_mapped_ground(record, network, report, made_with, longer_s, most)
    except Rejection:
        return found  # the map ends too near for so long a time
    return longer if longer.best.impact_time_s > lead_s else found


def _estimate(
    record: CrashRecord, network: RoadNetwork, report: MapReport, settings: StateSettings, first_planner: FirstPlanner
) -> StateEstimate:
    """Return the ranked hypotheses with the lead time of the settings, regardless of the end of the map."""
    sequence = assume_animal(sequence_of(record), settings)
    lead_s = settings.lead_time_s
    longest_s = LONGEST_WAIT_S if sequence.first.kind is EventKind.VEHICLE_CONTACT else LONGEST_CHAIN_S
    scene = build_scene(record, network, report, lead_time_s=lead_s + (longest_s if _later_contacts(sequence) else 0.0))
    simulation = default_simulation(network, record)
    found: list[FirstEvent] = []
    rejections: list[Rejection] = []
    simulated = 0  # in either order
    for order in _orders(sequence):
        search = Search(scene, order, simulation, lead_s, simulated, simulated + _ENOUGH)
        try:
            found.append(_in_order(search, settings, first_planner))
        except Rejection as rejection:
            rejections.append(rejection)
        simulated = search.simulated
    if not found:
        raise rejections[0]
    best, unsure = found[0].hypotheses, found[0].ambiguity
    if len(found) > 1:
        both = [hypothesis for each in found for hypothesis in each.hypotheses]
        best = tuple(sorted(both, key=lambda each: (_failed(each), -each.score, each.name))[: settings.max_hypotheses])
        unsure = ambiguity_of(best)
    return StateEstimate(record.key, best, EstimatorRun(NAME, VERSION), unsure)


def _orders(sequence: EventSequence) -> Iterator[EventSequence]:
    """Yield the sequence; if the order of its contacts is not reported, yield also the reverse order."""
    yield sequence
    contacts = list(sequence.contacts)
    if not sequence.order_known and len(contacts) == len(sequence.events) > 1:
        yield replace(sequence, events=tuple(reversed(contacts)))


def _in_order(search: Search, settings: StateSettings, first_planner: FirstPlanner) -> FirstEvent:
    """Return the ranked hypotheses for one order of the events, and the doubt of the best."""
    later = _later_contacts(search.sequence)
    most = max(settings.max_hypotheses, _FIRSTS) if later else settings.max_hypotheses
    first = first_planner(search, settings.model_copy(update={"max_hypotheses": most}))
    hypotheses, unsure = first.hypotheses, first.ambiguity
    if later:
        hypotheses, unsure = _with_contacts(search, first.hypotheses, settings)
    return FirstEvent(_with_later_events(search, hypotheses), unsure)


def _later_contacts(sequence: EventSequence) -> tuple[CrashEvent, ...]:
    """Return the contacts that are planned after the first event, rather than together with it."""
    together = companions_of(sequence) if sequence.first.kind is EventKind.PERSON_STRUCK else ()
    return tuple(event for event in sequence.contacts if event is not sequence.first and event not in together)


# --- contacts --------------------------------------------------------------------------------------------------------
def _with_contacts(
    search: Search, firsts: Sequence[Hypothesis], settings: StateSettings
) -> tuple[tuple[Hypothesis, ...], float]:
    """Return the hypotheses of a first event with the following contacts, best first, and the doubt of the best."""
    later = _later_contacts(search.sequence)
    planned = tuple(event for event in search.sequence.events if event not in later)
    begun = tuple(
        event for event in planned if event is search.sequence.first or event.is_contact or _is_placed(event, firsts[0])
    )
    whole: list[tuple[Course, Hypothesis, Hypothesis]] = []
    stuck: list[str] = []
    right: set[str] = set()  # names of firsts that came right: of a pair only the first is wanted
    for first in firsts:
        if first.name in right:
            continue
        if len(right) == settings.max_hypotheses or (first is not firsts[0] and search.has_enough):
            break  # what goes wrong comes after these
        plan = Plan(first.participants, first.objects, first.name, first.score, first.evidence)
        followed = [_begun(search, plan, begun)]
        for event in later:
            followed = [after for course in followed for after in _followed_by(search, course, event, stuck)]
            followed = sorted(followed, key=lambda course: course.rank)[:_FOLLOWED]
        if any(course.comes_right for course in followed):
            right.add(first.name)
        whole += [(course, first, _hypothesis(search, course, first)) for course in followed]
    if not whole:
        raise Rejection(Reason.NO_FEASIBLE_STATE, stuck[0], measured=0.0)
    whole.sort(key=lambda each: (*each[0].rank[:2], _failed(each[2]), each[0].rank[2], each[2].name))
    hypotheses = tuple(hypothesis for _, _, hypothesis in whole)
    return hypotheses[: settings.max_hypotheses], ambiguity_of(hypotheses)


def _is_placed(event: CrashEvent, first: Hypothesis) -> bool:
    """Return whether the first event's plan has the object of an event."""
    return event.kind is EventKind.OBJECT_STRUCK and any(item.number == event.party for item in first.objects)


def _begun(search: Search, plan: Plan, events: Sequence[CrashEvent]) -> Course:
    course = search.course(plan, events)
    return course if course.comes_right else search.to_the_end(course)


def _followed_by(search: Search, course: Course, event: CrashEvent, stuck: list[str]) -> list[Course]:
    """Return courses with one more contact: unchanged if both parties meet by themselves, else with the missing one.

    If no plan of a missing vehicle leads to the contact, the likeliest is kept, and the verdict reports the failure. If
    both parties are present, or one stood there, the course stays as it is. If the course has already failed, one plan
    for a joining party suffices.
    """
    as_it_is = search.with_event(course, event)
    newcomers = [number for number in event.pair if number not in course.numbers]
    if not newcomers or as_it_is.matching.matched[-1] is not None:
        return [as_it_is]
    good: list[Course] = []
    tried: list[Course] = []
    most = _TRIED if course.comes_right and not search.has_enough else 1
    for plan in _contact_plans(search, course, event, newcomers):
        if isinstance(plan, str):
            stuck.append(f"event {event.number}: {plan}")
            continue
        tried.append(search.course(plan, as_it_is.events, course))
        if tried[-1].comes_right and _is_struck_so(tried[-1], event):
            good.append(tried[-1])
        if len(good) == _FOLLOWED or len(tried) == most:
            break
    if not tried and not stuck:
        who = " and ".join(map(party_in_words, newcomers))
        stuck.append(f"event {event.number}: no way past the crash brings {who} to it")
    kept = good or sorted(tried, key=lambda each: each.rank)[:1]
    for each in tried:
        if each not in kept:
            each.release()
    return good or [search.to_the_end(each) for each in kept]


def _is_struck_so(course: Course, event: CrashEvent) -> bool:
    """Return whether the vehicles of a contact touch within the clock positions that a verdict allows."""
    seen = course.matching.matched[course.events.index(event)]
    if seen is None or seen.contact is None:
        return False
    point = np.array([seen.contact.x_m, seen.contact.y_m])
    for vehicle in event.vehicles:
        if vehicle.impact is not None:
            clock_h = contact_clock_h(*course.log.clock_body(seen.contact, vehicle.number), point)
            if clock_difference_h(clock_h, vehicle.impact.clock_h) > _CLOCK_POSITIONS:
                return False
    return True


def _contact_plans(search: Search, course: Course, event: CrashEvent, newcomers: Sequence[int]) -> Plans:
    """Yield plans of missing parties for a contact."""
    if len(newcomers) == 2:
        yield from _plans_by_themselves(search, course, event)
        return
    if event.kind is EventKind.VEHICLE_CONTACT:
        (known,) = (number for number in event.pair if number not in newcomers)
        in_transport = event.as_struck(newcomers[0]).in_transport
        for on_its_way, _ in ways_on(search, course, known, None) if in_transport else [(course, "")]:
            arriving = list(arrival_plans(search, on_its_way, event, newcomers[0]))
            plans = [plan for plan in arriving if isinstance(plan, Plan)]
            yield from leaders_first(plans, lambda plan: plan.group)
            if plans:
                break  # else it went otherwise, so that the two met
        if in_transport:
            yield from (plan for plan in arriving if isinstance(plan, str))
            return
    elif event.vehicle.number in newcomers:
        yield from lying_plans(search, course, event)
        return
    yield from standing_plans(search, course, event)


def _plans_by_themselves(search: Search, course: Course, event: CrashEvent) -> Plans:
    """Yield plans of a contact of two new parties, planned as a first contact, some time after the previous one."""
    last_s = max((each.time_s for each in course.matching.matched if each is not None), default=search.lead_s)
    settings = StateSettings(lead_time_s=round(last_s + _AFTER_S, _DECIMALS), max_hypotheses=_TRIED)
    alone = Search(search.scene, EventSequence((event,)), search.simulation, settings.lead_time_s)
    try:
        found = plan_first_event(alone, settings)
    except Rejection as rejection:
        yield rejection.detail
        return
    for each in found.hypotheses:
        states, objects = (*course.states, *each.participants), (*course.objects, *each.objects)
        yield Plan(states, objects, each.name, each.score, each.evidence)


def _hypothesis(search: Search, course: Course, first: Hypothesis) -> Hypothesis:
    checks, planned = list(first.checks), []
    states = {state.vehicle_number: state for state in course.states}
    for event, seen in zip(course.events, course.matching.matched, strict=True):
        one, two = event.vehicle.number, event.party
        both = f"{party_in_words(one)} and {party_in_words(two)}"
        if seen is None or seen.contact is None:
            at = states[two].impact_pose if two in states else states[one].impact_pose
            is_first = event is search.sequence.first
            time_s, xy_m = search.lead_s, first.impact_point_xy_m if is_first else (at.x_m, at.y_m)
            checks.append(EstimateCheck(event.name, False, f"{both} do not touch in their turn"))
        else:
            time_s, xy_m = seen.time_s, (seen.contact.x_m, seen.contact.y_m)
            checks.append(EstimateCheck(event.name, True, f"{both} touch at {seen.time_s:.2f} s"))
        where = (round(xy_m[0], _DECIMALS), round(xy_m[1], _DECIMALS))
        planned.append(PlannedEvent(event.number, one, two, round(time_s, _DECIMALS), where))
    return replace(
        first,
        name="; ".join(course.names),
        score=round(course.score, _DECIMALS),
        evidence=dict(course.evidence),
        participants=tuple(sorted(course.states, key=lambda state: state.vehicle_number)),
        objects=course.objects,
        checks=tuple(checks),
        planned=tuple(planned),
    )


def _failed(hypothesis: Hypothesis) -> int:
    return sum(not check.passed for check in hypothesis.checks)


# --- beside the road -------------------------------------------------------------------------------------------------
_LATER: Final[Mapping[EventKind, Callable[[Search, Course, CrashEvent], Plans]]] = {
    EventKind.OBJECT_STRUCK: object_plans,
    EventKind.OVERTURN: later_overturn_plans,
}


def _with_later_events(search: Search, hypotheses: Sequence[Hypothesis]) -> tuple[Hypothesis, ...]:
    """Return the hypotheses with the later objects and overturns of the report.

    These are added to the first hypothesis that agrees with the report so far. If not all can be added, the next one is
    tried, and the one with more of them comes first.
    """
    first = search.sequence.first
    wanted = [event for event in search.sequence.events if event.kind in _LATER and event is not first]
    if not wanted:
        return tuple(hypotheses)
    found = list(hypotheses)
    asked: list[tuple[int, int]] = []  # events that do not come about, and the place of the hypothesis
    for place, each in enumerate(hypotheses):
        later = [event for event in wanted if not _is_placed(event, each)]
        made = _off_the_road(each, later)
        planned = tuple(event for event in search.sequence.events if event not in later)
        course = search.course(Plan(made.participants, made.objects), planned)
        if not course.comes_right:
            continue  # the crash does not go as reported: no verdict will be about this one
        checks = []
        for event in later:
            course, check = _with_later_event(search, course, event)
            checks.append(check)
        found[place] = replace(made, participants=course.states, objects=course.objects, later_events=tuple(checks))
        asked.append((sum(not check.passed for check in checks), place))
        if not asked[-1][0] or len(asked) == _ASKED_LATER or search.has_enough:
            break
    if asked:
        least = found[asked[0][1]].score - _AS_GOOD
        _, best = min(each for each in asked if found[each[1]].score >= least)
        found.insert(asked[0][1], found.pop(best))
    return tuple(found)


def _off_the_road(hypothesis: Hypothesis, later: Sequence[CrashEvent]) -> Hypothesis:
    gone = {each.vehicle.number for each in later}
    states = tuple(replace(s, beyond_edge=True) if s.vehicle_number in gone else s for s in hypothesis.participants)
    return replace(hypothesis, participants=states)


def _with_later_event(search: Search, course: Course, event: CrashEvent) -> tuple[Course, EstimateCheck]:
    """Return the course with one more event, or unchanged, and a sentence on the outcome."""
    as_it_is = search.with_event(course, event)
    number = event.vehicle.number
    place = as_it_is.events.index(event)
    seen = as_it_is.matching.matched[place]
    if seen is not None:
        does = "overturns" if event.kind is EventKind.OVERTURN else "strikes it"
        return as_it_is, EstimateCheck(event.name, True, f"vehicle {number} {does} at {seen.time_s:.2f} s")
    why_not = ""
    for plan in _LATER[event.kind](search, course, event):
        if isinstance(plan, str):
            why_not = why_not or plan
            continue
        if search.is_over:
            why_not = why_not or f"nothing of {search.simulated} simulations leads to it, and no more are tried"
            break
        tried = search.course(plan, as_it_is.events, course, tolerated=course.matching.strange)
        seen = tried.matching.matched[place]
        if seen is not None and not _worse(tried, as_it_is, place) and not _grazes(tried, seen):
            detail = f"vehicle {number} {plan.detail} at {seen.time_s:.2f} s"
            return tried, EstimateCheck(event.name, True, detail)
        why_not = _why(tried, as_it_is, event, place)
        tried.release()
    return as_it_is, EstimateCheck(event.name, False, why_not or f"vehicle {number} stays on its wheels")


def _grazes(course: Course, seen: SimulatedEvent) -> bool:
    """Return whether a firm object is touched so lightly that the touch has no effect."""
    item = course.log.object_of(seen.pair[1])
    stands = item is not None and item.resistance in (Resistance.RIGID, Resistance.YIELDING)
    return stands and seen.contact is not None and seen.contact.closing_speed_mps < _GRAZES_MPS


def _worse(tried: Course, before: Course, place: int) -> bool:
    """Return whether an earlier event no longer happens, or a new unreported contact occurs."""
    lost = any(
        was is not None and now is None
        for at, (was, now) in enumerate(zip(before.matching.matched, tried.matching.matched, strict=True))
        if at != place
    )
    return lost or not {each.pair for each in tried.matching.strange} <= {each.pair for each in before.matching.strange}


def _why(tried: Course, before: Course, event: CrashEvent, place: int) -> str:
    number = event.vehicle.number
    if event.kind is EventKind.OVERTURN:
        return (
            f"vehicle {number} stays on its wheels" if tried.matching.matched[place] is None else "others would touch"
        )
    (name,) = (item.name for item in tried.objects if item.number == event.party)
    others = [each for each in tried.matching.strange if event.party in each.pair]
    other = next((each.pair[0] for each in others if each.pair[0] != number), None)
    if other is not None:
        return f"vehicle {other} would strike the {name} of event {event.number} too"
    if others:
        return f"vehicle {number} would strike the {name} before what came before it"
    seen = tried.matching.matched[place]
    if seen is not None and _grazes(tried, seen):
        return f"vehicle {number} would only graze the {name}"
    if _worse(tried, before, place):
        return f"who meets whom would change by the {name} of event {event.number}"
    return f"vehicle {number} does not come to touch the {name} that was placed for it"
