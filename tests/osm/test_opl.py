"""OPL lines as libosmium writes them."""

from __future__ import annotations

import numpy as np
import osmium
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from numpy.testing import assert_array_equal
from osmium.osm.mutable import Node, Relation, Way

from trace_dag.osm import opl
from trace_dag.osm.types import OsmMember

# libosmium cuts the last digit off characters of the last plane, which is for private use.
CHARACTERS = st.characters(exclude_categories=("Cs",), exclude_characters="\0", max_codepoint=0xFFFFF)
TEXT = st.text(CHARACTERS, min_size=1, max_size=15)
TAGS = st.dictionaries(TEXT, TEXT, max_size=4)
IDS = st.integers(-(2**40), 2**40)
MEMBERS = st.lists(st.tuples(st.sampled_from("nwr"), IDS, TEXT | st.just("")), max_size=4)
LONG = {"n": "node", "w": "way", "r": "relation"}


@settings(deadline=None, max_examples=60)
@given(tags=TAGS, refs=st.lists(IDS, max_size=6), members=MEMBERS)
def test_what_libosmium_writes_is_read(
    tmp_path_factory: pytest.TempPathFactory, tags: dict[str, str], refs: list[int], members: list[tuple[str, int, str]]
) -> None:
    file = tmp_path_factory.mktemp("opl") / "a.opl"
    with osmium.SimpleWriter(osmium.io.File(str(file), opl.WRITING)) as writer:
        writer.add_node(Node(id=1, location=(-77.5, 37.25), tags=tags))
        writer.add_way(Way(id=2, nodes=refs, tags=tags))
        writer.add_relation(Relation(id=3, members=members, tags=tags))
    with file.open("rb") as lines:
        node, way, relation = lines
    assert [opl.read_id(line) for line in (node, way, relation)] == [1, 2, 3]
    assert all(opl.read_tags(line) == tags for line in (node, way, relation))
    assert opl.read_way_nodes([way]).ids.tolist() == refs
    assert opl.read_members(relation) == tuple(OsmMember(LONG[kind], ref, role) for kind, ref, role in members)


def test_nodes_of_many_ways_come_in_one_row() -> None:
    lines = [b"w7 Ta=b Nn12x-77.5y37.25,n-3x-77y37\n", b"w6 T N\n", b"w8 T Nn4xy\n", b"w9 T Nn12x-77.5y37.25\n"]
    counts, ids, x_deg, y_deg = opl.read_way_nodes(lines)
    assert counts.tolist() == [2, 0, 1, 1]
    assert ids.tolist() == [12, -3, 4, 12]
    assert_array_equal(x_deg, [-77.5, -77.0, np.nan, -77.5])
    assert_array_equal(y_deg, [37.25, 37.0, np.nan, 37.25])


def test_places_of_nodes_and_of_first_nodes() -> None:
    x_deg, y_deg = opl.read_places([b" x-77.5 y37.25\n", b"n12x-77y37", b"", b" x y\n"])
    assert_array_equal(x_deg, [-77.5, -77.0, np.nan, np.nan])
    assert_array_equal(y_deg, [37.25, 37.0, np.nan, np.nan])
