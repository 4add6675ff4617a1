"""One run of vehicles on the embedded back-end: step by step to the end, and its log.

Where people take part, :mod:`trace_dag.sim.run_with_people` goes on from here.
"""

from __future__ import annotations

import math
import sys
import time
from collections.abc import Callable, Mapping, Sequence

import numpy as np

from trace_dag.settings import SimSettings
from trace_dag.sim.at_the_wheel import AtTheWheel
from trace_dag.sim.commanded import CommandedVehicle
from trace_dag.sim.driving import Driver
from trace_dag.sim.dynamics import Vehicle
from trace_dag.sim.outlines import separation
from trace_dag.sim.people import Person
from trace_dag.sim.plan import resample
from trace_dag.sim.recorder import (
    BodyMotion,
    ContactEpisode,
    Pulled,
    StateRecorder,
    begin_contact,
    of_combinations,
)
from trace_dag.sim.rigid import RigidBodies
from trace_dag.sim.surface import Surface
from trace_dag.sim.towing import Towed, couple
from trace_dag.sim.types import Contact, Participant, SimulationLog, Termination, party_name
from trace_dag.sim.vehicle_pairs import VehiclePairs, same_level
from trace_dag.sim.vehicles import vehicle_model
from trace_dag.states.objects import FixedObject

BACKEND_NAME, VERSION = "embedded", "4"
_CONTACT_STEP_S = 0.0025
BOUND, BOUND_MPS = 1.5, 10.0
"""A closing speed may grow by so much until it is looked at again."""
_MAX_SPEED_MPS = 150.0
_MAX_DISTANCE_M = 5000.0

BodyStates = tuple[list[float], list[float]]
"""Positions and rates of all bodies as MuJoCo has them: x, y, yaw of each centre of gravity, one after the other."""


