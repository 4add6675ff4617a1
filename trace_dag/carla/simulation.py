"""One run in a CARLA world: spawn, settle, tick by tick to the end, and leave nothing behind."""

from __future__ import annotations

import math
import time
from collections import deque
from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from dataclasses import dataclass
from itertools import combinations
from typing import Any

import numpy as np

from trace_dag.carla.actors import CarlaActor, CarlaWalker
from trace_dag.carla.frame import location_to_carla
from trace_dag.common.errors import TransientFailure, UserError
from trace_dag.common.geometry import Pose
from trace_dag.common.settings import SimSettings
from trace_dag.common.units import GRAVITY_MPS2
from trace_dag.simulation.driving import Driver, Pace, Pedals
from trace_dag.simulation.objects import FixedObject
from trace_dag.simulation.outlines import between, contact_point, first_touch, separation
from trace_dag.simulation.plan import check_participants
from trace_dag.simulation.types import (
    PULSE_S,
    AfterStriking,
    BodyKind,
    Contact,
    Participant,
    SimulationLog,
    Termination,
)

BACKEND_NAME = "carla"
_MAX_STEP_S = 0.05
_SUBSTEP_S = 0.005
_SETTLE_TICKS = 20
_SPECTATOR_ABOVE_M = 60.0
_ON_FOOT = (BodyKind.PEDESTRIAN, BodyKind.CONVEYANCE)


@contextmanager
def server_errors(doing: str) -> Iterator[None]:
    """Turn RuntimeError, which CARLA raises for every fault between client and server, into a transient failure.

    >>> with server_errors("loading the map"):
    ...     raise RuntimeError("time-out of 60000ms")
    Traceback (most recent call last):
    trace_dag.common.errors.TransientFailure: CARLA, loading the map: time-out of 60000ms
    """
    try:
        yield
    except RuntimeError as error:
        raise TransientFailure(f"CARLA, {doing}: {error}") from error


