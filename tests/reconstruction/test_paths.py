"""Paths: where they lead, and that a vehicle can follow them."""

from __future__ import annotations

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from trace_dag.common.geometry import Pose
from trace_dag.common.paths import (
    LateralShift,
    Path,
    TurnShape,
    extended,
    shifted,
    straight,
    through_points,
    turn_start_to_meet,
    turned,
)


def arc(radius_m: float, angle_rad: float, step_m: float = 1.0) -> np.ndarray:
    angles = np.linspace(0, angle_rad, max(int(radius_m * abs(angle_rad) / step_m), 3))
    return np.column_stack([radius_m * np.sin(angles), radius_m * (1 - np.cos(angles)), np.zeros_like(angles)])


def consistent(path: Path, tolerance_m: float = 0.03) -> None:
    """Headings are those of the points, stations their distances."""
    dx, dy = np.diff(path.x_m), np.diff(path.y_m)
    steps = np.diff(path.s_m)
    assert (steps > 0).all()
    assert np.hypot(dx, dy) == pytest.approx(steps, rel=0.01, abs=1e-4)
    middle = (path.heading_rad[1:] + path.heading_rad[:-1]) / 2
    assert np.abs(dy * np.cos(middle) - dx * np.sin(middle)).max() < tolerance_m


@given(st.floats(0.5, 12), st.floats(0.02, 0.5), st.floats(6, 60), st.sampled_from([1, -1]))
def test_a_shift_ends_beside_the_line_and_parallel_to_it(total, slope, ramp, sign):
    ramp = min(ramp, total / slope)
    shift = LateralShift(sign * total, sign * total * 0.6, slope, ramp)
    base = straight(Pose(0, 0, 0), back_m=800, ahead_m=800)
    path = shifted(base, shift, anchor_s_m=800)
    assert path.y_m[0] == pytest.approx(0, abs=1e-9)
    assert path.y_m[-1] == pytest.approx(sign * total, abs=1e-6)
    assert np.interp(0.0, path.x_m, path.y_m) == pytest.approx(sign * total * 0.6, abs=0.05)
    assert path.heading_rad[-1] == pytest.approx(0, abs=1e-9)
    consistent(path)


def test_a_shift_keeps_the_curvature_its_ramp_promises():
    path = shifted(straight(Pose(0, 0, 0), back_m=200, ahead_m=200), LateralShift(3.5, 2.3, 0.1, 25), anchor_s_m=200)
    assert np.abs(path.curvature_1pm).max() <= 1.5 * 0.1 / 25 * 1.02


@given(st.floats(math.radians(20), math.radians(180)), st.floats(4, 60), st.floats(1, 20), st.sampled_from([1, -1]))
def test_a_turn_turns_by_its_angle_no_tighter_than_its_radius(angle, radius, ramp, sign):
    shape = TurnShape(sign * angle, radius, min(ramp, radius * angle))
    path = turned(straight(Pose(3, -2, 1.0), back_m=50, ahead_m=50), shape, start_s_m=50, tail_m=30)
    assert path.heading_rad[-1] - path.heading_rad[0] == pytest.approx(sign * angle, abs=1e-6)
    assert np.abs(path.curvature_1pm).max() <= 1.02 / radius
    consistent(path)


@given(st.floats(math.radians(40), math.radians(140)), st.floats(6, 30), st.sampled_from([1, -1]))
def test_a_turn_can_be_begun_where_it_ends_in_the_lane_meant(angle, radius, sign):
    base = straight(Pose(0, 0, 0), back_m=100, ahead_m=100)
    shape = TurnShape(sign * angle, radius, 3.0)
    lane = Pose(5.0, sign * 12.0, sign * angle)
    start = turn_start_to_meet(base, shape, lane, near_s_m=95)
    assert start is not None
    path = turned(base, shape, start_s_m=start, tail_m=60)
    _, left = lane.to_body(np.array([path.x_m[-1], path.y_m[-1]]))
    assert left == pytest.approx(0, abs=0.05)


def test_no_turn_meets_a_parallel_lane():
    base = straight(Pose(0, 0, 0), back_m=100, ahead_m=100)
    assert turn_start_to_meet(base, TurnShape(math.pi, 6, 2), Pose(0, 8, math.pi), near_s_m=100) is None


def test_smoothing_leaves_straight_lines_alone():
    points = np.column_stack([np.linspace(0, 100, 40), np.linspace(0, 50, 40), np.linspace(0, 4, 40)])
    path = through_points(points, sigma_m=5)
    assert path.y_m == pytest.approx(path.x_m / 2, abs=1e-6)
    assert path.z_m == pytest.approx(path.x_m / 25, abs=1e-6)
    assert path.length_m == pytest.approx(math.hypot(100, 50), abs=1e-6)


def test_smoothing_moves_an_arc_inward_by_no_more_than_it_states():
    path = through_points(arc(40, 1.5), sigma_m=3)
    radius = np.hypot(path.x_m, path.y_m - 40)
    middle = radius[len(radius) // 4 : -len(radius) // 4]
    assert np.abs(40 - middle).max() <= 3**2 / (2 * 40) + 0.05


def test_smoothing_turns_a_kink_into_a_bend():
    kink = np.array([[-60, 0, 0], [0, 0, 0], [60 * math.cos(0.5), 60 * math.sin(0.5), 0]], float)
    sharp = np.column_stack([np.interp(np.arange(0, 120), [0, 60, 120], kink[:, axis]) for axis in range(3)])
    bends = [np.abs(through_points(sharp, sigma_m=sigma).curvature_1pm).max() for sigma in (3, 6, 12)]
    assert bends == sorted(bends, reverse=True)
    assert bends[-1] == pytest.approx(0.5 / (12 * math.sqrt(2 * math.pi)), rel=0.1)


def test_the_same_line_the_other_way():
    path = through_points(arc(50, 1.0), sigma_m=3)
    back = path.reversed()
    assert back.pose(0).x_m == pytest.approx(path.x_m[-1])
    assert math.cos(back.heading_rad[0] - path.heading_rad[-1]) == pytest.approx(-1)
    consistent(back)


def test_a_path_goes_on_straight_beyond_its_ends():
    path = straight(Pose(0, 0, math.pi / 2), back_m=10, ahead_m=10)
    assert path.pose(35).y_m == pytest.approx(25)
    longer = extended(path, back_m=20, ahead_m=20)
    assert longer.pose(30).y_m == pytest.approx(0)
    consistent(longer)


@given(st.floats(-40, 40), st.floats(-5, 5))
def test_projection_finds_station_and_side(along, aside):
    path = straight(Pose(0, 0, 0), back_m=50, ahead_m=50)
    station, offset = path.project(along, aside)
    assert station == pytest.approx(50 + along, abs=1e-6)
    assert offset == pytest.approx(aside, abs=1e-6)
