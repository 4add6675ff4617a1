"""The default back-end: our vehicles and drivers over MuJoCo's rigid bodies and contacts, in this process.

Everything moves by one fixed step (semi-implicit Euler, forces held over the step). From the step in which two bodies
could come to touch until their crash pulse is over, MuJoCo takes the step in parts of half a millisecond at most, so
that the first touch is located within that time and then, by bisection between those two states, to the micrometre.
While nothing can touch, each body moves by the same scheme by itself. Nothing is random: equal input gives equal bits.
"""

from __future__ import annotations

import math
import time
from collections.abc import Mapping

import numpy as np

from trace_dag.roads.map.network import RoadNetwork
from trace_dag.settings import SimSettings
from trace_dag.sim.commanded import CommandedVehicle
from trace_dag.sim.driving import Driver
from trace_dag.sim.dynamics import Vehicle
from trace_dag.sim.outlines import separation
from trace_dag.sim.plan import check_participants, resample
from trace_dag.sim.recorder import BodyMotion, ContactEpisode, StateRecorder, begin_contact
from trace_dag.sim.rigid import RigidBodies
from trace_dag.sim.surface import NetworkSurface, Surface
from trace_dag.sim.types import Participant, Simulation, SimulationLog, Termination
from trace_dag.sim.vehicles import vehicle_model

VERSION = "2"
_CONTACT_STEP_S = 0.0005
_BOUND, _BOUND_MPS = 1.5, 10.0  # a closing speed may grow by so much until it is looked at again
_MAX_SPEED_MPS = 150.0
_MAX_DISTANCE_M = 5000.0


_State = tuple[list[float], list[float]]
"""Positions and rates of all bodies as MuJoCo has them: x, y, yaw of each centre of gravity, one after the other."""


class EmbeddedBackend:
    """No connection to keep: loading a map samples its surface."""

    name = "embedded"
    one_at_a_time = False

    def __init__(self, settings: SimSettings) -> None:
        self._settings = settings

    @staticmethod
    def require(settings: SimSettings) -> None:
        """It needs nothing that is not installed with this package."""

    def load(self, network: RoadNetwork, xodr: bytes, *, friction: float) -> Simulation:
        """Make a map's surface ready."""
        return EmbeddedSimulation(self._settings, NetworkSurface(network), friction)

    def close(self) -> None:
        """Nothing to release."""


class EmbeddedSimulation:
    """Runs on one surface, with one tyre-road friction."""

    def __init__(self, settings: SimSettings, surface: Surface | NetworkSurface, friction: float) -> None:
        self._settings = settings
        self._surface = surface
        self._friction = friction

    def run(
        self,
        participants: tuple[Participant, ...],
        *,
        time_limit_s: float,
        drivers: Mapping[int, Driver] | None = None,
        after_contact_s: float | None = None,
    ) -> SimulationLog:
        """Simulate until rest or ``time_limit_s``; :class:`trace_dag.errors.Failure` for a plan nobody can drive."""
        check_participants(participants)
        paths = [np.stack([p.trajectory.x_m, p.trajectory.y_m], axis=-1) for p in participants]
        surface = self._surface.around(np.concatenate(paths)) if paths else Surface()
        run = _Run(self._settings, surface, self._friction, participants, time_limit_s, drivers or {}, after_contact_s)
        return run.log()


