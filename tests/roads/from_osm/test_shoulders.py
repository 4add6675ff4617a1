"""Shoulders beside roads of high speed. Widths and speeds are AASHTO's, as the rule says them."""

from __future__ import annotations

from pathlib import Path

import pytest

from tests.roads import judges
from tests.roads.towns import Town, straight_street
from trace_dag.roads.gates.gates import check_map
from trace_dag.roads.map.model import LaneRef, LaneType
from trace_dag.roads.map.network import RoadNetwork
from trace_dag.roads.map.rules import StoredMap
from trace_dag.roads.map.writer import write_opendrive


def shoulders_m(network: RoadNetwork, road: int = 0, at_m: float = 100.0) -> dict[bool, float]:
    """Widths of the shoulders of a road, by whether they are on the right of its reference line."""
    made = network.roads[road]
    return {
        lane.id < 0: round(network.width_m(LaneRef(made.id, 0, lane.id), at_m), 3)
        for lane in made.lane_sections[0].lanes
        if lane.type is LaneType.SHOULDER
    }


@pytest.mark.parametrize(
    ("tags", "expected"),
    [
        ({"highway": "motorway", "oneway": "yes"}, {True: 3.0, False: 1.2}),
        ({"highway": "secondary", "maxspeed": "55 mph"}, {True: 2.4, False: 2.4}),
        ({"highway": "tertiary", "maxspeed": "50 mph"}, {True: 1.5, False: 1.5}),
        ({"highway": "secondary", "maxspeed": "45 mph"}, {}),
        ({"highway": "residential"}, {}),
        ({"highway": "trunk", "shoulder": "no"}, {}),
        ({"highway": "trunk", "sidewalk": "both"}, {}),
        ({"highway": "trunk", "sidewalk": "no"}, {True: 2.4, False: 2.4}),
        ({"highway": "trunk", "bridge": "yes"}, {}),
        ({"highway": "trunk", "surface": "gravel"}, {}),
        # The map's own shoulder, as wide as it says.
        ({"highway": "trunk", "shoulder": "right", "shoulder:width": "1"}, {True: 1.0}),
    ],
)
def test_roads_of_fifty_miles_an_hour_have_shoulders(tags: dict[str, str], expected: dict[bool, float]) -> None:
    network = straight_street(**{key.replace(":", "__"): value for key, value in tags.items()})
    assert shoulders_m(network) == expected


def test_a_shoulder_ends_where_a_sidewalk_of_its_own_runs() -> None:
    town = Town()
    town.street([(-100, 0), (100, 0)], highway="trunk")
    town.walkway([(-100, -7), (0, -7)], footway="sidewalk")
    network = town.network()
    assert set(shoulders_m(network, at_m=50.0)) == {True, False}
    assert shoulders_m(network, at_m=50.0)[True] < 0.3  # the lane is there and has no width to use
    assert shoulders_m(network, at_m=150.0) == {True: 2.4, False: 2.4}


def test_two_shoulders_never_share_a_place() -> None:
    """Carriageways of a divided road whose edges are 2 m apart: no room for 1.2 m of each; 10 m apart there is."""
    for apart_m, left_m in ((2.0, None), (10.0, 1.2)):
        town = Town()
        middle_m = (apart_m + 2 * 3.65) / 2
        town.street([(-200, -middle_m), (200, -middle_m)], highway="motorway", oneway="yes")
        town.street([(200, middle_m), (-200, middle_m)], highway="motorway", oneway="yes")
        network = town.network()
        for road in range(2):
            assert shoulders_m(network, road, 200.0).get(False) == left_m
            assert shoulders_m(network, road, 200.0)[True] == 3.0


def test_shoulders_end_before_a_junction_and_the_map_keeps_its_gates() -> None:
    town = Town()
    town.street([(-150, 0), (0, 0), (150, 0)], highway="trunk")
    town.street([(0, 0), (0, -150)], highway="secondary", maxspeed="55 mph")
    extract = town.extract()
    network = town.network()
    gates = check_map(network, extract, StoredMap(write_opendrive(network)))
    assert [gate.name for gate in gates if gate.passed is False] == []
    assert not any(
        lane.type is LaneType.SHOULDER
        for road in network.roads
        if road.junction_id is not None
        for section in road.lane_sections
        for lane in section.lanes
    )
    assert sum(bool(shoulders_m(network, k, 60.0)) for k, road in enumerate(network.roads) if not road.junction_id) == 3


def test_carla_reads_the_shoulders() -> None:
    """``carla.Map`` finds one beside the outermost lane, as wide as ours."""
    carla_map = judges.carla_map(write_opendrive(straight_street(highway="motorway", oneway="yes")))
    carla = pytest.importorskip("carla")
    lane = carla_map.get_waypoint(carla.Location(0.0, 0.0, 0.0))
    while lane.lane_type == carla.LaneType.Driving:
        lane = lane.get_right_lane()
    assert lane.lane_type == carla.LaneType.Shoulder
    assert lane.lane_width == pytest.approx(3.0)


def test_the_official_checker_finds_nothing(tmp_path: Path) -> None:
    path = tmp_path / "shoulders.xodr"
    path.write_bytes(write_opendrive(straight_street(highway="motorway", oneway="yes")))
    (result,) = judges.official_check([path])
    assert result["issues"] == []
