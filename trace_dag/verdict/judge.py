"""The verdict of a crash over all its hypotheses: the first one that satisfies the rules, in the estimate's order.

A verdict shows measures beside its criteria, which judge nothing. ``J_KNIFE`` records whether a combination jackknifed,
in the first or a later event; the angle at which one counts as such is nowhere defined, so that the largest angle
between both is shown with the report's word.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from dataclasses import replace

import numpy as np

from trace_dag.common.errors import Failure, Reason
from trace_dag.common.messages.wording import count_of
from trace_dag.common.settings import VerdictSettings
from trace_dag.common.units import wrap_angle
from trace_dag.crash.codes.elements import J_KNIFE
from trace_dag.crash.completed_record import drop_headings
from trace_dag.crash.event_sequence import MODELLED, OFF_THE_ROAD, CrashEvent, EventSequence, sequence_of
from trace_dag.crash.parties import EventKind
from trace_dag.crash.record import CrashRecord, EventRecord
from trace_dag.reconstruction.alternatives import alternatives
from trace_dag.reconstruction.scene.mapped_ground import OFF_GROUND_M, Way, astray
from trace_dag.roads.map.network import RoadNetwork
from trace_dag.roads.report import MapReport
from trace_dag.simulation.states import Hypothesis, StateEstimate
from trace_dag.simulation.types import SimulationLog, moment_of
from trace_dag.verdict.metrics import clock_error_positions, speed_error_rel
from trace_dag.verdict.observation import ObservedCrash, ObservedEvent, ObservedVehicle, StruckSide, observe_crash
from trace_dag.verdict.reservations import place_doubts, simulation_doubts
from trace_dag.verdict.rules import Beside, Comparison, at_most, criteria, judgement, required_reasons
from trace_dag.verdict.support import assess_support, facts_of, grade_of
from trace_dag.verdict.types import Criterion, EventOutcome, EventResult, Grade, Label, Reservation, Verdict


def judge(
    record: CrashRecord,
    network: RoadNetwork,
    report: MapReport,
    estimate: StateEstimate,
    logs: Sequence[SimulationLog],
    settings: VerdictSettings,
) -> Verdict:
    """Judge the logs of an estimate's hypotheses, given in its order.

    Raises :class:`Failure` if they are not its logs.

    The verdict is graded by the other facts of the report that agree with the map, the course and the report itself
    (:mod:`trace_dag.verdict.support`), at most consistent if there is a doubt about street, course or areas
    (:mod:`trace_dag.verdict.reservations`). It gives the distance from the contact to the crash's place on the map.
    """
    if len(logs) != len(estimate.hypotheses):
        raise Failure(
            f"{record.key}: {count_of(len(logs), 'simulation log')} for "
            f"{count_of(len(estimate.hypotheses), 'hypothesis', 'hypotheses')}; simulate again"
        )
    if not settings.reported_headings:
        record = drop_headings(record)
    sequence = sequence_of(record)
    judged: list[tuple[Verdict, ObservedCrash]] = []
    for i, each in enumerate(zip(estimate.hypotheses, logs, strict=True)):
        seen = observe_crash(network, *each)
        found = judge_observed(record, seen, settings, sequence=sequence, report=report, index=i, of=len(logs))
        judged.append((found, seen))
        if found.verified:
            break  # none that follows is taken before it
    verdict, seen = max(judged, key=lambda each: (each[0].verified, each[0].accepted))  # the first of the best
    beside = Comparison.of(record, sequence, seen, settings, (report.placement.x_m, report.placement.y_m))
    support = assess_support(facts_of(record, network, report, beside))
    verdict = replace(verdict, support=support)
    if verdict.accepted:
        doubts = (*verdict.reservations, *place_doubts(record, network, report, support))
        verdict = replace(verdict, label=_label(doubts), grade=grade_of(support, doubts), reservations=doubts)
    unsure = alternatives(estimate)
    return verdict if unsure is None else replace(verdict, alternatives=unsure.clause, direction_open=unsure.sides)


def judge_hypothesis(
    record: CrashRecord, network: RoadNetwork, hypothesis: Hypothesis, log: SimulationLog, settings: VerdictSettings
) -> Verdict:
    """Judge one simulated hypothesis against a record."""
    return judge_observed(record, observe_crash(network, hypothesis, log), settings)


def judge_observed(
    record: CrashRecord,
    observed: ObservedCrash,
    settings: VerdictSettings,
    *,
    sequence: EventSequence | None = None,
    report: MapReport | None = None,
    index: int = 0,
    of: int = 1,
) -> Verdict:
    """Judge a simulation against a record, or against another ``sequence`` of events.

    With the map's ``report``, the distance of the contact from the placed crash is added.
    """
    told = sequence_of(record) if sequence is None else sequence
    placed_xy_m = (0.0, 0.0) if report is None else (report.placement.x_m, report.placement.y_m)
    beside = Comparison.of(record, told, observed, settings, placed_xy_m)
    found = criteria(beside)
    if report is not None:
        found += (_mapped_ground(record, observed, report),)
    result = judgement(found, required_reasons(told, record))
    found += (*select_measures(beside), *articulation_shown(record, observed.log))
    detail = result.detail
    if observed.first is not None:
        x_m, y_m = observed.first.xy_m
        found += (Criterion("reported_distance", math.hypot(x_m, y_m), None, "m", None),)
        if report is not None:
            placed = report.placement
            distance_m = math.hypot(x_m - placed.x_m, y_m - placed.y_m)
            found += (Criterion("placed_distance", distance_m, None, "m", None),)
            if result.reason is Reason.WRONG_LOCATION and distance_m < placed.moved_m:
                detail += (
                    f"; the reported point is {placed.moved_m:.1f} m from its place on the road that was taken for the "
                    f"crash's (by {placed.matched_by}), and the contact {distance_m:.1f} m from that place"
                )
    events = event_outcomes(beside)
    doubts = simulation_doubts(beside, events) if result.accepted else ()
    return Verdict(
        key=record.key,
        rule_set=settings.rule_set,
        label=_label(doubts) if result.accepted else Label.REJECTED,
        hypothesis=index,
        hypotheses_judged=of,
        criteria=found,
        reason=result.reason,
        detail=detail,
        grade=Grade.CONSISTENT if result.accepted else None,
        events=events,
        reservations=doubts,
    )


def _label(doubts: Sequence[Reservation]) -> Label:
    return Label.FIRST_EVENT_ONLY if any(each.doubt.bars_verification for each in doubts) else Label.VERIFIED


def _mapped_ground(record: CrashRecord, observed: ObservedCrash, report: MapReport) -> Criterion:
    """Judge that before the first event no party is off mapped ground, unless reported, or in a building."""
    log, planned = observed.log, observed.hypothesis
    moment = moment_of(log)
    begun_s = moment.time_s if moment is not None else planned.impact_time_s
    event_s = min((contact.time_s for contact in log.contacts), default=begun_s)
    kinds = {state.vehicle_number: state.kind for state in planned.participants}
    driven = [each for each in log.parties if each.number in kinds]
    ways = [Way(each.number, kinds[each.number], each.time_s, each.x_m, each.y_m) for each in driven]
    found = astray(record, observed.network, report.things, ways, event_s)
    worst = max(found, key=lambda stray: (stray.in_building, stray.off_m), default=None)
    number, off_m = (None, 0.0) if worst is None else (worst.number, worst.off_m)
    detail = "" if worst is None else str(worst)
    return Criterion("mapped_ground", off_m, OFF_GROUND_M, "m", worst is None, Reason.WRONG_LOCATION, detail, number)


# --- outcomes of the reported events ---------------------------------------------------------------------------------
def event_outcomes(beside: Comparison) -> tuple[EventOutcome, ...]:
    """Return the outcome of each harmful event of the report, in order.

    An event between the same parties as the previous one continues that one. If the report lists no events, it is the
    one that its first harmful event implies. A later object struck with another part of the vehicle than reported is
    not the reported event.

    >>> [each.outcome.value for each in event_outcomes(comparison)]  # one event: the two collide
    ['happened']
    """
    planned = {event.number: event for event in beside.sequence.events}
    why_not = {check.name: check.detail for check in beside.observed.hypothesis.later_events if not check.passed}
    listed = [(event.number, event.code) for event in beside.record.events if event.is_harmful]
    listed = [each for each in listed if beside.sequence.has(each[0]) or each[0] < beside.sequence.first.number]
    found = []
    for number, code in listed or [(event.number, event.code) for event in beside.sequence.events]:
        event = planned.get(number) or beside.sequence.goes_on_with(number)
        seen = None if event is None else beside.seen(event)
        elsewhere = _struck_elsewhere(event, seen, beside) if event is not None and seen is not None else ""
        if elsewhere:
            found.append(EventOutcome(number, code, EventResult.MISSED, elsewhere))
        elif seen is not None:
            time_s = round(seen.time_s, 4) if number in planned else None
            found.append(EventOutcome(number, code, EventResult.HAPPENED, time_s=time_s))
        elif code not in MODELLED:
            found.append(EventOutcome(number, code, EventResult.NOT_MODELLED))
        else:
            why = beside.sequence.unclear.get(number) or (why_not.get(event.name) if event else None)
            found.append(EventOutcome(number, code, EventResult.MISSED, why or _why_not(event, number, beside)))
    return tuple(found)


def _struck_elsewhere(event: CrashEvent, seen: ObservedEvent, beside: Comparison) -> str:
    """Return a sentence if a later object is struck with another part of the vehicle than reported; else ""."""
    side = seen.sides.get(event.vehicle.number)
    if event.kind is not EventKind.OBJECT_STRUCK or event is beside.begins or side is None or event.area is None:
        return ""
    error = clock_error_positions(beside.rules.clock_h(side), event.area)
    if error is None or error <= beside.limits.max_clock_error_positions:
        return ""
    return f"the object is struck at {side.clock_h:.1f} o'clock, reported is {event.area.clock_h:g}"


def _why_not(event: CrashEvent | None, number: int, beside: Comparison) -> str:
    if event is None:
        first: EventRecord | None = next((e for e in beside.record.events if e.number == number), None)
        return "it comes before the first harmful event" if first is not None else "not simulated"
    if event.kind is EventKind.OVERTURN:
        return f"vehicle {event.vehicle.number} stays on its wheels"
    return "the object is not struck" if event.kind is EventKind.OBJECT_STRUCK else "the two do not touch in their turn"


# --- measures that are shown -----------------------------------------------------------------------------------------
def select_measures(beside: Comparison) -> Iterator[Criterion]:
    """Return the measures shown for every reported event that happens, in order.

    >>> shown = list(select_measures(comparison))
    >>> [(each.vehicle_number, each.value) for each in shown if each.name == "reported_clock"]
    [(2, 1.0), (1, 3.0)]
    """
    for event in beside.sequence.events:
        seen = beside.seen(event)
        if seen is None:
            continue
        each = Beside(event, seen, event is beside.begins, beside)
        if event.kind in OFF_THE_ROAD:
            yield from _beside_the_road(each)
        else:
            yield from _of_contact(each)
        for vehicle in event.vehicles:
            if vehicle.number in seen.sides:
                yield from _of_vehicle(each, vehicle.number)
        if seen.person is not None:
            yield from _of_person(each)


def shown(name: str, value: float | None, unit: str, number: int | None = None, event: int | None = None) -> Criterion:
    """Return a measure that is shown without a judgement."""
    return Criterion(name, value, None, unit, None, None, "", number, event)


def _of_contact(each: Beside) -> Iterator[Criterion]:
    contact, number = each.seen.contact, each.event.number
    yield shown("contact_time", contact.time_s, "s", None, number)
    yield shown("closing_speed", contact.closing_speed_mps, "mps", None, number)
    if each.first and each.event.kind is EventKind.VEHICLE_CONTACT:
        apart_rad = wrap_angle(contact.pose_1.heading_rad - contact.pose_2.heading_rad)
        yield shown("approach_angle", abs(math.degrees(apart_rad)), "deg", None, number)


def _of_vehicle(each: Beside, number: int) -> Iterator[Criterion]:
    event, side = each.event.number, each.seen.sides[number]
    vehicle, went = each.event.as_struck(number), each.seen.vehicles.get(number)
    struck: StruckSide | ObservedVehicle = side if went is None else went
    yield shown("clock", struck.clock_h, "h", number, event)
    yield shown("reported_clock", vehicle.impact.clock_h if vehicle.impact else None, "h", number, event)
    yield shown("bearing_clock", struck.bearing_clock_h, "h", number, event)
    yield shown("impact_speed", struck.impact_speed_mps, "mps", number, event)
    yield shown("delta_v", struck.delta_v_mps, "mps", number, event)
    yield shown("pdof", struck.pdof_deg, "deg", number, event)
    if went is None:
        return
    limit = each.of.limits.max_speed_error_rel
    error = speed_error_rel(went.impact_speed_mps, vehicle)
    yield at_most("impact_speed_error", error, limit, "rel", None, number, event)
    yield shown("turn", went.turn_deg, "deg", number, event)
    yield shown("initial_speed", went.initial_speed_mps, "mps", number, event)
    yield shown("arrival_error", went.arrival_error_m, "m", number, event)
    yield shown("path_error_p99", went.path_error_p99_m, "m", number, event)
    yield shown("tracked_speed_error_p99", went.tracked_speed_error_p99_rel, "rel", number, event)


def _of_person(each: Beside) -> Iterator[Criterion]:
    person, party, event = each.seen.person, each.event.party, each.event.number
    assert person is not None
    yield replace(shown("throw_distance", person.thrown_m, "m", party, event), detail=person.throw.value)
    yield shown("person_speed", person.speed_mps, "mps", party, event)
    yield shown("time_on_carriageway", person.exposed_s, "s", party, event)
    yield shown("outside_carriageway", person.outside_m, "m", party, event)


def _beside_the_road(each: Beside) -> Iterator[Criterion]:
    event, number, seen = each.event, each.event.vehicle.number, each.seen
    if event.kind is EventKind.OBJECT_STRUCK:
        yield shown("closing_speed", seen.contact.closing_speed_mps, "mps", None, event.number)
    if each.first and seen.departure is not None:
        left, place = seen.departure, seen.departure.place
        if event.kind is EventKind.OBJECT_STRUCK:
            yield shown("outside_carriageway", place.beyond_m if place else None, "m", number, event.number)
            yield shown("angle_to_road", _angle_to_road_deg(seen), "deg", number, event.number)
            yield shown("departure_time", left.left_s, "s", number, event.number)
    if seen.overturn is not None:
        over = seen.overturn
        yield shown("overturn_time", seen.time_s, "s", number, event.number)
        yield shown("overturn_speed", over.speed_mps, "mps", number, event.number)
        yield shown("slide_distance", over.slid_m, "m", number, event.number)
        yield shown("quarter_turns", float(over.quarter_turns), "", number, event.number)


def _angle_to_road_deg(seen: ObservedEvent) -> float | None:
    """Return the angle between the vehicle's course before the contact and the road, 0 to 90.

    None without a road near it.
    """
    place = seen.departure.place if seen.departure is not None else None
    if place is None:
        return None
    vx, vy = seen.contact.velocity_1_mps
    return math.degrees(abs(math.remainder(math.atan2(vy, vx) - place.along_rad, math.pi)))


def articulation_shown(record: CrashRecord, log: SimulationLog) -> Iterator[Criterion]:
    """Return the largest hitch angle of each vehicle with a trailer in the simulation, degrees.

    >>> list(articulation_shown(record, log))  # neither vehicle draws a trailer
    []
    """
    reported = {vehicle.number: vehicle.jackknife_code for vehicle in record.vehicles}
    for number in sorted(log.trailers):
        angle = log.articulation_rad(number)
        if angle is None:
            continue
        word = J_KNIFE.meaning(reported.get(number)) or "not reported"
        largest_deg = math.degrees(float(np.abs(angle).max()))
        yield Criterion("articulation", largest_deg, None, "deg", None, None, f"jackknife reported: {word}", number)
