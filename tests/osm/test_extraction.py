"""What is found around a place in a file, wherever its nodes are located."""

from __future__ import annotations

import random
from pathlib import Path

import osmium
import pytest

from tests.osm.osm_text import ORIGIN, node, place, restriction, save, thing, way
from trace_dag.common.settings import OsmSettings
from trace_dag.osm.catalog import MapCatalog
from trace_dag.osm.types import OsmExtract, Site

SITE = Site("1", *ORIGIN)
FAR_M = 3000.0
CORNERS = ((1, -FAR_M, 5.0), (2, FAR_M, 5.0), (3, FAR_M, FAR_M), (4, -FAR_M, FAR_M))
AROUND = ((5, -FAR_M, -FAR_M), (6, FAR_M, -FAR_M), (7, FAR_M, FAR_M), (8, -FAR_M, FAR_M))


def sorted_pbf(folder: Path, *elements: str) -> Path:
    """A file as the public servers have them: sorted, and it says what it covers."""
    xml, target = save(folder / "map.osm", *elements), folder / "map.osm.pbf"
    south, west = place(-4000, -4000)
    north, east = place(4000, 4000)
    header = osmium.io.Header()
    header.set("sorting", "Type_then_ID")
    header.add_box(osmium.osm.Box(west, south, east, north))
    with osmium.SimpleWriter(str(target), header=header) as writer:
        osmium.apply(str(xml), writer)
    return target


def cut(file: Path, **settings: float) -> OsmExtract:
    extract = MapCatalog.open([file]).extract([SITE], OsmSettings(**settings))[SITE.key]  # type: ignore[arg-type]
    assert isinstance(extract, OsmExtract)
    return extract


def test_a_road_passes_without_a_node_for_kilometres(tmp_path: Path) -> None:
    file = sorted_pbf(tmp_path, *(node(*corner) for corner in CORNERS), way(10, [1, 2]), way(11, [3, 4]))
    assert [each.id for each in cut(file).ways] == [10]


def test_a_wood_lies_around_the_place(tmp_path: Path) -> None:
    wood = thing(20, [5, 6, 7, 8, 5], natural="wood")
    file = sorted_pbf(tmp_path, *(node(*each) for each in (*CORNERS[:2], *AROUND)), way(10, [1, 2]), wood)
    assert [each.id for each in cut(file).surroundings] == ["way/20"]


def test_a_restriction_by_way_of_another_street_is_kept(tmp_path: Path) -> None:
    nodes = [node(1, -50, 5), node(2, 0, 5), node(3, 0, 25), node(4, -50, 25)]
    turn = restriction(30, 10, 11, 12, "no_u_turn", via_type="way")
    file = sorted_pbf(tmp_path, *nodes, way(10, [1, 2]), way(11, [2, 3]), way(12, [3, 4]), turn)
    assert [each.id for each in cut(file).relations] == [30]


def test_a_way_whose_nodes_are_missing_is_kept_as_far_as_it_is_there(tmp_path: Path) -> None:
    file = sorted_pbf(tmp_path, node(1, -20, 5), node(2, 20, 5), way(10, [98, 99, 1, 2]))
    assert [each.node_ids for each in cut(file).ways] == [(1, 2)]


def test_a_file_that_claims_to_be_sorted_and_is_not_is_read_again(tmp_path: Path) -> None:
    elements = (way(10, [1, 2]), node(1, -20, 5, highway="stop"), node(2, 20, 5))
    assert [each.node_ids for each in cut(sorted_pbf(tmp_path, *elements)).ways] == [(1, 2)]


@pytest.mark.parametrize("node_memory_mb", [0.0, 100.0])
def test_files_are_read_once_where_sorted_and_twice_where_not(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, node_memory_mb: float
) -> None:
    readings: list[object] = []
    processor = osmium.FileProcessor

    def counted(file: str, entities: object = osmium.osm.ALL, **options: object) -> object:
        if entities is not osmium.osm.NOTHING:
            readings.append(entities)
        return processor(file, entities, **options)  # type: ignore[arg-type]

    monkeypatch.setattr(osmium, "FileProcessor", counted)
    nodes, road = (node(1, -20, 5), node(2, 20, 5)), way(10, [1, 2])
    assert cut(sorted_pbf(tmp_path, *nodes, road), node_memory_mb=node_memory_mb).ways
    assert len(readings) == 1
    assert cut(save(tmp_path / "any.osm", road, *nodes), node_memory_mb=node_memory_mb).ways
    assert len(readings) == 3


def test_nodes_located_on_disk_and_in_memory_give_the_same(shared_data: Path) -> None:
    catalog = MapCatalog.open([shared_data / "osm" / "concho-az.osm.pbf"])
    box = catalog.files[0].header.box
    assert box is not None
    draw = random.Random(1)
    sites = [
        Site(str(each), draw.uniform(box.south_deg, box.north_deg), draw.uniform(box.west_deg, box.east_deg))
        for each in range(60)
    ]
    memory, disk = (catalog.extract(sites, OsmSettings(node_memory_mb=most)) for most in (1000.0, 0.0))
    assert sum(isinstance(each, OsmExtract) for each in memory.values()) > 10
    assert {key: _ordered(each) for key, each in disk.items()} == {k: _ordered(v) for k, v in memory.items()}


def _ordered(answer: object) -> object:
    if not isinstance(answer, OsmExtract):
        return repr(answer)
    things = sorted((each.id, each.geometry.wkt, dict(each.tags)) for each in answer.surroundings)
    return answer.nodes, answer.ways, answer.relations, answer.walkways, things
