"""The DuckDB warehouse, built from the stored artefacts.

One ``.sql`` file per table and view, in ``sql/``, run in the order below. The database is built beside the old one and
then replaces it, so readers of the old one are not disturbed and a warehouse is never incomplete. If few crashes have
changed since, it begins as a copy of the old one (:mod:`trace_dag.warehouse.updating`). Only current artefacts enter:
those of a record whose inputs are the outputs of earlier records.
"""

from __future__ import annotations

import hashlib
import logging
import shutil
import tempfile
import time
from collections.abc import Iterable, Mapping
from concurrent.futures import Future, ThreadPoolExecutor
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

from tenacity import Retrying, retry_if_exception_type, stop_after_attempt

from trace_dag.agents import evaluations, stored_traffic, stored_variations
from trace_dag.agents.evaluation.table import EVALUATIONS
from trace_dag.agents.stored_traffic import TRAFFIC
from trace_dag.agents.stored_variations import VARIATIONS
from trace_dag.common.errors import DamagedFile, Failure, Rejection, UserError
from trace_dag.common.processes import temporary_prefix
from trace_dag.common.provenance import crash_of
from trace_dag.common.stage import Stage
from trace_dag.common.storage.files import Storage
from trace_dag.crash.classes import JUDGED_KINDS, CrashKind
from trace_dag.crash.codes.elements import STATES
from trace_dag.crash.codes.odd import ODD
from trace_dag.crash.codes.table import code_table
from trace_dag.crash.listing import CrashListing
from trace_dag.crash.parse import reported_position
from trace_dag.flow.cohorts.listings import listings_of
from trace_dag.flow.cohorts.registry import Cohort, Registry
from trace_dag.flow.manifests import bring_up_to_date
from trace_dag.flow.records import OnProblem, log_problem
from trace_dag.flow.study_tables import CONTROLS, ESTIMATORS, FOLDER, PERTURBED, is_comparison_whole
from trace_dag.flow.workspace import BUILDING, WAREHOUSE_FILE
from trace_dag.warehouse import query
from trace_dag.warehouse.outcomes import (
    DOCUMENTS,
    DocumentTables,
    OutcomeTables,
    execute_sql,
    local_files,
    read_snapshots,
)
from trace_dag.warehouse.query import stray_log
from trace_dag.warehouse.updating import TABLES, changed_since_built, list_for_build, note_crashes, update_tables

if TYPE_CHECKING:
    import duckdb
    import pyarrow as pa

log = logging.getLogger(__name__)

# Comparisons of whole cohorts: the variable their SQL reads their files from, and their kind.
_COMPARISONS = {"control_files": CONTROLS, "perturbed_files": PERTURBED, "estimator_files": ESTIMATORS}
VERSION = "11"
"""Number of the code and the SQL that build a warehouse; see :data:`trace_dag.flow.stages.VERSIONS`."""
_BUILD_ATTEMPTS = 3
_MEMORY_LIMIT = "1GB"
# Each column of each table takes whole blocks. With DuckDB's usual 256 kB nearly all of a warehouse of a few hundred
# crashes is empty: 20 kB per crash in place of 6; of 36,000 it saves nothing and costs 2 s.
_BLOCK_BYTES = 32_768
_CODES = """
    FUNC_SYS LGT_COND MAN_COLL REL_ROAD RELJCT2 RUR_URB TYP_INT WEATHER HARM_EV IMPACT1 SOE PEDCGP BIKECGP
    ACC_TYPE P_CRASH1 P_CRASH2 VALIGN VPROFILE VSURCOND J_KNIFE VTRAFCON VTRAFWAY SEX LOCATION NMACTION NMCC
    MSAFEQMT NMHELMET NMPROPAD NMOTHPRO NMREFCLO NMLIGHT NMOTHPRE PBCWALK PBSWALK PBSZONE PEDLOC PEDPOS
    BIKEPOS PEDDIR BIKEDIR MOTDIR MOTMAN PEDLEG PER_TYP
"""
"""Elements whose codes stand in the warehouse's columns."""
_POSITION = ("latitude_deg", "longitude_deg")


@dataclass(frozen=True)
class BuildReport:
    """The build of a warehouse: rows per table, size in bytes, duration, and damaged parts left out."""

    rows: dict[str, int]
    size: int
    duration_s: float
    damaged: tuple[DamagedFile, ...] = ()

    @property
    def incomplete_crashes(self) -> set[str]:
        """Return the crashes of which the warehouse lacks some stages."""
        files = (damaged.name for damaged in self.damaged)
        return {crash_of(name) for name in files if name.partition("/")[0] in set(Stage)}


def is_built_by_this_code(path: Path) -> bool:
    """Return whether there is a warehouse built by the present code and SQL."""
    return _built_by(path) == VERSION


def is_outdated(path: Path) -> bool:
    """Return whether there is an undamaged warehouse built by an earlier version of the program."""
    return _built_by(path) not in (None, VERSION)


