"""Crosswalks, sidewalks and cycle lanes: from OpenStreetMap's tags and ways into the map, its file, and the questions
asked of it. Places are worked out by hand from the streets' own numbers."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from tests.roads import judges
from tests.roads.towns import FRAME, SETTINGS, Town, straight_street
from trace_dag.common.settings import OsmSettings
from trace_dag.osm.catalog import MapCatalog
from trace_dag.osm.types import OsmExtract, Site
from trace_dag.osm.xml import read_osm, write_osm
from trace_dag.roads.from_osm.convert import convert
from trace_dag.roads.from_osm.tag_values import Beside, read_beside
from trace_dag.roads.gates.gates import check_map
from trace_dag.roads.map.model import Crosswalk, LaneRef, LaneType, Road
from trace_dag.roads.map.network import RoadNetwork
from trace_dag.roads.map.people import crosswalks, crosswalks_near, lanes_beside
from trace_dag.roads.map.reader import read_opendrive
from trace_dag.roads.map.rules import StoredMap
from trace_dag.roads.map.writer import write_opendrive

_LANE_M = 3.35  # of a residential street


def _sidewalks_at(network, road_id, s_m):
    """The sidewalk left and the one right of a road's reference line at a station."""
    found = {beside.lane.lane_id > 0: beside for beside in lanes_beside(network, road_id, s_m, LaneType.SIDEWALK)}
    return found.get(True), found.get(False)


@pytest.mark.parametrize(
    ("tags", "expected"),
    [
        ({}, Beside()),
        ({"sidewalk": "both"}, Beside(1.5, 1.5)),
        ({"sidewalk": "right"}, Beside(None, 1.5)),
        ({"sidewalk": "separate"}, Beside()),
        ({"sidewalk:left": "yes", "sidewalk:right": "separate"}, Beside(1.5, None)),
        ({"sidewalk:both": "yes", "sidewalk:both:width": "2.5"}, Beside(2.5, 2.5)),
        ({"cycleway": "lane"}, Beside(None, None, 1.5, 1.5)),
        ({"cycleway:right": "lane"}, Beside(None, None, None, 1.5)),
        ({"cycleway:both": "shared_lane"}, Beside()),
        ({"cycleway:left": "track", "cycleway:left:width": "6 ft"}, Beside(None, None, 1.8288, None)),
    ],
)
def test_tags_of_a_two_way_street(tags: Mapping[str, str], expected: Beside) -> None:
    assert read_beside(tags, oneway=False) == pytest.approx(expected)


@pytest.mark.parametrize(
    ("tags", "expected"),
    [
        ({"cycleway": "lane"}, Beside(None, None, None, 1.5)),
        ({"oneway:bicycle": "no", "lanes:backward": "1"}, Beside(None, None, 1.5, None)),
        ({"cycleway": "opposite_lane"}, Beside(None, None, 1.5, None)),
        ({"cycleway:left": "lane"}, Beside(None, None, 1.5, None)),
    ],
)
def test_the_cycle_lane_of_a_one_way_street_is_on_its_right(tags: Mapping[str, str], expected: Beside) -> None:
    assert read_beside(tags, oneway=True) == expected


def test_cycle_lane_next_to_traffic_then_parking_then_sidewalk() -> None:
    network = straight_street(sidewalk="right", cycleway__right="lane", parking__right="lane")
    road = network.roads[0]
    lanes = {lane.id: lane.type for lane in road.lane_sections[0].lanes}
    assert lanes == {
        1: LaneType.DRIVING,
        0: LaneType.NONE,
        -1: LaneType.DRIVING,
        -2: LaneType.BIKING,
        -3: LaneType.PARKING,
        -4: LaneType.SIDEWALK,
    }
    (cycle,) = lanes_beside(network, road.id, 100.0, LaneType.BIKING)
    assert cycle.t_m == pytest.approx(-_LANE_M - 0.75)
    left, right = _sidewalks_at(network, road.id, 100.0)
    assert left is None
    assert right is not None
    assert right.t_m == pytest.approx(-_LANE_M - 1.5 - 2.2 - 0.75)
    assert right.width_m == pytest.approx(1.5)


