"""A batch: some stages for many crashes, through an executor, one event per crash and stage.

Belongs here: finding the remaining work for each crash, cutting it into chunks, and joining the results. It is the same
for every executor, and only this module calls one. Does not belong here: the work on a crash
(:mod:`trace_dag.flow.worker`) and its report to Dagster.
"""

from __future__ import annotations

import logging
import math
from collections.abc import Callable, Collection, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace

from trace_dag.common.errors import Failure
from trace_dag.common.plugins import resolve_reference
from trace_dag.common.provenance import Outcome, now
from trace_dag.common.stage import Stage
from trace_dag.flow.cohorts.registry import CrashSource
from trace_dag.flow.cohorts.services import Services
from trace_dag.flow.contract import CrashFiles, StageDefinition
from trace_dag.flow.crash_store import CrashStore
from trace_dag.flow.executors import Executor, run_redoing_lost
from trace_dag.flow.pool import Lost
from trace_dag.flow.records import Records, intact, read_records, write_index
from trace_dag.flow.staleness import FAILED, MISSING, current_inputs, why_to_run
from trace_dag.flow.tasks import Action, Chunk, CrashTask, MadeFiles, StageEvent, Work, log_outcome
from trace_dag.flow.worker import installed_versions, work_on_chunk
from trace_dag.flow.workspace import Workspace

log = logging.getLogger(__name__)

_CHUNKS_PER_WORKER = 4  # at least, so that the last chunk of a batch keeps nobody waiting long


def work_of(
    workspace: Workspace,
    run_id: str,
    force: Collection[Stage] = (),
    afterwards: Callable[[CrashFiles], MadeFiles | None] | None = None,
) -> Work:
    """Return the shared facts for the workers of a run."""
    flow, settings = workspace.flow, workspace.settings
    if not workspace.pages_in_runs:
        settings = settings.model_copy(update={"execution": settings.execution.model_copy(update={"pictures": False})})
    return Work(workspace.storage, settings, flow, run_id, installed_versions(), frozenset(force), afterwards)


def first_stale(workspace: Workspace, keys: Sequence[str], stages: Sequence[Stage] = tuple(Stage)) -> dict[str, Stage]:
    """Return, for each outdated crash, the first of the given stages that would have to run."""
    records = read_records(workspace.storage, keys, stages)
    crashes = _Crashes(work_of(workspace, ""), records, workspace.registry.sources(keys))
    first = {key: crashes.first_to_run(crash, stages) for key, crash in crashes.by_key.items()}
    return {key: stage for key, stage in first.items() if stage is not None}


@dataclass(frozen=True)
class StaleResult:
    """A stored result that a run would make again, and what has changed since, such as "code" or "setting radius_m"."""

    key: str
    stage: Stage
    changed: tuple[str, ...]


def stale_results(workspace: Workspace, records: Mapping[str, Records]) -> list[StaleResult]:
    """Return the first outdated result of each crash without a failure.

    Later results depend on it.

    ``records`` are stored ones. Results that were never made, or that a run failed to make again, are not listed.
    """
    records = {key: of_crash for key, of_crash in records.items() if of_crash}
    recipes, sources = work_of(workspace, "").recipes, workspace.registry.sources(records)
    whole = intact(workspace.storage, [record for each in records.values() for record in each.values()])
    found = []
    for key, of_crash in records.items():
        for stage, recipe in recipes.items():
            record = of_crash.get(stage)
            why = why_to_run(record, current_inputs(recipe, sources[key], of_crash), whole)
            if why and why not in ((MISSING,), (FAILED,)):
                found.append(StaleResult(key, stage, why))
            if why or record is None or record.outcome is not Outcome.ACCEPTED:
                break
    return found


def check_requirements(workspace: Workspace, stages: Collection[Stage], run_id: str = "") -> None:
    """Raise :class:`trace_dag.common.errors.UserError` if this machine lacks a requirement of some stages.

    A paid request to a language model counts towards the run's budget. The workers of a cluster have their own
    installation, which is not checked.
    """
    if workspace.settings.execution.executor == "dask":
        return
    services = Services(workspace.storage, workspace.settings.services, run_id)
    for definition in workspace.flow.stages:
        if definition.stage in stages and definition.requires is not None:
            resolve_reference(definition.requires)(workspace.settings, services)


