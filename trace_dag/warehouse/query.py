"""Queries to the warehouse: read-only, from the file of the last build.

Queries of users run in a process with limits of time and memory, which DuckDB has not: a recursive query may run for
ever, and one expression may hold gigabytes.
"""

from __future__ import annotations

import hashlib
import json
import os
import pickle
import re
import resource
import subprocess
import sys
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from functools import lru_cache
from pathlib import Path
from threading import Lock
from typing import TYPE_CHECKING, Any, TypeVar

from trace_dag.common.errors import DamagedFile, Failure, UserError
from trace_dag.common.storage.checksums import add_checksum, check_document
from trace_dag.common.storage.files import Storage

if TYPE_CHECKING:
    import duckdb
    import pyarrow as pa

    from trace_dag.common.settings import WarehouseSettings

_BESIDE = "warehouse.json"
MAX_ROWS = 5_000_000
"""Limit for one answer: some 2 GB of memory. A national year has 40,000 crashes, its largest table some 100 rows for
each."""

_DESCRIBE = re.compile(r'\s*DESC(?:RIBE)?\s+"?(?P<table>\w+)"?\s*;?\s*', re.IGNORECASE)
_HELD_BY = re.compile(r"Conflicting lock is held in (?P<program>.+) \(PID (?P<pid>\d+)\)")
_OPENING = Lock()  # connections of one process share the configuration that the first one locks
_BUILT_AGAIN = "trace-dag verify --repair builds it again from what is stored, and so does trace-dag run"


def open_warehouse(path: Path) -> duckdb.DuckDBPyConnection:
    """Yield a read-only connection to the warehouse.

    A rebuild does not disturb it.

    Raises :class:`UserError` if there is no warehouse yet, :class:`DamagedFile` if it is damaged or was changed by
    hand. The connection has access only to the warehouse: it opens and writes no file, not even its own, uses no
    network, and allows no change of settings.
    """
    import duckdb

    check_warehouse(path)
    try:
        with _OPENING:
            connection = duckdb.connect(
                str(path),
                read_only=True,
                config={"enable_external_access": "false", "autoload_known_extensions": "false"},
            )
            # Without external access DuckDB still allows COPY TO the open file itself and to its log. It reads on
            # through the handle it has when no file can be opened any more. A second connection finds it locked
            # already. An answer that is not read to its end keeps the connection busy.
            if connection.execute("SELECT current_setting('lock_configuration')").fetchall() != [(True,)]:
                connection.execute("SET disabled_filesystems = 'LocalFileSystem'")
                connection.execute("SET lock_configuration = true")
    except duckdb.Error as error:
        if held := _HELD_BY.search(str(error)):
            raise Failure(
                f"{path}: {held['program']} (process {held['pid']}) has it open to write; end it, or have it open "
                "the warehouse read-only"
            ) from error
        raise DamagedFile(str(path), f"DuckDB cannot open it ({_first_line(error)})", _BUILT_AGAIN) from error
    return connection


def check_warehouse(path: Path) -> str:
    """Return the SHA-256 of an undamaged warehouse.

    Raises :class:`UserError` if there is no warehouse yet, :class:`DamagedFile` if it differs from its build.
    """
    from trace_dag.flow.manifests import check_listed

    return check_listed(lambda: _check(path), remedy=_BUILT_AGAIN)


def stray_log(path: Path) -> Path:
    """Return DuckDB's write-ahead log beside a warehouse; an undamaged warehouse has none."""
    return path.with_name(f"{path.name}.wal")


def _check(path: Path) -> str:
    if not path.is_file():
        raise UserError(f"{path}: there is no warehouse yet; trace-dag run builds it")
    built = _built(path)
    if stray_log(path).exists():
        raise DamagedFile(str(path), f"somebody else has written into it, {stray_log(path).name} lies beside it")
    status = path.stat()
    if _digest(path, status.st_ino, status.st_size, status.st_mtime_ns) != built:
        raise DamagedFile(str(path), "its content is not what was built")
    return built


def note_built(path: Path, sha256: str) -> None:
    """Store the digest of a warehouse's content beside it."""
    Storage(path.parent).write(_BESIDE, add_checksum(json.dumps({"sha256": sha256}).encode()))


def _built(path: Path) -> str:
    try:
        return str(check_document(Storage(path.parent).read(_BESIDE), name=_BESIDE)["sha256"])
    except (FileNotFoundError, KeyError) as error:
        raise DamagedFile(str(path), "nothing says with what content it was built") from error


@lru_cache(maxsize=4)
def _digest(path: Path, _inode: int, _size: int, _mtime_ns: int) -> str:
    """Return the SHA-256 of a file, computed once as long as the file does not change."""
    with path.open("rb") as file:
        return hashlib.file_digest(file, "sha256").hexdigest()


def query(path: Path, sql: str) -> tuple[list[str], list[tuple[Any, ...]]]:
    """Return the column names and rows of one query.

    Raises :class:`UserError` for a query that DuckDB refuses, and for too many rows.

    ``DESCRIBE`` of a table adds the meaning of each column, which DuckDB's own lacks.
    """
    described = _DESCRIBE.fullmatch(sql)
    if described and (columns := [row for owner, *row in columns_of(path) if owner == described["table"]]):
        return ["column", "type", "what it means"], [tuple(row) for row in columns]
    with open_warehouse(path) as connection:
        with _refusals(sql):
            connection.execute(sql)
            if connection.description is None:
                raise UserError("sql: there is no query in it")
            found = connection.fetchmany(MAX_ROWS + 1)
        _check_size(len(found))
        return [column[0] for column in connection.description], found


