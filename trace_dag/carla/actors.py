"""A vehicle, bicycle or walker in CARLA: spawned, moved along its plan, released at the first contact, and logged.

CARLA's walkers are moved by a character controller. They take part in no collision: a vehicle's sensor detects the
contact, but the person is not thrown and the vehicle loses no speed. So a run shows the parties, place, time and speed
of a strike; only the embedded back-end simulates its effect.
"""

from __future__ import annotations

import math
from contextlib import suppress
from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np

from trace_dag.carla.frame import (
    location_from_carla,
    location_to_carla,
    pose_from_carla,
    transform_to_carla,
    yaw_rate_from_carla,
    yaw_rate_to_carla,
)
from trace_dag.common.errors import Failure
from trace_dag.common.geometry import Pose
from trace_dag.scenario.carla_blueprints import choose_bicycle, choose_blueprint, choose_walker
from trace_dag.simulation.driving import BodyState, Pedals
from trace_dag.simulation.outlines import Outline, separation
from trace_dag.simulation.plan import SampledTrajectory, resample
from trace_dag.simulation.types import Body, BodyKind, Participant, VehicleLog, party_name

SPAWN_ABOVE_M = 0.3
POSITION_GAIN = 4.0  # 1/s: target velocity for each metre off the plan
_HEADING_GAIN = 4.0  # 1/s
_STANDARD_FRICTION = 0.75  # that CARLA's default tyres stand for
_REST_MPS = 0.1
_CRUISE_THROTTLE = 0.3
_STANDARD_MAX_STEER_RAD = math.radians(70.0)
_WHEELBASE = 0.6  # of the length


