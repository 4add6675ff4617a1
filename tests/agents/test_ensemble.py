"""A crash as weighted courses, and an agent's result as a probability."""

from __future__ import annotations

import dataclasses
import json

import duckdb
import numpy as np
import pytest
from cases import SETTINGS, sample_case

from trace_dag.reconstruction.estimate import estimate
from trace_dag.reconstruction.samples.draws import draw_samples
from trace_dag.reconstruction.samples.simulated import SampledContact, SampledRuns, simulate_samples
from trace_dag.reconstruction.scene.scene import place_of
from trace_dag.scenario.driving_files import draw_course, ensemble_to_json, likely_draws
from trace_dag.simulation.embedded import EmbeddedBackend
from trace_dag.simulation.run import simulate
from trace_dag.simulation.states import StateEstimate
from trace_dag.warehouse.outcomes import execute_sql


def weighed(*weights: float) -> SampledRuns:
    contacts = tuple(SampledContact(2 * k, weight, 0.0, 0.0, None, ()) for k, weight in enumerate(weights))
    return SampledRuns(2 * len(weights), 1.0, contacts, ())


@pytest.fixture(scope="module")
def crash() -> tuple[StateEstimate, SampledRuns]:
    """A car that turns left across a motorcycle, and what 24 draws of it come to."""
    case = sample_case("2023-319003")
    states = estimate(case.record, case.network, case.report, SETTINGS.states)
    states = dataclasses.replace(states, samples=draw_samples(case.record, states.hypotheses, 24))
    logs = simulate(EmbeddedBackend(SETTINGS.sim), case.network, b"", states, SETTINGS.sim)
    place = place_of(case.report.placement)
    return states, simulate_samples(case.network, states, logs, SETTINGS.sim, case.record, place)


def test_a_draw_is_taken_as_often_as_it_weighs() -> None:
    assert likely_draws(weighed(0.3, 0.6, 0.1), most=10) == [(2, 0.6), (0, 0.3), (4, 0.1)]


def test_a_draw_that_weighs_less_than_half_a_course_is_left_out() -> None:
    assert likely_draws(weighed(0.98, 0.02), most=20) == [(0, 1.0)]


def test_no_more_courses_than_asked_for() -> None:
    found = likely_draws(weighed(*[1 / 64] * 64), most=20)
    assert len(found) == 20
    assert sum(weight for _, weight in found) == pytest.approx(1.0)


def test_no_courses_without_a_draw_that_agrees() -> None:
    assert likely_draws(weighed()) == []


def test_a_course_begins_as_long_before_the_impact_as_the_crash_at_the_draws_travel_speed(crash) -> None:
    states, sampled = crash
    for sample, _ in likely_draws(sampled):
        course = draw_course(states, sample)
        assert course.impact_time_s == course.hypothesis.impact_time_s
        for own, draw in zip(course.participants, states.samples[sample].parties, strict=True):
            plan = own.trajectory
            assert own.initial_speed_mps == pytest.approx(draw.travel_mps, abs=1e-6)
            at_impact = np.interp(course.impact_time_s, plan.time_s, np.abs(plan.speed_mps))
            assert at_impact == pytest.approx(draw.impact_mps, abs=1e-6)


def test_a_course_is_as_long_as_its_speeds_say(crash) -> None:
    states, sampled = crash
    for sample, _ in likely_draws(sampled):
        for own in draw_course(states, sample).participants:
            plan = own.trajectory
            way_m = np.hypot(np.diff(plan.x_m), np.diff(plan.y_m)).sum()
            assert way_m == pytest.approx(np.trapezoid(np.abs(plan.speed_mps), plan.time_s), rel=0.02)


def test_a_package_has_them_with_weights_that_add_up(crash) -> None:
    states, sampled = crash
    courses = json.loads(ensemble_to_json("2023-319003", states, sampled))["courses"]
    assert sum(each["weight"] for each in courses) == pytest.approx(1.0)
    assert [each["weight"] for each in courses] == sorted((each["weight"] for each in courses), reverse=True)
    for each in courses:
        steps = {len(column) for party in each["parties"].values() for column in party.values()}
        assert steps == {int((each["impact_s"] + 5.0) / 0.1 + 0.5) + 1}


def test_a_result_is_a_probability_with_wilsons_interval_of_so_many_equal_courses() -> None:
    """Weights of 3/4 and 1/4 are worth 1 / (9/16 + 1/16) = 1.6 courses; z is 1.96."""
    connection = duckdb.connect()
    connection.execute(
        "CREATE TABLE evaluations (agent TEXT, key TEXT, case_id TEXT, vehicle_number INTEGER, weight DOUBLE,"
        " outcome TEXT, recorded_delta_v_mps DOUBLE)"
    )
    for case_id, weight, outcome, delta_v_mps in (
        ("2023-1", 1.0, "worse", 9.0),  # the crash itself
        ("2023-1-c03", 0.75, "collision_avoided", 9.0),
        ("2023-1-c00", 0.25, "mitigated", 9.0),
        ("2023-1-c07", 0.5, "unchanged", 0.0),  # a near miss
    ):
        connection.execute(
            "INSERT INTO evaluations VALUES ('idm', '2023-1', ?, 1, ?, ?, ?)", [case_id, weight, outcome, delta_v_mps]
        )
    execute_sql(connection, "agent_probabilities")
    found = connection.sql(
        "SELECT courses, effective, avoided, avoided_low, avoided_high, mitigated, worse FROM agent_probabilities"
    ).fetchall()
    assert found == [pytest.approx((2, 1.6, 0.75, 0.1691, 0.9779, 0.25, 0.0), abs=1e-4)]
