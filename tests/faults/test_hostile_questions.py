"""Questions to the warehouse that want more than an answer: it stays as it was built, and the process goes on."""

from __future__ import annotations

from pathlib import Path

import pytest
import sample_runs
from sample_runs import trace_dag, trace_dag_process

import trace_dag.warehouse.query as warehouse_query
from trace_dag.cli.printing import print_table, write_csv
from trace_dag.common.errors import UserError
from trace_dag.common.settings import WarehouseSettings
from trace_dag.warehouse.query import ask, open_warehouse, query, stray_log


@pytest.fixture
def warehouse(tmp_path: Path) -> Path:
    sample_runs.copy_finished(tmp_path / "root")
    return tmp_path / "root" / "warehouse.duckdb"


WRITERS = {
    "over the warehouse": "COPY (SELECT 1) TO '{warehouse}' (USE_TMP_FILE false)",
    "over its log": "COPY (SELECT 1) TO '{warehouse}.wal'",
    "beside it": "COPY (SELECT 1) TO '{folder}/other.csv'",
    "export": "EXPORT DATABASE '{folder}/exported'",
    "log of DuckDB": "CALL enable_logging(storage='file', storage_config={{'path': '{warehouse}.wal'}})",
    "log of DuckDB elsewhere": "CALL enable_logging(storage='file', storage_config={{'path': '{folder}/log'}})",
    "profile": "PRAGMA enable_profiling='json'",
    "attach": "ATTACH '{folder}/new.duckdb'",
    "extension": "INSTALL httpfs",
    "unlock": "SET lock_configuration = false",
    "file systems": "RESET disabled_filesystems",
    "drop": "SELECT 1; DROP TABLE crashes",
}


@pytest.mark.parametrize("asked", WRITERS.values(), ids=WRITERS)
def test_no_question_writes(warehouse: Path, asked: str):
    folder = warehouse.parent
    before, there = warehouse.read_bytes(), sorted(folder.iterdir())
    done = trace_dag_process(folder, "sql", asked.format(warehouse=warehouse, folder=folder))
    assert done.returncode == 2, done.stderr
    assert done.stderr.startswith("trace-dag: sql: ")
    assert len(done.stderr.splitlines()) == 1
    assert warehouse.read_bytes() == before
    assert sorted(folder.iterdir()) == there
    assert not stray_log(warehouse).exists()
    assert trace_dag(folder, "sql", "SELECT count(*) FROM crashes", "--format", "csv").stdout.split() == [
        "count_star()",
        str(len(sample_runs.KEYS)),
    ]


@pytest.mark.parametrize(
    "asked",
    [
        "SELECT '\udcff'",
        "",
        ";",
        "SELECT INTERVAL '2000000000 months'",
        "SELECT " + "(" * 5000 + "1" + ")" * 5000,
        "SELECT repeat('a', 100000000000)",
        "FROM read_csv('/etc/passwd')",
        "FROM read_text('{warehouse}')",
    ],
)
def test_questions_that_cannot_be_answered_are_one_line(warehouse: Path, asked: str):
    with pytest.raises(UserError, match=r"^sql: "):
        query(warehouse, asked.format(warehouse=warehouse))


def test_more_rows_than_can_be_held_are_refused(warehouse: Path, monkeypatch: pytest.MonkeyPatch):
    monkeypatch.setattr(warehouse_query, "MAX_ROWS", 3)
    assert query(warehouse, "FROM range(3)") == (["range"], [(0,), (1,), (2,)])
    with pytest.raises(UserError, match="LIMIT"):
        query(warehouse, "FROM range(1000000000000)")


def test_two_may_read_at_once(warehouse: Path):
    with open_warehouse(warehouse) as first, open_warehouse(warehouse) as second:
        for each in (first, second):
            assert each.execute("SELECT count(*) FROM crashes").fetchone() == (len(sample_runs.KEYS),)


def test_long_queries_are_answered(warehouse: Path):
    """Four seconds of two cores; the bar comes after two."""
    asked = "SELECT sum(sqrt(a.range) * sqrt(b.range)) > 0 AS found FROM range(30000) a, range(30000) b"
    assert ask(warehouse, asked, WarehouseSettings(), query) == (["found"], [(True,)])


def test_column_names_command_neither_a_terminal_nor_a_spreadsheet(capsys: pytest.CaptureFixture[str]):
    print_table(["\x1b[31mred"], [["x"]])
    write_csv(["=1+1"], [["x"]])
    shown = capsys.readouterr().out
    assert "\x1b" not in shown
    assert "'=1+1" in shown
