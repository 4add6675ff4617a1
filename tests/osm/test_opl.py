"""OPL lines as libosmium writes them."""

from __future__ import annotations

from io import BytesIO

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
    with file.open("rb") as stream:
        (lines,) = opl.read_lines(stream)
    node, way, relation = lines
    assert [opl.read_id(line) for line in lines] == [1, 2, 3]
    assert all(opl.read_tags(line) == tags for line in lines)
    assert lines.of_kind("n").node_places()[0].tolist() == [-77.5]
    assert lines.of_kind("w").way_nodes().ids.tolist() == refs
    assert opl.read_members(relation) == tuple(OsmMember(LONG[kind], ref, role) for kind, ref, role in members)
    assert [*lines.of_kind("n"), *lines.of_kind("w"), *lines.of_kind("r")] == [node, way, relation]


def test_nodes_of_many_ways_come_in_one_row() -> None:
    lines = opl.Lines.of(b"w7 Ta=b Nn12x-77.5y37.25,n-3x-77y37\nw6 T N\nw8 T Nn4xy\nw9 T Nn12x-77.5y37.25\n")
    counts, ids, x_deg, y_deg = lines.way_nodes()
    assert counts.tolist() == [2, 0, 1, 1]
    assert ids.tolist() == [12, -3, 4, 12]
    assert_array_equal(x_deg, [-77.5, -77.0, np.nan, -77.5])
    assert_array_equal(y_deg, [37.25, 37.0, np.nan, 37.25])
    assert_array_equal(lines.first_places()[0], [-77.5, np.nan, np.nan, -77.5])
    assert lines.some(np.array([3, 0])).way_nodes().ids.tolist() == [12, 12, -3]


def test_places_of_nodes() -> None:
    x_deg, y_deg = opl.Lines.of(b"n1 Ta=b,c=d x-77.5 y37.25\nn2 T x y\n").node_places()
    assert_array_equal(x_deg, [-77.5, np.nan])
    assert_array_equal(y_deg, [37.25, np.nan])


def test_no_lines_have_nothing() -> None:
    none = opl.Lines.of(b"")
    assert len(none) == len(none.having(b"highway")) == len(none.way_nodes().ids) == len(none.node_places()[0]) == 0
    assert len(none.first_places()[0]) == 0


@pytest.mark.parametrize(
    ("tags", "has_key", "has_value"),
    [
        (b"highway=primary", True, True),
        (b"name=A,highway=primary", True, True),
        (b"highway=primary,name=A", True, True),
        (b"highway=primary_link", True, False),
        (b"highway=prim", True, False),
        (b"was:highway=primary", False, False),
        (b"name=highway", False, False),
        (b"", False, False),
    ],
)
def test_tags_are_found_by_key_and_value(tags: bytes, has_key: bool, has_value: bool) -> None:
    # Between others, so that one taken for the tag of a neighbour would be seen.
    lines = opl.Lines.of(b"w1 T Nn1xy,n2xy\nw2 T%s Nn3xy\nw3 T N\n" % tags)
    assert lines.having(b"highway").tolist() == [False, has_key, False]
    assert lines.having(b"highway", [b"primary", b"residential"]).tolist() == [False, has_value, False]
    assert lines.some(np.array([0, 2])).having(b"highway").tolist() == [False, False]


def test_a_file_is_read_in_whole_lines(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(opl, "_AT_ONCE", 10)
    text = b"".join(b"n%d T x1 y%d\n" % (number, number) for number in range(20))
    assert b"".join(line for lines in opl.read_lines(BytesIO(text)) for line in lines) == text
