"""Road maps without crashes: around a place, in a box, of a whole file, in the forms of other tools."""

from __future__ import annotations

import gzip
import json
from pathlib import Path

import click
import pytest
import shapely
from click.testing import CliRunner

import trace_dag
from trace_dag.cli.main import cli
from trace_dag.cli.map import map_command
from trace_dag.common.errors import UserError
from trace_dag.export.formats import MAP_FORMS
from trace_dag.reading.road_map import MadeMap
from trace_dag.roads.map.reader import read_opendrive

TOWN = Path(__file__).parents[2] / "data" / "sample" / "osm" / "merrow.osm"
MIDDLE = (41.8290, -101.5400)


@pytest.fixture(scope="module", name="made")
def _made() -> MadeMap:
    return trace_dag.road_map(TOWN, at=MIDDLE, radius_m=300.0)


def test_a_map_reaches_as_far_as_asked_and_holds_every_gate(made: MadeMap) -> None:
    assert made.network.roads
    assert [gate.name for gate in made.gates if gate.passed is False] == []
    starts = [road.plan[0] for road in made.network.roads]
    assert all(max(abs(start.x_m), abs(start.y_m)) < 330.0 for start in starts)  # roads end just beyond the box
    assert (made.network.frame.latitude_deg, made.network.frame.longitude_deg) == MIDDLE


def test_map_report_and_picture_are_saved(made: MadeMap, tmp_path: Path) -> None:
    written = made.save(tmp_path / "town", ["geojson", "geoparquet", "commonroad", "lanelet2", "scenarionet", "glb"])
    assert {str(path.relative_to(tmp_path / "town")) for path in written} == {
        "map.xodr",
        "map.json",
        "map.png",
        "lanes.geojson",
        "lanes.parquet",
        "map.commonroad.xml",
        "map.lanelet2.osm",
        f"scenarionet/sd_trace-dag_{trace_dag.__version__}_map.pkl",
        "scenarionet/dataset_mapping.pkl",
        "scenarionet/dataset_summary.pkl",
        "map.glb",
    }
    stored = read_opendrive((tmp_path / "town" / "map.xodr").read_bytes(), name="map.xodr")
    assert len(stored.roads) == len(made.network.roads)
    assert json.loads((tmp_path / "town" / "map.json").read_text())["gates"]
    lanes = json.loads((tmp_path / "town" / "lanes.geojson").read_text())["features"]
    assert len(lanes) == len(made.lanes)
    middle = shapely.Point(MIDDLE[::-1])
    assert min(shapely.geometry.shape(lane["geometry"]).distance(middle) for lane in lanes) < 0.003  # 300 m in degrees


def test_left_hand_roads_have_the_rule() -> None:
    made = trace_dag.road_map(TOWN, at=MIDDLE, radius_m=200.0, left_hand=True)
    assert all(road.left_hand for road in made.network.roads)
    assert b'rule="LHT"' in made.xodr


def test_a_box_and_a_whole_file_are_maps_too() -> None:
    whole = trace_dag.road_map(TOWN)
    box = trace_dag.road_map(TOWN, box=(-101.545, 41.826, -101.535, 41.832))
    assert 0 < len(box.network.roads) < len(whole.network.roads)


@pytest.mark.parametrize(
    ("arguments", "said"),
    [
        # 0.0558563 degrees north of where the file ends, 111.195 km each
        (["--at", "41.9,-101.54"], "no map covers (41.90000, -101.54000): the nearest, merrow.osm, ends 6.2 km away"),
        (["--at", "141.9,-101.54"], "no place; latitude comes first"),
        (["--at", "here"], "is not LAT,LON"),
        (["--box=-125,25,-66,49"], "at most 10 km each way fit a map"),
        (["--box=-101.5,41.8,-101.6,41.9"], "no box of west, south, east, north"),
        (["--at", "41.8,-101.5", "--box=-101.6,41.8,-101.5,41.9"], "not both"),
    ],
)
def test_files_that_cannot_be_made_are_named(arguments: list[str], said: str, tmp_path: Path) -> None:
    result = CliRunner().invoke(cli, ["map", "--osm", str(TOWN), *arguments, "-o", str(tmp_path / "out")])
    assert result.exit_code
    assert said in (result.output if isinstance(result.exception, SystemExit) else str(result.exception))
    assert not (tmp_path / "out").exists()


def test_a_file_that_is_no_map_is_named(tmp_path: Path) -> None:
    notes = tmp_path / "notes.osm"
    notes.write_text("the road goes north")
    with pytest.raises(UserError, match=r"notes\.osm: cannot be read as OSM data"):
        trace_dag.road_map(notes, at=MIDDLE)


def test_the_command_offers_every_form() -> None:
    (option,) = (each for each in map_command.params if each.name == "forms")
    assert isinstance(option.type, click.Choice)
    assert tuple(option.type.choices) == MAP_FORMS


def test_the_command_names_what_it_made(tmp_path: Path) -> None:
    given = ["map", "--osm", str(TOWN), "--at", "41.8290,-101.5400", "--radius", "200", "-o", str(tmp_path / "town")]
    result = CliRunner().invoke(cli, given, catch_exceptions=False)
    assert result.exit_code == 0
    assert "gates hold" in result.output
    assert (tmp_path / "town" / "map.png").read_bytes()[:4] == b"\x89PNG"


@pytest.mark.parametrize("command", [["map", "--osm"], ["--root", "root", "ingest", "--maps"]], ids=["map", "ingest"])
def test_a_packed_map_that_never_ends_is_refused_before_anything_looks_at_it(
    command: list[str], tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)
    with gzip.open("endless.osm.gz", "wb") as stream:
        stream.write(b'<osm version="0.6"><!--' + b"a" * 100_000_000 + b"--></osm>")
    result = CliRunner().invoke(cli, [*command, "endless.osm.gz"])
    assert isinstance(result.exception, UserError)
    assert "endless.osm.gz: one tag or comment has more than 65536 bytes" in str(result.exception)
