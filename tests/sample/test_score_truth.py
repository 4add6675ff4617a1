"""Scoring against the truth: an estimate made of the truth scores zeros, and each mistake shows as what it is."""

from __future__ import annotations

import math
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from lab.truth.vehicles import SampleTruth, TrueCrash, load_truth, score_truth
from trace_dag.common.errors import UserError
from trace_dag.common.geometry import Pose
from trace_dag.crash.record import VehicleClass
from trace_dag.simulation.states import (
    EstimatorRun,
    Hypothesis,
    Manoeuvre,
    ParticipantState,
    SpeedSource,
    StateEstimate,
    Trajectory,
)

STRAIGHT, BACKING, UNREPORTED = "2023-319022", "2023-319046", "2023-319029"


def _perfect(crash: TrueCrash) -> StateEstimate:
    """An estimate that says exactly what the truth says."""
    assert crash.impact_point is not None
    participants = []
    for vehicle in crash.vehicles:
        start, end = vehicle.initial_pose, vehicle.impact_pose
        times = np.array([0.0, 5.0])
        participants.append(
            ParticipantState(
                vehicle_number=vehicle.vehicle_number,
                vehicle_class=VehicleClass.CAR,
                length_m=4.8,
                width_m=1.8,
                height_m=1.5,
                mass_kg=1500.0,
                manoeuvre=Manoeuvre(vehicle.manoeuvre),
                initial_pose=Pose(start.x_m, start.y_m, start.heading_rad),
                initial_speed_mps=vehicle.initial_speed_mps,
                impact_pose=Pose(end.x_m, end.y_m, end.heading_rad),
                impact_speed_mps=vehicle.impact_speed_mps,
                speed_source=SpeedSource.REPORTED,
                trajectory=Trajectory(times, times, times, times, times, times),
            )
        )
    point = (crash.impact_point.x_m, crash.impact_point.y_m)
    best = Hypothesis("as it was", 0.0, {}, tuple(participants), 5.0, point)
    return StateEstimate(crash.key, (best,), EstimatorRun("truth", "1"))


def _moved(estimate: StateEstimate, number: int, *, ahead_m: float = 0.0, left_m: float = 0.0, turn_rad: float = 0.0):
    """The estimate with one vehicle's initial pose moved in its own axes and turned."""

    def changed(state: ParticipantState) -> ParticipantState:
        if state.vehicle_number != number:
            return state
        x_m, y_m = state.initial_pose.to_world(np.array([ahead_m, left_m]))
        heading_rad = state.initial_pose.heading_rad + turn_rad
        return replace(state, initial_pose=Pose(float(x_m), float(y_m), heading_rad))

    best = replace(estimate.best, participants=tuple(map(changed, estimate.best.participants)))
    return replace(estimate, hypotheses=(best,))


@pytest.fixture
def perfect(truth: SampleTruth) -> dict[str, StateEstimate]:
    return {crash.key: _perfect(crash) for crash in truth.crashes if crash.vehicles}


def test_the_truth_itself_has_no_error(truth: SampleTruth, perfect: dict[str, StateEstimate]) -> None:
    score = score_truth(truth, perfect)
    assert len(score.rows) == 2 * score.summary.crashes == 2 * len(perfect)
    for row in score.rows:
        assert row.impact_point_error_m == 0.0
        assert row.heading_error_deg == 0.0
        assert row.initial_position_error_m == 0.0
        assert row.initial_speed_error_mps == row.impact_speed_error_mps == 0.0
        assert row.approach_correct, row
        assert row.lane_correct, row
    assert score.summary.approach_correct_share == score.summary.lane_correct_share == 1.0
    assert score.summary.outcomes is None


def test_a_lane_beside_is_the_right_road_and_the_wrong_lane(
    truth: SampleTruth, perfect: dict[str, StateEstimate]
) -> None:
    # Vehicle 1 of this crash drives on the right half of a two-lane highway of 3.6 m lanes.
    wrong = _moved(perfect[STRAIGHT], 1, left_m=3.6)
    row = score_truth(truth, perfect | {STRAIGHT: wrong}).rows[_index(truth, STRAIGHT)]
    assert (row.approach_correct, row.lane_correct) == (True, False)
    assert row.initial_position_error_m == pytest.approx(3.6, abs=1e-6)
    assert row.impact_point_error_m == 0.0


