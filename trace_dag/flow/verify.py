"""Verification of storage against its records, and repair.

Belongs here: a disagreement with its remedy, and those between outcome records, artefacts, registered crashes and the
results of studies. Those of pages and packages are in :mod:`trace_dag.export.build`, the warehouse's in
:mod:`trace_dag.warehouse.verify`, Dagster's in :mod:`trace_dag.assets.verify`.

Sizes are compared over listings, so that a large cohort on an object store costs no request per crash; the contents are
read only on request. Records and manifests are always read, and checked by their checksums. Repair deletes only
half-written files of killed processes and damaged answers of services. Other files that are damaged, or in no record,
move to ``ROOT/quarantine/<time>/``, and the next run makes them again.
"""

from __future__ import annotations

import hashlib
import json
import re
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from datetime import UTC, datetime
from enum import Enum
from pathlib import Path
from shutil import rmtree

from trace_dag.common.errors import DamagedFile
from trace_dag.common.messages.progress import OnProgress
from trace_dag.common.messages.wording import count_of
from trace_dag.common.network.http import find_damaged_answers
from trace_dag.common.processes import is_abandoned
from trace_dag.common.provenance import MADE_AGAIN, Outcome, crash_of, record_name
from trace_dag.common.stage import Stage
from trace_dag.common.storage.checksums import check_document, check_table
from trace_dag.common.storage.files import Entry, Storage, StoredFile, check_name
from trace_dag.flow.cohorts.kept_files import FOLDER, find_unused_map_copies, read_kept
from trace_dag.flow.cohorts.listings import FILE as LISTINGS
from trace_dag.flow.cohorts.registry import Cohort, Registry, ReportSource
from trace_dag.flow.cohorts.services import CACHE_FOLDER
from trace_dag.flow.crash_status import valid_records
from trace_dag.flow.manifests import (
    FOLDERS,
    adopt_files,
    is_of_older_version,
    manifest_name,
    not_as_listed,
    read_manifest,
    sound_manifest,
    write_manifest,
)
from trace_dag.flow.records import Records, read_records, write_record
from trace_dag.flow.recovery import register_again
from trace_dag.flow.workspace import BUILDING

QUARANTINE = "quarantine"
_RECORD_ENDING = ".outcome.json"
_ANSWERS = "llm_answers"
_VARIATION = re.compile(r"-v\d+$")


class DisagreementKind(Enum):
    """A kind of disagreement between storage, Dagster and the warehouse: its name and remedy."""

    LOST_COHORT = "lost or damaged cohort", "--repair puts it back, from its copy or from records"
    LOST_REGISTRY = "lost cohorts", "--repair registers the crashes again from their records; ingest their maps again"
    DAMAGED_PAGE = "damaged page or package", "--repair makes it again"
    DAMAGED_RESULT = "damaged result", "--repair puts it aside with all that was made together; make it again"
    LOST_MANIFEST = "lost or damaged manifest", "--repair makes it from the files that are there"
    DAMAGED_CACHE = (
        "damaged answer of a model, or note",
        "--repair puts it aside; it is asked for again when it is needed",
    )
    DAMAGED_ANSWER = "damaged answer of a service", "--repair deletes it; it is asked for again when it is needed"
    UNREADABLE_RECORD = "unreadable record", f"--repair puts it aside, {MADE_AGAIN}"
    MISSING_RECORD = "missing record", MADE_AGAIN
    MISSING_ARTEFACT = "missing artefact", MADE_AGAIN
    DAMAGED_ARTEFACT = "damaged artefact", f"--repair puts it aside, {MADE_AGAIN}"
    DAMAGED_PICTURE = "damaged or missing picture", f"--repair marks its stage to be run again, {MADE_AGAIN}"
    UNLISTED_FILE = "file of no record", "--repair puts it aside"
    LEFTOVER = "leftover of a killed process", "--repair deletes it"
    DAMAGED_REPORT = "lost or damaged report", "--repair copies it from raw_report; without that, ingest it again"
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
    """One disagreement; ``file`` is a name below the root, or a path outside it."""

    kind: DisagreementKind
    detail: str
    key: str | None = None
    stage: Stage | None = None
    file: str | None = None