def run_stages(
    workspace: Workspace,
    keys: Sequence[str],
    stages: Collection[Stage] = tuple(Stage),
    *,
    run_id: str,
    force: Collection[Stage] = (),
    afterwards: Callable[[CrashFiles], MadeFiles | None] | None = None,
) -> Iterator[StageEvent]:
    """Run the selected stages for some crashes; yield one event for each crash and stage when it is done.

    A current result is not made again unless its stage is in ``force``. A crash that fails does not stop the others.
    Events of one crash come in the order of the stages. Workers call ``afterwards``, which must be picklable, with each
    finished crash that they changed; the crash's last event has the result.

    Raises the errors of :func:`check_requirements` before anything is changed.
    """
    with workspace.executing() as executor:
        work = _shared_out(work_of(workspace, run_id, force, afterwards), executor.machines)
        batch = _Batch(workspace, work, executor, stages, keys, workspace.registry.sources(keys))
        check_requirements(workspace, batch.to_run(), run_id)
        yield from batch.run()


class _Crashes:
    """Some stored crashes, and the remaining work for each."""

    def __init__(self, work: Work, records: Mapping[str, Records], sources: Mapping[str, CrashSource]) -> None:
        self.work = work
        self.by_key = {key: CrashTask(key, sources[key], of_crash) for key, of_crash in records.items()}
        self._whole = intact(work.storage, [record for each in records.values() for record in each.values()])

    def has_work(self, crash: CrashTask, definition: StageDefinition) -> bool:
        """Return whether a stage has to run for a crash that reaches it."""
        now = current_inputs(self.work.recipes[definition.stage], crash.source, crash.records)
        record = crash.records.get(definition.stage)
        return definition.stage in self.work.force or bool(why_to_run(record, now, self._whole))

    def first_to_run(self, crash: CrashTask, stages: Collection[Stage]) -> Stage | None:
        """Return the first of some stages that has to run.

        None if all are current, or if an earlier one ends the crash.
        """
        for definition in self.work.flow.stages:
            if definition.stage in stages and self.has_work(crash, definition):
                return definition.stage
            record = crash.records.get(definition.stage)
            if record is None or record.outcome is not Outcome.ACCEPTED:
                return None
        return None


