"""A warehouse brought up to date holds what one built anew holds, whatever has changed."""

from __future__ import annotations

import hashlib
import logging
import re
import subprocess
import sys
from importlib import resources
from pathlib import Path

import duckdb
import pytest

from tests.result_tables import result_tables
from tests.warehouse.test_rebuilding import made, note
from trace_dag.common.errors import Failure, Reason
from trace_dag.common.stage import Stage
from trace_dag.common.storage.files import Storage
from trace_dag.flow.cohorts.registry import Registry, ReportSource
from trace_dag.warehouse.build import build_warehouse
from trace_dag.warehouse.query import check_warehouse, note_built, open_warehouse, rows
from trace_dag.warehouse.updating import TABLES, Rows

KEYS = [f"2023-51{number:04d}" for number in range(1, 61)]
WAREHOUSE = "warehouse.duckdb"
DOCUMENTS = ("crash_record", "map_report", "estimate", "simulation", "sampled", "verdict")
OF_CRASHES = {*DOCUMENTS, "standing", "outcome", "known_outcome", "failed_attempt", "artefact"}
OF_CRASHES |= {"listing"}  # what is read of the crashes that are read, and of no other


def anew(root: Path) -> dict[str, str]:
    """All tables of a warehouse for which everything is read."""
    (root / "cache" / "warehouse.json").unlink()
    build_warehouse(Storage(root), root)
    return result_tables(root / WAREHOUSE)


def read_again(root: Path, monkeypatch) -> set[str]:
    """The crashes that a build reads."""
    asked: set[str] = set()
    from trace_dag.warehouse import outcomes

    read = outcomes.read_records
    monkeypatch.setattr(
        outcomes, "read_records", lambda storage, keys, **more: asked.update(keys) or read(storage, keys, **more)
    )
    build_warehouse(Storage(root), root)
    monkeypatch.setattr(outcomes, "read_records", read)
    return asked


@pytest.mark.parametrize("table", TABLES)
def test_tables_of_what_is_read_of_crashes_are_updated_crash_by_crash(table):
    sql = resources.files("trace_dag.warehouse").joinpath("sql", f"{table}.sql").read_text()
    asked = set(re.findall(r"(?:FROM|JOIN) (\w+)", sql))
    assert bool(asked & OF_CRASHES) == (TABLES[table] is Rows.OF_ONE)


def test_reads_what_has_changed_and_ends_as_if_built_anew(tmp_path, monkeypatch):
    storage = made(tmp_path, KEYS)
    build_warehouse(storage, tmp_path)
    assert read_again(tmp_path, monkeypatch) == set()
    note(storage, KEYS[3], Stage.VERDICT, run=2, reason=Reason.WRONG_IMPACT)
    note(storage, KEYS[4], Stage.ROAD_MAP, run=2, error="the disk is full")
    Registry(storage).register("one", {"2023-520001": ReportSource("file", "/gone", "0")})
    Registry(storage).remove("one", only=[KEYS[5]])
    changed = {KEYS[3], KEYS[4], "2023-520001"}
    assert read_again(tmp_path, monkeypatch) == changed
    updated = result_tables(tmp_path / WAREHOUSE)
    with open_warehouse(tmp_path / WAREHOUSE) as connection:
        comments = connection.execute("SELECT count(*) FROM duckdb_columns() WHERE comment IS NULL").fetchone()
    assert updated == anew(tmp_path)
    with open_warehouse(tmp_path / WAREHOUSE) as connection:
        assert connection.execute("SELECT count(*) FROM duckdb_columns() WHERE comment IS NULL").fetchone() == comments
    assert check_warehouse(tmp_path / WAREHOUSE)


def test_is_built_anew_after_a_change_by_hand_or_of_many(tmp_path, monkeypatch):
    storage = made(tmp_path, KEYS)
    build_warehouse(storage, tmp_path)
    with (tmp_path / WAREHOUSE).open("ab") as warehouse:
        warehouse.write(b"more")
    assert read_again(tmp_path, monkeypatch) == set(KEYS)
    for key in KEYS[:7]:  # more than a tenth
        note(storage, key, Stage.VERDICT, run=2)
    assert read_again(tmp_path, monkeypatch) == set(KEYS)


def test_damaged_crashes_are_read_until_they_are_whole(tmp_path, monkeypatch, caplog):
    storage = made(tmp_path, KEYS)
    whole = storage.read(f"verdict/{KEYS[0]}.json")
    storage.write(f"verdict/{KEYS[0]}.json", whole[:-1])
    with caplog.at_level(logging.ERROR):
        assert build_warehouse(storage, tmp_path).incomplete_crashes == {KEYS[0]}
        assert build_warehouse(storage, tmp_path).incomplete_crashes == {KEYS[0]}
    storage.write(f"verdict/{KEYS[0]}.json", whole)
    assert read_again(tmp_path, monkeypatch) == {KEYS[0]}
    assert {
        row["key"]
        for row in rows(tmp_path / WAREHOUSE, "crashes")
        if row["final_state"] in ("verified", "first_event_only")
    } == set(KEYS)


def test_a_program_that_holds_the_warehouse_is_named(tmp_path):
    path = tmp_path / WAREHOUSE
    with duckdb.connect(str(path)) as connection:
        connection.execute("CREATE TABLE crashes AS SELECT 1")
    note_built(path, hashlib.sha256(path.read_bytes()).hexdigest())
    hold = f"import duckdb, sys; c = duckdb.connect({str(path)!r}); print('held', flush=True); sys.stdin.read()"
    holder = subprocess.Popen([sys.executable, "-c", hold], stdin=subprocess.PIPE, stdout=subprocess.PIPE)
    try:
        assert holder.stdout.readline() == b"held\n"
        with pytest.raises(Failure, match=rf"\(process {holder.pid}\) has it open to write; end it"):
            open_warehouse(path)
    finally:
        holder.communicate(b"")
    with open_warehouse(path) as reader:
        assert reader.execute("FROM crashes").fetchall() == [(1,)]