@dataclass(eq=False)
class CarlaActor:
    """A vehicle of the server that represents a participant, with its observed states, one row per tick.

    For CARLA a bicycle with its rider is a vehicle, one body.

    ``rows``: x, y, z (m), heading (rad), velocity x, y (m/s), yaw rate (rad/s), steering (rad), throttle, brake; of the
    centre of its bounding box, in the local frame.
    """

    carla: Any
    world: Any
    participant: Participant
    plan: SampledTrajectory
    actor: Any
    body: Body
    step_s: float
    max_steer_rad: float
    sensor: Any = None
    crashed: bool = False
    brakes_from_tick: float = math.inf
    """When its driver, who has struck a person, begins to brake."""
    steer: float = 0.0
    throttle: float = 0.0
    brake: float = 0.0
    rows: list[tuple[float, ...]] = field(default_factory=list)

    @classmethod
    def spawn(
        cls, carla: Any, world: Any, participant: Participant, *, friction: float, step_s: float, time_limit_s: float
    ) -> CarlaActor:
        """Spawn the blueprint most similar to the participant at its start, with its mass and the road's friction.

        Raises :class:`Failure` if its place is taken or no road is under it.
        """
        library = world.get_blueprint_library()
        available = [entry.id for entry in library]
        rides = participant.body.kind is BodyKind.CYCLIST
        name = choose_bicycle(available) if rides else choose_blueprint(participant.body, available).id
        pose = participant.initial_pose
        actor = world.try_spawn_actor(library.find(name), transform_to_carla(carla, pose, SPAWN_ABOVE_M))
        if actor is None:
            raise Failure(
                f"CARLA could not spawn {party_name(participant.body, participant.number)} ({name}) at "
                f"x {pose.x_m:.1f} m, y {pose.y_m:.1f} m: something is in its place or there is no road under it"
            )
        try:
            return cls._with_physics(carla, world, participant, actor, friction, step_s, time_limit_s)
        except BaseException:
            with suppress(RuntimeError):  # the server may be gone
                actor.destroy()
            raise

    @classmethod
    def _with_physics(
        cls,
        carla: Any,
        world: Any,
        participant: Participant,
        actor: Any,
        friction: float,
        step_s: float,
        time_limit_s: float,
    ) -> CarlaActor:
        control = actor.get_physics_control()
        control.mass = participant.body.mass_kg
        wheels = control.wheels
        for wheel in wheels:
            wheel.tire_friction *= friction / _STANDARD_FRICTION
        control.wheels = wheels
        actor.apply_physics_control(control)
        return cls(
            carla=carla,
            world=world,
            participant=participant,
            plan=resample(participant.trajectory, step_s, time_limit_s, 0.0),
            actor=actor,
            body=_body_in_carla(participant.body, actor),
            step_s=step_s,
            max_steer_rad=max(
                (math.radians(wheel.max_steer_angle) for wheel in wheels if wheel.max_steer_angle > 0),
                default=_STANDARD_MAX_STEER_RAD,
            ),
        )

    @property
    def number(self) -> int:
        """Return the participant's number."""
        return self.participant.number

    @property
    def _ahead_m(self) -> float:
        """Return the box's centre ahead of the actor's own origin."""
        return float(self.actor.bounding_box.location.x)

    def outline(self, tick: int) -> Outline:
        """Return the body's outline as seen after a tick."""
        x, y, _, heading = self.rows[tick][:4]
        return Outline(x, y, heading, self.body.length_m / 2, self.body.width_m / 2)

    def meets(self, other: CarlaActor) -> bool:
        """Return whether the two boxes overlap, as last seen."""
        one_z, two_z = self.rows[-1][2], other.rows[-1][2]
        same_level = one_z < two_z + other.body.height_m and two_z < one_z + self.body.height_m
        return same_level and separation(self.outline(-1), other.outline(-1))[0] <= 0

    def velocity(self, tick: int) -> tuple[float, float]:
        """Return the velocity x, y as seen after a tick."""
        return self.rows[tick][4], self.rows[tick][5]

    def plan_is_over(self, tick: int) -> bool:
        """Return whether the plan has ended at a tick."""
        return tick >= len(self.plan) and self.plan.end_s > 0

    def at_rest(self, tick: int) -> bool:
        """Return whether the vehicle stands still and no plan will move it again."""
        undriven = self.crashed or tick >= min(len(self.plan), self.brakes_from_tick)
        return undriven and math.hypot(*self.velocity(-1)) < _REST_MPS

    # --- control ---------------------------------------------------------------------------------------------
    def hold(self) -> None:
        """Brake with all wheels."""
        self.actor.apply_control(self.carla.VehicleControl(brake=1.0, hand_brake=True))

    def put_at_start(self) -> None:
        """Move the settled vehicle one step before its start, so that the next tick brings it there at its speed.

        It keeps the height, pitch and roll at which it settled on the road.
        """
        settled = self.actor.get_transform()
        z_m = settled.location.z - self._climb_mps(0) * self.step_s
        placed = transform_to_carla(self.carla, self._a_step_before(self._ahead_m, z_m))
        placed.rotation.pitch, placed.rotation.roll = settled.rotation.pitch, settled.rotation.roll
        self.actor.set_transform(placed)
        self.actor.apply_control(self.carla.VehicleControl())
        self.carry(0)

    def _a_step_before(self, ahead_m: float, z_m: float) -> Pose:
        """Return the pose, one step before the start, of an origin that is some way behind the body's centre."""
        start = self.participant.initial_pose
        back_m = ahead_m + self.participant.initial_speed_mps * self.step_s
        x_m = start.x_m - back_m * math.cos(start.heading_rad)
        y_m = start.y_m - back_m * math.sin(start.heading_rad)
        return Pose(x_m, y_m, start.heading_rad, z_m)

    def _climb_mps(self, tick: int) -> float:
        """Return the vertical speed of the planned position over the next tick, m/s, positive uphill."""
        last = len(self.plan) - 1
        here, there = min(tick, last), min(tick + 1, last)
        return (self.plan.row(there)[9] - self.plan.row(here)[9]) / self.step_s

    def carry(self, tick: int) -> None:
        """Set the target velocities of the plan at a tick, and steer the wheels to match them.

        The vertical velocity follows the road; without it the vehicle would float where the road falls.
        """
        last = len(self.plan) - 1
        _, _, vx, vy, _, _, speed, curvature, _, _ = self.plan.row(min(tick, last))
        off_x = off_y = turn = 0.0
        if self.rows:
            before = self.plan.row(min(max(tick - 1, 0), last))
            off_x, off_y = before[0] - self.rows[-1][0], before[1] - self.rows[-1][1]
            turn = math.remainder(before[8] - self.rows[-1][3], math.tau)
        x, y = location_to_carla(vx + POSITION_GAIN * off_x, vy + POSITION_GAIN * off_y)
        yaw_rate = yaw_rate_to_carla(curvature * speed + _HEADING_GAIN * turn)
        self.actor.set_target_velocity(self.carla.Vector3D(x, y, self._climb_mps(tick)))
        self.actor.set_target_angular_velocity(self.carla.Vector3D(0.0, 0.0, yaw_rate))
        self.steer = math.atan(_WHEELBASE * self.body.length_m * curvature)
        self.throttle, self.brake = (_CRUISE_THROTTLE, 0.0) if abs(speed) > _REST_MPS else (0.0, 1.0)
        self._apply_control(reverse=speed < 0)

    def obey(self, pedals: Pedals) -> None:
        """Apply a driver's pedals and steering through CARLA's own vehicle control."""
        self.steer = max(-self.max_steer_rad, min(self.max_steer_rad, pedals.steer_rad))
        self.throttle = max(0.0, min(1.0, pedals.throttle))
        self.brake = max(0.0, min(1.0, pedals.brake))
        self._apply_control(reverse=pedals.reverse)

    def _apply_control(self, *, reverse: bool) -> None:
        to_the_right = max(-1.0, min(1.0, -self.steer / self.max_steer_rad))
        control = self.carla.VehicleControl(
            throttle=self.throttle, steer=to_the_right, brake=self.brake, reverse=reverse
        )
        self.actor.apply_control(control)

    def let_go(self, brake: float) -> None:
        """Release the vehicle: from now on it only brakes, with ``brake`` as a share of full brakes."""
        self.steer = self.throttle = 0.0
        self.brake = brake
        self.actor.apply_control(self.carla.VehicleControl(brake=self.brake))

    def dispose(self) -> list[Any]:
        """Return the calls that remove the actor and its sensors, in order."""
        sensor = [] if self.sensor is None else [self.sensor.stop, self.sensor.destroy]
        return [*sensor, self.actor.destroy]

    # --- what is seen ----------------------------------------------------------------------------------------
    def observe(self) -> None:
        """Keep the state after a tick."""
        seen = self.world.get_snapshot().find(self.actor.id)
        if seen is None:
            who = party_name(self.body, self.number)
            raise Failure(f"{who} is gone from CARLA's world: it fell off the map, or another client removed it")
        origin = pose_from_carla(seen.get_transform())
        velocity = seen.get_velocity()
        vx, vy = location_from_carla(velocity.x, velocity.y)
        yaw_rate = yaw_rate_from_carla(seen.get_angular_velocity().z)
        ahead_x, ahead_y = self._ahead_m * math.cos(origin.heading_rad), self._ahead_m * math.sin(origin.heading_rad)
        box = self.actor.bounding_box
        self.rows.append(
            (
                origin.x_m + ahead_x,
                origin.y_m + ahead_y,
                origin.z_m + box.location.z - box.extent.z,
                origin.heading_rad,
                vx - yaw_rate * ahead_y,
                vy + yaw_rate * ahead_x,
                yaw_rate,
                self.steer,
                self.throttle,
                self.brake,
            )
        )

    def body_state(self) -> BodyState:
        """Return the state as last seen."""
        x, y, z, heading, vx, vy, yaw_rate = self.rows[-1][:7]
        return BodyState(self.number, x, y, z, heading, vx, vy, yaw_rate)

    def log(self, step_s: float) -> VehicleLog:
        """Return the log of all ticks; acceleration is the mean over the step that ends at each."""
        x, y, z, heading, vx, vy, yaw_rate, steer, throttle, brake = np.array(self.rows, np.float64).T
        ahead_x, ahead_y = np.cos(heading), np.sin(heading)
        acceleration = np.zeros(len(x))
        if len(x) > 1:
            acceleration[1:] = (np.diff(vx) * ahead_x[1:] + np.diff(vy) * ahead_y[1:]) / step_s
            acceleration[0] = acceleration[1]
        return VehicleLog(
            number=self.number,
            time_s=np.arange(len(x), dtype=np.float64) * step_s,
            x_m=x,
            y_m=y,
            z_m=z,
            heading_rad=heading,
            speed_mps=vx * ahead_x + vy * ahead_y,
            velocity_x_mps=vx,
            velocity_y_mps=vy,
            yaw_rate_rps=yaw_rate,
            acceleration_mps2=acceleration,
            steer_rad=steer,
            throttle=throttle,
            brake=brake,
            above_road_m=np.full(len(x), self.body.height_m / 2),
            pitch_rad=np.zeros(len(x)),
            roll_rad=np.zeros(len(x)),
            landmarks_m=np.zeros((len(x), 0)),
        ).on_grid()


