"""What a road network can be asked, against plane geometry worked out by hand or by shapely."""

from __future__ import annotations

import math
import pickle
from collections.abc import Sequence

import numpy as np
import pytest
import shapely
from hypothesis import given, settings
from hypothesis import strategies as st

from tests.roads.networks import FRAME, crossroads, curvy_road, one_road, plans, ring
from trace_dag.common.units import wrap_angle
from trace_dag.roads.map.model import (
    ContactPoint,
    Cubic,
    Lane,
    LaneRef,
    LaneSection,
    LaneType,
    PlanElement,
    Road,
    RoadLink,
)
from trace_dag.roads.map.network import RoadNetwork
from trace_dag.roads.map.paths import follow, trace_forward

WEST_IN = LaneRef("west", 0, -1)  # road from x=-100 to the junction's west side, eastbound lane


def test_lanes_of_a_two_way_street_lie_on_the_right_hand_side() -> None:
    """A road from the origin to the east: eastbound traffic drives south of the centre line, westbound north."""
    network = one_road((PlanElement(0, 0, 0, 0.0, 100.0),), lanes_left=1, lanes_right=2, width_m=3.5)
    east, outer, west = LaneRef("1", 0, -1), LaneRef("1", 0, -2), LaneRef("1", 0, 1)
    assert set(network.drivable_lanes()) == {east, outer, west}
    pose = network.pose(east, 40.0)
    assert (pose.x_m, pose.y_m, pose.heading_rad) == pytest.approx((40, -1.75, 0))
    pose = network.pose(west, 40.0, offset_m=0.5)  # left of a westbound car is south
    assert (pose.x_m, pose.y_m, abs(pose.heading_rad)) == pytest.approx((40, 1.25, math.pi))
    assert network.neighbours(east) == (west, outer)
    assert network.neighbours(west) == (east, None)
    assert network.neighbours(outer) == (east, None)
    assert network.centreline(west)[0, :2] == pytest.approx((100, 1.75))
    assert network.width_m(outer, 3.0) == 3.5


def test_a_sidewalk_is_neither_drivable_nor_a_neighbour() -> None:
    lanes = (Lane(-1, LaneType.DRIVING, (Cubic(0, 3.5),)), Lane(-2, LaneType.SIDEWALK, (Cubic(0, 2.0),)))
    road = Road("1", 50.0, (PlanElement(0, 0, 0, 0, 50.0),), (LaneSection(0.0, lanes),))
    network = RoadNetwork(FRAME, (road,))
    assert network.drivable_lanes() == (LaneRef("1", 0, -1),)
    assert network.neighbours(LaneRef("1", 0, -1)) == (None, None)
    assert network.nearest_lanes(25.0, -4.5, 5.0)[0].outside_m == pytest.approx(1.0)


@given(plans(), st.integers(0, 2), st.integers(1, 3), st.floats(0, 1), st.floats(-1.7, 1.7))
@settings(max_examples=150)
def test_projection_inverts_pose(
    plan: tuple[PlanElement, ...], left: int, right: int, share: float, offset_m: float
) -> None:
    network = one_road(plan, lanes_left=left, lanes_right=right, width_m=3.5)
    for ref in network.drivable_lanes():
        begin, end = network.lane_span(ref)
        s = begin + share * (end - begin)
        pose = network.pose(ref, s, offset_m)
        match = network.project(ref, pose.x_m, pose.y_m)
        assert match.s_m == pytest.approx(s, abs=1e-5)
        assert match.offset_m == pytest.approx(offset_m, abs=1e-5)
        assert match.outside_m == pytest.approx(0.0, abs=1e-6)


@given(plans(), st.floats(0.02, 0.98))
@settings(max_examples=100)
def test_heading_is_the_direction_the_centre_moves_in(plan: tuple[PlanElement, ...], share: float) -> None:
    """Also where the lane widens: a numerical derivative of the positions is the judge."""
    network = curvy_road(plan)
    h = 1e-4
    for ref in network.drivable_lanes():
        begin, end = network.lane_span(ref)
        s = begin + share * (end - begin)
        sign = network.direction(ref)
        behind, here, ahead = (network.pose(ref, s + sign * d) for d in (-h, 0.0, h))
        moved = math.atan2(ahead.y_m - behind.y_m, ahead.x_m - behind.x_m)
        assert wrap_angle(here.heading_rad - moved) == pytest.approx(0.0, abs=2e-3)


