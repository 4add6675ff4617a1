"""Draws simulated and weighed: the plan's own draw gives the plan's crash, and the report weighs the others."""

from __future__ import annotations

import dataclasses
import math

import numpy as np
import pytest
from cases import SETTINGS, Case, sample_case

from trace_dag.common.errors import Failure
from trace_dag.reconstruction.estimate import estimate
from trace_dag.reconstruction.samples.crash import STEP_S, PlannedLine, SampledBody
from trace_dag.reconstruction.samples.draws import draw_samples
from trace_dag.reconstruction.samples.simulated import samples_from_json, samples_to_json, simulate_samples
from trace_dag.reconstruction.scene.scene import place_of
from trace_dag.simulation.embedded import EmbeddedBackend
from trace_dag.simulation.run import simulate
from trace_dag.simulation.states import PartyDraw, Sample, StateEstimate, Trajectory
from trace_dag.simulation.types import SimulationLog

Simulated = tuple[Case, StateEstimate, tuple[SimulationLog, ...]]


@pytest.fixture(scope="module", params=["2023-319003", "2023-319004"])
def simulated(request: pytest.FixtureRequest) -> Simulated:
    case = sample_case(request.param)
    states = estimate(case.record, case.network, case.report, SETTINGS.states)
    return case, states, simulate(EmbeddedBackend(SETTINGS.sim), case.network, b"", states, SETTINGS.sim)


def run(simulated: Simulated, samples: tuple[Sample, ...]):
    case, states, logs = simulated
    drawn = dataclasses.replace(states, samples=samples)
    return simulate_samples(case.network, drawn, logs, SETTINGS.sim, case.record, place_of(case.report.placement))


def as_planned(states: StateEstimate, ahead_m: float = 0.0) -> Sample:
    """The draw in which everything is as the best hypothesis has it; the slowest party so far ahead."""
    slowest = min(states.best.participants, key=lambda state: abs(state.impact_speed_mps))
    return Sample(
        0,
        1.0,
        tuple(
            PartyDraw(
                state.vehicle_number,
                abs(state.initial_speed_mps),
                abs(state.impact_speed_mps),
                ahead_m if state is slowest else 0.0,
                0.0,
                state.mass_kg,
            )
            for state in states.best.participants
        ),
        reaction=1.0,
    )


def test_the_draw_that_is_the_plan_gives_the_crash_of_the_plan(simulated: Simulated) -> None:
    _, states, logs = simulated
    (found,) = run(simulated, (as_planned(states),)).contacts
    contact = logs[0].first_contact
    assert contact is not None
    assert math.hypot(found.x_m - contact.x_m, found.y_m - contact.y_m) < 0.3
    for party in found.parties:
        first = party.number == contact.number_1
        delta_v = contact.delta_v_1_mps if first else contact.delta_v_2_mps
        velocity = contact.velocity_1_mps if first else contact.velocity_2_mps
        assert party.impact_speed_mps == pytest.approx(math.hypot(*velocity), rel=0.03, abs=0.1)
        assert party.delta_v_mps == pytest.approx(math.hypot(*delta_v), rel=0.1)


def test_the_course_of_the_draw_that_is_the_plan_is_the_one_of_the_plan(simulated: Simulated) -> None:
    _, states, logs = simulated
    (course,) = run(simulated, (as_planned(states),)).courses
    contact = logs[0].first_contact
    assert contact is not None
    assert {each.number for each in course.bodies} == {each.number for each in logs[0].vehicles}
    for body in course.bodies:
        planned = next(each for each in logs[0].vehicles if each.number == body.number)
        time_s = course.begins_s + STEP_S * np.arange(len(body.x))
        near = (time_s > -1.0) & (time_s < 1.0)
        for found, logged in zip(body.poses.T, (planned.x_m, planned.y_m), strict=False):
            wanted = np.interp(time_s[near] + contact.time_s, planned.time_s, logged)
            assert found[near] == pytest.approx(wanted, abs=1.0)


def test_a_braking_vehicle_of_a_draw_came_faster(simulated: Simulated) -> None:
    time_s, still = np.linspace(0.0, 10.0, 101), np.zeros(101)
    straight = Trajectory(time_s, 20.0 * time_s, still, still, still, still + 20.0)
    state = dataclasses.replace(simulated[1].best.participants[0], trajectory=straight, impact_speed_mps=20.0)
    line = PlannedLine(state, PartyDraw(1, 20.0, 10.0, 0.0, 0.0, 1500.0), 8.0)
    ((x, y, _),) = line.approach(np.array([-0.5, -1.5, -4.5]), back_s=0.5)
    # 10 m/s over the last half second; 0.4 g from 20 to 10 m/s take 2.55 s before it
    slowing = 0.4 * 9.80665
    braked_s = 10.0 / slowing
    assert x[0] == pytest.approx(160.0 - 5.0)
    assert x[0] - x[1] == pytest.approx(10.0 + slowing / 2)
    assert x[0] - x[2] == pytest.approx(15.0 * braked_s + 20.0 * (4.0 - braked_s))
    assert y == pytest.approx(np.zeros(3))


def test_courses_are_kept_to_five_centimetres_without_drift() -> None:
    x_m = np.linspace(100.013, 160.037, 91)
    poses = SampledBody.at(1, x_m, -x_m, np.linspace(0.0, 1.0, 91)).poses
    assert np.abs(poses[:, 0] - x_m).max() <= 0.0251
    assert np.abs(poses[:, 1] + x_m).max() <= 0.0251
    assert np.abs(poses[:, 2] - np.linspace(0.0, 1.0, 91)).max() <= 0.0101


def test_a_worse_fit_to_the_report_weighs_less(simulated: Simulated) -> None:
    _, states, _ = simulated
    found = run(simulated, (as_planned(states), as_planned(states, ahead_m=6.0)))
    weights = [each.weight for each in found.contacts]
    assert weights[0] > 0.9  # six metres are more than two standard deviations of the place, or miss altogether
    assert sum(weights) == pytest.approx(1.0, abs=1e-4)


def test_intervals_are_ordered_and_the_same_every_time(simulated: Simulated) -> None:
    case, states, _ = simulated
    samples = draw_samples(case.record, states.hypotheses, 6)
    found = run(simulated, samples)
    assert samples_to_json(run(simulated, samples)) == samples_to_json(found)
    assert samples_from_json(samples_to_json(found)) == found
    assert found.drawn == 6
    assert 1.0 <= found.effective <= 6.0
    assert {each.quantity for each in found.intervals} >= {"impact_speed", "delta_v", "contact_x", "contact_y"}
    assert all(each.low <= each.middle <= each.high for each in found.intervals)


def test_a_file_that_is_no_document_of_draws_is_named() -> None:
    with pytest.raises(Failure, match="simulate again"):
        samples_from_json(b"{}")
