"""The work of a worker: some stages for some crashes.

Each crash is isolated: any exception becomes its outcome, and the next crash follows. The order of its writes is in
:mod:`trace_dag.flow.crash_store`.
"""

from __future__ import annotations

import logging
import time
from collections.abc import Iterable, Sequence
from dataclasses import replace
from functools import partial
from typing import TYPE_CHECKING

from trace_dag.common.errors import Failure, Rejection, TransientFailure
from trace_dag.common.gc_pause import gc_paused, import_frozen
from trace_dag.common.messages.logs import log_context
from trace_dag.common.plugins import resolve_reference
from trace_dag.common.provenance import Outcome, OutcomeRecord, Provenance, libraries_of, now
from trace_dag.common.stage import Stage
from trace_dag.flow.contract import DamagedArtefactError, Flow, StageDefinition, StageProduct
from trace_dag.flow.crash_store import CrashStore, open_crashes
from trace_dag.flow.records import intact, read_records
from trace_dag.flow.staleness import current_inputs, why_to_run
from trace_dag.flow.tasks import Action, Chunk, CrashTask, StageEvent, Work
from trace_dag.flow.time_limit import SLOWEST_BYTES_PER_S, within
from trace_dag.version import __version__

if TYPE_CHECKING:
    from tenacity import RetryCallState

log = logging.getLogger(__name__)

_IMPORTED_WHERE_USED = ("mujoco", "pyarrow.parquet", "pyproj", "tenacity")  # by stages, and by nearly every crash


def _may_pass(error: BaseException) -> bool:
    """Return whether a retry may help, which it does not after an error that was already retried."""
    return isinstance(error, TransientFailure) and not error.tried_again


def _say_trying_again(key: str, stage: Stage, state: RetryCallState) -> None:
    error = state.outcome.exception() if state.outcome else None
    log.warning("%s %s: %s; trying again", key, stage, error)


@gc_paused()
def get_ready(flow: Flow, modules: Sequence[str] = ()) -> None:
    """Import a worker's modules, also ``modules``, before its first chunk."""
    for definition in flow.stages:
        for reference in (definition.function, *(each.reader for each in flow.inputs(definition).values())):
            if reference:
                resolve_reference(reference)
    import_frozen((*_IMPORTED_WHERE_USED, *modules, *([flow.picture.partition(":")[0]] if flow.picture else [])))


def installed_versions() -> dict[str, str]:
    """Return this process's versions of this package, of its stages and of the libraries that affect results."""
    from trace_dag.flow.stages import VERSIONS

    stages = {f"{stage} (stage)": str(version) for stage, version in VERSIONS.items()}
    return {"trace-dag": __version__, **stages, **libraries_of(None)}


def work_on_chunk(chunk: Chunk) -> list[StageEvent]:
    """Run the chunk's stages; return one event for each crash and stage reached, in order."""
    work = chunk.work
    for name, version in installed_versions().items():
        if version != work.installed[name]:
            raise Failure(f"this worker has {name} {version}, the run has {work.installed[name]}; update the workers")
    if chunk.again:
        stored = read_records(work.storage, [crash.key for crash in chunk.crashes])
        chunk = replace(chunk, crashes=tuple(replace(crash, records=stored[crash.key]) for crash in chunk.crashes))
    definitions = [work.flow.definition(stage) for stage in chunk.stages]
    if definitions[0].for_several:
        with open_crashes(work, chunk.crashes) as stores:
            return _work_on_group(chunk, stores, definitions[0])
    return [event for crash in chunk.crashes for event in _work_on_crash(work, crash, chunk)]


@gc_paused()  # until the crash is let go: then hardly anything is left to look through
def _work_on_crash(work: Work, crash: CrashTask, chunk: Chunk) -> list[StageEvent]:
    with open_crashes(work, [crash]) as (store,):
        return _CrashWorker(work, store).run(chunk.stages, chunk.last)


