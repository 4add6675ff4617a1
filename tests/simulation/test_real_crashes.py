"""Simulation and verdict over real crashes, from report and map to judgement; skipped where the data are absent."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

import numpy as np
import pytest
from cases import SETTINGS, cases
from motion_judge import judge_geometry

from tests.verdict.crashes import acceptance_rate, row_of_change
from trace_dag.reconstruction.estimate import estimate
from trace_dag.simulation.embedded import EmbeddedBackend
from trace_dag.simulation.plan import tracking_errors
from trace_dag.simulation.run import simulate
from trace_dag.simulation.states import StateEstimate
from trace_dag.simulation.types import SimulationLog, Termination
from trace_dag.verdict.changed_plans import make_changed_plans
from trace_dag.verdict.controls import JudgedCrash, changed_reports, true_pairing
from trace_dag.verdict.judge import judge
from trace_dag.verdict.types import Verdict

PEER_SIM = SETTINGS.sim.model_copy(update={"time_limit_s": 45.0})  # its slowest vehicle takes half a minute


@dataclass(frozen=True, eq=False)
class Ours:
    estimate: StateEstimate
    logs: tuple[SimulationLog, ...]
    verdict: Verdict
    judged: JudgedCrash


@pytest.fixture(scope="module")
def cohort(shared_data: Path) -> list[Ours]:
    """Every mapped crash of the Virginian cohort, simulated and judged."""
    data = shared_data / "va-2023"
    backend = EmbeddedBackend(SETTINGS.sim)
    crashes = []
    reports = {path.name: path.read_bytes() for path in (data / "reports").glob("*.xml")}
    for case in cases(reports, data / "osm"):
        states = estimate(case.record, case.network, case.report, SETTINGS.states)
        logs = simulate(backend, case.network, case.xodr, states, SETTINGS.sim, record=case.record)
        verdict = judge(case.record, case.network, case.report, states, logs, SETTINGS.verdict)
        chosen = verdict.hypothesis
        judged = JudgedCrash(case.record, case.network, states.hypotheses[chosen], logs[chosen])
        crashes.append(Ours(states, logs, verdict, judged))
    return crashes


def of_two_vehicles(cohort: list[Ours]) -> list[Ours]:
    """Those whose vehicles met each other."""
    return [crash for crash in cohort if crash.judged.record.colliding_vehicles is not None]


def test_nearly_every_crash_is_verified(cohort: list[Ours]) -> None:
    assert len(cohort) >= 29  # of the 35 with a map, five are of vehicles that never touched
    assert sum(crash.verdict.accepted for crash in cohort) >= 0.9 * len(cohort)


def test_estimates_of_two_vehicles_pass_every_check_and_are_accepted(cohort: list[Ours]) -> None:
    crashes = of_two_vehicles(cohort)
    assert len(crashes) >= 30
    for crash in crashes:
        judge_geometry(crash.estimate.best)
        failed = [f"{check.name}: {check.detail}" for check in crash.estimate.best.checks if not check.passed]
        assert not failed, crash.estimate.key
    assert sum(crash.verdict.accepted for crash in crashes) >= 0.95 * len(crashes)


def test_every_run_ends_for_a_reason_and_nothing_diverges(cohort: list[Ours]) -> None:
    for crash in cohort:
        for log in crash.logs:
            assert log.termination in (Termination.AT_REST, Termination.TIME_LIMIT, Termination.NO_CONTACT)
            assert log.reason
            for vehicle in log.vehicles:
                assert np.isfinite(vehicle.x_m).all()


def test_vehicles_follow_their_plans_up_to_the_impact(cohort: list[Ours]) -> None:
    """Within 0.25 m and 5 % in 99 % of all steps of all vehicles of all hypotheses of all crashes."""
    distances, relative = [], []
    for crash in cohort:
        for hypothesis, log in zip(crash.estimate.hypotheses, crash.logs, strict=True):
            until_s = log.first_contact.time_s if log.first_contact else hypothesis.impact_time_s
            logged = {vehicle.number: vehicle for vehicle in log.vehicles}  # trailers, which follow, among them
            for state in hypothesis.participants:
                vehicle = logged[state.vehicle_number]
                distance, speed_error = tracking_errors(state.trajectory, vehicle, until_s)
                planned = np.interp(
                    vehicle.time_s[: len(speed_error)], state.trajectory.time_s, state.trajectory.speed_mps
                )
                distances.append(distance)
                relative.append(speed_error / np.maximum(np.abs(planned), 1.0))
    assert (np.concatenate(distances) < 0.25).mean() >= 0.99
    assert (np.concatenate(relative) < 0.05).mean() >= 0.99


def test_reported_speeds_are_driven(cohort: list[Ours]) -> None:
    """Within 2 % at the beginning, and within 10 % at the impact by all who are not reported to brake."""
    compared = 0
    for crash in cohort:
        braking = {state.vehicle_number: state.braking for state in crash.judged.hypothesis.participants}
        for criterion in crash.verdict.criteria:
            if criterion.value is None or criterion.vehicle_number is None:
                continue
            if criterion.name == "initial_speed_error":
                assert abs(criterion.value) <= 0.02
                compared += 1
            elif criterion.name == "impact_speed_error" and not braking[criterion.vehicle_number]:
                assert abs(criterion.value) <= 0.1
    assert compared >= 55


def test_negative_controls(cohort: list[Ours]) -> None:
    crashes = [crash.judged for crash in of_two_vehicles(cohort) if crash.verdict.accepted]
    true = [true_pairing(crash, SETTINGS.verdict) for crash in crashes]
    assert (acceptance_rate(true) or 0.0) >= 0.6  # the others are first_event_only
    rows = [row for crash in crashes for row in changed_reports(crash, crashes, SETTINGS.verdict)]
    rows = [row for row in rows if row.kind == "other_report"]
    assert len(rows) == len(crashes) * (len(crashes) - 1)
    differ = [row for row in rows if row.reports_differ]
    assert acceptance_rate(differ) <= 0.06  # two reports that contradict each other are told apart
    assert acceptance_rate(rows) <= 0.4  # a third of the cohort are head-on crashes with the same codes
    changed = [(crash, *each) for crash in crashes for each in make_changed_plans(crash, SETTINGS.verdict)]
    shifted = [row_of_change(*each) for each in changed]
    assert acceptance_rate(shifted) <= 0.02
    assert sum(row.verified is not None for row in shifted) >= 28
