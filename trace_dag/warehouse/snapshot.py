"""A snapshot of all stored crashes with consistent records and artefacts while batches go on writing.

A document counts only with the digest in its record. If one has been replaced since its record was read, the crash is
read again. If that happens repeatedly, only its settled part enters, as for a crash with a started stage. Some hundred
crashes at a time are read, so that memory does not grow with the cohort.
"""

from __future__ import annotations

from collections.abc import Collection, Iterator, Mapping, Sequence
from dataclasses import dataclass

from trace_dag.common.errors import DamagedFile
from trace_dag.common.stage import Stage
from trace_dag.common.storage.files import Storage
from trace_dag.flow.contract import DamagedArtefactError
from trace_dag.flow.crash_status import valid_records
from trace_dag.flow.records import OnProblem, Records, read_records

_CRASHES_AT_ONCE = 250
_ATTEMPTS = 3


@dataclass(frozen=True)
class CrashSnapshot:
    """One crash: all its records, the valid ones, and its documents by stage and extension."""

    key: str
    records: Records
    valid: Records
    documents: Mapping[tuple[Stage, str], bytes]


def read_snapshots(
    storage: Storage, keys: Sequence[str], documents: Collection[tuple[Stage, str]], on_problem: OnProblem
) -> Iterator[list[CrashSnapshot]]:
    """Yield some crashes at a time, in order, each with its documents: artefacts by stage and extension.

    ``on_problem`` is called with the errors of damaged records and documents; the undamaged part of their crash enters.
    """
    for start in range(0, len(keys), _CRASHES_AT_ONCE):
        chunk = keys[start : start + _CRASHES_AT_ONCE]
        settled: dict[str, CrashSnapshot] = {}
        for attempt in range(1, _ATTEMPTS + 1):
            unsettled = [key for key in chunk if key not in settled]
            for snapshot, damaged in _read(storage, unsettled, documents, on_problem):
                if damaged is None:
                    settled[snapshot.key] = snapshot
                elif attempt == _ATTEMPTS:
                    on_problem(damaged)
                    settled[snapshot.key] = snapshot
            if len(settled) == len(chunk):
                break
        yield [settled[key] for key in chunk]


def _read(
    storage: Storage, keys: Sequence[str], documents: Collection[tuple[Stage, str]], on_problem: OnProblem
) -> Iterator[tuple[CrashSnapshot, DamagedFile | None]]:
    """Yield each crash up to the first document that differs from its record, with the fault of that document."""
    records = read_records(storage, keys, on_problem=on_problem)
    valid = {key: valid_records(of_crash) for key, of_crash in records.items()}
    listed = {
        (key, stage, extension): file
        for key, of_crash in valid.items()
        for stage, extension in documents
        if stage in of_crash and (file := of_crash[stage].artefact(extension)) is not None
    }
    contents = storage.read_many((file.name for file in listed.values()), unreadable=lambda _: None)  # told of below
    for key, of_crash in valid.items():
        found: dict[tuple[Stage, str], bytes] = {}
        damaged = None
        for stage, extension in sorted(documents, key=lambda document: document[0].position):
            file = listed.get((key, stage, extension))
            if file is None:
                continue
            data = contents.get(file.name)
            if data is None or not file.matches(data):
                damaged = DamagedArtefactError(key, stage, file.name, "not the file its record lists")
                of_crash = {each: record for each, record in of_crash.items() if each.position < stage.position}
                break
            found[stage, extension] = data
        yield CrashSnapshot(key, records[key], of_crash, found), damaged
