"""Lanelet2 files against the road network they are made of."""

from __future__ import annotations

from pathlib import Path
from typing import NamedTuple

import numpy as np
import pytest
import sample_runs
import shapely
from lxml import etree
from sample_runs import SAMPLE

import trace_dag
from trace_dag.export.export import export
from trace_dag.export.formats.lanelet2 import lanelets
from trace_dag.flow.artefacts import ROAD_MAP
from trace_dag.roads.map.lane_shapes import lane_shapes
from trace_dag.roads.map.model import LaneType

KEY = "2023-319003"


class Read(NamedTuple):
    """A file by ids: places of nodes, nodes and tags of ways, members by role and tags of relations."""

    nodes: dict
    ways: dict
    relations: dict
    degrees: dict

    def lanelet(self, ref):
        """Return the id of the lanelet of a lane."""
        return next(i for i, (_, tags) in self.relations.items() if tags.get("lane") == ":".join(map(str, ref)))

    def elements(self, subtype):
        """Return the regulatory elements of a kind."""
        return {i: r for i, r in self.relations.items() if r[1]["type"] != "lanelet" and r[1]["subtype"] == subtype}


def read(data):
    root = etree.fromstring(data)
    tags = {each.get("id"): {tag.get("k"): tag.get("v") for tag in each.iterfind("tag")} for each in root}
    assert len(tags) == len(root), "no id is there twice"
    relations = {}
    for each in root.iterfind("relation"):
        members = {}
        for member in each.iterfind("member"):
            members.setdefault(member.get("role"), []).append(member.get("ref"))
        relations[each.get("id")] = members, tags[each.get("id")]
    places = {
        each.get("id"): [float(tags[each.get("id")][k]) for k in ("local_x", "local_y")]
        for each in root.iterfind("node")
    }
    degrees = {each.get("id"): (float(each.get("lat")), float(each.get("lon"))) for each in root.iterfind("node")}
    ways = {
        each.get("id"): ([nd.get("ref") for nd in each.iterfind("nd")], tags[each.get("id")])
        for each in root.iterfind("way")
    }
    return Read(places, ways, relations, degrees)


@pytest.fixture(scope="module")
def network():
    return trace_dag.open(sample_runs.finished())[KEY].stored.load(ROAD_MAP)


@pytest.fixture(scope="module")
def made(tmp_path_factory):
    folder = tmp_path_factory.mktemp("lanelet2")
    assert export(trace_dag.open(sample_runs.finished()).workspace, [KEY], folder, "lanelet2") == 1
    return read((folder / f"{KEY}.osm").read_bytes())


def ends_of(made, shape):
    """Return the nodes where a lanelet begins, left and right, and where it ends: as its lane goes."""
    members, _ = made.relations[made.lanelet(shape.ref)]
    out = []
    for side, border in (("left", shape.left_m), ("right", shape.right_m)):
        nodes = made.ways[members[side][0]][0]
        at = [np.array(made.nodes[node]) for node in (nodes[0], nodes[-1])]
        here = np.hypot(*(at[0] - border[0, :2])) + np.hypot(*(at[1] - border[-1, :2]))
        there = np.hypot(*(at[1] - border[0, :2])) + np.hypot(*(at[0] - border[-1, :2]))
        out.append((nodes[0], nodes[-1]) if here <= there else (nodes[-1], nodes[0]))
        assert min(here, there) < 1.2, "a border is where the lane's is: on its left, on its right"
    return tuple(zip(*out, strict=True))


def shapes_of(network):
    return {each.ref: each for each in lane_shapes(network, drivable_only=True) if each.length_m > 0.0}


def test_lanelets_that_follow_each_other_share_the_nodes_at_their_ends_and_no_others_do(made, network):
    shapes = shapes_of(network)
    ends = {ref: ends_of(made, shape) for ref, shape in shapes.items()}
    expected = {(ref, after) for ref, shape in shapes.items() for after in shape.successors if after in shapes}
    found = {(one, other) for one in ends for other in ends if ends[one][1] == ends[other][0]}
    assert found == expected
    assert len(expected) > len(shapes) / 2


