"""OPL lines as libosmium writes them."""

from __future__ import annotations

from pathlib import Path

import osmium
from hypothesis import given, settings
from hypothesis import strategies as st
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
@given(tags=TAGS, refs=st.lists(IDS, min_size=1, max_size=6), members=MEMBERS)
def test_what_libosmium_writes_is_read(
    tmp_path_factory: object, tags: dict[str, str], refs: list[int], members: list[tuple[str, int, str]]
) -> None:
    file = Path(tmp_path_factory.mktemp("opl")) / "a.opl"  # type: ignore[attr-defined]
    with osmium.SimpleWriter(str(file)) as writer:
        writer.add_node(Node(id=1, location=(-77.5, 37.25), tags=tags))
        writer.add_way(Way(id=2, nodes=refs, tags=tags))
        writer.add_relation(Relation(id=3, members=members, tags=tags))
    node, way, relation = (opl.read_line(line) for line in file.read_text(encoding="utf-8").split("\n") if line)
    assert node[:3] == ("n", 1, tags)
    assert way[:3] == ("w", 2, tags)
    assert opl.node_ids(way[3]) == tuple(refs)
    assert relation[:3] == ("r", 3, tags)
    assert opl.members(relation[3]) == tuple(OsmMember(LONG[kind], ref, role) for kind, ref, role in members)


def test_locations_on_nodes_do_not_disturb() -> None:
    assert opl.node_ids("n12x-77.5y37.25,n-3x-77y37,n4x1y2") == (12, -3, 4)
    assert opl.node_ids("") == ()
    assert opl.members("") == ()
