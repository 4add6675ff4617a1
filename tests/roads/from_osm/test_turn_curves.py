"""Turns that a car can drive: where they lead, how tight they are, and what becomes of those it cannot."""

from __future__ import annotations

import math

import numpy as np
import pytest
from hypothesis import assume, given
from hypothesis import strategies as st

from tests.roads.towns import Town
from trace_dag.roads.from_osm.polyline_fit import fit_plan
from trace_dag.roads.from_osm.turn_curves import (
    TIGHTEST_RADIUS_M,
    drivable_turn,
    tightest_radius_m,
    widen_tight_bends,
)
from trace_dag.roads.gates.measures import shortest_element, tightest_turns
from trace_dag.roads.map.curves import PlanPose, PlanView, drop_slivers, join_plans, plan_pose
from trace_dag.roads.map.model import PlanElement, Road
from trace_dag.roads.map.network import RoadNetwork

_places = st.floats(-15, 15)
_headings = st.floats(-3.1, 3.1)


@given(_places, _places, _headings)
def test_a_drivable_turn_leads_from_pose_to_pose_without_a_loop(x_m: float, y_m: float, heading_rad: float) -> None:
    plan = drivable_turn(PlanPose(1.0, 2.0, 0.5), PlanPose(x_m, y_m, heading_rad))
    assume(plan is not None)
    end = plan_pose(plan, plan.length_m)
    assert math.dist(end[:2], (x_m, y_m)) < 1e-5
    assert abs(math.remainder(end.heading_rad - heading_rad, math.tau)) < 1e-5
    turned = sum(element.curvature_1pm * element.length_m for element in plan.elements)
    assert abs(turned) < math.pi + 0.51
    assert tightest_radius_m(plan) >= 2.0 - 1e-9


@pytest.mark.parametrize("apart_m", [0.007, 3.35, 7.4])
def test_a_car_swings_out_to_turn_round_between_lanes_too_close(apart_m: float) -> None:
    """Three circles of 3.7 m that touch, the outer two tangent to the lanes: the law of cosines gives the angle."""
    plan = drivable_turn(PlanPose(0.0, 0.0, 0.0), PlanPose(0.0, apart_m, math.pi))
    assert plan is not None
    swing_rad = math.acos((apart_m / 2 + TIGHTEST_RADIUS_M) / (2 * TIGHTEST_RADIUS_M))
    assert tightest_radius_m(plan) == pytest.approx(TIGHTEST_RADIUS_M)
    assert plan.length_m == pytest.approx(TIGHTEST_RADIUS_M * (math.pi + 4 * swing_rad))


def _divided(median_m: float, lanes: str) -> Town:
    """A divided street whose carriageways lie ``median_m`` apart between their edges, and one that crosses it."""
    half_m = (median_m + 3.5 * int(lanes)) / 2
    town = Town()
    town.street([(-200, -half_m), (0, -half_m), (200, -half_m)], highway="primary", name="M", oneway="yes", lanes=lanes)
    town.street([(200, half_m), (0, half_m), (-200, half_m)], highway="primary", name="M", oneway="yes", lanes=lanes)
    town.street([(0, -150), (0, -half_m), (0, half_m), (0, 150)], highway="tertiary", name="Cross", lanes="2")
    return town


def _u_turns(network: RoadNetwork) -> list[Road]:
    return [road for road in network.roads if road.turn == "u_turn"]


def _fork(median_m: float) -> Town:
    """A street that becomes two carriageways of one lane, without any crossing."""
    half_m = (median_m + 3.5) / 2
    town = Town()
    town.street([(-150, 0), (0, 0)], highway="primary", name="M", lanes="2")
    town.street([(0, 0), (30, -half_m), (200, -half_m)], highway="primary", name="M", oneway="yes", lanes="1")
    town.street([(200, half_m), (30, half_m), (0, 0)], highway="primary", name="M", oneway="yes", lanes="1")
    return town


@pytest.mark.parametrize("median_m", [0.0, 0.5, 2.0, 12.0])
@pytest.mark.parametrize("lanes", ["1", "2", "3"])
def test_every_u_turn_at_a_divided_street_can_be_driven(median_m: float, lanes: str) -> None:
    network = _divided(median_m, lanes).network()
    _, turning_round = tightest_turns(network)
    assert turning_round[0] >= TIGHTEST_RADIUS_M * 0.999


def test_across_no_median_there_is_a_u_turn_where_the_crossing_has_room() -> None:
    """Two lanes each way and a street across: 7 m from the inner to the outer lane's centre is not a full circle."""
    assert _u_turns(_divided(0.0, "2").network())


def test_nobody_turns_round_the_tip_of_a_median() -> None:
    network = _fork(0.0).network()
    assert not _u_turns(network)
    assert network.junctions, "the street still divides"


def test_across_a_wide_median_the_u_turn_is_a_half_circle() -> None:
    """12 m of median and half a lane of 3.5 m on either side: a half circle of 7.75 m, 24.3 m long."""
    network = _divided(12.0, "1").network()
    lengths = [road.length_m for road in _u_turns(network)]
    assert lengths
    assert min(lengths) == pytest.approx(math.pi * 7.75, rel=0.02)


@pytest.mark.parametrize("angle_deg", [35, 50, 90, 130])
def test_corners_at_any_angle_can_be_driven(angle_deg: float) -> None:
    town = Town()
    town.street([(-150, 0), (0, 0), (150, 0)], name="Main")
    x, y = math.cos(math.radians(angle_deg)), math.sin(math.radians(angle_deg))
    town.street([(0, 0), (100 * x, 100 * y)], highway="service", name="Drive")
    tightest, _ = tightest_turns(town.network())
    assert tightest[0] >= TIGHTEST_RADIUS_M * 0.999