def test_a_sidewalk_of_its_own_is_laid_where_it_is() -> None:
    """6 m from the middle of the street: the verge is what is left of that beyond lane and half the sidewalk."""
    town = Town()
    town.street([(-100, 0), (100, 0)])
    town.walkway([(-60, 6), (40, 6)], footway="sidewalk")
    town.walkway([(-60, 30), (40, 30)], footway="sidewalk")  # through a park
    network = town.network()
    road = network.roads[0]
    left, right = _sidewalks_at(network, road.id, 100.0)
    assert right is None
    assert left is not None
    assert left.t_m == pytest.approx(6.0, abs=0.05)
    assert _sidewalks_at(network, road.id, 30.0) == (None, None)  # at x = -70 it has not begun
    assert _sidewalks_at(network, road.id, 150.0) == (None, None)


@pytest.mark.parametrize("path", [[(-60, 40), (40, 40)], [(10, -12), (10, 12)]], ids=["far away", "across"])
def test_sidewalks_that_run_along_no_street_are_left_out(path: list[tuple[float, float]]) -> None:
    town = Town()
    town.street([(-100, 0), (100, 0)])
    town.walkway(path, footway="sidewalk")
    network = town.network()
    assert _sidewalks_at(network, network.roads[0].id, 100.0) == (None, None)


def test_no_sidewalk_lies_on_another_carriageway() -> None:
    """The carriageways of a divided road, 8 m apart: the left sidewalk of either would be the other's left lane."""
    town = Town()
    town.street([(-100, -4), (100, -4)], oneway="yes", lanes="2", sidewalk="both")
    town.street([(100, 4), (-100, 4)], oneway="yes", lanes="2", sidewalk="both")
    network = town.network()
    assert len(network.roads) == 2
    for road in network.roads:
        left, right = _sidewalks_at(network, road.id, road.length_m / 2)
        assert left is None
        assert right is not None


def test_traffic_drives_where_it_would_without_people() -> None:
    """Lanes to drive in, their places, heights and links are the same to the last bit."""

    def town(**tags: str) -> RoadNetwork:
        made = Town()
        made.street([(-150, 0), (0, 0)], lanes="2", **tags)
        made.street([(0, 0), (150, 0)], lanes="4", **tags)
        made.street([(0, -150), (0, 0), (0, 150)], incline="3%", **tags)
        if tags:
            made.sign(-12, 0, highway="crossing")
            made.walkway([(-60, 8), (-10, 8)], footway="sidewalk")
            # A node on a road changes the road's polyline, though not its line: both towns have it.
        else:
            made.sign(-12, 0)
        return made.network()

    plain, full = town(), town(sidewalk="both", cycleway="lane")
    assert plain.drivable_lanes() == full.drivable_lanes()
    for ref in plain.drivable_lanes():
        one, two = plain.geometry(ref), full.geometry(ref)
        stations = np.linspace(one.begin_m, one.end_m, 9)
        assert np.array_equal(one.sample(stations), two.sample(stations))
        assert np.array_equal(one.width.sample(stations), two.width.sample(stations))
        assert plain.successors(ref) == full.successors(ref)
    assert any(lane.type is LaneType.SIDEWALK for lane in map(full.lane, full.lanes()))


def _crossed(**crossing: str) -> Town:
    town = Town()
    town.street([(-100, 0), (-40, 0), (0, 0), (100, 0)], highway="secondary", lanes="4", sidewalk="both")
    town.sign(0, 0, highway="crossing", **crossing)
    return town


def test_a_crossing_is_a_crosswalk_from_edge_to_edge() -> None:
    """Four lanes of 3.5 m: it reaches 7 m to either side; 10 ft wide."""
    network = _crossed().network()
    (place,) = crosswalks(network)
    corners = np.array([(-1.525, -7.0), (1.525, -7.0), (1.525, 7.0), (-1.525, 7.0)])
    assert place.corners_m == pytest.approx(corners, abs=0.01)
    assert place.ends_m == pytest.approx(np.array([[0, -7], [0, 7]]), abs=0.01)
    assert place.distance_m(0.0, 3.0) == 0.0
    assert place.distance_m(11.525, 0.0) == pytest.approx(10.0, abs=0.01)
    assert crosswalks_near(network, 11.525, 0.0, 9.0) == []
    assert [found.crosswalk for found in crosswalks_near(network, 11.525, 0.0, 11.0)] == [place.crosswalk]


