"""One run of the embedded back-end: step by step to the end, and its log.

A run has motor vehicles, and optional components: people and animals (:mod:`trace_dag.simulation.thrown`), and the
roadside (:mod:`trace_dag.simulation.roadside`).
"""

from __future__ import annotations

import math
import sys
import time
from collections.abc import Callable, Mapping, Sequence

import numpy as np

from trace_dag.common.settings import SimSettings
from trace_dag.simulation.commanded import CommandedVehicle
from trace_dag.simulation.driver_response import DriverResponse
from trace_dag.simulation.driving import Driver
from trace_dag.simulation.dynamics import Vehicle
from trace_dag.simulation.objects import FixedObject
from trace_dag.simulation.outlines import separation
from trace_dag.simulation.people import Person
from trace_dag.simulation.plan import resample
from trace_dag.simulation.recorder import (
    BodyMotion,
    ContactEpisode,
    Pulled,
    StateRecorder,
    begin_contact,
    of_combinations,
)
from trace_dag.simulation.rigid import BodyStates, RigidBodies
from trace_dag.simulation.roadside import Roadside
from trace_dag.simulation.roadside_terrain import RoadsideTerrain
from trace_dag.simulation.surface import Surface
from trace_dag.simulation.thrown import ThrownPeople, people_of
from trace_dag.simulation.towing import Towed, couple
from trace_dag.simulation.types import Contact, Participant, SimulationLog, Termination, party_name
from trace_dag.simulation.vehicle_pairs import BOUND, BOUND_MPS, VehiclePairs, same_level
from trace_dag.simulation.vehicles import vehicle_model

BACKEND_NAME, VERSION = "embedded", "5"
_CONTACT_STEP_S = 0.0025
_MAX_SPEED_MPS = 150.0
_MAX_DISTANCE_M = 5000.0


