"""Agents that cannot be made are said before any crash is run."""

from __future__ import annotations

from pathlib import Path

import pytest

from trace_dag.agents.evaluation.agent_main import AgentLimits
from trace_dag.agents.evaluations import try_agents
from trace_dag.common.errors import UserError

AGENTS = """
import os, time

class Driver:
    def __init__(self): self.act = self.reset = lambda given: None

class Raising:
    def __init__(self): raise KeyError("weights")

class Hanging:
    def __init__(self): time.sleep(60)

class Leaving:
    def __init__(self): os._exit(3)
"""


@pytest.fixture(autouse=True)
def module(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    (tmp_path / "my_agents.py").write_text(AGENTS)
    monkeypatch.syspath_prepend(tmp_path)


def test_any_object_with_the_methods_of_an_agent_is_one():
    assert try_agents(["my_agents:Driver"], AgentLimits()) is None  # it raises for what is none


@pytest.mark.parametrize(
    ("agents", "limits", "said"),
    [
        (["Driver", "Raising"], AgentLimits(), "cannot be made: KeyError: 'weights'"),
        (["Hanging"], AgentLimits(time_s=0.5), "took longer than 2.5 s"),  # alone: others would be held to it too
        (["Driver", "Leaving"], AgentLimits(), "ended its process"),
    ],
)
def test_an_agent_that_cannot_be_made_is_named_with_what_came_of_it(agents, limits, said):
    with pytest.raises(UserError, match=f"--agent my_agents:{agents[-1]}: ") as caught:
        try_agents([f"my_agents:{name}" for name in agents], limits)
    assert said in str(caught.value)
