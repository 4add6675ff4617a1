"""Agents evaluated on stored crashes, in parallel, each evaluation with a time limit; and where the results lie.

``ROOT/evaluations/<agent>.parquet`` holds every evaluation of an agent, one row per case and vehicle (an evaluation
made again replaces its row), ``<agent>.json`` beside it how the latest were made. Belongs here: which crashes, the
workers, storage. Does not belong here: driving and measuring (:mod:`trace_dag.evaluation`).
"""

from __future__ import annotations

import json
from collections.abc import Callable, Collection, Mapping, Sequence
from dataclasses import dataclass, field
from enum import StrEnum
from typing import Literal

from trace_dag.code_versions import code_version
from trace_dag.errors import DamagedFile, Failure, Stage, UserError
from trace_dag.evaluation.agents import Agent, AgentFault
from trace_dag.evaluation.cases import Case
from trace_dag.evaluation.evaluate import Conditions, Evaluation, evaluate, run
from trace_dag.evaluation.metrics import Outcome
from trace_dag.evaluation.registry import label, make_agent, resolve
from trace_dag.evaluation.table import Row, row, rows_from_parquet, rows_to_parquet
from trace_dag.pipeline.artefacts import ESTIMATE, LOGS, RECORD, ROAD_MAP, VERDICT, XODR
from trace_dag.pipeline.batch import Pipeline
from trace_dag.pipeline.deadlines import DeadlinePool, StepLost, Task
from trace_dag.pipeline.executors import available_cores
from trace_dag.pipeline.flow import CrashFiles
from trace_dag.pipeline.ledgers import Complaint, ledger_name, raised, read_listed, subjects, write_ledger
from trace_dag.pipeline.records import Records, log_complaint, read_records
from trace_dag.pipeline.registry import CrashSource
from trace_dag.pipeline.selection import registered
from trace_dag.pipeline.standing import FinalState, standing, valid_records
from trace_dag.provenance import now
from trace_dag.settings import Settings
from trace_dag.sim.backends import backend
from trace_dag.sim.types import Simulation
from trace_dag.storage import Storage

FOLDER = "evaluations"
_CODE = ("trace_dag.evaluation.evaluate", "trace_dag.evaluation.baselines", "trace_dag.sim.embedded")


class Role(StrEnum):
    """Whose place an agent takes, of the two that collided first."""

    FIRST = "first"  # by their numbers in the report
    SECOND = "second"
    STRIKING = "striking"  # the one that closes in faster at the contact
    STRUCK = "struck"


@dataclass(frozen=True)
class Limits:
    """What one evaluation may take: wall-clock time, and memory beyond what the worker needs itself."""

    time_s: float = 20.0
    memory_mb: int = 2048


@dataclass(frozen=True)
class StoredCase:
    """Where a case comes from: a verified crash, and a variation of it if ``variation`` names one."""

    key: str
    source: CrashSource
    records: Records
    variation: str | None = None

    @property
    def case_id(self) -> str:
        """The crash's key or the variation's."""
        return self.variation or self.key

    @property
    def fingerprint(self) -> str:
        """Of the verdict it rests on."""
        return self.records[Stage.VERDICT].fingerprint

    def files(self, settings: Settings, storage: Storage) -> CrashFiles:
        """The artefacts of the crash."""
        files = CrashFiles(self.key, self.source, settings, storage)
        for record in self.records.values():
            files.accept(record)
        return files


@dataclass(frozen=True)
class Step:
    """One evaluation: an agent, as ``module:Class``, in somebody's place."""

    name: str
    reference: str
    role: Role


@dataclass
class LoadedCase:
    """What the evaluations of one case share in a worker."""

    case: Case
    simulation: Simulation


