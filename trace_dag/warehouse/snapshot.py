"""What is stored of all crashes, read so that records and artefacts belong together while batches go on writing.

A document counts only if it has the digest its record lists. Where one has been replaced since its record was read,
the crash is read again; where that goes on, the crash enters as far as it is settled, as a crash does whose stage has
started. Some hundred crashes at a time are read, so that memory does not grow with the cohort.
"""

from __future__ import annotations

import hashlib
from collections.abc import Collection, Iterator, Mapping, Sequence
from dataclasses import dataclass

from trace_dag.errors import Stage
from trace_dag.pipeline.records import Records, read_records
from trace_dag.pipeline.standing import valid_records
from trace_dag.storage import Storage

_CRASHES_AT_ONCE = 250
_ATTEMPTS = 3


@dataclass(frozen=True)
class CrashSnapshot:
    """One crash: every record there is, those that count, and its JSON artefacts (UTF-8) by stage."""

    key: str
    records: Records
    valid: Records
    documents: Mapping[Stage, bytes]


def read_snapshots(storage: Storage, keys: Sequence[str], stages: Collection[Stage]) -> Iterator[list[CrashSnapshot]]:
    """Some crashes at a time, in order, each with its documents of some stages."""
    for start in range(0, len(keys), _CRASHES_AT_ONCE):
        chunk = keys[start : start + _CRASHES_AT_ONCE]
        settled: dict[str, CrashSnapshot] = {}
        for attempt in range(1, _ATTEMPTS + 1):
            unsettled = [key for key in chunk if key not in settled]
            for snapshot, replaced in _read(storage, unsettled, stages):
                if replaced is None or attempt == _ATTEMPTS:
                    settled[snapshot.key] = snapshot
            if len(settled) == len(chunk):
                break
        yield [settled[key] for key in chunk]


def _read(
    storage: Storage, keys: Sequence[str], stages: Collection[Stage]
) -> Iterator[tuple[CrashSnapshot, Stage | None]]:
    """Each crash up to the first stage whose document is not the one its record lists, and that stage."""
    records = read_records(storage, keys)
    valid = {key: valid_records(of_crash) for key, of_crash in records.items()}
    contents = storage.read_many(
        file.name
        for of_crash in valid.values()
        for stage, record in of_crash.items()
        if stage in stages and (file := record.artefact("json")) is not None
    )
    for key, of_crash in valid.items():
        documents: dict[Stage, bytes] = {}
        replaced = None
        for stage, record in of_crash.items():
            file = record.artefact("json") if stage in stages else None
            if file is None:
                continue
            data = contents.get(file.name, b"")
            if hashlib.sha256(data).hexdigest() != file.sha256:
                replaced = stage
                break
            documents[stage] = data
        if replaced is not None:
            of_crash = {stage: record for stage, record in of_crash.items() if stage.position < replaced.position}
        yield CrashSnapshot(key, records[key], of_crash, documents), replaced
