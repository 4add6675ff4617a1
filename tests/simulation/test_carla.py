"""The CARLA back-end against a stand-in world, and the frame conversion against CARLA's own transforms."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest

carla = pytest.importorskip("carla", reason="the carla extra is not installed")

from hypothesis import given  # noqa: E402
from hypothesis import strategies as st  # noqa: E402

from tests.simulation.carla_stand_in import TIME_OUT, StandIn  # noqa: E402
from tests.simulation.motions import CAR, TRUCK, driven, participant, straight  # noqa: E402
from trace_dag.carla.backend import CarlaBackend  # noqa: E402
from trace_dag.carla.frame import (  # noqa: E402
    heading_from_carla,
    heading_to_carla,
    location_from_carla,
    location_to_carla,
    pose_from_carla,
    transform_to_carla,
)
from trace_dag.common.errors import Failure, TransientFailure, UserError  # noqa: E402
from trace_dag.common.geometry import LocalFrame, Pose  # noqa: E402
from trace_dag.common.settings import SimSettings  # noqa: E402
from trace_dag.common.units import wrap_angle  # noqa: E402
from trace_dag.crash.record import VehicleClass  # noqa: E402
from trace_dag.roads.map.network import RoadNetwork  # noqa: E402
from trace_dag.scenario.carla_blueprints import BLUEPRINTS, choose_blueprint  # noqa: E402
from trace_dag.simulation.body_sizes import person_body  # noqa: E402
from trace_dag.simulation.log_io import logs_from_files, logs_to_files  # noqa: E402
from trace_dag.simulation.objects import KINDS, FixedObject  # noqa: E402
from trace_dag.simulation.plan import tracking_errors  # noqa: E402
from trace_dag.simulation.states import Trajectory  # noqa: E402
from trace_dag.simulation.types import AfterStriking, Body, BodyKind, Participant, SimulationLog, Termination  # noqa: E402

XODR = b"<OpenDRIVE/>"
NETWORK = RoadNetwork(LocalFrame(37.0, -77.0), ())
SETTINGS = SimSettings(backend="carla")
HEAD_ON = (participant(1, straight(-45.0, 0.3, 0.0, 15.0)), participant(2, straight(40.0, 0.0, math.pi, 12.0)))


def run(module: StandIn, *participants, time_limit_s: float = 20.0) -> SimulationLog:
    simulation = CarlaBackend(SETTINGS, module).load(NETWORK, XODR, friction=0.75)
    return simulation.run(participants or HEAD_ON, time_limit_s=time_limit_s)


# --- frames ------------------------------------------------------------------------------------------------------
metres = st.floats(-500, 500)


@given(metres, metres, st.floats(-10, 10), metres, metres)
def test_points_of_a_body_are_where_carlas_transform_puts_them(
    x: float, y: float, heading: float, ahead: float, left: float
) -> None:
    pose = Pose(x, y, heading, 1.5)
    transform = transform_to_carla(carla, pose)
    theirs = transform.transform(carla.Location(ahead, -left, 0.0))  # CARLA's body axes: x ahead, y to the right
    assert location_from_carla(theirs.x, theirs.y) == pytest.approx(pose.to_world(np.array([ahead, left])), abs=2e-3)
    assert transform.location.z == pytest.approx(1.5)


@given(metres, metres, st.floats(-10, 10))
def test_headings_are_carlas_forward_vectors(x: float, y: float, heading: float) -> None:
    pose = Pose(x, y, heading)
    forward = transform_to_carla(carla, pose).get_forward_vector()
    assert location_from_carla(forward.x, forward.y) == pytest.approx(pose.forward, abs=1e-5)
    again = pose_from_carla(transform_to_carla(carla, pose))
    assert wrap_angle(again.heading_rad - heading) == pytest.approx(0.0, abs=1e-5)
    assert heading_from_carla(heading_to_carla(heading)) == pytest.approx(wrap_angle(heading), abs=1e-9)
    assert location_from_carla(*location_to_carla(x, y)) == (x, y)


# --- a run -------------------------------------------------------------------------------------------------------
def test_a_head_on_crash_runs_and_its_log_is_like_any_other() -> None:
    log = run(StandIn())
    contact = log.first_contact
    assert contact is not None
    assert log.backend == "carla"
    assert log.termination is Termination.AT_REST
    boxes = (log.bodies[1].length_m + log.bodies[2].length_m) / 2
    assert contact.time_s == pytest.approx((85.0 - boxes) / 27.0, abs=0.01)
    assert contact.closing_speed_mps == pytest.approx(27.0, rel=0.01)
    assert contact.x_m == pytest.approx(-45.0 + 15.0 * contact.time_s + log.bodies[1].length_m / 2, abs=0.1)
    assert (contact.number_1, contact.number_2) == (1, 2)
    assert contact.impulse_ns > 0
    assert contact.delta_v_1_mps[0] == pytest.approx(-contact.delta_v_2_mps[0], rel=0.05)
    assert log.vehicles[0].x_m[0] == pytest.approx(-45.0, abs=1e-3)
    assert log.vehicles[0].speed_mps[0] == pytest.approx(15.0, abs=1e-3)
    (again,) = logs_from_files(*logs_to_files([log]))
    assert again.contacts == log.contacts


def test_an_object_that_is_struck_after_a_contact_stays_out() -> None:
    """CARLA's props neither break nor yield; of one vehicle alone the object is the crash, and it is refused."""
    kind = KINDS[42]
    tree = FixedObject(
        2003, 3, 42, kind.name, Pose(0.0, -8.0, 0.0), kind.length_m, kind.width_m, kind.height_m, kind.resistance
    )
    simulation = CarlaBackend(SETTINGS, StandIn()).load(NETWORK, XODR, friction=0.75)
    log = simulation.run(HEAD_ON, time_limit_s=20.0, objects=(tree,))
    assert len(log.meetings) == 1
    assert log.objects == ()
    with pytest.raises(UserError, match="tree"):
        simulation.run(HEAD_ON[:1], time_limit_s=20.0, objects=(tree,))


