"""The verdict of a crash over all its hypotheses: the first one that satisfies the rules, in the estimate's order."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import replace
from typing import Final

from trace_dag.crash.contacts import VehicleContact, contacts_of
from trace_dag.crash.reconstruction import Reconstruction, reconstruction_of
from trace_dag.crash.record import CrashRecord
from trace_dag.errors import Failure
from trace_dag.roads.map.network import RoadNetwork
from trace_dag.roads.report import MapReport
from trace_dag.settings import VerdictSettings
from trace_dag.sim.types import SimulationLog
from trace_dag.states.types import Hypothesis, StateEstimate
from trace_dag.verdict.contacts import ObservedContacts, contact_criteria, observe_contacts
from trace_dag.verdict.departures import ObservedDeparture, departure_criteria, observe_departure
from trace_dag.verdict.metrics import FirstContact, compare, observe
from trace_dag.verdict.overturns import ObservedOverturn, observe_overturn, overturn_criteria
from trace_dag.verdict.rules import (
    REQUIRED,
    REQUIRED_OF_DEPARTURES,
    REQUIRED_OF_OVERTURNS,
    REQUIRED_OF_SEQUENCES,
    criteria,
    judgement,
)
from trace_dag.verdict.strikes import ObservedStrikes, observe_strikes, strike_criteria
from trace_dag.verdict.support import facts_of, facts_of_strikes, grade_of, supported
from trace_dag.verdict.types import Criterion, Grade, Verdict

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
    (:mod:`trace_dag.verdict.support`), and shows how far the contact is from where the crash was placed on the map. One
    of several contacts of vehicles is graded no higher than consistent: what facts are worth was not measured on those.
    """
    if len(logs) != len(estimate.hypotheses):
        raise Failure(
            f"{record.key}: {len(logs)} simulation logs for {len(estimate.hypotheses)} hypotheses; simulate again"
        )
    judged = [
        judge_hypothesis(record, network, hypothesis, log, settings, report=report, index=i, of=len(logs))
        for i, (hypothesis, log) in enumerate(zip(estimate.hypotheses, logs, strict=True))
    ]
    verdict = next((verdict for verdict in judged if verdict.accepted), judged[0])
    hypothesis, log = estimate.hypotheses[verdict.hypothesis], logs[verdict.hypothesis]
    match reconstruction_of(record):
        case Reconstruction.COLLISION:
            facts = facts_of(record, network, report, observe(network, hypothesis, log))
        case Reconstruction.STRIKES:
            facts = facts_of_strikes(record, network, report, observe_strikes(network, hypothesis, log))
        case _:
            return verdict  # no weights are fitted to it
    support = supported(facts)
    return replace(verdict, grade=grade_of(verdict.accepted, support), support=support)


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
    reconstruction = reconstruction_of(record)
    if reconstruction is Reconstruction.STRIKES:
        strikes = observe_strikes(network, hypothesis, log)
        return judge_strikes(record, strikes, log, settings, report=report, index=index, of=of)
    if reconstruction is Reconstruction.CONTACTS:
        contacts = observe_contacts(network, hypothesis, log)
        return judge_contacts(record, contacts, log, settings, report=report, index=index, of=of)
    if reconstruction is Reconstruction.OVERTURN:
        over = observe_overturn(network, log)
        return judge_overturn(record, over, log, settings, report=report, index=index, of=of)
    if reconstruction is Reconstruction.DEPARTURE:
        left = observe_departure(network, hypothesis, log)
        return judge_departure(record, left, log, settings, report=report, index=index, of=of)
    return judge_observation(
        record, observe(network, hypothesis, log), log, settings, report=report, index=index, of=of
    )


def judge_observation(
    record: CrashRecord,
    observation: FirstContact | None,
    log: SimulationLog,
    settings: VerdictSettings,
    *,
    report: MapReport | None = None,
    index: int = 0,
    of: int = 1,
) -> Verdict:
    """Judge a contact that was observed already, as when one simulation is set beside many reports."""
    measures = compare(observation, record) if observation else None
    found = criteria(measures, log, settings)
    at = (measures.contact_x_m, measures.contact_y_m) if measures is not None else None
    return _verdict(record, found, at, settings, report, index, of)


def judge_strikes(
    record: CrashRecord,
    observed: ObservedStrikes,
    log: SimulationLog,
    settings: VerdictSettings,
    *,
    report: MapReport | None = None,
    index: int = 0,
    of: int = 1,
) -> Verdict:
    """Judge the strikes of a simulation, as :func:`judge_observation` a contact of two vehicles."""
    found = strike_criteria(observed, record, log, settings)
    at = (observed.contacts[0].x_m, observed.contacts[0].y_m) if observed.contacts else None
    return _verdict(record, found, at, settings, report, index, of)


def judge_contacts(
    record: CrashRecord,
    observed: ObservedContacts,
    log: SimulationLog,
    settings: VerdictSettings,
    *,
    report: MapReport | None = None,
    index: int = 0,
    of: int = 1,
    contacts: tuple[VehicleContact, ...] | None = None,
) -> Verdict:
    """Judge the contacts of a simulation of several vehicles, as :func:`judge_observation` that of two.

    ``contacts``: those to hold it to, if not those of the record.
    """
    held_to = contacts_of(record) if contacts is None else contacts
    found = contact_criteria(observed, record, log, settings, held_to)
    at = (observed.contacts[0].x_m, observed.contacts[0].y_m) if observed.contacts else None
    return _verdict(record, found, at, settings, report, index, of)


def judge_departure(
    record: CrashRecord,
    observed: ObservedDeparture | None,
    log: SimulationLog,
    settings: VerdictSettings,
    *,
    report: MapReport | None = None,
    index: int = 0,
    of: int = 1,
) -> Verdict:
    """Judge a departure from the road, as :func:`judge_observation` a contact of two vehicles."""
    found = departure_criteria(observed, record, log, settings)
    at = (observed.first.contact.x_m, observed.first.contact.y_m) if observed is not None else None
    return _verdict(record, found, at, settings, report, index, of)


def judge_overturn(
    record: CrashRecord,
    observed: ObservedOverturn | None,
    log: SimulationLog,
    settings: VerdictSettings,
    *,
    report: MapReport | None = None,
    index: int = 0,
    of: int = 1,
) -> Verdict:
    """Judge an overturn, as :func:`judge_observation` a contact of two vehicles."""
    found = overturn_criteria(observed, record, log, settings)
    return _verdict(record, found, observed.xy_m if observed is not None else None, settings, report, index, of)


def _verdict(
    record: CrashRecord,
    found: tuple[Criterion, ...],
    contact_xy_m: tuple[float, float] | None,
    settings: VerdictSettings,
    report: MapReport | None,
    index: int,
    of: int,
) -> Verdict:
    result = judgement(found, _REQUIRED[reconstruction_of(record)])
    if contact_xy_m is not None and report is not None:
        placed = report.placement
        distance_m = math.hypot(contact_xy_m[0] - placed.x_m, contact_xy_m[1] - placed.y_m)
        found += (Criterion("placed_distance", distance_m, None, "m", None),)
    return Verdict(
        key=record.key,
        rule_set=settings.rule_set,
        accepted=result.accepted,
        hypothesis=index,
        hypotheses_judged=of,
        criteria=found,
        reason=result.reason,
        detail=result.detail,
        grade=Grade.CONSISTENT if result.accepted else Grade.REJECTED,
    )
