"""Roots of any size: crashes that were really run, stored again under new keys.

Reports, outcome records, crash records and JSON artefacts are written anew with the new key, and the records with the
new digests and the present code, so that every crash is whole and up to date; other files are hard links to those of
the root they come from. How far a crash got is how far its copies got. Pages and packages are not copied.
"""

from __future__ import annotations

import multiprocessing
import os
from collections.abc import Iterator, Sequence
from dataclasses import replace
from itertools import islice
from pathlib import Path

from trace_dag.cohorts.registry import CrashSource, Registry, ReportSource
from trace_dag.crash.keys import crash_key, parse_key, register_key, state_of
from trace_dag.crash.tables import record_from_parquet, record_to_parquet
from trace_dag.flow.batch import work_of
from trace_dag.flow.crash_status import valid_records
from trace_dag.flow.records import Records, read_records, write_record
from trace_dag.flow.staleness import made_from
from trace_dag.flow.tasks import Work
from trace_dag.flow.workspace import Workspace
from trace_dag.stage import Stage
from trace_dag.storage.files import Storage, StoredFile

_FIRST_YEAR, _YEARS = 1975, 40  # of FARS
_AT_ONCE = 500


def multiply(source: Path, target: Path, crashes: int) -> None:
    """Make a root of that many crashes out of the stored ones of ``source``, each cohort with its maps."""
    origin, registry = Storage(source), Registry(Storage(source))
    work = work_of(Workspace.open(str(target)), "")
    stored = {key: valid_records(each) for key, each in read_records(origin, registry.keys()).items()}
    sources = registry.sources(stored)
    pairs = list(islice(_new_keys(list(stored)), crashes))
    tasks = [
        (origin, work, [(old, new, stored[old], sources[old]) for old, new in pairs[at : at + _AT_ONCE]])
        for at in range(0, crashes, _AT_ONCE)
    ]
    reports: dict[str, ReportSource] = {}
    with multiprocessing.get_context("spawn").Pool(os.cpu_count()) as pool:
        for made in pool.imap_unordered(_copy_some, tasks):
            reports.update(made)
    for name, cohort in registry.cohorts().items():
        own = {new: reports[new] for old, new in pairs if old in cohort.reports}
        Registry(Storage(target)).register(name, own, cohort.maps)


def _new_keys(keys: Sequence[str]) -> Iterator[tuple[str, str]]:
    """Old keys, round after round, each with a new one of the same state or register."""
    turn = 0
    while True:
        for position, key in enumerate(keys):
            parsed = parse_key(key)
            if parsed.state_case is None:
                yield key, register_key(parsed.register, f"{turn}-{parsed.id}")
            else:
                case = state_of(parsed.state_case) * 10_000 + turn // _YEARS * len(keys) + position
                yield key, crash_key(_FIRST_YEAR + turn % _YEARS, case)
        turn += 1


_Task = tuple[Storage, Work, list[tuple[str, str, Records, CrashSource]]]


def _copy_some(task: _Task) -> dict[str, ReportSource]:
    origin, work, crashes = task
    return {new: _copy_crash(origin, work, old, new, records, source) for old, new, records, source in crashes}


def _copy_crash(origin: Storage, work: Work, old: str, new: str, records: Records, source: CrashSource) -> ReportSource:
    """One crash under a new key; its report as a source, which is stored as it was handed in."""
    extension = Path(source.report.location).suffix
    target, report = work.storage, ReportSource("stored", f"reports/{new}{extension}", source.report.sha256)
    of_file = source.report.kind == "file"
    _link(Path(source.report.location if of_file else origin.path(source.report.location)), target, report.location)
    made: Records = {}
    for stage, record in records.items():
        provenance = made_from(work.recipes[stage], replace(source, report=report), made)
        artefacts, pictures = (
            tuple(_copy(origin, target, file, file.name.replace(old, new), old, new) for file in files)
            for files in (record.artefacts, record.pictures)
        )
        made[stage] = replace(
            record,
            key=new,
            provenance=provenance,
            fingerprint=provenance.fingerprint,
            artefacts=artefacts,
            pictures=pictures,
        )
        write_record(target, made[stage])
    return report


def _copy(source: Storage, target: Storage, file: StoredFile, name: str, old: str, new: str) -> StoredFile:
    if name.startswith(f"{Stage.CRASH_RECORD}/"):
        parsed, record = parse_key(new), record_from_parquet(source.read(file.name))
        year = parsed.case_year or record.case_year
        return target.write(
            name, record_to_parquet(replace(record, key=new, case_year=year, state_case=parsed.state_case))
        )
    if name.endswith(".json"):
        return target.write(name, source.read(file.name).replace(old.encode(), new.encode()))
    _link(Path(source.path(file.name)), target, name)
    return StoredFile(name, file.size, file.sha256)


def _link(file: Path, target: Storage, name: str) -> None:
    path = Path(target.path(name))
    path.parent.mkdir(parents=True, exist_ok=True)
    path.hardlink_to(file)