class _Run:
    def __init__(
        self,
        settings: SimSettings,
        surface: Surface,
        friction: float,
        participants: tuple[Participant, ...],
        time_limit_s: float,
        drivers: Mapping[int, Driver],
        after_contact_s: float | None,
    ) -> None:
        self._began = time.perf_counter()
        self._step_s = settings.step_s
        self._parts = max(1, math.ceil(settings.step_s / _CONTACT_STEP_S - 1e-9))
        self._log_every = max(1, round(settings.log_step_s / settings.step_s))
        self._steps = math.ceil(time_limit_s / settings.step_s)
        self._surface = surface
        self._participants = participants
        self._after_contact_s = after_contact_s
        self._vehicles: list[Vehicle] = []
        self._driven: list[tuple[CommandedVehicle, Driver, int]] = []  # and the steps from one command to the next
        for participant in participants:
            model = vehicle_model(participant.body)
            plan = resample(participant.trajectory, settings.step_s, time_limit_s, model.cg_ahead_m)
            common = {"friction": friction, "locked_wheels": settings.locked_wheels}
            driver = drivers.get(participant.number)
            if driver is None:
                self._vehicles.append(Vehicle(participant, model, plan, **common))
                continue
            vehicle = CommandedVehicle(participant, model, plan, **common, step_s=settings.step_s)
            self._vehicles.append(vehicle)
            self._driven.append((vehicle, driver, max(1, round(driver.period_s / settings.step_s))))
        self._bodies = RigidBodies([v.model for v in self._vehicles], settings.restitution, settings.contact_friction)
        self._recorder = StateRecorder(self._vehicles)
        self._open: dict[tuple[int, int], ContactEpisode] = {}
        self._closed: list[ContactEpisode] = []
        self._state: _State | None = None  # as MuJoCo has it; None while bodies move by themselves
        self._apart_until_step = 0  # no two bodies can touch before it
        self._before: _State | None = None  # the state a part of a step ago, while steps are taken in parts
        self._pairs = [(i, j) for j in range(len(self._vehicles)) for i in range(j)]

    def log(self) -> SimulationLog:
        self._bodies.set_heights([v.z for v in self._vehicles])
        self._stand_on_surface()
        termination, reason, step = self._advance_until_end()
        duration_s = step * self._step_s
        self._recorder.record(duration_s)
        episodes = sorted([*self._closed, *self._open.values()], key=lambda episode: episode.start_s)
        return SimulationLog(
            backend=EmbeddedBackend.name,
            backend_version=f"{VERSION} (mujoco {self._bodies.version})",
            step_s=self._step_s,
            vehicles=self._recorder.logs(),
            contacts=tuple(episode.contact() for episode in episodes),
            bodies={p.number: p.body for p in self._participants},
            termination=termination,
            reason=reason,
            duration_s=duration_s,
            wall_s=time.perf_counter() - self._began,
        )

    def _advance_until_end(self) -> tuple[Termination, str, int]:
        for i, j in self._pairs:
            one, two = self._vehicles[i], self._vehicles[j]
            if self._same_level(one, two) and separation(one.outline(), two.outline())[0] <= 0:
                reason = f"vehicles {one.number} and {two.number} overlap at the start"
                return Termination.STARTED_IN_CONTACT, reason, 0
        vehicles, recorder = self._vehicles, self._recorder
        last_plan_step = round(max((v.plan_end_s for v in vehicles), default=0.0) / self._step_s)
        for step in range(self._steps):
            if step % self._log_every == 0:
                self._stand_on_surface()
                recorder.record(step * self._step_s)
                ended = self._ended(step, last_plan_step)
                if ended is not None:
                    return *ended, step
            for driven, driver, every in self._driven:
                if step % every == 0 and not driven.crashed:
                    driven.command(driver.drive(step * self._step_s, {v.number: v.body_state() for v in vehicles}))
            forces = [vehicle.road_force(step) for vehicle in vehicles]
            if self._contact_possible(step):
                self._step_in_parts(step, [value for force in forces for value in force])
            elif self._open:
                self._step_leaning(step, [value for force in forces for value in force])
            else:
                self._state = self._before = None
                for vehicle, force in zip(vehicles, forces, strict=True):
                    vehicle.advance(force, self._step_s)
        limit_s = self._steps * self._step_s
        if not self._open and not self._closed:
            return Termination.NO_CONTACT, self._no_contact_reason(), self._steps
        return Termination.TIME_LIMIT, f"still moving after {limit_s:g} s", self._steps

    def _ended(self, step: int, last_plan_step: int) -> tuple[Termination, str] | None:
        for v in self._vehicles:
            if not (math.hypot(v.vx, v.vy) < _MAX_SPEED_MPS and math.hypot(v.x, v.y) < _MAX_DISTANCE_M):
                state = f"x {v.x:.3g} m, y {v.y:.3g} m, speed {math.hypot(v.vx, v.vy):.3g} m/s"
                reason = f"vehicle {v.number} left all bounds at {step * self._step_s:.2f} s: {state}"
                return Termination.DIVERGED, reason
        if not self._open and not self._closed:
            return (Termination.NO_CONTACT, self._no_contact_reason()) if step > last_plan_step else None
        if self._after_contact_s is not None:
            first_s = min(episode.start_s for episode in [*self._closed, *self._open.values()])
            if step * self._step_s >= first_s + self._after_contact_s:
                return Termination.TIME_LIMIT, f"ended {self._after_contact_s:g} s after the first contact, as asked"
        if all(v.at_rest and (v.crashed or step > last_plan_step) for v in self._vehicles):
            return Termination.AT_REST, f"all vehicles at rest after {step * self._step_s:.2f} s"
        return None

    def _no_contact_reason(self) -> str:
        """Says how near the vehicles came to each other, from the logged states."""
        nearest, when, numbers = math.inf, 0.0, (0, 0)
        logs = self._recorder.logs()
        for i, j in self._pairs:
            distance = np.hypot(logs[i].x_m - logs[j].x_m, logs[i].y_m - logs[j].y_m)
            k = int(distance.argmin())
            if distance[k] < nearest:
                nearest, when = float(distance[k]), float(logs[i].time_s[k])
                numbers = (logs[i].number, logs[j].number)
        if nearest == math.inf:
            return "nothing to collide with: fewer than two participants"
        return f"no contact: vehicles {numbers[0]} and {numbers[1]} came to {nearest:.1f} m (centres) at {when:.2f} s"

    # --- steps -----------------------------------------------------------------------------------------------
    def _taken_over(self) -> _State:
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
        for v in self._vehicles:
            if not v.ground.reaches(v.x, v.y):
                v.ground = self._surface.at(v.x, v.y, v.z)
            v.z = v.ground.height_m(v.x, v.y)
        self._bodies.set_heights([v.z for v in self._vehicles])

    @staticmethod
    def _same_level(one: Vehicle, two: Vehicle) -> bool:
        return one.z < two.z + two.model.body.height_m and two.z < one.z + one.model.body.height_m

    def _contact_possible(self, step: int) -> bool:
        """Whether two bodies may come to touch within the next step, or a crash pulse is under way."""
        if step < self._apart_until_step:
            return False
        now_s = step * self._step_s
        apart_s = math.inf
        for i, j in self._pairs:
            one, two = self._vehicles[i], self._vehicles[j]
            episode = self._open.get((i, j))
            if episode is not None:
                if now_s < episode.pulse_end_s:
                    return True
                apart_s = 0.0
                continue
            between_m = math.hypot(one.x - two.x, one.y - two.y) - one.reach_m - two.reach_m
            closing = math.hypot(one.vx - two.vx, one.vy - two.vy)
            if between_m > 0:
                apart_s = min(apart_s, between_m / (_BOUND * closing + _BOUND_MPS))
                continue
            apart_s = 0.0
            turning = abs(one.yaw_rate) * one.reach_m + abs(two.yaw_rate) * two.reach_m
            travel = (closing + turning) * self._step_s * _BOUND
            if self._same_level(one, two) and separation(one.outline(), two.outline())[0] <= travel:
                return True
        if apart_s < math.inf:
            self._apart_until_step = step + int(apart_s / self._step_s)
        return False

    def _step_in_parts(self, step: int, forces: list[float]) -> None:
        part_s = self._step_s / self._parts
        for part in range(self._parts):
            start_s = step * self._step_s + part * part_s
            now = self._taken_over()
            for pair, (fx, fy) in self._bodies.step(forces, part_s).items():
                if pair not in self._open:
                    # MuJoCo finds contacts in the state a step begins with: this one came about in the part before.
                    self._open[pair] = self._begin(pair, self._before or now, now, start_s - part_s, part_s)
                self._open[pair].add(fx, fy, start_s + part_s, part_s)
            self._before = now
            self._update(*self._bodies.state)
            self._record_overlaps(start_s + part_s)
        self._close_ended((step + 1) * self._step_s)

    def _step_leaning(self, step: int, forces: list[float]) -> None:
        """Bodies that lean on each other: the contact needs its short steps, but nobody needs to look at each."""
        self._before = None
        self._taken_over()
        touching = self._bodies.step(forces, self._step_s / self._parts, self._parts)
        self._update(*self._bodies.state)
        end_s = (step + 1) * self._step_s
        for pair in touching:
            if pair in self._open:
                self._open[pair].last_s = end_s
        self._record_overlaps(end_s)
        self._close_ended(end_s)

    def _record_overlaps(self, time_s: float) -> None:
        for pair in self._open:
            one, two = (self._vehicles[i].outline() for i in pair)
            self._recorder.record_overlap(pair, -separation(one, two)[0], time_s)

    def _close_ended(self, now_s: float) -> None:
        for pair, episode in list(self._open.items()):
            if now_s > episode.over_s:
                self._closed.append(self._open.pop(pair))

    def _begin(
        self, pair: tuple[int, int], before: _State, now: _State, before_s: float, part_s: float
    ) -> ContactEpisode:
        """A contact that came about between two states a part of a step from each other."""
        one, two = (self._vehicles[i] for i in pair)
        one.crashed = two.crashed = True
        (one_before, one_now), (two_before, two_now) = (
            [BodyMotion(*positions[3 * i : 3 * i + 3], *rates[3 * i : 3 * i + 3]) for positions, rates in (before, now)]
            for i in pair
        )
        return begin_contact(one, two, (one_before, two_before), (one_now, two_now), before_s, part_s)