@dataclass(frozen=True)
class StorageReport:
    """The contents of storage: the registered crashes' records, and the disagreements.

    ``interrupted`` counts stages whose process ended while they ran again; ``unregistered`` counts crashes with files
    that are no longer registered. ``older``: an earlier version of the program made the files. None of these is a
    disagreement.
    """

    records: dict[str, Records]
    disagreements: tuple[Disagreement, ...]
    files: int
    interrupted: int
    unregistered: int
    older: bool


def verify_storage(
    storage: Storage, local_folder: Path, *, contents: bool = False, progress: OnProgress | None = None
) -> StorageReport:
    """Compare the lists of records and manifests with the files.

    With ``contents`` every file is read and compared with its SHA-256; ``progress`` receives the numbers done and in
    total.
    """
    registry, older = Registry(storage), is_of_older_version(storage)
    lost = [each for each in registry.damage() if _is_first(each) or not older]  # which made no copies
    cohorts = list(registry.cohorts().values()) if not any(_is_first(each) for each in lost) else []
    registered = {key for cohort in cohorts for key in cohort.reports}
    everywhere = {stage: storage.list(stage.value) for stage in Stage}
    foreign = [name for listing in everywhere.values() for name in listing if not _can_be_ours(name)]
    listings = {
        stage: {name: entry for name, entry in listing.items() if name not in foreign}
        for stage, listing in everywhere.items()
    }
    found = {crash_of(name) for listing in listings.values() for name in listing}
    everything = read_records(storage, sorted(registered | found), on_problem=lambda _: None)
    disagreements = [
        Disagreement(DisagreementKind.LOST_COHORT, f"{each.name}: {each.found}", file=each.name) for each in lost
    ]
    for stage, listing in listings.items():
        disagreements += _stage_disagreements(storage, stage, listing, everything)
    drawn = _pictures(everything)
    disagreements += _picture_disagreements(drawn, storage.list("pictures"), everything, listings)
    if contents:
        disagreements += _damaged(storage, everything, drawn, disagreements, progress)
    if not older:
        disagreements += _result_disagreements(storage, contents)
    disagreements += _report_disagreements(storage, cohorts, contents)
    disagreements += _cache_disagreements(storage)
    if not lost and not cohorts and any(everything.values()):
        detail = f"no cohort is registered, though there are results of {count_of(len(everything), 'crash', 'crashes')}"
        disagreements.append(Disagreement(DisagreementKind.LOST_REGISTRY, detail, file="cohorts"))
    left = [*storage.leftovers(), *_unfinished_builds(local_folder)]
    if not lost:
        left += find_unused_map_copies(storage)
    if storage.local_root is not None:
        disagreements += [
            Disagreement(DisagreementKind.UNLISTED_FILE, f"{name} has no name of ours", file=name) for name in foreign
        ]
    disagreements += [Disagreement(DisagreementKind.LEFTOVER, str(path), file=str(path)) for path in left]
    return StorageReport(
        {key: everything[key] for key in sorted(registered)},
        tuple(disagreements),
        sum(map(len, listings.values())),
        sum(record.outcome is Outcome.STARTED for records in everything.values() for record in records.values()),
        len(found - registered),
        older,
    )


_PUT_ASIDE = frozenset(
    {
        DisagreementKind.UNREADABLE_RECORD,
        DisagreementKind.DAMAGED_ARTEFACT,
        DisagreementKind.DAMAGED_PICTURE,
        DisagreementKind.DAMAGED_CACHE,
        DisagreementKind.UNLISTED_FILE,
    }
)


