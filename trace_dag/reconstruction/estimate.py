"""The interface of an estimator, and the estimator that the settings name.

Belongs here: the interface, which packages implement and offer by name (:mod:`trace_dag.common.plugins`). Does not
belong here: the search for hypotheses.
"""

from __future__ import annotations

from typing import Protocol

from trace_dag.common.errors import Reason, Rejection
from trace_dag.common.plugins import PluginKind, load
from trace_dag.common.settings import StateSettings
from trace_dag.common.storage.files import Storage
from trace_dag.crash.record import CrashRecord
from trace_dag.roads.map.network import RoadNetwork
from trace_dag.roads.report import MapReport
from trace_dag.simulation.states import EstimatorRun, StateEstimate


class Estimator(Protocol):
    """Makes hypotheses of the states before a crash."""

    def estimate(self, record: CrashRecord, network: RoadNetwork, report: MapReport) -> StateEstimate:
        """Return states of the vehicles and people of one crash: ranked hypotheses, at least one.

        Raises :class:`trace_dag.common.errors.Rejection` with ``no_feasible_state``, also as :class:`UnusableAnswers`.
        An estimator with a service also raises :class:`trace_dag.common.errors.Failure` and
        :class:`trace_dag.common.errors.TransientFailure`.
        """

    def require(self) -> None:
        """Raise :class:`trace_dag.common.errors.UserError` if something is missing, before anything runs."""


class EstimatorFactory(Protocol):
    """A package's estimator, usually its class (entry points of the group ``trace_dag.estimators``)."""

    paid: bool
    """True where an estimate may cost money: it is then asked only by name."""

    def __call__(self, settings: StateSettings, files: Storage | None = None, ledger: str = "run") -> Estimator:
        """Return the estimator by the settings.

        It may keep answers of a service in ``files``, a storage root that all workers share. Estimators with the same
        ``files`` and the same ``ledger`` share one budget and one rate.
        """

    def variant(self, settings: StateSettings, name: str) -> StateSettings:
        """Return the settings for a name such as ``llm:PROMPT@MODEL``.

        ``name`` is the part behind the estimator's own name, never empty.

        Raises :class:`trace_dag.common.errors.UserError` if the estimator has no such variant.
        """


class UnusableAnswers(Rejection):
    """A service gave no usable answer; ``run`` has its answers and their cost."""

    def __init__(self, detail: str, run: EstimatorRun, *, threshold: float) -> None:
        super().__init__(Reason.NO_FEASIBLE_STATE, detail, measured=run.attempts, threshold=threshold)
        self.run = run


def estimator_factory(settings: StateSettings) -> EstimatorFactory:
    """Return the factory of the estimator.

    Raises :class:`trace_dag.common.errors.UserError` if it cannot be loaded.

    >>> estimator = estimator_factory(StateSettings(estimator="analytic"))(StateSettings())
    >>> estimator.estimate(record, network, map_report).key
    '2023-319003'
    """
    factory: EstimatorFactory = load(PluginKind.ESTIMATOR, settings.estimator)
    return factory


def estimate(record: CrashRecord, network: RoadNetwork, report: MapReport, settings: StateSettings) -> StateEstimate:
    """Estimate one crash by the estimator in the settings; see :meth:`Estimator.estimate`.

    Answers of a service are kept in memory, and the budget is for this call alone.
    """
    return estimator_factory(settings)(settings).estimate(record, network, report)
