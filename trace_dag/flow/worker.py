"""The work itself: some stages for some crashes, wherever an executor calls it.

Each crash is isolated: whatever one raises becomes its outcome, and the next is worked on. The order of writing is
what makes an interruption harmless: once a new result is at hand an older record is marked as started, then the
artefacts are written, then the record that lists them. An attempt that fails before has touched nothing, and the older
result stands, marked as outdated.
"""

from __future__ import annotations

import gc
import logging
import time
from collections.abc import Iterable, Iterator, Sequence
from contextlib import contextmanager
from dataclasses import replace
from functools import partial
from importlib import import_module

from tenacity import RetryCallState, Retrying, retry_if_exception, stop_after_attempt, wait_exponential

from trace_dag.errors import Failure, Rejection, TransientFailure
from trace_dag.flow.contract import CrashFiles, DamagedArtefactError, Flow, StageDefinition
from trace_dag.flow.locks import held
from trace_dag.flow.products import StageProduct
from trace_dag.flow.records import after_failure, intact, read_records, write_record
from trace_dag.flow.staleness import made_from, why_to_run
from trace_dag.flow.tasks import (
    Action,
    Attempt,
    Chunk,
    CrashTask,
    StageEvent,
    Work,
    failed_record,
    made_record,
)
from trace_dag.flow.time_limit import SLOWEST_BYTES_PER_S, within
from trace_dag.garbage import no_garbage_collection
from trace_dag.logs import at_work
from trace_dag.provenance import (
    Outcome,
    OutcomeRecord,
    Provenance,
    artefact_name,
    libraries_of,
    now,
)
from trace_dag.references import referred
from trace_dag.stage import Stage
from trace_dag.version import __version__

log = logging.getLogger(__name__)

_IMPORTED_WHERE_USED = ("mujoco", "pyarrow.parquet", "pyproj")  # by stages, and by nearly every crash


def _may_pass(error: BaseException) -> bool:
    """Whether trying again may help: not if the code that raised the error has tried several times already."""
    return isinstance(error, TransientFailure) and not error.tried_again


def _say_trying_again(key: str, stage: Stage, state: RetryCallState) -> None:
    error = state.outcome.exception() if state.outcome else None
    log.warning("%s %s: %s; trying again", key, stage, error)


@no_garbage_collection()
def get_ready(flow: Flow, modules: Sequence[str] = ()) -> None:
    """What a worker does once before its first chunk, ahead of time: imports, those of ``modules`` among them.

    What is there then stays: the garbage collector, which runs after each crash, need not look through it every time.
    """
    for definition in flow.stages:
        for reference in (definition.function, *(each.reader for each in flow.inputs(definition).values())):
            if reference:
                referred(reference)
    for name in (*_IMPORTED_WHERE_USED, *modules, *([flow.picture.partition(":")[0]] if flow.picture else [])):
        import_module(name)
    gc.collect()
    gc.freeze()


def installed() -> dict[str, str]:
    """Versions of this package, of its stages and of the libraries that decide, in this process."""
    from trace_dag.flow.stages import VERSIONS

    stages = {f"{stage} (stage)": str(version) for stage, version in VERSIONS.items()}
    return {"trace-dag": __version__, **stages, **libraries_of(None)}


def work_on_chunk(chunk: Chunk) -> list[StageEvent]:
    """Run the chunk's stages; one event for each crash and stage it got to, in order."""
    work = chunk.work
    for name, version in installed().items():
        if version != work.installed[name]:
            raise Failure(f"this worker has {name} {version}, the run has {work.installed[name]}; update the workers")
    if chunk.again:
        stored = read_records(work.storage, [crash.key for crash in chunk.crashes])
        chunk = replace(chunk, crashes=tuple(replace(crash, records=stored[crash.key]) for crash in chunk.crashes))
    definitions = [work.flow.definition(stage) for stage in chunk.stages]
    if definitions[0].for_several:
        with _holding(work, chunk.crashes) as crashes:
            return _work_on_group(replace(chunk, crashes=crashes), definitions[0])
    return [event for crash in chunk.crashes for event in _work_on_crash(work, crash, chunk)]


@no_garbage_collection()  # until the crash is let go: then hardly anything is left to look through
def _work_on_crash(work: Work, crash: CrashTask, chunk: Chunk) -> list[StageEvent]:
    with _holding(work, [crash]) as (held_crash,):
        return _CrashWorker(work, held_crash).run(chunk.stages, chunk.last)


@contextmanager
def _holding(work: Work, crashes: Sequence[CrashTask]) -> Iterator[tuple[CrashTask, ...]]:
    """Lock some crashes against other runs; if another run held one, its newer records are read again."""
    keys = [crash.key for crash in crashes]
    with held(work.storage, keys) as waited:
        if waited:
            stored = read_records(work.storage, keys)
            crashes = [replace(crash, records=stored[crash.key]) for crash in crashes]
        yield tuple(crashes)