def query_typed(path: Path, sql: str) -> tuple[list[str], pa.Table]:
    """Return the result of :func:`query` with the column types of DuckDB, also for columns of nulls."""
    with open_warehouse(path) as connection:
        with _refusals(sql):
            asked = connection.sql(sql)
            if asked is None:
                raise UserError("sql: there is no query in it")
            found: pa.Table = asked.to_arrow_table()
        _check_size(found.num_rows)
        return found.column_names, found


@contextmanager
def _refusals(sql: str) -> Iterator[None]:
    import duckdb

    try:
        sql.encode()
        yield
    except UnicodeEncodeError as error:
        raise UserError("sql: the question is not UTF-8; expected a query in SQL") from error
    except duckdb.OutOfMemoryException as error:
        raise MemoryError from error
    except duckdb.Error as error:
        raise UserError(f"sql: {str(error).strip()}") from error
    except (OverflowError, ValueError) as error:  # DuckDB's values go further than Python's
        raise UserError(f"sql: a value that cannot be shown ({error}); cast it to VARCHAR") from error


def _check_size(rows: int) -> None:
    if rows > MAX_ROWS:
        raise UserError(f"sql: more than {MAX_ROWS:,} rows; ask for fewer with LIMIT or count them")


def rows(path: Path, table: str) -> list[dict[str, Any]]:
    """Return all rows of one table as dictionaries."""
    names, values = query(path, f'SELECT * FROM "{table}"')  # noqa: S608 - a name of ours
    return [dict(zip(names, row, strict=True)) for row in values]


def rows_of(path: Path, tables: Sequence[str]) -> list[list[dict[str, Any]]]:
    """Return the :func:`rows` of several tables.

    The file is opened once, because opening takes longer than most queries.
    """
    with open_warehouse(path):  # who connects to a file that this process has open shares it
        return [rows(path, table) for table in tables]


def tables_of(path: Path) -> list[tuple[Any, ...]]:
    """Return every table and view: name, number of rows and description, by name."""
    _, found = query(
        path,
        "SELECT table_name, comment FROM duckdb_tables() UNION ALL "
        "SELECT view_name, comment FROM duckdb_views() WHERE NOT internal ORDER BY ALL",
    )
    counted = " UNION ALL ".join(f'SELECT count(*) FROM "{name}"' for name, _ in found)  # noqa: S608 - names of ours
    rows_of = [count for (count,) in query(path, counted)[1]]
    return [(name, count, comment or "") for (name, comment), count in zip(found, rows_of, strict=True)]


def columns_of(path: Path) -> list[tuple[Any, ...]]:
    """Return all columns of tables and views: owner, name, type and meaning with unit, in order."""
    columns = (
        "SELECT table_name, column_name, data_type, comment FROM duckdb_columns() ORDER BY table_name, column_index"
    )
    return [(owner, name, kind, comment or "") for owner, name, kind, comment in query(path, columns)[1]]


def _first_line(error: Exception) -> str:
    return str(error).strip().partition("\n")[0]


# --- queries of users ------------------------------------------------------------------------------------------------
Answer = TypeVar("Answer")

_CHILD = "from trace_dag.warehouse.query import _answer; _answer()"


def ask(path: Path, sql: str, limits: WarehouseSettings, how: Callable[[Path, str], Answer]) -> Answer:
    """Run ``how``, a function such as :func:`trace_dag.warehouse.query.query`, within the limits of the settings.

    Raises :class:`UserError` also for a query that exceeds the limits of time or memory.
    """
    asked = pickle.dumps((how, path, sql, limits.query_memory_mb))
    try:
        done = subprocess.run(  # noqa: S603 - our own command
            [sys.executable, "-P", "-c", _CHILD],
            input=asked,
            capture_output=True,
            timeout=limits.query_time_s,
            check=False,
            start_new_session=True,  # Ctrl-C is for this process, which ends that one
        )
    except subprocess.TimeoutExpired as error:
        raise UserError(
            f"sql: no answer after {limits.query_time_s:g} s; ask for less, or set warehouse.query_time_s higher"
        ) from error
    if done.returncode or not done.stdout:
        raise _too_large(limits.query_memory_mb)
    answer: Answer | Exception
    answer = pickle.loads(done.stdout)  # noqa: S301 - written by this module
    if isinstance(answer, MemoryError | ImportError):  # DuckDB itself may find no room
        raise _too_large(limits.query_memory_mb) from answer
    if isinstance(answer, Exception):
        raise answer
    return answer


def _too_large(memory_mb: int) -> UserError:
    return UserError(
        f"sql: the answer needs more than {memory_mb} MB; ask for less, or set warehouse.query_memory_mb higher"
    )


def _answer() -> None:
    """Write the answer, or the error, to the child's original standard output.

    DuckDB draws a progress bar on standard output after two seconds, which is redirected to standard error.
    """
    answer = os.fdopen(os.dup(sys.stdout.fileno()), "wb")
    os.dup2(sys.stderr.fileno(), sys.stdout.fileno())
    how, path, sql, memory_mb = pickle.load(sys.stdin.buffer)  # noqa: S301 - written by this module
    resource.setrlimit(resource.RLIMIT_AS, (memory_mb * 2**20, memory_mb * 2**20))
    said: object
    try:
        said = how(path, sql)
    except Exception as error:
        said = error
    with answer:
        pickle.dump(said, answer)
