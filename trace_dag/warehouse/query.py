"""Asking the warehouse: read-only, from the file as it was last built."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Any

from trace_dag.errors import UserError

if TYPE_CHECKING:
    import duckdb


def open_warehouse(path: Path) -> duckdb.DuckDBPyConnection:
    """A read-only connection; :class:`UserError` if there is no warehouse yet. A rebuild does not disturb it.

    The connection reaches nothing but the warehouse: no other file, no network.
    """
    import duckdb

    if not path.is_file():
        raise UserError(f"{path}: there is no warehouse yet; trace-dag run builds it")
    return duckdb.connect(
        str(path), read_only=True, config={"enable_external_access": "false", "autoload_known_extensions": "false"}
    )


def query(path: Path, sql: str) -> tuple[list[str], list[tuple[Any, ...]]]:
    """Column names and rows of one query; :class:`UserError` for what DuckDB refuses."""
    import duckdb

    with open_warehouse(path) as connection:
        try:
            connection.execute(sql)
            if connection.description is None:
                raise UserError("sql: there is no query in it")
            return [column[0] for column in connection.description], connection.fetchall()
        except duckdb.Error as error:
            raise UserError(f"sql: {str(error).strip()}") from error


def rows(path: Path, table: str) -> list[dict[str, Any]]:
    """All rows of one table as dictionaries."""
    names, values = query(path, f'SELECT * FROM "{table}"')  # noqa: S608 - a name of ours
    return [dict(zip(names, row, strict=True)) for row in values]
