"""Whether what is stored agrees with what was recorded, and mending what does not.

Belongs here: a disagreement with its remedy, and those between outcome records, artefacts, registered crashes and the
results of studies. Those of pages and packages are in :mod:`trace_dag.benchmark.verify`, the warehouse's in
:mod:`trace_dag.warehouse.verify`, Dagster's in :mod:`trace_dag.assets.verify`.

Sizes are compared over listings, so that a large cohort on an object store costs no request per crash; the contents
are read only where that is asked for. Records and ledgers are read always, and prove themselves by their seals.
"""

from __future__ import annotations

import shutil
from collections.abc import Collection, Iterator, Mapping, Sequence
from dataclasses import dataclass
from enum import Enum
from pathlib import Path

from trace_dag.cohorts.kept_maps import unused_map_copies
from trace_dag.cohorts.registry import Registry
from trace_dag.errors import DamagedFile
from trace_dag.flow.ledgers import (
    SUBJECT_FOLDERS,
    ledger_name,
    not_as_listed,
    read_ledger,
    sound_ledger,
    subjects,
)
from trace_dag.flow.records import Records, read_records, write_record
from trace_dag.flow.standing import valid_records
from trace_dag.flow.workspace import BUILDING
from trace_dag.processes import abandoned
from trace_dag.progress import Progress
from trace_dag.provenance import MADE_AGAIN, Outcome, crash_of, record_name
from trace_dag.stage import Stage
from trace_dag.storage import Entry, Storage, StoredFile, check_name

_RECORD_ENDING = ".outcome.json"


class DisagreementKind(Enum):
    """A way in which two of storage, Dagster and the warehouse disagree: its name, and what mends it."""

    DAMAGED_PAGE = "damaged page or package", "--repair makes it again"
    DAMAGED_RESULT = "damaged result", "--repair deletes it with all that was made together; make it again"
    UNREADABLE_RECORD = "unreadable record", f"--repair deletes it, {MADE_AGAIN}"
    MISSING_ARTEFACT = "missing artefact", f"--repair marks the stage to be run again, {MADE_AGAIN}"
    DAMAGED_ARTEFACT = "damaged artefact", f"--repair marks the stage to be run again, {MADE_AGAIN}"
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

    kind: DisagreementKind
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
    """Compare what records and ledgers list with the files that are there.

    With ``contents`` every file is read and compared with its SHA-256; ``progress`` hears how many of how many.
    """
    cohorts = Registry(storage).cohorts().values()
    registered = {key for cohort in cohorts for key in cohort.reports}
    everywhere = {stage: storage.list(stage.value) for stage in Stage}
    foreign = [name for listing in everywhere.values() for name in listing if not _can_be_ours(name)]
    listings = {
        stage: {name: entry for name, entry in listing.items() if name not in foreign}
        for stage, listing in everywhere.items()
    }
    found = {crash_of(name) for listing in listings.values() for name in listing}
    everything = read_records(storage, sorted(registered | found), complain=lambda _: None)
    disagreements: list[Disagreement] = []
    for stage, listing in listings.items():
        disagreements += _stage_disagreements(stage, listing, everything)
    drawn = _pictures(everything)
    begun = {key for key, each in everything.items() if any(r.outcome is Outcome.STARTED for r in each.values())}
    disagreements += _picture_disagreements(drawn, storage.list("pictures"), begun)
    if contents:
        disagreements += _damaged(storage, everything, drawn, disagreements, progress)
    disagreements += _result_disagreements(storage, contents)
    reports = storage.list("reports")
    for cohort in cohorts:
        for key, report in cohort.reports.items():
            if report.kind == "stored" and report.location not in reports:
                detail = f"{report.location} is not there"
                disagreements.append(
                    Disagreement(DisagreementKind.MISSING_REPORT, detail, key, Stage.RAW_REPORT, report.location)
                )
    left = [*storage.leftovers(), *_unfinished_builds(local_folder), *unused_map_copies(storage)]
    if storage.local_root is not None:
        left += [storage.local_root / name for name in foreign]
    disagreements += [Disagreement(DisagreementKind.LEFTOVER, str(path), file=str(path)) for path in left]
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
        if (
            each.kind in (DisagreementKind.MISSING_ARTEFACT, DisagreementKind.DAMAGED_ARTEFACT)
            and each.key
            and each.stage
        ):
            name = record_name(each.stage, each.key)
            if name not in again:
                record = read_records(storage, [each.key], [each.stage])[each.key].get(each.stage)
                if record is not None:
                    write_record(storage, record.begun_again())
                    for file in (*record.artefacts, *record.pictures):
                        storage.delete(file.name)
                    again.add(name)
        elif each.kind is DisagreementKind.UNREADABLE_RECORD and each.file:
            storage.delete(each.file)
            again.add(each.file)
        elif each.kind is DisagreementKind.UNLISTED_FILE and each.file:
            storage.delete(each.file)
        elif each.kind is DisagreementKind.DAMAGED_RESULT and each.file:
            _delete_made_together(storage, each.file)
        elif each.kind is DisagreementKind.LEFTOVER and each.file:
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
                yield Disagreement(
                    DisagreementKind.MISSING_ARTEFACT, f"{file.name} is not there", key, stage, file.name
                )
            elif entry.size != file.size:
                detail = f"{file.name} has {entry.size} bytes, recorded are {file.size}"
                yield Disagreement(DisagreementKind.DAMAGED_ARTEFACT, detail, key, stage, file.name)
    for name in listing:
        key = crash_of(name)
        if name.endswith(_RECORD_ENDING):
            if stage not in records[key]:
                detail = f"{name} is not an outcome record"
                yield Disagreement(DisagreementKind.UNREADABLE_RECORD, detail, key, stage, name)
        elif name not in listed:
            yield Disagreement(DisagreementKind.UNLISTED_FILE, f"{name} is in no record", key, stage, name)


