"""Large files, of which what is far from all sites is not copied, give the same extracts as small ones."""

from __future__ import annotations

import random
from pathlib import Path

import numpy as np
import osmium
import pytest

from tests.osm.osm_text import ORIGIN, node, place, restriction, save, thing, way
from trace_dag.osm import extraction
from trace_dag.osm.catalog import MapCatalog
from trace_dag.osm.near_nodes import set_of
from trace_dag.osm.types import OsmExtract, Site
from trace_dag.settings import OsmSettings

SITE = Site("1", *ORIGIN)
FAR_M = 3000.0
CORNERS = ((1, -FAR_M, 5.0), (2, FAR_M, 5.0), (3, FAR_M, FAR_M), (4, -FAR_M, FAR_M))
AROUND = ((5, -FAR_M, -FAR_M), (6, FAR_M, -FAR_M), (7, FAR_M, FAR_M), (8, -FAR_M, FAR_M))


@pytest.fixture
def all_large(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    """Every file is a large one."""
    monkeypatch.setattr(extraction, "_LARGE", 0)
    monkeypatch.setattr("tempfile.tempdir", str(tmp_path))


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


def cut(file: Path) -> OsmExtract:
    extract = MapCatalog.open([file]).extract([SITE], OsmSettings())[SITE.key]
    assert isinstance(extract, OsmExtract)
    return extract


@pytest.mark.usefixtures("all_large")
def test_a_road_passes_without_a_node_for_kilometres(tmp_path: Path) -> None:
    file = sorted_pbf(tmp_path, *(node(*corner) for corner in CORNERS), way(10, [1, 2]), way(11, [3, 4]))
    assert [each.id for each in cut(file).ways] == [10]


@pytest.mark.usefixtures("all_large")
def test_a_wood_lies_around_the_place(tmp_path: Path) -> None:
    wood = thing(20, [5, 6, 7, 8, 5], natural="wood")
    file = sorted_pbf(tmp_path, *(node(*each) for each in (*CORNERS[:2], *AROUND)), way(10, [1, 2]), wood)
    assert [each.id for each in cut(file).surroundings] == ["way/20"]


@pytest.mark.usefixtures("all_large")
def test_a_restriction_by_way_of_another_street_is_kept(tmp_path: Path) -> None:
    nodes = [node(1, -50, 5), node(2, 0, 5), node(3, 0, 25), node(4, -50, 25)]
    turn = restriction(30, 10, 11, 12, "no_u_turn", via_type="way")
    file = sorted_pbf(tmp_path, *nodes, way(10, [1, 2]), way(11, [2, 3]), way(12, [3, 4]), turn)
    assert [each.id for each in cut(file).relations] == [30]


@pytest.mark.usefixtures("all_large")
def test_a_way_whose_nodes_are_missing_is_kept_as_far_as_it_is_there(tmp_path: Path) -> None:
    file = sorted_pbf(tmp_path, node(1, -20, 5), node(2, 20, 5), way(10, [98, 99, 1, 2]))
    assert [each.node_ids for each in cut(file).ways] == [(1, 2)]


def test_large_and_small_files_give_the_same(
    shared_data: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    file = shared_data / "osm" / "concho-az.osm.pbf"
    catalog = MapCatalog.open([file])
    box = catalog.files[0].header.box
    assert box is not None
    draw = random.Random(1)
    sites = [
        Site(str(each), draw.uniform(box.south_deg, box.north_deg), draw.uniform(box.west_deg, box.east_deg))
        for each in range(60)
    ]
    small = catalog.extract(sites, OsmSettings())
    assert sum(isinstance(each, OsmExtract) for each in small.values()) > 10
    monkeypatch.setattr(extraction, "_LARGE", 0)
    monkeypatch.setattr("tempfile.tempdir", str(tmp_path))
    for _ in ("first time", "with the long ways noted"):
        large = catalog.extract(sites, OsmSettings())
        assert {key: _ordered(each) for key, each in large.items()} == {k: _ordered(v) for k, v in small.items()}


def _ordered(answer: object) -> object:
    if not isinstance(answer, OsmExtract):
        return repr(answer)
    things = sorted((each.id, each.geometry.wkt, dict(each.tags)) for each in answer.surroundings)
    return answer.nodes, answer.ways, answer.relations, answer.walkways, things


def test_scattered_ids_are_not_put_into_a_set_in_memory() -> None:
    assert set_of([np.arange(0, 2**40, 2**29, dtype=np.uint64)]) is None
