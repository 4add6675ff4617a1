"""One estimate by a model on a loopback server."""

from __future__ import annotations

import json
from dataclasses import dataclass, field

from cases import Case
from loopback import Loopback, serving
from model_server import Respond, llm_settings

from trace_dag.common.settings import StateSettings
from trace_dag.common.storage.files import Storage
from trace_dag.crash.event_sequence import sequence_of
from trace_dag.language.client import LlmClient
from trace_dag.language.hypotheses import estimate_llm, llm_client
from trace_dag.reconstruction.analytic_hypotheses import build_scene
from trace_dag.simulation.states import StateEstimate

HEAD_ON, LEFT_TURN = "2023-319022", "2023-319003"


@dataclass
class Asked:
    """What came of it: the estimate, what the server saw, how long the client slept."""

    estimate: StateEstimate | None
    server: Loopback
    slept: list[float] = field(default_factory=list)

    def question(self, number: int) -> str:
        """The last message of a request."""
        return json.loads(self.server.requests[number].body)["messages"][-1]["content"]


def by_model(case: Case, settings: StateSettings, client: LlmClient) -> StateEstimate:
    """What a model makes of the first contact of a crash."""
    scene = build_scene(case.record, case.network, case.report, lead_time_s=settings.lead_time_s)
    return estimate_llm(scene, sequence_of(case.record).first, settings, client)


def asking(monkeypatch, case: Case, respond: Respond, *, files: Storage | None = None, **changes: object) -> Asked:
    """Estimate a crash with answers of the server's; ``changes`` are settings."""
    chosen = llm_settings(**changes)
    with serving(respond) as server:
        monkeypatch.setenv("OPENAI_API_BASE", f"{server.url}/v1")
        client = llm_client(chosen, files=files)
        asked = Asked(None, server)
        client.sleep = asked.slept.append
        asked.estimate = by_model(case, chosen, client)
    return asked
