"""Doubts about an accepted crash: each keeps it from being corroborated, whatever supports it.

Support (:mod:`trace_dag.verdict.support`) weighs facts; a doubt is not outweighed. Belongs here: what makes a motion
that agrees with its report one that can hardly have happened, or one among several that are as likely.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence

from trace_dag.crash.record import CrashRecord, Severity
from trace_dag.crash.summary import event_in_words, event_named
from trace_dag.roads.crash_site.contradicted_road import has_name_of_another
from trace_dag.roads.map.network import RoadNetwork
from trace_dag.roads.report import MapReport
from trace_dag.states.alternatives import Alternatives
from trace_dag.units import mps_to_mph
from trace_dag.verdict.observation import LEAST_RECORDED_MPS, ObservedCrash
from trace_dag.verdict.place_facts import names_at
from trace_dag.verdict.types import Doubt, EventOutcome, Happening, Reservation


def reservations_about(
    record: CrashRecord,
    report: MapReport,
    unsure: Alternatives | None,
    observed: ObservedCrash,
    events: Sequence[EventOutcome],
) -> tuple[Reservation, ...]:
    """Every doubt about a simulated hypothesis that agrees with its report.

    >>> reservations_about(record, map_report, None, observed_crash, verdict.events)
    ()
    """
    found = (
        _other_street(record, observed.network, report),
        *_missed(record, events),
        _harmless(record, observed),
        _no_areas(record),
        _ambiguous(unsure),
    )
    return tuple(each for each in found if each is not None)


def _other_street(record: CrashRecord, network: RoadNetwork, report: MapReport) -> Reservation | None:
    """The street of the crash has another name than the report's, or none, and the reported one is elsewhere on the
    map."""
    here = names_at(record, network, report.placement)
    if not has_name_of_another(record, here, network):
        return None
    found = ", ".join(sorted(here)) or "a street without a name"
    detail = f"the crash stands on {found}; the report names {record.trafficway_1}, which is elsewhere on the map"
    return Reservation(Doubt.OTHER_STREET, detail)


def _missed(record: CrashRecord, events: Sequence[EventOutcome]) -> Iterator[Reservation]:
    """Each harmful event of the report that can be modelled and does not happen."""
    by_number = {event.number: event for event in record.events}
    for each in events:
        if each.outcome is Happening.MISSED:
            event = by_number.get(each.event_number)
            what = event_in_words(event) if event else event_named(each.event_number, each.code)
            detail = f"{what}: does not happen in the simulation ({each.why})"
            yield Reservation(Doubt.EVENT_MISSED, detail)


def _no_areas(record: CrashRecord) -> Reservation | None:
    """Its register has no areas of impact: at which parts the bodies meet is asked of no simulation."""
    if "impact" not in record.register_lacks:
        return None
    detail = "the register has no areas of impact: that the bodies meet at other parts would not be noticed"
    return Reservation(Doubt.NO_AREAS, detail)


def _harmless(record: CrashRecord, observed: ObservedCrash) -> Reservation | None:
    """Somebody was killed, and no vehicle changes its velocity by what an event data recorder records, none overturns,
    and nobody outside a vehicle is struck."""
    if (
        record.severity is not Severity.KILLED
        or not observed.events
        or any(event.overturn or event.person for event in observed.events)
    ):
        return None
    changes = [side.delta_v_mps for event in observed.events for side in event.sides.values()]
    change_mps = max(changes, default=0.0)
    if change_mps >= LEAST_RECORDED_MPS:
        return None
    detail = (
        f"the simulated impact is harmless (a change of velocity of {mps_to_mph(change_mps):.0f} mph at most): it does "
        "not explain a death"
    )
    return Reservation(Doubt.HARMLESS, detail)


def _ambiguous(unsure: Alternatives | None) -> Reservation | None:
    return Reservation(Doubt.AMBIGUOUS, unsure.clause) if unsure is not None and unsure.of_approaches else None
