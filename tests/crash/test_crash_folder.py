"""Reports found in folders: by content, one per crash, nothing lost."""

from __future__ import annotations

import gzip
from pathlib import Path

import pytest
from crash_reports import not_released, report

from trace_dag.common.errors import UserError
from trace_dag.crash.folder import scan
from trace_dag.crash.xml_input import MAX_REPORT_BYTES


def test_every_real_file_gets_its_key_malformed_or_not(shared_data: Path) -> None:
    folder = shared_data / "va-2023" / "reports"
    found = scan([folder])
    assert {entry.key: entry.path.name for entry in found.reports} == {
        f"2023-{path.stem.removeprefix('crash_')}": path.name for path in folder.glob("*.xml")
    }
    assert (found.duplicates, found.conflicts, found.unrecognised) == ((), (), ())
    assert [entry.key for entry in found.reports] == sorted(entry.key for entry in found.reports)


def test_names_and_places_do_not_matter(tmp_path: Path) -> None:
    deep = tmp_path / "a" / "b"
    deep.mkdir(parents=True)
    (deep / "holiday.jpg").write_bytes(report())
    (tmp_path / "crash_519002.xml").write_text("hello")
    (tmp_path / "page.xml").write_text("<html><body>no</body></html>")
    (tmp_path / "empty.xml").write_text("")
    found = scan([tmp_path])
    assert [(entry.key, entry.path.name) for entry in found.reports] == [("2023-519001", "holiday.jpg")]
    assert {entry.path.name: entry.why for entry in found.unrecognised} == {
        "crash_519002.xml": "it is not XML",
        "page.xml": "it names no crash",
        "empty.xml": "it is empty",
    }


def test_identical_reports_are_merged(tmp_path: Path) -> None:
    (tmp_path / "a.xml").write_bytes(report())
    (tmp_path / "b.xml").write_bytes(report())
    (tmp_path / "indented.xml").write_bytes(report().replace(b"><", b">\n  <"))
    found = scan([tmp_path])
    assert [entry.path.name for entry in found.reports] == ["a.xml"]
    assert [(entry.kept.name, entry.path.name) for entry in found.duplicates] == [
        ("a.xml", "b.xml"),
        ("a.xml", "indented.xml"),
    ]
    assert found.conflicts == ()


def test_differing_reports_of_one_crash_are_reported(tmp_path: Path) -> None:
    (tmp_path / "a.xml").write_bytes(report())
    (tmp_path / "b.xml").write_bytes(report({"FATALS": 2}))
    found = scan([tmp_path])
    assert [entry.path.name for entry in found.reports] == ["a.xml"]
    assert [entry.path.name for entry in found.conflicts] == ["b.xml"]


def test_a_well_formed_report_goes_before_a_broken_one(tmp_path: Path) -> None:
    (tmp_path / "a.xml").write_bytes(report()[:-100])
    (tmp_path / "b.xml").write_bytes(report())
    found = scan([tmp_path])
    assert [entry.path.name for entry in found.reports] == ["b.xml"]
    assert [entry.path.name for entry in found.conflicts] == ["a.xml"]


def test_the_same_folder_twice_is_searched_once(tmp_path: Path) -> None:
    (tmp_path / "a.xml").write_bytes(report())
    found = scan([tmp_path, tmp_path, tmp_path / "a.xml"])
    assert len(found.reports) == 1
    assert found.duplicates == ()


def test_a_case_that_is_not_released_is_registered_as_that(tmp_path: Path) -> None:
    (tmp_path / "a.xml").write_bytes(not_released(519007))
    entry = scan([tmp_path]).reports[0]
    assert (entry.key, entry.released) == ("2023-519007", False)


def test_a_released_report_supersedes_the_answer_before_it(tmp_path: Path) -> None:
    (tmp_path / "a.xml").write_bytes(not_released())
    (tmp_path / "b.xml").write_bytes(report())
    found = scan([tmp_path])
    assert [(entry.path.name, entry.released) for entry in found.reports] == [("b.xml", True)]
    assert not found.conflicts


def test_large_files_are_not_read(tmp_path: Path) -> None:
    (tmp_path / "a.xml").write_bytes(report())
    with (tmp_path / "huge.xml").open("wb") as file:
        file.truncate(MAX_REPORT_BYTES + 1)
    assert "MB" in scan([tmp_path]).unrecognised[0].why


@pytest.mark.parametrize("case", ["../../etc/passwd", "519001/../../x", "519001%2e%2e", "٥١٩٠٠١", "-519001", "5190011"])
def test_keys_are_two_numbers_in_any_file(case: str, tmp_path: Path) -> None:
    (tmp_path / "good.xml").write_bytes(report())
    (tmp_path / "evil.xml").write_bytes(report({"ST_CASE": case}))
    found = scan([tmp_path])
    assert [entry.key for entry in found.reports] == ["2023-519001"]
    assert [entry.path.name for entry in found.unrecognised] == ["evil.xml"]


def test_a_path_that_is_not_there_is_one_line(tmp_path: Path) -> None:
    with pytest.raises(UserError, match="does not exist"):
        scan([tmp_path / "nowhere"])


def test_a_compressed_report_is_named_as_that(tmp_path: Path) -> None:
    (tmp_path / "crash.xml.gz").write_bytes(gzip.compress(report()))
    found = scan([tmp_path])
    assert not found.reports
    assert [each.why for each in found.unrecognised] == ["it is compressed; unpack it"]
