"""What is kept of map files and no registered one needs: pieces, passes that were broken off, copies."""

from __future__ import annotations

import shutil
from pathlib import Path

from trace_dag.cohorts.registry import Registry
from trace_dag.cohorts.services import map_copies
from trace_dag.osm.large_map import unused
from trace_dag.storage import Storage


def unused_of_maps(storage: Storage) -> tuple[list[str], list[Path]]:
    """Names in storage, and files and folders of this machine."""
    maps = [file for cohort in Registry(storage).cohorts().values() for file in cohort.maps]
    names, folders = unused(storage, {file.sha256 for file in maps})
    copies = map_copies(storage)
    wanted = {copies / file.location for file in maps if file.stored}
    return names, [*folders, *(path for path in sorted(copies.rglob("*")) if path.is_file() and path not in wanted)]


def remove_unused_of_maps(storage: Storage) -> None:
    """Delete it, after maps have been left out or new ones have come."""
    names, paths = unused_of_maps(storage)
    for name in names:
        storage.delete(name)
    for path in paths:
        if path.is_dir():
            shutil.rmtree(path, ignore_errors=True)
        else:
            path.unlink(missing_ok=True)
