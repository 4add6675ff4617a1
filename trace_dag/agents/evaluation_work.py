"""The work of one evaluation, by processes of this machine or workers of a cluster, and the identity of agent code.

Belongs here: loading a case, driving it, and dividing the cases. Does not belong here: what becomes of the answers
(:mod:`trace_dag.agents.evaluations`), and driving and measuring themselves (:mod:`trace_dag.agents.evaluation`).
"""

from __future__ import annotations

import hashlib
import importlib.util
import math
import time
from collections.abc import Iterator, Mapping, Sequence
from contextlib import closing, suppress
from dataclasses import dataclass, field, replace
from functools import partial
from pathlib import Path
from urllib.parse import parse_qsl

from trace_dag.agents.evaluation.agent_main import AgentLimits
from trace_dag.agents.evaluation.agent_process import WAITS, AgentProcess
from trace_dag.agents.evaluation.evaluate import Conditions, Evaluation, evaluate
from trace_dag.agents.evaluation.isolation import Isolation
from trace_dag.agents.stored_cases import AgentRole, StoredCase, number_of
from trace_dag.agents.stored_traffic import load_driven
from trace_dag.common.errors import Failure
from trace_dag.common.provenance import libraries_of
from trace_dag.common.settings import SimSettings
from trace_dag.flow.executors import available_cores, run_redoing_lost
from trace_dag.flow.pool import Lost, Pool, StepAnswer, Task
from trace_dag.flow.time_limit import within
from trace_dag.flow.workspace import Workspace
from trace_dag.scenario.cases import Case
from trace_dag.simulation.run import backend, backend_factory
from trace_dag.simulation.types import Simulation

VERSION = "6"
"""Number of the code that evaluates, our agents' included; see :data:`trace_dag.flow.stages.VERSIONS`."""
_OURS_S = 120.0  # beyond making an agent and its evaluation: what a worker does itself, a new process included
_OUR_MEMORY_MB = 4096
_CHUNKS_PER_WORKER = 4  # of a cluster, at least
_MOST_TOGETHER = 8  # cases that a worker of a cluster is given at a time: its agents are made once for them


@dataclass(frozen=True)
class Step:
    """One evaluation: an agent, as ``module:Class``, in somebody's place."""

    name: str
    reference: str
    role: AgentRole


@dataclass
class LoadedCase:
    """The parts of a case that its evaluations share in a worker."""

    case: Case
    simulation: Simulation


@dataclass
class EvaluationWork:
    """Simulation and measurement in the workers.

    Each agent is in a process beside each worker, made once.
    """

    settings: SimSettings
    cases: Mapping[str, StoredCase]
    conditions: Conditions
    limits: AgentLimits
    isolation: Isolation | None
    _agents: dict[str, AgentProcess] = field(default_factory=dict)

    @property
    def step_limit_s(self) -> float:
        """Return the limit of one evaluation's duration, whatever the agent does, s."""
        return 2 * WAITS * self.limits.time_s + _OURS_S

    def prepare(self, name: str) -> LoadedCase:
        """Return the case, and its map made ready.

        Raises :class:`Failure`.
        """
        try:
            case = load_driven(self.cases[name], self.conditions.traffic)
            return LoadedCase(case, backend(self.settings).load(case.network, case.xodr, friction=case.friction))
        except Failure:
            raise
        except Exception as error:
            raise Failure(f"{name} cannot be loaded for evaluation: {type(error).__name__}: {error}") from error

    def do(self, shared: LoadedCase, step: Step) -> Evaluation:
        """Return one evaluation; a fault of the agent is its result."""
        if step.reference not in self._agents:
            self._agents[step.reference] = AgentProcess(step.reference, self.limits, self.isolation)
        ego = number_of(shared.case, step.role)
        return evaluate(shared.case, ego, self._agents[step.reference], self.conditions, shared.simulation)

    def close(self) -> None:
        """End the agents' processes."""
        for agent in self._agents.values():
            agent.close()
        self._agents.clear()


Answers = Iterator[StepAnswer[Step, Evaluation]]


def answers(workspace: Workspace, work: EvaluationWork, tasks: Sequence[Task[Step]]) -> Answers:
    """Answer every step of every case once, with the workers that the settings ask for.

    On a cluster each worker needs the same version of the agents' modules; raises :class:`Failure` otherwise.
    """
    execution = workspace.settings.execution
    one_at_a_time = backend_factory(work.settings).one_at_a_time
    if execution.executor == "dask" and not one_at_a_time:
        return _on_cluster(workspace, work, tasks)
    workers = 1 if one_at_a_time else execution.workers or available_cores()
    pool: Pool[LoadedCase, Step, Evaluation] = Pool(
        work, workers=workers, step_limit_s=work.step_limit_s, memory_mb=_OUR_MEMORY_MB
    )
    return _in_pool(pool, tasks)


