"""Verdicts of simulated crashes whose truth is known by construction, and the negative controls."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from tests.simulation.motions import CAR, driven, straight
from tests.verdict.crashes import (
    CROSSROADS,
    STREET,
    acceptance_rate,
    area,
    estimate,
    moved,
    record,
    row_of_change,
    simulated,
    vehicle,
)
from trace_dag.common.errors import Failure, Reason
from trace_dag.common.geometry import LocalFrame, Pose, contact_clock_h
from trace_dag.common.settings import VerdictSettings
from trace_dag.common.units import clock_difference_h
from trace_dag.crash.record import ImpactArea, PreCrashMovement
from trace_dag.roads.map.network import RoadNetwork
from trace_dag.roads.report import CrashPlacement, MapReport
from trace_dag.verdict.changed_plans import late_vehicle
from trace_dag.verdict.controls import JudgedCrash, changed_reports, true_pairing
from trace_dag.verdict.judge import judge, judge_hypothesis
from trace_dag.verdict.metrics import clock_error_positions
from trace_dag.verdict.types import Verdict, verdict_from_json, verdict_to_json

REPORT = MapReport("by hand", CrashPlacement(0.0, 0.0, 0.0, "1", 0.0, "by hand"), ())
HALF = CAR.length_m / 2

# Vehicle 1 eastbound at 20 m/s, vehicle 2 westbound at 15 m/s over the centre line: both over the origin after 3 s.
HEAD_ON = (
    straight(-HALF - 60.0, -1.75, 0.0, 20.0, until_s=8.0),
    straight(HALF + 45.0, -1.5, math.pi, 15.0, until_s=8.0),
)
# Vehicle 1 northbound struck on its left side by vehicle 2, eastbound.
ANGLE = (
    straight(1.75, -45.0 - 1.75, math.pi / 2, 15.0, until_s=8.0),
    straight(-HALF - 36.0 + 0.8, -1.75, 0.0, 12.0, until_s=8.0),
)
HEAD_ON_RECORD = record(vehicle(1, 12, 50), vehicle(2, 12, 51))
ANGLE_RECORD = record(vehicle(1, 9, 89), vehicle(2, 12, 88), key="2023-2")


def verdict_of(trajectories: tuple, reported, network: RoadNetwork = STREET) -> Verdict:
    hypothesis, log = simulated(*trajectories)
    return judge_hypothesis(reported, network, hypothesis, log, VerdictSettings())


def test_a_head_on_crash_as_reported_is_accepted() -> None:
    verdict = verdict_of(HEAD_ON, HEAD_ON_RECORD)
    assert verdict.accepted, verdict.detail
    assert verdict.criterion("contact_distance").value < 2.0
    assert verdict.criterion("approach_angle").value == pytest.approx(180.0, abs=1.0)
    assert verdict.criterion("closing_speed").value == pytest.approx(35.0, rel=0.01)
    for number in (1, 2):
        assert verdict.criterion("clock_error", number).value < 0.6
        assert min(verdict.criterion("pdof", number).value, 360 - verdict.criterion("pdof", number).value) < 30.0
    assert 35.0 / 2 <= verdict.criterion("delta_v", 1).value < 35.0 * 1.1 / 2  # little comes back at 35 m/s


@pytest.mark.parametrize(("known_to_m", "accepted"), [(None, False), (4.0, False), (15.0, True)])
def test_a_contact_may_be_as_far_off_as_the_register_knows_the_point(known_to_m: float | None, accepted: bool) -> None:
    far = tuple(moved(trajectory, 6.0, 0.0) for trajectory in HEAD_ON)  # 5 m are allowed, or what is known
    verdict = verdict_of(far, replace(HEAD_ON_RECORD, position_accuracy_m=known_to_m))
    assert verdict.accepted is accepted, verdict.detail
    assert verdict.reason is (None if accepted else Reason.WRONG_LOCATION)


@pytest.mark.parametrize(
    ("contact_m", "placed_m", "accepted"),
    [
        (6.0, 0.0, False),
        (6.0, 5.5, True),  # as far from the point as its road is
        (9.0, 9.0, True),  # 4 m from where a point moved by 5 m would be
        (11.0, 11.0, False),  # the program may not move a crash as it likes
    ],
)
def test_a_contact_is_measured_from_where_the_point_was_placed_on_its_road(contact_m, placed_m, accepted) -> None:
    hypothesis, log = simulated(*(moved(trajectory, contact_m, 0.0) for trajectory in HEAD_ON))
    report = MapReport("by hand", CrashPlacement(placed_m, 0.0, placed_m, "1", 0.0, "by hand"), ())
    verdict = judge(HEAD_ON_RECORD, STREET, report, estimate(hypothesis), [log], VerdictSettings())
    assert verdict.accepted is accepted, verdict.detail


def test_a_side_impact_as_reported_is_accepted() -> None:
    verdict = verdict_of(ANGLE, ANGLE_RECORD, CROSSROADS)
    assert verdict.accepted, verdict.detail
    assert clock_difference_h(verdict.criterion("clock", 1).value, 9.0) < 1.0
    assert clock_difference_h(verdict.criterion("clock", 2).value, 12.0) < 1.5
    assert verdict.criterion("pdof", 1).value == pytest.approx(270.0, abs=45.0)
    assert verdict.criterion("approach_angle").value == pytest.approx(90.0, abs=2.0)


@pytest.mark.parametrize(
    ("trajectories", "network", "reported", "reason"),
    [
        (tuple(moved(t, 6.0, 0.0) for t in HEAD_ON), STREET, HEAD_ON_RECORD, Reason.WRONG_LOCATION),
        (HEAD_ON, STREET, record(vehicle(1, 12, 50), vehicle(2, 6, 51)), Reason.WRONG_IMPACT),
        (ANGLE, CROSSROADS, record(vehicle(1, 3, 89), vehicle(2, 12, 88)), Reason.WRONG_IMPACT),
        (HEAD_ON, STREET, record(vehicle(1, 12, 86), vehicle(2, 12, 87)), Reason.WRONG_DIRECTION),
        (HEAD_ON, STREET, record(vehicle(1, 12, 24), vehicle(2, 12, 25)), Reason.WRONG_DIRECTION),
        (
            HEAD_ON,
            STREET,
            record(vehicle(1, 12, None, PreCrashMovement.TURNING_LEFT), vehicle(2, 12)),
            Reason.WRONG_DIRECTION,
        ),
    ],
)
def test_a_difference_from_the_report_is_rejected_with_its_reason(trajectories, network, reported, reason) -> None:
    assert verdict_of(trajectories, reported, network).reason is reason


TURN_R = 10.0


def left_turn(late_s: float = 0.0) -> tuple:
    """Vehicle 1 eastbound turns left across the path of vehicle 2, westbound."""
    start = 20.0
    turner = driven(
        -start - 8.0,
        -1.75,
        0.0,
        lambda _: 7.0,
        lambda s: 1 / TURN_R if start < s < start + TURN_R * math.pi / 2 else 0.0,
        until_s=9.0,
    )
    return turner, straight(3.0 + 15.0 * (4.3 + late_s), 1.75, math.pi, 15.0, until_s=9.0)


def test_a_vehicle_hit_in_the_middle_of_its_turn_was_turning() -> None:
    turning = record(vehicle(1, 2, 68, PreCrashMovement.TURNING_LEFT), vehicle(2, 12, 69))
    verdict = verdict_of(left_turn(), turning, CROSSROADS)
    assert verdict.criterion("turn", 1).value == pytest.approx(90.0, abs=15.0)
    assert verdict.criterion("turn", 2).value == pytest.approx(0.0, abs=3.0)
    assert verdict.criterion("relation_error").value == pytest.approx(0.0, abs=5.0)
    wrong = record(vehicle(1, 2, 68, PreCrashMovement.TURNING_RIGHT), vehicle(2, 12, 69))
    both = verdict_of(left_turn(), wrong, CROSSROADS).criterion("direction_error", 1)
    assert both.value < 45.0  # ACC_TYPE says left, P_CRASH1 right: a report that contradicts itself allows both
    only_right = record(vehicle(1, 2, None, PreCrashMovement.TURNING_RIGHT), vehicle(2, 12))
    assert verdict_of(left_turn(), only_right, CROSSROADS).criterion("direction_error", 1).value > 135.0


def test_the_first_accepted_hypothesis_wins_and_the_first_stands_for_none() -> None:
    good, bad = simulated(*HEAD_ON), simulated(*(moved(t, 9.0, 0.0) for t in HEAD_ON))
    worse = simulated(*(moved(t, 30.0, 0.0) for t in HEAD_ON))
    verdict = judge(HEAD_ON_RECORD, STREET, REPORT, estimate(bad[0], good[0]), (bad[1], good[1]), VerdictSettings())
    assert (verdict.accepted, verdict.hypothesis, verdict.hypotheses_judged) == (True, 1, 2)
    verdict = judge(HEAD_ON_RECORD, STREET, REPORT, estimate(bad[0], worse[0]), (bad[1], worse[1]), VerdictSettings())
    assert (verdict.accepted, verdict.hypothesis, verdict.reason) == (False, 0, Reason.WRONG_LOCATION)
    assert verdict.criterion("placed_distance").value == pytest.approx(verdict.criterion("contact_distance").value)


def test_logs_of_another_estimate_are_a_failure() -> None:
    hypothesis, log = simulated(*HEAD_ON)
    with pytest.raises(Failure, match="2 simulation logs for 1 hypothesis;"):
        judge(HEAD_ON_RECORD, STREET, REPORT, estimate(hypothesis), (log, log), VerdictSettings())


def test_verdicts_survive_their_file() -> None:
    verdict = verdict_of(ANGLE, ANGLE_RECORD, CROSSROADS)
    assert verdict_from_json(verdict_to_json(verdict)) == verdict
    with pytest.raises(Failure, match="judge again"):
        verdict_from_json(b"{}")


# --- clock positions ---------------------------------------------------------------------------------------------
@given(st.floats(-math.pi, math.pi), st.floats(2.0, 20.0), st.floats(0.8, 3.0), st.floats(0, 12, exclude_min=True))
def test_a_clock_position_does_not_depend_on_where_the_body_is(
    heading: float, length: float, width: float, clock: float
) -> None:
    angle = -clock * math.pi / 6
    scale = 1 / max(abs(math.cos(angle)), abs(math.sin(angle)))
    on_body = np.array([math.cos(angle) * scale * length / 2, math.sin(angle) * scale * width / 2])
    pose = Pose(3.0, -8.0, heading)
    assert clock_difference_h(contact_clock_h(pose, length, width, pose.to_world(on_body)), clock) < 1e-6


def test_faces_of_long_bodies_have_their_share_of_the_clock() -> None:
    trailer = Pose(0.0, 0.0, 0.0)
    assert contact_clock_h(trailer, 20.0, 2.6, np.array([0.0, 1.3])) == pytest.approx(9.0)
    assert contact_clock_h(trailer, 20.0, 2.6, np.array([5.0, 1.3])) == pytest.approx(9.886, abs=0.01)
    assert contact_clock_h(trailer, 20.0, 2.6, np.array([10.0, 1.3])) == pytest.approx(10.5)


def test_errors_are_counted_from_the_middle_of_the_reported_area() -> None:
    left_side = ImpactArea(61, 9.0, math.pi / 2, math.radians(45))
    assert clock_error_positions(9.9, left_side) == pytest.approx(0.9)
    assert clock_error_positions(12.0, left_side) == clock_error_positions(12.0, area(9)) == pytest.approx(3.0)
    assert clock_error_positions(12.0, None) is None


def test_two_clock_positions_either_way_let_four_of_twelve_pass() -> None:
    passing = [error <= 2.0 for error in (clock_error_positions(12 * k / 1200, area(3)) for k in range(1, 1201))]
    assert sum(passing) / len(passing) == pytest.approx(4 / 12, abs=0.002)


# --- negative controls -------------------------------------------------------------------------------------------
def cohort() -> list[JudgedCrash]:
    return [
        JudgedCrash(HEAD_ON_RECORD, STREET, *simulated(*HEAD_ON)),
        JudgedCrash(ANGLE_RECORD, CROSSROADS, *simulated(*ANGLE)),
    ]


def test_true_pairings_pass_and_other_reports_do_not() -> None:
    crashes = cohort()
    settings = VerdictSettings()
    assert acceptance_rate([true_pairing(crash, settings) for crash in crashes]) == 1.0
    rows = [row for crash in crashes for row in changed_reports(crash, crashes, settings)]
    assert {(row.key, row.other_key) for row in rows} == {("2023-1", "2023-2"), ("2023-2", "2023-1")}
    assert acceptance_rate(rows) == 0.0
    assert all(row.reports_differ for row in rows)
    assert all(row.clock_error_max_positions is not None and row.clock_error_max_positions > 2.0 for row in rows)


def test_a_vehicle_that_comes_late_misses_or_meets_elsewhere() -> None:
    for crash in cohort():
        row = row_of_change(crash, "shifted", late_vehicle(crash))
        assert row.verified is False
        assert row.shift_s >= 2.0
        assert row.reason in (Reason.NO_COLLISION, Reason.WRONG_LOCATION)


def test_a_standing_vehicle_cannot_be_missed_by_coming_late() -> None:
    standing = straight(HALF, -1.75, math.pi, 0.0)
    crash = JudgedCrash(HEAD_ON_RECORD, STREET, *simulated(HEAD_ON[0], standing))
    assert late_vehicle(crash) is None
    row = row_of_change(crash, "shifted", None)
    assert row.verified is None
    assert acceptance_rate([row]) is None


def test_the_frame_of_a_record_is_the_networks() -> None:
    assert STREET.frame == LocalFrame(HEAD_ON_RECORD.latitude_deg, HEAD_ON_RECORD.longitude_deg)
