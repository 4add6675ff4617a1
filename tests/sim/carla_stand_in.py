"""A world that behaves as CARLA's API does, without a server, and records every call.

Data types (Transform, Vector3D, VehicleControl, ...) are CARLA's own, from the installed package; what needs a server
is imitated: actors move by their target velocities, fall onto the road, slow down by their brakes, and boxes
that overlap exchange momentum and make both collision sensors speak.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass
from types import SimpleNamespace
from typing import Any

import carla

from trace_dag.sim.carla_frame import location_to_carla, pose_from_carla
from trace_dag.sim.outlines import Outline, separation

BOXES = {  # length, width, height, and the box's centre ahead of the actor's origin
    "vehicle.tesla.model3": (4.79, 2.16, 1.49, 0.02),
    "vehicle.audi.etron": (4.86, 2.03, 1.65, 0.05),
    "vehicle.carlamotors.firetruck": (8.47, 2.89, 3.83, 0.4),
    "vehicle.kawasaki.ninja": (2.03, 0.80, 1.45, 0.0),
}


@dataclass
class Call:
    """A call of the API: which, on which actor (None: the world's or the client's), with what."""

    name: str
    actor: int | None
    arguments: tuple[Any, ...] = ()


class StandIn:
    """In place of the ``carla`` module: its data types, and a client of this one world."""

    def __init__(self, *, server: str = "0.9.16", package: str = "0.9.16") -> None:
        self.calls: list[Call] = []
        self.world = World(self)
        self.server, self.package = server, package
        self.connects = True
        self.Transform, self.Location, self.Rotation = carla.Transform, carla.Location, carla.Rotation
        self.Vector3D, self.VehicleControl = carla.Vector3D, carla.VehicleControl
        self.OpendriveGenerationParameters = carla.OpendriveGenerationParameters

    def Client(self, host: str, port: int) -> Client:
        self.note("Client", None, host, port)
        return Client(self)

    def note(self, name: str, actor: int | None, *arguments: Any) -> None:
        self.calls.append(Call(name, actor, arguments))

    def named(self, name: str) -> list[Call]:
        return [call for call in self.calls if call.name == name]


class Client:
    def __init__(self, module: StandIn) -> None:
        self._module = module

    def set_timeout(self, seconds: float) -> None:
        self._module.note("set_timeout", None, seconds)

    def get_server_version(self) -> str:
        if not self._module.connects:
            raise RuntimeError("time-out of 60000ms while waiting for the simulator")
        return self._module.server

    def get_client_version(self) -> str:
        return self._module.package

    def generate_opendrive_world(self, opendrive: str, parameters: Any, reset_settings: bool = True) -> World:
        if "<OpenDRIVE" not in opendrive:
            raise RuntimeError("opendrive could not be correctly parsed")
        self._module.note("generate_opendrive_world", None, opendrive, parameters)
        return self._module.world


class World:
    def __init__(self, module: StandIn) -> None:
        self._module = module
        self.settings = carla.WorldSettings()
        self.actors: dict[int, Vehicle] = {}
        self.sensors: list[Sensor] = []
        self.frame = 1000
        self.fails_at_tick: int | None = None
        self.ticks = 0
        self.spectator_transform: Any = None
        self._next_id = 100

    def get_settings(self) -> Any:
        s = self.settings
        return carla.WorldSettings(
            synchronous_mode=s.synchronous_mode,
            fixed_delta_seconds=s.fixed_delta_seconds or 0.0,
            substepping=s.substepping,
            max_substep_delta_time=s.max_substep_delta_time,
            max_substeps=s.max_substeps,
        )

    def apply_settings(self, settings: Any) -> int:
        self._module.note("apply_settings", None, settings.synchronous_mode, settings.fixed_delta_seconds)
        self.settings = settings
        return self.frame

    def get_blueprint_library(self) -> Library:
        return Library()

    def get_spectator(self) -> Any:
        def place(transform: Any) -> None:
            self.spectator_transform = transform

        return SimpleNamespace(set_transform=place)

    def try_spawn_actor(self, blueprint: Any, transform: Any) -> Vehicle | None:
        vehicle = Vehicle(self._module, self, self._next_id, blueprint.id, transform)
        if any(separation(vehicle.outline(), other.outline())[0] < 0 for other in self.actors.values()):
            return None
        self._module.note("try_spawn_actor", vehicle.id, blueprint.id, transform)
        self._next_id += 1
        self.actors[vehicle.id] = vehicle
        return vehicle

    def spawn_actor(self, blueprint: Any, transform: Any, attach_to: Vehicle) -> Sensor:
        sensor = Sensor(self._module, self, attach_to)
        self._module.note("spawn_actor", attach_to.id, blueprint.id)
        self.sensors.append(sensor)
        return sensor

    def get_snapshot(self) -> Any:
        return SimpleNamespace(frame=self.frame, find=lambda actor_id: self.actors[actor_id])

    def tick(self) -> int:
        if self.fails_at_tick is not None and self.ticks >= self.fails_at_tick:
            raise RuntimeError("time-out of 60000ms while waiting for the simulator")
        if not self.settings.synchronous_mode:
            raise RuntimeError("tick() in asynchronous mode")
        self.ticks += 1
        self.frame += 1
        step_s = self.settings.fixed_delta_seconds
        for vehicle in self.actors.values():
            vehicle.advance(step_s)
        vehicles = list(self.actors.values())
        for i, one in enumerate(vehicles):
            for two in vehicles[i + 1 :]:
                gap, nx, ny = separation(one.outline(), two.outline())
                if gap < 0:
                    self._collide(one, two, nx, ny)
        return self.frame

    def _collide(self, one: Vehicle, two: Vehicle, nx: float, ny: float) -> None:
        nx, ny = location_to_carla(nx, ny)
        closing = (one.velocity.x - two.velocity.x) * nx + (one.velocity.y - two.velocity.y) * ny
        if closing <= 0:
            return
        impulse = 1.1 * closing / (1 / one.physics.mass + 1 / two.physics.mass)
        for vehicle, sign in ((one, -1.0), (two, 1.0)):
            vehicle.velocity.x += sign * impulse / vehicle.physics.mass * nx
            vehicle.velocity.y += sign * impulse / vehicle.physics.mass * ny
        for sensor in self.sensors:
            for own, other, sign in ((one, two, -1.0), (two, one, 1.0)):
                if sensor.parent is own and sensor.callback is not None:
                    sensor.callback(
                        SimpleNamespace(
                            frame=self.frame,
                            actor=own,
                            other_actor=other,
                            normal_impulse=carla.Vector3D(sign * impulse * nx, sign * impulse * ny, 0.0),
                        )
                    )


class Library:
    def __iter__(self) -> Any:
        return iter(SimpleNamespace(id=name) for name in (*BOXES, "sensor.other.collision", "walker.pedestrian.0001"))

    def find(self, name: str) -> Any:
        return SimpleNamespace(id=name)


class Vehicle:
    def __init__(self, module: StandIn, world: World, actor_id: int, type_id: str, transform: Any) -> None:
        self._module, self._world = module, world
        self.id, self.type_id = actor_id, type_id
        self.transform = transform
        self.velocity = carla.Vector3D()
        self.angular_velocity = carla.Vector3D()
        self.control = carla.VehicleControl()
        self.physics = SimpleNamespace(
            mass=1000.0, wheels=[SimpleNamespace(tire_friction=3.5, max_steer_angle=70.0) for _ in range(4)]
        )
        length, width, height, ahead = BOXES[type_id]
        self.bounding_box = carla.BoundingBox(
            carla.Location(ahead, 0.0, height / 2), carla.Vector3D(length / 2, width / 2, height / 2)
        )
        self._targeted = False

    def outline(self) -> Outline:
        pose = pose_from_carla(self.transform)
        ahead = self.bounding_box.location.x
        return Outline(
            pose.x_m + ahead * math.cos(pose.heading_rad),
            pose.y_m + ahead * math.sin(pose.heading_rad),
            pose.heading_rad,
            self.bounding_box.extent.x,
            self.bounding_box.extent.y,
        )

    def get_transform(self) -> Any:
        return self.transform

    def get_velocity(self) -> Any:
        return self.velocity

    def get_angular_velocity(self) -> Any:
        return self.angular_velocity

    def get_physics_control(self) -> Any:
        return self.physics

    def apply_physics_control(self, control: Any) -> None:
        self._module.note("apply_physics_control", self.id, control.mass, control.wheels[0].tire_friction)
        self.physics = control

    def apply_control(self, control: Any) -> None:
        self._module.note("apply_control", self.id, control)
        self.control = control

    def set_transform(self, transform: Any) -> None:
        self._module.note("set_transform", self.id, transform)
        self.transform = transform

    def set_target_velocity(self, velocity: Any) -> None:
        self._module.note("set_target_velocity", self.id, velocity)
        self.velocity = velocity
        self._targeted = True

    def set_target_angular_velocity(self, velocity: Any) -> None:
        self._module.note("set_target_angular_velocity", self.id, velocity)
        self.angular_velocity = velocity

    def destroy(self) -> bool:
        self._module.note("destroy", self.id)
        self._world.actors.pop(self.id)
        return True

    def advance(self, step_s: float) -> None:
        if not self._targeted:
            speed = math.hypot(self.velocity.x, self.velocity.y)
            slower = max(0.0, speed - 7.0 * self.control.brake * step_s)
            scale = slower / speed if speed else 0.0
            self.velocity = carla.Vector3D(self.velocity.x * scale, self.velocity.y * scale, 0.0)
            self.angular_velocity = carla.Vector3D()
        self._targeted = False
        at, rotation = self.transform.location, self.transform.rotation
        self.transform = carla.Transform(
            carla.Location(at.x + self.velocity.x * step_s, at.y + self.velocity.y * step_s, max(0.0, at.z - 0.05)),
            carla.Rotation(yaw=rotation.yaw + self.angular_velocity.z * step_s),
        )


class Sensor:
    def __init__(self, module: StandIn, world: World, parent: Vehicle) -> None:
        self._module, self._world, self.parent = module, world, parent
        self.callback: Callable[[Any], None] | None = None

    def listen(self, callback: Callable[[Any], None]) -> None:
        self.callback = callback

    def stop(self) -> None:
        self._module.note("stop", self.parent.id)
        self.callback = None

    def destroy(self) -> bool:
        self._module.note("destroy_sensor", self.parent.id)
        self._world.sensors.remove(self)
        return True
