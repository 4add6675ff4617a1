"""Broken data gives a map or a rejection, never a traceback; and generated street networks keep what maps promise."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest
from hypothesis import assume, given, settings
from hypothesis import strategies as st

from tests.roads.towns import FRAME, SETTINGS, Town
from trace_dag.common.errors import Reason, Rejection
from trace_dag.common.geometry import LocalFrame
from trace_dag.osm.types import BoundingBox, OsmExtract, OsmMember, OsmNode, OsmRelation, OsmWay
from trace_dag.roads.from_osm.convert import convert
from trace_dag.roads.from_osm.turn_curves import tightest_radius_m
from trace_dag.roads.from_osm.way_direction import along_traffic
from trace_dag.roads.gates.gates import check_map
from trace_dag.roads.gates.measures import link_gaps, one_sided_links
from trace_dag.roads.map.curves import PlanView
from trace_dag.roads.map.model import LaneRef, LaneType
from trace_dag.roads.map.network import RoadNetwork
from trace_dag.roads.map.reader import read_opendrive
from trace_dag.roads.map.rules import StoredMap, find_violations
from trace_dag.roads.map.writer import write_opendrive


def extract_of(points: list[tuple[float, float]], *ways: tuple[list[int], dict[str, str]]) -> OsmExtract:
    """Nodes 0, 1, ... at places in metres, and ways through them."""
    degrees = FRAME.to_geographic(np.array(points, float).reshape(-1, 2)) if points else []
    nodes = {i: OsmNode(i, float(lat), float(lon)) for i, (lat, lon) in enumerate(degrees)}
    made = tuple(OsmWay(n, tuple(refs), tags) for n, (refs, tags) in enumerate(ways, start=1))
    return OsmExtract(BoundingBox(36.99, -77.01, 37.01, -76.99), nodes, made)


ROAD = {"highway": "residential"}
LINE = [(0.0, 0.0), (50.0, 0.0), (100.0, 0.0), (100.0, 60.0)]

GARBAGE = {
    "missing nodes": extract_of(LINE, ([0, 77, 1, 78, 2], ROAD), ([79, 80], ROAD)),
    "self-loop": extract_of(LINE, ([0, 0], ROAD), ([0, 1, 2], ROAD)),
    "zero-length segments": extract_of([(0, 0), (0, 0), (50, 0), (50, 0), (50, 0)], ([0, 1, 2, 3, 4], ROAD)),
    "two nodes at one junction": extract_of(
        [(0, 0), (50, 0), (50, 0.001), (100, 0), (50, 50)],
        ([0, 1], ROAD),
        ([1, 2], ROAD),
        ([2, 3], ROAD),
        ([2, 4], ROAD),
    ),
    "duplicate nodes": extract_of(LINE, ([0, 1, 1, 1, 2, 2, 3], ROAD)),
    "the same way twice": extract_of(LINE, ([0, 1, 2], ROAD), ([0, 1, 2], ROAD), ([2, 1], ROAD)),
    "there and back": extract_of(LINE, ([0, 1, 2, 1, 0], ROAD)),
    "closed ring": extract_of([*LINE, (0.0, 60.0)], ([0, 2, 3, 4, 0], ROAD)),
    "one-way ring": extract_of([*LINE, (0.0, 60.0)], ([0, 2, 3, 4, 0], {**ROAD, "oneway": "yes"})),
    "ring at the end of a street": extract_of(
        [*LINE, (130.0, 60.0), (130.0, 90.0), (100.0, 90.0)], ([0, 1, 2, 3, 4, 5, 6, 3], ROAD)
    ),
    "one-ways head-on": extract_of(LINE, ([0, 1], {**ROAD, "oneway": "yes"}), ([3, 2, 1], {**ROAD, "oneway": "yes"})),
    "hairpin": extract_of([(0, 0), (80, 0), (0, 4)], ([0, 1, 2], ROAD)),
    "strange values": extract_of(
        LINE, ([0, 1, 2, 3], {**ROAD, "lanes": "many", "layer": "ground", "maxspeed": "signals", "width": "wide"})
    ),
    "more lanes than a way has room for": extract_of(LINE, ([0, 1, 2, 3], {**ROAD, "lanes": "12", "width": "3"})),
    "way of 2,000 nodes": extract_of(
        [(2.0 * i, 5.0 * math.sin(i / 10)) for i in range(2000)], (list(range(2000)), ROAD)
    ),
    "2,000 nodes every few decimetres": extract_of(
        [(0.2 * i, 0.02 * (-1) ** i) for i in range(2000)], (list(range(2000)), ROAD)
    ),
    "two ways of 300 nodes that cross everywhere": extract_of(
        [(2.0 * i, 0.0) for i in range(300)] + [(2.0 * i, 4.0 * (-1) ** i) for i in range(300)],
        (list(range(300)), ROAD),
        ([node for i in range(0, 299, 3) for node in (300 + i, i)], ROAD),
    ),
    "star of twelve arms": extract_of(
        [(0, 0), *((60 * math.cos(a), 60 * math.sin(a)) for a in np.arange(12) * math.tau / 12)],
        *(([0, arm], ROAD) for arm in range(1, 13)),
    ),
}


def check(network: RoadNetwork) -> None:
    """Check the promises of every map."""
    xodr = write_opendrive(network)
    assert find_violations(xodr, name="map") == []
    assert not one_sided_links(network)
    gaps = link_gaps(read_opendrive(xodr, name="map"))
    assert max((gap.position_m for gap in gaps), default=0.0) < 0.02
    assert max((abs(gap.heading_rad) for gap in gaps), default=0.0) < math.radians(1)


@pytest.mark.parametrize("name", GARBAGE)
def test_garbage_still_makes_a_map(name: str) -> None:
    network = convert(GARBAGE[name], FRAME, SETTINGS)
    assert network.drivable_lanes()
    check(network)


@pytest.mark.parametrize(
    "extract",
    [
        extract_of([]),
        extract_of(LINE, ([77, 78], ROAD)),
        extract_of(LINE, ([0], ROAD), ([1, 1], ROAD)),
        extract_of(LINE, ([0, 1], {"highway": "footway"})),
        extract_of([(0, 0), (0, 0.001)], ([0, 1], ROAD)),
    ],
    ids=["empty", "no nodes", "no segments", "nothing to drive on", "no length"],
)
def test_nothing_to_build_is_a_rejection(extract: OsmExtract) -> None:
    with pytest.raises(Rejection) as caught:
        convert(extract, FRAME, SETTINGS)
    assert caught.value.reason == Reason.MAP_DISTORTED
    assert "none of them drivable" in caught.value.detail


@pytest.mark.parametrize(("latitude", "longitude"), [(52.0, 179.9999), (-16.5, -179.9999), (89.9, 10.0), (0.0, 0.0)])
def test_strange_places_on_earth(latitude: float, longitude: float) -> None:
    frame = LocalFrame(latitude, longitude)
    points = frame.to_geographic(np.array([(-80.0, 0.0), (0.0, 0.0), (80.0, 5.0), (0.0, 90.0)]))
    nodes = {i: OsmNode(i, float(lat), float(lon)) for i, (lat, lon) in enumerate(points)}
    box = BoundingBox(latitude - 0.01, longitude - 0.01, latitude + 0.01, longitude + 0.01)
    network = convert(OsmExtract(box, nodes, (OsmWay(1, (0, 1, 2), ROAD), OsmWay(2, (1, 3), ROAD))), frame, SETTINGS)
    assert len(network.junctions) == 1
    check(network)


def test_nodes_on_the_other_side_of_the_world_are_left_out() -> None:
    extract = extract_of(LINE, ([0, 1, 2, 99, 3], ROAD))
    extract = replace(extract, nodes={**extract.nodes, 99: OsmNode(99, -37.0, 103.0)})
    network = convert(extract, FRAME, SETTINGS)
    assert sum(road.length_m for road in network.roads) == pytest.approx(160, abs=5)


def test_restrictions_that_make_no_sense_are_ignored() -> None:
    town = Town()
    town.street([(-100, 0), (0, 0), (100, 0)])
    town.street([(0, 0), (0, 100)])
    members = (OsmMember("way", 1, "from"), OsmMember("way", 999, "to"))
    odd = (
        OsmRelation(1, (), {"restriction": "no_left_turn"}),
        OsmRelation(2, members, {"restriction": "no_u_turn"}),
        OsmRelation(3, (*members, OsmMember("node", 5, "via")), {"restriction": "none of your business"}),
        OsmRelation(4, (*members, OsmMember("relation", 5, "via")), {}),
    )
    plain = convert(town.extract(), FRAME, SETTINGS)
    assert convert(replace(town.extract(), relations=odd), FRAME, SETTINGS) == plain


# --- generated networks --------------------------------------------------------------------------------------------
HIGHWAYS = st.sampled_from(["primary", "secondary", "tertiary", "residential", "service", "secondary_link"])


@st.composite
def towns(draw: st.DrawFn) -> OsmExtract:
    """Distorted grids with gaps: streets of any class, width and direction, some of them bent between the crossings."""
    columns, rows = draw(st.integers(2, 4)), draw(st.integers(2, 3))
    spacing = draw(st.sampled_from([14.0, 30.0, 60.0, 110.0]))
    jitter = st.floats(-0.28 * spacing, 0.28 * spacing)
    points = [(spacing * c + draw(jitter), spacing * r + draw(jitter)) for r in range(rows) for c in range(columns)]
    ways = []
    pairs = [(r * columns + c, r * columns + c + 1) for r in range(rows) for c in range(columns - 1)]
    pairs += [(r * columns + c, (r + 1) * columns + c) for r in range(rows - 1) for c in range(columns)]
    for a, b in pairs:
        if draw(st.integers(0, 5)) == 0:
            continue
        tags = {"highway": draw(HIGHWAYS)}
        oneway = draw(st.sampled_from(["no", "no", "yes", "-1"]))
        if oneway != "no":
            tags["oneway"] = oneway
        if draw(st.booleans()):
            tags["lanes"] = str(draw(st.integers(1, 6)))
        refs = [a, b]
        if draw(st.booleans()):
            (xa, ya), (xb, yb) = points[a], points[b]
            points.append(((xa + xb) / 2 + draw(jitter) / 2, (ya + yb) / 2 + draw(jitter) / 2))
            refs.insert(1, len(points) - 1)
        ways.append((refs, tags))
    return extract_of(points, *ways)


def folds(network: RoadNetwork) -> bool:
    """Return whether a bend is tighter than half of its road, so that the inner lanes turn back on themselves there."""
    for ref in network.drivable_lanes():
        road, lane = network.road_by_id[ref.road_id], network.geometry(ref)
        outer_m = max(abs(lane.centre.at(s_m)) + lane.width.at(s_m) / 2 for s_m in (lane.begin_m, lane.end_m))
        if road.junction_id is None and tightest_radius_m(PlanView(road.plan, road.length_m)) < outer_m:
            return True
    return False


def test_a_bend_tighter_than_half_of_its_road_is_refused() -> None:
    """A block of 14 m that turns by a right angle into a road of four lanes."""
    primary = {"highway": "primary"}
    grid = [(0.0, 0.0), (14.0, 0.0), (0.0, 14.0), (14.0, 14.0), (28.0, 14.0), (0.5, 7.125)]
    extract = extract_of(
        grid,
        ([1, 0], primary | {"oneway": "yes"}),
        ([2, 3], primary),
        ([3, 4], primary),
        ([0, 5, 2], primary | {"lanes": "4"}),
        ([1, 3], primary),
    )
    network = convert(extract, FRAME, SETTINGS)
    assert folds(network)
    gates = check_map(network, extract, StoredMap(write_opendrive(network), name="map"))
    assert {gate.name: gate.passed for gate in gates}["link_kink"] is False


@settings(max_examples=80)
@given(towns())
def test_generated_networks_keep_what_maps_promise(extract: OsmExtract) -> None:
    assume(extract.ways)
    network = convert(along_traffic(extract), FRAME, SETTINGS)
    assume(not folds(network))  # a gate refuses it
    check(network)
    for road in network.roads:
        assert road.length_m > 0
        if road.junction_id is not None:
            continue
        forward = any(lane.id < 0 for lane in road.lane_sections[0].lanes)
        backward = any(lane.id > 0 for lane in road.lane_sections[0].lanes)
        assert forward
        if len(road.osm_way_ids) == 1:
            assert backward == ("oneway" not in extract.ways[road.osm_way_ids[0] - 1].tags)


@settings(max_examples=40)
@given(towns())
def test_every_junction_can_be_left_again_on_every_lane(extract: OsmExtract) -> None:
    assume(extract.ways)
    network = convert(extract, FRAME, SETTINGS)
    for road in network.roads:
        if road.junction_id is None:
            continue
        for lane in road.lane_sections[0].lanes:
            if lane.id and lane.type is not LaneType.BIDIRECTIONAL:  # nobody drives through a centre turn lane
                ref = LaneRef(road.id, 0, lane.id)
                assert len(network.successors(ref)) == 1
                assert len(network.predecessors(ref)) == 1


@given(towns())
@settings(max_examples=20)
def test_the_same_extract_gives_the_same_bytes(extract: OsmExtract) -> None:
    if extract.ways:
        first = write_opendrive(convert(extract, FRAME, SETTINGS))
        assert write_opendrive(convert(extract, FRAME, SETTINGS)) == first
