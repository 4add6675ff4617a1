"""Every pair of crash types as motion: how the two approach each other, and who turns which way."""

from __future__ import annotations

import dataclasses
import math

import numpy as np
import pytest
from cases import SETTINGS, Case, sample_case

from trace_dag.crash.crash_types import CRASH_TYPES, Relation, Turn
from trace_dag.crash.record import PreCrashMovement
from trace_dag.reconstruction.estimate import estimate
from trace_dag.simulation.states import Hypothesis, Manoeuvre, ParticipantState

FOUR_WAY = "2023-319003"
MOVEMENT = {
    None: PreCrashMovement.GOING_STRAIGHT,
    Turn.LEFT: PreCrashMovement.TURNING_LEFT,
    Turn.RIGHT: PreCrashMovement.TURNING_RIGHT,
    Turn.U_TURN: PreCrashMovement.U_TURN,
}
PAIRS = [
    *((20, 21), (24, 25), (28, 29), (34, 35), (38, 39), (44, 45), (46, 47)),
    *((50, 51), (54, 55), (60, 61), (64, 65)),
    *((68, 69), (70, 71), (72, 73), (76, 77), (78, 79), (80, 81), (82, 83)),
    *((86, 87), (88, 89)),
]
# Angle between the directions in which the two approach, degrees; a turn at a skewed crossing still counts.
APPROACH_DEG = {
    Relation.SAME_LANE: (0, 30),
    Relation.SAME_DIRECTION: (0, 30),
    Relation.OPPOSITE_DIRECTION: (150, 180),
    Relation.CROSSING: (30, 150),
}


@pytest.fixture(scope="module")
def case() -> Case:
    return sample_case(FOUR_WAY)


def reconstructed(case: Case, *reported: dict[str, object]) -> Hypothesis:
    """The best hypothesis for the crash with two vehicles of which nothing but ``reported`` is known."""
    vehicles = tuple(
        dataclasses.replace(
            vehicle,
            **{"impact": None, "critical_event_code": None, "avoidance_code": None, "trafficway_code": None} | said,
        )
        for vehicle, said in zip(case.record.vehicles, reported, strict=True)
    )
    record = dataclasses.replace(case.record, vehicles=vehicles)
    return estimate(record, case.network, case.report, SETTINGS.states).best


def turned_deg(state: ParticipantState) -> float:
    """How far the planned motion turns, positive to the left."""
    heading = np.unwrap(state.trajectory.heading_rad)
    return math.degrees(float(heading[-1] - heading[0]))


def between_deg(best: Hypothesis) -> float:
    """Angle between the two directions of travel at the beginning."""
    one, two = (state.initial_pose.heading_rad for state in best.participants)
    return abs(math.degrees(math.remainder(one - two, math.tau)))


@pytest.mark.parametrize(("first", "second"), PAIRS)
def test_a_pair_of_crash_types_moves_as_its_diagram_shows(case, first, second):
    reported = []
    for code in (first, second):
        crash_type = CRASH_TYPES[code]
        speed_mps = 0.0 if crash_type.stopped else 6.0 if crash_type.turn else 14.0 if code == first else 12.0
        movement = PreCrashMovement.STOPPED if crash_type.stopped else MOVEMENT[crash_type.turn]
        reported.append({"crash_type_code": code, "movement": movement, "travel_speed_mps": speed_mps})
    best = reconstructed(case, *reported)
    low, high = APPROACH_DEG[CRASH_TYPES[first].relation]
    assert low <= between_deg(best) <= high
    for state, code in zip(best.participants, (first, second), strict=True):
        turn = CRASH_TYPES[code].turn
        if turn is None:
            assert abs(turned_deg(state)) < 30
        else:
            assert turned_deg(state) * (1 if turn is Turn.LEFT else -1) > 45
    assert all(check.passed for check in best.checks if "direction" in check.name or "touching" in check.name)


@pytest.mark.parametrize("codes", [(24, 25), (46, 47)])
def test_two_who_turn_the_same_way_turn_behind_or_beside_each_other(case, codes):
    """One runs into the other in the turn, or comes over to it: both turn, from one street."""
    best = reconstructed(
        case,
        *(
            {"crash_type_code": code, "movement": PreCrashMovement.TURNING_LEFT, "travel_speed_mps": speed_mps}
            for code, speed_mps in zip(codes, (8.0, 5.0), strict=True)
        ),
    )
    assert between_deg(best) < 30
    assert [state.manoeuvre for state in best.participants] == [Manoeuvre.TURN_LEFT] * 2
    assert all(turned_deg(state) > 45 for state in best.participants)


def test_a_u_turn_goes_around_to_the_left(case):
    best = reconstructed(
        case,
        {"crash_type_code": 98, "movement": PreCrashMovement.U_TURN, "travel_speed_mps": 4.0},
        {"crash_type_code": 98, "movement": PreCrashMovement.GOING_STRAIGHT, "travel_speed_mps": 15.0},
    )
    assert best.participants[0].manoeuvre is Manoeuvre.U_TURN
    assert turned_deg(best.participants[0]) == pytest.approx(180, abs=25)


def test_backing_goes_backward(case):
    best = reconstructed(
        case,
        {"crash_type_code": 92, "movement": PreCrashMovement.BACKING, "travel_speed_mps": 2.0},
        {"crash_type_code": 93, "movement": PreCrashMovement.GOING_STRAIGHT, "travel_speed_mps": 12.0},
    )
    state = best.participants[0]
    assert state.manoeuvre is Manoeuvre.BACKING
    assert state.initial_speed_mps == pytest.approx(-2.0)
    moved = state.impact_pose.xy_m - state.initial_pose.xy_m
    assert float(moved @ state.initial_pose.forward) < 0


@pytest.mark.parametrize(
    ("movement", "codes", "manoeuvres"),
    [
        (PreCrashMovement.CHANGING_LANES, (46, 47), {Manoeuvre.LANE_CHANGE_LEFT, Manoeuvre.LANE_CHANGE_RIGHT}),
        (PreCrashMovement.PASSING, (24, 25), {Manoeuvre.PASS}),
        (PreCrashMovement.MERGING, (24, 25), {Manoeuvre.MERGE}),
    ],
)
def test_movements_have_their_manoeuvres(case, movement, codes, manoeuvres):
    one, two = codes
    best = reconstructed(
        case,
        {"crash_type_code": one, "movement": movement, "travel_speed_mps": 16.0},
        {"crash_type_code": two, "movement": PreCrashMovement.GOING_STRAIGHT, "travel_speed_mps": 11.0},
    )
    assert best.participants[0].manoeuvre in manoeuvres
    assert between_deg(best) < 30


def test_a_vehicle_reported_from_a_driveway_comes_from_the_side(case):
    best = reconstructed(
        case,
        {
            "crash_type_code": 86,
            "movement": PreCrashMovement.GOING_STRAIGHT,
            "travel_speed_mps": 12.0,
            "critical_event_code": 73,
        },
        {
            "crash_type_code": 87,
            "movement": PreCrashMovement.GOING_STRAIGHT,
            "travel_speed_mps": 3.0,
            "trafficway_code": 0,
        },
    )
    assert 60 <= between_deg(best) <= 120
