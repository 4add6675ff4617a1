"""Whether what is stored agrees with what was recorded, and mending what does not.

Belongs here: a disagreement with its remedy, and those between outcome records, artefacts and registered crashes. The
warehouse's are in :mod:`trace_dag.warehouse.verify`, Dagster's in :mod:`trace_dag.assets.verify`.

Sizes are compared over listings, so that a large cohort on an object store costs no request per crash; the contents
are read only where that is asked for.
"""

from __future__ import annotations

import hashlib
import shutil
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from enum import Enum
from pathlib import Path

from trace_dag.errors import Stage
from trace_dag.pipeline.home import BUILDING
from trace_dag.pipeline.progress import Progress
from trace_dag.pipeline.records import Records, read_records, write_record
from trace_dag.pipeline.registry import Registry
from trace_dag.processes import abandoned
from trace_dag.provenance import Outcome, record_name
from trace_dag.storage import Entry, Storage

_READ_AT_ONCE = 200
_RECORD_ENDING = ".outcome.json"
_RUN = "trace-dag run makes it again"


class Kind(Enum):
    """A way in which two of storage, Dagster and the warehouse disagree: its name, and what mends it."""

    UNREADABLE_RECORD = "unreadable record", f"--repair deletes it, {_RUN}"
    MISSING_ARTEFACT = "missing artefact", f"--repair marks the stage to be run again, {_RUN}"
    DAMAGED_ARTEFACT = "damaged artefact", f"--repair marks the stage to be run again, {_RUN}"
    UNLISTED_FILE = "file of no record", "--repair deletes it"
    LEFTOVER = "leftover of a killed process", "--repair deletes it"
    MISSING_REPORT = "missing report", "ingest it again"
    NO_PARTITION = "no partition", "--repair adds it"
    STRAY_PARTITION = "partition of no registered crash", "--repair takes it away"
    NOT_LOGGED = "result Dagster does not hold", "--repair tells Dagster"
    FAILURE_NOT_LOGGED = "failure Dagster does not hold", "trace-dag rerun --failed"
    NO_RESULT = "Dagster holds a result that is not there", "trace-dag run"
    WAREHOUSE = "not as in the warehouse", "--repair builds the warehouse"

    def __init__(self, title: str, remedy: str) -> None:
        self.title = title
        self.remedy = remedy


@dataclass(frozen=True)
class Disagreement:
    """One thing that does not agree; ``file`` is a name below the root, or a path outside it."""

    kind: Kind
    detail: str
    key: str | None = None
    stage: Stage | None = None
    file: str | None = None


@dataclass(frozen=True)
class StorageReport:
    """What storage holds: the registered crashes' records, and what of it does not agree.

    ``interrupted`` counts stages that were being run again when their process ended; ``unregistered`` the crashes
    that something was made of and that are registered no more. Neither is a disagreement.
    """

    records: dict[str, Records]
    disagreements: tuple[Disagreement, ...]
    files: int
    interrupted: int
    unregistered: int


def verify_storage(
    storage: Storage, local_folder: Path, *, contents: bool = False, progress: Progress | None = None
) -> StorageReport:
    """Compare the records of all crashes with the files beside them.

    With ``contents`` every artefact is read and compared with its SHA-256; ``progress`` hears how many of how many.
    """
    cohorts = Registry(storage).cohorts().values()
    registered = {key for cohort in cohorts for key in cohort.reports}
    listings = {stage: storage.list(stage.value) for stage in Stage}
    found = {_key_of(name) for listing in listings.values() for name in listing}
    everything = read_records(storage, sorted(registered | found))
    disagreements: list[Disagreement] = []
    for stage, listing in listings.items():
        disagreements += _stage_disagreements(stage, listing, everything)
    if contents:
        disagreements += _damaged(storage, everything, disagreements, progress)
    reports = storage.list("reports")
    for cohort in cohorts:
        for key, report in cohort.reports.items():
            if report.kind == "stored" and report.location not in reports:
                detail = f"{report.location} is not there"
                disagreements.append(Disagreement(Kind.MISSING_REPORT, detail, key, Stage.RAW_REPORT, report.location))
    left = [*storage.leftovers(), *_unfinished_builds(local_folder)]
    disagreements += [Disagreement(Kind.LEFTOVER, str(path), file=str(path)) for path in left]
    return StorageReport(
        {key: everything[key] for key in sorted(registered)},
        tuple(disagreements),
        sum(map(len, listings.values())),
        sum(record.outcome is Outcome.STARTED for records in everything.values() for record in records.values()),
        len(found - registered),
    )