def _in_pool(pool: Pool[LoadedCase, Step, Evaluation], tasks: Sequence[Task[Step]]) -> Answers:
    with closing(pool):
        yield from pool.run(tasks)


def evaluation_code_version(settings: SimSettings) -> str:
    """Return the version of the evaluating code; measures of different versions are not compared."""
    return f"{VERSION}, mujoco {libraries_of(settings)['mujoco']}"


# --- on a cluster -----------------------------------------------------------------------------------------------------
@dataclass(frozen=True)
class _Chunk:
    """Some cases for a worker of a cluster. ``code``: of what evaluates, and of each agent by its reference."""

    work: EvaluationWork
    tasks: tuple[Task[Step], ...]
    code: str
    agents: Mapping[str, str]

    def split(self) -> list[_Chunk]:
        """Return one chunk for each evaluation, to be tried again."""
        return [replace(self, tasks=(Task(task.name, (step,)),)) for task in self.tasks for step in task.steps]


def _on_cluster(workspace: Workspace, work: EvaluationWork, tasks: Sequence[Task[Step]]) -> Answers:
    code = evaluation_code_version(work.settings)
    agents = {step.reference: agent_code(step.reference) for task in tasks for step in task.steps}
    unread = {name: replace(case, files=case.files.unread()) for name, case in work.cases.items()}
    with workspace.executing() as executor:
        size = max(1, min(_MOST_TOGETHER, math.ceil(len(tasks) / (executor.workers * _CHUNKS_PER_WORKER))))
        together = [tuple(tasks[start : start + size]) for start in range(0, len(tasks), size)]
        chunks = [
            _Chunk(replace(work, cases={task.name: unread[task.name] for task in some}), some, code, agents)
            for some in together
        ]
        for chunk, found in run_redoing_lost(executor, _evaluate_chunk, chunks, _Chunk.split):
            if isinstance(found, Lost):
                ((name, (step,)),) = ((task.name, task.steps) for task in chunk.tasks)
                yield StepAnswer(name, step, Lost(f"ended its worker's process ({found.detail})"))
            else:
                yield from found


def _evaluate_chunk(chunk: _Chunk) -> list[StepAnswer[Step, Evaluation]]:
    """Return the evaluations of a chunk, in order."""
    for what, theirs, ours in (
        ("what evaluates", chunk.code, evaluation_code_version(chunk.work.settings)),
        *((f"agent {reference}", code, agent_code(reference)) for reference, code in chunk.agents.items()),
    ):
        if theirs != ours:
            raise Failure(f"{what}: this worker has code {ours}, the command has {theirs}; update the workers")
    found: list[StepAnswer[Step, Evaluation]] = []
    try:
        for task in chunk.tasks:
            try:
                shared = chunk.work.prepare(task.name)
            except Failure as failure:
                found += [StepAnswer(task.name, step, failure) for step in task.steps]
                continue
            found += [StepAnswer(task.name, step, _done(chunk.work, shared, step)) for step in task.steps]
    finally:
        chunk.work.close()
    return found


def _done(work: EvaluationWork, shared: LoadedCase, step: Step) -> Evaluation | Lost:
    began_s, limit_s = time.monotonic(), work.step_limit_s
    try:
        return within(limit_s, step.name, partial(work.do, shared, step))
    except Failure as failure:
        late = time.monotonic() - began_s >= limit_s
        work.close()  # an agent that was broken off may be in the middle of an answer: the next step has a new one
        return Lost(f"took longer than {limit_s:g} s" if late else str(failure))


# --- code of agents --------------------------------------------------------------------------------------------------
def agent_code(reference: str) -> str:
    """Return the digest of an agent, given as ``module:Class?name=value``.

    It covers the sources of the agent's package (for an agent of trace-dag only its module), its arguments, and the
    bytes of files that the arguments name. The result is "unread" if the module is not a Python source.
    """
    place, _, arguments = reference.partition("?")
    digest = hashlib.sha256()
    try:
        for path in _sources(place.partition(":")[0]):
            digest.update(path.read_bytes() + b"\0")
    except (OSError, ValueError, ImportError):
        return "unread"
    for name, value in parse_qsl(arguments, keep_blank_values=True):
        digest.update(f"\0{name}\0{value}\0".encode())
        with suppress(OSError, ValueError), Path(value).open("rb") as file:
            digest.update(hashlib.file_digest(file, "sha256").digest())
    return digest.hexdigest()[:16]


def _sources(module: str) -> Iterator[Path]:
    spec = importlib.util.find_spec(module)
    if spec is None or spec.origin is None or not spec.origin.endswith(".py"):
        raise ImportError(f"{module}: no Python source")
    path = Path(spec.origin)
    alone = module.startswith("trace_dag.") or ("." not in module and path.name != "__init__.py")
    yield from [path] if alone else sorted(path.parent.rglob("*.py"))
