"""The DuckDB warehouse, built from the stored artefacts.

One ``.sql`` file per table and view, in ``sql/``, run in the order below. The database is built beside the old one and
then put in its place, so readers of the old one go on undisturbed and there is never half a warehouse. Only artefacts
that still count enter: those listed by a record whose inputs are what the records before it list.
"""

from __future__ import annotations

import logging
import tempfile
import time
from collections.abc import Sequence
from dataclasses import dataclass
from importlib import resources
from pathlib import Path
from typing import TYPE_CHECKING

from trace_dag.crash.tables import CRASH_RECORD
from trace_dag.errors import Failure, Stage
from trace_dag.pipeline.comparisons import CONTROLS, FOLDER, PUBLISHED
from trace_dag.pipeline.home import WAREHOUSE_FILE
from trace_dag.pipeline.registry import Registry
from trace_dag.storage import Storage
from trace_dag.warehouse.outcomes import read_outcomes
from trace_dag.warehouse.reports import state_names, unread_reports

if TYPE_CHECKING:
    import duckdb

log = logging.getLogger(__name__)

TABLES = (
    "coverage_classes",
    "crashes",
    "vehicles",
    "events",
    "stage_outcomes",
    "stage_history",
    "artefacts",
    "maps",
    "map_checks",
    "estimates",
    "estimated_states",
    "simulations",
    "contacts",
    "verdict_criteria",
    "verdicts",
    "verdict_changes",
    "failures",
    "funnel",
    "cohort_funnel",
    "failure_reasons",
    "coverage",
    "coverage_cross",
    "cohort_gaps",
    "run_summary",
    "negative_controls",
    "benchmark_comparison",
)

# The parts of the JSON artefacts that the tables need, read once into temporary tables (``sql/documents``).
_DOCUMENTS = {
    "map_report": Stage.ROAD_MAP,
    "estimate": Stage.STATE_ESTIMATE,
    "simulation": Stage.SIMULATION_LOG,
    "verdict": Stage.VERDICT,
}
# Comparisons of whole cohorts that the SQL reads: variable, beginning of the file's name.
_COMPARISONS = (("control_files", f"{FOLDER}/{CONTROLS}-"), ("comparison_files", f"{FOLDER}/{PUBLISHED}-"))
_BUILD_ATTEMPTS = 3
_MEMORY_LIMIT = "1GB"
_READ_AT_ONCE = 500  # documents, so that a cohort of any size needs the same memory


@dataclass(frozen=True)
class BuildReport:
    """What was built: rows per table, size in bytes, and how long it took."""

    rows: dict[str, int]
    size: int
    duration_s: float


def build_warehouse(storage: Storage, local_folder: Path) -> BuildReport:
    """Build ``ROOT/warehouse.duckdb`` anew. ``local_folder`` is where it is built (the root itself, if local).

    A crash may be worked on meanwhile: if one of its files goes while it is read, the build begins again.
    """
    started = time.monotonic()
    for attempt in range(1, _BUILD_ATTEMPTS + 1):
        with tempfile.TemporaryDirectory(prefix=".building-", dir=local_folder) as folder:
            try:
                return _build(storage, Path(folder), local_folder / WAREHOUSE_FILE, started)
            except FileNotFoundError as error:
                if attempt == _BUILD_ATTEMPTS:
                    raise Failure(f"warehouse: artefacts keep changing while they are read ({error})") from error
                log.info("an artefact was replaced while it was read; building again")
    raise AssertionError("unreachable")