@pytest.mark.parametrize("between_m", [8.0, 10.0, 12.0, 14.0, 17.0])
def test_corners_at_two_driveways_near_each_other_can_be_driven(between_m: float) -> None:
    town = Town()
    town.street([(-150, 0), (0, 0), (between_m, 0), (150, 0)], name="Main")
    town.street([(0, 0), (0, 80)], highway="service")
    town.street([(between_m, 0), (between_m, -80)], highway="service")
    tightest, _ = tightest_turns(town.network())
    assert tightest[0] >= 2.0 * 0.999


def _plan(*pieces: tuple[float, float]) -> PlanView:
    """Lines and arcs one after the other, each a length and a curvature."""
    plans: list[PlanView] = []
    pose = PlanPose(3.0, -4.0, 0.7)
    for length_m, curvature_1pm in pieces:
        plan = PlanView((PlanElement(0.0, *pose, length_m, curvature_1pm),), length_m)
        plans.append(plan)
        pose = plan_pose(plan, length_m)
    return join_plans(plans)


@pytest.mark.parametrize(
    "pieces",
    [
        [(20.0, 0.0), (0.004, 0.1), (15.0, 0.0)],
        [(0.002, 0.0), (6.0, 0.2), (0.006, 0.0)],
        [(6.0, 0.2), (0.0001, 0.0), (6.0, -0.1)],
        [(0.3, 0.0), (0.005, 0.25), (0.2, 0.0)],
        [(5.0, 0.0), (0.005, 0.25), (0.006, 0.0), (0.005, -0.25), (5.0, 0.0)],
    ],
)
def test_pieces_shorter_than_a_centimetre_go_and_the_line_stays(pieces: list[tuple[float, float]]) -> None:
    before = _plan(*pieces)
    after = drop_slivers(before)
    assert min(element.length_m for element in after.elements) >= 0.01
    assert after.length_m == pytest.approx(before.length_m, abs=1e-3)
    for share in (0.0, 0.2, 0.5, 0.8, 1.0):
        a, b = plan_pose(before, share * before.length_m), plan_pose(after, share * after.length_m)
        assert math.dist(a[:2], b[:2]) < 5e-3
        assert abs(math.remainder(a.heading_rad - b.heading_rad, math.tau)) < 0.02
    for first, second in zip(after.elements, after.elements[1:], strict=False):
        end = plan_pose(PlanView((first,), first.s_m + first.length_m), first.s_m + first.length_m)
        assert math.dist(end[:2], (second.x_m, second.y_m)) < 1e-6
        assert abs(math.remainder(end.heading_rad - second.heading_rad, math.tau)) < 1e-3


def test_lines_of_a_town_have_no_slivers() -> None:
    length_m, _ = shortest_element(_divided(0.0, "2").network())
    assert length_m >= 0.01


_turns = st.lists(st.floats(-1.7, 1.7), min_size=1, max_size=5)
_steps = st.lists(st.floats(1.0, 8.0), min_size=5, max_size=5)


@given(_turns, _steps, st.floats(2.0, 6.0))
def test_wider_bends_begin_and_end_as_before(turns: list[float], steps_m: list[float], radius_m: float) -> None:
    """A way of a few metres between corners of up to 100 degrees, 30 m before and behind them."""
    points, heading = [(0.0, 0.0), (30.0, 0.0)], 0.0
    for turn, step_m in zip(turns, [*steps_m[1 : len(turns)], 30.0], strict=True):
        heading += turn
        x, y = points[-1]
        points.append((x + step_m * math.cos(heading), y + step_m * math.sin(heading)))
    plan = fit_plan(points, radius_m)
    wider = widen_tight_bends(plan, radius_m)
    for before, after in ((0.0, 0.0), (plan.length_m, wider.length_m)):
        assert plan_pose(wider, after)[:2] == pytest.approx(plan_pose(plan, before)[:2], abs=1e-5)
    assert tightest_radius_m(wider) >= min(tightest_radius_m(plan), radius_m) * (1 - 1e-5)
    assert len(wider.vertex_s_m) == len(points)
    assert list(wider.vertex_s_m) == sorted(wider.vertex_s_m)


@pytest.mark.parametrize("highway", ["service", "residential"])
def test_no_car_has_to_drive_a_bend_of_less_than_two_metres(highway: str) -> None:
    """A parking aisle, drawn with corners a metre and a half apart."""
    town = Town()
    town.street([(-40, 0), (0, 0), (1.5, 0.5), (1.5, 2), (0, 2.5), (-40, 6)], highway=highway)
    network = town.network()
    assert network.drivable_lanes()
    for road in network.roads:
        assert all(abs(piece.curvature_1pm) <= 1 / 1.999 for piece in road.plan)
    for ref in network.drivable_lanes():
        x, y, _, heading = network.centreline(ref, 0.1).T
        steps_m = np.hypot(np.diff(x), np.diff(y))
        assert (np.abs(np.diff(heading)) <= steps_m / 1.9 + 1e-3).all()


def test_one_lane_beside_another_is_reached_by_a_curve_that_a_car_can_steer() -> None:
    """Straight on from the left lane of two into the right one, over a junction 10 m long."""
    town = Town()
    town.street([(-100, 0), (0, 0)], highway="secondary", oneway="yes", lanes="1", placement="right_of:1")
    town.street([(0, 0), (100, 0)], highway="secondary", oneway="yes", lanes="2", placement="left_of:1")
    town.street([(0, 0), (0, 80)], highway="service")
    turns, _ = tightest_turns(town.network())
    assert turns[0] >= 2.0 * (1 - 1e-3)
