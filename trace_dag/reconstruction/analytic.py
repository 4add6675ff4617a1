"""The estimator ``analytic`` of the settings."""

from __future__ import annotations

from trace_dag.common.errors import UserError
from trace_dag.common.settings import StateSettings
from trace_dag.common.storage.files import Storage
from trace_dag.crash.record import CrashRecord
from trace_dag.reconstruction.analytic_hypotheses import NAME
from trace_dag.reconstruction.search import estimate_by_record
from trace_dag.roads.map.network import RoadNetwork
from trace_dag.roads.report import MapReport
from trace_dag.simulation.states import StateEstimate


class AnalyticEstimator:
    """An estimator without a language model; it gives the same estimate for the same crash."""

    paid = False

    def __init__(self, settings: StateSettings, files: Storage | None = None, ledger: str = "run") -> None:
        self._settings = settings

    def estimate(self, record: CrashRecord, network: RoadNetwork, report: MapReport) -> StateEstimate:
        """See :func:`estimate_by_record`."""
        return estimate_by_record(record, network, report, self._settings)

    def require(self) -> None:
        """Require nothing."""

    @staticmethod
    def variant(settings: StateSettings, name: str) -> StateSettings:
        """Raise UserError, because there is only one variant."""
        raise UserError(f"{NAME + name!r} is not an estimator; {NAME} has no variants")
