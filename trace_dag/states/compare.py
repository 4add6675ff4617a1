"""Estimators side by side on one cohort: who agrees with whom, what it took, and what the verdicts said.

Pure: takes estimates (and verdicts, where there are any) and returns rows. Errors against a known truth are
:mod:`trace_dag.pipeline.truth`'s.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass

from trace_dag.states.types import Hypothesis, ParticipantState, StateEstimate


@dataclass(frozen=True)
class EstimatorRow:
    """One estimator's estimate of one crash, beside the reference estimator's.

    ``approach_agrees``: both vehicles start on the same road in the same direction as in the reference's best
    hypothesis; ``lane_agrees``: in the same lane too; None without a reference or off the lanes. Distances in metres,
    costs in US dollars.
    """

    key: str
    estimator: str
    hypothesis: str
    hypotheses: int
    ambiguity: float
    checks_failed: int
    approach_agrees: bool | None
    lane_agrees: bool | None
    impact_apart_m: float | None
    attempts: int
    fallback: bool
    prompt_tokens: int
    completion_tokens: int
    cost_usd: float
    latency_s: float
    accepted: bool | None  # by the verdict, None where there is none


@dataclass(frozen=True)
class EstimatorSummary:
    """One estimator over the cohort; shares are of the crashes where the question has an answer, None if of none."""

    estimator: str
    crashes: int
    approach_agreement: float | None
    lane_agreement: float | None
    all_checks_passed: float
    accepted: float | None
    mean_attempts: float
    fallbacks: int
    cost_usd: float


def compare_estimators(
    estimates: Mapping[str, Mapping[str, StateEstimate]],
    *,
    reference: str = "analytic",
    accepted: Mapping[str, Mapping[str, bool]] | None = None,
) -> tuple[EstimatorRow, ...]:
    """Rows by key and estimator, sorted. ``estimates`` and ``accepted``: by estimator, then by key."""
    rows = []
    for estimator, by_key in estimates.items():
        for key, made in by_key.items():
            other = estimates.get(reference, {}).get(key) if estimator != reference else None
            verdict = (accepted or {}).get(estimator, {}).get(key)
            rows.append(_row(estimator, made, other, verdict))
    return tuple(sorted(rows, key=lambda row: (row.key, row.estimator)))


def summarise(rows: tuple[EstimatorRow, ...]) -> tuple[EstimatorSummary, ...]:
    """One line per estimator, sorted by name."""
    by_estimator: dict[str, list[EstimatorRow]] = {}
    for row in rows:
        by_estimator.setdefault(row.estimator, []).append(row)
    return tuple(
        EstimatorSummary(
            estimator=estimator,
            crashes=len(own),
            approach_agreement=_share([row.approach_agrees for row in own]),
            lane_agreement=_share([row.lane_agrees for row in own]),
            all_checks_passed=sum(row.checks_failed == 0 for row in own) / len(own),
            accepted=_share([row.accepted for row in own]),
            mean_attempts=sum(row.attempts for row in own) / len(own),
            fallbacks=sum(row.fallback for row in own),
            cost_usd=round(sum(row.cost_usd for row in own), 8),
        )
        for estimator, own in sorted(by_estimator.items())
    )


def _row(estimator: str, made: StateEstimate, other: StateEstimate | None, accepted: bool | None) -> EstimatorRow:
    best, run = made.best, made.run
    return EstimatorRow(
        key=made.key,
        estimator=estimator,
        hypothesis=best.name,
        hypotheses=len(made.hypotheses),
        ambiguity=made.ambiguity,
        checks_failed=sum(not check.passed for check in best.checks),
        approach_agrees=_agree(best, other.best, _approach) if other else None,
        lane_agrees=_agree(best, other.best, _lane) if other else None,
        impact_apart_m=math.dist(best.impact_point_xy_m, other.best.impact_point_xy_m) if other else None,
        attempts=run.attempts,
        fallback=run.fallback,
        prompt_tokens=run.prompt_tokens,
        completion_tokens=run.completion_tokens,
        cost_usd=run.cost_usd,
        latency_s=run.latency_s,
        accepted=accepted,
    )


def _agree(one: Hypothesis, two: Hypothesis, place: _Place) -> bool | None:
    others = {state.vehicle_number: place(state) for state in two.participants}
    pairs = [(place(state), others.get(state.vehicle_number)) for state in one.participants]
    if any(mine is None or theirs is None for mine, theirs in pairs):
        return None
    return all(mine == theirs for mine, theirs in pairs)


class _Place:
    """Where a vehicle starts, at some fineness; None off the lanes."""

    def __init__(self, *, lane: bool) -> None:
        self._lane = lane

    def __call__(self, state: ParticipantState) -> tuple[str, int] | None:
        if state.initial_lane is None:
            return None
        ref = state.initial_lane.lane
        return ref.road_id, ref.lane_id if self._lane else (1 if ref.lane_id > 0 else -1)


_approach, _lane = _Place(lane=False), _Place(lane=True)


def _share(values: list[bool | None]) -> float | None:
    known = [value for value in values if value is not None]
    return sum(known) / len(known) if known else None
