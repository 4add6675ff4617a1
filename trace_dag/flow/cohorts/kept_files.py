"""Reports kept below the root, and copies of map files that are no longer needed.

Reports of tables are kept a thousand to a file, since a table may have half a million. A file is named after its
content and never changed; a later version of the table only adds files for its new reports.
"""

from __future__ import annotations

import hashlib
from collections.abc import Iterable, Mapping
from functools import lru_cache
from itertools import islice
from pathlib import Path
from typing import Final

from trace_dag.common.storage.checksums import check_table, write_table
from trace_dag.common.storage.files import Storage
from trace_dag.flow.cohorts.registry import Registry, ReportSource
from trace_dag.flow.cohorts.services import map_copies

FOLDER: Final = "reports"
_TOGETHER: Final = 1000


def keep_reports(
    storage: Storage, reports: Iterable[tuple[str, bytes]], known: Mapping[str, ReportSource]
) -> dict[str, ReportSource]:
    """Keep reports, by key; return the location of each.

    Reports that are ``known`` with this content stay where they are.
    """
    import pyarrow as pa

    taken: dict[str, ReportSource] = {}
    there, left = storage.list(FOLDER), iter(reports)
    while part := list(islice(left, _TOGETHER)):
        digests = {key: hashlib.sha256(data).hexdigest() for key, data in part}
        before = {key: known[key] for key in digests if key in known}
        taken |= {key: at for key, at in before.items() if at.sha256 == digests[key] and at.location in there}
        new = [(key, data) for key, data in part if key not in taken]
        if not new:
            continue
        keys, contents = zip(*new, strict=True)
        table = write_table(pa.table({"key": keys, "report": pa.array(contents, pa.binary())}))
        name = f"{FOLDER}/{hashlib.sha256(table).hexdigest()[:16]}.parquet"
        if name not in there:
            storage.write(name, table)
        taken |= {key: ReportSource("stored", name, digests[key]) for key in keys}
    return taken


def read_kept(storage: Storage, key: str, report: ReportSource) -> bytes:
    """Return a kept report.

    Raises FileNotFoundError if it is missing, :class:`~trace_dag.common.errors.DamagedFile` for a damaged file.
    """
    if not report.location.endswith(".parquet"):
        return storage.read(report.location)
    try:
        return _cached(storage, report.location)[key]
    except KeyError as error:
        raise FileNotFoundError(f"{report.location} has no report {key}") from error


def read_together(storage: Storage, name: str) -> dict[str, bytes]:
    """Return the reports of one file by key; raise the errors of :func:`read_kept`."""
    table, _ = check_table(storage.read(name), name=name)
    return dict(zip(table["key"].to_pylist(), table["report"].to_pylist(), strict=True))


_cached = lru_cache(maxsize=2)(read_together)


# --- maps ------------------------------------------------------------------------------------------------------------
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
