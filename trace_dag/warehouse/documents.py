"""The parts of the artefacts that the tables need, as temporary tables of DuckDB, one per kind: ``sql/documents``."""

from __future__ import annotations

from collections.abc import Sequence
from importlib import resources
from pathlib import Path
from typing import TYPE_CHECKING

from trace_dag.common.errors import Failure
from trace_dag.common.schemas import table_from_parquet
from trace_dag.common.stage import Stage
from trace_dag.common.storage.disk_errors import disk_failure
from trace_dag.common.storage.files import Storage
from trace_dag.crash.tables import CRASH_RECORD
from trace_dag.warehouse.outcomes import CrashSnapshot

if TYPE_CHECKING:
    import duckdb
    import pyarrow as pa

_RECORD = (Stage.CRASH_RECORD, "parquet")
_JSON = {
    "map_report": (Stage.ROAD_MAP, "json"),
    "estimate": (Stage.STATE_ESTIMATE, "json"),
    "simulation": (Stage.SIMULATION_LOG, "json"),
    "sampled": (Stage.SIMULATION_LOG, "samples.json"),
    "verdict": (Stage.VERDICT, "json"),
}
DOCUMENTS = (_RECORD, *_JSON.values())


class DocumentTables:
    """Loads the artefacts of some crashes at a time."""

    def __init__(self, connection: duckdb.DuckDBPyConnection) -> None:
        self._connection = connection
        self._made = False
        self.add([])

    def add(self, crashes: Sequence[CrashSnapshot]) -> None:
        """Load some crashes."""
        import pyarrow as pa

        records = [table_from_parquet(crash.documents[_RECORD]) for crash in crashes if _RECORD in crash.documents]
        # Records of an older version may lack columns, in their vehicles and persons too.
        columns = pa.schema([_optional(field) for field in CRASH_RECORD.arrow()]).empty_table()
        self._take("crash_record", pa.concat_tables([columns, *records], promote_options="permissive"))
        for name, document in _JSON.items():
            found = [(crash.key, crash.documents[document]) for crash in crashes if document in crash.documents]
            keys, contents = ([each[column] for each in found] for column in (0, 1))
            texts = pa.array(contents, pa.binary()).cast(pa.string())  # never texts of Python's
            self._take(name, pa.table({"key": pa.array(keys, pa.string()), "content": texts}))
        self._made = True

    def _take(self, name: str, documents: pa.Table) -> None:
        into = f"INSERT INTO {name}" if self._made else f"CREATE TEMP TABLE {name} AS"
        self._connection.register("document", documents)
        execute_sql(self._connection, f"documents/{name}", prefix=into)
        self._connection.unregister("document")


def _optional(field: pa.Field) -> pa.Field:
    """Return a field that may be null, like all fields within it."""
    import pyarrow as pa

    kind = field.type
    if pa.types.is_list(kind):
        kind = pa.list_(_optional(kind.value_field))
    elif pa.types.is_struct(kind):
        kind = pa.struct([_optional(each) for each in kind])
    return pa.field(field.name, kind)


def local_files(storage: Storage, names: Sequence[str], folder: Path) -> list[str]:
    """Return local paths of stored JSON files for DuckDB, with copies in ``folder`` if the storage is remote.

    DuckDB needs at least one file to infer the columns, so an empty one is always the first.
    """
    empty = folder / "empty.json"
    empty.write_text("[]")
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
    """Run one of the ``.sql`` files.

    Raises ``FileNotFoundError`` for missing data files, :class:`Failure` for other errors.
    """
    import duckdb

    sql = resources.files("trace_dag.warehouse").joinpath("sql", f"{name}.sql").read_text()
    try:
        connection.execute(f"BEGIN; {prefix} {sql}; COMMIT")  # else each comment on a column is written by itself
    except duckdb.Error as error:
        if (failure := disk_failure(error)) is not None:
            raise failure from error
        if isinstance(error, duckdb.IOException):
            raise FileNotFoundError(str(error)) from error
        raise Failure(f"{name}.sql: {error}") from error