def repair_storage(storage: Storage, found: Iterable[Disagreement], aside: Quarantine) -> None:
    """Repair storage where possible, and put aside files that are damaged or in no record.

    The next run makes these again.
    """
    lost: set[str] = set()  # cohorts whose file and copy are both damaged or gone
    for each in found:
        if each.file is None:
            continue
        if each.kind is DisagreementKind.LOST_COHORT:
            aside.copy(each.file, each.detail)
            if not Registry(storage).put_back(each.file):
                lost.add(Path(each.file).stem)
        elif each.kind is DisagreementKind.LOST_REGISTRY:
            lost.add(each.file)
        elif each.kind is DisagreementKind.DAMAGED_REPORT:
            _copy_of_report(storage, each, aside)
        elif each.kind is DisagreementKind.DAMAGED_RESULT:
            _put_aside_made_together(storage, each.file, each.detail, aside)
        elif each.kind is DisagreementKind.LOST_MANIFEST:
            aside.move(each.file, each.detail)
            for name in adopt_files(storage, each.file.partition("/")[0]):
                aside.move(name, f"{name} cannot be read")
        elif each.kind in (DisagreementKind.LEFTOVER, DisagreementKind.DAMAGED_ANSWER):
            _remove(Path(each.file))
        elif each.kind in _PUT_ASIDE:
            aside.move(each.file, each.detail)
            if each.kind is DisagreementKind.DAMAGED_PICTURE and each.key and each.stage:
                record = read_records(storage, [each.key], [each.stage])[each.key][each.stage]
                write_record(storage, replace(record, fingerprint=""))
    if lost:
        register_again(storage, lost)


class Quarantine:
    """Puts files aside in ``ROOT/quarantine/<time>/``, under their names; at its end it lists them with the reasons."""

    def __init__(self, storage: Storage) -> None:
        self._storage = storage
        self._folder = f"{QUARANTINE}/{datetime.now(UTC):%Y-%m-%dT%H%M%S.%f}"
        self._why: dict[str, str] = {}

    def move(self, name: str, why: str) -> None:
        """Put a file aside; on a local root also one with a name that storage does not allow."""
        if _can_be_ours(name) or self._storage.local_root is None:
            self._storage.move(name, f"{self._folder}/{name}")
        else:
            target = self._storage.local_root / self._folder / name
            target.parent.mkdir(parents=True, exist_ok=True)
            (self._storage.local_root / name).replace(target)
        self._why[name] = why

    def copy(self, name: str, why: str) -> None:
        """Keep a copy of a file before it is replaced."""
        try:
            self._storage.write(f"{self._folder}/{name}", self._storage.read(name))
        except (FileNotFoundError, DamagedFile):
            return  # gone, no right to read it, a folder in its place, or a bad sector
        self._why[name] = why

    def __enter__(self) -> Quarantine:
        return self

    def __exit__(self, *_: object) -> None:
        if self._why:
            self._storage.write(f"{self._folder}/list.json", json.dumps(self._why, indent=1).encode())


def _is_first(damaged: DamagedFile) -> bool:
    return damaged.name.count("/") == 1  # not a copy


def _stage_disagreements(
    storage: Storage, stage: Stage, listing: Mapping[str, Entry], records: Mapping[str, Records]
) -> Iterator[Disagreement]:
    listed: set[str] = set()
    for key, of_crash in records.items():
        record = of_crash.get(stage)
        if record is None:
            name = record_name(stage, key)
            if storage.is_folder(name):
                yield Disagreement(DisagreementKind.UNREADABLE_RECORD, f"{name} is a folder", key, stage, name)
            elif name not in listing and any(each.position > stage.position for each in of_crash):
                yield Disagreement(DisagreementKind.MISSING_RECORD, f"{name} is not there", key, stage, name)
            continue
        for file in record.artefacts:
            listed.add(file.name)
            entry = listing.get(file.name)
            if entry is None and storage.is_folder(file.name):
                detail = f"{file.name} is a folder"
                yield Disagreement(DisagreementKind.DAMAGED_ARTEFACT, detail, key, stage, file.name)
            elif entry is None:
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
        elif name not in listed and not _has_lost_its_record(stage, key, listing, records[key]):
            yield Disagreement(DisagreementKind.UNLISTED_FILE, f"{name} is in no record", key, stage, name)