ADULT, CHILD = person_body(BodyKind.PEDESTRIAN), person_body(BodyKind.PEDESTRIAN, 6)


def crossing(person: Body = ADULT) -> tuple[Participant, Participant]:
    """A car at 15 m/s whose middle is at x = 0 after 3 s, and a pedestrian who crosses there at 1.4 m/s."""
    return participant(1, straight(-45.0, 0.0, 0.0, 15.0)), participant(
        1001, straight(0.0, -1.4 * 3.0, math.pi / 2, 1.4), person
    )


def test_a_walker_crosses_as_planned_and_stands_where_a_vehicle_touches_it() -> None:
    """Nothing throws it and the vehicle loses nothing: so it is with CARLA's walkers."""
    module = StandIn()
    log = run(module, *crossing())
    contact = log.first_contact
    assert contact is not None
    assert (contact.number_1, contact.number_2) == (1, 1001)
    front_m = log.bodies[1].length_m / 2 + log.bodies[1001].length_m / 2
    assert contact.time_s == pytest.approx((45.0 - front_m) / 15.0, abs=0.03)
    assert contact.closing_speed_mps == pytest.approx(15.0, rel=0.02)
    assert math.hypot(*contact.delta_v_1_mps) < 0.05
    _, walker = log.vehicles
    before = (walker.time_s > 0.1) & (walker.time_s < contact.time_s)
    assert walker.y_m[before] == pytest.approx(-4.2 + 1.4 * walker.time_s[before], abs=0.05)
    assert walker.z_m[before] == pytest.approx(0.0, abs=0.05)  # on the road, though its origin is in its middle
    assert walker.speed_mps[-1] == 0.0
    assert math.dist((walker.x_m[-1], walker.y_m[-1]), contact.pose_2.xy_m) < 0.2
    assert log.bodies[1001].kind is BodyKind.PEDESTRIAN
    assert log.termination is Termination.AT_REST
    assert not module.world.actors


