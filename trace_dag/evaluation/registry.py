"""Agents by name: those that installed packages offer, and any class that Python can import."""

from __future__ import annotations

import importlib
import importlib.util
import re
from collections.abc import Callable
from typing import Any

from trace_dag import plugins
from trace_dag.errors import UserError
from trace_dag.evaluation.agents import Agent, AgentFault
from trace_dag.evaluation.loop import described
from trace_dag.plugins import PluginKind

BASELINES = ("replay", "brake", "idm", "cautious")

_REFERENCE = re.compile(r"[A-Za-z_]\w*(\.[A-Za-z_]\w*)*:[A-Za-z_]\w*")


def offered() -> dict[str, str]:
    """The agents that installed packages offer: ``module:Class`` by name."""
    return {name: plugin.reference for name, plugin in plugins.offered(PluginKind.AGENT).items()}


def resolve(agent: str) -> str:
    """The ``module:Class`` of an agent given by name or as such. Nothing of the agent is imported.

    Raises :class:`UserError` for a name nobody offers and a module that is not there.
    """
    known = offered()
    reference = known.get(agent, agent)
    if not _REFERENCE.fullmatch(reference):
        raise UserError(f"--agent {agent}: expected {', '.join(sorted(known))}, or module:Class")
    package = reference.partition(":")[0].partition(".")[0]
    if importlib.util.find_spec(package) is None:
        raise UserError(f"--agent {agent}: no module {package!r} here or among the installed packages")
    return reference


def make_agent(reference: str) -> Agent:
    """An instance of the class. Raises :class:`AgentFault` for whatever goes wrong on the way."""
    module_name, _, name = reference.partition(":")
    try:
        module = importlib.import_module(module_name)
        factory: Callable[[], Any] | None = getattr(module, name, None)
        if factory is None:
            raise AgentFault(f"module {module_name} has no class {name}")
        agent = factory()
    except AgentFault:
        raise
    except (Exception, SystemExit) as error:
        raise AgentFault(f"{reference} cannot be made: {described(error)}") from error
    missing = [method for method in ("reset", "act") if not callable(getattr(agent, method, None))]
    if missing:
        raise AgentFault(f"{reference} is no agent: it has no method {' and '.join(missing)}")
    made: Agent = agent
    return made


def label(agent: str) -> str:
    """The agent's name as part of a file's name and in tables: ``pkg.module.Class`` for ``pkg.module:Class``.

    >>> label('my_stack.agents:Careful')
    'my_stack.agents.Careful'
    """
    return agent.replace(":", ".")
