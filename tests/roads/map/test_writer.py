"""What stands in the file: OpenDRIVE 1.7 that others read as it is meant, and that reads back as it was."""

from __future__ import annotations

import re
from collections import defaultdict
from dataclasses import replace

import pytest
from lxml import etree

from tests.roads.judges import carla_landmarks, carla_map, carla_steps
from tests.roads.towns import FRAME, Town
from trace_dag.roads.from_osm.left_hand import mirror_network
from trace_dag.roads.map.model import Road
from trace_dag.roads.map.network import RoadNetwork
from trace_dag.roads.map.reader import read_opendrive
from trace_dag.roads.map.rules import find_violations
from trace_dag.roads.map.writer import write_opendrive


@pytest.fixture(scope="module")
def network() -> RoadNetwork:
    """A crossing with a bit of everything: lanes, signs, names, a bridge, a centre turn lane."""
    town = Town()
    town.street([(-250, 0), (0, 0)], highway="primary", name="Café & Sons <Road>", lanes="5", maxspeed="45 mph")
    town.street(
        [(0, 0), (250, 0)], highway="primary", ref="US 1", turn__lanes__backward="left|through;right", lanes="4"
    )
    town.street([(0, -250), (0, 0), (0, 20), (60, 250)], highway="residential", name="Side")
    town.street([(120, -200), (120, -60)], level="up", name="Over")
    town.street([(120, -60), (120, 60)], level="up", name="Over", bridge="yes", layer="1")
    town.street([(120, 60), (120, 100)], level="up", name="Over")
    town.sign(0, 0, highway="traffic_signals")
    town.sign(0, 20, highway="stop")
    return town.network()


@pytest.fixture(scope="module")
def root(network: RoadNetwork) -> etree._Element:
    return etree.fromstring(write_opendrive(network))


def test_it_is_opendrive_1_7_by_its_rules(network: RoadNetwork, root: etree._Element) -> None:
    header = root.find("header")
    assert header is not None
    assert (header.get("revMajor"), header.get("revMinor")) == ("1", "7")
    assert find_violations(write_opendrive(network), name="map") == []


def test_the_frame_is_the_projection_of_the_file(root: etree._Element) -> None:
    text = root.findtext("header/geoReference") or ""
    assert f"+lat_0={FRAME.latitude_deg:.9f}" in text
    assert "+proj=tmerc" in text


def test_it_reads_back_as_it_was(network: RoadNetwork) -> None:
    stored = read_opendrive(write_opendrive(network), name="map")
    assert stored.converter == network.converter
    assert stored.attribution == network.attribution
    for road in network.roads:
        read = stored.road_by_id[road.id]
        for name in (
            *("name", "names", "highway", "osm_way_ids", "layer", "bridge", "tunnel", "lanes_from_tags", "turn"),
            *("junction_id", "predecessor", "successor"),
        ):
            assert getattr(read, name) == getattr(road, name), name
        assert read.length_m == pytest.approx(road.length_m, abs=1e-6)
        assert (read.speed_mps or 0.0) == pytest.approx(road.speed_mps or 0.0, abs=1e-4)
        assert [_lanes(section) for section in read.lane_sections] == [
            _lanes(section) for section in road.lane_sections
        ]
        assert [(s.type, s.orientation, s.osm_node_id) for s in read.signals] == [
            (s.type, s.orientation, s.osm_node_id) for s in road.signals
        ]
    for junction in network.junctions:
        assert stored.junction_by_id[junction.id].connections == junction.connections
        assert stored.junction_by_id[junction.id].osm_node_ids == junction.osm_node_ids


def _lanes(section: object) -> list[tuple[object, ...]]:
    return [
        (lane.id, lane.type, lane.predecessor, lane.successor, lane.mark, lane.legal_mark, lane.turns)
        for lane in section.lanes  # type: ignore[attr-defined]
    ]


def test_any_centre_line_may_be_crossed_in_a_reconstruction(root: etree._Element) -> None:
    marks = root.findall(".//center/lane/roadMark")
    assert marks
    assert {mark.get("laneChange") for mark in root.iter("roadMark")} == {"both"}
    assert {m.get("type") for m in root.findall("road[@junction='-1']//center/lane/roadMark")} == {"broken"}


def test_legal_marks_forbid_what_the_law_forbids(network: RoadNetwork) -> None:
    legal = etree.fromstring(write_opendrive(network, marks="legal"))
    (over,) = legal.xpath("road[@name='US 1' and @junction='-1']")
    centre = over.find(".//center/lane/roadMark")
    assert (centre.get("type"), centre.get("laneChange"), centre.get("color")) == ("solid solid", "none", "yellow")
    # What was written does not change what is known.
    first = read_opendrive(etree.tostring(legal), name="legal")
    second = read_opendrive(write_opendrive(network), name="reconstruction")
    for road in first.roads:
        ours = second.road_by_id[road.id]
        assert [[lane.legal_mark for lane in s.lanes] for s in road.lane_sections] == [
            [lane.legal_mark for lane in s.lanes] for s in ours.lane_sections
        ]