def test_the_driver_brakes_a_reaction_time_after_the_strike() -> None:
    log = run(StandIn(), *crossing())
    car, struck_s = log.vehicles[0], log.contacts[0].time_s
    braking = car.time_s[car.brake > 0.5]
    assert braking[0] == pytest.approx(struck_s + SETTINGS.reaction_s, abs=0.1)
    assert car.brake[-1] == pytest.approx(SETTINGS.braking_share)
    assert car.speed_mps[-1] < 0.1
    one, two = crossing()
    log = run(StandIn(), replace(one, after_striking=AfterStriking(math.inf, 0.0)), two)
    assert log.vehicles[0].x_m[-1] > 100.0  # who leaves drives the plan to its end


def test_children_are_children_and_cyclists_ride_bicycles() -> None:
    module = StandIn()
    cyclist = participant(1001, straight(-6.0, 0.2, 0.0, 5.0), person_body(BodyKind.CYCLIST))
    child = participant(1002, straight(30.0, 30.0, 0.0, 0.0, until_s=0.0), CHILD)
    log = run(module, participant(1, straight(-60.0, 0.0, 0.0, 18.0)), cyclist, child)
    spawned = [call.arguments[0] for call in module.named("try_spawn_actor")]
    assert spawned == ["vehicle.tesla.model3", "vehicle.bh.crossbike", "walker.pedestrian.0011"]
    assert (log.contacts[0].number_1, log.contacts[0].number_2) == (1, 1001)
    assert log.bodies[1001].kind is BodyKind.CYCLIST
    assert log.contacts[0].delta_v_2_mps[0] > 1.0  # a bicycle is a vehicle to CARLA: it is pushed


def test_nobody_is_left_behind_where_a_walker_cannot_be_spawned() -> None:
    module = StandIn()
    inside = participant(1001, straight(-45.0, 0.0, 0.0, 1.4), ADULT)
    with pytest.raises(Failure, match=r"could not spawn pedestrian 1001 \(walker.pedestrian.0001\)"):
        run(module, crossing()[0], inside)
    assert left_clean(module)


def test_a_vehicle_is_carried_along_its_plan() -> None:
    bend = driven(0.0, 0.0, 0.4, lambda _: 8.0, lambda s: 1 / 20 if 20 < s < 50 else 0.0, until_s=7.0)
    log = run(StandIn(), participant(1, bend), participant(2, straight(300.0, 300.0, 0.0, 5.0, until_s=7.0)))
    distance, speed_error = tracking_errors(bend, log.vehicles[0], 7.0)
    assert np.percentile(distance, 99) < 0.25
    assert np.percentile(speed_error, 99) < 0.4
    assert log.vehicles[0].steer_rad.max() > 0.1  # wheels turned left, as the plan does


def test_the_server_is_asked_for_what_it_needs() -> None:
    module = StandIn()
    run(module, participant(1, straight(-45.0, 0.0, 0.0, 15.0)), participant(2, straight(40, 0, math.pi, 12.0), TRUCK))
    (built,) = module.named("generate_opendrive_world")
    assert built.arguments[0] == XODR.decode()
    assert built.arguments[1].wall_height == 0.0
    spawned = module.named("try_spawn_actor")
    assert [call.arguments[0] for call in spawned] == ["vehicle.tesla.model3", "vehicle.carlamotors.firetruck"]
    assert (spawned[0].arguments[1].location.x, spawned[0].arguments[1].location.y) == pytest.approx((-45.0, 0.0))
    assert abs(spawned[1].arguments[1].rotation.yaw) == pytest.approx(180.0)
    assert [call.arguments for call in module.named("apply_physics_control")] == [(1500.0, 3.5), (12000.0, 3.5)]
    synchronous = module.named("apply_settings")[0].arguments
    assert synchronous == (True, pytest.approx(0.02))
    assert len([call for call in module.named("spawn_actor") if call.arguments[0] == "sensor.other.collision"]) == 2
    assert module.world.spectator_transform.rotation.pitch == -90.0
    steering = [call.arguments[0].steer for call in module.named("apply_control")]
    assert all(-1.0 <= steer <= 1.0 for steer in steering)


