"""The stage's entry point: the estimator the settings name."""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING, Protocol

from trace_dag.crash.record import CrashRecord
from trace_dag.crash.strikes import is_of_strikes
from trace_dag.roads.map.network import RoadNetwork
from trace_dag.roads.report import MapReport
from trace_dag.settings import StateSettings
from trace_dag.states.analytic import estimate_analytic
from trace_dag.states.strikes import estimate_strikes
from trace_dag.states.types import EstimatorRun, StateEstimate

if TYPE_CHECKING:
    from trace_dag.states.llm.client import LlmClient
    from trace_dag.states.llm.ledger import SharedFiles
    from trace_dag.states.llm.store import Files

    class LlmFiles(Files, SharedFiles, Protocol):
        """Where the LLM estimator keeps answers and ledgers; :class:`trace_dag.storage.Storage` is one."""


def estimate(
    record: CrashRecord,
    network: RoadNetwork,
    report: MapReport,
    settings: StateSettings,
    *,
    llm: LlmClient | None = None,
) -> StateEstimate:
    """States of the vehicles and people of one crash: ranked hypotheses, at least one.

    ``llm`` is the client to ask with where the settings name the LLM estimator; without one, answers are kept in
    memory and the budget is this call's own.

    Raises :class:`trace_dag.errors.Rejection` with ``no_feasible_state``; the LLM estimator also
    :class:`trace_dag.errors.Failure` and :class:`trace_dag.errors.TransientFailure`.
    """
    if is_of_strikes(record):
        made = estimate_strikes(record, network, report, settings)
        return made if settings.estimator == "analytic" else replace(made, run=_in_place_of(settings, made.run))
    if settings.estimator == "analytic":
        return estimate_analytic(record, network, report, settings)
    from trace_dag.states.llm.estimator import estimate_llm

    return estimate_llm(record, network, report, settings, llm or llm_client(settings))


def _in_place_of(settings: StateSettings, run: EstimatorRun) -> EstimatorRun:
    """Says that the language model was not asked: its questions are about two vehicles."""
    reason = "language models are asked about collisions of two vehicles only"
    return replace(run, model=settings.llm_model, attempts=0, fallback_from="llm", fallback_reason=reason)


def llm_client(settings: StateSettings, *, files: LlmFiles | None = None, ledger: str = "run") -> LlmClient:
    """A client by the settings: answers, budget and rate kept in ``files`` (a storage root), else in memory.

    Clients with the same ``files`` and the same ``ledger`` share budget and rate, over all processes and machines.
    """
    from trace_dag.states.llm.client import LlmClient
    from trace_dag.states.llm.ledger import SpendingLedger
    from trace_dag.states.llm.store import AnswerStore

    return LlmClient(
        model=settings.llm_model,
        timeout_s=settings.llm_timeout_s,
        attempts=settings.llm_provider_attempts,
        question_time_s=settings.llm_question_time_s,
        max_output_tokens=settings.llm_max_output_tokens,
        store=AnswerStore(files),
        ledger=SpendingLedger(
            settings.llm_budget_usd, settings.llm_requests_per_minute, files, settings.llm_ledger or ledger
        ),
    )
