"""Extracts written as OSM XML and read back, by us and by libosmium."""

from __future__ import annotations

from pathlib import Path

import osmium
import pytest
from hypothesis import given
from hypothesis import strategies as st

from trace_dag.common.errors import UserError
from trace_dag.osm.types import BoundingBox, OsmExtract, OsmMember, OsmNode, OsmRelation, OsmWay
from trace_dag.osm.xml import read_osm, write_osm

IDS = st.integers(-(10**10), 10**10).filter(bool)
# What XML can carry: no control characters, no surrogates.
TEXT = st.text(st.characters(exclude_categories=("Cs", "Cc", "Co", "Cn")), min_size=1, max_size=20)
TAGS = st.dictionaries(TEXT, TEXT, max_size=4)
DEGREES_LATITUDE = st.integers(-900_000_000, 900_000_000).map(lambda n: n / 1e7)
DEGREES_LONGITUDE = st.integers(-1_800_000_000, 1_800_000_000).map(lambda n: n / 1e7)


@st.composite
def extracts(draw: st.DrawFn) -> OsmExtract:
    ids = draw(st.lists(IDS, min_size=2, max_size=8, unique=True))
    nodes = {
        i: OsmNode(i, draw(DEGREES_LATITUDE), draw(DEGREES_LONGITUDE), draw(TAGS), clipped=draw(st.booleans()))
        for i in ids
    }
    refs = st.lists(st.sampled_from(ids), min_size=2, max_size=12).map(tuple)
    way_ids = sorted(draw(st.lists(IDS, max_size=4, unique=True)))
    ways = tuple(OsmWay(i, draw(refs), draw(TAGS)) for i in way_ids)
    members = st.builds(
        OsmMember, st.sampled_from(["node", "way", "relation"]), IDS, st.sampled_from(["from", "via", ""])
    )
    relation_ids = sorted(draw(st.lists(IDS, max_size=2, unique=True)))
    relations = tuple(OsmRelation(i, tuple(draw(st.lists(members, max_size=4))), draw(TAGS)) for i in relation_ids)
    corners = sorted(draw(st.tuples(DEGREES_LATITUDE, DEGREES_LATITUDE)))
    sides = sorted(draw(st.tuples(DEGREES_LONGITUDE, DEGREES_LONGITUDE)))
    box = BoundingBox(corners[0], sides[0], corners[1], sides[1])
    return OsmExtract(box, nodes, ways, relations, source=draw(TEXT), data_timestamp="2026-01-02T03:04:05Z")


@given(extracts())
def test_written_values_are_read_back(extract: OsmExtract) -> None:
    assert read_osm(write_osm(extract), name="round trip") == extract


@given(extracts())
def test_the_same_extract_gives_the_same_bytes(extract: OsmExtract) -> None:
    data = write_osm(extract)
    assert write_osm(read_osm(data, name="again")) == data


@given(st.text(max_size=30))
def test_any_text_makes_a_readable_file(text: str) -> None:
    nodes = {1: OsmNode(1, 0.0, 0.0, {"name": text}), 2: OsmNode(2, 0.0, 1.0)}
    extract = OsmExtract(BoundingBox(0, 0, 1, 1), nodes, (OsmWay(1, (1, 2), {text: "x"}),), source=text)
    again = read_osm(write_osm(extract), name="text")
    assert (again.nodes.keys(), [way.node_ids for way in again.ways]) == (nodes.keys(), [(1, 2)])


def test_libosmium_reads_what_we_write(tmp_path: Path) -> None:
    nodes = {
        -1: OsmNode(-1, 37.1234567, -77.7654321, clipped=True),
        5: OsmNode(5, 37.2, -77.8, {"highway": "stop", "direction": "backward"}),
    }
    ways = (OsmWay(-2, (-1, 5), {"highway": "service"}), OsmWay(7, (5, -1), {"name": 'A "quoted" <Road> & more'}))
    relations = (OsmRelation(9, (OsmMember("way", 7, "from"),), {"type": "restriction"}),)
    file = tmp_path / "extract.osm"
    file.write_bytes(write_osm(OsmExtract(BoundingBox(37, -78, 38, -77), nodes, ways, relations)))
    with osmium.io.Reader(str(file)) as reader:
        box = reader.header().box()
    assert (box.bottom_left.lat, box.bottom_left.lon, box.top_right.lat, box.top_right.lon) == (37, -78, 38, -77)
    seen = {}
    for obj in osmium.FileProcessor(str(file)):
        if obj.is_node():
            seen["n", obj.id] = (obj.lat, obj.lon, dict(obj.tags))
        elif obj.is_way():
            seen["w", obj.id] = ([n.ref for n in obj.nodes], dict(obj.tags))
        else:
            seen["r", obj.id] = ([(m.type, m.ref, m.role) for m in obj.members], dict(obj.tags))
    assert seen == {
        ("n", -1): (37.1234567, -77.7654321, {}),
        ("n", 5): (37.2, -77.8, {"highway": "stop", "direction": "backward"}),
        ("w", -2): ([-1, 5], {"highway": "service"}),
        ("w", 7): ([5, -1], {"name": 'A "quoted" <Road> & more'}),
        ("r", 9): ([("w", 7, "from")], {"type": "restriction"}),
    }