def _has_lost_its_record(stage: Stage, key: str, listing: Mapping[str, Entry], of_crash: Records) -> bool:
    """Return whether a stage ran for a crash and its record is lost.

    Its files are then no strays, since a run makes both again.
    """
    later = any(each.position > stage.position for each in of_crash)
    return stage not in of_crash and (later or record_name(stage, key) in listing)


_Drawn = dict[str, tuple[str, Stage, StoredFile]]  # pictures by name: of which crash, drawn after which stage


def _pictures(records: Mapping[str, Records]) -> _Drawn:
    """Return the pictures of all crashes in their present state."""
    found = {}
    for key, of_crash in records.items():
        standing = valid_records(of_crash)
        if len(standing) < len(of_crash) and list(Stage)[len(standing)] not in of_crash:  # a record in between is lost
            standing = {stage: of_crash[stage] for stage in Stage if stage in of_crash}
        for record in list(standing.values())[-1:]:
            found.update({file.name: (key, record.stage, file) for file in record.pictures})
    return found


def _picture_disagreements(
    drawn: _Drawn,
    listing: Mapping[str, Entry],
    records: Mapping[str, Records],
    listings: Mapping[Stage, Mapping[str, Entry]],
) -> Iterator[Disagreement]:
    """Yield pictures that differ from their record, or that no intact record of their crash names."""
    for name, (key, stage, file) in drawn.items():
        entry = listing.get(name)
        if entry is None:
            yield Disagreement(DisagreementKind.DAMAGED_PICTURE, f"{name} is not there", key, stage, name)
        elif entry.size != file.size:
            detail = f"{name} has {entry.size} bytes, recorded are {file.size}"
            yield Disagreement(DisagreementKind.DAMAGED_PICTURE, detail, key, stage, name)
    named = {file.name for of_crash in records.values() for record in of_crash.values() for file in record.pictures}
    for name in listing:
        key = crash_of(name)
        of_crash = records.get(key, {})
        whole = not any(_has_lost_its_record(stage, key, listings[stage], of_crash) for stage in Stage)
        begun = any(record.outcome is Outcome.STARTED for record in of_crash.values())
        if name not in named and whole and not begun:
            yield Disagreement(DisagreementKind.UNLISTED_FILE, f"{name} is in no record", key, None, name)


def _damaged(
    storage: Storage,
    records: Mapping[str, Records],
    drawn: _Drawn,
    known: Sequence[Disagreement],
    progress: OnProgress | None,
) -> Iterator[Disagreement]:
    """Yield artefacts and pictures of the right size whose content differs from their record."""
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
        kind = DisagreementKind.DAMAGED_PICTURE if file.name in drawn else DisagreementKind.DAMAGED_ARTEFACT
        yield Disagreement(kind, detail, key, stage, file.name)


def _result_disagreements(storage: Storage, contents: bool) -> Iterator[Disagreement]:
    """Yield the lost manifests, files that differ from their manifest, and files that no manifest lists."""
    for folder in FOLDERS:
        name, there = manifest_name(folder), storage.list(folder)
        try:
            files = read_manifest(storage, folder).files
            if there and name not in there:
                raise DamagedFile(name, "it is not there")
        except DamagedFile as damaged:
            yield Disagreement(DisagreementKind.LOST_MANIFEST, str(damaged), file=name)
            continue
        for file, detail in not_as_listed(storage, files.values(), contents=contents):
            yield Disagreement(DisagreementKind.DAMAGED_RESULT, detail, file=file.name)
        for each in there:
            if each != name and each not in files:
                yield Disagreement(DisagreementKind.UNLISTED_FILE, f"{each} is not in {name}", file=each)


