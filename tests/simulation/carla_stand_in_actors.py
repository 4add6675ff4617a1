"""The actors of the stand-in world: vehicles that move by target velocities and brakes on a road, walkers, sensors."""

from __future__ import annotations

import math
from collections.abc import Callable
from types import SimpleNamespace
from typing import TYPE_CHECKING, Any

import carla

from trace_dag.carla.frame import pose_from_carla
from trace_dag.common.units import GRAVITY_MPS2
from trace_dag.simulation.outlines import Outline

if TYPE_CHECKING:
    from tests.simulation.carla_stand_in import World

BOXES = {  # length, width, height, and the box's centre ahead of the actor's origin
    "vehicle.tesla.model3": (4.79, 2.16, 1.49, 0.02),
    "vehicle.audi.etron": (4.86, 2.03, 1.65, 0.05),
    "vehicle.carlamotors.firetruck": (8.47, 2.89, 3.83, 0.4),
    "vehicle.kawasaki.ninja": (2.03, 0.80, 1.45, 0.0),
    "vehicle.bh.crossbike": (1.49, 0.86, 1.61, 0.0),
}
WALKERS = {  # length, width, height; the origin is in the middle of the body
    "walker.pedestrian.0001": (0.38, 0.38, 1.86),
    "walker.pedestrian.0011": (0.50, 0.50, 1.10),
}
BRAKING_MPS2 = 7.0


class ArgumentError(TypeError):
    """What Boost.Python raises for arguments that fit no C++ signature."""


def require(call: str, *arguments: tuple[Any, type | tuple[type, ...]]) -> None:
    """Refuse arguments of other types than a signature's; whole numbers pass as floats, numbers never as booleans."""
    for value, kind in arguments:
        fits = isinstance(value, (int, float)) if kind is float else isinstance(value, kind)
        if not fits or (kind in (int, float) and isinstance(value, bool)):
            raise ArgumentError(
                f"Python argument types in {call}(..., {type(value).__name__}) did not match C++ signature"
            )


class Blueprint:
    def __init__(self, blueprint_id: str) -> None:
        self.id = blueprint_id


class _Actor:
    def __init__(self, world: World, actor_id: int) -> None:
        self.world, self.id = world, actor_id
        self.is_alive = True

    def living(self) -> None:
        """Every function of a destroyed actor ends in this."""
        if not self.is_alive:
            raise RuntimeError(
                "trying to operate on a destroyed actor; an actor's function was called, but the actor is already "
                "destroyed."
            )

    def _call(self, name: str, *arguments: Any) -> None:
        self.living()
        self.world.module.note(name, self.id, *arguments)


class _Mover(_Actor):
    """What moves on the road. Where it is, is known as of the last tick."""

    bounding_box: Any

    def __init__(self, world: World, actor_id: int, type_id: str, transform: Any) -> None:
        super().__init__(world, actor_id)
        self.type_id = type_id
        self.transform = transform
        self.velocity, self.angular_velocity = carla.Vector3D(), carla.Vector3D()
        self.seen: Any = None

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

    # --- what is asked of it: as of the last tick, nothing before the first -------------------------------------
    def get_transform(self) -> Any:
        self.living()
        return carla.Transform() if self.seen is None else self.seen.get_transform()

    def get_velocity(self) -> Any:
        self.living()
        return carla.Vector3D() if self.seen is None else self.seen.get_velocity()

    def show(self) -> None:
        at, turned = self.transform.location, self.transform.rotation
        v, w = self.velocity, self.angular_velocity
        self.seen = SimpleNamespace(
            id=self.id,
            get_transform=lambda: carla.Transform(
                carla.Location(at.x, at.y, at.z), carla.Rotation(turned.pitch, turned.yaw, turned.roll)
            ),
            get_velocity=lambda: carla.Vector3D(v.x, v.y, v.z),
            get_angular_velocity=lambda: carla.Vector3D(w.x, w.y, w.z),
        )

    # --- what every actor is told -----------------------------------------------------------------------
    def set_transform(self, transform: Any) -> None:
        require("Actor.set_transform", (transform, carla.Transform))
        self._call("set_transform", transform)
        self.transform = transform

    def destroy(self) -> bool:
        if not self.is_alive:
            return False
        self.is_alive = False
        known = self.world.actors.pop(self.id, None) is not None
        self.world.module.note("destroy", self.id)
        return known

    def vanish(self) -> None:
        """Removed by the server or another client: this client's actor does not know."""
        self.world.actors.pop(self.id)


