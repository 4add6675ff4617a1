"""The sample's crashes of one vehicle that leaves the road: estimates and verdicts against their truth."""

from __future__ import annotations

import math
from pathlib import Path

import pytest
from cases import SETTINGS, Case, cases

from lab.truth.contacts import contacts_by_kind
from lab.truth.vehicles import SampleTruth, load_truth, score_truth
from tests.verdict.crashes import row_of_change
from trace_dag.common.errors import Reason, Rejection
from trace_dag.crash.completeness import check
from trace_dag.crash.event_sequence import sequence_of
from trace_dag.crash.parse import read_report
from trace_dag.crash.road_departure import departure_of
from trace_dag.reconstruction.estimate import estimate
from trace_dag.simulation.embedded import EmbeddedBackend
from trace_dag.simulation.run import simulate
from trace_dag.simulation.types import overturned_at
from trace_dag.verdict.changed_plans import make_changed_plans
from trace_dag.verdict.controls import JudgedCrash
from trace_dag.verdict.judge import judge
from trace_dag.verdict.types import Verdict

UNTOLD, TOO_SLOW = "2023-319119", "2023-319120"
ON_ROADWAY = "2023-319118"


@pytest.fixture(scope="module")
def truth(sample: Path) -> SampleTruth:
    return load_truth(sample / "roadside" / "truth.json")


@pytest.fixture(scope="module")
def found(sample: Path) -> dict[str, Case]:
    reports = {path.name: path.read_bytes() for path in (sample / "roadside" / "reports").glob("*.xml")}
    return {case.key: case for case in cases(reports, sample / "osm")}


@pytest.fixture(scope="module")
def judged(found: dict[str, Case]) -> dict[str, tuple[JudgedCrash, Verdict]]:
    out = {}
    for key, case in found.items():
        made = estimate(case.record, case.network, case.report, SETTINGS.states)
        logs = simulate(EmbeddedBackend(SETTINGS.sim), case.network, case.xodr, made, SETTINGS.sim, record=case.record)
        verdict = judge(case.record, case.network, case.report, made, logs, SETTINGS.verdict)
        chosen = verdict.hypothesis
        crash = JudgedCrash(case.record, case.network, made.hypotheses[chosen], logs[chosen])
        out[key] = crash, verdict
    return out


def test_every_crash_ends_as_it_must(truth: SampleTruth, judged: dict[str, tuple[JudgedCrash, Verdict]]) -> None:
    for key, (crash, verdict) in judged.items():
        expected = truth.by_key[key].expected
        assert verdict.accepted == (expected.final_state != "rejected"), f"{key}: {verdict.detail}"
        assert (verdict.reason.value if verdict.reason else None) == expected.reason
        overturns = any(overturned_at(vehicle) is not None for vehicle in crash.log.vehicles)
        assert overturns or crash.record.kind == "fixed_object" or not verdict.accepted
    assert judged[TOO_SLOW][1].reason is Reason.NO_OVERTURN


def test_the_other_side_and_a_moved_object_are_refused(judged: dict[str, tuple[JudgedCrash, Verdict]]) -> None:
    refused = 0
    for key, (crash, verdict) in judged.items():
        if not verdict.accepted or key == ON_ROADWAY:
            continue
        for name, changed in make_changed_plans(crash, SETTINGS.verdict):
            assert row_of_change(crash, name, changed).verified is False, key
            refused += 1
    assert refused >= 12


def test_vehicles_come_from_their_lane_and_strike_where_they_did(
    truth: SampleTruth, judged: dict[str, tuple[JudgedCrash, Verdict]], found: dict[str, Case]
) -> None:
    estimates = {key: estimate(case.record, case.network, case.report, SETTINGS.states) for key, case in found.items()}
    score = score_truth(truth, estimates, hypothesis={key: verdict.hypothesis for key, (_, verdict) in judged.items()})
    rows = [row for row in score.rows if row.impact_point_error_m is not None]
    assert {line.kind: line.crashes for line in contacts_by_kind(truth, score.rows)} == {
        "fixed_object": 8,
        "overturn": 2,
    }
    # Which lane of the freeway it left for the median is not reported.
    assert [row.key for row in rows if not row.lane_correct] in ([], ["2023-319113"])
    # Across the road the objects stand where such objects usually do: the truth has them elsewhere by up to 1.5 m.
    assert [row for row in rows if (row.impact_point_error_m or math.inf) > 3.0] == []


def test_sides_are_read_from_the_events(truth: SampleTruth, found: dict[str, Case]) -> None:
    sides = {key: departure_of(case.record, sequence_of(case.record)).side for key, case in found.items()}
    read = {key: str(side) for key, side in sides.items() if side}
    assert read == {
        **{f"2023-{number}": "right" for number in (319111, 319114, 319115, 319116, 319117, 319120)},
        **{f"2023-{number}": "left" for number in (319112, 319113)},
        **{f"2023-{number}": "ahead" for number in (319121, 319122)},
    }


def test_a_report_that_gives_no_side_is_refused(sample: Path) -> None:
    path = sample / "roadside" / "reports" / f"crash_{UNTOLD[-6:]}.xml"
    record = read_report(path.read_bytes(), name=path.name, settings=SETTINGS.crash)
    with pytest.raises(Rejection) as caught:
        check(record, SETTINGS.crash)
    assert caught.value.reason is Reason.INCOMPLETE_TRAJECTORY


def test_a_vehicle_leaving_a_dead_end_came_along_it(found: dict[str, Case], truth: SampleTruth) -> None:
    """The road begins where it ends for the other direction: nobody came from there."""
    case = found["2023-319122"]
    (known,) = next(crash for crash in truth.crashes if crash.key == case.key).vehicles
    best = estimate(case.record, case.network, case.report, SETTINGS.states).best
    (state,) = best.participants
    assert state.initial_pose.heading_rad == pytest.approx(known.initial_pose.heading_rad, abs=0.01)
    assert best.evidence.get("a road that begins here") is None
