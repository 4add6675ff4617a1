"""Agents evaluated on stored crashes, in parallel, each evaluation with a time limit; and where the results lie.

``ROOT/evaluations/<agent>.parquet`` holds every evaluation of an agent, one row per case and vehicle (an evaluation
made again replaces its row), ``<agent>.json`` beside it how the latest were made. Belongs here: which crashes, the
workers, storage. Does not belong here: driving and measuring (:mod:`trace_dag.agents.evaluation`).
"""

from __future__ import annotations

import json
from collections.abc import Callable, Sequence

from trace_dag.agents.evaluation.agent_main import AgentLimits
from trace_dag.agents.evaluation.agent_process import AgentProcess
from trace_dag.agents.evaluation.agents import AgentFault
from trace_dag.agents.evaluation.evaluate import Conditions, faulty
from trace_dag.agents.evaluation.isolation import Isolation
from trace_dag.agents.evaluation.registry import label, resolve
from trace_dag.agents.evaluation.splits import Split
from trace_dag.agents.evaluation.table import Row, row, rows_from_parquet, rows_to_parquet
from trace_dag.agents.evaluation_work import EvaluationWork, Step, agent_code, answers, evaluation_code_version
from trace_dag.agents.stored_cases import AgentRole, StoredCase, load_case, number_of
from trace_dag.common.errors import DamagedFile, Failure, UserError
from trace_dag.common.provenance import now
from trace_dag.common.storage.files import Storage
from trace_dag.flow.manifests import list_files, read_listed, sound_manifest
from trace_dag.flow.pool import Lost, Task
from trace_dag.flow.records import OnProblem, raise_problem
from trace_dag.flow.workspace import Workspace

FOLDER = "evaluations"
_TABLE = ".parquet"

_ABOUT = ("rate_hz", "range_m", "noise_m", "occlusion", "traffic", "seed", "agent_code", "code_version")


def evaluate_agents(
    workspace: Workspace,
    cases: Sequence[StoredCase],
    agents: Sequence[str],
    roles: Sequence[AgentRole],
    conditions: Conditions,
    limits: AgentLimits,
    *,
    split: Split | None = None,
    isolation: Isolation | None = None,
    on_progress: Callable[[Row], None] = lambda _: None,
    on_problem: OnProblem = raise_problem,
) -> list[Row]:
    """Evaluate every agent in every role of every case; return the stored rows in a fixed order.

    ``split`` is the part that the cases form, or None. ``on_progress`` is called with each finished evaluation,
    ``on_problem`` for every step of a crash that cannot be loaded. Raises :class:`UserError` for unknown agents.
    """
    references = {name: resolve(name) for name in agents}
    by_id = {case.case_id: case for case in cases}
    work = EvaluationWork(workspace.settings.sim, by_id, conditions, limits, isolation)
    steps = tuple(Step(name, reference, role) for name, reference in references.items() for role in roles)
    code = evaluation_code_version(workspace.settings.sim)
    digests = {name: agent_code(reference) for name, reference in references.items()}
    labels = {name: label(name) + conditions.suffix for name in agents}
    rows: dict[str, dict[tuple[str, int], Row]] = {name: {} for name in agents}
    try:
        for answer in answers(workspace, work, [Task(case_id, steps) for case_id in by_id]):
            stored = by_id[answer.task]
            driven = answer.result
            if isinstance(driven, Failure):
                on_problem(driven)
                continue
            if isinstance(driven, Lost):
                case = load_case(stored)
                driven = faulty(case, number_of(case, answer.step.role), driven.detail)
            made = row(
                labels[answer.step.name],
                driven,
                conditions,
                weight=stored.weight,
                split=split,
                agent_code=digests[answer.step.name],
                code_version=code,
                verdict_fingerprint=stored.fingerprint,
            )
            rows[answer.step.name].setdefault(_identity(made), made)  # two roles can mean the same vehicle
            on_progress(made)
    finally:  # also of a batch that is interrupted
        for name, found in rows.items():
            if found:
                store_rows(workspace.storage, labels[name], references[name], list(found.values()), on_problem)
    return [of_agent[which] for of_agent in rows.values() for which in sorted(of_agent)]


def store_rows(
    storage: Storage, agent: str, reference: str, rows: Sequence[Row], on_problem: OnProblem = raise_problem
) -> None:
    """Store evaluations of one agent, a label; a row replaces the earlier one of the same case and vehicle.

    ``reference`` is the ``module:Class`` of the agent; ``on_problem`` is called if its stored table is damaged.
    """
    subject = f"{FOLDER}/{agent}"
    try:
        merged = {_identity(each): each for each in stored_rows(storage, subject)}
    except DamagedFile as damaged:
        on_problem(damaged.mended_by("what it held of other crashes is lost; evaluate them again"))
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
    list_files(storage, FOLDER, [table, made])


def _identity(row_of_table: Row) -> tuple[str, int]:
    return row_of_table["case_id"], row_of_table["vehicle_number"]


def stored_rows(storage: Storage, subject: str) -> list[Row]:
    """Return the stored rows of one agent; empty if it was not evaluated.

    Raises :class:`DamagedFile`.
    """
    agent = subject.removeprefix(f"{FOLDER}/")
    if agent not in agents_of(storage):
        return []
    remedy = f"evaluate the agent {agent} again, trace-dag evaluate --agent"
    return rows_from_parquet(read_listed(storage, f"{subject}.parquet", remedy=remedy))


def agents_of(storage: Storage) -> list[str]:
    """Return the agents with stored evaluations, damaged ones included, in order."""
    listed = {*sound_manifest(storage, FOLDER).files, *storage.list(FOLDER)}
    tables = [name for name in listed if name.endswith(_TABLE)]
    return sorted(name.removeprefix(f"{FOLDER}/").removesuffix(_TABLE) for name in tables)


def remove_agent(storage: Storage, agent: str) -> int:
    """Delete the evaluations of one agent and return their number.

    The agent is given as in the tables or as ``module:Class``. Raises :class:`UserError` if it has no evaluations.
    """
    subject = f"{FOLDER}/{label(agent)}"
    known = agents_of(storage)
    if label(agent) not in known:
        raise UserError(
            f"--remove {agent}: no evaluations of it are stored; there are those of {', '.join(known) or 'none'}"
        )
    try:
        rows = len(stored_rows(storage, subject))
    except DamagedFile:
        rows = 0  # they go all the same
    names = (f"{subject}.parquet", f"{subject}.json")
    for name in names:
        storage.delete(name)
    list_files(storage, FOLDER, [], gone=names)
    return rows


def all_rows(storage: Storage, *, on_problem: OnProblem = raise_problem) -> list[Row]:
    """Return the stored evaluations of all agents.

    ``on_problem`` is called with the error of each damaged table.
    """
    found: list[Row] = []
    for agent in agents_of(storage):
        try:
            found += stored_rows(storage, f"{FOLDER}/{agent}")
        except DamagedFile as damaged:
            on_problem(damaged)
    return found


def try_agents(agents: Sequence[str], limits: AgentLimits, isolation: Isolation | None = None) -> None:
    """Make each agent once, in a process of its own.

    Raises :class:`UserError` for the first that cannot be made: an unknown module or class, a class without an agent's
    methods, or an agent that raises, hangs, or ends its process.
    """
    for agent in agents:
        process = AgentProcess(resolve(agent), limits, isolation)
        try:
            process.make()
        except AgentFault as fault:
            raise UserError(f"--agent {agent}: {fault}") from fault
        finally:
            process.close()