class _CrashWorker:
    """Works on one crash, stage by stage."""

    def __init__(self, work: Work, store: CrashStore) -> None:
        self.work = work
        self.store = store
        self.damaged: DamagedArtefactError | None = None

    def run(self, stages: Sequence[Stage], last: bool) -> list[StageEvent]:
        """Run the stages in order, up to the first that does not accept the crash; return their events."""
        events = self._in_order(stages, self.work.force)
        damaged = self.damaged
        if damaged is not None and damaged.stage in stages:
            log.warning("%s: %s; made again", self.store.key, damaged)
            kept = [event for event in events if event.stage.position < damaged.stage.position]
            again = [stage for stage in stages if stage.position >= damaged.stage.position]
            events = kept + self._in_order(again, self.work.force | {damaged.stage})
        return self.ended(self.drawn(events)) if last else events

    def _in_order(self, stages: Sequence[Stage], force: frozenset[Stage]) -> list[StageEvent]:
        events: list[StageEvent] = []
        for stage in stages:
            event = self.one_stage(self.work.flow.definition(stage), stage in force)
            events.append(event)
            if event.record is None or event.record.outcome is not Outcome.ACCEPTED:
                break
        return events

    def one_stage(self, definition: StageDefinition, force: bool) -> StageEvent:
        """Run a stage unless its record is current; the earlier stages must have accepted the crash."""
        provenance = self.provenance(definition)
        earlier = self.store.records.get(definition.stage)
        if not force and self.holds(earlier, provenance):
            return StageEvent(self.store.key, definition.stage, Action.UNCHANGED, earlier)
        record = self.compute(definition, provenance)
        return StageEvent(self.store.key, definition.stage, Action.COMPUTED, record)

    def holds(self, earlier: OutcomeRecord | None, provenance: Provenance) -> bool:
        """Return whether an outcome, perhaps stored by another run meanwhile, equals what this run would make."""
        whole = {} if earlier is None else intact(self.work.storage, [earlier])
        return not why_to_run(earlier, provenance, whole)

    def provenance(self, definition: StageDefinition) -> Provenance:
        return current_inputs(self.work.recipes[definition.stage], self.store.source, self.store.records)

    def compute(self, definition: StageDefinition, provenance: Provenance) -> OutcomeRecord:
        from tenacity import Retrying, retry_if_exception, stop_after_attempt, wait_exponential

        execution = self.work.settings.execution
        started_at, started = now(), time.monotonic()
        trying = Retrying(
            retry=retry_if_exception(_may_pass),
            stop=stop_after_attempt(execution.transient_retries + 1),
            wait=wait_exponential(multiplier=execution.retry_wait_s),
            before_sleep=partial(_say_trying_again, self.store.key, definition.stage),
            reraise=True,
        )
        try:
            product: StageProduct | Exception = trying(self._make, definition)
        except Exception as error:
            product = error
        attempts = trying.statistics["attempt_number"]
        return self.conclude(definition, provenance, product, started_at, time.monotonic() - started, attempts)

    def _make(self, definition: StageDefinition) -> StageProduct:
        limit_s = self.work.settings.execution.stage_time_limit_s
        what = f"{definition.stage} of {self.store.key}"
        with log_context(self.store.key, definition.stage):
            return within(limit_s, what, lambda: self.work.flow.make(definition, self.store.files))

    def conclude(
        self,
        definition: StageDefinition,
        provenance: Provenance,
        product: StageProduct | Exception,
        started_at: str,
        duration_s: float,
        attempts: int = 1,
    ) -> OutcomeRecord:
        """Store a stage's product and its record, which is returned; remember a damaged input."""
        if isinstance(product, DamagedArtefactError):
            self.damaged = product
            try:
                self.store.doubt(product)
            except Failure as error:
                product = error
        key, stage = self.store.key, definition.stage
        return self.store.put(self.work.attempt(key, stage, provenance, started_at, duration_s, attempts), product)

    def drawn(self, events: list[StageEvent]) -> list[StageEvent]:
        """Redraw the crash's picture if something visible has changed, and return the events."""
        draws = self.work.flow.picture
        if draws is None or not any(
            event.action is Action.COMPUTED and event.stage.position >= Stage.ROAD_MAP.position for event in events
        ):
            return events
        last = events[-1]
        if last.record is None or self.store.records.get(last.stage) is not last.record:
            return events  # it failed and an earlier result stands, with its picture
        if not self.work.settings.execution.pictures:
            self.store.delete_pictures()
            return events
        try:
            last = replace(
                last, record=self.store.put_pictures(last.record, resolve_reference(draws)(self.store.files))
            )
        except Exception as error:
            # A missing picture does not fail the crash: the run names those without one. The picture drawn before shows
            # an earlier state of the crash, so it is deleted.
            log.exception("%s: no picture", self.store.key)
            record = self.store.delete_pictures(last.record)
            last = replace(last, record=record, no_picture=f"{type(error).__name__}: {error}")
        return [*events[:-1], last]

    def ended(self, events: list[StageEvent]) -> list[StageEvent]:
        """Make the files of a crash that the run changed and finished, and return the events."""
        afterwards, last = self.work.afterwards, events[-1]
        if afterwards is None or last.failed or not any(event.action is Action.COMPUTED for event in events):
            return events
        try:
            return [*events[:-1], replace(last, made=afterwards(self.store.files))]
        except Exception:
            # It can be made later, and whoever makes it then says what went wrong.
            log.exception("%s: its page or package could not be made now", self.store.key)
            return events


