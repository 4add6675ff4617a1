"""Crashes changed since a warehouse was built, and the update of these alone.

A build stores the listing of each crash's records and documents beside the warehouse (``cache/warehouse.json`` of the
local folder). The next build lists them again and only reads the crashes whose listing differs: their rows are removed
from the tables with rows per crash, and made anew by the same SQL in a separate schema. Everything else in the
warehouse is made anew at every build. The stored listing only saves time: if it is missing, or of another warehouse,
everything is read.
"""

from __future__ import annotations

import hashlib
import json
from collections.abc import Callable, Collection, Iterable, Mapping
from enum import StrEnum
from pathlib import Path
from typing import TYPE_CHECKING, Final

from trace_dag.common.data_files import read_csv
from trace_dag.common.errors import DamagedFile, UserError
from trace_dag.common.gc_pause import gc_paused
from trace_dag.common.provenance import crash_of
from trace_dag.common.stage import Stage
from trace_dag.common.storage.checksums import add_checksum, check_document
from trace_dag.common.storage.files import Storage
from trace_dag.flow.cohorts.registry import Cohort
from trace_dag.warehouse.outcomes import DOCUMENTS
from trace_dag.warehouse.query import check_warehouse

if TYPE_CHECKING:
    import duckdb


class Rows(StrEnum):
    """Subjects of the rows of a table."""

    OF_ONE = "of one crash"
    """Each belongs to one crash and says nothing of others: a changed crash changes its own rows alone."""
    OF_ALL = "of all crashes"


TABLES: Final = {row["table"]: Rows(row["rows"]) for row in read_csv("trace_dag.warehouse", "sql/tables.csv")}
"""All tables and views of a warehouse by name, in the order in which they are made, each by its ``.sql`` file."""
_NOTE = "cache/warehouse.json"
_MOST = 0.1  # of the crashes; where more have changed, building anew takes hardly longer and leaves no gaps
_READ = {stage: (".outcome.json", *(f".{ext}" for of, ext in DOCUMENTS if of is stage)) for stage in Stage}
_SCHEMA = "changed"

Listed = Mapping[str, str]
"""For each crash a digest of how all that a warehouse reads of it is listed."""


def list_for_build(storage: Storage, cohorts: Iterable[Cohort]) -> Listed:
    """Return the listing of the registered crashes now."""
    about = {
        key: f"{cohort.name} {report.location} {report.sha256}\n"
        for cohort in cohorts
        for key, report in cohort.reports.items()
    }
    return digest_listing(storage, about)


@gc_paused()
def digest_listing(storage: Storage, about: Mapping[str, str]) -> Listed:
    """Return, for each crash, a digest of its listing for the warehouse and of the facts ``about`` it."""
    lines = {key: [text] for key, text in about.items()}
    for stage in Stage:
        for name, entry in storage.list(stage.value, _READ[stage]).items():
            if (of_crash := lines.get(crash_of(name))) is not None:
                of_crash.append(f"{name} {entry.size} {entry.version}\n")
    return {key: hashlib.sha256("".join(sorted(of_crash)).encode()).hexdigest() for key, of_crash in lines.items()}


def changed_since_built(warehouse: Path, now: Listed) -> set[str] | None:
    """Return the crashes added, removed or changed since a warehouse was built; None if it has to be built anew.

    The caller checks that it was built by the present code.
    """
    before = _noted(warehouse, _digest_of_built(warehouse))
    if before is None:
        return None
    changed = {key for key in now.keys() | before.keys() if now.get(key) != before.get(key)}
    return changed if len(changed) <= _MOST * len(now) else None


def note_crashes(warehouse: Path, sha256: str, crashes: Listed, unsettled: Collection[str]) -> None:
    """Store the inputs of a warehouse; ``unsettled`` crashes are read again by the next build."""
    settled = {key: digest for key, digest in crashes.items() if key not in unsettled}
    note = json.dumps({"warehouse": sha256, "crashes": settled}, sort_keys=True).encode()
    Storage(warehouse.parent).write(_NOTE, add_checksum(note))


def _noted(warehouse: Path, sha256: str | None) -> Listed | None:
    """Return the stored listing of the crashes in a warehouse with that content, or None."""
    try:
        note = check_document(Storage(warehouse.parent).read(_NOTE), name=_NOTE)
    except (FileNotFoundError, DamagedFile):
        return None
    return note["crashes"] if note["warehouse"] == sha256 else None


def _digest_of_built(warehouse: Path) -> str | None:
    """Return the SHA-256 of an undamaged warehouse, or None."""
    try:
        return check_warehouse(warehouse)
    except (DamagedFile, UserError):
        return None


def update_tables(
    connection: duckdb.DuckDBPyConnection,
    changed: Collection[str],
    run_sql: Callable[[duckdb.DuckDBPyConnection, str], None],
) -> None:
    """Bring an earlier warehouse up to date from the ``changed`` crashes, registered as for a build.

    ``run_sql`` makes the table or view of a name.
    """
    views = {name for (name,) in connection.sql("SELECT view_name FROM duckdb_views() WHERE NOT internal").fetchall()}
    for name in TABLES:
        if TABLES[name] is Rows.OF_ALL:
            connection.execute(f"DROP {'VIEW' if name in views else 'TABLE'} {name}")
    keys = "SELECT unnest($keys::VARCHAR[]) AS key"  # of no crash too, which before DuckDB 2 are integers
    connection.execute(f"CREATE TEMP TABLE changed_crash AS {keys}", {"keys": sorted(changed)})
    connection.execute(f"CREATE SCHEMA {_SCHEMA}")
    for name in TABLES:
        if TABLES[name] is Rows.OF_ALL:
            run_sql(connection, name)
            continue
        connection.execute(f"SET search_path = '{_SCHEMA},main'")
        run_sql(connection, name)
        connection.execute("SET search_path = 'main'")
        connection.execute(f"DELETE FROM {name} WHERE key IN (SELECT key FROM changed_crash)")  # noqa: S608 - ours
        connection.execute(f"INSERT INTO {name} SELECT * FROM {_SCHEMA}.{name}")  # noqa: S608 - names of ours
    connection.execute(f"DROP SCHEMA {_SCHEMA} CASCADE")
