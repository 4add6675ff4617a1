"""The verdict of a crash over all its hypotheses: the first one that satisfies the rules, in the estimate's order."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from typing import Final

from trace_dag.crash.contacts import contacts_of
from trace_dag.crash.kind import CrashKind
from trace_dag.crash.reconstruction import Reconstruction, reconstruction_of
from trace_dag.crash.record import CrashRecord
from trace_dag.errors import Failure, Reason
from trace_dag.roads.map.network import RoadNetwork
from trace_dag.roads.report import MapReport
from trace_dag.settings import VerdictSettings
from trace_dag.sim.types import Contact, SimulationLog
from trace_dag.states.alternatives import alternatives
from trace_dag.states.types import Hypothesis, StateEstimate
from trace_dag.verdict.aftermath import aftermath_shown
from trace_dag.verdict.articulation import articulation_shown
from trace_dag.verdict.contacts import contact_criteria, observe_contacts
from trace_dag.verdict.departures import departure_criteria, observe_departure
from trace_dag.verdict.event_outcomes import event_outcomes
from trace_dag.verdict.metrics import compare, observe
from trace_dag.verdict.overturns import observe_overturn, overturn_criteria
from trace_dag.verdict.reservations import reservations_about
from trace_dag.verdict.rules import (
    REQUIRED,
    REQUIRED_OF_DEPARTURES,
    REQUIRED_OF_OVERTURNS,
    REQUIRED_OF_SEQUENCES,
    criteria,
    judgement,
)
from trace_dag.verdict.strikes import observe_strikes, strike_criteria
from trace_dag.verdict.support import facts_of, facts_of_strikes, grade_of, supported
from trace_dag.verdict.types import Criterion, Grade, Support, Verdict
from trace_dag.wording import counted

_REQUIRED: Final = {
    Reconstruction.COLLISION: REQUIRED,
    Reconstruction.STRIKES: REQUIRED_OF_SEQUENCES,
    Reconstruction.CONTACTS: REQUIRED_OF_SEQUENCES,
    Reconstruction.DEPARTURE: REQUIRED_OF_DEPARTURES,
    Reconstruction.OVERTURN: REQUIRED_OF_OVERTURNS,
}


def judge(
    record: CrashRecord,
    network: RoadNetwork,
    report: MapReport,
    estimate: StateEstimate,
    logs: Sequence[SimulationLog],
    settings: VerdictSettings,
) -> Verdict:
    """Judge the logs of an estimate's hypotheses, given in its order; :class:`Failure` if they are not its logs.

    The verdict is graded by what else of the report the map, the course and the report itself bear out
    (:mod:`trace_dag.verdict.support`), no higher than consistent where there is a doubt about it
    (:mod:`trace_dag.verdict.reservations`), and shows how far the contact is from where the crash was placed on the
    map. One of several contacts of vehicles or with an animal is graded no higher than consistent: what facts are worth
    was not measured on those.
    """
    if len(logs) != len(estimate.hypotheses):
        raise Failure(
            f"{record.key}: {counted(len(logs), 'simulation log')} for "
            f"{counted(len(estimate.hypotheses), 'hypothesis', 'hypotheses')}; simulate again"
        )
    judged = [
        judge_hypothesis(record, network, hypothesis, log, settings, report=report, index=i, of=len(logs))
        for i, (hypothesis, log) in enumerate(zip(estimate.hypotheses, logs, strict=True))
    ]
    verdict = next((verdict for verdict in judged if verdict.accepted), judged[0])
    hypothesis, log = estimate.hypotheses[verdict.hypothesis], logs[verdict.hypothesis]
    events = event_outcomes(record, verdict.criteria)
    unsure = alternatives(estimate)
    doubts = reservations_about(record, network, report, unsure, hypothesis, log, events) if verdict.accepted else ()
    support: Support | None
    match reconstruction_of(record):
        case Reconstruction.COLLISION:
            support = supported(facts_of(record, network, report, observe(network, hypothesis, log)))
        case Reconstruction.STRIKES if record.kind is not CrashKind.ANIMAL:
            observed = observe_strikes(network, hypothesis, log)
            support = supported(facts_of_strikes(record, network, report, observed))
        case _:
            support = None  # no weights are fitted to it
    grade = grade_of(verdict.accepted, support, doubts)
    clause = unsure.clause if unsure is not None else ""
    return replace(verdict, grade=grade, support=support, events=events, reservations=doubts, alternatives=clause)


def judge_hypothesis(
    record: CrashRecord,
    network: RoadNetwork,
    hypothesis: Hypothesis,
    log: SimulationLog,
    settings: VerdictSettings,
    *,
    report: MapReport | None = None,
    index: int = 0,
    of: int = 1,
) -> Verdict:
    """Judge one simulated hypothesis against a record."""
    observed = observe_crash(record, network, hypothesis, log, settings)
    return judge_observed(record, observed, settings, report=report, index=index, of=of)


@dataclass(frozen=True)
class ObservedCrash:
    """What happened in one simulation, measured once, to be compared with any number of reports.

    ``criteria`` gives the criteria for a report; ``contact_xy_m`` is where the first contact was, in metres in the
    local frame.
    """

    criteria: Callable[[CrashRecord], tuple[Criterion, ...]]
    contact_xy_m: tuple[float, float] | None = None


def observe_crash(
    record: CrashRecord, network: RoadNetwork, hypothesis: Hypothesis, log: SimulationLog, settings: VerdictSettings
) -> ObservedCrash:
    """Measure a simulation in the way in which this crash is reconstructed; reports compared with it are of that kind.

    Only the kind of crash is taken from the record.
    """
    observed = _observed(record, network, hypothesis, log, settings)

    def with_what_is_shown(told: CrashRecord) -> tuple[Criterion, ...]:
        shown = (*aftermath_shown(told, network, hypothesis, log), *articulation_shown(told, log))
        return (*observed.criteria(told), *shown)

    return replace(observed, criteria=with_what_is_shown)


def _observed(
    record: CrashRecord, network: RoadNetwork, hypothesis: Hypothesis, log: SimulationLog, settings: VerdictSettings
) -> ObservedCrash:
    match reconstruction_of(record):
        case Reconstruction.STRIKES:
            strikes = observe_strikes(network, hypothesis, log)
            return ObservedCrash(
                lambda told: strike_criteria(strikes, told, log, settings), _first_place(strikes.contacts)
            )
        case Reconstruction.CONTACTS:
            contacts = observe_contacts(network, hypothesis, log)
            return ObservedCrash(
                lambda told: contact_criteria(contacts, told, log, settings, contacts_of(told)),
                _first_place(contacts.contacts),
            )
        case Reconstruction.OVERTURN:
            over = observe_overturn(network, log)
            return ObservedCrash(
                lambda told: overturn_criteria(over, told, log, settings), over.xy_m if over is not None else None
            )
        case Reconstruction.DEPARTURE:
            left = observe_departure(network, hypothesis, log)
            return ObservedCrash(
                lambda told: departure_criteria(left, told, log, settings),
                _first_place([left.first.contact] if left is not None else []),
            )
        case Reconstruction.COLLISION:
            first = observe(network, hypothesis, log)
            return ObservedCrash(
                lambda told: criteria(compare(first, told) if first is not None else None, log, settings),
                _first_place([first.contact] if first is not None else []),
            )


def judge_observed(
    record: CrashRecord,
    observed: ObservedCrash,
    settings: VerdictSettings,
    *,
    report: MapReport | None = None,
    index: int = 0,
    of: int = 1,
) -> Verdict:
    """Judge what happened in a simulation against a record.

    With the ``report`` of the map, the distance of the contact from where the crash was placed is stated too.
    """
    found = observed.criteria(record)
    result = judgement(found, _REQUIRED[reconstruction_of(record)])
    detail = result.detail
    if observed.contact_xy_m is not None:
        found += (Criterion("reported_distance", math.hypot(*observed.contact_xy_m), None, "m", None),)
    if observed.contact_xy_m is not None and report is not None:
        placed, (x_m, y_m) = report.placement, observed.contact_xy_m
        distance_m = math.hypot(x_m - placed.x_m, y_m - placed.y_m)
        found += (Criterion("placed_distance", distance_m, None, "m", None),)
        if result.reason is Reason.WRONG_LOCATION and distance_m < placed.moved_m:
            detail += (
                f"; the reported point is {placed.moved_m:.1f} m from its place on the road that was taken for the "
                f"crash's (by {placed.matched_by}), and the contact {distance_m:.1f} m from that place"
            )
    return Verdict(
        key=record.key,
        rule_set=settings.rule_set,
        accepted=result.accepted,
        hypothesis=index,
        hypotheses_judged=of,
        criteria=found,
        reason=result.reason,
        detail=detail,
        grade=Grade.CONSISTENT if result.accepted else Grade.REJECTED,
    )


def _first_place(contacts: Sequence[Contact]) -> tuple[float, float] | None:
    return (contacts[0].x_m, contacts[0].y_m) if contacts else None
