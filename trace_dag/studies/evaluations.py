"""Agents evaluated on stored crashes, in parallel, each evaluation with a time limit; and where the results lie.

``ROOT/evaluations/<agent>.parquet`` holds every evaluation of an agent, one row per case and vehicle (an evaluation
made again replaces its row), ``<agent>.json`` beside it how the latest were made. Belongs here: which crashes, the
workers, storage. Does not belong here: driving and measuring (:mod:`trace_dag.evaluation`).
"""

from __future__ import annotations

import json
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field

from trace_dag.errors import DamagedFile, Failure, UserError
from trace_dag.evaluation.agent_code import agent_code
from trace_dag.evaluation.agent_main import AgentLimits
from trace_dag.evaluation.agent_process import AgentProcess
from trace_dag.evaluation.agents import AgentFault
from trace_dag.evaluation.cases import Case
from trace_dag.evaluation.evaluate import Conditions, Evaluation, evaluate, faulty
from trace_dag.evaluation.isolation import Isolation
from trace_dag.evaluation.registry import label, resolve
from trace_dag.evaluation.table import Row, row, rows_from_parquet, rows_to_parquet
from trace_dag.flow.executors import available_cores
from trace_dag.flow.ledgers import Complaint, ledger_name, raised, read_listed, subjects, write_ledger
from trace_dag.flow.workspace import Workspace
from trace_dag.plugins import PluginKind, offered
from trace_dag.provenance import code_of, now
from trace_dag.settings import SimSettings
from trace_dag.sim.backends import backend, backend_factory
from trace_dag.sim.types import Simulation
from trace_dag.storage import Storage
from trace_dag.studies.cases import AgentRole, StoredCase, load_case, number_of
from trace_dag.studies.deadlines import DeadlinePool, StepLost, Task

FOLDER = "evaluations"

_OURS_S = 120.0  # beyond making an agent and its evaluation: what a worker does itself, a new process included
_OUR_MEMORY_MB = 4096
_ABOUT = ("rate_hz", "range_m", "noise_m", "occlusion", "traffic", "seed", "agent_code", "code_version")


@dataclass(frozen=True)
class Step:
    """One evaluation: an agent, as ``module:Class``, in somebody's place."""

    name: str
    reference: str
    role: AgentRole


@dataclass
class LoadedCase:
    """What the evaluations of one case share in a worker."""

    case: Case
    simulation: Simulation


@dataclass
class EvaluationWork:
    """What the workers do: they simulate and measure. Each agent is in a process beside each worker, made once."""

    settings: SimSettings
    cases: Mapping[str, StoredCase]
    conditions: Conditions
    limits: AgentLimits
    isolation: Isolation | None
    _agents: dict[str, AgentProcess] = field(default_factory=dict)

    def prepare(self, name: str) -> LoadedCase:
        """The case, and its map made ready. Raises :class:`Failure`."""
        try:
            case = load_case(self.cases[name])
            return LoadedCase(case, backend(self.settings).load(case.network, case.xodr, friction=case.friction))
        except Failure:
            raise
        except Exception as error:
            raise Failure(f"{name} cannot be loaded for evaluation: {type(error).__name__}: {error}") from error

    def do(self, shared: LoadedCase, step: Step) -> Evaluation:
        """One evaluation; whatever the agent does wrong is its result."""
        if step.reference not in self._agents:
            self._agents[step.reference] = AgentProcess(step.reference, self.limits, self.isolation)
        ego = number_of(shared.case, step.role)
        return evaluate(shared.case, ego, self._agents[step.reference], self.conditions, shared.simulation)


def evaluate_agents(
    workspace: Workspace,
    cases: Sequence[StoredCase],
    agents: Sequence[str],
    roles: Sequence[AgentRole],
    conditions: Conditions,
    limits: AgentLimits,
    *,
    isolation: Isolation | None = None,
    tell: Callable[[Row], None] = lambda _: None,
    complain: Complaint = raised,
) -> list[Row]:
    """Every agent in every role of every case, as rows in a fixed order, stored under the root.

    ``tell`` hears of each evaluation as it is done, ``complain`` of every step of a crash that cannot be loaded. Raises
    :class:`UserError` for agents that are not there.
    """
    references = {name: resolve(name) for name in agents}
    by_id = {case.case_id: case for case in cases}
    work = EvaluationWork(workspace.settings.sim, by_id, conditions, limits, isolation)
    steps = tuple(Step(name, reference, role) for name, reference in references.items() for role in roles)
    one_at_a_time = backend_factory(workspace.settings.sim).one_at_a_time
    workers = 1 if one_at_a_time else workspace.settings.execution.workers or available_cores()
    pool: DeadlinePool[LoadedCase, Step, Evaluation] = DeadlinePool(
        work, workers=workers, step_limit_s=2 * limits.time_s + _OURS_S, memory_mb=_OUR_MEMORY_MB
    )
    code = evaluating_code(workspace.settings.sim)
    digests = {name: agent_code(reference) for name, reference in references.items()}
    results = _Results(workspace.storage, {name: label(name) + conditions.suffix for name in agents}, complain)
    try:
        for answer in pool.run([Task(case_id, steps) for case_id in by_id]):
            stored = by_id[answer.task]
            found = answer.result
            if isinstance(found, Failure):
                complain(found)
                continue
            if isinstance(found, StepLost):
                case = load_case(stored)
                ego = number_of(case, answer.step.role)
                found = faulty(case, ego, found.detail)
            made = row(
                results.labels[answer.step.name],
                found,
                conditions,
                agent_code=digests[answer.step.name],
                code_version=code,
                verdict_fingerprint=stored.fingerprint,
            )
            results.add(answer.step.name, made)
            tell(made)
    finally:
        results.store(references)
    return results.in_order()


