"""Tractor and trailer: how it follows, what the hitch does and keeps, when it folds up, and whose contact it is."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest

from tests.simulation.motions import CAR, driven, log_of, participant, straight
from trace_dag.common.geometry import FloatArray, contact_clock_h
from trace_dag.common.settings import SimSettings
from trace_dag.crash.codes.bodies import BODIES, ReportedBody
from trace_dag.crash.trailer import Trailer
from trace_dag.crash.vehicles import trailer_of
from trace_dag.simulation.dynamics import Vehicle
from trace_dag.simulation.plan import resample
from trace_dag.simulation.states import Trajectory
from trace_dag.simulation.towing import Hitch, Towed, pulled_body
from trace_dag.simulation.types import Body, BodyKind, Participant, SimulationLog, VehicleLog
from trace_dag.simulation.vehicles import trailer_model, vehicle_model

ONE_TRAILER = 1  # TOW_VEH


def combination(body: ReportedBody, trajectory: Trajectory, number: int = 1, angle_rad: float = 0.0) -> Participant:
    """What pulls its usual trailer, the trailer turned by an angle to its left."""
    trailer = trailer_of(body, ONE_TRAILER)
    puller = Body(BodyKind.MOTOR_VEHICLE, body.vehicle_class, body.length_m, body.width_m, body.height_m, body.mass_kg)
    heading = float(trajectory.heading_rad[0]) + angle_rad
    return replace(participant(number, trajectory, puller), trailer=trailer, trailer_heading_rad=heading)


def run(*participants: Participant, friction: float = 0.75, time_limit_s: float = 20.0) -> SimulationLog:
    return log_of(participants, SimSettings(friction=friction, time_limit_s=time_limit_s))


def towed_log(log: SimulationLog, number: int = 1) -> tuple[Trailer, VehicleLog]:
    behind = log.trailer_log(number)
    assert behind is not None
    return log.trailers[number], behind


def hitch_of(log: SimulationLog) -> tuple[tuple[FloatArray, FloatArray], tuple[FloatArray, FloatArray]]:
    """Both ends of the hitch."""
    puller, (trailer, behind) = log.vehicles[0], towed_log(log)
    ahead_m = trailer.length_m / 2 - trailer.coupling_m
    towed = behind.x_m + ahead_m * np.cos(behind.heading_rad), behind.y_m + ahead_m * np.sin(behind.heading_rad)
    return trailer.hitch((puller.x_m, puller.y_m, puller.heading_rad), log.bodies[1].length_m), towed


@pytest.mark.parametrize(("radius_m", "speed_mps"), [(20.0, 2.5), (40.0, 4.0)])
def test_the_trailer_cuts_the_corner_as_far_as_geometry_states(radius_m: float, speed_mps: float) -> None:
    """In a steady turn at low speed no axle slides sideways, so that hitch, axle and centre make a right angle: the
    trailer's axle runs at the root of the hitch's radius squared less the drawbar squared (WHI formula, SAE J695)."""
    turn = driven(
        0.0, 0.0, 0.0, lambda _: speed_mps, lambda _: 1 / radius_m, until_s=1.9 * math.pi * radius_m / speed_mps
    )
    log = run(combination(BODIES["tractor_of_trailer"], turn), time_limit_s=float(turn.time_s[-1]))
    trailer, behind = towed_log(log)
    back_m = trailer.axle_m - trailer.length_m / 2
    axle_x, axle_y = behind.x_m - back_m * np.cos(behind.heading_rad), behind.y_m - back_m * np.sin(behind.heading_rad)
    (hitch_x, hitch_y), _ = hitch_of(log)
    hitch_m = math.hypot(hitch_x[-1], hitch_y[-1] - radius_m)
    expected_m = math.sqrt(hitch_m**2 - trailer.drawbar_m**2)
    assert hitch_m - expected_m > 1.5
    assert math.hypot(axle_x[-1], axle_y[-1] - radius_m) == pytest.approx(
        expected_m, abs=0.03 * (hitch_m - expected_m) + 0.2
    )


@pytest.mark.parametrize("body", [BODIES["tractor_of_trailer"], BODIES["pickup"]])
def test_both_ends_of_the_hitch_stay_together(body: ReportedBody) -> None:
    weaving = driven(0.0, 0.0, 0.0, lambda t: 15.0 - t, lambda s: math.sin(s / 15.0) / 120.0, until_s=8.0)
    log = run(combination(body, weaving), time_limit_s=8.0)
    (x, y), (towed_x, towed_y) = hitch_of(log)
    assert np.hypot(x - towed_x, y - towed_y).max() < 1e-3
    angle = log.articulation_rad(1)
    assert angle is not None
    assert np.abs(angle).max() > math.radians(1.0)


def test_the_driver_keeps_the_speed_of_the_plan_with_a_trailer_behind() -> None:
    braking = driven(0.0, 0.0, 0.0, lambda t: 20.0 - 2.0 * max(t - 1.0, 0.0), lambda _: 0.0, until_s=8.0)
    log = run(combination(BODIES["tractor_of_trailer"], braking), time_limit_s=8.0)
    planned = np.interp(log.vehicles[0].time_s, braking.time_s, braking.speed_mps)
    assert np.abs(log.vehicles[0].speed_mps - planned).max() < 0.5


def momentum(log: SimulationLog, k: int) -> tuple[FloatArray, float]:
    """Momentum and angular momentum about the origin of everybody, at a step."""
    linear, angular = np.zeros(2), 0.0
    for each in log.vehicles:
        body = log.bodies[each.number]
        model = (
            trailer_model(body, log.trailers[1])
            if body.is_trailer
            else vehicle_model(body, log.trailers.get(each.number))
        )
        c, s = math.cos(each.heading_rad[k]), math.sin(each.heading_rad[k])
        place = np.array([each.x_m[k] + model.cg_ahead_m * c, each.y_m[k] + model.cg_ahead_m * s])
        velocity = np.array([
            each.velocity_x_mps[k] - model.cg_ahead_m * each.yaw_rate_rps[k] * s,
            each.velocity_y_mps[k] + model.cg_ahead_m * each.yaw_rate_rps[k] * c,
        ])  # fmt: skip
        linear += body.mass_kg * velocity
        angular += body.mass_kg * float(place[0] * velocity[1] - place[1] * velocity[0])
        angular += model.yaw_inertia_kgm2 * float(each.yaw_rate_rps[k])
    return linear, angular


def test_a_crash_with_a_trailer_keeps_momentum() -> None:
    """On a road without friction nothing from outside acts on three bodies, two of them coupled."""
    rig = combination(BODIES["tractor_of_trailer"], straight(0.0, 0.0, 0.0, 10.0, until_s=2.0))
    car = participant(2, straight(-3.0, -22.0, math.pi / 2, 20.0, until_s=2.0))
    log = run(rig, car, friction=1e-6, time_limit_s=2.0)
    contact = log.first_contact
    assert contact is not None
    assert contact.touched == (3001, 2)
    (before, turning_before), (after, turning_after) = momentum(log, 0), momentum(log, -1)
    assert after == pytest.approx(before, rel=2e-3, abs=50.0)
    assert turning_after == pytest.approx(turning_before, rel=5e-3)
    assert abs(log.vehicles[0].velocity_y_mps[-1]) > 0.01  # the tractor feels it through the hitch


def folds_to_rad(angle_rad: float, *, brakes_trailer: bool) -> float:
    """Largest articulation of a combination at 20 m/s all of whose tractor wheels lock, its trailer turned so far."""

    class Pushing(Towed):
        @property
        def pedals(self) -> tuple[float, float]:
            return 0.0, 1.0 if brakes_trailer else 0.0

    settings = SimSettings()
    who = combination(BODIES["tractor_of_trailer"], straight(0.0, 0.0, 0.0, 20.0), angle_rad=angle_rad)
    model, body = vehicle_model(who.body, who.trailer), pulled_body(who)
    assert body is not None
    plan = resample(who.trajectory, settings.step_s, 10.0, model.cg_ahead_m)
    tractor = Vehicle(who, model, plan, friction=0.6, locked_wheels=1.0)
    towed = Pushing(tractor, who, body, friction=0.6)
    tractor.crashed = True
    hitch = Hitch((tractor, towed), 0, 1)
    largest = 0.0
    for step in range(round(6.0 / settings.step_s)):
        forces = [value for each in (tractor, towed) for value in each.road_force(step)]
        hitch.hold(forces, settings.step_s)
        tractor.advance((forces[0], forces[1], forces[2]), settings.step_s)
        towed.advance((forces[3], forces[4], forces[5]), settings.step_s)
        largest = max(largest, abs(math.remainder(tractor.heading - towed.heading, math.tau)))
    return largest


def test_a_tractor_with_locked_wheels_jackknifes_at_an_angle_and_not_in_line() -> None:
    """The trailer pushes a tractor that cannot hold its rear: any angle grows, by an unstable motion."""
    assert folds_to_rad(math.radians(4.0), brakes_trailer=False) > math.radians(45.0)
    assert folds_to_rad(0.0, brakes_trailer=False) < math.radians(0.1)


def test_braked_with_its_tractor_the_trailer_does_not_push() -> None:
    assert folds_to_rad(math.radians(4.0), brakes_trailer=True) < math.radians(15.0)


def test_it_folds_no_farther_than_cab_and_trailer_meet() -> None:
    assert folds_to_rad(math.radians(20.0), brakes_trailer=False) < math.radians(103.0)


@pytest.mark.parametrize(("x_m", "clock_h"), [(0.0, 6.0), (-14.0, 4.1)])
def test_a_strike_of_the_trailer_is_one_of_the_vehicle(x_m: float, clock_h: float) -> None:
    """Into its rear: 6 o'clock of the combination. Into its right side 14 m behind the middle of the tractor, which is
    6.93 m behind the middle of the 21.14 m of both: half a width aside and 0.328 lengths back, 123 degrees or 4.1 h."""
    rig = combination(BODIES["tractor_of_trailer"], Trajectory(*(np.zeros(1) for _ in range(6))))
    if x_m:
        car = participant(2, straight(x_m, -30.0, math.pi / 2, 15.0, until_s=4.0))
    else:
        car = participant(2, straight(-50.0, 0.0, 0.0, 15.0, until_s=4.0))
    log = run(rig, car)
    contact = log.first_contact
    assert contact is not None
    assert (contact.number_1, contact.number_2) == (1, 2)
    assert contact.touched == (3001, 2)
    seen = contact_clock_h(*log.clock_body(contact, 1), np.array([contact.x_m, contact.y_m]))
    assert seen == pytest.approx(clock_h, abs=0.15)
    assert (contact.pose_1.x_m, contact.pose_1.y_m) == pytest.approx((0.0, 0.0), abs=0.05)
    assert [each.number for each in log.parties] == [1, 2]


def test_a_car_that_runs_into_a_trailer_moves_both_by_the_mass_of_both() -> None:
    """The change of velocity of a combination is that of its whole mass: momentum that the car lost."""
    rig = combination(BODIES["tractor_of_trailer"], straight(0.0, 0.0, 0.0, 5.0))
    log = run(rig, participant(2, straight(-50.0, 0.0, 0.0, 25.0)))
    contact = log.first_contact
    assert contact is not None
    trailer, _ = towed_log(log)
    whole_kg = BODIES["tractor_of_trailer"].mass_kg + trailer.mass_kg
    assert contact.delta_v_1_mps[0] * whole_kg == pytest.approx(-contact.delta_v_2_mps[0] * CAR.mass_kg, rel=1e-6)