def test_slippery_roads_reach_the_tyres() -> None:
    module = StandIn()
    simulation = CarlaBackend(SETTINGS, module).load(NETWORK, XODR, friction=0.3)
    simulation.run(HEAD_ON, time_limit_s=6.0)
    assert module.named("apply_physics_control")[0].arguments[1] == pytest.approx(3.5 * 0.3 / 0.75)


def left_clean(module: StandIn) -> bool:
    return not module.world.actors and not module.world.sensors and not module.world.settings.synchronous_mode


def test_nothing_is_left_behind() -> None:
    module = StandIn()
    run(module)
    assert left_clean(module)
    assert len(module.named("destroy")) == 2
    assert len(module.named("stop")) == 2


@pytest.mark.parametrize(
    ("call", "which"),
    [
        ("apply_settings", 1),
        ("try_spawn_actor", 1),
        ("try_spawn_actor", 2),
        ("get_physics_control", 1),
        ("apply_physics_control", 2),
        ("tick", 1),
        ("tick", 11),
        ("tick", 41),
        ("set_transform", 1),
        ("set_target_velocity", 30),
        ("set_target_angular_velocity", 2),
        ("apply_control", 60),
        ("get_snapshot", 3),
        ("spawn_actor", 2),
        ("listen", 1),
    ],
)
@pytest.mark.parametrize("error", [RuntimeError(TIME_OUT), KeyboardInterrupt()], ids=["time-out", "Ctrl-C"])
def test_nothing_is_left_behind_wherever_a_run_breaks(call: str, which: int, error: BaseException) -> None:
    module = StandIn()
    module.breaks = call, which, error
    with pytest.raises(TransientFailure if isinstance(error, RuntimeError) else KeyboardInterrupt):
        run(module)
    # A vehicle whose spawning breaks within the call itself is known to the server alone.
    unknown = call == "try_spawn_actor"
    assert len(module.world.actors) == (1 if unknown else 0)
    assert not module.world.sensors
    assert not module.world.settings.synchronous_mode


@pytest.mark.parametrize("call", ["stop", "destroy_sensor", "destroy"])
def test_cleaning_up_goes_on_where_a_part_of_it_breaks(call: str) -> None:
    module = StandIn()
    module.breaks = call, 1, RuntimeError(TIME_OUT)
    with pytest.raises(TransientFailure, match="cleaning up"):
        run(module)
    assert left_clean(module)


def test_settings_of_before_are_the_settings_after() -> None:
    """Of a server that another client runs in synchronous mode."""
    module = StandIn()
    simulation = CarlaBackend(SETTINGS, module).load(NETWORK, XODR, friction=0.75)
    module.world.apply_settings(carla.WorldSettings(synchronous_mode=True, fixed_delta_seconds=0.1))
    simulation.run(HEAD_ON, time_limit_s=5.0)
    assert module.world.settings.synchronous_mode
    assert module.world.settings.fixed_delta_seconds == pytest.approx(0.1)


def test_a_vehicle_that_is_gone_is_reported() -> None:
    module = StandIn()
    simulation = CarlaBackend(SETTINGS, module).load(NETWORK, XODR, friction=0.75)
    tick = module.world.tick

    def tick_and_lose_one() -> int:
        if module.world.ticks == 50:
            list(module.world.actors.values())[1].vanish()
        return tick()

    module.world.tick = tick_and_lose_one
    with pytest.raises(Failure, match="vehicle 2 is gone"):
        simulation.run(HEAD_ON, time_limit_s=5.0)
    assert not module.world.settings.synchronous_mode