@dataclass
class EvaluationWork:
    """What the workers do; agents are made once per worker."""

    storage: Storage
    settings: Settings
    cases: Mapping[str, StoredCase]
    conditions: Conditions
    _agents: dict[str, Agent] = field(default_factory=dict)

    def prepare(self, name: str) -> LoadedCase:
        """The case, and its map made ready. Raises :class:`Failure`."""
        try:
            case = load_case(self.cases[name], self.settings, self.storage)
            return LoadedCase(case, backend(self.settings.sim).load(case.network, case.xodr, friction=case.friction))
        except Failure:
            raise
        except Exception as error:
            raise Failure(f"{name} cannot be loaded for evaluation: {type(error).__name__}: {error}") from error

    def do(self, shared: LoadedCase, step: Step) -> Evaluation:
        """One evaluation; whatever the agent does wrong is its result."""
        case = shared.case
        ego = number_of(case, step.role)
        try:
            if step.reference not in self._agents:
                self._agents[step.reference] = make_agent(step.reference)
            found = evaluate(case, ego, self._agents[step.reference], self.conditions, shared.simulation)
        except AgentFault as fault:
            return Evaluation(case.case_id, case.key, ego, Outcome.FAULTY, fault=str(fault))
        if found.outcome is Outcome.FAULTY:
            del self._agents[step.reference]  # in no state to go on with
        return found


def load_case(stored: StoredCase, settings: Settings, storage: Storage) -> Case:
    """A case as it is evaluated."""
    from trace_dag.sim.run import participants, surface_friction

    files = stored.files(settings, storage)
    network, xodr = files.load(ROAD_MAP), files.load(XODR)
    if stored.variation is not None:
        from trace_dag.pipeline.variations import read_variation

        varied = read_variation(storage, stored.variation)
        hypothesis, log, friction = varied.hypothesis, varied.log, varied.about.friction
    else:
        verdict = files.load(VERDICT)
        hypothesis = files.load(ESTIMATE).hypotheses[verdict.hypothesis]
        log = files.load(LOGS)[verdict.hypothesis]
        friction = surface_friction(settings.sim, files.load(RECORD))
    return Case(
        case_id=stored.case_id,
        key=stored.key,
        network=network,
        xodr=xodr,
        friction=friction,
        participants=participants(hypothesis),
        impact_time_s=hypothesis.impact_time_s,
        recorded=log,
    )


def number_of(case: Case, role: Role) -> int:
    """The number of the vehicle in a role of the recorded crash; of a near miss the first is the striking one."""
    first, second = case.pair
    if role is Role.FIRST:
        return first
    if role is Role.SECOND:
        return second
    contact = case.contact
    striking, struck = first, second
    if contact is not None:
        nx, ny = contact.normal_x, contact.normal_y  # from body 1 to body 2
        toward_2 = contact.velocity_1_mps[0] * nx + contact.velocity_1_mps[1] * ny
        toward_1 = -contact.velocity_2_mps[0] * nx - contact.velocity_2_mps[1] * ny
        striking, struck = contact.number_1, contact.number_2
        if toward_1 > toward_2:
            striking, struck = struck, striking
    return striking if role is Role.STRIKING else struck


def verified_cases(
    pipeline: Pipeline, cohort: str | None, only: Collection[str], *, complain: Complaint = log_complaint
) -> list[StoredCase]:
    """The verified ones of the crashes asked for; :class:`UserError` if there are none.

    ``complain`` hears of records that are damaged, so that nobody knows whether their crash is verified.
    """
    keys = registered(pipeline, cohort, only)
    sources, records = pipeline.registry.sources(keys), read_records(pipeline.storage, keys, complain=complain)
    cases = [
        StoredCase(key, sources[key], valid_records(records[key]))
        for key in keys
        if standing(key, records[key]).final_state is FinalState.VERIFIED
    ]
    if not cases:
        raise UserError(
            f"none of the {len(keys)} crashes asked for is verified; trace-dag status tells where they stand"
        )
    return cases


