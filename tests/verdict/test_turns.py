"""What counts as the reported turn where streets do not meet at right angles, and for vehicles that back."""

from __future__ import annotations

import math
from dataclasses import replace

import pytest

from tests.sim.motions import straight
from tests.verdict.crashes import STREET, record, simulated, vehicle
from trace_dag.crash.classes import RoadTopology
from trace_dag.crash.record import PreCrashMovement
from trace_dag.sim.types import SimulationLog
from trace_dag.verdict.directions import turn_error_deg
from trace_dag.verdict.metrics import VehicleMeasures, compare, observe

HEAD_ON = (straight(-62.0, -1.75, 0.0, 20.0, until_s=8.0), straight(47.0, -1.5, math.pi, 15.0, until_s=8.0))
LEFT, RIGHT, STRAIGHT = frozenset({90.0}), frozenset({-90.0}), frozenset({0.0})


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


def test_who_is_said_to_back_must_go_backward() -> None:
    hypothesis, log = simulated(*HEAD_ON)
    backing = record(vehicle(1, 6, 92, PreCrashMovement.BACKING), vehicle(2, 12, 93))
    assert _first(hypothesis, log, backing).turn_error_deg == 180.0


def test_a_bend_is_no_turn_but_at_an_l_reports_call_it_one() -> None:
    hypothesis, log = simulated(*HEAD_ON)
    turning = record(vehicle(1, 12, 50, PreCrashMovement.TURNING_LEFT), vehicle(2, 12, 51))
    assert _first(hypothesis, log, turning).turn_error_deg == pytest.approx(90.0, abs=5.0)
    at_l = replace(turning, road_topology=RoadTopology.L)
    assert _first(hypothesis, log, at_l).turn_error_deg == pytest.approx(0.0, abs=5.0)
    assert compare(observe(STREET, hypothesis, log), turning).relation_error_deg == pytest.approx(0.0, abs=5.0)
    assert compare(observe(STREET, hypothesis, log), at_l).relation_error_deg is None


def test_crossing_streets_need_not_be_square_where_the_report_says_so() -> None:
    hypothesis, log = simulated(*HEAD_ON)
    crossing = record(vehicle(1, 12, 86), vehicle(2, 12, 87))
    observed = observe(STREET, hypothesis, log)
    assert compare(
        observed, replace(crossing, road_topology=RoadTopology.FOUR_WAY)
    ).relation_error_deg == pytest.approx(90.0, abs=5.0)
    assert compare(observed, replace(crossing, road_topology=RoadTopology.Y)).relation_error_deg is None


def _first(hypothesis: object, log: SimulationLog, crash: object) -> VehicleMeasures:
    return compare(observe(STREET, hypothesis, log), crash).vehicles[0]