class Vehicle(_Mover):
    def __init__(self, world: World, actor_id: int, type_id: str, transform: Any) -> None:
        super().__init__(world, actor_id, type_id, transform)
        self.control = carla.VehicleControl()
        self.physics = carla.VehiclePhysicsControl()
        self.physics.wheels = [carla.WheelPhysicsControl(tire_friction=3.5, max_steer_angle=70.0) for _ in range(4)]
        length, width, height, ahead = BOXES[type_id]
        self.bounding_box = carla.BoundingBox(
            carla.Location(ahead, 0.0, height / 2), carla.Vector3D(length / 2, width / 2, height / 2)
        )
        self._targeted = False

    def get_physics_control(self) -> Any:
        self._call("get_physics_control")
        copy = carla.VehiclePhysicsControl()
        copy.mass, copy.wheels = self.physics.mass, self.physics.wheels
        return copy

    # --- what it is told -----------------------------------------------------------------------------------------
    def apply_physics_control(self, control: Any) -> None:
        require("Vehicle.apply_physics_control", (control, carla.VehiclePhysicsControl))
        self._call("apply_physics_control", control.mass, control.wheels[0].tire_friction)
        self.physics = control

    def apply_control(self, control: Any) -> None:
        require("Vehicle.apply_control", (control, carla.VehicleControl))
        self._call("apply_control", control)
        self.control = control

    def set_target_velocity(self, velocity: Any) -> None:
        require("Actor.set_target_velocity", (velocity, carla.Vector3D))
        self._call("set_target_velocity", velocity)
        self.velocity = carla.Vector3D(velocity.x, velocity.y, velocity.z)
        self._targeted = True

    def set_target_angular_velocity(self, velocity: Any) -> None:
        require("Actor.set_target_angular_velocity", (velocity, carla.Vector3D))
        self._call("set_target_angular_velocity", velocity)
        self.angular_velocity = velocity

    # --- time ------------------------------------------------------------------------------------------------
    def advance(self, step_s: float) -> None:
        v = self.velocity
        if not self._targeted:
            speed = math.hypot(v.x, v.y)
            slower = max(0.0, speed - BRAKING_MPS2 * self.control.brake * step_s)
            scale = slower / speed if speed else 0.0
            v = carla.Vector3D(v.x * scale, v.y * scale, v.z)
            self.angular_velocity = carla.Vector3D()
        self._targeted = False
        at, rotation = self.transform.location, self.transform.rotation
        climb = v.z - GRAVITY_MPS2 * step_s  # gravity acts whatever velocity was set
        x, y = at.x + v.x * step_s, at.y + v.y * step_s
        road, falling = self.world.road_height_m(x, -y), at.z + climb * step_s
        self.velocity = carla.Vector3D(v.x, v.y, 0.0 if falling <= road else climb)
        self.transform = carla.Transform(
            carla.Location(x, y, max(road, falling)),
            carla.Rotation(rotation.pitch, rotation.yaw + self.angular_velocity.z * step_s, rotation.roll),
        )


class Walker(_Mover):
    """Walks as it is told, on the road, at once; nothing throws it."""

    def __init__(self, world: World, actor_id: int, type_id: str, transform: Any) -> None:
        super().__init__(world, actor_id, type_id, transform)
        self.control = carla.WalkerControl()
        length, width, height = WALKERS[type_id]
        self.bounding_box = carla.BoundingBox(
            carla.Location(0.0, 0.0, 0.0), carla.Vector3D(length / 2, width / 2, height / 2)
        )

    def apply_control(self, control: Any) -> None:
        require("Walker.apply_control", (control, carla.WalkerControl))
        self._call("apply_control", control)
        self.control = control

    def advance(self, step_s: float) -> None:
        way, speed = self.control.direction, self.control.speed
        self.velocity = carla.Vector3D(way.x * speed, way.y * speed, 0.0)
        at, rotation = self.transform.location, self.transform.rotation
        x, y = at.x + self.velocity.x * step_s, at.y + self.velocity.y * step_s
        z = self.world.road_height_m(x, -y) + self.bounding_box.extent.z
        yaw = math.degrees(math.atan2(way.y, way.x)) if speed > 0 else rotation.yaw
        self.transform = carla.Transform(carla.Location(x, y, z), carla.Rotation(0.0, yaw, 0.0))


class Sensor(_Actor):
    def __init__(self, world: World, parent: Vehicle | Walker) -> None:
        super().__init__(world, -parent.id)
        self.parent = parent
        self.callback: Callable[[Any], None] | None = None

    def listen(self, callback: Callable[[Any], None]) -> None:
        self.living()
        self.world.module.note("listen", self.parent.id)
        self.callback = callback

    def stop(self) -> None:
        self.living()
        self.world.module.note("stop", self.parent.id)
        self.callback = None

    def destroy(self) -> bool:
        if not self.is_alive:
            return False
        assert self.parent.is_alive, "a sensor is destroyed before the vehicle it is attached to"
        self.is_alive, self.callback = False, None
        self.world.sensors.remove(self)
        self.world.module.note("destroy_sensor", self.parent.id)
        return True
