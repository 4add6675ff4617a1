"""All outcome records of a run in one file, so that a large cohort on an object store is read in few requests.

Records lie one by one beside their artefacts, and those are what counts. On an object store each costs a request, a
hundred thousand for a national year. So the parent of a run also writes what the run recorded as one file,
``ROOT/outcomes/<run>.jsonl.gz``. An entry is believed only while the MD5 that the store lists for the record's own file
is that of the entry; any other record is read by itself.
"""

from __future__ import annotations

import gzip
import hashlib
import json
import logging
from collections.abc import Collection, Iterable, Mapping

from trace_dag.errors import Failure
from trace_dag.provenance import OutcomeRecord, record_to_json
from trace_dag.storage import Entry, Storage

FOLDER = "outcomes"
log = logging.getLogger(__name__)


def write_index(storage: Storage, run_id: str, records: Iterable[OutcomeRecord]) -> None:
    """Store the records of a run in one file; nothing where the root is local and reading one by one costs nothing."""
    lines = [json.dumps({"name": each.name, "record": record_to_json(each).decode()}) for each in records]
    if not lines or storage.local_root is not None:
        return
    try:
        storage.write(f"{FOLDER}/{run_id}.jsonl.gz", gzip.compress("\n".join(lines).encode(), mtime=0))
    except Failure as error:
        log.warning("%s; the records of this run will be read one by one", error)


def indexed(storage: Storage, names: Collection[str], listed: Mapping[str, Entry]) -> dict[str, bytes]:
    """Contents of those of the records ``names`` that an index holds as they are now, by the record's name."""
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
