"""A world that behaves as CARLA's API does, without a server, and records every call.

Data types (Transform, Vector3D, VehicleControl, VehiclePhysicsControl, WorldSettings, ...) are CARLA's own, from the
installed package, so that it refuses what CARLA refuses when they are made. What needs a server is imitated with the
rules of LibCarla's client: arguments must be of the types of the C++ signatures; what an actor says of itself is as of
the last tick; whoever is destroyed cannot be asked any more; a world ticks in synchronous mode only, and in substeps
that fit into its step; a snapshot does not know who is gone. The bodies are in
:mod:`tests.simulation.carla_stand_in_actors`.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from types import SimpleNamespace
from typing import Any

import carla

from tests.simulation.carla_stand_in_actors import BOXES, WALKERS, Blueprint, Sensor, Vehicle, Walker, require
from trace_dag.carla.frame import location_to_carla
from trace_dag.simulation.outlines import separation

TIME_OUT = "time-out of 60000ms while waiting for the simulator, make sure the simulator is ready and connected"


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
        self.breaks: tuple[str, int, BaseException] | None = None  # a call, which of them, and what it ends in
        self.Transform, self.Location, self.Rotation = carla.Transform, carla.Location, carla.Rotation
        self.Vector3D, self.VehicleControl = carla.Vector3D, carla.VehicleControl
        self.WalkerControl = carla.WalkerControl
        self.OpendriveGenerationParameters = carla.OpendriveGenerationParameters

    def Client(self, host: str, port: int) -> Client:
        require("Client", (host, str), (port, int))
        self.note("Client", None, host, port)
        return Client(self)

    def note(self, name: str, actor: int | None, *arguments: Any) -> None:
        self.calls.append(Call(name, actor, arguments))
        if self.breaks is not None and self.breaks[:2] == (name, len(self.named(name))):
            raise self.breaks[2]

    def named(self, name: str) -> list[Call]:
        return [call for call in self.calls if call.name == name]


class Client:
    def __init__(self, module: StandIn) -> None:
        self._module = module

    def set_timeout(self, seconds: float) -> None:
        require("Client.set_timeout", (seconds, float))
        self._module.note("set_timeout", None, seconds)

    def get_server_version(self) -> str:
        if not self._module.connects:
            raise RuntimeError(TIME_OUT)
        return self._module.server

    def get_client_version(self) -> str:
        return self._module.package

    def generate_opendrive_world(self, opendrive: str, parameters: Any, reset_settings: bool = True) -> World:
        require(
            "Client.generate_opendrive_world",
            (opendrive, str),
            (parameters, carla.OpendriveGenerationParameters),
            (reset_settings, bool),
        )
        if "<OpenDRIVE" not in opendrive:
            raise RuntimeError("opendrive could not be correctly parsed")
        self._module.note("generate_opendrive_world", None, opendrive, parameters)
        if reset_settings:
            self._module.world.settings = carla.WorldSettings()
        return self._module.world


class World:
    def __init__(self, module: StandIn) -> None:
        self.module = module
        self.settings = carla.WorldSettings()
        self.actors: dict[int, Vehicle | Walker] = {}
        self.sensors: list[Sensor] = []
        self.frame = 1000
        self.ticks = 0
        self.sensors_late = False  # sensors speak up to a tick later than what they saw
        self.road_height_m: Callable[[float, float], float] = lambda x, y: 0.0
        self.spectator_transform: Any = None
        self._next_id = 100
        self._unsaid: list[tuple[Sensor, Any]] = []

    # --- settings --------------------------------------------------------------------------------------------
    def get_settings(self) -> Any:
        """A copy, as the real one is."""
        s = self.settings
        return carla.WorldSettings(
            synchronous_mode=s.synchronous_mode,
            fixed_delta_seconds=s.fixed_delta_seconds or 0.0,
            substepping=s.substepping,
            max_substep_delta_time=s.max_substep_delta_time,
            max_substeps=s.max_substeps,
        )

    def apply_settings(self, settings: Any) -> int:
        require("World.apply_settings", (settings, carla.WorldSettings))
        if settings.synchronous_mode and settings.substepping:  # the real one warns and computes nonsense
            assert settings.fixed_delta_seconds, "synchronous mode needs a fixed step"
            assert 1 <= settings.max_substeps <= 16, "the number of substeps must be 1 to 16"
            covered = settings.max_substep_delta_time * settings.max_substeps
            assert settings.fixed_delta_seconds <= covered + 1e-9, "substeps must fill the step"
        self.module.note("apply_settings", None, settings.synchronous_mode, settings.fixed_delta_seconds)
        self.settings = settings
        return self.frame

    # --- actors ----------------------------------------------------------------------------------------------
    def get_blueprint_library(self) -> Library:
        return Library()

    def get_spectator(self) -> Any:
        def place(transform: Any) -> None:
            require("Actor.set_transform", (transform, carla.Transform))
            self.spectator_transform = transform

        return SimpleNamespace(set_transform=place)

    def try_spawn_actor(self, blueprint: Any, transform: Any) -> Vehicle | Walker | None:
        require("World.try_spawn_actor", (blueprint, Blueprint), (transform, carla.Transform))
        kind = Walker if blueprint.id in WALKERS else Vehicle
        vehicle = kind(self, self._next_id, blueprint.id, transform)
        if any(separation(vehicle.outline(), other.outline())[0] < 0 for other in self.actors.values()):
            return None
        self._next_id += 1
        self.actors[vehicle.id] = vehicle
        self.module.note("try_spawn_actor", vehicle.id, blueprint.id, transform)
        return vehicle

    def spawn_actor(self, blueprint: Any, transform: Any, attach_to: Any = None) -> Sensor:
        require(
            "World.spawn_actor", (blueprint, Blueprint), (transform, carla.Transform), (attach_to, (Vehicle, Walker))
        )
        attach_to.living()
        self.module.note("spawn_actor", attach_to.id, blueprint.id)
        sensor = Sensor(self, attach_to)
        self.sensors.append(sensor)
        return sensor

    def get_snapshot(self) -> Any:
        def find(actor_id: int) -> Any:
            require("WorldSnapshot.find", (actor_id, int))
            found = self.actors.get(actor_id)
            return None if found is None or found.seen is None else found.seen

        self.module.note("get_snapshot", None)
        return SimpleNamespace(frame=self.frame, find=find)

    # --- time ------------------------------------------------------------------------------------------------
    def tick(self, seconds: float = 0.0) -> int:
        require("World.tick", (seconds, float))
        self.module.note("tick", None)
        if not self.settings.synchronous_mode:
            raise RuntimeError(TIME_OUT)  # nobody waits for this client
        self.ticks += 1
        self.frame += 1
        if self.sensors_late:
            self._say()
        for vehicle in self.actors.values():
            vehicle.advance(self.settings.fixed_delta_seconds)
        vehicles = list(self.actors.values())
        for i, one in enumerate(vehicles):
            for two in vehicles[i + 1 :]:
                gap, nx, ny = separation(one.outline(), two.outline())
                if gap < 0:
                    self._collide(one, two, nx, ny)
        for vehicle in vehicles:
            vehicle.show()
        if not self.sensors_late:
            self._say()
        return self.frame

    def _say(self) -> None:
        events, self._unsaid = self._unsaid, []
        for sensor, event in events:
            if sensor.callback is not None:
                sensor.callback(event)

    def _collide(self, one: Vehicle | Walker, two: Vehicle | Walker, nx: float, ny: float) -> None:
        """Two vehicles push each other; a walker is touched, and neither it nor the vehicle feels it."""
        nx, ny = location_to_carla(nx, ny)
        if isinstance(one, Walker) or isinstance(two, Walker):
            self._say_later(one, two, 0.0, nx, ny)
            return
        closing = (one.velocity.x - two.velocity.x) * nx + (one.velocity.y - two.velocity.y) * ny
        if closing <= 0:
            return
        impulse = 1.1 * closing / (1 / one.physics.mass + 1 / two.physics.mass)
        for vehicle, sign in ((one, -1.0), (two, 1.0)):
            vehicle.velocity.x += sign * impulse / vehicle.physics.mass * nx
            vehicle.velocity.y += sign * impulse / vehicle.physics.mass * ny
        self._say_later(one, two, impulse, nx, ny)

    def _say_later(self, one: Vehicle | Walker, two: Vehicle | Walker, impulse: float, nx: float, ny: float) -> None:
        for sensor in self.sensors:
            for own, other, sign in ((one, two, -1.0), (two, one, 1.0)):
                if sensor.parent is own:
                    pushed = carla.Vector3D(sign * impulse * nx, sign * impulse * ny, 0.0)
                    event = SimpleNamespace(frame=self.frame, actor=own, other_actor=other, normal_impulse=pushed)
                    self._unsaid.append((sensor, event))


class Library:
    def __iter__(self) -> Any:
        return iter(Blueprint(name) for name in (*BOXES, *WALKERS, "sensor.other.collision"))

    def find(self, name: str) -> Any:
        require("BlueprintLibrary.find", (name, str))
        found = next((blueprint for blueprint in self if blueprint.id == name), None)
        if found is None:
            raise IndexError(f"blueprint '{name}' not found")
        return found
