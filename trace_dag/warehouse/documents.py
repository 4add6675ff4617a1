"""The parts of the artefacts that the tables need, as temporary tables of DuckDB, one per kind: ``sql/documents``."""

from __future__ import annotations

from collections.abc import Sequence
from importlib import resources
from pathlib import Path
from typing import TYPE_CHECKING

from trace_dag.crash.tables import CRASH_RECORD
from trace_dag.disks import disk_failure
from trace_dag.errors import DamagedFile, Failure
from trace_dag.flow.ledgers import Complaint
from trace_dag.stage import Stage
from trace_dag.storage import Storage
from trace_dag.warehouse.snapshot import CrashSnapshot

if TYPE_CHECKING:
    import duckdb

JSON_DOCUMENTS = {
    "map_report": (Stage.ROAD_MAP, "json.gz"),
    "estimate": (Stage.STATE_ESTIMATE, "json.gz"),
    "simulation": (Stage.SIMULATION_LOG, "json.gz"),
    "sampled": (Stage.SIMULATION_LOG, "samples.json.gz"),
    "verdict": (Stage.VERDICT, "json.gz"),
}
_RECORD = "crash_record"
DOCUMENTS = (*JSON_DOCUMENTS.values(), (Stage.CRASH_RECORD, "parquet"))


class DocumentTables:
    """Takes over the artefacts of some crashes at a time. ``folder`` is for copies of what is not a local file.

    ``complain`` is called for crash records of other columns, which are left out.
    """

    def __init__(
        self, connection: duckdb.DuckDBPyConnection, storage: Storage, folder: Path, complain: Complaint
    ) -> None:
        self._connection = connection
        self._storage = storage
        self._folder = folder
        self._complain = complain
        self._made = False
        self.add([])

    def add(self, crashes: Sequence[CrashSnapshot]) -> None:
        """Take over some crashes. Raises ``FileNotFoundError`` if a record was deleted meanwhile."""
        import pyarrow as pa

        for name, document in JSON_DOCUMENTS.items():
            found = [(crash.key, crash.documents[document]) for crash in crashes if document in crash.documents]
            keys, contents = ([each[column] for each in found] for column in (0, 1))
            texts = pa.array(contents, pa.binary()).cast(pa.string())  # never texts of Python's
            table = pa.table({"key": pa.array(keys, pa.string()), "content": texts})
            self._connection.register("document", table)
            self._take(name)
            self._connection.unregister("document")
        files = [
            file.name
            for crash in crashes
            if Stage.CRASH_RECORD in crash.valid
            and (file := crash.valid[Stage.CRASH_RECORD].artefact("parquet")) is not None
        ]
        paths = local_files(self._storage, files, self._folder, "parquet")
        try:
            self._take_records(paths)
        except Failure:
            self._take_records(self._of_todays_columns(paths))
        self._made = True

    def _take_records(self, paths: Sequence[str]) -> None:
        self._connection.execute("SET VARIABLE record_files = $paths", {"paths": paths})
        self._take(_RECORD)

    def _of_todays_columns(self, paths: Sequence[str]) -> list[str]:
        """Records with the columns they have now. Looked at only if reading fails: it takes time for each file."""
        import pyarrow.parquet as pq

        kept, schema = [], CRASH_RECORD.arrow()
        for path in paths:
            if pq.read_schema(path).equals(schema):
                kept.append(path)
            else:
                name = f"{Stage.CRASH_RECORD}/{Path(path).name}"
                self._complain(DamagedFile(name, "written by another version of the program", "trace-dag run"))
        return kept

    def _take(self, name: str) -> None:
        into = f"INSERT INTO {name}" if self._made else f"CREATE TEMP TABLE {name} AS"
        execute_sql(self._connection, f"documents/{name}", prefix=into)


def local_files(storage: Storage, names: Sequence[str], folder: Path, extension: str) -> list[str]:
    """Paths of stored files as DuckDB reads them: copies in ``folder`` where the storage is elsewhere.

    DuckDB needs at least one file to know the columns by: an empty one is always the first.
    """
    empty = folder / f"empty.{extension}"
    if not empty.exists():
        _write_empty(empty)
    paths = [str(empty)]
    if storage.local_root is not None:
        return paths + [storage.path(name) for name in names]
    for name, data in storage.read_many(names).items():
        copy = folder / name
        copy.parent.mkdir(exist_ok=True)
        copy.write_bytes(data)
        paths.append(str(copy))
    return paths


def execute_sql(connection: duckdb.DuckDBPyConnection, name: str, *, prefix: str = "") -> None:
    """Run one of the ``.sql`` files. Raises ``FileNotFoundError`` for files that are gone, :class:`Failure` else."""
    import duckdb

    sql = resources.files("trace_dag.warehouse").joinpath("sql", f"{name}.sql").read_text()
    try:
        connection.execute(f"{prefix} {sql}")
    except duckdb.Error as error:
        if (failure := disk_failure(error)) is not None:
            raise failure from error
        if isinstance(error, duckdb.IOException):
            raise FileNotFoundError(str(error)) from error
        raise Failure(f"{name}.sql: {error}") from error


def _write_empty(path: Path) -> None:
    if path.suffix == ".json":
        path.write_text("[]")
        return
    import pyarrow.parquet as pq

    pq.write_table(CRASH_RECORD.arrow().empty_table(), path)
