"""Curves of the plan view: they run where they should, without gaps or kinks."""

from __future__ import annotations

import itertools
import math

import numpy as np
import pytest
import shapely
from hypothesis import assume, given
from hypothesis import strategies as st

from trace_dag.roads.from_osm.polyline_fit import fit_plan
from trace_dag.roads.map.curves import PlanPose, PlanView, connect, cut_plan, join_plans, plan_pose, reverse_plan
from trace_dag.roads.map.reference_line import ReferenceLine

Points = list[tuple[float, float]]


@st.composite
def polylines(draw: st.DrawFn) -> Points:
    """Streets as mappers draw them: segments of 2 to 80 m, bends of up to 100 degrees."""
    x, y, heading = 0.0, 0.0, draw(st.floats(-3.1, 3.1))
    points = [(x, y)]
    for _ in range(draw(st.integers(1, 8))):
        length = draw(st.floats(2.0, 80.0))
        x, y = x + length * math.cos(heading), y + length * math.sin(heading)
        points.append((x, y))
        heading += draw(st.one_of(st.just(0.0), st.floats(-0.3, 0.3), st.floats(-1.7, 1.7)))
    return points


def worst_joint(plan: PlanView) -> tuple[float, float]:
    """Largest gap (metres) and kink (radians) between consecutive elements, by an independent evaluation."""
    gap = kink = 0.0
    for a, b in zip(plan.elements, plan.elements[1:], strict=False):
        x, y, heading, _ = ReferenceLine((a,), a.s_m + a.length_m).at(a.s_m + a.length_m)
        gap = max(gap, math.hypot(b.x_m - x, b.y_m - y))
        kink = max(kink, abs(math.remainder(b.heading_rad - heading, math.tau)))
    return gap, kink


def sampled(plan: PlanView) -> np.ndarray:
    line = ReferenceLine(plan.elements, plan.length_m)
    return line.sample(line.stations(0.5))


@given(polylines(), st.sampled_from([0.0, 7.15, 9.0, 30.0]))
def test_a_fitted_line_is_smooth_and_follows_the_polyline(points: Points, radius: float) -> None:
    plan = fit_plan(points, radius)
    gap, kink = worst_joint(plan)
    assert gap < 1e-4
    assert kink < 1e-4
    assert sum(element.length_m for element in plan.elements) == pytest.approx(plan.length_m)
    line = shapely.LineString(sampled(plan)[:, :2])
    drawn = shapely.LineString(points)
    assert shapely.hausdorff_distance(line, drawn) < 3.05
    start, end = plan_pose(plan, 0.0), plan_pose(plan, plan.length_m)
    assert math.dist(start[:2], points[0]) < 1e-6
    assert math.dist(end[:2], points[-1]) < 1e-3


@given(polylines())
def test_vertices_lie_along_the_plan_in_order(points: Points) -> None:
    plan = fit_plan(points, 9.0)
    assert len(plan.vertex_s_m) == len(points)
    assert list(plan.vertex_s_m) == sorted(plan.vertex_s_m)
    for point, s in zip(points, plan.vertex_s_m, strict=True):
        assert math.dist(plan_pose(plan, s)[:2], point) < 8.0


def test_a_right_angle_gets_the_radius_asked_for() -> None:
    plan = fit_plan([(0, 0), (50, 0), (50, 50)], 6.0)
    assert 1 / max(element.curvature_1pm for element in plan.elements) == pytest.approx(6.0)


@pytest.mark.parametrize(
    ("before_m", "behind_m", "least_m", "most_m"),
    [
        (40.0, 40.0, 1.6, 1.7),  # 0.95 m out on both sides: 7.15 m * (sqrt(2) - 1) - 0.95 m * sqrt(2)
        (12.0, 40.0, 2.2, 2.5),  # on the longer side only
        (40.0, 12.0, 2.2, 2.5),
        (12.0, 12.0, 2.9, 3.0),
    ],
)
def test_a_right_angle_is_missed_by_less_where_there_is_room_to_swing_out(
    before_m: float, behind_m: float, least_m: float, most_m: float
) -> None:
    drawn = [(-before_m, 0.0), (0.0, 0.0), (0.0, behind_m)]
    plan = fit_plan(drawn, 7.15)
    assert least_m < shapely.LineString(sampled(plan)[:, :2]).distance(shapely.Point(0.0, 0.0)) < most_m
    assert 1 / max(element.curvature_1pm for element in plan.elements) > 7.0


def test_a_bend_drawn_with_many_vertices_becomes_one_wide_enough() -> None:
    corner = [(3 * math.sin(a), 3 - 3 * math.cos(a)) for a in np.linspace(0, math.pi / 2, 5)]
    plan = fit_plan([(-40, 0), *corner, (3, 40)], 6.0)
    assert 1 / max(element.curvature_1pm for element in plan.elements) == pytest.approx(6.0, rel=0.1)


@given(polylines(), st.floats(0.05, 0.45), st.floats(0.55, 0.95))
def test_pieces_of_a_line_put_together_are_the_line(points: Points, first: float, second: float) -> None:
    plan = fit_plan(points, 9.0)
    cuts = [0.0, first * plan.length_m, second * plan.length_m, plan.length_m]
    joined = join_plans([cut_plan(plan, a, b) for a, b in itertools.pairwise(cuts)])
    assert joined.length_m == pytest.approx(plan.length_m)
    assert np.abs(sampled(joined) - sampled(plan))[:, :2].max() < 1e-3


@given(polylines())
def test_a_line_run_backwards_is_the_same_line(points: Points) -> None:
    plan = fit_plan(points, 9.0)
    assert np.abs(sampled(reverse_plan(plan))[::-1, :2] - sampled(plan)[:, :2]).max() < 1e-4


@given(st.floats(-40, 40), st.floats(-40, 40), st.floats(-3.1, 3.1), st.floats(-3.1, 3.1))
def test_a_curve_between_two_poses_touches_both(x: float, y: float, h0: float, h1: float) -> None:
    assume(math.hypot(x, y) > 0.5)
    start, end = PlanPose(0.0, 0.0, h0), PlanPose(x, y, h1)
    plan = connect(start, end)
    assume(plan is not None)
    gap, kink = worst_joint(plan)
    first, last = plan_pose(plan, 0.0), plan_pose(plan, plan.length_m)
    assert gap < 2e-3
    assert kink < math.radians(0.1)
    assert math.dist(first[:2], start[:2]) < 2e-3
    assert math.dist(last[:2], end[:2]) < 2e-3
    assert abs(math.remainder(first.heading_rad - start.heading_rad, math.tau)) < math.radians(0.1)
    assert abs(math.remainder(last.heading_rad - end.heading_rad, math.tau)) < math.radians(0.1)


def test_a_quarter_turn_is_one_arc() -> None:
    plan = connect(PlanPose(0, 0, 0), PlanPose(10, 10, math.pi / 2))
    assert plan is not None
    assert [element.curvature_1pm for element in plan.elements] == pytest.approx([0.1])


def test_no_curve_leads_straight_back() -> None:
    assert connect(PlanPose(0, 0, 0), PlanPose(-10, 0, 0)) is None
