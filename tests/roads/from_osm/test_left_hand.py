"""Where traffic keeps left every lane, turn, signal and sign is on the other side."""

from __future__ import annotations

import math

import numpy as np
import pytest

from tests.roads.networks import crossroads
from tests.roads.towns import FRAME, SETTINGS, Town
from trace_dag.roads.from_osm.convert import convert
from trace_dag.roads.from_osm.left_hand import mirror_extract, mirror_network, mirror_tags
from trace_dag.roads.map.lane_shapes import lane_shapes
from trace_dag.roads.map.network import RoadNetwork
from trace_dag.roads.map.reader import read_opendrive
from trace_dag.roads.map.rules import find_violations
from trace_dag.roads.map.writer import write_opendrive


@pytest.fixture(name="network", scope="module")
def _network() -> RoadNetwork:
    """A T of a street with a turn lane and one with traffic lights, read back from its file."""
    town = Town()
    town.street([(-100, 0), (0, 0)], lanes="3", lanes__forward="2", turn__lanes__forward="left|through", name="Main")
    town.street([(0, 0), (100, 0)], lanes="2", name="Main")
    town.street([(0, 0), (0, 100)], oneway="yes", lanes="1", parking__left="lane", name="North")
    town.sign(0, 0, highway="traffic_signals")
    made = convert(mirror_extract(town.extract(), FRAME), FRAME, SETTINGS)
    xodr = write_opendrive(mirror_network(made))
    assert find_violations(xodr) == []
    assert b'rule="RHT"' not in xodr
    return read_opendrive(xodr, name="left")


def test_traffic_keeps_left(network: RoadNetwork) -> None:
    """Eastbound lanes lie north of the way, westbound ones south of it."""
    for x, y, heading in ((60.0, 1.7, 0.0), (60.0, -1.7, math.pi)):
        lane = network.nearest_lanes(x, y, 1.0)[0]
        assert abs(math.remainder(network.pose(lane.lane, lane.s_m).heading_rad - heading, math.tau)) < 1e-6


def test_the_left_lane_is_the_one_nearer_to_the_kerb(network: RoadNetwork) -> None:
    """Of two eastbound lanes the northern one turns left, as tagged, and the other one is its right neighbour."""
    northern, southern = (network.nearest_lanes(-60.0, y, 0.5)[0].lane for y in (3.4, 0.2))
    assert network.lane(northern).turns == ("left",)
    assert network.lane(southern).turns == ("through",)
    assert network.neighbours(northern)[1] == southern
    assert network.neighbours(southern)[0] == northern


def test_movements_lead_from_lane_to_lane(network: RoadNetwork) -> None:
    northern = network.nearest_lanes(-60.0, 3.4, 0.5)[0].lane
    (turn,) = network.successors(northern)
    assert network.road_by_id[turn.road_id].turn == "left"
    (target,) = network.successors(turn)
    assert network.road_by_id[target.road_id].name == "North"


def test_lights_stand_on_the_left_of_their_traffic(network: RoadNetwork) -> None:
    lights = [(road, signal) for road in network.roads for signal in road.signals if signal.dynamic]
    assert lights
    for _, signal in lights:
        assert (signal.t_m > 0) == (signal.orientation == "+")


@pytest.mark.parametrize(
    ("before", "after"),
    [
        ({"parking:left": "lane"}, {"parking:right": "lane"}),
        ({"turn:lanes": "left|through;slight_right"}, {"turn:lanes": "through;slight_left|right"}),
        ({"turn:lanes:backward": "left|"}, {"turn:lanes:backward": "|right"}),
        ({"change:lanes": "not_left|yes"}, {"change:lanes": "yes|not_right"}),
        ({"lanes": "3", "placement": "right_of:1"}, {"lanes": "3", "placement": "left_of:3"}),
        ({"width:lanes": "3|4"}, {"width:lanes": "4|3"}),
        ({"name": "Left Fork Road"}, {"name": "Left Fork Road"}),
    ],
)
def test_tags_in_a_mirror(before: dict[str, str], after: dict[str, str]) -> None:
    assert mirror_tags(before) == after
    assert mirror_tags(after) == before


@pytest.mark.parametrize("mirrored", [False, True])
def test_borders_are_on_the_left_and_right_of_who_drives(mirrored: bool) -> None:
    network = crossroads()
    for shape in lane_shapes(mirror_network(network) if mirrored else network, drivable_only=True):
        (along_x, along_y), middle = np.diff(shape.centre_m[:2, :2], axis=0)[0], shape.centre_m[0, :2]
        for border, side in ((shape.left_m, 1), (shape.right_m, -1)):
            across_x, across_y = border[0, :2] - middle
            assert np.sign(along_x * across_y - along_y * across_x) == side
