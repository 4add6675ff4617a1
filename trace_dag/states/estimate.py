"""The stage's entry point: the estimator the settings name."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING

from trace_dag.crash.record import CrashRecord
from trace_dag.roads.network import RoadNetwork
from trace_dag.roads.report import MapReport
from trace_dag.settings import StateSettings
from trace_dag.states.analytic import estimate_analytic
from trace_dag.states.types import StateEstimate

if TYPE_CHECKING:
    from trace_dag.states.llm.client import LlmClient
    from trace_dag.states.llm.store import Files


def estimate(
    record: CrashRecord,
    network: RoadNetwork,
    report: MapReport,
    settings: StateSettings,
    *,
    llm: LlmClient | None = None,
) -> StateEstimate:
    """States of the vehicles of one crash: ranked hypotheses, at least one.

    ``llm`` is the client to ask with where the settings name the LLM estimator; without one, answers are kept in
    memory and the budget is this call's own.

    Raises :class:`trace_dag.errors.Rejection` with ``no_feasible_state``; the LLM estimator also
    :class:`trace_dag.errors.Failure` and :class:`trace_dag.errors.TransientFailure`.
    """
    if settings.estimator == "analytic":
        return estimate_analytic(record, network, report, settings)
    from trace_dag.states.llm.estimator import estimate_llm

    return estimate_llm(record, network, report, settings, llm or llm_client(settings))


def llm_client(settings: StateSettings, *, files: Files | None = None, ledger: Path | None = None) -> LlmClient:
    """A client by the settings: answers kept in ``files`` (a storage root), budget and rate shared through ``ledger``.

    One ``ledger`` file per run makes the budget the run's, over all its processes on one machine.
    """
    from trace_dag.states.llm.client import LlmClient
    from trace_dag.states.llm.ledger import Ledger
    from trace_dag.states.llm.store import AnswerStore

    return LlmClient(
        model=settings.llm_model,
        timeout_s=settings.llm_timeout_s,
        store=AnswerStore(files),
        ledger=Ledger(settings.llm_budget_usd, settings.llm_requests_per_minute, ledger),
    )