class _CrashWorker:
    """Works on one crash, stage by stage."""

    def __init__(self, work: Work, task: CrashTask) -> None:
        self.work = work
        self.task = task
        self.records = dict(task.records)
        self.files = CrashFiles.recorded(
            task.key, task.source, work.settings, work.storage, self.records, run_id=work.run_id
        )
        self.damaged: DamagedArtefactError | None = None

    def run(self, stages: Sequence[Stage], last: bool) -> list[StageEvent]:
        """The stages in order, up to the first that does not accept the crash."""
        events = self._in_order(stages, self.work.force)
        damaged = self.damaged
        if damaged is not None and damaged.stage in stages:
            log.warning("%s: %s; made again", self.task.key, damaged)
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
        """Run a stage unless its record is current; the stages before it were accepted."""
        provenance = self.provenance(definition)
        earlier = self.records.get(definition.stage)
        if not force and self.holds(earlier, provenance):
            return StageEvent(self.task.key, definition.stage, Action.UNCHANGED, earlier)
        record = self.compute(definition, provenance)
        return StageEvent(self.task.key, definition.stage, Action.COMPUTED, record)

    def holds(self, earlier: OutcomeRecord | None, provenance: Provenance) -> bool:
        """Whether an outcome, which another run may have stored meanwhile, is what this one would make."""
        whole = {} if earlier is None else intact(self.work.storage, [earlier])
        return not why_to_run(earlier, provenance, whole)

    def provenance(self, definition: StageDefinition) -> Provenance:
        return made_from(self.work.recipes[definition.stage], self.task.source, self.records)

    def compute(self, definition: StageDefinition, provenance: Provenance) -> OutcomeRecord:
        execution = self.work.settings.execution
        started_at, started = now(), time.monotonic()
        trying = Retrying(
            retry=retry_if_exception(_may_pass),
            stop=stop_after_attempt(execution.transient_retries + 1),
            wait=wait_exponential(multiplier=execution.retry_wait_s),
            before_sleep=partial(_say_trying_again, self.task.key, definition.stage),
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
        what = f"{definition.stage} of {self.task.key}"
        with at_work(self.task.key, definition.stage):
            return within(limit_s, what, lambda: self.work.flow.make(definition, self.files))

    def conclude(
        self,
        definition: StageDefinition,
        provenance: Provenance,
        product: StageProduct | Exception,
        started_at: str,
        duration_s: float,
        attempts: int = 1,
    ) -> OutcomeRecord:
        """Store what a stage made, then its outcome record, which is returned.

        A stage that fails leaves nothing but its record, or the earlier result, where that outlasts the failure.
        """
        contents: dict[str, bytes] = {}
        parsed: dict[str, object] = {}
        earlier = standing = self.records.get(definition.stage)
        replaced = {file.name for file in earlier.artefacts} if earlier else set()
        try:
            if isinstance(product, Rejection):
                product = StageProduct({}, rejection=product)
            if isinstance(product, DamagedArtefactError):
                self.invalidate(product)
            if isinstance(product, Exception):
                raise product
            standing = self._begun(earlier)
            stored = []
            for extension, data in product.files.items():
                name = artefact_name(definition.stage, self.task.key, extension)
                contents[name] = data
                stored.append(self.work.storage.write(name, data))
            attempt = self._attempt(definition, provenance, started_at, duration_s)
            record = made_record(attempt, product, stored)
            record = replace(record, attempts=attempts).superseding(earlier)
            write_record(self.work.storage, record)
            parsed = {artefact_name(definition.stage, self.task.key, e): v for e, v in product.parsed.items()}
            standing = record
        except Exception as error:
            attempt = self._attempt(definition, provenance, started_at, duration_s)
            record = replace(failed_record(attempt, error), attempts=attempts)
            standing = self._after_failure(standing, record)
            record = standing if standing.outcome is Outcome.FAILED else record
            replaced |= set(contents)
            contents = {}
        self._delete(replaced - {file.name for file in standing.artefacts})
        self.records[definition.stage] = standing
        self.files.accept(standing, contents, parsed)
        return record

    def _begun(self, earlier: OutcomeRecord | None) -> OutcomeRecord | None:
        """The record to store while artefacts are replaced: marked as started if there are old artefacts."""
        if earlier is None or not earlier.artefacts:
            return earlier
        begun = replace(earlier.begun_again(), run_id=self.work.run_id)
        write_record(self.work.storage, begun)
        return begun

    def _after_failure(self, standing: OutcomeRecord | None, failed: OutcomeRecord) -> OutcomeRecord:
        try:
            stands = after_failure(self.work.storage, standing, failed)
            write_record(self.work.storage, stands)
        except Failure as second:
            # The disk is full or the store is gone: the run still knows and says so.
            log.error("%s %s: the failure could not be recorded: %s", failed.key, failed.stage, second)
            return failed if standing is None or standing.outcome is Outcome.FAILED else standing
        if stands.failed_attempt is not None:
            log.warning("%s %s: the earlier result stands, outdated", failed.key, failed.stage)
        return stands

    def _delete(self, names: Iterable[str]) -> None:
        for name in names:
            try:
                self.work.storage.delete(name)
            except Failure as error:
                log.warning("%s; trace-dag verify --repair deletes it", error)

    def invalidate(self, damaged: DamagedArtefactError) -> None:
        """Let the stage that made a damaged artefact run again, now or next time."""
        self.damaged = damaged
        record = self.records[damaged.stage]
        write_record(self.work.storage, replace(record, fingerprint="").superseding(record))

    def drawn(self, events: list[StageEvent]) -> list[StageEvent]:
        """The events, after redrawing the crash's picture if something that can be seen has changed."""
        draws = self.work.flow.picture
        if draws is None or not any(
            event.action is Action.COMPUTED and event.stage.position >= Stage.ROAD_MAP.position for event in events
        ):
            return events
        last = events[-1]
        if self.records.get(last.stage) is not last.record:
            return events  # it failed and an earlier result stands, with its picture
        if not self.work.settings.execution.pictures:
            self._delete(file.name for record in self.task.records.values() for file in record.pictures)
            return events
        try:
            stored = [
                self.work.storage.write(picture_name(self.task.key, extension), picture)
                for extension, picture in referred(draws)(self.files).items()
            ]
            if stored and last.record is not None:
                record = replace(last.record, pictures=tuple(stored))
                write_record(self.work.storage, record)
                before = {file.name for each in self.task.records.values() for file in each.pictures}
                self._delete(before - {file.name for file in stored})  # other kinds, of an earlier version
                self.files.amend(record)
                last = replace(last, record=record)
        except Exception as error:
            # A missing picture does not fail the crash: the run names those without one. The picture drawn before shows
            # an earlier state of the crash, so it is deleted.
            log.exception("%s: no picture", self.task.key)
            self._delete(picture_name(self.task.key, extension) for extension in PICTURE_EXTENSIONS)
            if last.record is not None and last.record.pictures:
                record = replace(last.record, pictures=())
                write_record(self.work.storage, record)
                last = replace(last, record=record)
            last = replace(last, no_picture=f"{type(error).__name__}: {error}")
        return [*events[:-1], last]

    def ended(self, events: list[StageEvent]) -> list[StageEvent]:
        """The events, after what is made of a crash that the run has changed and is done with."""
        afterwards, last = self.work.afterwards, events[-1]
        if afterwards is None or last.failed or not any(event.action is Action.COMPUTED for event in events):
            return events
        try:
            return [*events[:-1], replace(last, made=afterwards(self.files))]
        except Exception:
            # It can be made later, and whoever makes it then says what went wrong.
            log.exception("%s: not made at once", self.task.key)
            return events

    def _attempt(
        self, definition: StageDefinition, provenance: Provenance, started_at: str, duration_s: float
    ) -> Attempt:
        return Attempt(self.task.key, definition.stage, provenance, self.work.run_id, started_at, duration_s)


def _work_on_group(chunk: Chunk, definition: StageDefinition) -> list[StageEvent]:
    """A batch stage for a group: one call for all crashes whose record is not current."""
    events, open_workers = [], []
    for crash in chunk.crashes:
        worker = _CrashWorker(chunk.work, crash)
        provenance, earlier = worker.provenance(definition), worker.records.get(definition.stage)
        forced = definition.stage in chunk.work.force
        if not forced and worker.holds(earlier, provenance):
            events.append(StageEvent(crash.key, definition.stage, Action.UNCHANGED, earlier))
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
        keys = [worker.task.key for worker, _ in crashes]
        what = f"{definition.stage} of {keys[0]}" + (f" and {len(keys) - 1} others" if keys[1:] else "")
        files = [worker.files for worker, _ in crashes]
        limit_s = work.settings.execution.stage_time_limit_s
        if "maps" in definition.sources:
            maps = {file for worker, _ in crashes for file in worker.task.source.maps}
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
        key = crash[0].task.key
        product = products.get(key, Failure(f"{definition.stage}: no answer for {key} from the batch"))
        yield crash, product, started_at, duration_s


PICTURE_EXTENSIONS = ("png", "svg")


def picture_name(key: str, extension: str = "png") -> str:
    """Where a crash's picture lies below the storage root; ``svg`` is the sketch."""
    return f"pictures/{key}.{extension}"
