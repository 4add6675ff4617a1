"""Deleting the files of crashes that are no longer registered."""

from __future__ import annotations

from collections.abc import Collection

from trace_dag.benchmark.build import SUBJECT
from trace_dag.benchmark.crash_files import FOLDER as BENCHMARK
from trace_dag.flow.ledgers import sound_ledger, write_ledger
from trace_dag.provenance import crash_of
from trace_dag.stage import Stage
from trace_dag.storage import Storage

_FOLDERS = (
    *(stage.value for stage in Stage),
    "reports",
    "pictures",
    *(f"{BENCHMARK}/{folder}" for folder in ("crashes", "packages", "replays", "thumbnails")),
)


def delete_artefacts(storage: Storage, keys: Collection[str]) -> int:
    """Delete every file of some crashes below the root: artefacts, records, copies of reports, pages; how many."""
    wanted = set(keys)
    names = [
        name
        for folder in _FOLDERS
        for name in storage.list(folder)
        if name.rpartition("/")[2].partition(".")[0] in wanted
    ]
    for name in names:
        storage.delete(name)
    ledger = sound_ledger(storage, SUBJECT)
    if ledger.made_of.keys() & wanted:
        files = [file for name, file in ledger.files.items() if crash_of(name) not in wanted]
        made_of = {key: digest for key, digest in ledger.made_of.items() if key not in wanted}
        write_ledger(storage, SUBJECT, files, made_of)
    return len(names)
