"""Draws of what a report leaves open: spread evenly, the same every time, and within what the report says."""

from __future__ import annotations

import math
from statistics import NormalDist

import pytest
from cases import SETTINGS, sample_case

from trace_dag.common.units import mph_to_mps
from trace_dag.reconstruction.estimate import estimate
from trace_dag.reconstruction.samples.draws import draw_samples
from trace_dag.simulation.states import Sample, SpeedSource, StateEstimate, estimate_from_json, estimate_to_json

KEY = "2023-319003"
COUNT = 20


@pytest.fixture(scope="module")
def states() -> StateEstimate:
    case = sample_case(KEY)
    return estimate(case.record, case.network, case.report, SETTINGS.states)


@pytest.fixture(scope="module")
def drawn(states: StateEstimate) -> tuple[Sample, ...]:
    return draw_samples(sample_case(KEY).record, states.hypotheses, COUNT)


def test_the_same_draws_every_time_and_none_where_none_are_asked_for(
    states: StateEstimate, drawn: tuple[Sample, ...]
) -> None:
    assert draw_samples(sample_case(KEY).record, states.hypotheses, COUNT) == drawn
    assert len(drawn) == COUNT
    assert draw_samples(sample_case(KEY).record, states.hypotheses, 0) == ()


def test_each_number_falls_once_into_each_equal_part_of_its_distribution(
    states: StateEstimate, drawn: tuple[Sample, ...]
) -> None:
    """Latin hypercube sampling: here of the masses, whose logarithms scatter normally by 12 %."""
    for number, mass_kg in ((state.vehicle_number, state.mass_kg) for state in states.best.participants):
        masses = [each.mass_kg for sample in drawn for each in sample.parties if each.number == number]
        shares = [NormalDist(0.0, 0.12).cdf(math.log(mass / mass_kg)) for mass in masses]
        assert sorted(int(share * COUNT) for share in shares) == list(range(COUNT))


def test_reported_speeds_stay_within_their_rounding(states: StateEstimate, drawn: tuple[Sample, ...]) -> None:
    reported = {
        state.vehicle_number: state.initial_speed_mps
        for state in states.best.participants
        if state.speed_source is SpeedSource.REPORTED
    }
    assert reported
    for sample in drawn:
        for each in sample.parties:
            if each.number in reported:
                assert each.travel_mps == pytest.approx(reported[each.number], abs=mph_to_mps(2.5) + 0.001)
                assert each.impact_mps <= 1.3 * each.travel_mps + 0.001


def test_draws_are_stored_with_the_estimate(states: StateEstimate, drawn: tuple[Sample, ...]) -> None:
    stored = StateEstimate(states.key, states.hypotheses, states.run, states.ambiguity, drawn)
    assert estimate_from_json(estimate_to_json(stored)).samples == drawn
