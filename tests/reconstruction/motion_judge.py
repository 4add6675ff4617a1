"""An independent judge of estimated motion: shapely and differences, nothing of the estimator."""

from __future__ import annotations

import numpy as np
import pytest
import shapely

from trace_dag.common.geometry import Pose, rectangle_corners
from trace_dag.simulation.states import EstimateCheck, Hypothesis, ParticipantState


def outline(state, index: int) -> shapely.Geometry:
    """A vehicle's rectangle, and that of its trailer, which is hinged where the vehicle is coupled."""
    t, trailer = state.trajectory, state.trailer
    pose = Pose(float(t.x_m[index]), float(t.y_m[index]), float(t.heading_rad[index]))
    own = shapely.Polygon(rectangle_corners(pose, state.length_m, state.width_m))
    if trailer is None:
        return own
    hitch_x, hitch_y = pose.to_world(np.array([state.length_m / 2 - trailer.hitch_m, 0.0]))
    hinged = Pose(float(hitch_x), float(hitch_y), float(state.trailer_heading_rad[index]))
    centre_x, centre_y = hinged.to_world(np.array([trailer.coupling_m - trailer.length_m / 2, 0.0]))
    behind = Pose(float(centre_x), float(centre_y), hinged.heading_rad)
    return own.union(shapely.Polygon(rectangle_corners(behind, trailer.length_m, trailer.width_m)))


TIGHTEST_TURN_M = 2.0  # no lane of a map turns tighter: the gate of maps sees to it


def named_check(hypothesis: Hypothesis, name: str, state: ParticipantState) -> EstimateCheck:
    (found,) = (check for check in hypothesis.checks if check.name == f"{name} (vehicle {state.vehicle_number})")
    return found


def judge_geometry(hypothesis: Hypothesis) -> None:
    """Bodies touch at the impact and never before, motion is smooth and consistent; by shapely and differences."""
    one, two = hypothesis.participants
    impact = int(np.argmin(np.abs(one.trajectory.time_s - hypothesis.impact_time_s)))
    for index in range(0, impact, 3):
        assert not outline(one, index).intersects(outline(two, index))
    assert outline(one, impact).distance(outline(two, impact)) <= 0.03
    assert outline(one, impact).intersection(outline(two, impact)).area <= 0.05
    for state in (one, two):
        t = state.trajectory
        step = np.diff(t.time_s)
        assert step == pytest.approx(step[0], abs=1e-5)
        travelled = np.hypot(np.diff(t.x_m), np.diff(t.y_m))
        mean_speed = np.abs(t.speed_mps[1:] + t.speed_mps[:-1]) / 2
        assert travelled == pytest.approx(mean_speed * step, rel=0.02, abs=2e-3)
        turned = np.abs(np.diff(t.heading_rad))
        assert (turned <= travelled / TIGHTEST_TURN_M + 1e-3).all()
        if named_check(hypothesis, "lateral acceleration", state).passed:
            assert turned[:impact].max() < 0.05  # what the check looks at: the way to the impact
        moving = mean_speed > 1
        course = np.arctan2(np.diff(t.y_m), np.diff(t.x_m)) + np.where(t.speed_mps[:-1] < 0, np.pi, 0)
        midway = (t.heading_rad[1:] + t.heading_rad[:-1]) / 2  # an arc's chord has the heading of its middle
        apart = np.abs(np.remainder(course - midway + np.pi, 2 * np.pi) - np.pi)
        assert apart[moving].max(initial=0) < 0.06
