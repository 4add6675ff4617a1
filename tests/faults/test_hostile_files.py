"""Files no real source would give: names, sizes, damage. Each costs itself, and is named with what helps."""

from __future__ import annotations

import errno
import json
import os
import shlex
import shutil
from html import escape
from pathlib import Path

import pytest
from sample_runs import SAMPLE, finished, ingest, reports_of, trace_dag

from trace_dag.common.errors import Reason, Rejection
from trace_dag.common.settings import CrashSettings
from trace_dag.common.storage.files import writable_folder
from trace_dag.crash.parse import read_report
from trace_dag.reading.opening import open_place

KEY = "2023-319003"  # in the town of merrow.osm


def test_a_file_name_that_is_not_utf8_is_left_aside_and_the_others_registered(tmp_path: Path):
    folder = reports_of(tmp_path / "reports", (KEY,))
    other = (SAMPLE / "reports" / "crash_319024.xml").read_bytes()
    Path(os.fsdecode(os.fsencode(folder) + b"/crash_\xff.xml")).write_bytes(other)
    done = ingest(tmp_path / "root", folder)
    assert done.returncode == 0, done.stderr
    assert "1 crash registered" in done.stdout
    assert r"crash_\xff.xml: its name is not UTF-8" in done.stdout


REPORT = (SAMPLE / "reports" / "crash_319003.xml").read_text()
EVENT = REPORT[REPORT.index("<CEvent>") : REPORT.index("</CEvent>") + len("</CEvent>")]


@pytest.mark.parametrize(
    ("report", "said"),
    [
        (REPORT.replace(EVENT, EVENT * 3_000, 1), "CEvents has 3000 entries; expected 2000 at most"),
        (REPORT.replace("<TWAY_ID>", "<TWAY_ID>" + "A" * 1_600_000), "TWAY_ID has 16000"),
        (REPORT.replace("<MAK_MODNAME>", "<MAK_MODNAME>" + escape("<b>") * 1_000, 1), "expected 2000 at most"),
    ],
    ids=["events", "street name", "make"],
)
def test_sizes_no_report_has_are_refused_in_a_sentence(report: str, said: str):
    with pytest.raises(Rejection) as raised:
        read_report(report.encode(), name="big.xml", settings=CrashSettings())
    assert raised.value.reason is Reason.MALFORMED_REPORT
    assert said in raised.value.detail
    assert len(raised.value.detail) < 300


@pytest.fixture
def town(tmp_path: Path) -> Path:
    """A folder of two maps; each covers one of two crashes."""
    (tmp_path / "osm").mkdir()
    for name in ("merrow.osm", "quill.osm"):
        shutil.copy(SAMPLE / "osm" / name, tmp_path / "osm" / name)
    return tmp_path / "osm"


def damaged(content: bytes) -> bytes:
    """As long as it was, and its first half comes twice."""
    half = len(content) // 2
    return content[:half] + content[: len(content) - half]


def test_a_damaged_map_costs_the_crashes_it_covers_and_its_remedies_work(tmp_path: Path, town: Path):
    root, reports = tmp_path / "root", reports_of(tmp_path / "reports", (KEY,))
    arguments = ("ingest", "--reports", str(reports), "--cohort", "town", "--maps")
    assert trace_dag(root, *arguments, str(town)).returncode == 0
    whole = (town / "quill.osm").read_bytes()
    (town / "quill.osm").write_bytes(damaged(whole))
    assert trace_dag(root, "run").returncode == 0, "the other map covers it"

    whole = (town / "merrow.osm").read_bytes()
    (town / "merrow.osm").write_bytes(damaged(whole))
    done = trace_dag(root, "run", "--from", "osm_extract")
    assert done.returncode == 1
    assert "Traceback" not in done.stderr
    detail = trace_dag(root, "sql", "SELECT message FROM failures", "--format", "json").stdout
    (failure,) = json.loads(detail)
    assert str(town / "merrow.osm") in failure["message"]

    refused = trace_dag(root, *arguments, str(town / "merrow.osm"))
    assert refused.returncode == 2
    assert "cannot be read as OSM data" in refused.stderr
    assert len(refused.stderr.splitlines()) == 1

    said = failure["message"].rpartition("trace-dag ")[2]
    assert said == f"cohort maps --drop {town / 'merrow.osm'}"
    remedy = shlex.split(said.replace("merrow", "quill"))
    done = trace_dag(root, *remedy)
    assert done.returncode == 0, done.stderr
    assert "quill.osm" not in trace_dag(root, "cohort", "maps").stdout
    again = trace_dag(root, *remedy)
    assert again.returncode == 2
    assert "no such map file is registered" in again.stderr

    (town / "merrow.osm").write_bytes(whole)
    assert trace_dag(root, *arguments, str(town / "merrow.osm")).returncode == 0
    done = trace_dag(root, "run")
    assert done.returncode == 0, done.stderr


