"""Local copies of map files that no registered map needs any more."""

from __future__ import annotations

from pathlib import Path

from trace_dag.common.storage.files import Storage
from trace_dag.flow.cohorts.registry import Registry
from trace_dag.flow.cohorts.services import map_copies


def find_unused_map_copies(storage: Storage) -> list[Path]:
    """Return the files."""
    copies = map_copies(storage)
    wanted = {
        copies / file.location for cohort in Registry(storage).cohorts().values() for file in cohort.maps if file.stored
    }
    return [path for path in sorted(copies.rglob("*")) if path.is_file() and path not in wanted]


def remove_unused_map_copies(storage: Storage) -> None:
    """Delete copies of map files that are no longer registered."""
    for path in find_unused_map_copies(storage):
        path.unlink(missing_ok=True)
