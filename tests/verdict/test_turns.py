"""What counts as the reported turn where streets do not meet at right angles, and for vehicles that back."""

from __future__ import annotations

import math
from dataclasses import replace
from functools import cache

import pytest

from tests.simulation.motions import straight
from tests.verdict.crashes import STREET, record, simulated, vehicle
from trace_dag.common.geometry import Pose
from trace_dag.crash.classes import RoadTopology
from trace_dag.crash.record import PreCrashMovement, VehicleRecord
from trace_dag.verdict.directions import direction, turn_error_deg
from trace_dag.verdict.metrics import relation_error, turn_error
from trace_dag.verdict.observation import ObservedVehicle, observe_crash

HEAD_ON = (straight(-62.0, -1.75, 0.0, 20.0, until_s=8.0), straight(47.0, -1.5, math.pi, 15.0, until_s=8.0))
LEFT, RIGHT, STRAIGHT = frozenset({90.0}), frozenset({-90.0}), frozenset({0.0})
MIDBLOCK = RoadTopology.NOT_AN_INTERSECTION


@cache
def head_on() -> tuple[ObservedVehicle, ObservedVehicle]:
    first, *_ = observe_crash(STREET, *simulated(*HEAD_ON)).events
    return first.vehicles[1], first.vehicles[2]


def apart(one: VehicleRecord, two: VehicleRecord, topology: RoadTopology) -> float | None:
    """The error of the angle between both approaches."""
    return relation_error(*head_on(), one, two, replace(record(one, two), road_topology=topology))


@pytest.mark.parametrize(
    ("measured", "allowed", "offered", "error"),
    [
        (28.0, LEFT, frozenset({0.0, 28.0}), 0.0),  # the left leg of a Y
        (28.0, LEFT, frozenset(), 62.0),  # the same bend where nothing is offered
        (28.0, RIGHT, frozenset({0.0, 28.0}), 118.0),  # a leg to the left is not a turn to the right
        (2.0, LEFT, frozenset({2.0, 90.0}), 88.0),  # nearly straight on is not a turn
        (0.0, STRAIGHT, frozenset({0.0, 28.0}), 0.0),
        (28.0, STRAIGHT, frozenset({0.0, 28.0}), 28.0),
        (-130.0, RIGHT, frozenset({-130.0, 0.0}), 0.0),  # a sharp right at a skewed crossing
    ],
)
def test_a_turn_is_as_wide_as_the_junction_makes_it(
    measured: float, allowed: frozenset[float], offered: frozenset[float], error: float
) -> None:
    assert turn_error_deg(measured, allowed, offered) == pytest.approx(error)


def test_a_vehicle_reported_backing_must_go_backward() -> None:
    assert turn_error(head_on()[0], vehicle(1, 6, 92, PreCrashMovement.BACKING), MIDBLOCK) == 180.0


def test_a_bend_is_no_turn_but_at_an_l_reports_call_it_one() -> None:
    turning, other = vehicle(1, 12, 50, PreCrashMovement.TURNING_LEFT), vehicle(2, 12, 51)
    assert turn_error(head_on()[0], turning, MIDBLOCK) == pytest.approx(90.0, abs=5.0)
    assert turn_error(head_on()[0], turning, RoadTopology.L) == pytest.approx(0.0, abs=5.0)
    assert apart(turning, other, MIDBLOCK) == pytest.approx(0.0, abs=5.0)
    assert apart(turning, other, RoadTopology.L) is None


def test_crossing_streets_need_not_be_square_where_the_report_has_another_angle() -> None:
    crossing = vehicle(1, 12, 86), vehicle(2, 12, 87)
    assert apart(*crossing, RoadTopology.FOUR_WAY) == pytest.approx(90.0, abs=5.0)
    assert apart(*crossing, RoadTopology.Y) is None


def test_a_contact_at_the_first_step_has_the_direction_of_the_start() -> None:
    _, log = simulated(*HEAD_ON)
    (driven, _), plan = log.vehicles, HEAD_ON[0]
    start = Pose(float(driven.x_m[0]), float(driven.y_m[0]), float(driven.heading_rad[0]), float(driven.z_m[0]))
    found = direction(STREET, driven, start, 0.0, plan)
    assert (found.approach_rad, found.turn_deg) == (pytest.approx(0.0, abs=0.02), pytest.approx(0.0, abs=1.0))
