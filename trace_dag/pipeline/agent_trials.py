"""Agents made once, before any crash is run: a mistyped name is said at once, not as sixty faults."""

from __future__ import annotations

from collections.abc import Sequence

from trace_dag.errors import UserError
from trace_dag.evaluation.agents import AgentFault
from trace_dag.evaluation.registry import make_agent, resolve
from trace_dag.pipeline.deadlines import DeadlinePool, StepLost, Task
from trace_dag.pipeline.evaluations import Limits


class _Making:
    """What the worker does: make an agent, given as ``module:Class``, and tell what came in the way."""

    def prepare(self, name: str) -> None:
        """The making of one agent shares nothing with that of another."""

    def do(self, shared: None, step: str) -> str | None:
        try:
            make_agent(step)
        except AgentFault as fault:
            return str(fault)
        return None


def try_agents(agents: Sequence[str], limits: Limits) -> None:
    """Make each agent once, in a worker: nothing of an agent ever runs in this process.

    Raises :class:`UserError` for the first that cannot be made: no such module or class, a class without the methods
    of an agent, one that raises, hangs, or ends its process.
    """
    tasks = [Task(agent, (resolve(agent),)) for agent in agents]
    pool: DeadlinePool[None, str, str | None] = DeadlinePool(
        _Making(), workers=1, step_limit_s=limits.time_s, memory_mb=limits.memory_mb
    )
    for answer in pool.run(tasks):
        fault = f"{answer.step} {answer.result.detail}" if isinstance(answer.result, StepLost) else answer.result
        if fault is not None:
            raise UserError(f"--agent {answer.task}: {fault}")