def test_references_to_nowhere_and_deleted_objects_are_left_out() -> None:
    data = b"""<osm version="0.6">
      <node id="1" lat="0" lon="0"/><node id="2" lat="0" lon="1"/><node id="3" lat="0" lon="2" action="delete"/>
      <way id="1"><nd ref="1"/><nd ref="9"/><nd ref="2"/></way>
      <way id="2"><nd ref="1"/><nd ref="9"/></way>
      <way id="3"><nd ref="2"/><nd ref="3"/></way>
      <way id="4" visible="false"><nd ref="1"/><nd ref="2"/></way></osm>"""
    extract = read_osm(data, name="holes")
    assert [(w.id, w.node_ids) for w in extract.ways] == [(1, (1, 2))]
    assert extract.box == BoundingBox(0, 0, 0, 1)


@pytest.mark.parametrize(
    ("data", "said"),
    [
        (b"", "not OSM XML"),
        (b"not xml", "not OSM XML"),
        (b"<html/>", "<html>"),
        (b'<osm><node id="1" lat="0" lon="0"/>', "not OSM XML"),
        (b'<osm><node id="one" lat="0" lon="0"/></osm>', 'id="one"'),
        (b'<osm><node id="1" lat="91" lon="0"/></osm>', 'lat="91"'),
        (b'<osm><node id="1" lat="0" lon="nan"/></osm>', 'lon="nan"'),
        (b'<osm><node id="1" lat="0"/></osm>', 'lon=""'),
        (b'<osm><way id="1"><nd/></way></osm>', "<nd>"),
        (b'<osm><relation id="1"><member type="street" ref="1"/></relation></osm>', "street"),
        (b'<osm><bounds minlat="a" minlon="0" maxlat="0" maxlon="0"/></osm>', 'minlat="a"'),
        (b'<!DOCTYPE osm [<!ENTITY x SYSTEM "file:///etc/passwd">]><osm source="&x;"/>', ""),
    ],
)
def test_a_file_that_is_no_osm_is_reported_in_one_line(data: bytes, said: str) -> None:
    try:
        extract = read_osm(data, name="street.osm")
    except UserError as error:
        message = str(error)
        assert message.startswith("street.osm: ")
        assert said in message
        assert "\n" not in message
    else:
        assert "root:" not in extract.source  # the entity was not followed
        assert not said


@given(st.binary(max_size=200))
def test_garbage_never_escapes_as_anything_else(data: bytes) -> None:
    with pytest.raises(UserError):
        read_osm(data, name="garbage")


def test_the_newest_version_of_a_history_counts_if_it_exists() -> None:
    """Also where versions are not in order, and where Overpass repeats a way without its tags."""
    data = b"""<osm><node id="1" lat="1" lon="2"/><node id="2" lat="1" lon="3"/>
      <way id="7" version="2"><nd ref="1"/><nd ref="2"/><tag k="lanes" v="4"/></way>
      <way id="7" version="1"><nd ref="1"/><nd ref="2"/><tag k="lanes" v="2"/></way>
      <way id="8" version="1"><nd ref="1"/><nd ref="2"/><tag k="lanes" v="6"/></way>
      <way id="8" version="2" visible="false"/>
      <way id="9"><nd ref="1"/><nd ref="2"/><tag k="lanes" v="1"/></way>
      <way id="9"><nd ref="1"/><nd ref="2"/></way></osm>"""
    ways = read_osm(data, name="history").ways
    assert {way.id: way.tags for way in ways} == {7: {"lanes": "4"}, 9: {"lanes": "1"}}
