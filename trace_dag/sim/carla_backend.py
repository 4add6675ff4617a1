"""CARLA 0.9.15 and 0.9.16 as a back-end: the map as stored, the same plans, CARLA's physics, the same log.

The server runs in synchronous mode with the log's step; PhysX sub-steps below it. Until its first contact a vehicle is
carried along its plan by target velocities (the plan's, plus what brings it back to its planned position), its
wheels steered to match; after it nobody drives and brakes hold as many of its wheels as the settings lock. Contacts
come from collision sensors; their place is computed from the two bounding boxes as in the embedded back-end, since
the sensor gives none. Every exit destroys what was spawned and gives the server its settings back.

The ``carla`` package is the extra of that name; everything goes through the module object, so that a
stand-in can take its place.
"""

from __future__ import annotations

import math
import time
from collections import deque
from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from dataclasses import dataclass
from typing import Any

import numpy as np

from trace_dag.errors import Failure, TransientFailure, UserError
from trace_dag.roads.network import RoadNetwork
from trace_dag.settings import SimSettings
from trace_dag.sim.carla_actors import CarlaActor, CarlaContact
from trace_dag.sim.carla_frame import location_to_carla
from trace_dag.sim.driving import Driver, Pedals
from trace_dag.sim.plan import check_trajectory
from trace_dag.sim.types import Participant, Simulation, SimulationLog, Termination

SUPPORTED_VERSIONS = ("0.9.15", "0.9.16")
_TIMEOUT_S = 60.0
_MAX_STEP_S = 0.05
_SUBSTEP_S = 0.005
_SETTLE_TICKS = 20
_SPECTATOR_ABOVE_M = 60.0


class CarlaBackend:
    """A connection to one CARLA server, made when the first map is loaded."""

    name = "carla"

    def __init__(self, settings: SimSettings, module: Any = None) -> None:
        self._settings = settings
        self._carla = module
        self._client: Any = None

    def load(self, network: RoadNetwork, xodr: bytes, *, friction: float) -> Simulation:
        """Build the server's world from the stored map, without walls at the roads' edges.

        Raises :class:`UserError` where the ``carla`` package is missing, :class:`Failure` for a server of another
        version, :class:`TransientFailure` where none answers.
        """
        client = self._connected()
        parameters = self._carla.OpendriveGenerationParameters(
            vertex_distance=2.0,
            max_road_length=50.0,
            wall_height=0.0,
            additional_width=2.0,
            smooth_junctions=True,
            enable_mesh_visibility=True,
        )
        with _server_errors("building the map"):
            world = client.generate_opendrive_world(xodr.decode("utf-8"), parameters)
        return CarlaSimulation(self._carla, world, self._settings, friction, client.get_server_version())

    def close(self) -> None:
        """Let go of the server; its settings were given back after each run."""
        self._client = None

    def _connected(self) -> Any:
        if self._client is not None:
            return self._client
        if self._carla is None:
            try:
                import carla
            except ImportError as error:
                raise UserError(
                    "the CARLA back-end needs the carla package: pip install 'trace-dag[carla]', "
                    "or choose the embedded back-end"
                ) from error
            self._carla = carla
        address = f"{self._settings.carla_host}:{self._settings.carla_port}"
        with _server_errors(f"connecting to {address}"):
            client = self._carla.Client(self._settings.carla_host, self._settings.carla_port)
            client.set_timeout(_TIMEOUT_S)
            server, package = client.get_server_version(), client.get_client_version()
        if not server.startswith(SUPPORTED_VERSIONS):
            raise Failure(f"CARLA at {address} is version {server}; {' and '.join(SUPPORTED_VERSIONS)} are supported")
        if server.split("-")[0] != package.split("-")[0]:
            raise Failure(
                f"CARLA at {address} is version {server}, the installed carla package {package}; they must be the same"
            )
        self._client = client
        return client


@contextmanager
def _server_errors(doing: str) -> Iterator[None]:
    """CARLA raises RuntimeError for whatever goes wrong between client and server."""
    try:
        yield
    except RuntimeError as error:
        raise TransientFailure(f"CARLA, {doing}: {error}") from error


