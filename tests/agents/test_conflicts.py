"""Time to contact and post-encroachment time against hand calculation."""

from __future__ import annotations

import math

import numpy as np
import pytest

from tests.simulation.motions import CAR
from trace_dag.agents.evaluation.metrics import needed_mps2
from trace_dag.scenario.conflicts import post_encroachment_time_s, time_to_contact_s
from trace_dag.simulation.outlines import Outline
from trace_dag.simulation.types import VehicleLog


def car(x_m: float, y_m: float, heading_rad: float = 0.0) -> Outline:
    return Outline(x_m, y_m, heading_rad, 2.0, 1.0)


def test_time_to_contact_of_two_in_line_is_gap_over_closing_speed():
    assert time_to_contact_s(car(0, 0), (10, 0), car(24, 0), (0, 0)) == pytest.approx(2.0)
    assert time_to_contact_s(car(0, 0), (10, 0), car(24, 0), (-10, 0)) == pytest.approx(1.0)


def test_passing_and_departing_vehicles_never_touch():
    assert math.isinf(time_to_contact_s(car(0, 0), (10, 0), car(24, 2.1), (0, 0)))
    assert math.isinf(time_to_contact_s(car(0, 0), (10, 0), car(24, 0), (12, 0)))


def test_crossing_bodies_touch_when_the_later_axis_closes():
    # Along x the gap is 10 - 2 - 1 = 7 m at 7 m/s; along y 8 - 1 - 2 = 5 m at 8 m/s: together from 1 s on.
    assert time_to_contact_s(car(0, 0), (7, 0), car(10, -8, math.pi / 2), (0, 8)) == pytest.approx(1.0)


def test_bodies_that_overlap_touch_now():
    assert time_to_contact_s(car(0, 0), (1, 0), car(3, 0), (5, 0)) == 0.0


def log(number: int, x_m: np.ndarray, y_m: np.ndarray, heading_rad: float, time_s: np.ndarray) -> VehicleLog:
    zero = np.zeros_like(time_s)
    rest = (zero,) * 11
    return VehicleLog(number, time_s, x_m, y_m, zero, zero + heading_rad, *rest, landmarks_m=np.zeros((len(zero), 0)))


def test_the_deceleration_needed_is_that_of_the_own_vehicle_alone():
    """Across the own way the other one's speed does not count: 30 m at 15 m/s is 15 ** 2 / (2 * 30)."""
    assert needed_mps2(2.0, (1.0, 0.0), (15.0, 0.0), (0.0, 12.0)) == pytest.approx(3.75)
    assert needed_mps2(2.0, (1.0, 0.0), (5.0, 0.0), (9.0, 0.0)) == 0.0  # who is caught up with cannot mend it


def test_post_encroachment_time_is_the_gap_in_time_at_the_shared_place():
    # Both at 10 m/s; the first one's rear leaves the crossing strip 0.3275 s after its centre passes it, the second
    # one's front comes 0.3275 s before its own does: centres 2 s apart make 2 - 2 * (4.7 + 1.85) / 2 / 10 = 1.345 s.
    time_s = np.arange(0, 8, 0.02)
    one = log(1, 10 * (time_s - 2), 0 * time_s, 0.0, time_s)
    two = log(2, 0 * time_s, 10 * (time_s - 4), math.pi / 2, time_s)
    assert 1.345 <= (post_encroachment_time_s(one, CAR, two, CAR) or 0) <= 1.345 + 2 * 0.06


def test_paths_that_share_no_place_have_no_post_encroachment_time():
    time_s = np.arange(0, 4, 0.02)
    one, two = (log(n, 10 * time_s, 0 * time_s + 10 * n, 0.0, time_s) for n in (1, 2))
    assert post_encroachment_time_s(one, CAR, two, CAR) is None
