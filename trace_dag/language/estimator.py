"""The estimator ``llm`` of the settings."""

from __future__ import annotations

import re
from dataclasses import replace
from typing import Final

from trace_dag.common.errors import Failure, UserError
from trace_dag.common.settings import StateSettings
from trace_dag.common.storage.files import Storage
from trace_dag.crash.parties import EventKind
from trace_dag.crash.record import CrashRecord
from trace_dag.language.hypotheses import NAME, estimate_llm, llm_client
from trace_dag.language.prompt import Prompt
from trace_dag.reconstruction.course import Search
from trace_dag.reconstruction.first_event import FirstEvent, plan_first_event
from trace_dag.reconstruction.search import estimate_by_record
from trace_dag.roads.map.network import RoadNetwork
from trace_dag.roads.report import MapReport
from trace_dag.simulation.states import EstimatorRun, StateEstimate

_VARIANT: Final = re.compile(r"(:(?P<prompt>[\w-]+))?(@(?P<model>\S+))?")


class LlmEstimator:
    """The estimator ``llm`` of the settings."""

    paid = True

    def __init__(self, settings: StateSettings, files: Storage | None = None, ledger: str = "run") -> None:
        self._settings = settings
        self._client = llm_client(settings, files=files, ledger=ledger)

    def estimate(self, record: CrashRecord, network: RoadNetwork, report: MapReport) -> StateEstimate:
        """See :func:`estimate_llm`.

        If no two vehicles in transport meet first, no model is asked, and the estimate records that."""
        asked: list[EstimatorRun] = []

        def ask(search: Search, settings: StateSettings) -> FirstEvent:
            event = search.sequence.first
            if event.kind is not EventKind.VEHICLE_CONTACT or event.parked is not None:
                return plan_first_event(search, settings)
            made = estimate_llm(search.scene, event, settings, self._client)
            asked.append(made.run)
            return FirstEvent(made.hypotheses, made.ambiguity)

        made = estimate_by_record(record, network, report, self._settings, ask)
        return replace(made, run=asked[0] if asked else _in_place_of(self._settings, made.run))

    def require(self) -> None:
        """Raise UserError unless the language model answers, which needs prompt, key, model, budget and connection."""
        Prompt.load(self._settings.llm_prompt)
        try:
            self._client.try_out()
        except Failure as failure:
            raise UserError(f"the language model cannot be asked, so nothing is run: {failure}") from failure

    @staticmethod
    def variant(settings: StateSettings, name: str) -> StateSettings:
        """Return the settings with the prompt and model of ``:PROMPT``, ``@MODEL`` or ``:PROMPT@MODEL``."""
        match = _VARIANT.fullmatch(name)
        if match is None:
            raise UserError(
                f"{NAME + name!r} is not an estimator; give {NAME}, {NAME}:PROMPT, {NAME}@MODEL or "
                f"{NAME}:PROMPT@MODEL, such as {NAME}:coordinates-v1@openai/gpt-5-mini"
            )
        given = {"llm_prompt": match["prompt"], "llm_model": match["model"]}
        return settings.model_copy(update={field: value for field, value in given.items() if value is not None})


def _in_place_of(settings: StateSettings, run: EstimatorRun) -> EstimatorRun:
    """Return a run by the fallback, because language models only answer questions about two vehicles."""
    reason = "language models are asked about first contacts of two vehicles only"
    return replace(run, model=settings.llm_model, attempts=0, fallback_from=NAME, fallback_reason=reason)
