"""One crash in storage while a run works on it: its lock, its records, its artefacts and its picture.

Belongs here: all writes for a single crash, and their order. Does not belong here: which stages run
(:mod:`trace_dag.flow.worker`), and reading many crashes at once (:mod:`trace_dag.flow.records`).

The order makes an interruption harmless: with a new result at hand, an older record is marked as started, then the
artefacts are written, then the record that lists them. An attempt that fails earlier changes nothing, and the older
result is kept, marked as outdated.

Two runs may work on the same crash. Each file would still be whole, but files of one run could lie beside the record of
the other. So a worker locks the crash while it works on it, and the other waits. A lock ends with its process. An
object store has no locks: there the last record counts, and a file that differs from it is detected when it is read,
and made again.
"""

from __future__ import annotations

import hashlib
import logging
from collections.abc import Iterable, Iterator, Mapping, Sequence, Set
from contextlib import ExitStack, contextmanager
from dataclasses import replace

from trace_dag.common.errors import Failure, Rejection
from trace_dag.common.processes import lock_file
from trace_dag.common.provenance import Outcome, OutcomeRecord, artefact_name
from trace_dag.common.storage.files import Storage
from trace_dag.flow.contract import CrashFiles, DamagedArtefactError, StageProduct
from trace_dag.flow.records import intact, read_records, write_record
from trace_dag.flow.tasks import CrashTask, Work, build_failed_record, build_record

log = logging.getLogger(__name__)

LOCKS_FOLDER = "locks"
_LOCKS = 256  # files, shared by the crashes: few enough to keep, many enough that two crashes seldom meet


def picture_name(key: str, extension: str = "png") -> str:
    """Return the path of a crash's picture below the storage root; ``svg`` is the sketch."""
    return f"pictures/{key}.{extension}"


@contextmanager
def open_crashes(work: Work, crashes: Sequence[CrashTask]) -> Iterator[list[CrashStore]]:
    """Open some crashes, locked against other runs.

    After waiting for another run, their records are read again.
    """
    keys = [crash.key for crash in crashes]
    with _locked(work.storage, keys) as waited:
        if waited:
            stored = read_records(work.storage, keys)
            crashes = [replace(crash, records=stored[crash.key]) for crash in crashes]
        yield [CrashStore(work, crash) for crash in crashes]