def test_sensors_may_speak_late() -> None:
    """They have their own thread: in synchronous mode too, what they saw in a tick may arrive after it."""
    at_once, late = StandIn(), StandIn()
    late.world.sensors_late = True
    contacts = [run(module).first_contact for module in (at_once, late)]
    assert contacts[1].time_s == pytest.approx(contacts[0].time_s, abs=1e-3)
    assert (contacts[1].x_m, contacts[1].y_m) == pytest.approx((contacts[0].x_m, contacts[0].y_m), abs=0.01)
    assert contacts[1].impulse_ns == pytest.approx(contacts[0].impulse_ns)


@pytest.mark.parametrize("grade", [-0.08, 0.0, 0.08])
def test_vehicles_stay_on_a_road_with_a_grade(grade: float) -> None:
    def plan(x_m: float, heading_rad: float, speed_mps: float) -> Trajectory:
        level = straight(x_m, 0.0, heading_rad, speed_mps)
        return replace(level, z_m=20.0 + grade * level.x_m)

    module = StandIn()
    module.world.road_height_m = lambda x, y: 20.0 + grade * x
    log = run(module, participant(1, plan(-60.0, 0.0, 20.0)), participant(2, plan(60.0, math.pi, 20.0)))
    assert log.first_contact is not None
    assert log.first_contact.z_m == pytest.approx(20.0 + grade * log.first_contact.x_m, abs=0.15)
    spawned = [call.arguments[1].location for call in module.named("try_spawn_actor")]
    for each, vehicle in zip(spawned, log.vehicles, strict=True):
        assert 0.0 < each.z - (20.0 + grade * each.x) < 0.5  # above the road, not in it, and not to fall far
        assert vehicle.z_m == pytest.approx(20.0 + grade * vehicle.x_m, abs=0.15)


def test_the_stand_in_refuses_what_carla_refuses() -> None:
    module = StandIn()
    world = module.Client("localhost", 2000).generate_opendrive_world(
        XODR.decode(), carla.OpendriveGenerationParameters()
    )
    blueprint = world.get_blueprint_library().find("vehicle.tesla.model3")
    vehicle = world.try_spawn_actor(blueprint, carla.Transform())
    for call, wrong in (
        (vehicle.set_target_velocity, (1.0, 0.0, 0.0)),
        (vehicle.apply_control, {"brake": 1.0}),
        (vehicle.set_transform, carla.Location()),
        (world.apply_settings, {"synchronous_mode": True}),
        (world.get_blueprint_library().find, 7),
    ):
        with pytest.raises(TypeError, match=r"did not match C\+\+ signature"):
            call(wrong)
    with pytest.raises(RuntimeError, match="time-out"):
        world.tick()  # in asynchronous mode
    assert vehicle.destroy()
    assert not vehicle.destroy()
    with pytest.raises(RuntimeError, match="destroyed actor"):
        vehicle.get_transform()


def test_nothing_is_left_behind_when_a_vehicle_cannot_be_spawned() -> None:
    module = StandIn()
    with pytest.raises(Failure, match="could not spawn vehicle 2"):
        run(module, HEAD_ON[0], participant(2, straight(-44.0, 0.0, 0.0, 1.0)))
    assert left_clean(module)


def test_runs_that_do_not_collide_say_so() -> None:
    log = run(
        StandIn(), HEAD_ON[0], participant(2, straight(40.0, 30.0, math.pi, 12.0, until_s=3.0)), time_limit_s=15.0
    )
    assert log.termination is Termination.NO_CONTACT
    assert log.contacts == ()
    log = run(StandIn(), time_limit_s=1.0)
    assert log.termination is Termination.NO_CONTACT