def _work_on_group(chunk: Chunk, stores: Sequence[CrashStore], definition: StageDefinition) -> list[StageEvent]:
    """Return the events of a batch stage for a group: one call for all crashes without a current record."""
    events, open_workers = [], []
    for store in stores:
        worker = _CrashWorker(chunk.work, store)
        provenance, earlier = worker.provenance(definition), store.records.get(definition.stage)
        forced = definition.stage in chunk.work.force
        if not forced and worker.holds(earlier, provenance):
            events.append(StageEvent(store.key, definition.stage, Action.UNCHANGED, earlier))
        else:
            open_workers.append((worker, provenance))
    made = _call_for_several(chunk.work, definition, open_workers)
    for (worker, provenance), product, started_at, duration_s in made:
        record = worker.conclude(definition, provenance, product, started_at, duration_s)
        event = StageEvent(record.key, record.stage, Action.COMPUTED, record)
        events.extend(worker.drawn([event]) if chunk.last else [event])
    return events


_OpenCrash = tuple[_CrashWorker, Provenance]


def _call_for_several(
    work: Work, definition: StageDefinition, crashes: Sequence[_OpenCrash]
) -> Iterable[tuple[_OpenCrash, StageProduct | Rejection | Exception, str, float]]:
    if not crashes:
        return
    started_at, started = now(), time.monotonic()
    try:
        keys = [worker.store.key for worker, _ in crashes]
        what = f"{definition.stage} of {keys[0]}" + (f" and {len(keys) - 1} others" if keys[1:] else "")
        files = [worker.store.files for worker, _ in crashes]
        limit_s = work.settings.execution.stage_time_limit_s
        if "maps" in definition.sources:
            maps = {file for worker, _ in crashes for file in worker.store.source.maps}
            limit_s += sum(file.size for file in maps) / SLOWEST_BYTES_PER_S
        products = within(limit_s, what, lambda: work.flow.make_for_several(definition, files))
    except Exception as error:
        if len(crashes) > 1:  # find the one it broke on; a call may read a large map file, so with few of them
            half = len(crashes) // 2
            yield from _call_for_several(work, definition, crashes[:half])
            yield from _call_for_several(work, definition, crashes[half:])
            return
        yield crashes[0], error, started_at, time.monotonic() - started
        return
    duration_s = (time.monotonic() - started) / len(crashes)
    for crash in crashes:
        key = crash[0].store.key
        product = products.get(key, Failure(f"{definition.stage}: no answer for {key} from the batch"))
        yield crash, product, started_at, duration_s