def evaluating_code(settings: SimSettings) -> str:
    """The version of the code that evaluates: measures of one code are not compared with those of another."""
    baselines = {each.module for each in offered(PluginKind.AGENT).values() if each.is_ours}
    return code_of((evaluate.__module__, *sorted(baselines)), settings).digest


class _Results:
    """Rows as they come; stored at the end, also if the batch is interrupted, so that finished work is kept."""

    def __init__(self, storage: Storage, labels: Mapping[str, str], complain: Complaint) -> None:
        self.labels = labels
        self._complain = complain
        self._storage = storage
        self._rows: dict[str, list[Row]] = {name: [] for name in labels}

    def add(self, name: str, made: Row) -> None:
        """Keep each row once: in a crash with a person, two roles can mean the same vehicle."""
        if not any(_identity(each) == _identity(made) for each in self._rows[name]):
            self._rows[name].append(made)

    def in_order(self) -> list[Row]:
        return [each for rows in self._rows.values() for each in sorted(rows, key=_identity)]

    def store(self, references: Mapping[str, str]) -> None:
        """Merge what came with what is stored."""
        for name, rows in self._rows.items():
            if rows:
                store_rows(self._storage, self.labels[name], references[name], rows, self._complain)


def store_rows(storage: Storage, agent: str, reference: str, rows: Sequence[Row], complain: Complaint = raised) -> None:
    """Store evaluations of one agent, a label: a row for the same case and vehicle replaces the one before.

    ``reference`` says where they come from; ``complain`` hears of what is stored of the agent and damaged.
    """
    subject = f"{FOLDER}/{agent}"
    try:
        merged = {_identity(each): each for each in stored_rows(storage, subject)}
    except DamagedFile as damaged:
        complain(damaged.mended_by("what it held of other crashes is lost; evaluate them again"))
        merged = {}
    merged |= {_identity(each): each for each in rows}
    table = storage.write(f"{subject}.parquet", rows_to_parquet(merged[each] for each in sorted(merged)))
    about = {
        "agent": agent,
        "reference": reference,
        "evaluated_at": now(),
        "evaluations": len(rows),
        **{name: rows[0][name] for name in _ABOUT},
    }
    made = storage.write(f"{subject}.json", json.dumps(about, indent=1).encode())
    write_ledger(storage, subject, [table, made])


def _identity(row_of_table: Row) -> tuple[str, int]:
    return row_of_table["case_id"], row_of_table["vehicle_number"]


def stored_rows(storage: Storage, subject: str) -> list[Row]:
    """The rows of one agent; none if there are no evaluations of it. Raises :class:`DamagedFile`."""
    agent = subject.removeprefix(f"{FOLDER}/")
    table = f"{subject}.parquet"
    if not storage.exists(table) and not storage.exists(ledger_name(subject)):
        return []
    remedy = f"evaluate the agent {agent} again, trace-dag evaluate --agent"
    return rows_from_parquet(read_listed(storage, subject, table, remedy=remedy))


def remove_agent(storage: Storage, agent: str) -> int:
    """Delete the evaluations of one agent, given as in the tables or as ``module:Class``; how many there were.

    Raises :class:`UserError` where there are none of it.
    """
    subject = f"{FOLDER}/{label(agent)}"
    known = sorted(name.removeprefix(f"{FOLDER}/") for name in subjects(storage, FOLDER))
    if label(agent) not in known:
        raise UserError(
            f"--remove {agent}: no evaluations of it are stored; there are those of {', '.join(known) or 'none'}"
        )
    try:
        rows = len(stored_rows(storage, subject))
    except DamagedFile:
        rows = 0  # they go all the same
    for name in (f"{subject}.parquet", f"{subject}.json", ledger_name(subject)):
        storage.delete(name)
    return rows


def all_rows(storage: Storage, *, complain: Complaint = raised) -> list[Row]:
    """Every stored evaluation, of all agents; ``complain`` hears of the agents whose table is damaged."""
    found: list[Row] = []
    tables = [name for name in storage.list(FOLDER) if name.endswith(".parquet")]
    for subject in sorted({*subjects(storage, FOLDER), *(table.removesuffix(".parquet") for table in tables)}):
        try:
            found += stored_rows(storage, subject)
        except DamagedFile as damaged:
            complain(damaged)
    return found


def try_agents(agents: Sequence[str], limits: AgentLimits, isolation: Isolation | None = None) -> None:
    """Make each agent once, in a process of its own.

    Raises :class:`UserError` for the first that cannot be made: no such module or class, a class without the methods
    of an agent, one that raises, hangs, or ends its process.
    """
    for agent in agents:
        process = AgentProcess(resolve(agent), limits, isolation)
        try:
            process.make()
        except AgentFault as fault:
            raise UserError(f"--agent {agent}: {fault}") from fault
        finally:
            process.close()