def repair_storage(storage: Storage, report: StorageReport) -> int:
    """Mend what can be; how many stages are now to be run again. A stage whose artefact is damaged counts as begun."""
    again: set[str] = set()
    for each in report.disagreements:
        if each.kind in (Kind.MISSING_ARTEFACT, Kind.DAMAGED_ARTEFACT) and each.key and each.stage:
            name = record_name(each.stage, each.key)
            if name not in again:
                record = read_records(storage, [each.key], [each.stage])[each.key].get(each.stage)
                if record is not None:
                    write_record(storage, record.begun_again())
                    for file in record.artefacts:
                        storage.delete(file.name)
                    again.add(name)
        elif each.kind is Kind.UNREADABLE_RECORD and each.file:
            storage.delete(each.file)
            again.add(each.file)
        elif each.kind is Kind.UNLISTED_FILE and each.file:
            storage.delete(each.file)
        elif each.kind is Kind.LEFTOVER and each.file:
            _remove(Path(each.file))
    return len(again)


def _stage_disagreements(
    stage: Stage, listing: Mapping[str, Entry], records: Mapping[str, Records]
) -> Iterator[Disagreement]:
    listed: set[str] = set()
    for key, of_crash in records.items():
        record = of_crash.get(stage)
        if record is None:
            continue
        for file in record.artefacts:
            listed.add(file.name)
            entry = listing.get(file.name)
            if entry is None:
                yield Disagreement(Kind.MISSING_ARTEFACT, f"{file.name} is not there", key, stage, file.name)
            elif entry.size != file.size:
                detail = f"{file.name} has {entry.size} bytes, recorded are {file.size}"
                yield Disagreement(Kind.DAMAGED_ARTEFACT, detail, key, stage, file.name)
    for name in listing:
        key = _key_of(name)
        if name.endswith(_RECORD_ENDING):
            if stage not in records[key]:
                detail = f"{name} is not an outcome record"
                yield Disagreement(Kind.UNREADABLE_RECORD, detail, key, stage, name)
        elif name not in listed:
            yield Disagreement(Kind.UNLISTED_FILE, f"{name} is in no record", key, stage, name)


def _damaged(
    storage: Storage, records: Mapping[str, Records], known: Sequence[Disagreement], progress: Progress | None
) -> Iterator[Disagreement]:
    """Artefacts of the right size whose content is not what was recorded."""
    skipped = {each.file for each in known}
    files = [
        (key, stage, file)
        for key, of_crash in records.items()
        for stage, record in of_crash.items()
        for file in record.artefacts
        if file.name not in skipped
    ]
    for start in range(0, len(files), _READ_AT_ONCE):
        some = files[start : start + _READ_AT_ONCE]
        contents = storage.read_many(file.name for _, _, file in some)
        for key, stage, file in some:
            data = contents.get(file.name)
            if data is None or hashlib.sha256(data).hexdigest() != file.sha256:
                detail = f"{file.name} has its recorded size and another content"
                yield Disagreement(Kind.DAMAGED_ARTEFACT, detail, key, stage, file.name)
        if progress is not None:
            progress(start + len(some), len(files))


def _unfinished_builds(local_folder: Path) -> list[Path]:
    return [path for path in local_folder.glob(f"{BUILDING}*") if abandoned(path, BUILDING)]


def _remove(path: Path) -> None:
    if path.is_dir():
        shutil.rmtree(path, ignore_errors=True)
    else:
        path.unlink(missing_ok=True)


def _key_of(name: str) -> str:
    return name.rpartition("/")[2].partition(".")[0]