@pytest.mark.parametrize(
    ("tags", "marked", "signals"),
    [
        ({}, True, False),
        ({"crossing": "unmarked"}, False, False),
        ({"crossing": "traffic_signals"}, True, True),
        ({"crossing:markings": "no", "crossing:signals": "yes"}, False, True),
    ],
)
def test_the_tags_of_a_crossing_are_kept(tags: dict[str, str], marked: bool, signals: bool) -> None:
    (place,) = crosswalks(_crossed(**tags).network())
    assert (place.crosswalk.marked, place.crosswalk.signals) == (marked, signals)


def test_no_crossing_is_no_crosswalk() -> None:
    assert crosswalks(_crossed(crossing="no").network()) == []


def test_a_skewed_crossing_leads_the_way_its_way_does() -> None:
    """One metre along the street per two across it: 7 m to the side it is 3.5 m further on."""
    town = _crossed()
    town.walkway([(-6, -12), (0, 0), (6, 12)], footway="crossing")
    (place,) = crosswalks(town.network())
    assert place.ends_m == pytest.approx(np.array([[-3.5, -7], [3.5, 7]]), abs=0.01)


def test_a_crossing_that_shares_no_node_with_the_street_crosses_it_all_the_same() -> None:
    town = Town()
    town.street([(-100, 0), (100, 0)])
    town.walkway([(20, -9), (20, 9)], footway="crossing")
    (place,) = crosswalks(town.network())
    assert place.ends_m == pytest.approx(np.array([[20, -_LANE_M], [20, _LANE_M]]), abs=0.01)


def test_a_bridge_for_people_is_no_crosswalk() -> None:
    town = Town()
    town.street([(-100, 0), (100, 0)])
    town.walkway([(20, -9), (20, 9)], footway="crossing", bridge="yes", layer="1")
    assert crosswalks(town.network()) == []


def test_a_crosswalk_at_a_junction_belongs_to_the_road_it_crosses() -> None:
    """8 m from the middle of the junction, where the road is cut back for the turns: its outline lies there still."""
    town = Town()
    town.street([(-100, 0), (-8, 0), (0, 0), (100, 0)])
    town.street([(0, -100), (0, 0), (0, 100)])
    town.sign(-8, 0, highway="crossing")
    (place,) = crosswalks(town.network())
    assert place.corners_m.mean(axis=0) == pytest.approx([-8.0, 0.0], abs=0.01)
    assert place.ends_m[:, 1] == pytest.approx([-_LANE_M, _LANE_M], abs=0.01)


def _everything() -> Town:
    town = _crossed(crossing="traffic_signals")
    town.street([(-40, -100), (-40, 0)], cycleway="lane", sidewalk="left")
    town.street([(-40, 0), (-40, 100)], cycleway="lane", sidewalk="left")
    town.walkway([(20, -9), (90, -9)], footway="sidewalk")
    town.walkway([(60, -12), (62, 12)], footway="crossing", crossing="unmarked")
    town.sign(-40, 30, highway="crossing")
    return town


def test_the_file_keeps_what_the_map_has() -> None:
    network = _everything().network()
    read = read_opendrive(write_opendrive(network), name="map")
    for one, two in zip(crosswalks(read), crosswalks(network), strict=True):
        assert replace(one.crosswalk, s_m=0.0, outline_m=()) == replace(two.crosswalk, s_m=0.0, outline_m=())
        assert one.corners_m == pytest.approx(two.corners_m, abs=1e-6)
    assert [len(road.lane_sections) for road in read.roads] == [len(road.lane_sections) for road in network.roads]
    for ref in network.lanes():
        assert replace(read.lane(ref), widths=()) == replace(network.lane(ref), widths=())
        stations = np.linspace(*network.lane_span(ref), 9)
        there, here = read.geometry(ref).width.sample(stations), network.geometry(ref).width.sample(stations)
        assert there == pytest.approx(here, abs=1e-6)


