"""What a warehouse says came out, without when, how long and in which run: equal for equal results."""

from __future__ import annotations

import hashlib
from pathlib import Path

from trace_dag.warehouse.build import TABLES
from trace_dag.warehouse.query import open_warehouse

_ABOUT_RUNS = {"run_summary", "stage_history", "verdict_changes"}
_WHEN_AND_WHERE = {
    "stage_outcomes": {"duration_s", "started_at", "run_id", "attempts"},
    "estimates": {"latency_s"},
}


def result_tables(warehouse: Path) -> dict[str, str]:
    """SHA-256 of each table's and view's rows, in the order of all their columns."""
    found = {}
    with open_warehouse(warehouse) as connection:
        for table in TABLES:
            if table in _ABOUT_RUNS or table.startswith(("run_", "stage_duration", "slow")):
                continue
            columns = [row[0] for row in connection.execute(f"DESCRIBE {table}").fetchall()]
            kept = ", ".join(f'"{name}"' for name in columns if name not in _WHEN_AND_WHERE.get(table, ()))
            rows = connection.execute(f"SELECT {kept} FROM {table} ORDER BY ALL").fetchall()
            found[table] = f"{len(rows)} rows {hashlib.sha256(repr(rows).encode()).hexdigest()[:16]}"
    return found


def differences(one: Path, other: Path) -> dict[str, tuple[str | None, str | None]]:
    """The tables in which two warehouses differ, with what each holds."""
    first, second = result_tables(one), result_tables(other)
    return {
        table: (first.get(table), second.get(table))
        for table in first.keys() | second.keys()
        if first.get(table) != second.get(table)
    }
