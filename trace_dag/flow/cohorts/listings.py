"""Listings of reports before their crashes have been run: enough to show their classes.

A look at a report takes some milliseconds, so what was seen is kept in ``ROOT/listings.json`` by the report's digest;
the file is a cache and can be deleted. Reports of the CrashAPI are not here until the crash is run.
"""

from __future__ import annotations

import hashlib
import logging
from collections import Counter
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path

from pydantic import TypeAdapter, ValidationError

from trace_dag.common.errors import DamagedFile, Rejection
from trace_dag.common.storage.checksums import add_checksum, check_document
from trace_dag.common.storage.files import Storage
from trace_dag.crash.listing import CrashListing, list_report
from trace_dag.flow.cohorts.registry import ReportSource

log = logging.getLogger(__name__)

FILE = "listings.json"
_TOLD_EVERY = 1000


@dataclass(frozen=True)
class _Seen:
    """One report as it was seen: SHA-256 of its content, and its listing (None: it could not be read)."""

    sha256: str
    listing: CrashListing | None


_CACHE = TypeAdapter(dict[str, _Seen])


def listings_of(storage: Storage, reports: Mapping[str, ReportSource]) -> dict[str, CrashListing]:
    """Return the listings of those of some crashes (by key) whose reports are at hand and can be read."""
    before = _cached(storage)
    seen: dict[str, _Seen] = {}
    for number, (key, report) in enumerate(reports.items()):
        if number and number % _TOLD_EVERY == 0:
            log.info("%d of %d reports looked at", number, len(reports))
        known = before.get(key)
        if known is not None and report.sha256 and known.sha256 == report.sha256:
            seen[key] = known
        elif (data := _content(storage, report)) is not None:
            seen[key] = _Seen(hashlib.sha256(data).hexdigest(), _listing(data, key))
    _keep(storage, before, seen)
    return {key: each.listing for key, each in seen.items() if each.listing is not None}


def remember(storage: Storage, reports: Mapping[str, ReportSource], listings: Mapping[str, CrashListing]) -> None:
    """Keep what a source listed of the reports it gave, by key, so that none has to be looked at for it."""
    known = {key: _Seen(reports[key].sha256, listing) for key, listing in listings.items() if reports[key].sha256}
    _keep(storage, _cached(storage), known)


def kinds_of(storage: Storage, reports: Mapping[str, ReportSource]) -> Counter[str]:
    """Count crashes (by key) of each kind, the most frequent first.

    ``not_known`` counts those whose report is missing or does not say.
    """
    listings = listings_of(storage, reports)
    kinds = Counter(
        str(listing.kind) if (listing := listings.get(key)) and listing.kind else "not_known" for key in reports
    )
    return Counter(dict(kinds.most_common()))


def _keep(storage: Storage, before: Mapping[str, _Seen], seen: Mapping[str, _Seen]) -> None:
    after = dict(sorted({**before, **seen}.items()))  # the same bytes, whatever was seen first
    if after != before:
        storage.write(FILE, add_checksum(_CACHE.dump_json(after, exclude_defaults=True)))


def _cached(storage: Storage) -> dict[str, _Seen]:
    try:
        return _CACHE.validate_python(check_document(storage.read(FILE), name=FILE))
    except (FileNotFoundError, DamagedFile, ValidationError):  # none yet, or of another version
        return {}


def _content(storage: Storage, report: ReportSource) -> bytes | None:
    try:
        match report.kind:
            case "file":
                return Path(report.location).read_bytes()
            case "stored":
                return storage.read(report.location)
            case "crashapi":
                return None
    except OSError:  # gone since it was registered: running the crash will say so
        return None


def _listing(data: bytes, key: str) -> CrashListing | None:
    try:
        return list_report(data, name=key)
    except Rejection:
        return None
