"""The sample's crashes of several contacts: estimates and verdicts against the truth they were made of."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from pathlib import Path

import pytest
from cases import SETTINGS, Case, cases

from lab.truth.contacts import contacts_by_kind
from lab.truth.vehicles import SampleTruth, load_truth, score_truth
from trace_dag.common.errors import Reason
from trace_dag.crash.event_sequence import sequence_of
from trace_dag.reconstruction.estimate import estimate
from trace_dag.simulation.embedded import EmbeddedBackend
from trace_dag.simulation.run import simulate
from trace_dag.simulation.states import StateEstimate
from trace_dag.verdict.controls import JudgedCrash, changed_reports
from trace_dag.verdict.judge import judge


@pytest.fixture(scope="module")
def truth(sample: Path) -> SampleTruth:
    return load_truth(sample / "chains" / "truth.json")


STRUCK_ELSEWHERE = "2023-319104"
"""Its third contact is estimated a little more than two clock positions from the reported area."""


@pytest.fixture(scope="module")
def found(sample: Path) -> dict[str, Case]:
    reports = {path.name: path.read_bytes() for path in (sample / "chains" / "reports").glob("*.xml")}
    return {case.key: case for case in cases(reports, sample / "osm")}


@pytest.fixture(scope="module")
def estimates(found: dict[str, Case]) -> dict[str, StateEstimate]:
    return {key: estimate(case.record, case.network, case.report, SETTINGS.states) for key, case in found.items()}


def test_every_crash_is_verified_and_its_controls_are_refused(
    truth: SampleTruth, found: dict[str, Case], estimates: dict[str, StateEstimate]
) -> None:
    expected = {crash.key for crash in truth.crashes if crash.expected.final_state in ("verified", "first_event_only")}
    assert set(found) == expected
    for key, case in found.items():
        made = estimates[key]
        logs = simulate(EmbeddedBackend(SETTINGS.sim), case.network, case.xodr, made, SETTINGS.sim, record=case.record)
        verdict = judge(case.record, case.network, case.report, made, logs, SETTINGS.verdict)
        if key == STRUCK_ELSEWHERE:
            assert verdict.reason in (None, Reason.WRONG_IMPACT), verdict.detail
            continue
        assert verdict.accepted, f"{key}: {verdict.detail}"
        chosen = verdict.hypothesis
        crash = JudgedCrash(case.record, case.network, made.hypotheses[chosen], logs[chosen])
        controls = list(changed_reports(crash, [], SETTINGS.verdict))
        assert len(controls) == (2 * len(crash.sequence.contacts) - 1 if len(made.best.planned) > 1 else 0)
        assert not any(row.verified for row in controls), key


def test_everybody_is_estimated_in_the_lane_where_it_was(
    truth: SampleTruth, estimates: dict[str, StateEstimate]
) -> None:
    score = score_truth(truth, estimates)
    by_kind = {line.kind: line for line in contacts_by_kind(truth, score.rows)}
    assert set(by_kind) == {"multi_vehicle", "parked"}
    assert by_kind["multi_vehicle"].estimated == by_kind["multi_vehicle"].vehicles == 3 + 5 + 3 + 3
    assert by_kind["parked"].estimated == by_kind["parked"].vehicles == 2 + 2 + 3
    beside_the_road = {("2023-319105", 2), ("2023-319108", 2), ("2023-319108", 3)}  # where there is no lane
    assert all(row.lane_correct for row in score.rows if (row.key, row.vehicle_number) not in beside_the_road)
    for row in score.rows:
        assert row.impact_point_error_m is not None
        assert row.impact_point_error_m <= 0.5
        if row.manoeuvre == "stopped":
            assert row.initial_position_error_m is not None
            assert row.initial_position_error_m <= 2.5  # gaps in a queue are not told


def test_planned_events_are_the_reported_contacts(found: dict[str, Case], estimates: dict[str, StateEstimate]) -> None:
    for key, case in found.items():
        contacts = sequence_of(case.record).contacts
        for hypothesis in estimates[key].hypotheses:
            planned = [(event.event_number, event.party_1, event.party_2) for event in hypothesis.planned]
            assert planned == [(each.number, each.vehicle.number, each.party) for each in contacts]
        times = [event.time_s for event in estimates[key].best.planned]
        assert times == sorted(times)
        assert len(estimates[key].best.participants) == len(case.record.vehicles)


def test_a_report_that_states_too_little_is_refused(
    truth: SampleTruth, refused: Callable[[str, Mapping[str, str]], dict[str, str]]
) -> None:
    kinds = {crash.key: crash.kind for crash in truth.crashes}
    assert refused("chains", kinds) == {"2023-319107": "incomplete_sequence"}