def test_a_map_file_that_was_replaced_is_not_taken_for_the_one_that_was_ingested(tmp_path: Path, town: Path):
    root, reports = tmp_path / "root", reports_of(tmp_path / "reports", (KEY,))
    file = town / "merrow.osm"
    arguments = ("ingest", "--cohort", "town", "--maps", str(file))
    assert trace_dag(root, *arguments, "--reports", str(reports)).returncode == 0
    size = file.stat().st_size
    file.write_bytes(file.read_bytes() + b"\n")
    assert trace_dag(root, "run").returncode == 1
    (failure,) = json.loads(trace_dag(root, "sql", "SELECT message FROM failures", "--format", "json").stdout)
    assert f"it has {size + 1:,} bytes, and had {size:,}" in failure["message"]
    assert trace_dag(root, *arguments).returncode == 0
    done = trace_dag(root, "run")
    assert done.returncode == 0, done.stderr


def test_links_and_pipes_in_an_inbox_are_passed_over_and_what_links_lead_to_is_read_once(tmp_path: Path):
    folder = reports_of(tmp_path / "reports", (KEY,))
    (report,) = folder.iterdir()
    (folder / "again.xml").symlink_to(report)
    (folder / "nowhere.xml").symlink_to("/nowhere")
    (folder / "circle.xml").symlink_to("circle.xml")
    (folder / "itself").symlink_to(".")
    (folder / "endless.xml").symlink_to("/dev/zero")
    (folder / "folder.xml").mkdir()
    (folder / "secret.xml").symlink_to("/etc/passwd")
    os.mkfifo(folder / "pipe.xml")
    done = ingest(tmp_path / "root", folder)
    assert done.returncode == 0, done.stderr
    assert "1 crash registered" in done.stdout
    assert "secret.xml: it is not XML" in done.stdout
    assert "root:" not in done.stdout


@pytest.fixture
def read_only(monkeypatch: pytest.MonkeyPatch) -> Path:
    """A root with crashes that have been run, and every disk as if it could only be read."""
    root = finished()

    def refused(*_: object, **__: object) -> None:
        raise OSError(errno.EROFS, "Read-only file system")

    monkeypatch.setattr("trace_dag.common.storage.files.tempfile.TemporaryFile", refused)
    monkeypatch.setattr("trace_dag.common.storage.files.Storage.write", refused)
    allowed = os.access
    monkeypatch.setattr(os, "access", lambda path, mode: mode != os.W_OK and allowed(path, mode))
    return root


@pytest.mark.parametrize("command", [("run",), ("verify", "--repair"), ("ui",)])
def test_writing_commands_refuse_a_read_only_root_in_a_line(read_only: Path, command: tuple[str, ...]):
    done = trace_dag(read_only, *command)
    assert done.returncode == 2
    (line,) = done.stderr.splitlines()
    assert "cannot read and write there" in line
    assert "copy it, or choose another with --root" in line


@pytest.mark.parametrize(
    "command",
    [
        *(("status",), ("sql", "FROM verdicts"), ("tables",), ("show", KEY), ("cohort", "list"), ("settings",)),
        ("verify",),
    ],
)
def test_reading_commands_work_on_a_read_only_root(read_only: Path, command: tuple[str, ...]):
    done = trace_dag(read_only, *command)
    assert done.returncode == 0, done.stderr
    assert done.stdout


def test_dagsters_records_of_a_root_that_can_only_be_read_are_looked_at_in_a_copy(
    read_only: Path, monkeypatch: pytest.MonkeyPatch
):
    """SQLite writes beside its databases even to read them."""
    started = []
    monkeypatch.setattr(os, "execv", lambda program, words: started.append(words))
    before = {path: path.stat().st_mtime_ns for path in (read_only / "dagster").rglob("*")}
    done = trace_dag(read_only, "ui", "--read-only", "--port", "39473")
    assert done.returncode == 0, done.stderr
    assert [words[-1] for words in started] == ["read-only"]
    assert {path: path.stat().st_mtime_ns for path in (read_only / "dagster").rglob("*")} == before
    with writable_folder(read_only / "dagster") as copy:
        assert copy != read_only / "dagster"
        assert {path.name for path in copy.iterdir()} == {path.name for path in (read_only / "dagster").iterdir()}
    assert not copy.exists()


def test_python_opens_a_root_that_can_only_be_read(read_only: Path):
    assert KEY in open_place(read_only)