def test_speeds_and_signs_are_in_miles_per_hour(root: etree._Element) -> None:
    (road,) = root.xpath("road[starts-with(@name, 'Café') and @junction='-1']")
    speed = road.find("type/speed")
    assert (speed.get("max"), speed.get("unit")) == ("45", "mph")
    (sign,) = {s.get("value") for s in road.iter("signal") if s.get("type") == "274"}
    assert sign == "45"


def test_identifiers_are_numbers_and_unique(root: etree._Element) -> None:
    for path in ("road", "junction", "road/signals/signal"):
        ids = [element.get("id") or "" for element in root.findall(path)]
        assert all(re.fullmatch(r"\d+", text) for text in ids)
        assert len(ids) == len(set(ids))


def test_text_that_xml_cannot_hold_is_left_out(network: RoadNetwork) -> None:
    def renamed(road: Road) -> Road:
        return replace(road, name="Main\x00 Street\x0b", names=("Main\x00 Street",))

    odd = replace(network, roads=tuple(renamed(road) for road in network.roads))
    stored = read_opendrive(write_opendrive(odd), name="map")
    assert {road.name for road in stored.roads} == {"Main Street"}


@pytest.mark.parametrize(("length_m", "start_m"), [(400.7501000777, 111.4261934902), (448.8728473677, 162.0047773666)])
def test_the_last_lane_section_ends_with_the_road_as_carla_adds_it(length_m: float, start_m: float) -> None:
    assert start_m + (length_m - start_m) > length_m, "the sum of the numbers as they are is beyond the end"
    town = Town()
    town.street([(0, 0), (length_m, 0)], highway="primary", lanes="2")
    whole = town.network()
    (road,) = whole.roads
    (section,) = road.lane_sections
    (line,) = road.plan
    cut = replace(
        road,
        length_m=length_m,
        plan=(replace(line, length_m=length_m),),
        lane_sections=(section, replace(section, s_m=start_m)),
    )
    written = write_opendrive(replace(whole, roads=(cut,)))
    start = float(etree.fromstring(written).findall(".//laneSection")[1].get("s"))
    assert start == pytest.approx(start_m, abs=2e-10)
    assert start + (length_m - start) <= length_m
    assert len(carla_map(written).generate_waypoints(10.0)) > 70, "two lanes of 400 m, a point each 10 m"


def test_carla_drives_on_it_without_jumps(network: RoadNetwork) -> None:
    steps = carla_steps(carla_map(write_opendrive(network)))
    assert len(steps.distances_m) > 1000
    assert ((steps.distances_m >= 0.8) & (steps.distances_m <= 1.25)).mean() >= 0.998
    assert steps.distances_m.max() < 2.0


@pytest.mark.parametrize("left_hand", [False, True])
def test_carla_gives_each_lane_its_approachs_lights_and_signs_and_no_others(left_hand: bool) -> None:
    """A light and a stop at two junctions of an avenue with a limit from its middle on, a yield at a ramp's end."""
    town = Town()
    town.street([(-400, 0), (-200, 0)], highway="primary", name="West", lanes="4")
    town.street([(-200, 0), (0, 0)], highway="primary", name="Middle", lanes="5", turn__lanes__both_ways="left")
    town.street([(0, 0), (200, 0)], highway="primary", name="East", lanes="2", maxspeed="45 mph")
    town.street([(-200, -150), (-200, 0)], highway="secondary", name="South", lanes="2")
    town.street([(-200, 0), (-200, 150)], highway="secondary", name="North", lanes="2")
    town.street([(0, -150), (0, 0)], highway="residential", name="Stopped", lanes="2")
    town.street([(200, 0), (200, 150)], highway="residential", name="Yielding", oneway="-1", lanes="1")
    town.street([(200, 0), (350, 0)], highway="primary", name="Far East", lanes="2")
    town.sign(-200, 0, highway="traffic_signals")
    town.sign(0, 0, highway="stop")
    town.sign(200, 0, highway="give_way")
    whole = town.network()
    network = mirror_network(whole) if left_hand else whole
    found = defaultdict(set)
    for ref, types in carla_landmarks(network, carla_map(write_opendrive(network))).items():
        found[network.road_by_id[ref.road_id].name, network.direction(ref)].add(" ".join(types))
    assert found == {
        ("West", 1): {"1000001"},
        ("West", -1): {""},
        ("Middle", 1): {""},
        ("Middle", -1): {"1000001"},
        ("South", 1): {"1000001"},
        ("South", -1): {""},
        ("North", 1): {""},
        ("North", -1): {"1000001"},
        ("Stopped", 1): {"206"},
        ("Stopped", -1): {""},
        ("Yielding", 1): {"205"},
        ("East", 1): {"274"},
        ("East", -1): {"274"},
        ("Far East", 1): {""},
        ("Far East", -1): {""},
    }