def evaluate_agents(
    pipeline: Pipeline,
    cases: Sequence[StoredCase],
    agents: Sequence[str],
    roles: Sequence[Role],
    conditions: Conditions,
    limits: Limits,
    *,
    tell: Callable[[Row], None] = lambda _: None,
    complain: Complaint = raised,
) -> list[Row]:
    """Every agent in every role of every case, as rows in a fixed order, stored under the root.

    ``tell`` hears of each evaluation as it is done, ``complain`` of every step of a crash that cannot be loaded. Raises
    :class:`UserError` for agents that are not there.
    """
    references = {name: resolve(name) for name in agents}
    by_id = {case.case_id: case for case in cases}
    work = EvaluationWork(pipeline.storage, pipeline.settings, by_id, conditions)
    steps = tuple(Step(name, reference, role) for name, reference in references.items() for role in roles)
    one_server = pipeline.settings.sim.backend == "carla"
    workers = 1 if one_server else pipeline.settings.execution.workers or available_cores()
    pool: DeadlinePool[LoadedCase, Step, Evaluation] = DeadlinePool(
        work, workers=workers, step_limit_s=limits.time_s, memory_mb=limits.memory_mb
    )
    code = code_version(_CODE).digest
    results = _Results(pipeline.storage, {name: label(name) + conditions.suffix for name in agents}, complain)
    try:
        for answer in pool.run([Task(case_id, steps) for case_id in by_id]):
            stored = by_id[answer.task]
            found = answer.result
            if isinstance(found, Failure):
                complain(found)
                continue
            if isinstance(found, StepLost):
                ego = number_of(load_case(stored, pipeline.settings, pipeline.storage), answer.step.role)
                found = Evaluation(stored.case_id, stored.key, ego, Outcome.FAULTY, fault=found.detail)
            made = row(
                results.labels[answer.step.name],
                found,
                conditions,
                code_version=code,
                verdict_fingerprint=stored.fingerprint,
            )
            results.add(answer.step.name, made)
            tell(made)
    finally:
        results.store(references)
    return results.in_order()


class _Results:
    """Rows as they come; stored at the end, however it comes, so that an interrupted batch keeps what was done."""

    def __init__(self, storage: Storage, labels: Mapping[str, str], complain: Complaint) -> None:
        self.labels = labels
        self._complain = complain
        self._storage = storage
        self._rows: dict[str, list[Row]] = {name: [] for name in labels}

    def add(self, name: str, made: Row) -> None:
        self._rows[name].append(made)

    def in_order(self) -> list[Row]:
        return [each for rows in self._rows.values() for each in sorted(rows, key=_identity)]

    def store(self, references: Mapping[str, str]) -> None:
        """Merge what came with what is stored: a row for the same case and vehicle replaces the one before."""
        for name, rows in self._rows.items():
            if not rows:
                continue
            subject = f"{FOLDER}/{self.labels[name]}"
            try:
                merged = {_identity(each): each for each in stored_rows(self._storage, subject)}
            except DamagedFile as damaged:
                self._complain(damaged.mended_by("what it held of other crashes is lost; evaluate them again"))
                merged = {}
            merged |= {_identity(each): each for each in rows}
            table = self._storage.write(f"{subject}.parquet", rows_to_parquet(merged[each] for each in sorted(merged)))
            first = rows[0]
            about = {
                "agent": self.labels[name],
                "reference": references[name],
                "evaluated_at": now(),
                "evaluations": len(rows),
                **{key: first[key] for key in ("rate_hz", "range_m", "noise_m", "occlusion", "seed", "code_version")},
            }
            made = self._storage.write(f"{subject}.json", json.dumps(about, indent=1).encode())
            write_ledger(self._storage, subject, [table, made])


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


def replay_with(
    pipeline: Pipeline, key: str, agent: str, role: Role, replay_format: Literal["html", "gif", "webp", "mp4"]
) -> bytes:
    """The replay of a verified crash with an agent in somebody's place, under the usual conditions.

    Raises :class:`UserError` for a crash that is not verified and an agent that is not there or is faulty.
    """
    from trace_dag.scenario.animation import write_animation
    from trace_dag.scenario.replay import write_html_player

    (stored,) = verified_cases(pipeline, None, [key])
    case = load_case(stored, pipeline.settings, pipeline.storage)
    simulation = backend(pipeline.settings.sim).load(case.network, case.xodr, friction=case.friction)
    try:
        log = run(case, number_of(case, role), make_agent(resolve(agent)), Conditions(), simulation)
    except AgentFault as fault:
        raise UserError(f"--agent {agent} is faulty in {key}: {fault}") from fault
    record = stored.files(pipeline.settings, pipeline.storage).load(RECORD)
    if replay_format == "html":
        return write_html_player(record, case.network, log)
    return write_animation(record, case.network, log, image_format=replay_format)
