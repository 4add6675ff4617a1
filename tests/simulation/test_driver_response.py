"""Who drives on after a contact: a light one is no crash to a driver."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest

from tests.simulation.motions import CAR, participant, straight
from trace_dag.common.settings import SimSettings
from trace_dag.common.units import GRAVITY_MPS2, kmh_to_mps
from trace_dag.crash.record import VehicleClass
from trace_dag.simulation.embedded import EmbeddedSimulation
from trace_dag.simulation.surface import Surface
from trace_dag.simulation.types import AfterStriking, Body, BodyKind, Participant, SimulationLog, Termination

SETTINGS = SimSettings(friction=0.75, time_limit_s=30.0)
MOTORCYCLE = Body(BodyKind.MOTOR_VEHICLE, VehicleClass.MOTORCYCLE, 2.2, 0.8, 1.4, 300.0)
SPEED_MPS = 30.0


def run(*participants: Participant, settings: SimSettings = SETTINGS) -> SimulationLog:
    return EmbeddedSimulation(settings, Surface(), settings.friction).run(
        participants, time_limit_s=settings.time_limit_s
    )


def graze(body: Body = CAR, **changes: object) -> SimulationLog:
    """Side by side at one speed, the first heading 0.3 degrees towards the second, which goes straight on."""
    one = participant(1, straight(0.0, 0.0, math.radians(0.3), SPEED_MPS))
    two = participant(2, straight(0.0, (CAR.width_m + body.width_m) / 2 + 0.15, 0.0, SPEED_MPS), body)
    return run(replace(one, **changes), two)


def slid_m(log: SimulationLog, vehicle: int) -> float:
    """How far a vehicle goes on after the contact."""
    contact, logged = log.contacts[0], log.vehicles[vehicle]
    pose = (contact.pose_1, contact.pose_2)[vehicle]
    return math.hypot(logged.x_m[-1] - pose.x_m, logged.y_m[-1] - pose.y_m)


def test_a_grazed_vehicle_keeps_the_lane_and_brakes_after_a_reaction() -> None:
    log = graze()
    contact = log.contacts[0]
    assert math.hypot(*contact.delta_v_2_mps) < kmh_to_mps(8.0)
    assert log.termination is Termination.AT_REST
    straight_on = log.vehicles[1]
    assert abs(np.degrees(straight_on.heading_rad)).max() < 3.0
    assert abs(straight_on.y_m[-1] - straight_on.y_m[0]) < 0.5
    # By hand: 1.1 s at 30 m/s, then 0.8 of 0.75 g. While they touch, half of the wheels hold.
    expected_m = SPEED_MPS * SETTINGS.reaction_s + SPEED_MPS**2 / (2 * 0.8 * 0.75 * GRAVITY_MPS2)
    assert slid_m(log, 1) == pytest.approx(expected_m, rel=0.1)


def test_a_driver_reported_to_have_left_drives_on() -> None:
    log = graze(after_striking=AfterStriking(math.inf, 0.0))
    assert slid_m(log, 0) > 1.5 * slid_m(log, 1)


def test_a_motorcycle_that_is_grazed_falls() -> None:
    log = graze(MOTORCYCLE)
    assert math.hypot(*log.contacts[0].delta_v_1_mps) < kmh_to_mps(8.0)
    moment = log.contacts[0].time_s + SETTINGS.reaction_s / 2  # a driver does not brake yet
    for vehicle, nobody_drives in ((0, False), (1, True)):
        logged = log.vehicles[vehicle]
        brake = logged.brake[int(np.searchsorted(logged.time_s, moment))]
        assert (brake == pytest.approx(SETTINGS.locked_wheels)) == nobody_drives


def test_after_a_crash_nobody_drives() -> None:
    """Into the rear of a car that stands: the first would brake with 0.6 g; half of its wheels hold, with 0.375 g."""
    log = run(participant(1, straight(-30.0, 0.0, 0.0, 20.0)), participant(2, straight(0.0, 0.0, 0.0, 0.0)))
    contact = log.contacts[0]
    after_mps = 20.0 + contact.delta_v_1_mps[0]
    assert contact.delta_v_1_mps[0] < -kmh_to_mps(8.0)
    assert slid_m(log, 0) == pytest.approx(after_mps**2 / (2 * 0.375 * GRAVITY_MPS2), rel=0.25)


def test_a_nudged_standing_vehicle_stays_on_the_brakes() -> None:
    log = run(participant(1, straight(-8.0, 0.0, 0.0, 2.0)), participant(2, straight(0.0, 0.0, 0.0, 0.0)))
    contact = log.contacts[0]
    pushed_mps = contact.delta_v_2_mps[0]
    assert 0.5 < pushed_mps < kmh_to_mps(8.0)
    # By hand: 0.6 g or, while they touch, half of the wheels; a reaction of 1.1 s would add more than a metre.
    assert slid_m(log, 1) < pushed_mps**2 / (2 * 0.375 * GRAVITY_MPS2) + 0.3