@dataclass
class _Collision:
    """What a sensor said: which two actors, in which frame, with what impulse."""

    frame: int
    own_id: int
    other_id: int
    impulse_ns: float


class CarlaSimulation:
    """Runs in one world of the server."""

    def __init__(self, module: Any, world: Any, settings: SimSettings, friction: float, version: str) -> None:
        self._carla = module
        self._world = world
        self._settings = settings
        self._friction = friction
        self._version = version
        self._step_s = min(settings.log_step_s, _MAX_STEP_S)

    def run(
        self,
        participants: tuple[Participant, ...],
        *,
        time_limit_s: float,
        drivers: Mapping[int, Driver] | None = None,
        after_contact_s: float | None = None,
    ) -> SimulationLog:
        """Simulate until rest or ``time_limit_s``.

        Raises :class:`Failure` for a plan nobody can drive or a vehicle that cannot be spawned,
        :class:`TransientFailure` if the server goes away.
        """
        for participant in participants:
            check_trajectory(participant)
        began = time.perf_counter()
        original = self._world.get_settings()
        actors: list[CarlaActor] = []
        collisions: deque[_Collision] = deque()
        try:
            with _server_errors("running"):
                self._enter_synchronous_mode()
                for participant in participants:
                    actors.append(
                        CarlaActor.spawn(
                            self._carla,
                            self._world,
                            participant,
                            friction=self._friction,
                            step_s=self._step_s,
                            time_limit_s=time_limit_s,
                        )
                    )
                self._watch(participants)
                self._settle(actors)
                self._listen(actors, collisions)
                log = self._drive(actors, collisions, drivers or {}, time_limit_s, after_contact_s, began)
        except BaseException:
            self._leave(actors, original)
            raise
        problem = self._leave(actors, original)
        if problem is not None:
            raise TransientFailure(f"CARLA, cleaning up: {problem}") from problem
        return log

    # --- before ----------------------------------------------------------------------------------------------
    def _enter_synchronous_mode(self) -> None:
        settings = self._world.get_settings()
        settings.synchronous_mode = True
        settings.fixed_delta_seconds = self._step_s
        settings.substepping = True
        settings.max_substep_delta_time = _SUBSTEP_S
        settings.max_substeps = math.ceil(self._step_s / _SUBSTEP_S)
        self._world.apply_settings(settings)

    def _watch(self, participants: tuple[Participant, ...]) -> None:
        """Put the spectator above the middle between the plans' ends."""
        x = float(np.mean([p.trajectory.x_m[-1] for p in participants]))
        y = float(np.mean([p.trajectory.y_m[-1] for p in participants]))
        x, y = location_to_carla(x, y)
        above = self._carla.Location(x=x, y=y, z=participants[0].initial_pose.z_m + _SPECTATOR_ABOVE_M)
        self._world.get_spectator().set_transform(self._carla.Transform(above, self._carla.Rotation(pitch=-90.0)))

    def _settle(self, actors: list[CarlaActor]) -> None:
        """Let the bodies come down on their wheels, then put each at its start with its speed."""
        for actor in actors:
            actor.hold()
        for _ in range(_SETTLE_TICKS):
            self._world.tick()
        for actor in actors:
            actor.put_at_start(self._step_s)
        self._world.tick()
        for actor in actors:
            actor.observe()

    def _listen(self, actors: list[CarlaActor], collisions: deque[_Collision]) -> None:
        blueprint = self._world.get_blueprint_library().find("sensor.other.collision")
        for actor in actors:
            actor.sensor = self._world.spawn_actor(blueprint, self._carla.Transform(), attach_to=actor.actor)
            own_id = actor.actor.id

            def note(event: Any, own_id: int = own_id) -> None:
                impulse = event.normal_impulse
                size = math.sqrt(impulse.x**2 + impulse.y**2 + impulse.z**2)
                collisions.append(_Collision(event.frame, own_id, event.other_actor.id, size))

            actor.sensor.listen(note)

    # --- during ----------------------------------------------------------------------------------------------
    def _drive(
        self,
        actors: list[CarlaActor],
        collisions: deque[_Collision],
        drivers: Mapping[int, Driver],
        time_limit_s: float,
        after_contact_s: float | None,
        began: float,
    ) -> SimulationLog:
        first_frame = self._world.get_snapshot().frame
        by_id = {actor.actor.id: actor for actor in actors}
        last_plan_tick = max(len(actor.plan.rows) for actor in actors)
        contacts: dict[tuple[int, int], CarlaContact] = {}
        termination, reason = Termination.TIME_LIMIT, f"still moving after {time_limit_s:g} s"
        wanted: dict[int, Pedals | None] = {}
        tick = 0
        for tick in range(1, math.ceil(time_limit_s / self._step_s) + 1):
            self._ask(drivers, actors, wanted, tick - 1)
            for actor in actors:
                pedals = wanted.get(actor.number)
                if actor.crashed or (pedals is None and actor.plan_is_over(tick)):
                    actor.let_go(self._settings.locked_wheels)
                elif pedals is None:
                    actor.carry(tick)
                else:
                    actor.obey(pedals)
            self._world.tick()
            for actor in actors:
                actor.observe()
            self._note_contacts(collisions, by_id, contacts, first_frame)
            if not contacts and tick > last_plan_tick:
                termination, reason = Termination.NO_CONTACT, "no contact: all plans ended without a collision"
                break
            first_tick = min((contact.first_tick for contact in contacts.values()), default=tick)
            since_s = (tick - first_tick) * self._step_s
            if contacts and after_contact_s is not None and since_s >= after_contact_s:
                reason = f"ended {after_contact_s:g} s after the first contact, as asked"
                break
            if contacts and all(actor.at_rest(tick) for actor in actors):
                termination, reason = Termination.AT_REST, f"all vehicles at rest after {tick * self._step_s:.2f} s"
                break
        if not contacts and termination is Termination.TIME_LIMIT:
            termination, reason = Termination.NO_CONTACT, f"no contact within {time_limit_s:g} s"
        found = sorted((each.contact(self._step_s) for each in contacts.values()), key=lambda contact: contact.time_s)
        return SimulationLog(
            backend=CarlaBackend.name,
            backend_version=self._version,
            step_s=self._step_s,
            vehicles=tuple(actor.log(self._step_s) for actor in actors),
            contacts=tuple(found),
            bodies={actor.number: actor.body for actor in actors},
            termination=termination,
            reason=reason,
            duration_s=tick * self._step_s,
            wall_s=time.perf_counter() - began,
        )

    def _ask(
        self, drivers: Mapping[int, Driver], actors: list[CarlaActor], wanted: dict[int, Pedals | None], tick: int
    ) -> None:
        """What each driver whose turn it is wants from now on, from what was seen after a tick."""
        for actor in actors:
            driver = drivers.get(actor.number)
            if driver is not None and not actor.crashed and tick % max(1, round(driver.period_s / self._step_s)) == 0:
                states = {other.number: other.body_state() for other in actors}
                wanted[actor.number] = driver.drive(tick * self._step_s, states)

    def _note_contacts(
        self,
        collisions: deque[_Collision],
        by_id: dict[int, CarlaActor],
        contacts: dict[tuple[int, int], CarlaContact],
        first_frame: int,
    ) -> None:
        while collisions:
            event = collisions.popleft()
            own, other = by_id[event.own_id], by_id.get(event.other_id)
            if other is None:
                continue  # a kerb, a sign, the ground
            one, two = sorted((own, other), key=lambda actor: actor.number)
            tick = max(1, event.frame - first_frame)
            contact = contacts.setdefault((one.number, two.number), CarlaContact(one, two, tick, tick))
            one.crashed = two.crashed = True
            if own is one:  # both sensors report the same contact
                contact.add(tick, event.impulse_ns, self._step_s)

    # --- after -----------------------------------------------------------------------------------------------
    def _leave(self, actors: list[CarlaActor], original: Any) -> RuntimeError | None:
        """Destroy everything and give the settings back, whatever state the server is in; what went wrong last."""
        problem: RuntimeError | None = None
        steps = [step for actor in actors for step in actor.dispose()]
        for step in (*steps, lambda: self._world.apply_settings(original)):
            try:
                step()
            except RuntimeError as error:  # the server may be gone; the rest is tried all the same
                problem = error
        return problem
