"""Doubts about an accepted crash: each keeps it from being corroborated, whatever supports it.

Support (:mod:`trace_dag.verdict.support`) weighs facts; a doubt is not outweighed. Belongs here: what makes a motion
that agrees with its report one that can hardly have happened, or one among several that are as likely.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Sequence
from typing import Final

import numpy as np

from trace_dag.crash.codes.events import CROSSED_MEDIAN, RAN_OFF, RAN_OFF_AT_END, RAN_OFF_LEFT, RAN_OFF_RIGHT
from trace_dag.crash.parties import PartyKind, party_in_words
from trace_dag.crash.record import CrashRecord
from trace_dag.crash.road_departure import ON_ROADWAY
from trace_dag.crash.summary import event_in_words, event_named
from trace_dag.roads.crash_site.contradicted_road import has_name_of_another
from trace_dag.roads.map.network import RoadNetwork
from trace_dag.roads.report import MapReport
from trace_dag.sim.types import SimulationLog, moment_of
from trace_dag.states.alternatives import Alternatives
from trace_dag.units import mps_to_mph
from trace_dag.verdict.observation import LEAST_RECORDED_MPS, ObservedCrash
from trace_dag.verdict.place_facts import names_at
from trace_dag.verdict.types import Doubt, EventOutcome, Happening, Reservation

OFF_GROUND_M: Final = 1.0
"""How far the middle of a vehicle may be off what is mapped: widths of lanes and shoulders are known no better."""
_STEP_S: Final = 0.1
_LEFT_ROAD: Final = frozenset({RAN_OFF_RIGHT, RAN_OFF_LEFT, RAN_OFF_AT_END, RAN_OFF, CROSSED_MEDIAN})


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
        _off_mapped_ground(record, observed),
        _other_street(record, observed.network, report),
        *_missed(record, events),
        _harmless(observed),
        _ambiguous(unsure),
    )
    return tuple(each for each in found if each is not None)


def off_mapped_ground_m(network: RoadNetwork, log: SimulationLog, numbers: Iterable[int]) -> dict[int, float]:
    """How far the middle of each vehicle is off mapped carriageways, driveways, shoulders and pavements (m) until the
    first event, at most; 0 for those that stay on them.

    >>> off_mapped_ground_m(network, log, [1, 2])
    {1: 0.0, 2: 0.0}
    """
    moment = moment_of(log)
    until_s = moment.time_s if moment is not None else 0.0
    found = {}
    for number in numbers:
        driven = log.vehicle_log(number)
        time_s = np.append(np.arange(float(driven.time_s[0]), until_s, _STEP_S), until_s)
        x_m, y_m = (np.interp(time_s, driven.time_s, values) for values in (driven.x_m, driven.y_m))
        outside = ~network.paved_area.contains(x_m, y_m)
        beyond = network.paved_area.beyond_m(x_m[outside], y_m[outside]) if outside.any() else np.zeros(1)
        found[number] = float(np.nan_to_num(beyond, nan=np.inf).max())
    return found


def _off_mapped_ground(record: CrashRecord, observed: ObservedCrash) -> Reservation | None:
    """A vehicle that is where no road is, though the report does not have it off the road."""
    if record.road_relation_code is not None and record.road_relation_code not in ON_ROADWAY:
        return None
    moving = [
        state.vehicle_number
        for state in observed.hypothesis.participants
        if state.kind is PartyKind.MOTOR_VEHICLE and not _left_road(record, state.vehicle_number)
    ]
    off_m = off_mapped_ground_m(observed.network, observed.log, moving)
    far = [(number, value) for number, value in off_m.items() if value > OFF_GROUND_M]
    if not far:
        return None
    number, value = max(far, key=lambda each: each[1])
    detail = (
        f"{party_in_words(number)} is up to {value:.1f} m off every mapped road, driveway and shoulder before the "
        "first event, which the report does not say"
    )
    return Reservation(Doubt.OFF_MAPPED_GROUND, detail)


def _left_road(record: CrashRecord, number: int) -> bool:
    """Whether the report has a vehicle leave the road before the first harmful event."""
    for event in record.events:
        if event.is_harmful:
            return False
        if event.code in _LEFT_ROAD and event.party_1 == number:
            return True
    return False


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


def _harmless(observed: ObservedCrash) -> Reservation | None:
    """No vehicle changes its velocity by what an event data recorder records, none overturns, and nobody outside a
    vehicle is struck."""
    if not observed.events or any(event.overturn or event.person for event in observed.events):
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