def _body_in_carla(body: Body, actor: Any) -> Body:
    """Return a body with the dimensions of the actor that represents it."""
    extent = actor.bounding_box.extent
    return replace(body, length_m=2 * extent.x, width_m=2 * extent.y, height_m=2 * extent.z)


# --- people on foot --------------------------------------------------------------------------------------------------
_STANDS_MPS = 0.05


class CarlaWalker(CarlaActor):
    """A walker of the server that represents a person on foot or on a conveyance.

    Its own origin is in the middle of its body.
    """

    @classmethod
    def spawn(
        cls, carla: Any, world: Any, participant: Participant, *, friction: float, step_s: float, time_limit_s: float
    ) -> CarlaWalker:
        """Spawn the walker most similar to the person at its start; ``friction`` has no effect.

        Raises :class:`Failure` if its place is taken.
        """
        library = world.get_blueprint_library()
        name = choose_walker(participant.body, [entry.id for entry in library])
        pose = participant.initial_pose
        above_m = participant.body.height_m / 2 + SPAWN_ABOVE_M
        actor = world.try_spawn_actor(library.find(name), transform_to_carla(carla, pose, above_m))
        if actor is None:
            who = party_name(participant.body, participant.number)
            raise Failure(
                f"CARLA could not spawn {who} ({name}) at x {pose.x_m:.1f} m, y {pose.y_m:.1f} m: something is there"
            )
        return cls(
            carla=carla,
            world=world,
            participant=participant,
            plan=resample(participant.trajectory, step_s, time_limit_s, 0.0),
            actor=actor,
            body=_body_in_carla(participant.body, actor),
            step_s=step_s,
            max_steer_rad=0.0,
        )

    def hold(self) -> None:
        """Make the walker stand still."""
        self.actor.apply_control(self.carla.WalkerControl(speed=0.0))

    def put_at_start(self) -> None:
        """Move the settled walker one step short of its start."""
        origin = self._a_step_before(0.0, self.actor.get_transform().location.z)
        self.actor.set_transform(transform_to_carla(self.carla, origin))
        self.carry(0)

    def carry(self, tick: int) -> None:
        """Walk to the planned position of a tick at the planned speed; stand still at the plan's end."""
        last = len(self.plan) - 1
        here = self.plan.row(min(tick, last))
        vx, vy = (here[2], here[3]) if tick < last else (0.0, 0.0)
        if self.rows:
            before = self.plan.row(min(max(tick - 1, 0), last))
            vx += POSITION_GAIN * (before[0] - self.rows[-1][0])
            vy += POSITION_GAIN * (before[1] - self.rows[-1][1])
        speed = math.hypot(vx, vy)
        if speed < _STANDS_MPS:
            self.hold()
            return
        x, y = location_to_carla(vx / speed, vy / speed)
        self.actor.apply_control(self.carla.WalkerControl(direction=self.carla.Vector3D(x, y, 0.0), speed=speed))

    def let_go(self, brake: float) -> None:
        """Stop the walker where it was struck; CARLA does not throw it."""
        self.hold()
