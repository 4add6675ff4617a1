"""Folders that cohorts watch: which reports lie there now, and registering those that arrived.

A folder is watched by the cohort that asked for it (``trace-dag ingest --reports DIR --cohort NAME --watch``). Files
that may still be written to are left for the next look.
"""

from __future__ import annotations

import hashlib
import json
import logging
import time
from collections.abc import Iterable
from dataclasses import dataclass
from pathlib import Path
from typing import Final

from trace_dag.errors import UserError
from trace_dag.pipeline.ingest import ingest
from trace_dag.pipeline.registry import Registry, in_order
from trace_dag.storage import Storage

SETTLING_S: Final = 5.0
"""A file changed more recently than this may not be whole yet."""

log = logging.getLogger(__name__)


@dataclass(frozen=True)
class Arrivals:
    """A look at the watched folders: ``state`` stands for what lies there, ``keys`` are new or changed crashes."""

    state: str
    folders: int
    keys: tuple[str, ...] = ()


def register_arrivals(storage: Storage, seen: str = "") -> Arrivals:
    """Look at the folders of all cohorts and register what is new; nothing is read where ``seen`` is their state."""
    watched = {name: cohort.watched for name, cohort in Registry(storage).cohorts().items() if cohort.watched}
    files = {name: _settled(map(Path, folders)) for name, folders in watched.items()}
    listing = {name: [(str(path), *about) for path, about in found.items()] for name, found in files.items()}
    state = hashlib.sha256(json.dumps(listing).encode()).hexdigest()
    folders = sum(map(len, watched.values()))
    if state == seen:
        return Arrivals(state, folders)
    keys: list[str] = []
    for name, found in files.items():
        if not found:
            continue
        try:
            registration = ingest(storage, name, reports=list(found)).registration
        except UserError as error:
            log.warning("cohort %s: %s", name, error)  # nothing in there is a report so far
            continue
        keys += [*registration.added, *registration.changed]
    return Arrivals(state, folders, tuple(in_order(keys)))


def _settled(folders: Iterable[Path]) -> dict[Path, tuple[int, int]]:
    """The files below some folders with size and time of change, in order; those just written to are left out."""
    now_s = time.time()
    found: dict[Path, tuple[int, int]] = {}
    for folder in folders:
        if not folder.is_dir():
            log.warning("%s: the watched folder is not there", folder)
            continue
        for path in sorted(folder.rglob("*")):
            try:
                status = path.stat()
            except FileNotFoundError:
                continue  # gone again
            if path.is_file() and now_s - status.st_mtime >= SETTLING_S:
                found[path] = (status.st_size, status.st_mtime_ns)
    return found