@dataclass
class _Collision:
    """One report of a collision sensor: the two actors, the frame, the impulse."""

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
        objects: tuple[FixedObject, ...] = (),
    ) -> SimulationLog:
        """Simulate until rest or ``time_limit_s``.

        Objects struck after another contact are left out, because CARLA's props neither break nor yield. Raises
        :class:`UserError` if one vehicle alone strikes a fixed object or animals take part, :class:`Failure` for an
        impossible plan or a participant that cannot be spawned, :class:`TransientFailure` if the server disappears.
        """
        check_participants(participants)
        if len(participants) == 1:
            _check_no_objects(objects)
        _check_no_animals(participants)
        began = time.perf_counter()
        with server_errors("reading its settings"):
            original = self._world.get_settings()
        actors: list[CarlaActor] = []
        collisions: deque[_Collision] = deque()
        try:
            with server_errors("running"):
                self._enter_synchronous_mode()
                for participant in participants:
                    kind = CarlaWalker if participant.body.kind in _ON_FOOT else CarlaActor
                    actors.append(
                        kind.spawn(
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
        """Put the server's camera above the middle of the plans' ends."""
        x = float(np.mean([p.trajectory.x_m[-1] for p in participants]))
        y = float(np.mean([p.trajectory.y_m[-1] for p in participants]))
        x, y = location_to_carla(x, y)
        above = self._carla.Location(x=x, y=y, z=participants[0].initial_pose.z_m + _SPECTATOR_ABOVE_M)
        self._world.get_spectator().set_transform(self._carla.Transform(above, self._carla.Rotation(pitch=-90.0)))

    def _settle(self, actors: list[CarlaActor]) -> None:
        """Let the bodies settle on their wheels, then put each at its start with its speed."""
        for actor in actors:
            actor.hold()
        for _ in range(_SETTLE_TICKS):
            self._world.tick()
        for actor in actors:
            actor.put_at_start()
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
        last_plan_tick = max(len(actor.plan) for actor in actors)
        contacts: dict[tuple[int, int], CarlaContact] = {}
        termination, reason = Termination.TIME_LIMIT, f"still moving after {time_limit_s:g} s"
        wanted: dict[int, Pedals | None] = {}
        tick = 0
        for tick in range(1, math.ceil(time_limit_s / self._step_s) + 1):
            self._ask(drivers, actors, wanted, tick - 1)
            for actor in actors:
                pedals = wanted.get(actor.number)
                if not actor.crashed and pedals is None and tick >= actor.brakes_from_tick:
                    actor.let_go(self._braking(actor))
                elif actor.crashed or (pedals is None and actor.plan_is_over(tick)):
                    actor.let_go(self._settings.locked_wheels if actor.crashed else 1.0)
                elif pedals is None:
                    actor.carry(tick)
                else:
                    actor.obey(pedals)
            self._world.tick()
            for actor in actors:
                actor.observe()
            self._note_contacts(collisions, by_id, contacts, first_frame)
            _release_touching(actors)
            if not contacts and drivers and all(driver.has_arrived for driver in drivers.values()):
                termination, reason = Termination.NO_CONTACT, "no contact: whoever is driven had arrived"
                break
            if not contacts and tick > last_plan_tick:
                termination, reason = Termination.NO_CONTACT, "no contact: all plans ended without a collision"
                break
            first_tick = min((contact.first_tick for contact in contacts.values()), default=tick)
            since_s = (tick - first_tick) * self._step_s
            if contacts and after_contact_s is not None and since_s >= after_contact_s:
                reason = f"ended {after_contact_s:g} s after the first contact, as asked"
                break
            if contacts and all(actor.at_rest(tick) for actor in actors):
                termination, reason = Termination.AT_REST, f"everybody at rest after {tick * self._step_s:.2f} s"
                break
        if not contacts and termination is Termination.TIME_LIMIT:
            termination, reason = Termination.NO_CONTACT, f"no contact within {time_limit_s:g} s"
        found = sorted((each.contact(self._step_s) for each in contacts.values()), key=lambda contact: contact.time_s)
        return SimulationLog(
            backend=BACKEND_NAME,
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
        """Ask the drivers that are due for new commands, from the states seen after a tick."""
        for actor in actors:
            driver = drivers.get(actor.number)
            if driver is not None and not actor.crashed and tick % max(1, round(driver.period_s / self._step_s)) == 0:
                states = {other.number: other.body_state() for other in actors}
                command = driver.drive(tick * self._step_s, states)
                if isinstance(command, Pace) and command.pace != 1.0:
                    raise UserError("the CARLA back-end follows plans at their own pace; use sim.backend = 'embedded'")
                wanted[actor.number] = None if isinstance(command, Pace) else command

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
            if one.body.is_figure:
                continue  # people do not touch each other
            tick = max(1, event.frame - first_frame)
            contact = contacts.setdefault((one.number, two.number), CarlaContact(one, two, tick, tick))
            two.crashed = True
            if two.body.is_figure:
                self._answer(one, contact.first_tick)
            else:
                one.crashed = True
            if own is one:  # both sensors report the same contact
                contact.add(tick, event.impulse_ns, self._step_s)

    def _response(self, actor: CarlaActor) -> AfterStriking:
        grip_mps2 = self._friction * GRAVITY_MPS2
        default = AfterStriking(self._settings.reaction_s, self._settings.braking_share * grip_mps2)
        return actor.participant.after_striking or default

    def _answer(self, vehicle: CarlaActor, tick: int) -> None:
        """Schedule braking after the reaction time, as a driver brakes who has struck a person."""
        if math.isinf(vehicle.brakes_from_tick):
            vehicle.brakes_from_tick = tick + self._response(vehicle).reaction_s / self._step_s

    def _braking(self, vehicle: CarlaActor) -> float:
        """Return the brake pedal, 0 to 1, of a driver who brakes after striking a person."""
        return min(self._response(vehicle).deceleration_mps2 / (self._friction * GRAVITY_MPS2), 1.0)

    # --- after -----------------------------------------------------------------------------------------------
    def _leave(self, actors: list[CarlaActor], original: Any) -> RuntimeError | None:
        """Destroy all actors and restore the server's settings; return the last error, if any."""
        problem: RuntimeError | None = None
        steps = [step for actor in actors for step in actor.dispose()]
        for step in (*steps, lambda: self._world.apply_settings(original)):
            try:
                step()
            except RuntimeError as error:  # the server may be gone; the rest is tried all the same
                problem = error
        return problem


def _check_no_objects(objects: tuple[FixedObject, ...]) -> None:
    """Raise :class:`UserError` for objects: CARLA's props neither break nor yield, and have no crush."""
    if objects:
        raise UserError(
            f"the CARLA back-end cannot simulate a crash into a fixed object ({objects[0].name}): its props neither "
            "break nor yield; use sim.backend = 'embedded'"
        )


def _check_no_animals(participants: tuple[Participant, ...]) -> None:
    """Raise :class:`UserError` for animals: CARLA has none, and its walkers take part in no collision."""
    if any(participant.body.kind is BodyKind.ANIMAL for participant in participants):
        raise UserError(
            "the CARLA back-end cannot simulate a crash with an animal: its library has none; use "
            "sim.backend = 'embedded'"
        )


def _release_touching(actors: list[CarlaActor]) -> None:
    """Release actors whose boxes overlap.

    Their sensors may report the contact a tick later, and a target velocity set in between would push them into each
    other again.
    """
    for one, two in combinations(sorted(actors, key=lambda actor: actor.number), 2):
        if not one.body.is_figure and not (one.crashed and two.crashed) and one.meets(two):
            two.crashed = True
            one.crashed = one.crashed or not two.body.is_figure


# --- contacts --------------------------------------------------------------------------------------------------------
@dataclass
class CarlaContact:
    """A contact of two actors under way, by the ticks in which sensors reported it."""

    one: CarlaActor
    two: CarlaActor
    first_tick: int
    last_tick: int
    impulse_ns: float = 0.0

    def add(self, tick: int, impulse_ns: float, step_s: float) -> None:
        """Add another report of the first actor's sensor."""
        self.last_tick = max(self.last_tick, tick)
        if (tick - self.first_tick) * step_s <= PULSE_S:
            self.impulse_ns += impulse_ns

    def contact(self, step_s: float) -> Contact:
        """Return the contact.

        Its position is computed from the two boxes between the last tick before the report and the tick of the report.
        """
        one, two = self.one, self.two
        last = len(one.rows) - 1
        after = min(self.first_tick, last)
        before = max(after - 1, 0)
        start, end = (one.outline(before), two.outline(before)), (one.outline(after), two.outline(after))
        fraction = first_touch(start, end) if separation(*end)[0] <= 0 < separation(*start)[0] else 1.0
        touching = between(start[0], end[0], fraction), between(start[1], end[1], fraction)
        _, nx, ny = separation(*touching)
        x, y = contact_point(*touching)
        v1, v2 = one.velocity(before), two.velocity(before)
        settled = min(self.first_tick + round(PULSE_S / step_s), self.last_tick + 1, last)
        w1, w2 = one.velocity(settled), two.velocity(settled)
        z1, z2 = one.rows[before][2], two.rows[before][2]
        return Contact(
            time_s=(before + fraction) * step_s,
            duration_s=(self.last_tick - self.first_tick) * step_s,
            x_m=x,
            y_m=y,
            z_m=(z1 + z2) / 2,
            normal_x=nx,
            normal_y=ny,
            impulse_ns=self.impulse_ns,
            closing_speed_mps=(v1[0] - v2[0]) * nx + (v1[1] - v2[1]) * ny,
            number_1=one.number,
            number_2=two.number,
            pose_1=Pose(touching[0].x_m, touching[0].y_m, touching[0].heading_rad, z1),
            pose_2=Pose(touching[1].x_m, touching[1].y_m, touching[1].heading_rad, z2),
            velocity_1_mps=v1,
            velocity_2_mps=v2,
            delta_v_1_mps=(w1[0] - v1[0], w1[1] - v1[1]),
            delta_v_2_mps=(w2[0] - v2[0], w2[1] - v2[1]),
        )
