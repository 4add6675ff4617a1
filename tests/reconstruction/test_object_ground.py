"""Objects stand beside lanes and shoulders, none in another one; lengthwise ones end where a street opens."""

from __future__ import annotations

import math
from dataclasses import replace

import pytest

from tests.roads.networks import FRAME, lanes
from tests.simulation.test_objects import CURB, TREE, item
from tests.verdict.crashes import CROSSROADS, STREET
from trace_dag.common.geometry import Pose
from trace_dag.reconstruction.scene.roadside_objects import beyond_range_m, on_free_ground
from trace_dag.roads.map.model import Cubic, Lane, LaneSection, LaneType, PlanElement, Road
from trace_dag.roads.map.network import RoadNetwork

EDGE_M = 3.5  # of either street from its middle: two lanes of 3.5 m
BESIDE_M = EDGE_M + 0.1


def along(kerb) -> tuple[float, float]:
    return kerb.pose.x_m - kerb.length_m / 2, kerb.pose.x_m + kerb.length_m / 2


def test_a_kerb_ends_where_another_street_opens():
    kerb = replace(item(CURB, -8.0, -BESIDE_M), length_m=24.0)
    cut = on_free_ground(kerb, (-10.0, -EDGE_M), CROSSROADS)
    assert along(cut) == (pytest.approx(-20.0), pytest.approx(-EDGE_M, abs=0.51))
    assert cut.pose.y_m == pytest.approx(-BESIDE_M)


def test_an_object_on_free_ground_stays_as_it_is():
    kerb = replace(item(CURB, -8.0, -BESIDE_M), length_m=24.0)
    assert on_free_ground(kerb, (-10.0, -EDGE_M), STREET) is kerb, "no street opens"
    tree = item(TREE, -20.0, -6.0)
    assert on_free_ground(tree, (-20.0, -5.8), CROSSROADS) is tree


@pytest.mark.parametrize("y_m", [0.0, -EDGE_M], ids=["in a lane", "half in a lane"])
def test_no_object_stands_on_a_lane_unless_the_report_has_it_on_the_roadway(y_m):
    tree = item(TREE, 0.0, y_m)
    assert on_free_ground(tree, (0.0, y_m), STREET) is None
    assert on_free_ground(tree, (0.0, y_m), STREET, relation=1) is tree
    island = replace(item(CURB, 0.0, 0.0, math.pi / 2), length_m=4.0)
    assert on_free_ground(island, (0.0, -1.0), CROSSROADS) is None
    assert on_free_ground(island, (0.0, -1.0), CROSSROADS, relation=1) is island


def test_no_two_objects_stand_in_one_place():
    tree, pole = item(TREE, 0.0, -6.0), replace(item(TREE, 0.1, -6.0), number=2009)
    assert on_free_ground(pole, (0.0, -5.8), STREET, [(tree, (0.0, -5.8))]) is None
    rail = replace(item(CURB, 0.0, -6.0), length_m=40.0, number=2009)
    cut = on_free_ground(rail, (-10.0, -5.9), STREET, [(tree, (0.0, -5.8))])
    assert along(cut) == (pytest.approx(-20.0), pytest.approx(-0.2, abs=0.1))


def shouldered(*, bridge: bool) -> RoadNetwork:
    """A street along the x axis with a shoulder of 2.5 m on its right."""
    beside = Lane(-2, LaneType.SHOULDER, (Cubic(0.0, 2.5),))
    section = LaneSection(0, (*lanes(1, 1), beside))
    road = Road("1", 400.0, (PlanElement(0, -200, 0, 0, 400.0),), (section,), highway="secondary", bridge=bridge)
    return RoadNetwork(FRAME, (road,))


def test_objects_stand_behind_the_shoulder_and_on_a_bridge_at_its_edge():
    at_edge = Pose(0.0, -EDGE_M, 0.0)
    least_m, most_m = beyond_range_m(shouldered(bridge=False), at_edge, -1.0, TREE)
    assert 2.5 <= least_m < 3.0
    assert most_m == math.inf
    least_m, most_m = beyond_range_m(shouldered(bridge=True), at_edge, -1.0, 23)
    assert 2.5 <= least_m < most_m < 2.5 + 1.5, "beyond it a bridge has ended"
    tree = item(TREE, 0.0, -EDGE_M - 1.5)
    assert on_free_ground(tree, (0.0, -EDGE_M - 1.3), shouldered(bridge=False)) is None
    assert on_free_ground(tree, (0.0, -EDGE_M - 1.3), shouldered(bridge=False), relation=2) is tree


def test_each_strike_of_one_rail_has_its_part():
    first = replace(item(CURB, 0.0, -BESIDE_M), length_m=40.0)
    second = replace(item(CURB, 10.0, -BESIDE_M), length_m=40.0, number=2009)
    struck = [(first, (-4.0, -EDGE_M)), (second, (12.0, -EDGE_M))]
    one, two = (on_free_ground(rail, at, STREET, struck) for rail, at in struck)
    assert along(one) == (pytest.approx(-20.0), pytest.approx(4.0))
    assert along(two) == (pytest.approx(4.0), pytest.approx(30.0))