@given(plans(), st.lists(st.floats(-5, 400), min_size=1, max_size=20), st.floats(-3, 3))
@settings(max_examples=60)
def test_scalar_and_vectorised_evaluation_agree(
    plan: tuple[PlanElement, ...], stations: list[float], offset_m: float
) -> None:
    network = curvy_road(plan)
    for ref in network.drivable_lanes():
        many = network.poses(ref, np.array(stations), offset_m)
        for s, row in zip(stations, many, strict=True):
            pose = network.pose(ref, s, offset_m)
            assert (pose.x_m, pose.y_m, pose.z_m) == pytest.approx(tuple(row[:3]), abs=1e-8)
            assert wrap_angle(pose.heading_rad - row[3]) == pytest.approx(0.0, abs=1e-8)


@given(plans(), st.floats(-150, 150), st.floats(-150, 150))
@settings(max_examples=100)
def test_nearest_lane_agrees_with_the_lanes_surfaces(plan: tuple[PlanElement, ...], x: float, y: float) -> None:
    """The distance to each lane's surface as shapely sees it, within what 0.25 m facets cut off."""
    network = one_road(plan, lanes_left=1, lanes_right=1, width_m=3.5)
    matches = network.nearest_lanes(x, y, 30.0)
    assert matches == sorted(matches, key=lambda match: match.outside_m)
    found = {match.lane: match.outside_m for match in matches}
    for ref in network.drivable_lanes():
        distance = _surface(network, ref).distance(shapely.Point(x, y))
        if distance < 29.9:
            # Outside a bend, beside the road's end, the foot on the centre is not the nearest border point.
            assert found[ref] == pytest.approx(distance, abs=0.3)
        elif distance > 30.3:
            assert ref not in found


def _surface(network: RoadNetwork, ref: LaneRef) -> shapely.Polygon:
    begin_m, end_m = network.lane_span(ref)
    stations = np.linspace(begin_m, end_m, math.ceil((end_m - begin_m) / 0.25) + 1)
    left, right = (network.poses(ref, stations, side_m)[:, :2] for side_m in (1.75, -1.75))
    return shapely.Polygon(np.concatenate([left, right[::-1]]))


def test_height_distinguishes_lanes_above_each_other() -> None:
    low = Road("low", 100.0, (PlanElement(0, -50, 0, 0, 100.0),), one_road_sections())
    high = Road(
        "high", 100.0, (PlanElement(0, 0, -50, math.pi / 2, 100.0),), one_road_sections(), elevation=(Cubic(0, 6.0),)
    )
    network = RoadNetwork(FRAME, (low, high))
    assert {match.lane.road_id for match in network.nearest_lanes(1, -1, 1.0)} == {"low", "high"}
    assert {match.lane.road_id for match in network.nearest_lanes(1, -1, 1.0, z_m=0.3)} == {"low"}
    assert {match.lane.road_id for match in network.nearest_lanes(1, -1, 1.0, z_m=5.5)} == {"high"}


def one_road_sections() -> tuple[LaneSection, ...]:
    return (LaneSection(0.0, (Lane(-1, LaneType.DRIVING, (Cubic(0, 3.5),)),)),)


def test_links_lead_through_a_junction_both_ways() -> None:
    network = crossroads()
    reached = {ref.road_id for ref in network.successors(WEST_IN)}
    assert reached == {"west-east", "west-north", "west-south"}
    for connecting in network.successors(WEST_IN):
        assert WEST_IN in network.predecessors(connecting)
        (arm,) = network.successors(connecting)
        assert arm.lane_id == 1  # arms run towards the junction, so one leaves by the left lane
        begin, end = network.centreline(connecting)[-1], network.centreline(arm)[0]
        assert begin[:2] == pytest.approx(end[:2], abs=1e-6)
        assert wrap_angle(begin[3] - end[3]) == pytest.approx(0, abs=1e-6)
    assert network.predecessors(WEST_IN) == ()
    for ref in network.drivable_lanes():
        for following in network.successors(ref):
            assert ref in network.predecessors(following)


def test_a_road_touching_one_junction_at_both_ends_keeps_its_ends_apart() -> None:
    network = ring()
    assert {ref.road_id for ref in network.successors(LaneRef("loop", 0, -1))} == {"after-end"}
    assert {ref.road_id for ref in network.successors(LaneRef("loop", 0, 1))} == {"after-start"}