def test_lanes_beside_each_other_share_a_border_but_where_another_lane_begins_between_them(made, network):
    shapes = shapes_of(network)
    apart, together = set(), set()
    for ref, shape in shapes.items():
        if shape.left in shapes:
            (left,) = made.relations[made.lanelet(ref)][0]["left"]
            (across,) = made.relations[made.lanelet(shape.left)][0]["right" if shape.left_same_way else "left"]
            (together if left == across else apart).add(ref)
    turn_lanes = {ref.road_id for ref, shape in shapes.items() if shape.type is LaneType.BIDIRECTIONAL}
    for ref in apart:
        next_to = {each.road_id for each in (*shapes[ref].predecessors, *shapes[ref].successors)}
        assert turn_lanes & {ref.road_id, *next_to}
    assert 0 < len(apart) < len(together) / 10
    for ref, shape in shapes.items():
        for left, right in ends_of(made, shape):
            assert left != right, f"{ref} has two corners at each end"


def test_places_are_those_of_the_map_in_both_frames(made, network):
    local = network.frame.to_local(*np.array(list(made.degrees.values())).T)
    np.testing.assert_allclose(local, np.array(list(made.nodes.values())), atol=1e-3)


def test_limits_hold_for_their_lanes_in_words_that_readers_take(made, network):
    limits = made.elements("speed_limit")
    for ref, shape in shapes_of(network).items():
        members, tags = made.relations[made.lanelet(ref)]
        found = [limits[each][1]["sign_type"] for each in members.get("regulatory_element", ()) if each in limits]
        if shape.speed_mps is None:
            assert found == []
            assert "speed_limit" not in tags
        else:
            (posted,) = found
            value, unit = posted.split(" ")
            assert unit == "mph"
            assert float(value) * 0.44704 == pytest.approx(shape.speed_mps, abs=0.01)
            assert float(tags["speed_limit"]) / 3.6 == pytest.approx(shape.speed_mps, abs=0.01)


def test_lights_and_stop_signs_have_the_lanes_that_pass_them_and_a_line_across_these(made, network):
    shapes = shapes_of(network)
    on_the_map = [signal.type for road in network.roads for signal in road.signals]
    lights, signs = made.elements("traffic_light"), made.elements("traffic_sign")
    stops = {i: r for i, r in signs.items() if made.ways[r[0]["refers"][0]][1]["subtype"] == "stop_sign"}
    assert len(lights) == on_the_map.count("1000001") > 0
    assert len(stops) == on_the_map.count("206") > 0
    assert len(signs) - len(stops) == on_the_map.count("205")
    for number, (members, _) in {**lights, **stops}.items():
        (line,) = members["ref_line"]
        across = shapely.LineString([made.nodes[node] for node in made.ways[line][0]])
        passing = [
            shape
            for ref, shape in shapes.items()
            if number in made.relations[made.lanelet(ref)][0].get("regulatory_element", ())
        ]
        assert passing
        for shape in passing:
            lane = shapely.Polygon(np.concatenate([shape.left_m, shape.right_m[::-1]])[:, :2])
            assert across.intersection(lane.buffer(0.05)).length > 2.0


def test_lanes_that_yield_at_a_junction_are_named_apart_from_those_that_go_first(made):
    ordered = {**made.elements("right_of_way"), **made.elements("all_way_stop")}
    assert ordered
    for number, (members, tags) in ordered.items():
        assert bool(members.get("right_of_way")) == (tags["subtype"] == "right_of_way")
        for lanelet in [*members["yield"], *members.get("right_of_way", ())]:
            assert number in made.relations[lanelet][0]["regulatory_element"]


def test_where_traffic_keeps_left_the_left_border_is_on_the_left() -> None:
    town = Path(SAMPLE) / "osm" / "merrow.osm"
    network = trace_dag.road_map(town, at=(41.8290, -101.5400), radius_m=200.0, left_hand=True).network
    made = read(lanelets(network))
    for shape in shapes_of(network).values():
        middle, ahead = shape.centre_m[0, :2], shape.centre_m[1, :2] - shape.centre_m[0, :2]
        (left, right), _ = ends_of(made, shape)
        to_left, to_right = (np.array(made.nodes[node]) - middle for node in (left, right))
        if np.hypot(*(to_left - to_right)) > 1.0:
            assert ahead[0] * to_left[1] - ahead[1] * to_left[0] > 0.0
            assert ahead[0] * to_right[1] - ahead[1] * to_right[0] < 0.0
