"""What a warehouse says came out, without when, how long and in which run: equal for equal results."""

from __future__ import annotations

import hashlib
import tempfile
from pathlib import Path

import duckdb

from trace_dag.warehouse.updating import TABLES

ABOUT_RUNS = frozenset({"run_summary", "stage_history", "verdict_changes"})
WHEN_AND_WHERE = {
    "stage_outcomes": frozenset({"duration_s", "started_at", "run_id", "attempts"}),
    "estimates": frozenset({"latency_s"}),
}


def exported(warehouse: Path, folder: Path) -> dict[str, Path]:
    """Each table and view as a Parquet file in ``folder``, its rows in the order of all their columns."""
    folder.mkdir()
    files = {}
    with duckdb.connect(str(warehouse), read_only=True) as connection:  # one that may write files
        connection.execute("SET threads = 1")
        for table in TABLES:
            if table in ABOUT_RUNS:
                continue
            columns = [row[0] for row in connection.execute(f"DESCRIBE {table}").fetchall()]
            kept = ", ".join(f'"{name}"' for name in columns if name not in WHEN_AND_WHERE.get(table, ()))
            files[table] = folder / f"{table}.parquet"
            connection.execute(f"COPY (SELECT {kept} FROM {table} ORDER BY ALL) TO '{files[table]}' (FORMAT parquet)")
    return files


def result_tables(warehouse: Path) -> dict[str, str]:
    """SHA-256 of each table and view as :func:`exported` writes it."""
    with tempfile.TemporaryDirectory() as folder:
        files = exported(warehouse, Path(folder) / "tables")
        return {table: hashlib.sha256(path.read_bytes()).hexdigest()[:16] for table, path in files.items()}


def differences(one: Path, other: Path) -> dict[str, tuple[str | None, str | None]]:
    """The tables in which two warehouses differ, with what each holds."""
    first, second = result_tables(one), result_tables(other)
    return {
        table: (first.get(table), second.get(table))
        for table in first.keys() | second.keys()
        if first.get(table) != second.get(table)
    }
