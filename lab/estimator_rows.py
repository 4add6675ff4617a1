"""Estimators side by side: each one's estimate of a crash, how far they agree, what asking cost, and the verdict.

Takes the finished estimates and returns rows. Running the estimators, judging them and measuring their errors against a
known truth is done in :mod:`lab.estimators`.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable, Mapping
from dataclasses import dataclass
from statistics import mean, median

from trace_dag.simulation.states import EstimatorRun, Hypothesis, ParticipantState, StateEstimate


@dataclass(frozen=True)
class EstimateErrors:
    """Errors of a best hypothesis against the truth, of the worse vehicle: metres, degrees."""

    approach_correct: bool
    lane_correct: bool
    impact_point_error_m: float
    heading_error_deg: float
    initial_position_error_m: float | None  # None unless both speeds are reported


@dataclass(frozen=True, eq=False)
class EstimatorAttempt:
    """One estimator's attempt at one crash: an estimate and its verdict, or a sentence with the reason why there is
    none.

    ``failed``: the estimator or a service failed, the crash is not the reason.
    """

    estimate: StateEstimate | None
    run: EstimatorRun | None = None  # of the estimator that made the estimate, or failed to
    detail: str = ""
    failed: bool = False
    accepted: bool | None = None
    reason: str | None = None
    truth: EstimateErrors | None = None


@dataclass(frozen=True)
class EstimatorRow:
    """One estimator's estimate of one crash, beside the reference estimator's; None where there is no value.

    ``outcome``: estimated (by itself), fallback (another estimator made it in its place), rejected or failed;
    ``detail`` is the reason. ``approach_agrees``: both vehicles start on the same road in the same direction as in the
    reference's best hypothesis; ``lane_agrees``: in the same lane too. ``accepted`` and ``reason`` come from the
    verdict. Errors are against the truth, see :class:`EstimateErrors`. Distances in metres, costs in US dollars.
    """

    key: str
    estimator: str
    outcome: str
    detail: str = ""
    hypothesis: str | None = None
    hypotheses: int = 0
    ambiguity: float | None = None
    checks_failed: int | None = None
    approach_agrees: bool | None = None
    lane_agrees: bool | None = None
    impact_apart_m: float | None = None
    accepted: bool | None = None
    reason: str | None = None
    model: str | None = None
    prompt_version: str | None = None
    attempts: int = 0
    prompt_tokens: int = 0
    completion_tokens: int = 0
    cost_usd: float = 0.0
    latency_s: float = 0.0
    approach_correct: bool | None = None
    lane_correct: bool | None = None
    impact_point_error_m: float | None = None
    heading_error_deg: float | None = None
    initial_position_error_m: float | None = None


@dataclass(frozen=True)
class EstimatorSummary:
    """One estimator over a cohort. Crashes that another had to estimate in its place are counted as fallbacks and
    nowhere else.

    Shares and medians are over those crashes it estimated itself for which the value is known; None if there are none.
    """

    estimator: str
    crashes: int
    estimated: int
    rejected: int
    failed: int
    approach_agreement: float | None
    lane_agreement: float | None
    all_checks_passed: float | None
    accepted: float | None
    mean_attempts: float | None
    fallbacks: int
    tokens: int
    cost_usd: float
    approach_correct: float | None
    lane_correct: float | None
    median_impact_point_error_m: float | None
    median_heading_error_deg: float | None
    median_initial_position_error_m: float | None


def compare_estimators(
    key: str, attempts: Mapping[str, EstimatorAttempt], *, reference: str
) -> tuple[EstimatorRow, ...]:
    """Return rows of one crash in the order of ``attempts`` (by estimator); the others are compared with ``reference``.

    >>> attempt = EstimatorAttempt(state_estimate, state_estimate.run)
    >>> one, two = compare_estimators(record.key, {"analytic": attempt, "other": attempt}, reference="analytic")
    >>> one.lane_agrees, two.lane_agrees, two.impact_apart_m  # the reference is not compared with itself
    (None, True, 0.0)
    """
    against = attempts[reference].estimate if reference in attempts else None
    if against is not None and against.run.fallback:
        against = None  # a fallback is not the reference's own estimate
    return tuple(_row(key, name, attempt, against if name != reference else None) for name, attempt in attempts.items())


def summarise(rows: Iterable[EstimatorRow]) -> tuple[EstimatorSummary, ...]:
    """Return one line per estimator, in order of first mention.

    >>> attempt = EstimatorAttempt(state_estimate, state_estimate.run)
    >>> rows = compare_estimators(record.key, {"analytic": attempt}, reference="analytic")
    >>> [line.crashes for line in summarise(rows)]
    [1]
    """
    by_estimator: dict[str, list[EstimatorRow]] = {}
    for row in rows:
        by_estimator.setdefault(row.estimator, []).append(row)
    return tuple(_summary(estimator, own) for estimator, own in by_estimator.items())


def _row(key: str, estimator: str, attempt: EstimatorAttempt, other: StateEstimate | None) -> EstimatorRow:
    run, truth = attempt.run, attempt.truth
    took = {} if run is None else {name: getattr(run, name) for name in _TAKEN_OVER}
    errors = {} if truth is None else vars(truth)
    if attempt.estimate is None:
        outcome = "failed" if attempt.failed else "rejected"
        return EstimatorRow(key, estimator, outcome, attempt.detail, **took)
    best = attempt.estimate.best
    return EstimatorRow(
        key,
        estimator,
        "fallback" if attempt.estimate.run.fallback else "estimated",
        attempt.estimate.run.fallback_reason,
        hypothesis=best.name,
        hypotheses=len(attempt.estimate.hypotheses),
        ambiguity=attempt.estimate.ambiguity,
        checks_failed=sum(not check.passed for check in best.checks),
        approach_agrees=_agree(best, other.best, _approach) if other else None,
        lane_agrees=_agree(best, other.best, _lane) if other else None,
        impact_apart_m=math.dist(best.impact_point_xy_m, other.best.impact_point_xy_m) if other else None,
        accepted=attempt.accepted,
        reason=attempt.reason,
        **took,
        **errors,
    )


_TAKEN_OVER = (
    "model",
    "prompt_version",
    "attempts",
    "prompt_tokens",
    "completion_tokens",
    "cost_usd",
    "latency_s",
)

_Place = tuple[str, int]


def _agree(one: Hypothesis, two: Hypothesis, place: Callable[[ParticipantState], _Place | None]) -> bool | None:
    others = {state.vehicle_number: place(state) for state in two.participants}
    pairs = [(place(state), others.get(state.vehicle_number)) for state in one.participants]
    if any(mine is None or theirs is None for mine, theirs in pairs):
        return None
    return all(mine == theirs for mine, theirs in pairs)


def _approach(state: ParticipantState) -> _Place | None:
    """Return the road a vehicle starts on and the direction along it; None if it starts off the lanes."""
    lane = _lane(state)
    return None if lane is None else (lane[0], 1 if lane[1] > 0 else -1)


def _lane(state: ParticipantState) -> _Place | None:
    if state.initial_lane is None:
        return None
    return state.initial_lane.lane.road_id, state.initial_lane.lane.lane_id


def _summary(estimator: str, rows: list[EstimatorRow]) -> EstimatorSummary:
    made = [row for row in rows if row.outcome == "estimated"]
    asked = [row.attempts for row in rows if row.attempts]
    return EstimatorSummary(
        estimator=estimator,
        crashes=len(rows),
        estimated=len(made),
        rejected=sum(row.outcome == "rejected" for row in rows),
        failed=sum(row.outcome == "failed" for row in rows),
        approach_agreement=_share(row.approach_agrees for row in made),
        lane_agreement=_share(row.lane_agrees for row in made),
        all_checks_passed=_share(row.checks_failed == 0 for row in made),
        accepted=_share(row.accepted for row in made),
        mean_attempts=mean(asked) if asked else None,
        fallbacks=sum(row.outcome == "fallback" for row in rows),
        tokens=sum(row.prompt_tokens + row.completion_tokens for row in rows),
        cost_usd=round(math.fsum(row.cost_usd for row in rows), 8),
        approach_correct=_share(row.approach_correct for row in made),
        lane_correct=_share(row.lane_correct for row in made),
        median_impact_point_error_m=_median(row.impact_point_error_m for row in made),
        median_heading_error_deg=_median(row.heading_error_deg for row in made),
        median_initial_position_error_m=_median(row.initial_position_error_m for row in made),
    )


def _share(values: Iterable[bool | None]) -> float | None:
    known = [value for value in values if value is not None]
    return math.fsum(known) / len(known) if known else None


def _median(values: Iterable[float | None]) -> float | None:
    known = [value for value in values if value is not None]
    return median(known) if known else None
