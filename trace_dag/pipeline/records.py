"""Reading and writing outcome records, for one crash and for many."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence

from trace_dag.errors import Stage
from trace_dag.provenance import OutcomeRecord, record_from_json, record_name, record_to_json
from trace_dag.storage import Storage

Records = dict[Stage, OutcomeRecord]  # of one crash


def read_records(storage: Storage, keys: Iterable[str], stages: Sequence[Stage] = tuple(Stage)) -> dict[str, Records]:
    """The stored records of some crashes, by key and stage; every key has an entry."""
    by_key: dict[str, Records] = {key: {} for key in keys}
    contents = storage.read_many([record_name(stage, key) for key in by_key for stage in stages])
    for name, data in contents.items():
        record = record_from_json(data, name=name)
        by_key[record.key][record.stage] = record
    return by_key


def write_record(storage: Storage, record: OutcomeRecord) -> None:
    """Store a record in place of the one before."""
    storage.write(record.name, record_to_json(record))


def intact(storage: Storage, records: Iterable[OutcomeRecord]) -> dict[str, bool]:
    """Whether all artefacts of each record are in storage with their recorded sizes, by the record's name."""
    records = list(records)
    sizes = storage.sizes({file.name for record in records for file in record.artefacts})
    return {record.name: all(sizes.get(file.name) == file.size for file in record.artefacts) for record in records}


def built_on(record: OutcomeRecord, earlier: Mapping[Stage, OutcomeRecord]) -> bool:
    """Whether a record's inputs are the artefacts that the records of earlier stages list now."""
    made = {
        f"{stage}.{file.name.partition('.')[2]}": file.sha256
        for stage, other in earlier.items()
        for file in other.artefacts
    }
    return all(
        made.get(name) == digest
        for name, digest in record.provenance.inputs.items()
        if name.partition(".")[0] in _STAGE_NAMES
    )


_STAGE_NAMES = frozenset(stage.value for stage in Stage)
