"""The table of crash types against what the coding manual's diagrams and real records say."""

from __future__ import annotations

import pytest

from trace_dag.crash.classes import VehicleTrajectory
from trace_dag.crash.crash_types import (
    CRASH_TYPES,
    EncounterRole,
    Relation,
    Side,
    Turn,
    critical_event,
    opposite_side,
    trajectories_disagree,
    vehicle_trajectory,
)
from trace_dag.crash.record import PreCrashMovement

FARS_CODES = {*range(17), *range(20, 94), 98, 99}


def test_every_code_of_fars_has_a_row():
    assert set(CRASH_TYPES) == FARS_CODES


PARTNERS = {
    20: 21,
    24: 25,
    28: 29,
    34: 35,
    38: 39,
    50: 51,
    54: 55,
    60: 61,
    64: 65,
    68: 69,
    70: 71,
    72: 73,
    76: 77,
    78: 79,
    80: 81,
    82: 83,
    86: 87,
    88: 89,
}
LEFT_TURNS, RIGHT_TURNS, NO_TURNS = (22, 26, 68, 72, 76, 82), (23, 27, 70, 78, 80), (21, 51, 69, 77, 83, 86, 89)


@pytest.mark.parametrize(("first", "second"), PARTNERS.items())
def test_partners_agree(first, second):
    one, two = CRASH_TYPES[first], CRASH_TYPES[second]
    assert one.relation is two.relation
    assert {one.role, two.role} in (
        {EncounterRole.STRIKING, EncounterRole.STRUCK},
        {EncounterRole.ENCROACHING, EncounterRole.STEADY},
    )
    if one.relation is Relation.CROSSING and one.turn is None:
        assert {one.other_from, two.other_from} == {Side.LEFT, Side.RIGHT}


@pytest.mark.parametrize(
    ("code", "turn"),
    [(code, Turn.LEFT) for code in LEFT_TURNS]
    + [(code, Turn.RIGHT) for code in RIGHT_TURNS]
    + [(code, None) for code in NO_TURNS],
)
def test_the_turning_vehicle(code, turn):
    assert CRASH_TYPES[code].turn is turn


@pytest.mark.parametrize(
    ("turning", "going", "heading_after_turn_from_other"),
    # Turning into the same direction ends along the other's heading, into opposite directions against it.
    [(76, 77, 0), (78, 79, 0), (80, 81, 180), (82, 83, 180)],
)
def test_turns_into_a_path_end_as_the_diagram_has_it(turning, going, heading_after_turn_from_other):
    turner, other = CRASH_TYPES[turning], CRASH_TYPES[going]
    heading = 90 if turner.turn is Turn.LEFT else -90  # it came along 0 degrees
    other_heading = 90 if turner.other_from is Side.RIGHT else -90  # from the right means heading left
    assert (heading - other_heading) % 360 == heading_after_turn_from_other
    seen_by_other = (0 - other_heading) % 360  # heading of the turner before its turn, as the other sees it
    assert other.other_from is (Side.RIGHT if seen_by_other == 90 else Side.LEFT)


def test_the_struck_side_is_where_the_other_came_from():
    assert CRASH_TYPES[87].other_from is Side.RIGHT
    assert CRASH_TYPES[89].other_from is Side.LEFT


def test_critical_events_say_whose_doing_it_was():
    assert critical_event(10).own is True
    assert critical_event(62).own is False
    assert critical_event(62).relation is Relation.OPPOSITE_DIRECTION
    assert critical_event(71).driveway
    assert critical_event(99).own is None
    assert critical_event(None).relation is None


def test_sides():
    assert opposite_side(Side.LEFT) is Side.RIGHT
    assert opposite_side(opposite_side(Side.LEFT)) is Side.LEFT


def test_counterparts_are_each_others_in_every_configuration_of_two():
    for first, second in {20: 21, 50: 51, 64: 65, 68: 69, 76: 77, 86: 87, 88: 89, 92: 93}.items():
        assert (CRASH_TYPES[first].counterpart, CRASH_TYPES[second].counterpart) == (second, first)
    # Struck from behind while going straight, turning left or right: all three by 20, 24 or 28.
    assert [CRASH_TYPES[code].counterpart for code in (21, 22, 23, 25, 31)] == [20, 20, 20, 24, 28]
    # Of those who were out of control or avoided something (E, H) the manual does not say whom they met.
    assert {CRASH_TYPES[code].counterpart for code in (34, 41, 54, 61)} == {None}


def test_categories_are_the_manuals():
    """FARS/CRSS Coding and Validation Manual, ACC_TYPE: I 1-16, II 20-49, III 50-67, IV 68-85, V 86-91, VI the rest."""
    for code, row in CRASH_TYPES.items():
        expected = VehicleTrajectory.OTHERS
        for first, last, trajectory in (
            (20, 49, VehicleTrajectory.SAME_DIRECTION),
            (50, 67, VehicleTrajectory.OPPOSITE_DIRECTION),
            (68, 85, VehicleTrajectory.TURNING),
            (86, 91, VehicleTrajectory.INTERSECTING),
        ):
            if first <= code <= last:
                expected = trajectory
        assert row.trajectory is expected
        assert row.single_driver is (1 <= code <= 16)
        assert row.of_two is (20 <= code <= 93)
        assert row.needs_junction is (68 <= code <= 91)
    assert vehicle_trajectory([99, 69]) is VehicleTrajectory.TURNING
    assert trajectories_disagree([68, 51])


def test_movement_and_impact_in_a_diagram():
    assert CRASH_TYPES[22].movement is PreCrashMovement.STOPPED  # it was going to turn left
    assert CRASH_TYPES[26].movement is PreCrashMovement.TURNING_LEFT
    assert CRASH_TYPES[29].movement is PreCrashMovement.DECELERATING
    assert CRASH_TYPES[46].movement is PreCrashMovement.CHANGING_LANES
    assert CRASH_TYPES[92].movement is PreCrashMovement.BACKING
    # IMPACT1 by the clock: 12 front, 6 rear, 3 right, 9 left.
    found = {code: CRASH_TYPES[code].impact_code for code in (20, 21, 50, 51, 86, 87, 89, 92, 68)}
    assert found == {20: 12, 21: 6, 50: 12, 51: 12, 86: 12, 87: 3, 89: 9, 92: 6, 68: None}
    assert {code: CRASH_TYPES[code].departure for code in (1, 5, 6, 10, 11)} == {
        **dict.fromkeys((1, 5), Side.RIGHT),
        **dict.fromkeys((6, 10), Side.LEFT),
        11: None,
    }
