"""Estimates that follow from the record and the map alone, by what a crash is reconstructed as."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from typing import Final

from trace_dag.crash.reconstruction import Reconstruction, reconstruction_of
from trace_dag.crash.record import CrashRecord
from trace_dag.estimators.aftermath import with_aftermath
from trace_dag.estimators.contacts import estimate_contacts
from trace_dag.estimators.overturns import estimate_overturn
from trace_dag.estimators.strikes import estimate_strikes
from trace_dag.roads.map.network import RoadNetwork
from trace_dag.roads.report import MapReport
from trace_dag.settings import StateSettings
from trace_dag.states.analytic import estimate_analytic
from trace_dag.states.departures import estimate_departure
from trace_dag.states.types import StateEstimate

_MADE_BY: Final[
    Mapping[Reconstruction, Callable[[CrashRecord, RoadNetwork, MapReport, StateSettings], StateEstimate]]
] = {
    Reconstruction.COLLISION: estimate_analytic,
    Reconstruction.STRIKES: estimate_strikes,
    Reconstruction.CONTACTS: estimate_contacts,
    Reconstruction.DEPARTURE: estimate_departure,
    Reconstruction.OVERTURN: estimate_overturn,
}


def estimate_by_record(
    record: CrashRecord, network: RoadNetwork, report: MapReport, settings: StateSettings
) -> StateEstimate:
    """The ranked hypotheses of a crash, best first.

    Raises :class:`trace_dag.errors.Rejection` (``no_feasible_state``) where none lets happen what is reported.
    """
    made = _MADE_BY[reconstruction_of(record)](record, network, report, settings)
    return with_aftermath(made, record, network, report)
