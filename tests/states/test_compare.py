"""Estimators side by side."""

from __future__ import annotations

import dataclasses

import pytest
from cases import SETTINGS, sample_case

from trace_dag.roads.network import LaneRef
from trace_dag.states.compare import compare_estimators, summarise
from trace_dag.states.estimate import estimate
from trace_dag.states.types import EstimatorRun, StateEstimate


@pytest.fixture(scope="module")
def analytic() -> StateEstimate:
    case = sample_case("2023-319022")
    return estimate(case.record, case.network, case.report, SETTINGS.states)


def by_llm(made: StateEstimate, lane: LaneRef | None = None) -> StateEstimate:
    best = made.best
    if lane is not None:
        first, *rest = best.participants
        moved = dataclasses.replace(first, initial_lane=dataclasses.replace(first.initial_lane, lane=lane))
        best = dataclasses.replace(best, participants=(moved, *rest))
    run = EstimatorRun("llm", "1", model="m", attempts=3, cost_usd=0.02, fallback=True)
    return dataclasses.replace(made, hypotheses=(best,), run=run)


def test_agreement_is_counted_against_the_reference(analytic):
    key = analytic.key
    lane = analytic.best.participants[0].initial_lane.lane
    same, beside, facing = (
        compare_estimators({"analytic": {key: analytic}, "llm": {key: by_llm(analytic, changed)}})
        for changed in (None, lane._replace(lane_id=lane.lane_id * 2), lane._replace(lane_id=-lane.lane_id))
    )
    agreement = [(rows[1].approach_agrees, rows[1].lane_agrees) for rows in (same, beside, facing)]
    assert agreement == [(True, True), (True, False), (False, False)]
    assert same[0].approach_agrees is None
    assert same[1].impact_apart_m == 0


def test_the_summary_adds_up(analytic):
    key = analytic.key
    rows = compare_estimators(
        {"llm": {key: by_llm(analytic)}, "analytic": {key: analytic}},
        accepted={"analytic": {key: True}, "llm": {key: False}},
    )
    one, two = summarise(rows)
    assert (one.estimator, one.accepted, one.cost_usd, one.fallbacks, one.approach_agreement) == (
        "analytic",
        1.0,
        0.0,
        0,
        None,
    )
    assert (two.estimator, two.accepted, two.cost_usd, two.fallbacks, two.mean_attempts) == ("llm", 0.0, 0.02, 1, 3.0)
    assert two.approach_agreement == two.lane_agreement == 1.0


def test_nothing_to_compare_is_no_rows():
    assert compare_estimators({}) == ()
    assert summarise(()) == ()