class CrashRun:
    """A run of motor vehicles, with people, animals and the roadside if the crash has them."""

    def __init__(
        self,
        settings: SimSettings,
        surface: Surface,
        friction: float,
        participants: tuple[Participant, ...],
        time_limit_s: float,
        drivers: Mapping[int, Driver],
        *,
        objects: tuple[FixedObject, ...] = (),
        beyond: RoadsideTerrain | None = None,
    ) -> None:
        self._began = time.perf_counter()
        self.step_s = settings.step_s
        self.parts = max(1, math.ceil(settings.step_s / _CONTACT_STEP_S - 1e-9))
        self._log_every = max(1, round(settings.log_step_s / settings.step_s))
        self._steps = math.ceil(time_limit_s / settings.step_s)
        self.surface = surface
        self.settings = settings
        self.friction = friction
        self.time_limit_s = time_limit_s
        self.participants = participants
        self.drivers = drivers
        self._bodies_of = {p.number: p.body for p in participants}
        self.vehicles: list[Vehicle] = []
        lost = {p.number: p.losses_of_control for p in participants}
        # and the steps from one command to the next
        self._driven: list[tuple[CommandedVehicle | Person, Driver, int]] = []
        self.wheels = DriverResponse(participants, settings, friction, led_by=drivers)
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
                self.vehicles.append(Vehicle(participant, model, plan, **common))
                continue
            vehicle = CommandedVehicle(participant, model, plan, **common, step_s=settings.step_s)
            self.vehicles.append(vehicle)
            self._driven.append((vehicle, driver, self._steps_of(driver)))
        for each in self.vehicles:
            if losses := lost[each.number]:
                each.lose_control([(math.ceil(loss.from_s / settings.step_s), loss) for loss in losses])
        self.hitches = couple(self.vehicles, participants, friction)
        self._bodies_of |= {each.number: each.model.body for each in self.vehicles if isinstance(each, Towed)}
        self.people = people_of(participants, settings.step_s, time_limit_s)
        self._driven += [
            (person, drivers[person.number], self._steps_of(drivers[person.number]))
            for person in self.people
            if person.number in drivers
        ]
        self._movers: Sequence[Vehicle | Person] = [*self.vehicles, *self.people]
        models = [vehicle.model for vehicle in self.vehicles]
        self.thrown = ThrownPeople(self) if self.people else None
        self.bodies = RigidBodies(models) if self.thrown is None else self.thrown.bodies
        self._last_plan_step = round(max((mover.plan_end_s for mover in self._movers), default=0.0) / self.step_s)
        self._recorder = StateRecorder(self._movers)
        self.open: dict[tuple[int, int], ContactEpisode] = {}
        self._closed: list[ContactEpisode] = []
        self.state: BodyStates | None = None  # as MuJoCo has it; None while bodies move by themselves
        self._step = 0  # so many are taken
        self._apart_until_step = 0  # no two bodies can touch before it
        self.before: BodyStates | None = None  # the state a part of a step ago, while steps are taken in parts
        self.pairs = VehiclePairs(self.vehicles, self.hitches, settings)
        self.roadside = None if beyond is None else Roadside(self, objects, beyond)

    def _steps_of(self, driver: Driver) -> int:
        """Return steps from one command of a driver to the next."""
        return max(1, round(driver.period_s / self.step_s))

    def log(
        self,
        *,
        until_s: float = math.inf,
        after_contact_s: float = math.inf,
        as_long_as: Callable[[Sequence[Contact]], bool] | None = None,
    ) -> SimulationLog:
        """Simulate to the end and return the log.

        The run ends early without a contact until ``until_s``, ``after_contact_s`` after the first contact, or once
        ``as_long_as`` returns False for the contacts so far. A repeated call continues from there.
        """
        termination, reason = self._advance_until_end(until_s, after_contact_s, as_long_as)
        duration_s = self._step * self.step_s
        self._record(duration_s)
        by_number = {logged.number: logged for logged in self._recorder.logs()}
        return SimulationLog(
            backend=BACKEND_NAME,
            backend_version=f"{VERSION} (mujoco {self.bodies.version})",
            step_s=self.step_s,
            vehicles=tuple(by_number[number] for number in self._bodies_of),
            contacts=tuple(sorted(self._contacts(), key=lambda contact: contact.time_s)),
            bodies=self._bodies_of,
            termination=termination,
            reason=reason,
            duration_s=duration_s,
            wall_s=time.perf_counter() - self._began,
            objects=() if self.roadside is None else self.roadside.items,
            trailers={p.number: p.trailer for p in self.participants if p.trailer is not None},
        )

    def release(self) -> None:
        """Release the bodies for another run, and the memory of this one, which cannot go on."""
        self.bodies.release()
        self.thrown = self.roadside = None  # both know this run, and memory in a circle waits for a collection

    def _contacts(self) -> list[Contact]:
        """Return every contact so far."""
        found = [episode.contact() for episode in (*self._closed, *self.open.values())]
        return found if self.roadside is None else [*found, *(struck.contact() for struck in self.roadside.struck)]

    @property
    def _contacts_begun(self) -> int:
        """Return the number of contacts so far."""
        return len(self._closed) + len(self.open) + (0 if self.roadside is None else len(self.roadside.struck))

    @property
    def _first_contact_s(self) -> float | None:
        """Return the time of the first contact, object strike or overturn, or None."""
        firsts = [episode.start_s for episode in (*self._closed, *self.open.values())]
        return min([*firsts, *(self.roadside.firsts_s if self.roadside else ())], default=None)

    def _advance_until_end(
        self, until_s: float, after_contact_s: float, as_long_as: Callable[[Sequence[Contact]], bool] | None
    ) -> tuple[Termination, str]:
        looked_at = 0  # contacts that ``as_long_as`` was asked about
        if self._step == 0:
            self.bodies.set_heights([v.z for v in self.vehicles])
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
        limit_s = self._steps * self.step_s
        if self._first_contact_s is None:
            return Termination.NO_CONTACT, self._no_contact_reason()
        return Termination.TIME_LIMIT, f"still moving after {limit_s:g} s"

    def _look(self) -> None:
        """Put the vehicles on the ground under them, and record the state."""
        self._stand_on_surface()
        self._record(self._step * self.step_s)

    def _advance_to(self, last: int) -> None:
        """Advance to a later step."""
        while self._step < last:
            step = self._step
            for vehicle in self.vehicles:
                if vehicle.next_loss_step == step:
                    vehicle.begin_loss()
                    self.state = None
            alone = min(self._alone_until(step), last, *(vehicle.next_loss_step for vehicle in self.vehicles))
            if alone > step + 1:
                self._go_alone(step, alone)
                self._step = alone
                continue
            for driven, driver, every in self._driven:
                if step % every == 0 and not driven.crashed:
                    states = {mover.number: mover.body_state() for mover in self._movers}
                    driven.command(driver.drive(step * self.step_s, states), step * self.step_s)
            self._advance(step, [vehicle.road_force(step) for vehicle in self.vehicles])
            self._step = step + 1

    def _alone_until(self, step: int) -> int:
        """Return the step before which no bodies can touch and only the road exerts forces.

        Until then the vehicles are independent of each other.
        """
        if self.thrown is not None and self.thrown.moving:
            return step
        if self.open or self.pairs.crushed or self.hitches or self._driven:
            return step
        until = self._apart_until_step if self.pairs.places else sys.maxsize
        until = until if self.thrown is None else self.thrown.alone_until(until)
        return until if self.roadside is None else self.roadside.alone_until(until)

    def _go_alone(self, step: int, until: int) -> None:
        """Advance to a later step with each vehicle by itself."""
        self.state = self.before = None
        for i, vehicle in enumerate(self.vehicles):
            for each in range(step, until):
                force = vehicle.road_force(each)
                vehicle.advance(force, self.step_s)
                if self.roadside is not None and vehicle.roll is not None and vehicle.crashed:
                    self.roadside.roll(i, vehicle, force, (each + 1) * self.step_s)
        if self.thrown is not None:
            self.thrown.walk(until * self.step_s)

    def _advance(self, step: int, forces: list[tuple[float, float, float]]) -> None:
        """Take one step under the road's forces on each vehicle."""
        if self.thrown is not None:
            self.thrown.advance(step, forces)
        else:
            self._advance_vehicles(step, forces)
        if self.roadside is not None:
            self.roadside.advance(step, forces)

    def _advance_vehicles(self, step: int, forces: list[tuple[float, float, float]]) -> None:
        if self.contact_possible(step):
            self.step_in_parts(step, [value for force in forces for value in force], self.parts)
        elif self.open or self.pairs.crushed:
            self.step_leaning(step, [value for force in forces for value in force])
        else:
            self.move_alone(forces)

    def move_alone(self, forces: list[tuple[float, float, float]]) -> None:
        self.state = self.before = None
        if self.hitches:
            flat = self.held([value for force in forces for value in force], self.step_s)
            forces = [(flat[k], flat[k + 1], flat[k + 2]) for k in range(0, len(flat), 3)]
        for vehicle, force in zip(self.vehicles, forces, strict=True):
            vehicle.advance(force, self.step_s)

    def _record(self, time_s: float) -> None:
        if self.thrown is not None:
            self.thrown.look(time_s)
        self._recorder.record(time_s)

    def _could_meet(self) -> list[tuple[Vehicle, Vehicle | Person]]:
        return [*self.pairs.vehicles, *(self.thrown.could_meet if self.thrown is not None else ())]

    def _ended(self, until_s: float, after_contact_s: float) -> tuple[Termination, str] | None:
        now_s = self._step * self.step_s
        for v in self._movers:
            if not (math.hypot(v.vx, v.vy) < _MAX_SPEED_MPS and math.hypot(v.x, v.y) < _MAX_DISTANCE_M):
                state = f"x {v.x:.3g} m, y {v.y:.3g} m, speed {math.hypot(v.vx, v.vy):.3g} m/s"
                who = party_name(self._bodies_of[v.number], v.number)
                return Termination.DIVERGED, f"{who} left all bounds at {now_s:.2f} s: {state}"
        first_s, planned = self._first_contact_s, self._step <= self._last_plan_step
        if first_s is None:
            if self._driven and all(driver.has_arrived for _, driver, _ in self._driven):
                return Termination.NO_CONTACT, f"no contact: whoever is driven had arrived after {now_s:.2f} s"
            if planned and now_s <= until_s:
                return None
            slides = any(vehicle.crashed and not vehicle.at_rest for vehicle in self.vehicles)
            if self.roadside is not None and slides:
                return None  # it may strike something yet, or overturn
            return Termination.NO_CONTACT, self._no_contact_reason()
        if now_s >= first_s + after_contact_s:
            return Termination.TIME_LIMIT, f"ended {after_contact_s:g} s after the first contact, as asked"
        if any(now_s < episode.ends_s for episode in self.open.values()):
            return None  # bodies that stand still at their deepest crush come back
        if all(v.at_rest and (v.crashed or v.stops or not planned) for v in self._movers):
            return (
                Termination.AT_REST,
                f"all {'participants' if self.people else 'vehicles'} at rest after {now_s:.2f} s",
            )
        return None

    def _no_contact_reason(self) -> str:
        """Return a sentence on the least distance of vehicles that could have met, from the logged states."""
        if self.roadside is not None and len(self.vehicles) == 1 and not self.people:
            return self.roadside.no_contact_reason(self.vehicles[0].number)
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
    def taken_over(self) -> BodyStates:
        """Return the present state, which MuJoCo has from here on."""
        if self.state is None:
            positions = [value for v in self.vehicles for value in (v.x, v.y, v.heading)]
            rates = [value for v in self.vehicles for value in (v.vx, v.vy, v.yaw_rate)]
            self.bodies.place(positions, rates)
            self.state = positions, rates
        return self.state

    def update(self, positions: list[float], rates: list[float]) -> None:
        self.state = positions, rates
        k = 0
        for v in self.vehicles:
            v.x, v.y, v.heading = positions[k : k + 3]
            v.vx, v.vy, v.yaw_rate = rates[k : k + 3]
            k += 3

    def _stand_on_surface(self) -> None:
        if self.roadside is not None:
            self.roadside.take_off_ground()
        if not self.surface.flat:
            for v in self._movers:
                if not v.ground.reaches(v.x, v.y):
                    v.ground = self.surface.at(v.x, v.y, v.z)
                v.z = v.ground.height_m(v.x, v.y)
            self.bodies.set_heights([v.z for v in self.vehicles])
        if self.thrown is not None:
            self.thrown.stand_on_road()
        if self.roadside is not None:
            self.roadside.stand_on_ground()

    def contact_possible(self, step: int) -> bool:
        """Return whether bodies may touch each other or an object within the next step, or a crash pulse lasts."""
        if self._vehicles_may_touch(step):
            if self.roadside is not None:
                self.roadside.look_again()  # what vehicles do to each other changes their speeds at once
            return True
        return self.roadside is not None and self.roadside.object_in_reach(step)

    def _vehicles_may_touch(self, step: int) -> bool:
        if step < self._apart_until_step:
            return False
        now_s = step * self.step_s
        apart_s = math.inf
        for i, j in self.pairs.places:
            one, two = self.vehicles[i], self.vehicles[j]
            episode = self.open.get((i, j))
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
            if (i, j) in self.pairs.crushed:
                continue
            turning = abs(one.yaw_rate) * one.reach_m + abs(two.yaw_rate) * two.reach_m
            travel = (closing + turning) * self.step_s * BOUND
            if same_level(one, two) and separation(one.outline(), two.outline())[0] <= travel:
                return True
        if apart_s < math.inf:
            self._apart_until_step = step + int(apart_s / self.step_s)
        return False

    def forces_now(self, forces: list[float], now_s: float, part_s: float) -> list[float]:
        """Return the forces on the vehicles in a part of a step.

        They come from the road, from crush, and from objects.
        """
        total = self.pairs.press(forces, now_s, part_s)
        return total if self.roadside is None else self.roadside.press(total, now_s, part_s)

    def held(self, forces: list[float], part_s: float) -> list[float]:
        """Return the given forces on the vehicles plus those of the hitches."""
        for hitch in self.hitches:
            hitch.hold(forces, part_s)
        return forces

    def _place_planned(self, time_s: float) -> None:
        """Move bodies on plans exactly to their planned places.

        These are people before a touch, and vehicles that skid.
        """
        if self.thrown is not None:
            self.thrown.bodies.carry(time_s)
        if self.roadside is not None:
            self.roadside.carry(time_s)

    def step_in_parts(self, step: int, forces: list[float], parts: int) -> None:
        part_s = self.step_s / parts
        for part in range(parts):
            start_s = step * self.step_s + part * part_s
            self._place_planned(start_s)
            now = self.taken_over()
            strikes = self.bodies.step(self.held(self.forces_now(forces, start_s, part_s), part_s), part_s)
            for pair, (fx, fy) in (*strikes.items(), *self.pairs.pressed_n.items()):
                if pair not in self.open:
                    # Found in the state a part begins with: this one came about in the part before.
                    self.open[pair] = self.begin(pair, self.before or now, now, start_s - part_s, part_s)
                self.open[pair].add(fx, fy, start_s + part_s, part_s)
                if pair in self.pairs.crushed:
                    self.open[pair].crush_m = self.pairs.crushed[pair].depths_m
            self.before = now
            self.update(*self.bodies.state)
            self.watch_contacts(start_s + part_s)
        self.close_ended((step + 1) * self.step_s)

    def step_leaning(self, step: int, forces: list[float]) -> None:
        """Advance by whole steps while bodies lean on each other, or lie in each other's dents."""
        self.before = None
        self.taken_over()
        total = self.forces_now(forces, step * self.step_s, self.step_s)
        self.bodies.step(self.held(total, self.step_s), self.step_s)
        self.update(*self.bodies.state)
        end_s = (step + 1) * self.step_s
        for pair in self.pairs.pressed_n:
            if pair in self.open:
                self.open[pair].last_s = end_s
        self.watch_contacts(end_s)
        self.close_ended(end_s)

    def watch_contacts(self, time_s: float) -> None:
        """Update the deepest overlap of vehicles, and whether strikes are over, or count as a crash to the vehicle."""
        for pair, episode in self.open.items():
            if pair[1] < len(self.vehicles):
                self.watch_overlap(pair, time_s)
            elif self.thrown is not None:
                self.thrown.watch_strike(pair, episode, time_s)

    def watch_overlap(self, pair: tuple[int, int], time_s: float) -> None:
        self._recorder.record_overlap(pair, -self.pairs.gap_m(pair), time_s)

    def close_ended(self, now_s: float) -> None:
        for pair, episode in list(self.open.items()):
            if now_s > episode.over_s:
                self._closed.append(self.open.pop(pair))
                self.wheels.after(episode, self.open.values())

    def begin(
        self, pair: tuple[int, int], before: BodyStates, now: BodyStates, before_s: float, part_s: float
    ) -> ContactEpisode:
        """Return a contact that began between two states a part of a step apart."""
        if self.thrown is not None and pair[1] >= len(self.vehicles):
            return self.thrown.begin(pair, before_s + part_s, part_s)
        one, two = (self.vehicles[i] for i in pair)
        one.crashed = two.crashed = True

        def motions(i: int) -> tuple[BodyMotion, BodyMotion]:
            first, second = (
                BodyMotion(*positions[3 * i : 3 * i + 3], *rates[3 * i : 3 * i + 3])
                for positions, rates in (before, now)
            )
            return first, second

        (one_before, one_now), (two_before, two_now) = (motions(i) for i in pair)
        episode = begin_contact(one, two, (one_before, two_before), (one_now, two_now), before_s, part_s)
        if not self.hitches:
            return episode
        pullers = [each.puller if isinstance(each, Towed) else None for each in (one, two)]
        pulled = [None if by is None else Pulled(by, *motions(self.vehicles.index(by))) for by in pullers]
        return of_combinations(episode, pulled, (episode.start_s - before_s) / part_s)
