"""Families: within their bounds, on their criteria, the same for a seed whoever makes them."""

from __future__ import annotations

import math

import numpy as np
import pytest

from tests.agents.cases import BACKEND, crossing, rear_end
from trace_dag.agents.variations import (
    Bounds,
    Criteria,
    Perturbation,
    VariationKind,
    VehiclePerturbation,
    draw,
    family,
    perturb_motion,
)

NOTHING = VehiclePerturbation(1, 1.0, 0.0, 0.0, 0.0), VehiclePerturbation(2, 1.0, 0.0, 0.0, 0.0)


def test_no_perturbation_is_the_recorded_motion():
    of = crossing()
    same, impact_s = perturb_motion(of.participants, Perturbation(NOTHING, 1.0), of.impact_time_s)
    assert impact_s == of.impact_time_s
    for ours, theirs in zip(same, of.participants, strict=True):
        t, u = ours.trajectory, theirs.trajectory
        assert np.interp(t.time_s, u.time_s, u.x_m) == pytest.approx(t.x_m)
        assert np.interp(t.time_s, u.time_s, u.y_m) == pytest.approx(t.y_m)


def test_each_perturbation_does_what_it_states():
    of = crossing(15.0)
    faster, late = VehiclePerturbation(1, 1.1, 0.0, 0.3, 0.0), VehiclePerturbation(2, 1.0, 0.2, 0.0, 0.0)
    (one, two), impact_s = perturb_motion(of.participants, Perturbation((faster, late), 1.0), of.impact_time_s)
    assert one.initial_speed_mps == pytest.approx(16.5)
    at_impact = np.interp(impact_s, one.trajectory.time_s, one.trajectory.x_m)
    assert at_impact == pytest.approx(0.0, abs=0.01), "speed alone does not change where it is at the impact"
    assert one.initial_pose.y_m == pytest.approx(-1.75 + 0.3)
    assert np.interp(impact_s, two.trajectory.time_s, two.trajectory.y_m) == pytest.approx(-1.75 - 0.2 * 15.0, abs=0.01)


def test_a_reacting_driver_brakes_at_five_metres_per_second_squared():
    of = rear_end(20.0)
    brakes = VehiclePerturbation(1, 1.0, 0.0, 0.0, 1.0), NOTHING[1]
    (one, _), impact_s = perturb_motion(of.participants, Perturbation(brakes, 1.0), of.impact_time_s)
    t = one.trajectory
    assert np.interp(impact_s - 1.0, t.time_s, t.speed_mps) == pytest.approx(20.0, abs=0.11)
    assert np.interp(impact_s, t.time_s, t.speed_mps) == pytest.approx(15.0, abs=0.2)
    assert float(np.interp(impact_s, t.time_s, t.x_m)) == pytest.approx(-4.7 - 2.5, abs=0.2)


def test_draws_stay_in_their_bounds_and_depend_on_nothing_but_their_arguments():
    bounds = Bounds()
    draws = [draw("2023-1", (1, 2), 7, index, bounds) for index in range(300)]
    assert draws == [draw("2023-1", (1, 2), 7, index, bounds) for index in range(300)]
    assert draws[0] != draw("2023-1", (1, 2), 8, 0, bounds)
    assert draws[0] != draw("2023-2", (1, 2), 7, 0, bounds)
    vehicles = [vehicle for each in draws for vehicle in each.vehicles]
    assert all(abs(vehicle.speed_factor - 1) <= bounds.speed_rel for vehicle in vehicles)
    assert all(abs(vehicle.delay_s) <= bounds.timing_s for vehicle in vehicles)
    assert all(abs(vehicle.offset_left_m) <= bounds.lateral_m for vehicle in vehicles)
    assert 0.4 < np.mean([vehicle.reaction_s == 0 for vehicle in vehicles]) < 0.6
    assert all(bounds.friction_low <= each.friction_factor <= 1 for each in draws)


def test_a_family_holds_what_meets_the_criteria():
    of, criteria = crossing(), Criteria()
    kept, drawn = family(of, BACKEND, count=4, seed=3, bounds=Bounds(), criteria=criteria)
    assert [variation.variation_id for variation in kept] == [f"2023-1-v00{n}" for n in range(1, len(kept) + 1)]
    assert 1 <= len(kept) <= 4 <= drawn <= 80
    for variation in kept:
        contact, recorded = variation.case.contact, of.contact
        assert recorded is not None
        if variation.kind is VariationKind.COLLISION:
            assert contact is not None
            apart_m = math.hypot(contact.x_m - recorded.x_m, contact.y_m - recorded.y_m)
            assert apart_m <= criteria.max_contact_shift_m
        else:
            assert contact is None
            assert 0 <= variation.gap_m <= criteria.near_miss_m
    again, _ = family(of, BACKEND, count=4, seed=3, bounds=Bounds(), criteria=criteria)
    assert [each.perturbation for each in again] == [each.perturbation for each in kept]
