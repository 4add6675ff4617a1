"""What a worker of a cluster does with an evaluation that takes too long."""

from __future__ import annotations

import time
from types import SimpleNamespace
from typing import Any, cast

import pytest

from trace_dag.agents.evaluation.agent_main import AgentLimits
from trace_dag.agents.evaluation.evaluate import Conditions
from trace_dag.agents.evaluation_work import EvaluationWork, LoadedCase, Step, _done
from trace_dag.agents.stored_cases import AgentRole
from trace_dag.common.settings import SimSettings
from trace_dag.flow.pool import Lost


def test_an_agent_that_was_broken_off_is_not_asked_again(monkeypatch: pytest.MonkeyPatch) -> None:
    """It may be in the middle of an answer to the evaluation before."""
    ended: list[bool] = []
    work = EvaluationWork(SimSettings(), {}, Conditions(), AgentLimits(time_s=60.0), None)
    work._agents["slow:Agent"] = cast(Any, SimpleNamespace(close=lambda: ended.append(True)))
    monkeypatch.setattr(EvaluationWork, "step_limit_s", 0.2)
    monkeypatch.setattr(EvaluationWork, "do", lambda *_: time.sleep(30.0))
    shared = cast(LoadedCase, None)  # ``do`` is replaced
    assert _done(work, shared, Step("slow", "slow:Agent", AgentRole.FIRST)) == Lost("took longer than 0.2 s")
    assert ended == [True]
    assert not work._agents
