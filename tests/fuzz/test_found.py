"""Inputs that fuzzing found, as small as they went."""

from __future__ import annotations

import json
import zipfile
from pathlib import Path

import pytest

from tests.cases import SAMPLE
from tests.fuzz.targets import pbf
from tests.verdict.crashes import STREET
from trace_dag.agents.evaluation.agent_protocol import answer_from_bytes
from trace_dag.agents.evaluation.agents import AgentFault
from trace_dag.common.errors import DamagedFile, UserError
from trace_dag.common.settings import OsmSettings
from trace_dag.common.settings_sources import load_settings
from trace_dag.crash.fars.csv_tables import FarsCsvSource
from trace_dag.language.answer import SegmentsAnswer, WrongAnswer, parse
from trace_dag.osm.extraction import UnreadableMapError, read_around, read_header
from trace_dag.osm.map_check import MapChecker
from trace_dag.reading.packed import ArchiveFiles
from trace_dag.roads.map.reader import read_opendrive
from trace_dag.roads.map.writer import write_opendrive


def test_a_number_of_thousands_of_digits_is_no_setting() -> None:
    with pytest.raises(UserError, match=r"settings.toml: not TOML"):
        load_settings(b"[osm]\nradius_m = " + 5000 * b"9")


@pytest.mark.parametrize("text", [2000 * "[", 2000 * "[" + json.dumps({"vehicles": []})])
def test_an_answer_nested_without_end_is_no_answer(text: str) -> None:
    with pytest.raises(WrongAnswer):
        parse(text, SegmentsAnswer)


def test_an_agent_that_fails_in_silence_is_reported_as_failed() -> None:
    with pytest.raises(AgentFault, match="did not say why"):
        answer_from_bytes(b'{"fault": {"what": ""}}')


@pytest.mark.parametrize("key", [b"\xff\xff\xff\xff", b"nam\xe2"], ids=["no text", "cut off"])
def test_a_map_with_text_that_is_none_is_refused(tmp_path: Path, key: bytes) -> None:
    whole = pbf((SAMPLE / "osm" / "quill.osm").read_bytes())
    path = tmp_path / "map.osm.pbf"
    path.write_bytes(whole.replace(b"name", key))
    assert path.read_bytes() != whole
    with MapChecker() as checker, pytest.raises(UnreadableMapError, match="cannot be read as OSM data"):
        checker.check(path)


def test_a_map_that_ends_the_process_that_reads_it_ends_no_other(tmp_path: Path) -> None:
    """A zero byte within a key or a value leaves libosmium with one text too few, and it reads on for the next."""
    whole = pbf((SAMPLE / "osm" / "quill.osm").read_bytes())
    for name, data in (
        ("key", whole.replace(b"highway", b"h\0ghway")),
        ("value", whole.replace(b"residential", b"reside\0tial")),
        ("whole", whole),
    ):
        (tmp_path / f"{name}.osm.pbf").write_bytes(data)
    with MapChecker() as checker:
        for name in ("key", "value"):
            with pytest.raises(UnreadableMapError, match=rf"{name}.osm.pbf: (damaged, |cannot be read)"):
                checker.check(tmp_path / f"{name}.osm.pbf")
        checker.check(tmp_path / "whole.osm.pbf")


def test_a_map_that_is_never_read_to_its_end_is_given_up(tmp_path: Path) -> None:
    path = tmp_path / "map.osm.pbf"
    path.write_bytes(pbf((SAMPLE / "osm" / "quill.osm").read_bytes()))
    with MapChecker(limit_s=0.0) as checker, pytest.raises(UnreadableMapError, match=r"map\.osm\.pbf: not read after"):
        checker.check(path)


def test_a_number_with_two_points_in_a_geo_reference_is_no_number() -> None:
    right = write_opendrive(STREET)
    assert b"+lat_0=" in right
    with pytest.raises(UserError, match="lat_0"):
        read_opendrive(right.replace(b"+lat_0=", b"+lat_0=7.7."), name="map.xodr")


def test_a_table_with_a_column_twice_is_no_table(tmp_path: Path) -> None:
    (tmp_path / "accident.csv").write_text("ST_CASE,STATE,YEAR,STATE\n510001,51,2023,51\n")
    with pytest.raises(UserError, match="column STATE is there more than once"):
        FarsCsvSource.open(tmp_path).listings()


def test_a_carriage_return_within_the_first_line_of_a_table_is_reported(tmp_path: Path) -> None:
    (tmp_path / "accident.csv").write_bytes(b"ST_CASE,STA\rTE,YEAR\n510001,51,2023\n")
    with pytest.raises(
        UserError, match=r"accident.csv is not a readable CSV table: its first line: new-line character"
    ):
        FarsCsvSource.open(tmp_path).listings()


@pytest.mark.parametrize(
    ("right", "wrong", "said"),
    [
        (b'<laneSection s="0"', b'<laneSection s="-1e9"', "lane section at s=-1e.09 of a road of"),
        (b"<line/>", b'<spiral curvStart="0" curvEnd="1e30"/>', "turns more than 100 rad"),
    ],
)
def test_no_number_of_a_map_asks_for_more_points_than_there_is_memory(right: bytes, wrong: bytes, said: str) -> None:
    data = write_opendrive(STREET)
    assert right in data
    with pytest.raises(UserError, match=said):
        read_opendrive(data.replace(right, wrong, 1), name="map.xodr")


@pytest.mark.parametrize(
    ("offset", "value", "error"),
    [(6, 79, UserError), (8, 1, DamagedFile), (10, 99, DamagedFile)],
    ids=["a version to come", "a password", "another way to pack"],
)
def test_a_package_that_zipfile_does_not_know_how_to_read(
    tmp_path: Path, offset: int, value: int, error: type[Exception]
) -> None:
    path = tmp_path / "package.zip"
    with zipfile.ZipFile(path, "w") as archive:
        archive.writestr("2023-319003/map.xodr", b"<OpenDRIVE/>")
    data = bytearray(path.read_bytes())
    data[data.index(b"PK\x01\x02") + offset] = value  # in the central directory: APPNOTE.TXT, 4.3.12
    path.write_bytes(data)
    with pytest.raises(error):
        ArchiveFiles.of(path, "package.zip").read("map.xodr")


def test_maps_that_break_off_leave_nothing_open(tmp_path: Path) -> None:
    whole = (SAMPLE / "osm" / "quill.osm").read_bytes()
    path = tmp_path / "map.osm"
    path.write_bytes(whole[: len(whole) // 2])

    def held() -> tuple[int, int]:
        with pytest.raises(UnreadableMapError):
            read_around(path, read_header(path), [], OsmSettings())
        return len(list(Path("/proc/self/task").iterdir())), len(list(Path("/proc/self/fd").iterdir()))

    assert held() == held()
