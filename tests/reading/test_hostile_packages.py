"""Packages that were made to do harm are refused in one line, before anything of them is parsed."""

from __future__ import annotations

import gzip
import hashlib
import io
import json
import tarfile
import time
import zipfile
from collections.abc import Callable
from pathlib import Path

import pytest
import sample_runs

import trace_dag
from trace_dag.common.errors import DamagedFile, Failure, UserError

KEY = "2023-319003"
DEEP = b"[" * 200_000 + b"]" * 200_000


@pytest.fixture(scope="module")
def whole() -> dict[str, bytes]:
    """The files of a package of the sample."""
    with zipfile.ZipFile(sample_runs.finished() / "benchmark" / "packages" / f"{KEY}.zip") as archive:
        return {name.partition("/")[2]: archive.read(name) for name in archive.namelist()}


def package(folder: Path, files: dict[str, bytes]) -> Path:
    """A package of these files, with what its manifest says of them made right."""
    manifest = json.loads(files["manifest.json"])
    for name in manifest["files"]:
        manifest["files"][name]["sha256"] = hashlib.sha256(files[name]).hexdigest()
    return zipped(folder, files | {"manifest.json": json.dumps(manifest).encode()})


def zipped(folder: Path, files: dict[str, bytes]) -> Path:
    with zipfile.ZipFile(folder / "package.zip", "w", zipfile.ZIP_DEFLATED) as archive:
        for name, data in files.items():
            archive.writestr(f"{KEY}/{name}", data)
    return folder / "package.zip"


def line(call: Callable[[], object]) -> str:
    """What is said of it: one line, soon."""
    began_s = time.process_time()
    with pytest.raises((Failure, UserError)) as raised:
        call()
    assert time.process_time() - began_s < 20
    said = str(raised.value)
    assert "\n" not in said
    assert len(said) < 600
    return said


def test_a_manifest_that_unpacks_to_a_gigabyte_is_not_unpacked(tmp_path: Path) -> None:
    path = tmp_path / "bomb.zip"
    with zipfile.ZipFile(path, "w", zipfile.ZIP_DEFLATED) as archive, archive.open(f"{KEY}/manifest.json", "w") as file:
        for _ in range(100):
            file.write(b" " * 1_000_000)
    assert "has 100 MB, at most 64 are read" in line(lambda: trace_dag.open(path))


def test_a_packed_tar_with_a_huge_member_is_not_unpacked(tmp_path: Path) -> None:
    path = tmp_path / "bomb.tar.gz"
    with tarfile.open(path, "w:gz") as archive:
        member = tarfile.TarInfo(f"{KEY}/padding")
        member.size = 100_000_000
        archive.addfile(member, io.BytesIO(bytes(member.size)))
    assert "padding: damaged: has 100 MB" in line(lambda: trace_dag.open(path))


@pytest.mark.parametrize(
    ("manifest", "said"),
    [
        (b'{"key": "2023-319003", "files": ' + DEEP + b"}", "nested 200,001 deep"),
        (b'{"key": "2023-319003", "files": {"map.osm": 7}}', "not a manifest of a package"),
        (b'{"key": "2023-319003", "files": {"map.osm": {"sha256": [1]}}}', "files.map.osm.sha256"),
        (b'{"key": "2023-319003", "files": []}', "not a manifest of a package"),
        (b'{"key": "<img src=x onerror=alert(1)/>/../../etc", "files": {}}', "not a crash key"),
        (b"[]", "not a manifest of a package"),
        (b"\xff\x00", "not a manifest of a package"),
    ],
)
def test_a_manifest_of_a_wrong_form_is_refused(tmp_path: Path, manifest: bytes, said: str) -> None:
    path = zipped(tmp_path, {"manifest.json": manifest})
    assert said in line(lambda: trace_dag.open(path).only.record)


@pytest.mark.parametrize("kind", [tarfile.FIFOTYPE, tarfile.DIRTYPE, tarfile.CHRTYPE, tarfile.SYMTYPE, tarfile.LNKTYPE])
def test_a_member_that_is_no_file_is_none(tmp_path: Path, kind: bytes) -> None:
    with tarfile.open(tmp_path / "package.tar", "w") as archive:
        member = tarfile.TarInfo(f"{KEY}/manifest.json")
        member.type, member.linkname = kind, "/dev/zero"
        archive.addfile(member)
    said = "an archive without manifest.json" if kind == tarfile.DIRTYPE else "no plain file"
    assert said in line(lambda: trace_dag.open(tmp_path / "package.tar"))