def _build(storage: Storage, folder: Path, target: Path, started: float) -> BuildReport:
    import duckdb

    cohorts = Registry(storage).cohorts().values()
    outcomes = read_outcomes(storage, {key: cohort.name for cohort in cohorts for key in cohort.reports})
    path = folder / WAREHOUSE_FILE
    with duckdb.connect(str(path)) as connection:
        connection.execute("SET enable_progress_bar = false")
        connection.execute(f"SET memory_limit = '{_MEMORY_LIMIT}'")
        for name, rows_of_records in outcomes.tables.items():
            connection.register(name, rows_of_records)
        connection.register("listing", unread_reports(storage, cohorts, outcomes.tables["standing"]))
        connection.register("state", state_names())
        parquet = _local(storage, outcomes.files.get((Stage.CRASH_RECORD, "parquet"), ()), "parquet", folder)
        connection.execute("SET VARIABLE record_files = $files", {"files": parquet})
        for variable, beginning in _COMPARISONS:
            names = [name for name in storage.list(FOLDER) if name.startswith(beginning)]
            connection.execute(f"SET VARIABLE {variable} = $files", {"files": _local(storage, names, "json", folder)})
        for document, stage in _DOCUMENTS.items():
            _read_documents(connection, storage, document, outcomes.files.get((stage, "json"), ()), folder)
        for table in TABLES:
            _execute(connection, table, _sql(table))
        rows = {table: _count(connection, table) for table in TABLES}
        connection.execute("CHECKPOINT")
    size = path.stat().st_size
    if storage.local_root is None:
        storage.write(WAREHOUSE_FILE, path.read_bytes())
    path.replace(target)
    return BuildReport(rows, size, time.monotonic() - started)


def _sql(table: str) -> str:
    return resources.files("trace_dag.warehouse").joinpath("sql", f"{table}.sql").read_text()


def _count(connection: duckdb.DuckDBPyConnection, table: str) -> int:
    row = connection.execute(f'SELECT count(*) FROM "{table}"').fetchone()  # noqa: S608 - a name of ours
    return int(row[0]) if row else 0


def _read_documents(
    connection: duckdb.DuckDBPyConnection, storage: Storage, document: str, names: Sequence[str], folder: Path
) -> None:
    """One temporary table of what a kind of JSON artefact says, some hundred files at a time."""
    select = _sql(f"documents/{document}")
    for start in range(0, max(1, len(names)), _READ_AT_ONCE):
        files = _local(storage, names[start : start + _READ_AT_ONCE], "json", folder)
        connection.execute("SET VARIABLE files = $files", {"files": files})
        into = f"INSERT INTO {document}" if start else f"CREATE TEMP TABLE {document} AS"
        _execute(connection, f"documents/{document}", f"{into} {select}")
        for file in files[1:]:  # the first is the empty one, which others read too
            if Path(file).is_relative_to(folder):
                Path(file).unlink()


def _execute(connection: duckdb.DuckDBPyConnection, name: str, sql: str) -> None:
    import duckdb

    try:
        connection.execute(sql)
    except duckdb.IOException as error:
        raise FileNotFoundError(str(error)) from error
    except duckdb.Error as error:
        raise Failure(f"{name}.sql: {error}") from error


def _local(storage: Storage, names: Sequence[str], extension: str, folder: Path) -> list[str]:
    """Local paths of stored files. DuckDB needs at least one file: an empty one is always among them."""
    paths = [str(_empty_file(folder, extension))]
    if storage.local_root is not None:
        return paths + [storage.path(name) for name in names]
    for start in range(0, len(names), _READ_AT_ONCE):
        for name, data in storage.read_many(names[start : start + _READ_AT_ONCE]).items():
            copy = folder / name
            copy.parent.mkdir(exist_ok=True)
            copy.write_bytes(data)
            paths.append(str(copy))
    return paths


def _empty_file(folder: Path, extension: str) -> Path:
    path = folder / f"empty.{extension}"
    if extension == "json":
        path.write_text("[]")
    else:
        import pyarrow.parquet as pq

        pq.write_table(CRASH_RECORD.arrow().empty_table(), path)
    return path


def table_documentation(connection: duckdb.DuckDBPyConnection) -> dict[str, list[tuple[str, str, str]]]:
    """Columns of every table and view as (name, type, comment), in order."""
    found: dict[str, list[tuple[str, str, str]]] = {table: [] for table in TABLES}
    for table, column, kind, comment in connection.sql(
        "SELECT table_name, column_name, data_type, comment FROM duckdb_columns() ORDER BY table_name, column_index"
    ).fetchall():
        if table in found:
            found[table].append((column, kind, comment or ""))
    return found