def test_plans_nobody_can_drive_are_refused_before_anything_is_spawned() -> None:
    module = StandIn()
    plan = HEAD_ON[0].trajectory
    broken = replace(HEAD_ON[0], trajectory=replace(plan, x_m=plan.x_m * np.nan))
    with pytest.raises(Failure, match="finite"):
        run(module, broken, HEAD_ON[1])
    assert not module.named("try_spawn_actor")


# --- connections -------------------------------------------------------------------------------------------------
@pytest.mark.parametrize(
    ("server", "package", "says"),
    [
        ("0.9.13", "0.9.16", "0.9.15 and 0.9.16"),
        ("0.10.0", "0.9.16", "0.9.15 and 0.9.16"),
        ("0.9.15-dirty", "0.9.16", "install carla 0.9.15"),
    ],
)
def test_other_versions_are_refused(server: str, package: str, says: str) -> None:
    with pytest.raises(Failure, match=says):
        CarlaBackend(SETTINGS, StandIn(server=server, package=package)).load(NETWORK, XODR, friction=0.75)


def test_a_server_that_does_not_answer_may_answer_later() -> None:
    module = StandIn()
    module.connects = False
    with pytest.raises(TransientFailure, match=r"127\.0\.0\.1:2000"):
        CarlaBackend(SETTINGS, module).load(NETWORK, XODR, friction=0.75)


def test_one_connection_serves_a_batch() -> None:
    module = StandIn()
    backend = CarlaBackend(SETTINGS, module)
    for _ in range(3):
        backend.load(NETWORK, XODR, friction=0.75)
    backend.close()
    backend.close()
    assert len(module.named("Client")) == 1


def test_without_the_package_the_message_names_what_to_install(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(__import__("sys").modules, "carla", None)
    with pytest.raises(UserError, match=r"trace-dag\[carla\]"):
        CarlaBackend(SETTINGS).load(NETWORK, XODR, friction=0.75)


# --- blueprints --------------------------------------------------------------------------------------------------
ALL = [blueprint.id for blueprint in BLUEPRINTS]


@pytest.mark.parametrize("vehicle_class", [each for each in VehicleClass if each is not VehicleClass.TRAILER])
def test_every_class_has_a_vehicle_of_its_kind(vehicle_class: VehicleClass) -> None:
    chosen = choose_blueprint(replace(CAR, vehicle_class=vehicle_class), ALL)
    assert vehicle_class in chosen.classes or vehicle_class is VehicleClass.OTHER


def test_size_decides_within_a_class() -> None:
    small, large = replace(CAR, length_m=3.6, width_m=1.8), replace(CAR, length_m=5.3, width_m=2.0)
    assert choose_blueprint(small, ALL).length_m < 4.0
    assert choose_blueprint(large, ALL).length_m > 5.0


def test_an_unknown_library_is_a_failure() -> None:
    with pytest.raises(Failure, match="none of the"):
        choose_blueprint(CAR, ["vehicle.of.somebody"])


@pytest.mark.live
def test_a_real_server_runs_a_crash() -> None:
    """With CARLA at TRACE_DAG_SIM__CARLA_HOST, on one straight road of our own writing."""
    from tests.verdict.crashes import STREET
    from trace_dag.roads.map.writer import write_opendrive

    backend = CarlaBackend(SETTINGS)
    crash = (
        participant(1, straight(-45.0, -1.75, 0.0, 15.0)),
        participant(2, straight(40.0, -1.5, math.pi, 12.0)),
    )
    log = backend.load(STREET, write_opendrive(STREET), friction=0.75).run(crash, time_limit_s=20.0)
    assert log.first_contact is not None
    for each in crash:
        vehicle = next(v for v in log.vehicles if v.number == each.number)
        distance, _ = tracking_errors(each.trajectory, vehicle, log.first_contact.time_s)
        assert np.percentile(distance, 99) < 0.25
