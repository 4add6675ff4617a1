"""Extracts as they are stored."""

from __future__ import annotations

from pathlib import Path

import osmium
import pytest
from hypothesis import given

from tests.osm.test_xml import extracts
from trace_dag.common.errors import UserError
from trace_dag.osm.stored import CLIPPED, read_extract, write_extract
from trace_dag.osm.types import BoundingBox, OsmExtract, OsmMember, OsmNode, OsmRelation, OsmWay

STREETS = OsmExtract(
    BoundingBox(37, -78, 38, -77),
    {
        -1: OsmNode(-1, 37.1234567, -77.7654321, clipped=True),
        5: OsmNode(5, 37.2, -77.8, {"highway": "stop", "direction": "backward"}),
    },
    (OsmWay(-2, (-1, 5), {"highway": "service"}), OsmWay(7, (5, -1), {"name": 'A "quoted" <Road> & more'})),
    (OsmRelation(9, (OsmMember("way", 7, "from"),), {"type": "restriction"}),),
)


@given(extracts())
def test_written_values_are_read_back(extract: OsmExtract) -> None:
    assert read_extract(*write_extract(extract), name="round trip") == extract


@given(extracts())
def test_the_same_extract_gives_the_same_bytes(extract: OsmExtract) -> None:
    files = write_extract(extract)
    assert write_extract(read_extract(*files, name="again")) == files


def test_osmium_reads_the_streets(tmp_path: Path) -> None:
    file = tmp_path / "2023-519001.osm.pbf"
    file.write_bytes(write_extract(STREETS)[0])
    with osmium.io.Reader(str(file)) as reader:
        box = reader.header().box()
    assert (box.bottom_left.lat, box.bottom_left.lon, box.top_right.lat, box.top_right.lon) == (37, -78, 38, -77)
    nodes, ways, relations = {}, {}, {}
    for each in osmium.FileProcessor(str(file)):
        if each.is_node():
            nodes[each.id] = (each.lat, each.lon, dict(each.tags))
        elif each.is_way():
            ways[each.id] = ([node.ref for node in each.nodes], dict(each.tags))
        else:
            relations[each.id] = ([(one.type, one.ref, one.role) for one in each.members], dict(each.tags))
    assert nodes == {
        -1: (37.1234567, -77.7654321, {CLIPPED: "yes"}),
        5: (37.2, -77.8, {"highway": "stop", "direction": "backward"}),
    }
    assert ways == {-2: ([-1, 5], {"highway": "service"}), 7: ([5, -1], {"name": 'A "quoted" <Road> & more'})}
    assert relations == {9: ([("w", 7, "from")], {"type": "restriction"})}


@pytest.mark.parametrize("pbf", [b"", b"no PBF at all", write_extract(STREETS)[0][:-20]])
def test_damage_is_reported_in_one_line(pbf: bytes) -> None:
    _, geojson = write_extract(STREETS)
    with pytest.raises(UserError, match=r"^a: cannot be read as OSM PBF \(.*\)$"):
        read_extract(pbf, geojson, name="a")
