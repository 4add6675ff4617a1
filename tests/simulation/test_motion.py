"""Motion on the road: stopping, tracking a plan, heights, and how a run ends."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import replace

import numpy as np
import pytest
from pydantic import ValidationError
from shapely import LineString, Point

from tests.simulation.motions import CAR, TRUCK, driven, meeting, participant, straight
from tests.verdict.crashes import STREET, estimate, simulated
from trace_dag.common.errors import Failure
from trace_dag.common.geometry import Pose
from trace_dag.common.settings import SimSettings
from trace_dag.common.units import GRAVITY_MPS2
from trace_dag.crash.record import VehicleClass
from trace_dag.simulation.embedded import EmbeddedBackend, EmbeddedSimulation
from trace_dag.simulation.plan import tracking_errors
from trace_dag.simulation.run import simulate
from trace_dag.simulation.states import Trajectory
from trace_dag.simulation.surface import Surface
from trace_dag.simulation.types import Body, BodyKind, Participant, SimulationLog, Termination

BUS = Body(BodyKind.MOTOR_VEHICLE, VehicleClass.BUS, 12.0, 2.55, 3.2, 13000.0)
MOTORCYCLE = Body(BodyKind.MOTOR_VEHICLE, VehicleClass.MOTORCYCLE, 2.2, 0.8, 1.4, 300.0)


def run(
    *participants: Participant, settings: SimSettings | None = None, surface: Surface | None = None
) -> SimulationLog:
    settings = settings or SimSettings()
    simulation = EmbeddedSimulation(settings, surface or Surface(), settings.friction)
    return simulation.run(participants, time_limit_s=settings.time_limit_s)


@pytest.mark.parametrize("speed", [5.0, 15.0, 30.0, 45.0])
@pytest.mark.parametrize("friction", [0.75, 0.3])
def test_with_locked_wheels_a_car_stops_in_the_textbook_distance(speed: float, friction: float) -> None:
    """Struck by something far too light to matter, which ends the drive all the same, its wheels locked: v^2 / (2 mu
    g)."""
    feather = Body(BodyKind.MOTOR_VEHICLE, VehicleClass.CAR, 1.0, 1.0, 1.0, 0.001)
    settings = SimSettings(friction=friction, locked_wheels=1.0, time_limit_s=60.0, crash_delta_v_mps=1e-9)
    log = run(
        participant(1, straight(0.0, 0.0, 0.0, speed)),
        participant(2, straight(20.0, 0.0, 0.0, 0.0), feather),
        settings=settings,
    )
    contact = log.contacts[0]
    slid = math.hypot(log.vehicles[0].x_m[-1] - contact.pose_1.x_m, log.vehicles[0].y_m[-1] - contact.pose_1.y_m)
    assert log.termination is Termination.AT_REST
    assert slid == pytest.approx(speed**2 / (2 * friction * GRAVITY_MPS2), rel=0.03)


def turn(radius_m: float, from_m: float, speed: float) -> Trajectory:
    """Straight, then a quarter turn, at constant speed."""
    to_m = from_m + radius_m * math.pi / 2
    return driven(0.0, 0.0, 0.3, lambda _: speed, lambda s: 1 / radius_m if from_m < s < to_m else 0.0, until_s=8.0)


PLANS: dict[str, Callable[[], Trajectory]] = {
    "turn": lambda: turn(12.0, 15.0, 5.5),
    "start from rest into a turn": lambda: driven(
        0.0, 0.0, 0.0, lambda t: min(1.5 * max(t - 1, 0), 6.0), lambda s: 1 / 12 if 5 < s < 24 else 0.0
    ),
    "lane change at 25 m/s": lambda: driven(
        0.0, 0.0, 1.0, lambda _: 25.0, lambda s: 0.003 if 50 < s < 80 else -0.003 if 80 < s < 110 else 0.0, until_s=6.0
    ),
    "brake to a stop": lambda: driven(0.0, 0.0, 2.0, lambda t: max(20.0 - 5 * max(t - 1, 0), 0.0), lambda _: 0.0),
    "motorway bend": lambda: driven(0.0, 0.0, -2.0, lambda _: 38.0, lambda s: 0.001 if s > 50 else 0.0),
}


@pytest.mark.parametrize("body", [CAR, MOTORCYCLE, TRUCK, BUS], ids=lambda body: str(body.vehicle_class))
@pytest.mark.parametrize("plan", PLANS)
def test_vehicles_keep_to_plans_that_tyres_can_follow(plan: str, body: Body) -> None:
    trajectory = PLANS[plan]()
    log = run(participant(1, trajectory, body), participant(2, straight(900.0, 900.0, 0.0, 0.0)))
    until_s = float(trajectory.time_s[-1])
    distance, speed_error = tracking_errors(trajectory, log.vehicles[0], until_s)
    planned = np.interp(log.vehicles[0].time_s[: len(speed_error)], trajectory.time_s, trajectory.speed_mps)
    assert np.percentile(distance, 99) < 0.25
    moving = planned > 2.0
    assert np.percentile((speed_error[moving] / planned[moving]), 99) < 0.05


def test_a_plan_beyond_friction_is_not_followed() -> None:
    """A 10 m bend at 20 m/s asks for 4 g: tyres give what they have, and the vehicle runs wide."""
    log = run(participant(1, turn(10.0, 20.0, 20.0)), participant(2, straight(900.0, 900.0, 0.0, 0.0)))
    vehicle = log.vehicles[0]
    vx, vy, time = vehicle.velocity_x_mps, vehicle.velocity_y_mps, vehicle.time_s
    acceleration = np.hypot(np.gradient(vx, time), np.gradient(vy, time))
    assert tracking_errors(turn(10.0, 20.0, 20.0), vehicle, 8.0)[0].max() > 2.0
    assert np.percentile(acceleration, 99) < 0.75 * GRAVITY_MPS2 * 1.15


def test_distances_from_a_path_are_those_to_its_nearest_piece() -> None:
    """A path that loops over itself, driven by someone who keeps to it, leaves it for good, and jumps back: GEOS
    measures the same distances."""
    plan = driven(0.0, 0.0, 0.3, lambda _: 9.0, lambda s: 1 / 15 if 40 < s < 170 else 0.0, until_s=25.0)
    log = run(participant(1, plan), participant(2, straight(900.0, 900.0, 0.0, 0.0))).vehicles[0]
    apart_m = np.where(log.time_s < 12.0, 0.1, 40.0 * np.sin(log.time_s))
    apart_m[-5:] = 500.0
    strayed = replace(log, x_m=log.x_m + apart_m)
    distance, _ = tracking_errors(plan, strayed, 25.0)
    path = LineString(np.column_stack([plan.x_m, plan.y_m]))
    expected = [path.distance(Point(x, y)) for x, y in zip(strayed.x_m, strayed.y_m, strict=True)]
    assert distance == pytest.approx(expected[: len(distance)], abs=1e-9)


def test_bodies_stay_on_the_surface_and_bridges_pass_over_roads() -> None:
    """Two lanes that cross on different levels: both vehicles keep their height, and nothing touches."""
    s = np.linspace(-200.0, 200.0, 201)
    level, bridge = np.stack([s, 0 * s, 0 * s], -1), np.stack([0 * s, s, 6.0 + 0.02 * s], -1)
    slopes = np.concatenate([np.zeros((201, 2)), np.tile([0.0, 0.02], (201, 1))])
    surface = Surface(np.concatenate([level, bridge]), slopes)
    over = straight(0.0, -40.0, math.pi / 2, 20.0, z_m=5.2, until_s=6.0)
    log = run(participant(1, straight(-40.0, 0.0, 0.0, 20.0, until_s=6.0)), participant(2, over), surface=surface)
    assert log.termination is Termination.NO_CONTACT
    under, above = log.vehicles
    assert np.abs(under.z_m).max() < 1e-9
    assert above.z_m == pytest.approx(6.0 + 0.02 * above.y_m, abs=0.05)


def test_a_grade_pulls_a_sliding_car() -> None:
    """With free-rolling wheels after the impact a car on a 10 % grade picks up speed downhill."""
    s = np.linspace(-300.0, 300.0, 301)
    surface = Surface(np.stack([s, 0 * s, -0.1 * s], -1), np.tile([-0.1, 0.0], (301, 1)))
    feather = Body(BodyKind.MOTOR_VEHICLE, VehicleClass.CAR, 1.0, 1.0, 1.0, 0.001)
    settings = SimSettings(locked_wheels=0.0, time_limit_s=4.0, crash_delta_v_mps=1e-9)
    log = run(
        participant(1, straight(0.0, 0.0, 0.0, 10.0)),
        participant(2, straight(8.0, 0.0, 0.0, 0.0), feather),
        settings=settings,
        surface=surface,
    )
    speed, time = log.vehicles[0].speed_mps, log.vehicles[0].time_s
    gained = (speed[-1] - speed[len(speed) // 2]) / (time[-1] - time[len(time) // 2])
    assert gained == pytest.approx((0.1 - 0.015) * GRAVITY_MPS2, rel=0.05)


def test_vehicles_that_miss_end_with_how_near_they_came() -> None:
    log = run(participant(1, straight(0.0, 0.0, 0.0, 20.0)), participant(2, straight(30.0, 9.0, math.pi, 20.0)))
    assert log.termination is Termination.NO_CONTACT
    assert log.first_contact is None
    assert "9.0 m" in log.reason
    assert log.duration_s < 12.0


def test_vehicles_that_overlap_at_the_start_are_reported() -> None:
    log = run(participant(1, straight(0.0, 0.0, 0.0, 10.0)), participant(2, straight(3.0, 0.0, 0.0, 0.0)))
    assert log.termination is Termination.STARTED_IN_CONTACT
    assert log.duration_s == 0.0
    assert len(log.vehicles[0].time_s) == 1


def test_the_time_limit_ends_a_run() -> None:
    log = run(*meeting(math.pi / 2, 30.0, 30.0), settings=SimSettings(time_limit_s=2.5))
    assert log.termination is Termination.TIME_LIMIT
    assert log.duration_s == pytest.approx(2.5)


def test_a_plan_that_ends_before_the_crash_ends_in_a_stop() -> None:
    """A road that ends: the vehicle brakes to a stop where its plan is over, and the run ends."""
    log = run(
        participant(1, straight(0.0, 0.0, 0.0, 20.0, until_s=1.0)),
        participant(2, straight(300.0, 0.0, math.pi, 20.0, until_s=2.0)),
    )
    assert log.termination is Termination.NO_CONTACT


def test_one_point_is_enough_to_stand_on() -> None:
    one = np.array([0.0])
    standing = Trajectory(one, one + 15.0, one, one, one, one)
    log = run(participant(1, straight(-20.0, 0.0, 0.0, 10.0)), participant(2, standing))
    assert log.first_contact is not None
    assert log.first_contact.pose_2.x_m == pytest.approx(15.0, abs=0.01)


@pytest.mark.parametrize("count", [0, 1])
def test_with_fewer_than_two_there_is_nothing_to_collide_with(count: int) -> None:
    log = run(*[participant(1, straight(0.0, 0.0, 0.0, 10.0, until_s=2.0))][:count])
    assert log.termination is Termination.NO_CONTACT
    assert "fewer than two" in log.reason
    assert len(log.vehicles) == count


@pytest.mark.parametrize("speed", [1e3, 1e9, 1e300])
def test_speeds_beyond_all_bounds_end_a_run_at_once(speed: float) -> None:
    log = run(participant(1, straight(0.0, 0.0, 0.0, speed)), participant(2, straight(50.0, 0.0, math.pi, 0.0)))
    assert log.termination is Termination.DIVERGED
    assert log.reason.startswith("vehicle 1 left all bounds")
    assert log.duration_s == 0.0


def test_the_fastest_crash_there_can_be_still_ends_at_rest() -> None:
    """Two vehicles at 149 m/s: within one step they close by more than a metre, and do not pass through each other."""
    log = run(participant(1, straight(-300.0, 0.0, 0.0, 149.0)), participant(2, straight(300.0, 0.0, math.pi, 149.0)))
    assert log.termination is Termination.AT_REST
    assert log.first_contact.x_m == pytest.approx(0.0, abs=0.02)
    assert log.first_contact.closing_speed_mps == pytest.approx(298.0, rel=1e-3)
    one, two = log.vehicles
    assert (one.x_m < two.x_m).all()


@pytest.mark.parametrize("step_s", [0.0001, 0.05])
def test_the_smallest_and_the_largest_step_see_the_same_crash(step_s: float) -> None:
    crash = participant(1, straight(-6.0, 0.0, 0.0, 20.0)), participant(2, straight(6.0, 0.0, math.pi, 20.0))
    log = run(*crash, settings=SimSettings(step_s=step_s, time_limit_s=0.5))
    assert log.first_contact.time_s == pytest.approx((12.0 - CAR.length_m) / 40.0, abs=2e-4)
    assert log.first_contact.x_m == pytest.approx(0.0, abs=0.01)


@pytest.mark.parametrize(
    "setting", [{"step_s": 1e-5}, {"step_s": 0.0}, {"time_limit_s": math.inf}, {"time_limit_s": 1e9}, {"log_step_s": 0}]
)
def test_settings_that_would_never_end_are_refused(setting: dict[str, float]) -> None:
    with pytest.raises(ValidationError):
        SimSettings(**setting)


def test_an_estimate_that_leaves_all_bounds_is_a_failure_and_no_rejection() -> None:
    fast = straight(0.0, 0.0, 0.0, 400.0), straight(50.0, 0.0, math.pi, 0.0)
    hypothesis = simulated(*fast)[0]
    settings = SimSettings()
    with pytest.raises(Failure, match="left all bounds"):
        simulate(EmbeddedBackend(settings), STREET, b"", estimate(hypothesis), settings)


def _with(trajectory: Trajectory, **changes: object) -> Participant:
    return replace(participant(1, trajectory), trajectory=replace(trajectory, **changes))


PLAN = straight(0.0, 0.0, 0.0, 10.0)
NAN = np.where(np.arange(len(PLAN.time_s)) == 7, np.nan, PLAN.x_m)


@pytest.mark.parametrize(
    ("broken", "says"),
    [
        (_with(PLAN, x_m=NAN), r"vehicle 1: .*x_m\[7\] is nan"),
        (_with(PLAN, x_m=PLAN.x_m[:-1]), "differ in length"),
        (_with(PLAN, time_s=PLAN.time_s[::-1]), "times do not increase"),
        (_with(PLAN, time_s=PLAN.time_s + 1.0), "must cover time 0"),
        (_with(PLAN, **{k: getattr(PLAN, k)[:1] for k in PLAN.__dataclass_fields__}), "one point but it starts at 10"),
        (_with(PLAN, **{k: getattr(PLAN, k)[:0] for k in PLAN.__dataclass_fields__}), "empty"),
        (replace(participant(1, PLAN), initial_pose=Pose(math.nan, 0, 0)), "initial state"),
        (replace(participant(1, PLAN), body=replace(CAR, mass_kg=0.0)), "must be positive"),
    ],
)
def test_plans_nobody_can_drive_are_refused_by_name(broken: Participant, says: str) -> None:
    with pytest.raises(Failure, match=says):
        run(broken, participant(2, straight(100.0, 0.0, math.pi, 10.0)))


def test_participants_need_numbers_of_their_own() -> None:
    with pytest.raises(Failure, match=r"different numbers; found \[1, 1\]"):
        run(participant(1, PLAN), participant(1, straight(100.0, 0.0, math.pi, 10.0)))
