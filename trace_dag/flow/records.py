"""Reading and writing outcome records, for one crash and for many.

Each record is a file beside its artefacts, and these files are the truth. On an object store each costs a request, a
hundred thousand for a national year. So the parent of a run also writes all its records as one file,
``ROOT/outcomes/<run>.jsonl.gz``. An entry of it is used only if the store lists the same MD5 for the record's own file;
any other record is read by itself.
"""

from __future__ import annotations

import gzip
import hashlib
import json
import logging
from collections.abc import Callable, Collection, Iterable, Mapping, Sequence

from trace_dag.common.errors import DamagedFile, Failure
from trace_dag.common.gc_pause import gc_paused
from trace_dag.common.provenance import (
    MADE_AGAIN,
    OutcomeRecord,
    crash_of,
    record_from_json,
    record_name,
    record_to_json,
)
from trace_dag.common.stage import Stage
from trace_dag.common.storage.files import Entry, Storage

Records = dict[Stage, OutcomeRecord]  # of one crash
OnProblem = Callable[[Failure], None]
"""Hears of one crash or file that had to be left out, while the others go on."""
log = logging.getLogger(__name__)

FOLDER = "outcomes"
"""Folder of the records of a run as one file, on an object store."""
_READ_ONE_BY_ONE = 500  # records; for more, listings are cheaper, and the indices of runs on an object store


def raise_problem(failure: Failure) -> None:
    """Raise the error, for callers that need everything."""
    raise failure


def log_problem(failure: Failure) -> None:
    """Log a failure, for callers that continue without the damaged part."""
    log.warning("%s", failure)


@gc_paused()
def read_records(
    storage: Storage,
    keys: Iterable[str],
    stages: Sequence[Stage] = tuple(Stage),
    *,
    on_problem: OnProblem = log_problem,
) -> dict[str, Records]:
    """Return the stored records of some crashes, by key and stage; every key has an entry.

    A damaged record is left out, so that its stage runs again; ``on_problem`` is called with its error.
    """
    by_key: dict[str, Records] = {key: {} for key in keys}
    for name, data in _contents(storage, by_key, stages, on_problem).items():
        record = readable_record(storage, name, data, on_problem)
        if record is not None:
            by_key[record.key][record.stage] = record
    return by_key


def readable_record(storage: Storage, name: str, data: bytes, on_problem: OnProblem) -> OutcomeRecord | None:
    """Return a record from its bytes; if it is damaged, call ``on_problem`` and return None.

    An unreadable record is read once more, since the file may just have been replaced.
    """
    try:
        return record_from_json(data, name=name)
    except DamagedFile:
        try:
            return record_from_json(storage.read(name), name=name)
        except FileNotFoundError:
            return None
        except DamagedFile as damaged:
            on_problem(damaged)
            return None


def _contents(
    storage: Storage, keys: Collection[str], stages: Sequence[Stage], on_problem: OnProblem
) -> dict[str, bytes]:
    found: dict[str, bytes] = {}
    if len(keys) * len(stages) <= _READ_ONE_BY_ONE:
        names = [record_name(stage, key) for key in keys for stage in stages]
    else:  # most of the crashes of a large cohort may have none
        listed: dict[str, Entry] = {}
        for stage in stages:
            listed.update(storage.list(stage.value, (record_name(stage, "").partition("/")[2],)))
        names = [name for name in listed if crash_of(name) in keys]
        if storage.local_root is None:
            found = read_index(storage, names, listed)
            names = [name for name in names if name not in found]
    return found | storage.read_many(names, lambda damaged: on_problem(damaged.mended_by(MADE_AGAIN)))


def write_record(storage: Storage, record: OutcomeRecord) -> None:
    """Store a record, replacing the present one."""
    storage.write(record.name, record_to_json(record))


def intact(storage: Storage, records: Iterable[OutcomeRecord]) -> dict[str, bool]:
    """Return whether all artefacts of each record are in storage with their recorded sizes, by the record's name."""
    records = list(records)
    sizes = storage.sizes({file.name for record in records for file in record.artefacts})
    return {record.name: all(sizes.get(file.name) == file.size for file in record.artefacts) for record in records}


def write_index(storage: Storage, run_id: str, records: Iterable[OutcomeRecord]) -> None:
    """Store the records of a run in one file, if the root is not local."""
    lines = [json.dumps({"name": each.name, "record": record_to_json(each).decode()}) for each in records]
    if not lines or storage.local_root is not None:
        return
    try:
        storage.write(f"{FOLDER}/{run_id}.jsonl.gz", gzip.compress("\n".join(lines).encode(), mtime=0))
    except Failure as error:
        log.warning("%s; the records of this run will be read one by one", error)


def read_index(storage: Storage, names: Collection[str], listed: Mapping[str, Entry]) -> dict[str, bytes]:
    """Return contents of the records ``names`` that an index has in their present version, by the record's name."""
    wanted, found = set(names), {}
    for file, data in storage.read_many(storage.list(FOLDER)).items():
        try:
            rows = [json.loads(line) for line in gzip.decompress(data).splitlines()]
        except (OSError, EOFError, ValueError) as error:
            log.warning("%s: cannot be read (%s); its records are read one by one", file, error)
            continue
        for row in rows:
            name, content = row["name"], row["record"].encode()
            entry = listed.get(name)
            if name in wanted and entry is not None and entry.md5 == _md5(content):
                found[name] = content
    return found


def _md5(content: bytes) -> str:
    return hashlib.md5(content, usedforsecurity=False).hexdigest()