def _built_by(path: Path) -> str | None:
    """Return the version of the code that built a warehouse, or "" if unknown.

    None without an undamaged one.
    """
    if not path.is_file():
        return None
    try:
        rows = query.query(path, "SELECT code_version FROM warehouse_build")[1]
    except UserError:  # an older one does not say
        return ""
    except DamagedFile:
        return None
    return str(rows[0][0]) if len(rows) == 1 else ""


def build_warehouse(storage: Storage, local_folder: Path, *, on_problem: OnProblem = log_problem) -> BuildReport:
    """Build ``ROOT/warehouse.duckdb``, or bring it up to date.

    It is built in ``local_folder`` (the root itself, if local).

    A crash may be worked on meanwhile: if one of its files disappears during reading, the build begins again. Damaged
    parts are left out and passed to ``on_problem``. Its SHA-256 is stored beside it, so that readers can detect
    changes.
    """
    started = time.monotonic()
    bring_up_to_date(storage)

    def build() -> BuildReport:
        with tempfile.TemporaryDirectory(prefix=temporary_prefix(BUILDING), dir=local_folder) as folder:
            return _build(storage, Path(folder), local_folder / WAREHOUSE_FILE, started)

    building = Retrying(
        retry=retry_if_exception_type(FileNotFoundError),
        stop=stop_after_attempt(_BUILD_ATTEMPTS),
        before_sleep=lambda _: log.info("an artefact was replaced while it was read; building again"),
        reraise=True,
    )
    try:
        built = building(build)
    except FileNotFoundError as error:
        raise Failure(f"warehouse: artefacts keep changing while they are read ({error})") from error
    for damaged in built.damaged:
        on_problem(damaged)
    return built


def _build(storage: Storage, folder: Path, target: Path, started: float) -> BuildReport:
    import duckdb

    cohorts = Registry(storage).cohorts().values()
    cohort_of = {key: cohort.name for cohort in cohorts for key in cohort.reports}
    path = folder / WAREHOUSE_FILE
    now = list_for_build(storage, cohorts)
    changed = changed_since_built(target, now) if is_built_by_this_code(target) else None
    if changed is not None:
        shutil.copyfile(target, path)
        cohort_of = {key: name for key, name in cohort_of.items() if key in changed}
    damaged: dict[str, DamagedFile] = {}

    def on_problem(failure: Failure) -> None:
        if not isinstance(failure, DamagedFile):
            raise failure
        damaged.setdefault(failure.name, failure)

    with duckdb.connect(str(path), config={"default_block_size": str(_BLOCK_BYTES)}) as connection:
        connection.execute("SET enable_progress_bar = false")
        connection.execute(f"SET memory_limit = '{_MEMORY_LIMIT}'")
        connection.execute("SET threads = 1")  # thousands of small files: more threads get in each other's way
        tables = _read(storage, cohort_of, connection, on_problem)
        tables |= {"listing": unread_reports(storage, cohorts, tables["standing"])}
        tables |= fixed_tables() | evaluation_tables(storage, on_problem)
        for name, table in tables.items():
            connection.register(name, table)
        comparisons = list(storage.list(FOLDER))
        for variable, kind in _COMPARISONS.items():
            names = [
                name
                for name in comparisons
                if name.startswith(f"{FOLDER}/{kind}-") and is_comparison_whole(storage, name, on_problem)
            ]
            files = local_files(storage, names, folder)
            connection.execute(f"SET VARIABLE {variable} = $files", {"files": files})
        connection.execute("SET VARIABLE code_version = $code", {"code": VERSION})
        connection.execute("RESET threads")  # the tables are made of a few large ones
        if changed is None:
            for table in TABLES:
                execute_sql(connection, table)
        else:
            update_tables(connection, changed, execute_sql)
        _comment_columns_of_views(connection)
        rows = {table: _count(connection, table) for table in TABLES}
        connection.execute("CHECKPOINT")
    if storage.local_root is None:
        storage.write(WAREHOUSE_FILE, path.read_bytes())
    with path.open("rb") as built:
        digest = hashlib.file_digest(built, "sha256").hexdigest()
    size = path.stat().st_size
    stray_log(target).unlink(missing_ok=True)  # of whoever wrote into the old one: DuckDB would add it to the new
    path.replace(target)
    query.note_built(target, digest)
    report = BuildReport(rows, size, time.monotonic() - started, tuple(damaged.values()))
    note_crashes(target, digest, now, report.incomplete_crashes)
    return report


def _read(
    storage: Storage, cohort_of: Mapping[str, str], connection: duckdb.DuckDBPyConnection, on_problem: OnProblem
) -> dict[str, pa.Table]:
    """Read everything stored, chunk by chunk.

    While one chunk is read, the previous one is converted and loaded into DuckDB.
    """
    outcomes = OutcomeTables()
    documents = DocumentTables(connection)
    chunks = read_snapshots(storage, list(cohort_of), DOCUMENTS, on_problem)
    with ThreadPoolExecutor(max_workers=1) as reader, ThreadPoolExecutor(max_workers=1) as duckdb_thread:
        reading = reader.submit(next, chunks, None)
        taken: Future[None] | None = None
        while (crashes := reading.result()) is not None:
            reading = reader.submit(next, chunks, None)
            if taken is not None:
                taken.result()
            taken = duckdb_thread.submit(documents.add, crashes)
            outcomes.add(crashes, cohort_of)
        if taken is not None:
            taken.result()
    return outcomes.finished()


