"""Estimators side by side."""

from __future__ import annotations

import dataclasses

import pytest
from cases import SETTINGS, sample_case

from lab.estimator_rows import EstimateErrors, EstimatorAttempt, EstimatorRow, compare_estimators, summarise
from trace_dag.reconstruction.estimate import estimate
from trace_dag.roads.map.model import LaneRef
from trace_dag.simulation.states import EstimatorRun, StateEstimate

RUN = EstimatorRun("llm", "1", model="m", attempts=3, prompt_tokens=900, cost_usd=0.02)


@pytest.fixture(scope="module")
def analytic() -> StateEstimate:
    case = sample_case("2023-319022")
    return estimate(case.record, case.network, case.report, SETTINGS.states)


def attempt(made: StateEstimate, lane: LaneRef | None = None, **changes: object) -> EstimatorAttempt:
    """A model's estimate: the same, but that the first vehicle starts in ``lane``."""
    best = made.best
    if lane is not None:
        first, *rest = best.participants
        moved = dataclasses.replace(first, initial_lane=dataclasses.replace(first.initial_lane, lane=lane))
        best = dataclasses.replace(best, participants=(moved, *rest))
    return EstimatorAttempt(dataclasses.replace(made, hypotheses=(best,), run=RUN), RUN, **changes)


def compared(one: EstimatorAttempt, two: EstimatorAttempt) -> tuple[EstimatorRow, ...]:
    return compare_estimators("k", {"analytic": one, "llm": two}, reference="analytic")


def test_agreement_is_with_the_reference(analytic):
    lane = analytic.best.participants[0].initial_lane.lane
    same, beside, facing = (
        compared(EstimatorAttempt(analytic, analytic.run), attempt(analytic, changed))
        for changed in (None, lane._replace(lane_id=lane.lane_id * 2), lane._replace(lane_id=-lane.lane_id))
    )
    agreement = [(rows[1].approach_agrees, rows[1].lane_agrees) for rows in (same, beside, facing)]
    assert agreement == [(True, True), (True, False), (False, False)]
    assert same[0].approach_agrees is None
    assert same[1].impact_apart_m == 0


def test_a_crash_without_estimate_has_a_row(analytic):
    refused = EstimatorAttempt(None, RUN, "no usable answer in 3 attempts")
    broken = EstimatorAttempt(None, detail="the provider is down", failed=True)
    rows = compared(refused, broken)
    assert [(row.outcome, row.detail, row.attempts) for row in rows] == [
        ("rejected", "no usable answer in 3 attempts", 3),
        ("failed", "the provider is down", 0),
    ]
    assert all(row.approach_agrees is None and row.hypothesis is None for row in rows)
    after_rejection = compared(refused, attempt(analytic))
    assert after_rejection[1].outcome == "estimated"
    assert after_rejection[1].approach_agrees is None


def test_the_summary_adds_up(analytic):
    right = EstimateErrors(True, True, 0.5, 3.0, 1.0)
    wrong = EstimateErrors(False, False, 2.5, 5.0, None)
    rows = (
        *compared(
            EstimatorAttempt(analytic, analytic.run, accepted=True, truth=right), attempt(analytic, accepted=False)
        ),
        *compared(
            EstimatorAttempt(analytic, analytic.run, accepted=False, truth=wrong),
            EstimatorAttempt(None, RUN, "refused"),
        ),
    )
    one, two = summarise(rows)
    assert (one.estimator, one.crashes, one.estimated, one.accepted) == ("analytic", 2, 2, 0.5)
    assert (one.cost_usd, one.tokens, one.fallbacks, one.approach_agreement) == (0.0, 0, 0, None)
    assert (one.approach_correct, one.lane_correct, one.median_impact_point_error_m) == (0.5, 0.5, 1.5)
    assert (one.median_heading_error_deg, one.median_initial_position_error_m) == (4.0, 1.0)
    assert (two.estimator, two.crashes, two.estimated, two.rejected, two.failed) == ("llm", 2, 1, 1, 0)
    assert (two.accepted, two.cost_usd, two.tokens, two.fallbacks, two.mean_attempts) == (0.0, 0.04, 1800, 0, 3)
    assert two.approach_agreement == two.lane_agreement == 1.0
    assert two.approach_correct is None


def test_estimates_by_a_fallback_are_counted_apart(analytic):
    stepped_in = dataclasses.replace(
        RUN, estimator="analytic", fallback_from="llm", fallback_reason="m gave no usable answer"
    )
    right = EstimateErrors(True, True, 0.5, 3.0, 1.0)
    own = attempt(analytic, accepted=False)
    fallback = EstimatorAttempt(dataclasses.replace(analytic, run=stepped_in), stepped_in, accepted=True, truth=right)
    rows = [*compared(EstimatorAttempt(analytic), own), *compared(EstimatorAttempt(analytic), fallback)]
    assert [row.outcome for row in rows if row.estimator == "llm"] == ["estimated", "fallback"]
    assert rows[-1].detail == "m gave no usable answer"
    llm = summarise(rows)[1]
    assert (llm.crashes, llm.estimated, llm.fallbacks) == (2, 1, 1)
    assert (llm.accepted, llm.approach_correct, llm.median_impact_point_error_m) == (0.0, None, None)
    assert llm.cost_usd == pytest.approx(0.04), "asking was paid for all the same"


def test_nothing_to_compare_is_no_rows():
    assert compare_estimators("k", {}, reference="analytic") == ()
    assert summarise(()) == ()