_Drawn = dict[str, tuple[str, Stage, StoredFile]]  # pictures by name: of which crash, drawn after which stage


def _pictures(records: Mapping[str, Records]) -> _Drawn:
    """The pictures of all crashes as they stand."""
    found = {}
    for key, of_crash in records.items():
        for record in list(valid_records(of_crash).values())[-1:]:
            found.update({file.name: (key, record.stage, file) for file in record.pictures})
    return found


def _picture_disagreements(
    drawn: _Drawn, listing: Mapping[str, Entry], begun: Collection[str]
) -> Iterator[Disagreement]:
    """Pictures that differ from their record or have none; the next run draws those of crashes ``begun`` again."""
    for name, (key, stage, file) in drawn.items():
        entry = listing.get(name)
        if entry is None:
            yield Disagreement(DisagreementKind.MISSING_ARTEFACT, f"{name} is not there", key, stage, name)
        elif entry.size != file.size:
            detail = f"{name} has {entry.size} bytes, recorded are {file.size}"
            yield Disagreement(DisagreementKind.DAMAGED_ARTEFACT, detail, key, stage, name)
    for name in listing:
        if name not in drawn and crash_of(name) not in begun:
            yield Disagreement(DisagreementKind.UNLISTED_FILE, f"{name} is in no record", crash_of(name), None, name)


def _damaged(
    storage: Storage,
    records: Mapping[str, Records],
    drawn: _Drawn,
    known: Sequence[Disagreement],
    progress: Progress | None,
) -> Iterator[Disagreement]:
    """Artefacts and pictures of the right size whose content is not what was recorded."""
    skipped = {each.file for each in known}
    files = {
        file.name: (key, stage, file)
        for key, of_crash in records.items()
        for stage, record in of_crash.items()
        for file in record.artefacts
    }
    wanted = {name: each for name, each in (files | drawn).items() if name not in skipped}
    done = 0

    def told(some: int) -> None:
        nonlocal done
        done += some
        if progress is not None:
            progress(done, len(wanted))

    listed = [file for _, _, file in wanted.values()]
    for file, detail in not_as_listed(storage, listed, contents=True, told=told):
        key, stage, _ = wanted[file.name]
        yield Disagreement(DisagreementKind.DAMAGED_ARTEFACT, detail, key, stage, file.name)


def _result_disagreements(storage: Storage, contents: bool) -> Iterator[Disagreement]:
    """Damaged ledgers, files that differ from their ledger, and files that no ledger lists."""
    listed: set[str] = set()
    for subject in (each for folder in SUBJECT_FOLDERS for each in subjects(storage, folder)):
        try:
            ledger = read_ledger(storage, subject)
        except DamagedFile as damaged:
            yield Disagreement(DisagreementKind.DAMAGED_RESULT, str(damaged), file=damaged.name)
            continue
        listed |= ledger.files.keys()
        for file, detail in not_as_listed(storage, ledger.files.values(), contents=contents):
            yield Disagreement(DisagreementKind.DAMAGED_RESULT, detail, file=file.name)
    for folder in SUBJECT_FOLDERS:
        for name in storage.list(folder):
            if name not in listed:
                yield Disagreement(DisagreementKind.UNLISTED_FILE, f"{name} is in no ledger", file=name)


def _delete_made_together(storage: Storage, name: str) -> None:
    """Delete a damaged result, with what has to be made again together with it."""
    storage.delete(name)
    for folder in SUBJECT_FOLDERS:
        for subject in subjects(storage, folder):
            files = sound_ledger(storage, subject).files
            if name in files:
                for each in (*files, ledger_name(subject)):
                    storage.delete(each)


def _unfinished_builds(local_folder: Path) -> list[Path]:
    return [path for path in local_folder.glob(f"{BUILDING}*") if abandoned(path, BUILDING)]


def _remove(path: Path) -> None:
    if path.is_dir():
        shutil.rmtree(path, ignore_errors=True)
    else:
        path.unlink(missing_ok=True)


def _can_be_ours(name: str) -> bool:
    """Whether the program could have given a file this name; a file manager's ``Copy of ...`` has spaces."""
    try:
        check_name(name)
    except ValueError:
        return False
    return True