def _report_disagreements(storage: Storage, cohorts: Iterable[Cohort], contents: bool) -> Iterator[Disagreement]:
    """Yield reports kept below the root that are lost or, with ``contents``, differ from their registration."""
    reports = storage.list(FOLDER)
    for cohort in cohorts:
        for key, report in cohort.reports.items():
            name, found = report.location, ""
            if report.kind != "stored":
                continue
            if name not in reports:
                found = "is not there"
            elif contents and not _is_registered(storage, key, report):
                found = "is not the report that was registered"
            if found:
                detail = f"{name} {found}"
                yield Disagreement(DisagreementKind.DAMAGED_REPORT, detail, key, Stage.RAW_REPORT, name)


def _is_registered(storage: Storage, key: str, report: ReportSource) -> bool:
    try:
        return hashlib.sha256(read_kept(storage, key, report)).hexdigest() == report.sha256
    except (FileNotFoundError, DamagedFile):
        return False


def _cache_disagreements(storage: Storage) -> Iterator[Disagreement]:
    """Yield damaged answers of models, and damaged notes of reports and of the warehouse."""
    root = storage.local_root
    answers = sorted((root / _ANSWERS).rglob("*.json")) if root is not None else []
    names = [path.relative_to(root).as_posix() for path in answers if root is not None]
    notes = [LISTINGS, *(name for name in storage.list(CACHE_FOLDER) if name.endswith(".json"))]
    for path in find_damaged_answers(storage.local_folder / CACHE_FOLDER):
        detail = f"{path} is not the answer that was kept"
        yield Disagreement(DisagreementKind.DAMAGED_ANSWER, detail, file=str(path))
    for name, data in storage.read_many([*names, *notes], unreadable=lambda _: None).items():
        try:
            check_table(data, name=name) if name == LISTINGS else check_document(data, name=name)
        except DamagedFile as damaged:
            yield Disagreement(DisagreementKind.DAMAGED_CACHE, str(damaged), file=name)


def _copy_of_report(storage: Storage, each: Disagreement, aside: Quarantine) -> None:
    """Restore a report from the first stage's copy, if that is the registered one."""
    assert each.key is not None
    assert each.file is not None
    registered = Registry(storage).sources([each.key])[each.key]
    wanted = registered.report.sha256
    record = read_records(storage, [each.key], [Stage.RAW_REPORT])[each.key].get(Stage.RAW_REPORT)
    for file in record.artefacts if record is not None else ():
        if file.sha256 == wanted:
            try:
                data = storage.read_whole(file)
            except DamagedFile:
                return
            aside.move(each.file, each.detail)
            storage.write(name := f"{FOLDER}/{Path(file.name).name}", data)
            Registry(storage).register(registered.cohort, {each.key: ReportSource("stored", name, wanted)})


def _put_aside_made_together(storage: Storage, name: str, why: str, aside: Quarantine) -> None:
    """Put aside a damaged result with the files made together with it, and remove them from the manifest."""
    folder, _, file = name.partition("/")
    manifest = sound_manifest(storage, folder)
    if folder == "variations":
        crash = _VARIATION.sub("", crash_of(name))
        together = {name, *manifest.beginning(f"{crash}.", f"{crash}-v")}
    else:
        together = {each for each in manifest.files if Path(each).stem == Path(file).stem}
    for each in together:
        aside.move(each, why)
    left = {listed: entry for listed, entry in manifest.files.items() if listed not in together}
    write_manifest(storage, folder, replace(manifest, files=left))


def _unfinished_builds(local_folder: Path) -> list[Path]:
    return [path for path in local_folder.glob(f"{BUILDING}*") if is_abandoned(path, BUILDING)]


def _remove(path: Path) -> None:
    if path.is_dir():
        rmtree(path, ignore_errors=True)
    else:
        path.unlink(missing_ok=True)


def _can_be_ours(name: str) -> bool:
    """Return whether the program could have given a file this name, unlike a file manager's ``Copy of ...``."""
    try:
        check_name(name)
    except ValueError:
        return False
    return True
