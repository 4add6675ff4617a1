"""Agents by name: those that installed packages offer, and any class that Python can import.

An agent is named as ``brake``, ``module:Class``, or with arguments for its class: ``module:Class?checkpoint=a.pt``.
"""

from __future__ import annotations

import importlib
import importlib.util
import re
from collections.abc import Callable, Sequence
from typing import Any
from urllib.parse import parse_qsl, quote

from trace_dag.agents.evaluation.agent_protocol import describe_exception
from trace_dag.agents.evaluation.agents import Agent, AgentFault
from trace_dag.common.errors import UserError
from trace_dag.common.plugins import PluginKind
from trace_dag.common.plugins import list_plugins as offered_plugins

BASELINES = ("replay", "brake", "idm", "cautious", "r157")

_NOT_IN_A_LABEL = re.compile(r"[^A-Za-z0-9._-]+")
_REFERENCE = re.compile(r"[A-Za-z_]\w*(\.[A-Za-z_]\w*)*:[A-Za-z_]\w*")


def list_agents() -> dict[str, str]:
    """Return the agents that installed packages offer: ``module:Class`` by name."""
    return {name: plugin.reference for name, plugin in offered_plugins(PluginKind.AGENT).items()}


def set_arguments(agent: str, arguments: Sequence[str]) -> str:
    """Return the agent with arguments for its class, each ``NAME=VALUE``.

    Raises :class:`UserError` for any other form.

    >>> set_arguments('my_stack:Agent', ['checkpoint=runs/a b.pt'])
    'my_stack:Agent?checkpoint=runs/a%20b.pt'
    """
    pairs = []
    for argument in arguments:
        name, equals, value = argument.partition("=")
        if not (equals and name.isidentifier()):
            raise UserError(f"--agent-arg {argument}: expected NAME=VALUE, such as checkpoint=runs/a.pt")
        pairs.append(f"{name}={quote(value)}")
    return f"{agent}?{'&'.join(pairs)}" if pairs else agent


def resolve(agent: str) -> str:
    """Return the ``module:Class`` of an agent given by name or reference, with its arguments.

    The module is not imported. Raises :class:`UserError` for an unknown name or module.

    >>> resolve("json:JSONDecoder?strict=no")  # any module that can be found
    'json:JSONDecoder?strict=no'
    """
    name, question_mark, arguments = agent.partition("?")
    known = list_agents()
    reference = known.get(name, name)
    if not _REFERENCE.fullmatch(reference):
        raise UserError(f"--agent {agent}: expected {', '.join(sorted(known))}, or module:Class")
    package = reference.partition(":")[0].partition(".")[0]
    if importlib.util.find_spec(package) is None:
        raise UserError(f"--agent {agent}: no module {package!r} here or among the installed packages")
    return f"{reference}{question_mark}{arguments}"


def make_agent(reference: str) -> Agent:
    """Return an instance of the class, made with its arguments as text.

    Raises :class:`AgentFault` if that fails.
    """
    place, _, arguments = reference.partition("?")
    module_name, _, name = place.partition(":")
    try:
        module = importlib.import_module(module_name)
        factory: Callable[[], Any] | None = getattr(module, name, None)
        if factory is None:
            raise AgentFault(f"module {module_name} has no class {name}")
        agent = factory(**dict(parse_qsl(arguments, keep_blank_values=True)))
    except AgentFault:
        raise
    except BaseException as error:  # KeyboardInterrupt, too: in the process of an agent nobody else raises it
        raise AgentFault(f"{reference} cannot be made: {describe_exception(error)}") from error
    missing = [method for method in ("reset", "act") if not callable(getattr(agent, method, None))]
    if missing:
        raise AgentFault(f"{reference} is not an agent: it has no method {' and '.join(missing)}")
    made: Agent = agent
    return made


def label(agent: str) -> str:
    """Return the agent's name as part of a file's name and in tables.

    >>> label('my_stack.agents:Careful'), label('my_stack:Agent?checkpoint=runs/a.pt')
    ('my_stack.agents.Careful', 'my_stack.Agent-checkpoint-runs-a.pt')
    """
    return _NOT_IN_A_LABEL.sub("-", agent.replace(":", "."))
