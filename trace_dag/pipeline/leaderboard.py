"""The leaderboard's page, kept beside the benchmark's."""

from __future__ import annotations

from pathlib import Path

from trace_dag.scenario.leaderboard import write_leaderboard
from trace_dag.storage import Storage, StoredFile
from trace_dag.warehouse import query

PAGE = "benchmark/leaderboard.html"


def write_leaderboard_page(storage: Storage, warehouse: Path) -> StoredFile:
    """Write the page from the warehouse as it is."""
    rows = (query.rows(warehouse, view) for view in ("leaderboard", "leaderboard_by_class"))
    return storage.write(PAGE, write_leaderboard(*rows))
