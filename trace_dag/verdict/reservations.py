"""Doubts about an accepted crash. A doubt is not outweighed by support (:mod:`trace_dag.verdict.support`).

A reported fact that the simulation lacks prevents verification; doubts about street, course or areas also prevent
corroboration.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping, Sequence
from typing import Final

from trace_dag.common.units import kmh_to_mps, mps_to_mph
from trace_dag.crash.record import CrashRecord, Severity
from trace_dag.crash.summary import event_in_words, event_named
from trace_dag.roads.crash_site.placement import is_at_intersection
from trace_dag.roads.crash_site.reported_road import has_name_of_another, is_on_ramp
from trace_dag.roads.crash_site.street_names import SAME_STREET, similarity
from trace_dag.roads.map.network import RoadNetwork
from trace_dag.roads.report import MapReport
from trace_dag.verdict.course_events import course_doubts
from trace_dag.verdict.observation import ObservedCrash
from trace_dag.verdict.place_facts import names_at
from trace_dag.verdict.rules import Comparison
from trace_dag.verdict.types import Doubt, EventOutcome, EventResult, Reservation
from trace_dag.verdict.way_doubts import way_doubts

_OTHER_ROAD: Final[Mapping[str, tuple[float, str]]] = {
    "speed limit": (-1.0, "the speed limit differs by 14 mph or more"),
    "not on the street named first": (-1.0, "it is not on the street named first"),
    "street not named": (-1.0, "the report does not name that street"),
    "not on the map": (-1.0, "it comes out of a driveway that neither the map nor the report has"),
    "driveway reported": (-1.0, "it comes along a street, and a driveway is reported"),
}
"""Evidence terms of a hypothesis by which a vehicle is on another road than its form says: from which log-likelihood
down, and the sentence."""
_LEAST_HARM_MPS: Final = {Severity.KILLED: kmh_to_mps(16.0), Severity.SERIOUS: kmh_to_mps(8.0)}
"""Least change of velocity of any vehicle that can have done the harm, by the severity of the crash. A death: 10 mph,
at which the risk is 4 in 10,000 by Joksch (1993), (delta-v / 71 mph)^4. A serious injury: what an event data recorder
has to record (49 CFR 563.5). Lesser injuries come of any impact."""


def place_doubts(record: CrashRecord, network: RoadNetwork, report: MapReport) -> tuple[Reservation, ...]:
    """Return the doubts about an accepted crash that are common to all its simulations.

    >>> place_doubts(record, network, map_report)
    ()
    """
    found = (_other_street(record, network, report), _no_areas(record))
    return tuple(each for each in found if each is not None)


def simulation_doubts(beside: Comparison, events: Sequence[EventOutcome]) -> tuple[Reservation, ...]:
    """Return the doubts about one simulation: missing events, no harm, other roads, another course.

    >>> from trace_dag.crash.event_sequence import sequence_of
    >>> from trace_dag.common.settings import VerdictSettings
    >>> beside = Comparison.of(record, sequence_of(record), observed_crash, VerdictSettings())
    >>> simulation_doubts(beside, verdict.events)
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

    No vehicle changes its velocity enough, none overturns, and no person outside a vehicle is struck.
    """
    least_mps = _LEAST_HARM_MPS.get(record.severity) if record.severity else None
    if least_mps is None or not observed.events or any(event.overturn or event.person for event in observed.events):
        return None
    changes = [side.delta_v_mps for event in observed.events for side in event.sides.values()]
    change_mps = max(changes, default=0.0)
    if change_mps >= least_mps:
        return None
    harm = "a death" if record.severity is Severity.KILLED else "a serious injury"
    detail = (
        f"no vehicle changes its velocity by more than {mps_to_mph(change_mps):.0f} mph, which does not explain {harm} "
        f"(at least {mps_to_mph(least_mps):.0f} mph)"
    )
    return Reservation(Doubt.HARMLESS, detail)
