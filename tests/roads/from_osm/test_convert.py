"""OSM to lanes: what a driver may do on the map is what the tags and the geometry say."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest

from tests.roads.towns import FRAME, SETTINGS, Town
from trace_dag.osm.types import OsmExtract, OsmMember, OsmRelation
from trace_dag.roads.from_osm.convert import convert
from trace_dag.roads.from_osm.converter import WayHints
from trace_dag.roads.from_osm.way_direction import along_traffic
from trace_dag.roads.gates.measures import find_stranded_lanes, link_gaps, one_sided_links
from trace_dag.roads.map.model import ContactPoint, LaneRef, LaneType, Road
from trace_dag.roads.map.network import RoadNetwork


def streets(network: RoadNetwork) -> list[Road]:
    """Roads that are not connecting roads."""
    return [road for road in network.roads if road.junction_id is None]


def at(network: RoadNetwork, x: float, y: float, heading_deg: float) -> LaneRef:
    """The lane at a place whose traffic goes in a direction."""
    for match in network.nearest_lanes(x, y, 6.0):
        pose = network.pose(match.lane, match.s_m)
        if abs(math.remainder(pose.heading_rad - math.radians(heading_deg), math.tau)) < 0.5:
            return match.lane
    raise AssertionError(f"no lane towards {heading_deg} degrees at ({x}, {y})")


def exits(network: RoadNetwork, start: LaneRef) -> set[str]:
    """Names of the streets one can be on after the next junction."""
    return {
        network.road_by_id[after.road_id].name
        for inside in network.successors(start)
        for after in network.successors(inside)
    }


def lane_turns(network: RoadNetwork, start: LaneRef) -> set[str | None]:
    """How one may turn from a lane."""
    return {network.road_by_id[ref.road_id].turn for ref in network.successors(start)}


def cross(**main_tags: str) -> Town:
    """A crossing of two streets at the origin, each arm with its own name."""
    town = Town()
    town.street([(-150, 0), (0, 0)], highway="primary", name="West", **main_tags)
    town.street([(0, 0), (150, 0)], highway="primary", name="East", **main_tags)
    town.street([(0, -150), (0, 0)], highway="residential", name="South")
    town.street([(0, 0), (0, 150)], highway="residential", name="North")
    return town


def with_restriction(extract: OsmExtract, kind: str, origin: int, via: int, target: int) -> OsmExtract:
    """The extract with one turn restriction."""
    members = (OsmMember("way", origin, "from"), OsmMember("node", via, "via"), OsmMember("way", target, "to"))
    return replace(extract, relations=(OsmRelation(1, members, {"type": "restriction", "restriction": kind}),))


# --- streets -----------------------------------------------------------------------------------------------------
def test_a_two_way_street_is_one_road_along_its_way() -> None:
    town = Town()
    town.street([(-100, 10), (0, 10), (80, 60)], lanes="2", name="Oak Street")
    (road,) = streets(town.network())
    assert sorted(lane.id for lane in road.lane_sections[0].lanes) == [-1, 0, 1]
    assert (road.name, road.osm_way_ids, road.lanes_from_tags) == ("Oak Street", (1,), True)
    assert not road.lane_offset
    first = road.plan[0]
    assert (first.x_m, first.y_m) == pytest.approx((-100, 10), abs=1e-3)


def test_traffic_keeps_right_and_one_way_lanes_lie_about_the_way() -> None:
    town = Town()
    town.street([(-100, 0), (100, 0)])
    town.street([(100, 50), (-100, 50)], oneway="yes", lanes="2", highway="secondary")
    town.street([(-100, 90), (100, 90)], oneway="-1", lanes="1", highway="secondary")
    network = town.network()
    assert network.pose(at(network, 0, -1.7, 0), 100).y_m == pytest.approx(-1.675, abs=1e-3)
    assert network.pose(at(network, 0, 1.7, 180), 100).y_m == pytest.approx(1.675, abs=1e-3)
    ys = sorted(network.pose(match.lane, 100).y_m for match in network.nearest_lanes(0, 50, 5))
    assert ys == pytest.approx([48.25, 51.75], abs=1e-3)
    assert network.pose(at(network, 0, 90, 180), 100).y_m == pytest.approx(90, abs=1e-3)


def test_a_wider_direction_keeps_the_carriageway_on_the_way() -> None:
    town = Town()
    town.street([(-100, 0), (100, 0)], highway="secondary", lanes="3", lanes__forward="2", lanes__backward="1")
    network = town.network()
    ys = sorted(network.pose(match.lane, 100).y_m for match in network.nearest_lanes(0, 0, 8))
    assert ys == pytest.approx([-3.5, 0.0, 3.5], abs=1e-3)


def test_a_centre_turn_lane_lies_between_the_directions() -> None:
    town = Town()
    town.street(
        [(-100, 0), (100, 0)], highway="secondary", lanes="5", lanes__both_ways="1", turn__lanes__both_ways="left"
    )
    (road,) = streets(town.network())
    types = [lane.type for lane in road.lane_sections[0].lanes]
    assert types.count(LaneType.BIDIRECTIONAL) == 1
    assert types.count(LaneType.DRIVING) == 4


def test_lanes_open_and_close_along_one_road() -> None:
    town = Town()
    town.street([(-200, 0), (0, 0)], highway="primary", lanes="4", name="Main")
    town.street([(0, 0), (200, 0)], highway="primary", lanes="2", name="Main")
    network = town.network()
    (road,) = streets(network)
    assert [len(section.lanes) for section in road.lane_sections] == [5, 3]
    # The through lanes go on, the outer ones end within the first section.
    through, ending = LaneRef(road.id, 0, -1), LaneRef(road.id, 0, -2)
    assert network.successors(through) == (LaneRef(road.id, 1, -1),)
    assert network.successors(ending) == ()
    assert network.width_m(ending, 100) == pytest.approx(3.5)
    assert network.width_m(ending, network.lane_span(ending)[1]) == pytest.approx(0, abs=1e-6)
    gaps = [abs(a.y_m - b.y_m) for a, b in [(network.pose(through, 200), network.pose(LaneRef(road.id, 1, -1), 200))]]
    assert gaps == pytest.approx([0], abs=1e-6)


def test_a_street_that_changes_its_name_is_two_linked_roads() -> None:
    town = Town()
    town.street([(-200, 0), (0, 0)], name="Old Road")
    town.street([(200, 0), (0, 0)], name="New Road")  # drawn the other way round
    network = town.network()
    assert {road.name for road in streets(network)} == {"Old Road", "New Road"}
    assert exits(network, at(network, -100, -1.7, 0)) == set()  # no junction in between
    after = network.successors(at(network, -100, -1.7, 0))
    assert [network.road_by_id[ref.road_id].name for ref in after] == ["New Road"]
    assert not network.junctions


# --- junctions ---------------------------------------------------------------------------------------------------
def test_every_movement_of_a_crossing_exists_and_none_turns_back() -> None:
    network = cross().network()
    assert len(network.junctions) == 1
    assert exits(network, at(network, -100, -1.7, 0)) == {"East", "North", "South"}
    assert exits(network, at(network, 1.7, -100, 90)) == {"West", "East", "North"}


def test_left_and_right_are_left_and_right() -> None:
    network = cross().network()
    towards = {
        network.road_by_id[after.road_id].name: network.road_by_id[inside.road_id].turn
        for inside in network.successors(at(network, -100, -1.7, 0))
        for after in network.successors(inside)
    }
    assert towards == {"East": "straight", "North": "left", "South": "right"}


@pytest.mark.parametrize(
    ("kind", "expected"),
    [
        ("no_left_turn", {"East", "South"}),
        ("no_straight_on", {"East", "South"}),
        ("only_left_turn", {"North"}),
    ],
)
def test_turn_restrictions_hold_for_the_way_they_name(kind: str, expected: set[str]) -> None:
    town = cross()
    extract = town.extract()
    centre = extract.ways[0].node_ids[-1]
    network = convert(with_restriction(extract, kind, 1, centre, 4), FRAME, SETTINGS)
    assert exits(network, at(network, -100, -1.7, 0)) == expected
    assert exits(network, at(network, 100, 1.7, 180)) == {"West", "North", "South"}


def test_restrictions_for_others_than_cars_do_not_hold() -> None:
    town = cross()
    extract = with_restriction(town.extract(), "no_left_turn", 1, town.extract().ways[0].node_ids[-1], 4)
    tags = {**extract.relations[0].tags, "except": "motorcar;bicycle"}
    extract = replace(extract, relations=(replace(extract.relations[0], tags=tags),))
    network = convert(along_traffic(extract), FRAME, SETTINGS)
    assert "North" in exits(network, at(network, -100, -1.7, 0))


def test_one_way_streets_are_not_entered_from_their_end() -> None:
    town = Town()
    town.street([(-150, 0), (0, 0)], name="West")
    town.street([(0, 0), (150, 0)], name="East")
    town.street([(0, 150), (0, 0)], name="North", oneway="yes")
    network = town.network()
    assert exits(network, at(network, -100, -1.7, 0)) == {"East"}
    assert exits(network, at(network, 0, 100, -90)) == {"East", "West"}


def test_painted_lanes_go_where_they_are_painted_for() -> None:
    town = Town()
    town.street([(-150, 0), (0, 0)], highway="primary", name="West", oneway="yes", turn__lanes="left|through|right")
    town.street([(0, 0), (150, 0)], highway="primary", name="East", oneway="yes", lanes="1")
    town.street([(0, -150), (0, 0)], name="South")
    town.street([(0, 0), (0, 150)], name="North")
    network = town.network()
    found = {
        network.lane(match.lane).turns: lane_turns(network, match.lane) for match in network.nearest_lanes(-60, 0, 8)
    }
    assert found == {("left",): {"left"}, ("through",): {"straight"}, ("right",): {"right"}}


def test_turn_lanes_of_a_later_junction_go_straight_on_at_a_driveway() -> None:
    town = Town()
    tags = {"highway": "primary", "oneway": "yes", "turn__lanes": "left|through|through"}
    town.street([(-150, 0), (0, 0)], name="West", **tags)
    town.street([(0, 0), (150, 0)], name="East", **tags)
    town.street([(0, 0), (0, -60)], highway="service", name="Drive")
    network = town.network()
    lanes = network.nearest_lanes(-60, 0, 8)
    assert len(lanes) == 3
    for match in lanes:
        assert "East" in exits(network, match.lane)


def test_the_crossings_of_a_divided_road_are_one_junction() -> None:
    town = Town()
    town.street([(-200, -8), (0, -8), (200, -8)], highway="primary", name="Main", oneway="yes", lanes="2")
    town.street([(200, 8), (0, 8), (-200, 8)], highway="primary", name="Main", oneway="yes", lanes="2")
    town.street([(0, -150), (0, -8)], name="South")
    town.street([(0, -8), (0, 8)], name="Between")
    town.street([(0, 8), (0, 150)], name="North")
    network = town.network()
    (junction,) = network.junctions
    assert len(junction.osm_node_ids) == 2
    assert exits(network, at(network, 1.7, -100, 90)) == {"North", "Main"}
    assert lane_turns(network, at(network, 1.7, -100, 90)) == {"straight", "left", "right"}
    assert "Between" not in {road.name for road in network.roads}


def test_lanes_shift_gently_where_a_street_is_divided() -> None:
    """Its one lane becomes the two of a carriageway that begins as wide as the street."""
    town = Town()
    town.street([(-150, 0), (0, 0)], highway="primary", lanes="2")
    town.street([(0, 0), (150, -8)], highway="primary", oneway="yes", lanes="2")
    town.street([(150, 8), (0, 0)], highway="primary", oneway="yes", lanes="2")
    network = town.network()
    connecting = [road for road in network.roads if road.junction_id is not None]
    assert len(connecting) >= 2
    for road in connecting:
        centre = network.geometry(LaneRef(road.id, 0, -1)).centre
        borders = centre.sample(np.linspace(0.0, road.length_m, 50))
        assert np.abs(np.gradient(borders, road.length_m / 49)).max() < 0.75, "a step of 1 m moves at most 1.25 m"


def test_a_roundabout_runs_counter_clockwise_and_stays_a_ring() -> None:
    town = Town()
    ring = [(20 * math.cos(math.radians(a)), 20 * math.sin(math.radians(a))) for a in range(0, 360, 30)]
    town.street([*ring, ring[0]], junction="roundabout", name="Ring")
    for k, name in ((0, "East"), (3, "North"), (6, "West"), (9, "South")):
        x, y = ring[k]
        town.street([(x, y), (8 * x, 8 * y)], name=name)
    network = town.network()
    assert len(network.junctions) == 4
    for road in streets(network):
        if road.name == "Ring":
            pose = network.pose(LaneRef(road.id, 0, -1), road.length_m / 2)
            assert pose.x_m * math.sin(pose.heading_rad) - pose.y_m * math.cos(pose.heading_rad) > 0
    assert exits(network, at(network, 100, 1.7, 180)) == {"Ring"}


def test_roads_on_different_levels_do_not_meet() -> None:
    town = Town()
    town.street([(-300, 0), (300, 0)], highway="primary", name="Below")
    town.street([(0, -300), (0, -40)], level="up", name="Above")
    town.street([(0, -40), (0, 40)], level="up", name="Above", bridge="yes", layer="1")
    town.street([(0, 40), (0, 300)], level="up", name="Above")
    network = town.network()
    assert not network.junctions
    heights = sorted(network.pose(match.lane, match.s_m).z_m for match in network.nearest_lanes(0, 0, 5))
    assert heights[-1] - heights[0] > 4.5


def test_a_short_block_between_junctions_stays_drivable() -> None:
    town = Town()
    town.street([(-100, 0), (0, 0), (7, 0), (100, 0)], name="Main")
    town.street([(0, 0), (0, 100)], name="First")
    town.street([(7, 0), (7, -100)], name="Second")
    network = town.network()
    start = at(network, -60, -1.7, 0)
    reached, queue = set(), [start]
    while queue:
        ref = queue.pop()
        if ref not in reached:
            reached.add(ref)
            queue.extend(network.successors(ref))
    assert {"Main", "First", "Second"} <= {network.road_by_id[ref.road_id].name for ref in reached}


# --- signs -------------------------------------------------------------------------------------------------------
def test_a_stop_sign_stands_right_of_the_approach_it_holds_for() -> None:
    town = Town()
    town.street([(-150, 0), (0, 0), (150, 0)], name="Main")
    town.street([(0, 0), (0, 15), (0, 150)], name="Side")
    node = town.sign(0, 15, highway="stop")
    network = town.network()
    ((road, sign),) = [(road, sign) for road in network.roads for sign in road.signals]
    assert (sign.type, sign.osm_node_id, road.name) == ("206", node, "Side")
    # Traffic comes down from the north (against the way): the post is on its right, to the west.
    assert sign.orientation == "-"
    line = network.road_geometry(road.id).line
    x, _, heading, _ = line.at(sign.s_m)
    assert x - sign.t_m * math.sin(heading) == pytest.approx(-4.15, abs=0.2)


def test_signals_on_a_junction_hold_for_every_approach() -> None:
    town = cross()
    town.sign(0, 0, highway="traffic_signals")
    network = town.network()
    found = {(road.name, sign.orientation) for road in network.roads for sign in road.signals if sign.type == "1000001"}
    assert found == {("West", "+"), ("East", "-"), ("South", "+"), ("North", "-")}


def test_a_stop_node_on_a_junction_holds_for_the_minor_road() -> None:
    town = cross()
    town.sign(0, 0, highway="stop")
    network = town.network()
    assert {road.name for road in network.roads for sign in road.signals if sign.type == "206"} == {"North", "South"}
    town.sign(0, 0, stop="all")
    assert sum(sign.type == "206" for road in town.network().roads for sign in road.signals) == 4


def test_speed_limits_are_signed_in_mph_on_both_sides() -> None:
    town = Town()
    town.street([(-150, 0), (150, 0)], maxspeed="35 mph")
    ((road, signs),) = [(road, road.signals) for road in town.network().roads]
    assert {(sign.type, sign.value, sign.unit, sign.orientation) for sign in signs} == {
        ("274", 35.0, "mph", "+"),
        ("274", 35.0, "mph", "-"),
    }
    assert all((sign.t_m < 0) == (sign.orientation == "+") for sign in signs)
    assert road.speed_mps == pytest.approx(15.6464)


# --- hints -------------------------------------------------------------------------------------------------------
def test_hints_fill_what_is_untagged() -> None:
    town = Town()
    way = town.street([(-150, 0), (150, 0)], highway="primary")
    network = convert(town.extract(), FRAME, SETTINGS, {way: WayHints(lanes=4, speed_mps=20.0)})
    (road,) = streets(network)
    assert sum(lane.type == LaneType.DRIVING for lane in road.lane_sections[0].lanes) == 4
    assert (road.speed_mps, road.lanes_from_tags) == (20.0, False)


# --- all of it -----------------------------------------------------------------------------------------------------
def test_links_are_mutual_and_leave_no_gap() -> None:
    network = cross(lanes="4").network()
    assert not one_sided_links(network)
    assert find_stranded_lanes(network) == []
    assert max(gap.position_m for gap in link_gaps(network)) < 0.02
    assert {c.contact_point for junction in network.junctions for c in junction.connections} == {ContactPoint.START}