class _Batch:
    def __init__(
        self,
        workspace: Workspace,
        work: Work,
        executor: Executor,
        stages: Collection[Stage],
        keys: Sequence[str],
        sources: Mapping[str, CrashSource],
    ) -> None:
        self.workspace = workspace
        self.work = work
        self.executor = executor
        self.stages = tuple(each.stage for each in work.flow.stages if each.stage in stages)
        self._stored = _Crashes(work, read_records(work.storage, keys), sources)
        self.crashes = self._stored.by_key
        self._ended: set[str] = set()  # keys of crashes that do not go on to the next stage

    def to_run(self) -> set[Stage]:
        """Return the stages that some crash may need: from the first one that is not current."""
        before = self.stages  # those that no crash seen so far has to go through
        for crash in self.crashes.values():
            first = self._stored.first_to_run(crash, before)
            if first is not None:
                before = before[: before.index(first)]
        return set(self.stages[len(before) :])

    def run(self) -> Iterator[StageEvent]:
        for stage in self.stages:
            self.work.storage.remove_leftovers(stage)
        crashes = self.crashes
        segments = self.work.flow.segments(self.stages)
        for segment in segments:
            waiting = []
            for crash in crashes.values():
                if crash.key in self._ended:
                    continue
                known = self._without_work(crash, segment)
                if known is None:
                    waiting.append(crash)
                else:
                    yield from known
            chunks = self._chunks(waiting, segment, last=segment is segments[-1])
            yield from self._worked_on(chunks, segment)
        recorded = [record for crash in crashes.values() for record in crash.records.values()]
        run_id = self.work.run_id
        write_index(self.work.storage, run_id, [record for record in recorded if record.run_id == run_id])

    def _worked_on(self, chunks: Sequence[Chunk], segment: Sequence[StageDefinition]) -> Iterator[StageEvent]:
        for chunk, events in run_redoing_lost(self.executor, work_on_chunk, chunks, Chunk.split):
            if isinstance(events, Lost):
                events = [event for each in chunk.crashes for event in self._lost(each, segment, events)]
            for event in events:
                crash = self.crashes[event.key]
                if event.record is not None:
                    crash.records[event.stage] = event.record
                    if event.action is Action.COMPUTED:
                        log_outcome(event.record)
                yield from self._with_later(crash, event)

    def _without_work(self, crash: CrashTask, segment: Sequence[StageDefinition]) -> list[StageEvent] | None:
        """Return the events of a segment whose stages are all current or out of reach.

        None if there is work to do.
        """
        events: list[StageEvent] = []
        for definition in segment:
            ended = self._ended_before(crash, definition.stage)
            if ended is not None:
                return events + self._with_later(crash, ended)
            if self._stored.has_work(crash, definition):
                return None
            record = crash.records.get(definition.stage)
            event = StageEvent(crash.key, definition.stage, Action.UNCHANGED, record)
            if record is not None and record.outcome is Outcome.REJECTED:
                return events + self._with_later(crash, event)
            events.append(event)
        return events

    def _ended_before(self, crash: CrashTask, stage: Stage) -> StageEvent | None:
        """Return the event that tells why a crash cannot reach a stage, if an earlier run ended it.

        This concerns earlier stages that are not selected. None if the stage can be reached.
        """
        for definition in self.work.flow.stages:
            if definition.stage is stage:
                return None
            record = crash.records.get(definition.stage)
            if record is not None and record.outcome is Outcome.ACCEPTED:
                continue
            rejected = record is not None and record.outcome is Outcome.REJECTED
            return StageEvent(crash.key, stage, Action.NOT_REACHED if rejected else Action.BLOCKED, record)
        return None

    def _with_later(self, crash: CrashTask, event: StageEvent) -> list[StageEvent]:
        """Return an event, with those of all later selected stages if it ends the crash."""
        record = event.record
        if record is not None and record.outcome is Outcome.ACCEPTED and event.action is not Action.BLOCKED:
            return [event]
        self._ended.add(crash.key)
        action = Action.NOT_REACHED if record is not None and record.outcome is Outcome.REJECTED else Action.BLOCKED
        later = self.stages[self.stages.index(event.stage) + 1 :]
        return [event, *(StageEvent(crash.key, stage, action, record) for stage in later)]

    def _chunks(self, crashes: Sequence[CrashTask], segment: Sequence[StageDefinition], last: bool) -> list[Chunk]:
        if not crashes:
            return []
        workers = self.executor.workers
        tasks = {each.key: replace(each, records=dict(each.records)) for each in crashes}  # as they are now
        groups = self._groups(crashes, segment[0])
        if not groups:
            most = self.work.settings.execution.chunk_size
            size = max(1, min(most, math.ceil(len(crashes) / (workers * _CHUNKS_PER_WORKER))))
            keys = list(tasks)
            groups = [keys[start : start + size] for start in range(0, len(keys), size)]
        stages = tuple(definition.stage for definition in segment)
        return [Chunk(self.work, tuple(tasks[key] for key in group), stages, last) for group in groups]

    def _groups(self, crashes: Sequence[CrashTask], definition: StageDefinition) -> list[list[str]]:
        """Return the groups of crashes for a batch stage; empty if it has no grouping, or if grouping fails."""
        if definition.grouping is None:
            return []
        try:
            return [
                list(group) for group in resolve_reference(definition.grouping)([self._files(each) for each in crashes])
            ]
        except Exception as error:
            # What is broken breaks again in the stage itself, and is then the failure of the crashes it concerns.
            told = not isinstance(error, Failure)
            log.warning(
                "%s: crashes cannot be grouped (%s) and are run one by one", definition.stage, error, exc_info=told
            )
            return []

    def _files(self, crash: CrashTask) -> CrashFiles:
        return CrashFiles.recorded(crash.key, crash.source, self.work.settings, self.work.storage, crash.records)

    def _lost(self, task: CrashTask, segment: Sequence[StageDefinition], lost: Lost) -> list[StageEvent]:
        """Return a crash whose worker died every time, with a failure of the first unfinished stage."""
        records = read_records(self.work.storage, [task.key])[task.key]
        events: list[StageEvent] = []
        for stuck in segment:
            record = records.get(stuck.stage)
            forced = stuck.stage in self.work.force and (record is None or record.run_id != self.work.run_id)
            provenance = current_inputs(self.work.recipes[stuck.stage], task.source, records)
            if forced or why_to_run(record, provenance, {}):
                break
            events.append(StageEvent(task.key, stuck.stage, Action.COMPUTED, record))
            if record is not None and record.outcome is Outcome.REJECTED:
                return events
        else:
            return events  # it died after the last record, drawing the picture
        error = Failure(
            f"the worker process died in this stage, twice, the second time with this crash alone ({lost.detail})"
        )
        attempt = self.work.attempt(task.key, stuck.stage, provenance, now(), 0.0)
        failed = CrashStore(self.work, replace(task, records=records)).put(attempt, error)
        return [*events, StageEvent(task.key, stuck.stage, Action.COMPUTED, failed)]


def _shared_out(work: Work, machines: int) -> Work:
    """Return the work with a share of the request rate of public services for each machine.

    All processes of a machine keep one rate together, but machines do not coordinate.
    """
    if machines == 1:
        return work
    services = work.settings.services
    part = services.model_copy(update={"requests_per_s": services.requests_per_s / machines})
    return replace(work, settings=work.settings.model_copy(update={"services": part}))
