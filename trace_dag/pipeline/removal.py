"""Deleting what was made of crashes that are registered no more."""

from __future__ import annotations

from collections.abc import Collection

from trace_dag.errors import Stage
from trace_dag.pipeline.benchmark import FOLDER as BENCHMARK
from trace_dag.storage import Storage

_FOLDERS = (
    *(stage.value for stage in Stage),
    "reports",
    "pictures",
    *(f"{BENCHMARK}/{folder}" for folder in ("crashes", "packages", "pictures", "replays")),
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
    for key in keys:
        names.extend(storage.list(f"{BENCHMARK}/files/{key}"))
    for name in names:
        storage.delete(name)
    return len(names)
