"""The storage root, locally and on fsspec's memory file system in place of an object store."""

from __future__ import annotations

import hashlib
import os
import pickle
import string
import subprocess
import sys
from pathlib import Path

import fsspec
import pytest
from hypothesis import given
from hypothesis import strategies as st
from loopback import Answer, serving

from trace_dag.common.errors import Failure, TransientFailure, UserError
from trace_dag.common.processes import this_process
from trace_dag.common.storage.files import Storage, check_name


@pytest.fixture(params=["local", "memory"])
def storage(request, tmp_path: Path) -> Storage:
    if request.param == "local":
        return Storage.open(tmp_path / "root")
    fsspec.filesystem("memory").store.clear()
    return Storage.open("memory://bucket/root")


def test_written_values_are_read_back_and_described(storage):
    stored = storage.write("road_map/2023-1.xodr", b"<OpenDRIVE/>")
    assert storage.read(stored.name) == b"<OpenDRIVE/>"
    assert (stored.size, stored.sha256) == (12, hashlib.sha256(b"<OpenDRIVE/>").hexdigest())
    assert storage.sizes([stored.name, "road_map/none.xodr"]) == {stored.name: 12}
    assert storage.exists(stored.name)


def test_listing_distinguishes_replaced_files_from_unchanged_ones(storage):
    storage.write("verdict/a.json", b"1")
    storage.write("verdict/b.json", b"22")
    before = storage.list("verdict")
    assert {name: entry.size for name, entry in before.items()} == {"verdict/a.json": 1, "verdict/b.json": 2}
    storage.write("verdict/a.json", b"9")
    after = storage.list("verdict")
    assert after["verdict/a.json"].version != before["verdict/a.json"].version
    assert after["verdict/b.json"] == before["verdict/b.json"]
    assert storage.list("nothing_here") == {}


def test_many_are_read_at_once_and_absent_ones_left_out(storage):
    names = [f"crash_record/{number}.parquet" for number in range(5)]
    for name in names:
        storage.write(name, name.encode())
    assert storage.read_many([*names, "crash_record/none.parquet"]) == {name: name.encode() for name in names}


def test_deleting_and_reading_what_is_not_there(storage):
    storage.write("a/b.txt", b"x")
    storage.delete("a/b.txt")
    storage.delete("a/b.txt")
    with pytest.raises(FileNotFoundError):
        storage.read("a/b.txt")


def test_travels_to_another_process(storage):
    storage.write("a/b.txt", b"x")
    assert pickle.loads(pickle.dumps(storage)).read("a/b.txt") == b"x"


@pytest.mark.parametrize(
    "name",
    ["", "/etc/passwd", "../x", "a/../../x", "a//b", ".hidden", "a/.hidden", "-rf", "a/b c", "a\\b", "a\n", "a/"],
)
def test_names_that_lead_elsewhere_are_refused(storage, name):
    with pytest.raises(ValueError, match="unsafe name"):
        storage.write(name, b"")


@given(st.text(alphabet=string.ascii_letters + string.digits + "./\\-_ ~$\x00é", max_size=30))
def test_no_name_leads_out_of_the_root(name):
    try:
        check_name(name)
    except ValueError:
        return
    root = Path("/storage")
    inside = Path(os.path.normpath(root / name))
    assert root in inside.parents


def test_failed_write_leaves_the_old_file_and_nothing_else(tmp_path, monkeypatch):
    storage = Storage.open(tmp_path)
    storage.write("a/b.txt", b"old")

    def full(self: Path, target: Path) -> Path:
        raise OSError(28, "No space left on device")

    monkeypatch.setattr(Path, "replace", full)
    with pytest.raises(Failure, match="free some space"):
        storage.write("a/b.txt", b"new")
    assert storage.read("a/b.txt") == b"old"
    assert [path.name for path in (tmp_path / "a").iterdir()] == ["b.txt"]


def test_leftovers_of_a_killed_writer_differ_from_files_being_written(tmp_path):
    storage = Storage.open(tmp_path)
    storage.write("a/b.txt", b"x")
    writes = "import os, sys; from trace_dag.common.storage import files; files.os.fdopen = lambda *_: os._exit(1)"
    subprocess.run([sys.executable, "-c", f"{writes}; files.Storage({str(tmp_path)!r}).write('a/c.txt', b'y')"])
    (left,) = storage.leftovers("a")
    being_written = left.with_name(f".writing-{this_process()}:abc")
    elsewhere = left.with_name(".writing-another-machine:12:34:abc")
    for file in (being_written, elsewhere):
        file.write_bytes(b"half")
    assert list(storage.list("a")) == ["a/b.txt"]
    assert storage.remove_leftovers("a") == 1
    assert not left.exists()
    os.utime(elsewhere, (0, 0))
    assert storage.leftovers("a") == (elsewhere,)


def test_unusable_roots_are_one_line_errors(tmp_path):
    (tmp_path / "file").write_text("")
    for root in (tmp_path / "file" / "below", "nosuchprotocol://x"):
        with pytest.raises(UserError, match="cannot read and write"):
            Storage.open(root)


class _Flaky:
    """An object store that fails a few times before it answers."""

    def __init__(self, failures: int) -> None:
        self.failures = failures

    def cat_file(self, path: str) -> bytes:
        if self.failures:
            self.failures -= 1
            raise OSError("503 Slow Down")
        return b"here"


def test_object_store_errors_are_waited_out_but_not_for_ever(monkeypatch):
    monkeypatch.setattr("time.sleep", lambda _: None)
    storage = Storage("memory://bucket")
    storage.__dict__["_filesystem"] = _Flaky(2)
    assert storage.read("a/b") == b"here"
    storage.__dict__["_filesystem"] = _Flaky(99)
    with pytest.raises(TransientFailure, match="after 4 attempts"):
        storage.read("a/b")


def test_a_file_of_an_object_store_is_read_with_one_request():
    pytest.importorskip("s3fs")
    with serving(lambda request, _: Answer(b"content of " + request.path.encode())) as server:
        storage = Storage("s3://bucket/stored", {"endpoint_url": server.url, "key": "test", "secret": "test"})
        assert storage.read("a/b") == b"content of /bucket/stored/a/b"
    assert [(request.method, request.path) for request in server.requests] == [("GET", "/bucket/stored/a/b")]