class VehicleRun:
    """A run in which only motor vehicles take part."""

    def __init__(
        self,
        settings: SimSettings,
        surface: Surface,
        friction: float,
        participants: tuple[Participant, ...],
        time_limit_s: float,
        drivers: Mapping[int, Driver],
    ) -> None:
        self._began = time.perf_counter()
        self._step_s = settings.step_s
        self._parts = max(1, math.ceil(settings.step_s / _CONTACT_STEP_S - 1e-9))
        self._log_every = max(1, round(settings.log_step_s / settings.step_s))
        self._steps = math.ceil(time_limit_s / settings.step_s)
        self._surface = surface
        self._settings = settings
        self._friction = friction
        self._time_limit_s = time_limit_s
        self._participants = participants
        self._drivers = drivers
        self._bodies_of = {p.number: p.body for p in participants}
        self._everybody = "vehicles"
        self._vehicles: list[Vehicle] = []
        turned_wheels = {p.number: p.turned_wheels for p in participants}
        self._driven: list[tuple[CommandedVehicle, Driver, int]] = []  # and the steps from one command to the next
        self._wheels = AtTheWheel(participants, settings, friction, led_by=drivers)
        for participant in participants:
            if participant.body.is_figure:
                continue
            model = vehicle_model(participant.body, participant.trailer)
            plan = resample(
                participant.trajectory, settings.step_s, time_limit_s, model.cg_ahead_m, participant.skids_from_s
            )
            locked = participant.locked_wheels
            common = {"friction": friction, "locked_wheels": settings.locked_wheels if locked is None else locked}
            driver = drivers.get(participant.number)
            if driver is None:
                self._vehicles.append(Vehicle(participant, model, plan, **common))
                continue
            vehicle = CommandedVehicle(participant, model, plan, **common, step_s=settings.step_s)
            self._vehicles.append(vehicle)
            self._driven.append((vehicle, driver, max(1, round(driver.period_s / settings.step_s))))
        for free in self._vehicles:
            turned = turned_wheels[free.number]
            if turned is not None:
                free.turn_wheels(math.ceil(turned.from_s / settings.step_s), turned.angle_rad)
        self._hitches = couple(self._vehicles, participants, friction)
        self._bodies_of |= {each.number: each.model.body for each in self._vehicles if isinstance(each, Towed)}
        self._people = self._make_people()
        self._movers: Sequence[Vehicle | Person] = [*self._vehicles, *self._people]
        self._bodies = self._make_bodies()
        self._last_plan_step = round(max((mover.plan_end_s for mover in self._movers), default=0.0) / self._step_s)
        self._recorder = StateRecorder(self._movers)
        self._open: dict[tuple[int, int], ContactEpisode] = {}
        self._closed: list[ContactEpisode] = []
        self._state: BodyStates | None = None  # as MuJoCo has it; None while bodies move by themselves
        self._step = 0  # so many are taken
        self._apart_until_step = 0  # no two bodies can touch before it
        self._before: BodyStates | None = None  # the state a part of a step ago, while steps are taken in parts
        self._pairs = VehiclePairs(self._vehicles, self._hitches, settings)

    def _make_people(self) -> list[Person]:
        return []

    def _make_bodies(self) -> RigidBodies:
        models = [v.model for v in self._vehicles]
        return RigidBodies(models)

    def log(
        self,
        *,
        until_s: float = math.inf,
        after_contact_s: float = math.inf,
        as_long_as: Callable[[Sequence[Contact]], bool] | None = None,
    ) -> SimulationLog:
        """Simulate to the end and say what came of it. The run ends early where nothing has touched until a time (s),
        so long after the first contact, or once ``as_long_as`` does not hold for the contacts so far; asked again, it
        goes on from there."""
        termination, reason = self._advance_until_end(until_s, after_contact_s, as_long_as)
        duration_s = self._step * self._step_s
        self._record(duration_s)
        by_number = {logged.number: logged for logged in self._recorder.logs()}
        return SimulationLog(
            backend=BACKEND_NAME,
            backend_version=f"{VERSION} (mujoco {self._bodies.version})",
            step_s=self._step_s,
            vehicles=tuple(by_number[number] for number in self._bodies_of),
            contacts=tuple(sorted(self._contacts(), key=lambda contact: contact.time_s)),
            bodies=self._bodies_of,
            termination=termination,
            reason=reason,
            duration_s=duration_s,
            wall_s=time.perf_counter() - self._began,
            objects=self._objects(),
            trailers={p.number: p.trailer for p in self._participants if p.trailer is not None},
        )

    def release(self) -> None:
        """The run does not go on: another may use its bodies."""
        self._bodies.release()

    def _contacts(self) -> list[Contact]:
        """Every contact so far."""
        return [episode.contact() for episode in (*self._closed, *self._open.values())]

    @property
    def _contacts_begun(self) -> int:
        """The number of contacts so far."""
        return len(self._closed) + len(self._open)

    def _objects(self) -> tuple[FixedObject, ...]:
        return ()

    @property
    def _first_contact_s(self) -> float | None:
        """When two bodies first touched; None if none have."""
        return min((episode.start_s for episode in (*self._closed, *self._open.values())), default=None)

    def _advance_until_end(
        self, until_s: float, after_contact_s: float, as_long_as: Callable[[Sequence[Contact]], bool] | None
    ) -> tuple[Termination, str]:
        looked_at = 0  # contacts that ``as_long_as`` was asked about
        if self._step == 0:
            self._bodies.set_heights([v.z for v in self._vehicles])
            self._stand_on_surface()
            for one, two in self._could_meet():
                if same_level(one, two) and separation(one.outline(), two.outline())[0] <= 0:
                    reason = f"{self._names(one.number, two.number)} overlap at the start"
                    return Termination.STARTED_IN_CONTACT, reason
            self._look()
        while self._step < self._steps:
            ended = self._ended(until_s, after_contact_s)
            if ended is not None:
                return ended
            if as_long_as is not None and self._contacts_begun > looked_at:
                looked_at = self._contacts_begun
                if not as_long_as(self._contacts()):
                    return Termination.TIME_LIMIT, "ended by its contacts, as asked"
            self._advance_to(min(self._step + self._log_every, self._steps))
            if self._step < self._steps:
                self._look()
        limit_s = self._steps * self._step_s
        if self._first_contact_s is None:
            return Termination.NO_CONTACT, self._no_contact_reason()
        return Termination.TIME_LIMIT, f"still moving after {limit_s:g} s"

    def _look(self) -> None:
        """Stand on the ground as it is here, and keep the state."""
        self._stand_on_surface()
        self._record(self._step * self._step_s)

    def _advance_to(self, last: int) -> None:
        """Take the steps up to another one."""
        while self._step < last:
            step = self._step
            alone = min(self._alone_until(step), last)
            if alone > step + 1:
                self._go_alone(step, alone)
                self._step = alone
                continue
            for driven, driver, every in self._driven:
                if step % every == 0 and not driven.crashed:
                    states = {mover.number: mover.body_state() for mover in self._movers}
                    driven.command(driver.drive(step * self._step_s, states))
            self._advance(step, [vehicle.road_force(step) for vehicle in self._vehicles])
            self._step = step + 1

    def _alone_until(self, step: int) -> int:
        """The step before which nobody can touch anybody and nothing but the road moves anyone: no vehicle's steps
        depend on another's until then."""
        if self._open or self._pairs.crushed or self._hitches or self._driven:
            return step
        return self._apart_until_step if self._pairs.places else sys.maxsize

    def _go_alone(self, step: int, until: int) -> None:
        """Take the steps up to another one with each vehicle by itself."""
        self._state = self._before = None
        for i, vehicle in enumerate(self._vehicles):
            for each in range(step, until):
                force = vehicle.road_force(each)
                vehicle.advance(force, self._step_s)
                if vehicle.roll is not None and vehicle.crashed:
                    self._roll(i, vehicle, force, (each + 1) * self._step_s)

    def _roll(self, i: int, vehicle: Vehicle, force: tuple[float, float, float], now_s: float) -> None:
        """Tip and roll for a step under the road's force x, y (N) and moment: beside the road vehicles do."""

    def _advance(self, step: int, forces: list[tuple[float, float, float]]) -> None:
        """Take one step under the road's forces on each vehicle."""
        if self._contact_possible(step):
            self._step_in_parts(step, [value for force in forces for value in force], self._parts)
        elif self._open or self._pairs.crushed:
            self._step_leaning(step, [value for force in forces for value in force])
        else:
            self._move_alone(forces)

    def _move_alone(self, forces: list[tuple[float, float, float]]) -> None:
        self._state = self._before = None
        if self._hitches:
            flat = self._held([value for force in forces for value in force], self._step_s)
            forces = [(flat[k], flat[k + 1], flat[k + 2]) for k in range(0, len(flat), 3)]
        for vehicle, force in zip(self._vehicles, forces, strict=True):
            vehicle.advance(force, self._step_s)

    def _record(self, time_s: float) -> None:
        self._recorder.record(time_s)

    def _could_meet(self) -> list[tuple[Vehicle, Vehicle | Person]]:
        return [*self._pairs.vehicles]

    def _ended(self, until_s: float, after_contact_s: float) -> tuple[Termination, str] | None:
        now_s = self._step * self._step_s
        for v in self._movers:
            if not (math.hypot(v.vx, v.vy) < _MAX_SPEED_MPS and math.hypot(v.x, v.y) < _MAX_DISTANCE_M):
                state = f"x {v.x:.3g} m, y {v.y:.3g} m, speed {math.hypot(v.vx, v.vy):.3g} m/s"
                who = party_name(self._bodies_of[v.number], v.number)
                return Termination.DIVERGED, f"{who} left all bounds at {now_s:.2f} s: {state}"
        first_s, planned = self._first_contact_s, self._step <= self._last_plan_step
        if first_s is None:
            return None if planned and now_s <= until_s else (Termination.NO_CONTACT, self._no_contact_reason())
        if now_s >= first_s + after_contact_s:
            return Termination.TIME_LIMIT, f"ended {after_contact_s:g} s after the first contact, as asked"
        if any(now_s < episode.ends_s for episode in self._open.values()):
            return None  # bodies that stand still at their deepest crush come back
        if all(v.at_rest and (v.crashed or v.stops or not planned) for v in self._movers):
            return Termination.AT_REST, f"all {self._everybody} at rest after {now_s:.2f} s"
        return None

    def _no_contact_reason(self) -> str:
        """A sentence on how near the vehicles that could have met came to each other, from the logged states."""
        nearest, when, numbers = math.inf, 0.0, (0, 0)
        logs = {logged.number: logged for logged in self._recorder.logs()}
        for mover, other in self._could_meet():
            one, two = logs[mover.number], logs[other.number]
            distance = np.hypot(one.x_m - two.x_m, one.y_m - two.y_m)
            k = int(distance.argmin())
            if distance[k] < nearest:
                nearest, when, numbers = float(distance[k]), float(one.time_s[k]), (one.number, two.number)
        if nearest == math.inf:
            return "nothing to collide with: fewer than two participants"
        return f"no contact: {self._names(*numbers)} came to {nearest:.1f} m (centres) at {when:.2f} s"

    def _names(self, one: int, two: int) -> str:
        body_1, body_2 = self._bodies_of[one], self._bodies_of[two]
        if body_1.is_figure or body_2.is_figure or body_1.is_trailer or body_2.is_trailer:
            return f"{party_name(body_1, one)} and {party_name(body_2, two)}"
        return f"vehicles {one} and {two}"

    # --- steps -----------------------------------------------------------------------------------------------
    def _taken_over(self) -> BodyStates:
        """The present state, which MuJoCo has from here on."""
        if self._state is None:
            positions = [value for v in self._vehicles for value in (v.x, v.y, v.heading)]
            rates = [value for v in self._vehicles for value in (v.vx, v.vy, v.yaw_rate)]
            self._bodies.place(positions, rates)
            self._state = positions, rates
        return self._state

    def _update(self, positions: list[float], rates: list[float]) -> None:
        self._state = positions, rates
        k = 0
        for v in self._vehicles:
            v.x, v.y, v.heading = positions[k : k + 3]
            v.vx, v.vy, v.yaw_rate = rates[k : k + 3]
            k += 3

    def _stand_on_surface(self) -> None:
        if self._surface.flat:
            return
        for v in self._movers:
            if not v.ground.reaches(v.x, v.y):
                v.ground = self._surface.at(v.x, v.y, v.z)
            v.z = v.ground.height_m(v.x, v.y)
        self._bodies.set_heights([v.z for v in self._vehicles])

    def _contact_possible(self, step: int) -> bool:
        """Whether two bodies may come to touch within the next step, or a crash pulse is under way."""
        if step < self._apart_until_step:
            return False
        now_s = step * self._step_s
        apart_s = math.inf
        for i, j in self._pairs.places:
            one, two = self._vehicles[i], self._vehicles[j]
            episode = self._open.get((i, j))
            if episode is not None:
                if now_s < episode.ends_s:
                    return True
                apart_s = 0.0
                continue
            between_m = math.hypot(one.x - two.x, one.y - two.y) - one.reach_m - two.reach_m
            closing = math.hypot(one.vx - two.vx, one.vy - two.vy)
            if between_m > 0:
                apart_s = min(apart_s, between_m / (BOUND * closing + BOUND_MPS))
                continue
            apart_s = 0.0
            if (i, j) in self._pairs.crushed:
                continue
            turning = abs(one.yaw_rate) * one.reach_m + abs(two.yaw_rate) * two.reach_m
            travel = (closing + turning) * self._step_s * BOUND
            if same_level(one, two) and separation(one.outline(), two.outline())[0] <= travel:
                return True
        if apart_s < math.inf:
            self._apart_until_step = step + int(apart_s / self._step_s)
        return False

    def _forces_now(self, forces: list[float], now_s: float, part_s: float) -> list[float]:
        """The forces on the vehicles in a part of a step: those of the road, and of each other's crush."""
        return self._pairs.press(forces, now_s, part_s)

    def _held(self, forces: list[float], part_s: float) -> list[float]:
        """The given forces on the vehicles, and those of the hitches added."""
        for hitch in self._hitches:
            hitch.hold(forces, part_s)
        return forces

    def _place_people(self, time_s: float) -> None:
        """Move every person whom no vehicle has touched to the planned place."""

    def _step_in_parts(self, step: int, forces: list[float], parts: int) -> None:
        part_s = self._step_s / parts
        for part in range(parts):
            start_s = step * self._step_s + part * part_s
            self._place_people(start_s)
            now = self._taken_over()
            strikes = self._bodies.step(self._held(self._forces_now(forces, start_s, part_s), part_s), part_s)
            for pair, (fx, fy) in (*strikes.items(), *self._pairs.pressed_n.items()):
                if pair not in self._open:
                    # Found in the state a part begins with: this one came about in the part before.
                    self._open[pair] = self._begin(pair, self._before or now, now, start_s - part_s, part_s)
                self._open[pair].add(fx, fy, start_s + part_s, part_s)
                if pair in self._pairs.crushed:
                    self._open[pair].crush_m = self._pairs.crushed[pair].depths_m
            self._before = now
            self._update(*self._bodies.state)
            self._watch_contacts(start_s + part_s)
        self._close_ended((step + 1) * self._step_s)

    def _step_leaning(self, step: int, forces: list[float]) -> None:
        """Bodies that lean on each other, or lie in each other's dents: whole steps are short enough."""
        self._before = None
        self._taken_over()
        total = self._forces_now(forces, step * self._step_s, self._step_s)
        self._bodies.step(self._held(total, self._step_s), self._step_s)
        self._update(*self._bodies.state)
        end_s = (step + 1) * self._step_s
        for pair in self._pairs.pressed_n:
            if pair in self._open:
                self._open[pair].last_s = end_s
        self._watch_contacts(end_s)
        self._close_ended(end_s)

    def _watch_contacts(self, time_s: float) -> None:
        for pair in self._open:
            self._watch_overlap(pair, time_s)

    def _watch_overlap(self, pair: tuple[int, int], time_s: float) -> None:
        self._recorder.record_overlap(pair, -self._pairs.gap_m(pair), time_s)

    def _close_ended(self, now_s: float) -> None:
        for pair, episode in list(self._open.items()):
            if now_s > episode.over_s:
                self._closed.append(self._open.pop(pair))
                self._wheels.after(episode, self._open.values())

    def _begin(
        self, pair: tuple[int, int], before: BodyStates, now: BodyStates, before_s: float, part_s: float
    ) -> ContactEpisode:
        """A contact that came about between two states a part of a step from each other."""
        one, two = (self._vehicles[i] for i in pair)
        one.crashed = two.crashed = True

        def motions(i: int) -> tuple[BodyMotion, BodyMotion]:
            first, second = (
                BodyMotion(*positions[3 * i : 3 * i + 3], *rates[3 * i : 3 * i + 3])
                for positions, rates in (before, now)
            )
            return first, second

        (one_before, one_now), (two_before, two_now) = (motions(i) for i in pair)
        episode = begin_contact(one, two, (one_before, two_before), (one_now, two_now), before_s, part_s)
        if not self._hitches:
            return episode
        pullers = [each.puller if isinstance(each, Towed) else None for each in (one, two)]
        pulled = [None if by is None else Pulled(by, *motions(self._vehicles.index(by))) for by in pullers]
        return of_combinations(episode, pulled, (episode.start_s - before_s) / part_s)
