"""What stands and lies beside the roads of a map file."""

from __future__ import annotations

import json
from pathlib import Path

import pytest
from shapely.geometry import LineString

from tests.osm.osm_text import LATITUDE_PER_M, LONGITUDE_PER_M, ORIGIN, document, node, save, thing, way
from trace_dag.common.errors import UserError
from trace_dag.common.settings import OsmSettings
from trace_dag.osm.catalog import MapCatalog
from trace_dag.osm.stored import read_extract, write_extract
from trace_dag.osm.types import BoundingBox, OsmExtract, OsmFeature, Site

ROAD = (node(1, -200, 0), node(2, 200, 0), way(10, [1, 2], name="Main Street"))
WOOD = [node(number, x, y) for number, x, y in ((20, 50, 20), (21, 900, 20), (22, 900, 60), (23, 50, 60))]
HOUSE = [node(number, x, y) for number, x, y in ((30, -40, 20), (31, -30, 20), (32, -30, 30), (33, -40, 30))]
HOUSE.append(thing(40, [30, 31, 32, 33, 30], building="house"))


def surroundings(tmp_path: Path, *elements: str) -> dict[str, OsmFeature]:
    file = save(tmp_path / "map.osm", *ROAD, *elements)
    extract = MapCatalog.open([file]).extract([Site("1", *ORIGIN)], OsmSettings())["1"]
    assert isinstance(extract, OsmExtract)
    assert [each.id for each in extract.ways] == [10]
    return {each.id: each for each in extract.surroundings}


def test_a_tree_and_a_pole_beside_the_road_are_points(tmp_path: Path) -> None:
    things = [node(3, 5, 8, natural="tree"), node(4, 20, -8, power="pole"), node(5, 0, 9, natural="peak")]
    found = surroundings(tmp_path, *things)
    assert sorted(found) == ["node/3", "node/4"]
    assert found["node/4"].geometry.x == pytest.approx(ORIGIN[1] + 20 * LONGITUDE_PER_M, abs=1e-7)
    assert found["node/4"].tags == {"power": "pole"}


def test_a_wall_is_a_line_and_a_house_an_area(tmp_path: Path) -> None:
    wall = thing(41, [30, 32], barrier="wall")
    found = surroundings(tmp_path, *HOUSE, wall)
    assert found["way/40"].geometry.geom_type == "Polygon"
    area_m2 = found["way/40"].geometry.area / (LATITUDE_PER_M * LONGITUDE_PER_M)
    assert area_m2 == pytest.approx(100, rel=0.01)
    assert isinstance(found["way/41"].geometry, LineString)


def test_shapes_larger_than_the_box_are_cut_at_it(tmp_path: Path) -> None:
    wood = thing(50, [20, 21, 22, 23, 20], natural="wood")
    geometry = surroundings(tmp_path, *WOOD, wood)["way/50"].geometry
    west, _, east, _ = geometry.bounds
    assert (east - west) / LONGITUDE_PER_M == pytest.approx(150 - 50, abs=0.1)  # the box reaches 150 m


def test_written_values_are_read_back(tmp_path: Path) -> None:
    features = tuple(surroundings(tmp_path, *HOUSE, node(3, 5, 8, natural="tree", name='"Old\\" oak')).values())
    extract = OsmExtract(BoundingBox(0, 0, 1, 1), {}, (), surroundings=features, attribution="(c) somebody")
    pbf, geojson = write_extract(extract)
    assert json.loads(geojson)["attribution"] == "(c) somebody"
    assert sorted(read_extract(pbf, geojson, name="a").surroundings) == sorted(features)


@pytest.mark.parametrize("data", [b"", b"[]", b'{"features": [{}]}', document()])
def test_missing_files_are_named(data: bytes) -> None:
    pbf, _ = write_extract(OsmExtract(BoundingBox(0, 0, 1, 1), {}, ()))
    with pytest.raises(UserError, match="a: not the GeoJSON"):
        read_extract(pbf, data, name="a")