def test_links_across_sections_follow_renumbered_lanes() -> None:
    """A right lane ends: what was lane -2 goes on as lane -1, and the left turn lane -1 stops."""
    wide = (
        Lane(-1, LaneType.DRIVING, (Cubic(0, 3.5),)),
        Lane(-2, LaneType.DRIVING, (Cubic(0, 3.5),), successor=-1),
    )
    narrow = (Lane(-1, LaneType.DRIVING, (Cubic(0, 3.5),), predecessor=-2),)
    road = Road("1", 80.0, (PlanElement(0, 0, 0, 0, 80.0),), (LaneSection(0, wide), LaneSection(30, narrow)))
    network = RoadNetwork(FRAME, (road,))
    assert network.successors(LaneRef("1", 0, -2)) == (LaneRef("1", 1, -1),)
    assert network.successors(LaneRef("1", 0, -1)) == ()
    assert network.lane_span(LaneRef("1", 1, -1)) == (30.0, 80.0)


def test_a_link_to_a_road_that_is_missing_leads_nowhere() -> None:
    road = Road(
        "1",
        50.0,
        (PlanElement(0, 0, 0, 0, 50.0),),
        one_road_sections(),
        successor=RoadLink("road", "gone", ContactPoint.START),
    )
    assert RoadNetwork(FRAME, (road,)).successors(LaneRef("1", 0, -1)) == ()


def test_tracing_gives_every_way_on() -> None:
    """40 m before the crossing, 100 m on: one path into each of the three other arms, all beginning at that place."""
    network = crossroads()
    s_m = network.lane_span(WEST_IN)[1] - 40.0
    here = network.pose(WEST_IN, s_m)
    paths = trace_forward(network, WEST_IN, s_m, 100.0)
    assert {path.lanes[-1].road_id for path in paths} == {"east", "north", "south"}
    assert paths[0].lanes[-1] == LaneRef("east", 0, 1)  # straight on comes first
    for path in paths:
        assert path.complete
        assert path.length_m == pytest.approx(100.0)
        assert path.points[0, :2] == pytest.approx((here.x_m, here.y_m), abs=1e-6)
        assert wrap_angle(path.points[0, 3] - here.heading_rad) == pytest.approx(0, abs=1e-6)
        steps = np.hypot(*np.diff(path.points[:, :2], axis=0).T)
        assert steps.max() < 1.01
        assert np.abs(np.diff(path.points[:, 3])).max() < 0.3
    assert paths[0].points[-1, :2] == pytest.approx((here.x_m + 100.0, here.y_m), abs=0.05)


def test_following_starts_and_stops_at_the_given_places() -> None:
    network = crossroads()

    def to_the_north(lanes: tuple[LaneRef, ...], following: Sequence[LaneRef]) -> Sequence[LaneRef]:
        return [ref for ref in following if any(then.road_id == "north" for then in network.successors(ref))]

    assert [len(way) for way in follow(network, WEST_IN, lambda lanes, following: ())] == [1]
    assert len(follow(network, WEST_IN, lambda lanes, following: following)) == 3
    assert len(follow(network, WEST_IN, lambda lanes, following: following, most=2)) == 2
    (way,) = follow(network, WEST_IN, to_the_north)
    assert len(way) == 2
    (back,) = follow(network, way[-1], lambda lanes, before: before, ahead=False)
    assert back == (way[-1], WEST_IN)


def test_tracing_beyond_the_map_is_reported() -> None:
    network = crossroads()
    paths = trace_forward(network, WEST_IN, 10.0, 500.0)
    assert len(paths) == 3
    assert not any(path.complete for path in paths)
    assert max(path.length_m for path in paths) < 250
    start = network.pose(WEST_IN, 10.0)
    assert all(path.points[0, :2] == pytest.approx((start.x_m, start.y_m)) for path in paths)


def test_a_network_survives_pickling_with_its_caches_used() -> None:
    network = crossroads()
    network.nearest_lanes(0, 0, 10)
    copy = pickle.loads(pickle.dumps(network))
    assert copy == network
    assert copy.nearest_lanes(3, 1, 5) == network.nearest_lanes(3, 1, 5)
