"""The published benchmark beside ours: its scenarios in our simulator, on its own maps, judged by the same rules."""

from __future__ import annotations

from dataclasses import dataclass

from trace_dag.crash.record import CrashRecord
from trace_dag.errors import Reason
from trace_dag.roads.network import RoadNetwork
from trace_dag.settings import VerdictSettings
from trace_dag.sim.types import SimulationLog
from trace_dag.states.types import Hypothesis
from trace_dag.verdict.judge import judge_hypothesis
from trace_dag.verdict.types import Verdict


@dataclass(frozen=True)
class ComparisonRow:
    """One crash of one benchmark. ``clocks_ok`` is None where the report has no impact, ``speeds_kept`` unless it has
    both speeds."""

    key: str
    benchmark: str
    contact: bool
    contact_distance_m: float | None
    within_distance: bool
    clock_error_max_h: float | None
    clocks_ok: bool | None
    direction_error_max_deg: float | None
    initial_speed_error_max_rel: float | None
    speeds_kept: bool | None
    accepted: bool
    reason: Reason | None


def compare(
    benchmark: str,
    record: CrashRecord,
    network: RoadNetwork,
    hypothesis: Hypothesis,
    log: SimulationLog,
    settings: VerdictSettings,
) -> ComparisonRow:
    """Judge one simulation of a benchmark; a speed is kept if initial and reported one differ by no more than the
    settings allow."""
    verdict = judge_hypothesis(record, network, hypothesis, log, settings)
    distance = verdict.criterion("contact_distance")
    return ComparisonRow(
        key=record.key,
        benchmark=benchmark,
        contact=log.first_contact is not None,
        contact_distance_m=distance.value if distance else None,
        within_distance=bool(distance and distance.passed),
        clock_error_max_h=_worst(verdict, "clock_error"),
        clocks_ok=_all(verdict, "clock_error"),
        direction_error_max_deg=_worst(verdict, "direction_error", "relation_error"),
        initial_speed_error_max_rel=_worst(verdict, "initial_speed_error"),
        speeds_kept=_all(verdict, "initial_speed_error", at_least=2),
        accepted=verdict.accepted,
        reason=verdict.reason,
    )


def _worst(verdict: Verdict, *names: str) -> float | None:
    values = [abs(c.value) for c in verdict.criteria if c.name in names and c.value is not None]
    return max(values, default=None)


def _all(verdict: Verdict, name: str, *, at_least: int = 1) -> bool | None:
    passed = [criterion.passed for criterion in verdict.criteria if criterion.name == name]
    judged = [each for each in passed if each is not None]
    return all(judged) if len(judged) >= at_least else None
