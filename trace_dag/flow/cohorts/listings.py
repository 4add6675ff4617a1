"""Listings of reports before their crashes have been run: enough to show their classes.

Listing a report takes some milliseconds, so listings are kept in ``ROOT/listings.parquet`` by the report's digest; the
file is a cache and can be deleted. Reports of the CrashAPI are not here until the crash is run.
"""

from __future__ import annotations

import hashlib
import logging
from collections import Counter
from collections.abc import Collection, Iterator, Mapping
from dataclasses import fields
from itertools import islice
from pathlib import Path
from typing import TYPE_CHECKING, Any, Final

from trace_dag.common.errors import DamagedFile, Rejection
from trace_dag.common.storage.checksums import check_table, write_table
from trace_dag.common.storage.files import Storage
from trace_dag.crash.classes import CrashKind
from trace_dag.crash.listing import CrashListing, list_report
from trace_dag.flow.cohorts.kept_files import read_kept
from trace_dag.flow.cohorts.registry import ReportSource

if TYPE_CHECKING:
    import pyarrow as pa

log = logging.getLogger(__name__)

FILE = "listings.parquet"
_TOLD_EVERY = 1000
_AT_ONCE: Final = 20_000
_NAMES: Final = tuple(field.name for field in fields(CrashListing))


def listings_of(storage: Storage, reports: Mapping[str, ReportSource]) -> dict[str, CrashListing]:
    """Return the listings of crashes (by key) whose reports are at hand and can be read."""
    before = _cached(storage)
    seen = {key: (sha256, listing) for key, sha256, listing in _rows(before, reports) if sha256 == reports[key].sha256}
    new: dict[str, tuple[str, CrashListing | None]] = {}
    for number, key in enumerate(reports.keys() - seen.keys()):
        if number and number % _TOLD_EVERY == 0:
            log.info("%d reports looked at", number)
        if (data := _content(storage, key, reports[key])) is not None:
            new[key] = (hashlib.sha256(data).hexdigest(), _listing(data, key))
    _keep(storage, before, ((key, *each) for key, each in new.items()))
    found = {**seen, **new}
    return {key: listing for key in reports if (listing := found.get(key, ("", None))[1]) is not None}


def remember(storage: Storage, reports: Mapping[str, ReportSource], listings: Mapping[str, CrashListing]) -> None:
    """Keep the listings that sources gave with their reports, by key, so that the reports need not be read for them."""
    before = _cached(storage)
    same = {key for key, sha256, _ in _rows(before, reports) if sha256 == reports[key].sha256}
    seen = ((key, report.sha256, listings[key]) for key, report in reports.items() if report.sha256)
    _keep(storage, before, (each for each in seen if each[0] not in same and each[2].kind is not None))


def kinds_of(storage: Storage, reports: Mapping[str, ReportSource]) -> Counter[str]:
    """Count crashes (by key) of each kind, the most frequent first.

    ``not_known`` counts those whose report is missing or has no kind.
    """
    listings = listings_of(storage, reports)
    kinds = Counter(
        str(listing.kind) if (listing := listings.get(key)) and listing.kind else "not_known" for key in reports
    )
    return Counter(dict(kinds.most_common()))


def _keep(storage: Storage, before: pa.Table, seen: Iterator[tuple[str, str, CrashListing | None]]) -> None:
    """Replace the kept listings of these crashes; rows are in the order of keys."""
    import pyarrow as pa
    import pyarrow.compute as pc

    parts = []
    while part := list(islice(seen, _AT_ONCE)):
        rows = [
            {"key": key, "sha256": sha256, **({name: getattr(listing, name) for name in _NAMES} if listing else {})}
            for key, sha256, listing in part
        ]
        parts.append(pa.Table.from_pylist(rows, schema=before.schema))
    if parts:
        new = pa.concat_tables(parts)
        kept = before.filter(pc.invert(pc.is_in(before["key"], new["key"])))
        storage.write(FILE, write_table(pa.concat_tables([kept, new]).sort_by("key")))


def _cached(storage: Storage) -> pa.Table:
    import pyarrow as pa

    texts, numbers = ("key", "sha256", "county_name", "city_name", "kind"), ("latitude_deg", "longitude_deg")
    types = dict.fromkeys(texts, pa.string()) | dict.fromkeys(numbers, pa.float64())
    types["crash_types"] = pa.list_(pa.int32())
    schema = pa.schema([(name, types.get(name, pa.int32())) for name in ("sha256", *_NAMES)])
    try:
        return check_table(storage.read(FILE), name=FILE)[0].cast(schema)
    except (FileNotFoundError, DamagedFile, pa.ArrowException, ValueError):  # none yet, or of another version
        return schema.empty_table()


def _rows(table: pa.Table, wanted: Collection[str]) -> Iterator[tuple[str, str, CrashListing | None]]:
    """Yield key, digest and listing of the given crashes that are kept."""
    for batch in table.to_batches(max_chunksize=_AT_ONCE) if wanted else ():
        columns = [batch.column(name).to_pylist() for name in ("sha256", *_NAMES)]
        for sha256, key, *values in zip(*columns, strict=True):
            if key in wanted:
                yield key, sha256, _of_row(dict(zip(_NAMES, (key, *values), strict=True)))


def _of_row(row: dict[str, Any]) -> CrashListing | None:
    if row["case_year"] is None:
        return None
    kind = None if row["kind"] is None else CrashKind(row["kind"])
    return CrashListing(**{**row, "kind": kind, "crash_types": tuple(row["crash_types"])})


def _content(storage: Storage, key: str, report: ReportSource) -> bytes | None:
    try:
        match report.kind:
            case "file":
                return Path(report.location).read_bytes()
            case "stored":
                return read_kept(storage, key, report)
            case "crashapi":
                return None
    except (OSError, DamagedFile):  # gone since it was registered: running the crash will say so
        return None


def _listing(data: bytes, key: str) -> CrashListing | None:
    try:
        return list_report(data, name=key)
    except Rejection:
        return None