def test_a_size_that_the_directory_of_a_zip_hides_is_counted(tmp_path: Path) -> None:
    place = tmp_path / "package.zip"
    with zipfile.ZipFile(place, "w", zipfile.ZIP_DEFLATED) as archive:
        archive.writestr("package/manifest.json", bytes(70_000_000))
    written = place.read_bytes()
    place.write_bytes(written.replace((70_000_000).to_bytes(4, "little"), (1000).to_bytes(4, "little")))
    assert "manifest.json: damaged: " in line(lambda: trace_dag.open(place).only.record)


def test_lists_without_number_are_refused_before_they_are_made(tmp_path: Path) -> None:
    many = b'{"key": "2023-319003", "files": {}, "x": [' + b",".join([b"[]"] * 1_500_000) + b"]}"
    said = line(lambda: trace_dag.open(zipped(tmp_path, {"manifest.json": many})).only.record)
    assert "at most 2,000,000 are read" in said


@pytest.mark.parametrize("packed", [zipfile.ZIP_BZIP2, zipfile.ZIP_LZMA])
def test_ways_to_pack_that_cannot_be_bounded_are_refused(tmp_path: Path, packed: int) -> None:
    with zipfile.ZipFile(tmp_path / "package.zip", "w", packed) as archive:
        archive.writestr("package/manifest.json", b"{}")
    assert "stored or deflated" in line(lambda: trace_dag.open(tmp_path / "package.zip"))


def test_a_name_of_a_gigabyte_in_a_packed_tar_is_not_unpacked(tmp_path: Path) -> None:
    header = tarfile.TarInfo("././@LongLink")
    header.type, header.size = tarfile.GNUTYPE_LONGNAME, 1_000_000_000
    with gzip.open(tmp_path / "release.tar.gz", "wb") as file:
        file.write(header.tobuf(tarfile.GNU_FORMAT))
        file.write(bytes(1_000_000))
    assert "has 1,000 MB, at most 64 are read" in line(lambda: trace_dag.open(tmp_path / "release.tar.gz"))


def test_holes_in_place_of_data_are_refused(tmp_path: Path) -> None:
    with tarfile.open(tmp_path / "release.tar", "w", format=tarfile.PAX_FORMAT) as archive:
        member = tarfile.TarInfo("release/index.parquet")
        member.pax_headers = {"GNU.sparse.size": "1000000000", "GNU.sparse.numblocks": "0", "GNU.sparse.map": "0,0"}
        archive.addfile(member)
    assert "no plain file" in line(lambda: trace_dag.open(tmp_path / "release.tar"))


@pytest.mark.parametrize("report", [b"[]", b"null", b"{}", b'{"placement": 7}', b"7", DEEP, b"{", b"\xff"])
def test_a_map_report_of_any_wrong_form_is_refused(tmp_path: Path, whole: dict[str, bytes], report: bytes) -> None:
    path = package(tmp_path, whole | {"map_report.json": report})
    assert "map_report.json: " in line(lambda: trace_dag.open(path).only.map_report)


def test_trajectories_nested_without_end_are_refused(tmp_path: Path, whole: dict[str, bytes]) -> None:
    path = package(tmp_path, whole | {"trajectories.json": b'{"run": ' + DEEP + b"}"})
    assert "trajectories.json: damaged: JSON that is nested" in line(lambda: trace_dag.open(path).only.log)


@pytest.mark.parametrize("number", [b"NaN", b"-Infinity", b"1e999"])
def test_intervals_without_numbers_are_refused_on_replay(
    tmp_path: Path, whole: dict[str, bytes], number: bytes
) -> None:
    document = json.loads(whole["intervals.json"])
    document["effective"] = "here"
    data = json.dumps(document).encode().replace(b'"here"', number)
    crash = trace_dag.open(package(tmp_path, whole | {"intervals.json": data})).only
    assert "in place of a number" in line(lambda: crash.replay())


def test_text_in_a_package_may_look_like_nesting(tmp_path: Path, whole: dict[str, bytes]) -> None:
    manifest = json.loads(whole["manifest.json"])
    manifest["made_by"] = "[{" * 1000 + "NaN"
    path = package(tmp_path, whole | {"manifest.json": json.dumps(manifest).encode()})
    assert trace_dag.open(path).only.verdict.accepted
    with pytest.raises(DamagedFile):
        _ = trace_dag.open(zipped(tmp_path, {"manifest.json": b"{}"})).only.record