def test_crosswalks_of_other_converters_are_read() -> None:
    """Turned by a right angle and 2 m to the left; corners given along the road; an outline of two corners is none."""
    xodr = write_opendrive(straight_street()).decode()
    objects = (
        '<object type="crosswalk" id="a" s="10" t="2" zOffset="0" hdg="1.5707963267948966"><outlines><outline>'
        '<cornerLocal u="1" v="0" z="0" height="0"/><cornerLocal u="0" v="3" z="0" height="0"/>'
        '<cornerLocal u="-1" v="0" z="0" height="0"/></outline></outlines></object>'
        '<object type="crosswalk" id="b" s="20" t="0" zOffset="0"><outline><cornerRoad s="19" t="-3"/>'
        '<cornerRoad s="21" t="-3"/><cornerRoad s="21" t="3"/></outline></object>'
        '<object type="crosswalk" id="c" s="30" t="0" zOffset="0"><outline><cornerRoad s="19" t="-3"/>'
        '<cornerRoad s="21" t="-3"/></outline></object>'
        '<object type="pole" id="d" s="30" t="4" zOffset="0"/>'
    )
    network = read_opendrive(xodr.replace("<objects>", f"<objects>{objects}").encode(), name="other")
    one, two = network.roads[0].crosswalks
    assert np.array(one.outline_m) == pytest.approx(np.array([[0, 3], [-3, 2], [0, 1]]))
    assert two == Crosswalk("b", 20.0, ((-1.0, -3.0), (1.0, -3.0), (1.0, 3.0)))


def test_every_gate_holds_and_those_for_people_are_measured() -> None:
    extract = _everything().extract()
    network = convert(extract, FRAME, SETTINGS)
    gates = {gate.name: gate for gate in check_map(network, extract, StoredMap(write_opendrive(network)))}
    assert [name for name, gate in gates.items() if gate.passed is False] == []
    assert gates["crosswalk_place"].value == 0.0
    assert gates["lanes_beside_on_roadway"].value == 0.0


def test_carla_has_the_crosswalks_where_we_have_them() -> None:
    network = _everything().network()
    corners = {(round(p.x, 1), round(-p.y, 1)) for p in judges.carla_map(write_opendrive(network)).get_crosswalks()}
    expected = {(round(x, 1), round(y, 1)) for place in crosswalks(network) for x, y in place.corners_m.tolist()}
    assert {(x + 0.0, y + 0.0) for x, y in corners} == {(x + 0.0, y + 0.0) for x, y in expected}


def test_the_official_checker_finds_nothing(tmp_path: Path) -> None:
    path = tmp_path / "everything.xodr"
    path.write_bytes(write_opendrive(_everything().network()))
    (result,) = judges.official_check([path])
    assert result["issues"] == []


def test_walkways_come_with_the_roads_and_are_none(tmp_path: Path) -> None:
    """They pass through file and cut; a place with nothing but footways has no map."""
    extract = _everything().extract()
    (tmp_path / "town.osm").write_bytes(write_osm(extract))
    site = Site("a", 37.0, -77.0)
    found = MapCatalog.open([tmp_path / "town.osm"]).extract([site], OsmSettings())["a"]
    assert isinstance(found, OsmExtract)
    assert {way.id for way in found.walkways} == {way.id for way in extract.walkways}
    assert {way.id for way in found.ways} == {way.id for way in extract.ways}
    assert read_osm(write_osm(found), name="again").walkways == found.walkways
    lonely = Town()
    lonely.walkway([(-50, 0), (50, 0)], footway="sidewalk")
    (tmp_path / "lonely.osm").write_bytes(write_osm(lonely.extract()))
    rejected = MapCatalog.open([tmp_path / "lonely.osm"]).extract([site], OsmSettings())["a"]
    assert not isinstance(rejected, OsmExtract)


def _lanes_through_junctions(network: RoadNetwork, kind: LaneType) -> dict[frozenset[str], Road]:
    """Roads of junctions with a lane of one kind, by the names of the two roads they lead between."""
    found = {}
    for road in network.roads:
        if road.junction_id is not None and any(lane.type is kind for lane in road.lane_sections[0].lanes):
            assert road.predecessor is not None
            assert road.successor is not None
            ends = (road.predecessor.element_id, road.successor.element_id)
            found[frozenset(network.road_by_id[end].name for end in ends)] = road
    return found


def _arms_with(**tags: str) -> RoadNetwork:
    """A crossing of four streets, each named by where it leads from there."""
    town = Town()
    for name, end in (("east", (100, 0)), ("north", (0, 100)), ("west", (-100, 0)), ("south", (0, -100))):
        town.street([(0, 0), end], name=name, incline="2%", **tags)
    return town.network()


