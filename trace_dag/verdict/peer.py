"""The published benchmark beside ours: its scenarios in our simulator, on its own maps, judged by the same rules."""

from __future__ import annotations

from dataclasses import dataclass

from trace_dag.crash.record import CrashRecord
from trace_dag.errors import Reason
from trace_dag.roads.map.network import RoadNetwork
from trace_dag.settings import VerdictSettings
from trace_dag.sim.types import SimulationLog
from trace_dag.states.types import Hypothesis
from trace_dag.verdict.judge import judge_hypothesis
from trace_dag.verdict.metrics import speed_error_rel


@dataclass(frozen=True)
class ComparisonRow:
    """One crash of one benchmark. ``clocks_ok`` is None where the report has no impact, ``speeds_kept`` unless it has
    both speeds; whether the vehicles meet does not matter to it."""

    key: str
    benchmark: str
    contact: bool
    contact_distance_m: float | None
    within_distance: bool
    clock_error_max_positions: float | None
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
    settings allow.

    >>> row = compare("ours", record, network, hypothesis, log, VerdictSettings())
    >>> row.contact, row.clocks_ok, row.speeds_kept, row.accepted
    (True, True, True, True)
    """
    verdict = judge_hypothesis(record, network, hypothesis, log, settings)
    reported = {vehicle.number: vehicle for vehicle in record.vehicles}
    errors = [speed_error_rel(float(driven.speed_mps[0]), reported.get(driven.number)) for driven in log.vehicles]
    speed_errors = [abs(error) for error in errors if error is not None]
    distance = verdict.criterion("contact_distance")
    return ComparisonRow(
        key=record.key,
        benchmark=benchmark,
        contact=log.first_contact is not None,
        contact_distance_m=distance.value if distance else None,
        within_distance=bool(distance and distance.passed),
        clock_error_max_positions=verdict.worst("clock_error"),
        clocks_ok=verdict.all_hold("clock_error"),
        direction_error_max_deg=verdict.worst("direction_error", "relation_error"),
        initial_speed_error_max_rel=max(speed_errors, default=None),
        speeds_kept=max(speed_errors) <= settings.max_speed_error_rel if len(speed_errors) == 2 else None,
        accepted=verdict.accepted,
        reason=verdict.reason,
    )
