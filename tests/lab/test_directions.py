"""Directions hidden from estimates: what counts as right, and as fitting the manner of collision."""

from __future__ import annotations

import pytest

from lab.directions import DirectionRow, calibration, directions_fit, summary
from tests.crash.test_implied_types import EAST, LEFT, NORTH, STRAIGHT, WEST, crash
from trace_dag.crash.completed_record import complete_record

REAR_END, HEAD_ON, ANGLE = 1, 2, 6


@pytest.mark.parametrize(
    ("man_coll", "one", "two", "fits"),
    [
        (ANGLE, (STRAIGHT, EAST), (STRAIGHT, NORTH), True),
        (ANGLE, (STRAIGHT, EAST), (STRAIGHT, EAST), False),
        (ANGLE, (LEFT, EAST), (STRAIGHT, EAST), True),  # it may be the direction after its turn
        (REAR_END, (STRAIGHT, EAST), (STRAIGHT, EAST), True),
        (REAR_END, (STRAIGHT, EAST), (STRAIGHT, WEST), False),
        (HEAD_ON, (STRAIGHT, EAST), (STRAIGHT, WEST), True),
        (HEAD_ON, (STRAIGHT, EAST), (STRAIGHT, NORTH), False),
    ],
)
def test_directions_fit_the_manner_of_collision(man_coll, one, two, fits):
    record = complete_record(crash(man_coll, one, two))
    assert directions_fit(record, record.vehicles) is fits


def row(key: str, *, right: bool | None, ambiguity: float = 0.3, fits: bool = True) -> DirectionRow:
    return DirectionRow(key, "angle", True, False, fits, 0.5, right, right, right, ambiguity, True)


def test_shares_are_of_the_crashes_that_are_estimated():
    rows = [row("a", right=True), row("b", right=False), row("c", right=None)]
    (group, _, everything) = summary(rows)
    assert group["crashes"] == "angle, junction"
    assert (everything["asked"], everything["estimated"], everything["right"]) == (3, 2, "50%")


def test_calibration_sets_how_sure_beside_how_right():
    rows = [row(str(number), right=number < 7, ambiguity=0.3) for number in range(10)]  # 70 % sure, 70 % right
    assert calibration(rows) == [{"sure": "60% to 80%", "crashes": 10, "mean": "70%", "right": "70%"}]
