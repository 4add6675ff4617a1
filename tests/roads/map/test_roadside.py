"""Zones beside a road: on a street, and on a divided road with a ramp, both made by hand."""

from __future__ import annotations

import math

import pytest

from tests.roads.networks import FRAME, WIDTH_M, lanes
from trace_dag.roads.map.model import Cubic, Lane, LaneSection, LaneType, PlanElement, Road
from trace_dag.roads.map.network import RoadNetwork
from trace_dag.roads.map.roadside import RoadZone, roadside_at


def straight_road(road_id: str, y_m: float, heading_rad: float, highway: str, count: int = 2) -> Road:
    """A one-way road of 400 m through x = 0, its left edge at ``y_m``."""
    x_m = -200.0 * math.cos(heading_rad)
    plan = (PlanElement(0, x_m, y_m, heading_rad, 400.0),)
    return Road(road_id, 400.0, plan, (LaneSection(0, lanes(0, count)),), highway=highway)


STREET = RoadNetwork(
    FRAME,
    (Road("1", 400.0, (PlanElement(0, -200, 0, 0, 400.0),), (LaneSection(0, lanes(1, 1)),), highway="residential"),),
)
# Eastbound below, westbound above, 10 m of median between their left edges; a ramp 4 m right of the eastbound one.
DIVIDED = RoadNetwork(
    FRAME,
    (
        straight_road("east", -5.0, 0.0, "motorway"),
        straight_road("west", 5.0, math.pi, "motorway"),
        straight_road("ramp", -5.0 - 2 * WIDTH_M - 5.0, 0.0, "motorway_link", 1),
    ),
)


@pytest.mark.parametrize(
    ("y_m", "zone", "left", "beyond_m"),
    [
        (-1.0, RoadZone.ROADWAY, True, -2.5),
        (-3.9, RoadZone.SHOULDER, False, 0.4),  # local roads have 0.6 m
        (-6.5, RoadZone.ROADSIDE, False, 3.0),
        (6.5, RoadZone.ROADSIDE, False, 3.0),  # right of the lane that goes the other way
        (-20.0, RoadZone.OUTSIDE, False, 16.5),
    ],
)
def test_beside_a_street(y_m: float, zone: RoadZone, left: bool, beyond_m: float) -> None:
    place = roadside_at(STREET, 0.0, y_m)
    assert place is not None
    assert (place.zone, place.left) == (zone, left)
    assert place.beyond_m == pytest.approx(beyond_m, abs=0.05)
    assert place.lane.s_m == pytest.approx(200.0)


@pytest.mark.parametrize(
    ("y_m", "zone"),
    [
        (0.5, RoadZone.MEDIAN),
        (-4.0, RoadZone.SHOULDER),  # 1.2 m left of a freeway
        (-5.0 - 2 * WIDTH_M - 3.2, RoadZone.GORE),
        (-5.0 - 2 * WIDTH_M - 2.0, RoadZone.SHOULDER),  # 3.0 m right of it
        (5.0 + 2 * WIDTH_M + 5.0, RoadZone.ROADSIDE),
    ],
)
def test_beside_a_divided_road(y_m: float, zone: RoadZone) -> None:
    place = roadside_at(DIVIDED, 0.0, y_m)
    assert place is not None
    assert place.zone is zone


def test_the_maps_own_shoulder_counts() -> None:
    section = LaneSection(0, (*lanes(1, 1), Lane(-2, LaneType.SHOULDER, (Cubic(0, 2.5),))))
    road = Road("1", 400.0, (PlanElement(0, -200, 0, 0, 400.0),), (section,), highway="residential")
    place = roadside_at(RoadNetwork(FRAME, (road,)), 0.0, -5.5)
    assert place is not None
    assert (place.zone, place.shoulder_m) == (RoadZone.SHOULDER, 2.5)


def test_far_from_every_road_there_is_no_place() -> None:
    assert roadside_at(STREET, 0.0, 200.0) is None
