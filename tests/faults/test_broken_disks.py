"""Disks that are full, files that cannot be read, databases of Dagster that are garbage: a line with what helps."""

from __future__ import annotations

import errno
import shutil
import sqlite3
from collections.abc import Iterator
from pathlib import Path

import duckdb
import pytest
from sample_runs import trace_dag
from sqlalchemy import event
from sqlalchemy.engine import Engine

from trace_dag.common.errors import DamagedFile
from trace_dag.common.storage.disk_errors import disk_failure
from trace_dag.common.storage.files import Storage
from trace_dag.flow.cohorts.registry import Registry

KEY = "2023-319003"
SPACE = "free some space and run again"


def said(root: Path, *arguments: str) -> str:
    """The one line that a command ends with which failed."""
    done = trace_dag(root, *arguments)
    assert done.returncode == 1, done.stdout
    (line,) = [line for line in done.stderr.splitlines() if line.startswith("trace-dag: failed: ")]
    assert "Traceback" not in done.stderr
    return line


# --- what libraries raise ---------------------------------------------------------------------------------------------
def test_a_full_disk_below_sqlite_duckdb_and_python_is_the_same_failure(tmp_path: Path) -> None:
    with sqlite3.connect(tmp_path / "small.db") as small:
        small.execute("PRAGMA max_page_count = 2")
        with pytest.raises(sqlite3.OperationalError) as full:
            small.execute("CREATE TABLE one AS SELECT randomblob(100000)")
    assert str(disk_failure(full.value, "runs.db")) == f"runs.db: no space left on its disk; {SPACE}"
    with duckdb.connect() as connection, pytest.raises(duckdb.Error) as copied:
        connection.execute("COPY (SELECT range FROM range(1000000)) TO '/dev/full' (FORMAT csv)")
    assert str(disk_failure(copied.value)).endswith(SPACE)
    with pytest.raises(OSError, match="No space") as written:
        Path("/dev/full").write_bytes(b"0")
    assert str(disk_failure(written.value)).endswith(SPACE)
    assert disk_failure(ValueError("no disk behind it")) is None


def test_the_disk_is_found_behind_what_it_caused() -> None:
    step = RuntimeError("a step failed")
    step.__cause__ = OSError(errno.EROFS, "Read-only file system", "/data/x")
    assert str(disk_failure(step)) == "/data/x: Read-only file system; make it writable, or choose another folder"


# --- commands ---------------------------------------------------------------------------------------------------------
def test_a_replay_that_does_not_fit_is_reported_in_a_line(root: Path) -> None:
    assert f"/dev/full: No space left on device; {SPACE}" in said(
        root, "replay", KEY, "--format", "html", "--output", "/dev/full"
    )


@pytest.fixture
def dagster_cannot_grow() -> Iterator[None]:
    """SQLite answers as on a full disk as soon as a database needs one more page."""

    def no_more(connection: sqlite3.Connection, _: object) -> None:
        connection.execute("PRAGMA max_page_count = 1")  # SQLite takes the pages that there are

    event.listen(Engine, "connect", no_more)
    yield
    event.remove(Engine, "connect", no_more)


@pytest.mark.usefixtures("dagster_cannot_grow")
def test_no_space_for_dagster_is_not_called_damage(root: Path) -> None:
    line = said(root, "run", "--from", "crash_record")
    assert f"{root}/dagster: no space left on its disk; {SPACE}" in line


def test_a_removal_that_broke_off_is_finished_by_the_same_command(root: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    def full(*_: object) -> None:
        raise OSError(errno.ENOSPC, "No space left on device")

    with monkeypatch.context() as patched:
        patched.setattr("trace_dag.assets.run_requests.remove_partitions", full)
        assert SPACE in said(root, "cohort", "remove", "sample")
    assert list(Registry(Storage(root)).cohorts()) == ["sample"]
    done = trace_dag(root, "cohort", "remove", "sample")
    assert done.returncode == 0, done.stderr
    assert Registry(Storage(root)).cohorts() == {}


DATABASES = ["history/runs.db", "history/runs/index.db", "schedules/schedules.db"]


OVERWRITTEN, CUT, EMPTY = (lambda _: b"\x9c" * 20_000), (lambda data: data[: len(data) // 3]), (lambda _: b"")


@pytest.mark.parametrize(
    ("database", "damage"),
    [*((each, damage) for each in DATABASES for damage in (OVERWRITTEN, CUT)), ("history/runs/index.db", EMPTY)],
)
def test_a_damaged_database_of_dagster_is_a_line_whose_remedy_works(root: Path, database: str, damage) -> None:
    path = root / "dagster" / database
    path.write_bytes(damage(path.read_bytes()))
    done = trace_dag(root, "verify")
    assert "Traceback" not in done.stderr
    assert f"{root}/dagster: damaged" in done.stderr
    assert "delete that folder; trace-dag verify --repair tells Dagster anew" in done.stderr
    shutil.rmtree(root / "dagster")
    assert trace_dag(root, "verify", "--repair").returncode == 0
    assert trace_dag(root, "verify").returncode == 0


@pytest.mark.parametrize("database", ["history/runs.db", "schedules/schedules.db"])
def test_an_empty_database_of_dagster_is_filled_again(root: Path, database: str) -> None:
    (root / "dagster" / database).write_bytes(b"")  # a database in which Dagster makes its tables
    assert trace_dag(root, "verify", "--repair").returncode == 0
    assert trace_dag(root, "verify").returncode == 0


# --- one file that cannot be read -------------------------------------------------------------------------------------
def circle(path: Path) -> None:
    """In place of a file a link to itself, which nobody can read, whoever asks."""
    path.unlink()
    path.symlink_to(path.name)


def test_a_record_that_cannot_be_read_costs_its_crash(root: Path, caplog: pytest.LogCaptureFixture) -> None:
    circle(root / f"verdict/{KEY}.outcome.json")
    done = trace_dag(root, "status")
    assert done.returncode == 0, done.stderr
    assert f"verdict/{KEY}.outcome.json: damaged: it cannot be read (Too many levels" in caplog.text
    assert "trace-dag run makes it again" in caplog.text
    assert trace_dag(root, "verify").returncode == 1
    assert trace_dag(root, "run").returncode == 0
    assert trace_dag(root, "verify", "--contents").returncode == 0


def test_an_artefact_that_cannot_be_read_is_found_and_mended(root: Path) -> None:
    circle(root / f"road_map/{KEY}.xodr")
    (found,) = [line for line in trace_dag(root, "verify", "--contents").stdout.splitlines() if KEY in line][:1]
    assert "road_map" in found
    assert trace_dag(root, "run").returncode == 0
    assert trace_dag(root, "verify", "--contents").returncode == 0


def test_a_list_of_crashes_that_cannot_be_read_is_never_an_empty_one(root: Path) -> None:
    cohort = root / "cohorts/sample.parquet"
    storage = Storage(root)
    whole = storage.read_many([f"cohorts/{cohort.name}"])
    assert whole
    circle(cohort)
    with pytest.raises(DamagedFile, match="it cannot be read"):
        storage.read_many([f"cohorts/{cohort.name}"])