def test_sidewalks_go_round_the_corners_of_a_junction() -> None:
    """Each joins two streets side by side, touches the sidewalks of both, and keeps their width and height."""
    network = _arms_with(sidewalk="both")
    found = _lanes_through_junctions(network, LaneType.SIDEWALK)
    sides = ("east", "north", "west", "south")
    assert set(found) == {frozenset(pair) for pair in zip(sides, (*sides[1:], sides[0]), strict=True)}
    for road in found.values():
        (ref,) = (ref for ref in network.lanes() if ref.road_id == road.id)
        lane, geometry = network.lane(ref), network.geometry(ref)
        for link, lane_id, s_m in (
            (road.predecessor, lane.predecessor, 0.0),
            (road.successor, lane.successor, road.length_m),
        ):
            assert link is not None
            assert lane_id is not None
            arm = network.road_by_id[link.element_id]
            at_start = link.contact_point == "start"
            there = network.geometry(LaneRef(arm.id, 0 if at_start else len(arm.lane_sections) - 1, lane_id))
            assert there.lane.type is LaneType.SIDEWALK
            arm_s_m = 0.0 if at_start else arm.length_m
            here, beyond = geometry.pose(s_m), there.pose(arm_s_m)
            gap_m = (here.x_m - beyond.x_m, here.y_m - beyond.y_m, here.z_m - beyond.z_m)
            assert gap_m == pytest.approx((0, 0, 0), abs=1e-6)
            assert geometry.width.at(s_m) == pytest.approx(there.width.at(arm_s_m))
        for x_m, y_m, *_ in geometry.between(0.0, road.length_m, 0.5).tolist():
            assert not [match for match in network.nearest_lanes(x_m, y_m, 0.0) if match.outside_m <= 0]


def test_a_sidewalk_goes_on_past_a_street_that_joins_on_the_other_side() -> None:
    town = Town()
    town.street([(-100, 0), (0, 0)], name="west", sidewalk="both")
    town.street([(0, 0), (100, 0)], name="east", sidewalk="both")
    town.street([(0, 0), (0, 100)], name="north")
    (ends,) = _lanes_through_junctions(town.network(), LaneType.SIDEWALK)
    assert ends == {"west", "east"}


def test_cycle_lanes_go_on_straight_and_to_the_right() -> None:
    network = _arms_with(cycleway="lane")
    roads = [
        r
        for r in network.roads
        if r.junction_id and any(lane.type is LaneType.BIKING for lane in r.lane_sections[0].lanes)
    ]
    ends = {
        tuple(network.road_by_id[link.element_id].name for link in (road.predecessor, road.successor) if link)
        for road in roads
    }
    right_of = {"east": "north", "north": "west", "west": "south", "south": "east"}  # coming from there
    straight = {("east", "west"), ("west", "east"), ("north", "south"), ("south", "north")}
    assert ends == straight | set(right_of.items())
    assert len(roads) == len(ends)


def _edges(network: RoadNetwork) -> Iterator[tuple[LaneRef, np.ndarray]]:
    """Both edges of every lane, half a metre from place to place, seen along the reference line."""
    for ref in network.lanes():
        lane = network.geometry(ref)
        s_m = np.linspace(lane.begin_m + 1e-6, lane.end_m - 1e-6, max(3, int(2 * (lane.end_m - lane.begin_m))))
        line, half = lane.road.line.sample(s_m), lane.width.sample(s_m) / 2
        for t in (lane.centre.sample(s_m) - half, lane.centre.sample(s_m) + half):
            at = np.column_stack([line[:, 0] - t * np.sin(line[:, 2]), line[:, 1] + t * np.cos(line[:, 2])])
            heading = (line[1:, 2] + line[:-1, 2]) / 2
            yield ref, (np.diff(at, axis=0) * np.column_stack([np.cos(heading), np.sin(heading)])).sum(axis=1)


@pytest.mark.parametrize("bend_m", [(6.0, 8.0), (3.0, 3.0), (0.5, 6.0)])
def test_no_edge_folds_over_inside_a_bend(bend_m: tuple[float, float]) -> None:
    town = Town()
    x, y = bend_m
    town.street([(-80, 0), (0, 0), (x, y), (x - 2, y + 80)], sidewalk="both", cycleway="lane")
    town.street([(-80, 0), (-80, -70)], sidewalk="both")
    town.street([(-80, 0), (-140, 30)], sidewalk="both")
    edges = list(_edges(town.network()))
    assert edges
    for ref, forward_m in edges:
        assert (forward_m > -1e-6).all(), ref