class CrashStore:
    """The records and artefacts of one crash: the state at the making of its task, then the changes of the run."""

    def __init__(self, work: Work, crash: CrashTask) -> None:
        self.key = crash.key
        self.source = crash.source
        self.records = dict(crash.records)
        self.files = CrashFiles.recorded(
            crash.key, crash.source, work.settings, work.storage, self.records, run_id=work.run_id
        )
        self._storage = work.storage
        self._run_id = work.run_id
        self._pictures = {file.name for record in self.records.values() for file in record.pictures}

    def put(self, attempt: OutcomeRecord, product: StageProduct | Exception) -> OutcomeRecord:
        """Store a stage's product, then the record of the attempt, which is returned.

        A failed stage leaves only its record, or keeps the earlier result if that is still usable.
        """
        earlier = self.records.get(attempt.stage)
        old = {file.name for file in earlier.artefacts} if earlier else set()
        if isinstance(product, Rejection):
            product = StageProduct({}, rejection=product)
        if isinstance(product, Exception):
            return self._failed(attempt, product, old)
        names = {extension: artefact_name(attempt.stage, self.key, extension) for extension in product.files}
        contents = {names[extension]: data for extension, data in product.files.items()}
        try:
            self._begin(earlier)
            stored = [self._storage.write(name, data) for name, data in contents.items()]
            record = build_record(attempt, product, stored).superseding(earlier)
            write_record(self._storage, record)
        except Exception as error:
            return self._failed(attempt, error, old | contents.keys())
        self._stand(record, old, contents, {names[extension]: value for extension, value in product.parsed.items()})
        return record

    def doubt(self, damaged: DamagedArtefactError) -> None:
        """Mark the stage of a damaged artefact, so that it runs again, now or next time."""
        record = self.records[damaged.stage]
        write_record(self._storage, replace(record, fingerprint="").superseding(record))

    def put_pictures(self, record: OutcomeRecord, pictures: Mapping[str, bytes]) -> OutcomeRecord:
        """Store the crash's pictures, by extension, and the record that lists them, which is returned."""
        if not pictures:
            return record
        named = {picture_name(self.key, extension): picture for extension, picture in pictures.items()}
        before, self._pictures = self._pictures, self._pictures | named.keys()
        stored = [self._storage.write(name, picture) for name, picture in named.items()]
        record = replace(record, pictures=tuple(stored))
        write_record(self._storage, record)
        self._delete(before - named.keys())  # other kinds, of an earlier version
        self.files.amend(record)
        return record

    def delete_pictures(self, record: OutcomeRecord | None = None) -> OutcomeRecord | None:
        """Delete the crash's outdated pictures; return ``record`` without them."""
        self._delete(self._pictures)
        if record is None or not record.pictures:
            return record
        record = replace(record, pictures=())
        write_record(self._storage, record)
        return record

    def _begin(self, earlier: OutcomeRecord | None) -> None:
        """Mark a record as started before its artefacts are replaced, if it has any."""
        if earlier is not None and earlier.artefacts:
            begun = replace(earlier.begun_again(), run_id=self._run_id)
            write_record(self._storage, begun)
            self.records[begun.stage] = begun

    def _failed(self, attempt: OutcomeRecord, error: Exception, files: Set[str]) -> OutcomeRecord:
        """Record a failure, and delete ``files`` of the stage that do not belong to the remaining result."""
        failed, standing = build_failed_record(attempt, error), self.records.get(attempt.stage)
        try:
            stands = _after_failure(self._storage, standing, failed)
            write_record(self._storage, stands)
        except Failure as second:
            # The disk is full or the store is gone: the run still knows and says so.
            log.error("%s %s: the failure could not be recorded: %s", failed.key, failed.stage, second)
            stands = failed if standing is None or standing.outcome is Outcome.FAILED else standing
        if stands.failed_attempt is not None:
            log.warning("%s %s: the earlier result is kept, though it is outdated", failed.key, failed.stage)
        self._stand(stands, files)
        return stands if stands.outcome is Outcome.FAILED else failed

    def _stand(
        self,
        record: OutcomeRecord,
        files: Set[str],
        contents: Mapping[str, bytes] | None = None,
        parsed: Mapping[str, object] | None = None,
    ) -> None:
        self._delete(files - {file.name for file in record.artefacts})
        self.records[record.stage] = record
        self.files.accept(record, contents, parsed)

    def _delete(self, names: Iterable[str]) -> None:
        for name in names:
            try:
                self._storage.delete(name)
            except Failure as error:
                log.warning("%s; trace-dag verify --repair deletes it", error)


def _after_failure(storage: Storage, earlier: OutcomeRecord | None, failed: OutcomeRecord) -> OutcomeRecord:
    """Return the record that counts after a failed attempt: the failure, or the outdated earlier result.

    An earlier result is kept while its files are whole and its inputs are the same. After a change of its inputs it
    would contradict them.
    """
    if (
        earlier is not None
        and earlier.outcome in (Outcome.ACCEPTED, Outcome.REJECTED)
        and earlier.fingerprint
        and earlier.provenance.inputs == failed.provenance.inputs
        and intact(storage, [earlier])[earlier.name]
    ):
        return earlier.outlasting(failed)
    return failed.superseding(earlier)


@contextmanager
def _locked(storage: Storage, keys: Iterable[str]) -> Iterator[bool]:
    """Lock some crashes; yield whether another worker held one, which makes records read before outdated."""
    if storage.local_root is None:
        yield False
        return
    folder = storage.local_root / LOCKS_FOLDER
    folder.mkdir(exist_ok=True)
    waited = False
    with ExitStack() as stack:
        # In one order for all, so that no two wait for each other.
        for number in sorted({hashlib.sha256(key.encode()).digest()[0] % _LOCKS for key in keys}):
            waited |= stack.enter_context(lock_file(folder / f"{number:02x}"))
        yield waited
