"""Registration of new reports: those that arrive in watched folders, and those that the CrashAPI has released.

A cohort watches a folder after ``trace-dag ingest --reports DIR --cohort NAME --watch``. Files that may still be
written to are left for the next time.

A cohort follows the service with the choices it was made with (``trace-dag ingest --crashapi ... --watch``). A case
that was listed before its report was released is rejected as ``not_released``, and requested again later.
"""

from __future__ import annotations

import hashlib
import json
import logging
import time
from collections.abc import Callable, Collection, Iterable, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Final

from trace_dag.common.errors import UserError
from trace_dag.common.settings import ServiceSettings
from trace_dag.common.storage.files import Storage
from trace_dag.crash.folder import Unrecognised
from trace_dag.flow.cohorts.ingest import ingest
from trace_dag.flow.cohorts.registry import Registry, in_order
from trace_dag.flow.cohorts.services import crash_api

SETTLING_S: Final = 5.0
"""A file changed more recently than this may not be whole yet."""
_NAMED = 20

log = logging.getLogger(__name__)


@dataclass(frozen=True)
class Arrivals:
    """Contents of the watched folders: ``state`` identifies them, ``keys`` are new or changed crashes.

    ``unread`` names the files without a report, with the reason; "" if there are none.
    """

    state: str
    folders: int
    keys: tuple[str, ...] = ()
    unread: str = ""

    @property
    def seen(self) -> str:
        """Return the state that the next look compares with."""
        return f"{self.state} {self.unread}"


def register_arrivals(storage: Storage, seen: str = "") -> Arrivals:
    """Register new reports in the watched folders of all cohorts, and return what was found.

    Nothing is read if the folders are in the state ``seen``.
    """
    watched = {name: cohort.watched for name, cohort in Registry(storage).cohorts().items() if cohort.watched}
    files = {name: _settled(map(Path, folders)) for name, folders in watched.items()}
    listing = {name: [(str(path), *about) for path, about in found.items()] for name, found in files.items()}
    state = hashlib.sha256(json.dumps(listing).encode()).hexdigest()
    folders = sum(map(len, watched.values()))
    seen_state, _, unread_before = seen.partition(" ")
    if state == seen_state:
        return Arrivals(state, folders, unread=unread_before)
    keys: list[str] = []
    unread: list[Unrecognised] = []
    for name, found in files.items():
        if not found:
            continue
        try:
            report = ingest(storage, name, reports=list(found), watch=True)
        except UserError as error:
            log.warning("cohort %s: %s", name, error)
            continue
        keys += [*report.registration.added, *report.registration.changed]
        unread += report.unrecognised
    return Arrivals(state, folders, tuple(in_order(keys)), _named(unread))


def _named(unread: Sequence[Unrecognised]) -> str:
    if not unread:
        return ""
    named = "; ".join(f"{each.path}: {each.why}" for each in unread[:_NAMED])
    more = f"; and {len(unread) - _NAMED} more" if len(unread) > _NAMED else ""
    return f"Not crash reports, left aside: {named}{more}"


def _settled(folders: Iterable[Path]) -> dict[Path, tuple[int, int]]:
    """Return the files below some folders with size and modification time, in order.

    Files modified a moment ago are left out.
    """
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


# --- cases that the CrashAPI has released ----------------------------------------------------------------------------
@dataclass(frozen=True)
class NewCases:
    """Result of a query: the number of cohorts that follow the service, new cases, and cases still awaited."""

    followers: int
    added: tuple[str, ...] = ()
    awaited: tuple[str, ...] = ()

    @property
    def keys(self) -> tuple[str, ...]:
        """Return all crashes whose report is to be requested."""
        return tuple(in_order((*self.added, *self.awaited)))


def register_new_cases(
    storage: Storage, services: ServiceSettings, not_released: Callable[[Collection[str]], Collection[str]]
) -> NewCases:
    """Request the lists of cases again for every cohort that follows the service, and register new cases.

    ``not_released`` returns those of some crashes that had no report at the last request. Raises TransientFailure or
    Failure if the service does not answer; earlier registrations stay.
    """
    cohorts = [cohort for cohort in Registry(storage).cohorts().values() if cohort.followed]
    added: list[str] = []
    awaited: list[str] = []
    for cohort in cohorts:
        awaited += not_released([key for key, report in cohort.reports.items() if report.kind == "crashapi"])
        for choice in cohort.followed:
            try:
                found = ingest(
                    storage,
                    cohort.name,
                    crash_api=crash_api(services, storage),
                    case_lists=crash_api(services, storage, refresh=True),
                    choice=choice,
                )
            except UserError as error:  # the service lists no such case yet
                log.warning("cohort %s: %s", cohort.name, error)
                continue
            added += found.registration.added
    return NewCases(len(cohorts), tuple(in_order(added)), tuple(in_order(awaited)))