def test_the_other_direction_and_another_road_are_wrong_approaches(
    truth: SampleTruth, perfect: dict[str, StateEstimate]
) -> None:
    for wrong in (
        _moved(perfect[STRAIGHT], 1, turn_rad=math.pi),
        _moved(perfect[STRAIGHT], 1, left_m=-30.0),
        _moved(perfect[STRAIGHT], 1, turn_rad=math.pi / 2),
    ):
        row = score_truth(truth, perfect | {STRAIGHT: wrong}).rows[_index(truth, STRAIGHT)]
        assert (row.approach_correct, row.lane_correct) == (False, False)


def test_further_back_in_the_lane_is_still_the_lane(truth: SampleTruth, perfect: dict[str, StateEstimate]) -> None:
    guessed = _moved(perfect[UNREPORTED], 2, ahead_m=-25.0)
    score = score_truth(truth, {UNREPORTED: guessed})
    row = score.rows[_index(truth, UNREPORTED) + 1]
    assert not row.speed_reported
    assert (row.approach_correct, row.lane_correct) == (True, True)
    assert row.initial_position_error_m == pytest.approx(25.0, abs=1e-6)
    assert score.summary.estimated == 1
    assert score.summary.median_initial_position_error_m is None
    assert score.summary.median_initial_position_error_unreported_m == pytest.approx(12.5, abs=1e-6)


def test_a_backing_vehicle_points_against_its_path(truth: SampleTruth, perfect: dict[str, StateEstimate]) -> None:
    assert score_truth(truth, perfect).rows[_index(truth, BACKING)].approach_correct
    driving_forward = _moved(perfect[BACKING], 1, turn_rad=math.pi)
    assert not score_truth(truth, {BACKING: driving_forward}).rows[_index(truth, BACKING)].approach_correct


def test_crashes_without_estimate_stay_in_the_table_and_out_of_the_medians(truth: SampleTruth) -> None:
    score = score_truth(truth, {})
    assert all(row.approach_correct is None and row.impact_point_error_m is None for row in score.rows)
    assert score.summary.estimated == 0
    assert score.summary.median_impact_point_error_m is None


def test_the_hypothesis_the_verdict_chose_is_the_one_measured(
    truth: SampleTruth, perfect: dict[str, StateEstimate]
) -> None:
    good = perfect[STRAIGHT]
    wrong = replace(good.best, impact_point_xy_m=(100.0, 0.0))
    both = replace(good, hypotheses=(wrong, good.best))
    index = _index(truth, STRAIGHT)
    first = score_truth(truth, {STRAIGHT: both}).rows[index].impact_point_error_m
    second = score_truth(truth, {STRAIGHT: both}, hypothesis={STRAIGHT: 1}).rows[index].impact_point_error_m
    assert first is not None
    assert first > 90
    assert second == 0.0


def test_outcomes_are_set_beside_the_expected_ones(truth: SampleTruth) -> None:
    outcomes = {crash.key: (crash.expected.final_state, crash.expected.reason) for crash in truth.crashes}
    score = score_truth(truth, {}, outcomes=outcomes)
    assert score.summary.outcomes_as_expected == score.summary.outcomes == len(truth.crashes)
    outcomes[STRAIGHT] = ("rejected", "no_collision")
    del outcomes[BACKING]
    changed = score_truth(truth, {}, outcomes=outcomes)
    assert changed.summary.outcomes_as_expected == len(truth.crashes) - 2
    assert {row.key for row in changed.outcomes if not row.as_expected} == {STRAIGHT, BACKING}


def test_a_file_without_truth_is_reported_in_one_line(tmp_path: Path) -> None:
    with pytest.raises(UserError, match=r"truth\.json: cannot be read"):
        load_truth(tmp_path / "truth.json")
    (tmp_path / "truth.json").write_text('{"crashes": [{"key": "2023-319001"}]}')
    with pytest.raises(UserError, match=r"not a truth file: crashes\.0\.title"):
        load_truth(tmp_path / "truth.json")


def _index(truth: SampleTruth, key: str) -> int:
    """Where the rows of a crash begin."""
    return 2 * [crash.key for crash in truth.crashes if crash.vehicles].index(key)