def _comment_columns_of_views(connection: duckdb.DuckDBPyConnection) -> None:
    """Copy the comments of columns of ``crashes`` to columns that views take from it."""
    for view, column, comment in connection.execute(
        "SELECT taken.table_name, column_name, held.comment FROM duckdb_columns() taken JOIN duckdb_columns() held"
        " USING (column_name) WHERE taken.comment IS NULL AND held.table_name = 'crashes'"
    ).fetchall():
        text = comment.replace("'", "''")
        connection.execute(f"COMMENT ON COLUMN {view}.{column} IS '{text}'")


def _count(connection: duckdb.DuckDBPyConnection, table: str) -> int:
    row = connection.execute(f'SELECT count(*) FROM "{table}"').fetchone()  # noqa: S608 - a name of ours
    return int(row[0]) if row else 0


def table_documentation(connection: duckdb.DuckDBPyConnection) -> dict[str, list[tuple[str, str, str]]]:
    """Return columns of every table and view as (name, type, comment), in order."""
    found: dict[str, list[tuple[str, str, str]]] = {table: [] for table in TABLES}
    for table, column, kind, comment in connection.sql(
        "SELECT table_name, column_name, data_type, comment FROM duckdb_columns() ORDER BY table_name, column_index"
    ).fetchall():
        if table in found:
            found[table].append((column, kind, comment or ""))
    return found


# --- evaluations -----------------------------------------------------------------------------------------------------
def evaluation_tables(storage: Storage, on_problem: OnProblem) -> dict[str, pa.Table]:
    """Return the stored rows of each by their names in SQL, including those of changed crashes.

    ``on_problem`` is called with the errors of damaged files, which are left out.
    """
    import pyarrow as pa

    return {
        name: pa.Table.from_pylist(all_rows(storage, on_problem=on_problem), schema=schema.arrow())
        for name, all_rows, schema in (
            ("evaluation", evaluations.all_rows, EVALUATIONS),
            ("variation", stored_variations.all_rows, VARIATIONS),
            ("traffic_row", stored_traffic.all_rows, TRAFFIC),
        )
    }


# --- reports ---------------------------------------------------------------------------------------------------------
def unread_reports(storage: Storage, cohorts: Iterable[Cohort], crash_statuses: pa.Table) -> pa.Table:
    """Return one row per crash that no stage has read yet but whose report is at hand."""
    import pyarrow as pa

    reports = {key: report for cohort in cohorts for key, report in cohort.reports.items()}
    unread = [
        row["key"]
        for row in crash_statuses.select(["key", "stage_reached"]).to_pylist()
        if row["stage_reached"] in (None, Stage.RAW_REPORT.value)
    ]
    listings = listings_of(storage, {key: reports[key] for key in unread})
    texts = ("key", "kind", "collision_type", "road_topology", "vehicle_trajectory")
    schema = pa.schema(
        [(name, pa.string()) for name in texts]
        + [(name, pa.float64()) for name in _POSITION]
        + [("vehicles", pa.int32())]
    )
    return pa.Table.from_pylist([_row(listing) for listing in listings.values()], schema=schema)


def fixed_tables() -> dict[str, pa.Table]:
    """Return the tables that are the same for every root, by their names in SQL.

    They are the states by ``STATE`` code, the kinds of crash and whether each can be judged, the meanings of FARS codes
    in the warehouse's columns without those for "unknown", and the terms of the operational design domain.
    """
    import pyarrow as pa

    meanings = [
        (table.element, code, meaning)
        for table in map(code_table, _CODES.split())
        for code, meaning in table.meanings.items()
        if meaning and table.known(code) is not None
    ]
    kinds = [(kind.value, kind in JUDGED_KINDS) for kind in CrashKind]
    terms = [(element, str(code), each.term) for element, by_code in ODD.items() for code, each in by_code.items()]
    code, text, flag = ("code", pa.int32()), pa.string(), pa.bool_()
    return {
        name: pa.Table.from_pylist([dict(zip(dict(columns), row, strict=True)) for row in rows], pa.schema(columns))
        for name, columns, rows in (
            ("state", [code, ("name", text)], STATES.items()),
            ("kind_of_crash", [("kind", text), ("judged", flag)], kinds),
            ("code_meaning", [("element", text), code, ("meaning", text)], meanings),
            ("odd_term", [("element", text), ("code", text), ("term", text)], terms),
        )
    }


def _row(listing: CrashListing) -> dict[str, Any]:
    try:
        position = dict(zip(_POSITION, reported_position(listing.latitude_deg, listing.longitude_deg), strict=True))
    except Rejection:
        position = {}
    return {
        "key": listing.key,
        "kind": listing.kind.value if listing.kind else None,
        "collision_type": listing.collision_type.value,
        "road_topology": listing.road_topology.value,
        "vehicle_trajectory": listing.vehicle_trajectory.value,
        "vehicles": listing.vehicles,
        **position,
    }
