"""A run with people or animals in it: they move along their plans until a vehicle touches them, and are thrown.

Steps are taken in parts of about a millisecond while a vehicle may touch a person, and whole where people only fly and
slide. A striking driver goes on (:mod:`trace_dag.sim.after_strike`) unless the strike changes the vehicle's velocity by
as much as makes an event data recorder wake up: that is a crash for who drives, a motorcyclist for example.
"""

from __future__ import annotations

import math
from itertools import product

from trace_dag.errors import Failure
from trace_dag.sim.dynamics import Vehicle
from trace_dag.sim.outlines import separation
from trace_dag.sim.people import Person
from trace_dag.sim.plan import resample
from trace_dag.sim.recorder import BodyMotion, ContactEpisode, Pulled, begin_strike, of_combinations
from trace_dag.sim.run_of_vehicles import BOUND, BOUND_MPS, BodyStates, VehicleRun
from trace_dag.sim.scene import FigureBodies
from trace_dag.sim.towing import Towed
from trace_dag.sim.types import party_name
from trace_dag.sim.vehicle_pairs import same_level

_STRIKE_STEP_S = 0.00125
_NEAR_STEP_S = 0.0025
_FLIGHT_STEP_S = 0.005
_TOUCHED_S = 0.03  # so long after a touch the next one of the same strike is waited for with short steps
_PUSHED_MPS = 3.0  # of the pelvis against the vehicle: who moves faster is struck again
_NEAR_M = 0.1  # a figure's hands and feet may reach so far out of its outline


class PeopleRun(VehicleRun):
    """A run of motor vehicles and people, or animals."""

    _bodies: FigureBodies

    def _make_people(self) -> list[Person]:
        self._everybody = "participants"
        self._on_road = False
        self._sliding: set[tuple[int, int]] = set()  # pairs whose strike is over
        self._people_apart_until_step = 0  # no vehicle can touch a person before it
        self._strikes_in_parts = max(1, math.ceil(self._step_s / _STRIKE_STEP_S - 1e-9))
        self._near_in_parts = max(1, math.ceil(self._step_s / _NEAR_STEP_S - 1e-9))
        self._flight_in_parts = max(1, math.ceil(self._step_s / _FLIGHT_STEP_S - 1e-9))
        people = []
        for participant in self._participants:
            if not participant.body.is_figure:
                continue
            if participant.number in self._drivers:
                who = party_name(participant.body, participant.number)
                raise Failure(f"{who} has a driver; only motor vehicles are driven, people move along their trajectory")
            plan = resample(participant.trajectory, self._step_s, self._time_limit_s, 0.0)
            people.append(Person(participant, plan, self._step_s))
        return people

    def _make_bodies(self) -> FigureBodies:
        settings = self._settings
        scene = FigureBodies(
            [v.model for v in self._vehicles],
            self._people,
            person_friction=min(settings.person_friction, self._friction / settings.friction),
        )
        self._chances = list(product(range(len(self._vehicles)), range(len(self._people))))
        return scene

    def _could_meet(self) -> list[tuple[Vehicle, Vehicle | Person]]:
        return super()._could_meet() + [(self._vehicles[i], self._people[j]) for i, j in self._chances]

    def _stand_on_surface(self) -> None:
        super()._stand_on_surface()
        if not (self._surface.flat and self._on_road):
            self._bodies.stand_on_road(self._vehicles)
            self._on_road = True

    def _record(self, time_s: float) -> None:
        self._bodies.carry(time_s)
        self._bodies.look(time_s)
        super()._record(time_s)

    # --- steps -----------------------------------------------------------------------------------------------
    def _alone_until(self, step: int) -> int:
        if any(person.crashed and not person.at_rest for person in self._people):
            return step
        until = super()._alone_until(step)
        return min(until, self._people_apart_until_step) if self._chances else until

    def _go_alone(self, step: int, until: int) -> None:
        super()._go_alone(step, until)
        for person in self._people:
            if not person.crashed:
                person.walk(until * self._step_s)

    def _advance(self, step: int, forces: list[tuple[float, float, float]]) -> None:
        flat = [value for force in forces for value in force]
        end_s = (step + 1) * self._step_s
        if self._contact_possible(step):
            self._step_in_parts(step, flat, self._parts)
        elif parts := self._strike_parts(step):
            self._step_of_people(step, flat, parts)
        elif self._pairs.crushed or self._vehicles_lean():
            self._bodies.carry(step * self._step_s)
            self._step_leaning(step, flat)
        elif any(person.crashed and not person.at_rest for person in self._people):
            if self._bodies.lying_still:
                self._slide(forces, end_s)
            else:
                self._step_of_people(step, flat, self._flight_in_parts)
        else:
            self._move_alone(forces)
            self._close_ended(end_s)
        for person in self._people:
            if not person.crashed:
                person.walk(end_s)
        self._bodies.follow()

    def _place_people(self, time_s: float) -> None:
        self._bodies.carry(time_s)

    def _step_of_people(self, step: int, forces: list[float], parts: int) -> None:
        """A step in which no two vehicles can come to touch."""
        part_s = self._step_s / parts
        self._before = None
        self._taken_over()
        for part in range(parts):
            start_s = step * self._step_s + part * part_s
            walking = not all(person.crashed for person in self._people)
            if walking:
                self._bodies.carry(start_s)
            if walking or self._hitches:
                self._update(*self._bodies.state)
            total = self._held(self._forces_now(forces, start_s, part_s), part_s)
            for pair, (fx, fy) in self._bodies.step(total, part_s).items():
                if pair not in self._open:
                    now = self._state or self._bodies.state
                    self._open[pair] = self._begin(pair, now, now, start_s - part_s, part_s)
                self._open[pair].add(fx, fy, start_s + part_s, part_s)
            self._watch_contacts(start_s + part_s)
        self._update(*self._bodies.state)
        self._close_ended((step + 1) * self._step_s)

    def _slide(self, forces: list[tuple[float, float, float]], end_s: float) -> None:
        """A step in which people slide as one body each, and vehicles move alone."""
        self._move_alone(forces)
        self._bodies.slide(self._step_s)
        self._watch_contacts(end_s)
        self._close_ended(end_s)

    def _vehicles_lean(self) -> bool:
        return any(two < len(self._vehicles) for _, two in self._open)

    def _strike_parts(self, step: int) -> int:
        """The number of parts to take the next step in because a vehicle may come to touch a person in it, or goes on
        to; 0 if none can."""
        if step < self._people_apart_until_step:
            return 0
        now_s = step * self._step_s
        apart_s, parts = math.inf, 0
        for i, j in self._chances:
            vehicle, person = self._vehicles[i], self._people[j]
            if vehicle.at_rest and person.at_rest:
                apart_s = 0.0  # either may move again
                continue
            away_m = math.hypot(vehicle.x - person.x, vehicle.y - person.y) - vehicle.reach_m - person.reach_m - _NEAR_M
            closing = math.hypot(vehicle.vx - person.vx, vehicle.vy - person.vy)
            if away_m > 0:
                apart_s = min(apart_s, away_m / (BOUND * closing + BOUND_MPS))
                continue
            apart_s = 0.0
            travel = (closing + abs(vehicle.yaw_rate) * vehicle.reach_m) * self._step_s * BOUND + _NEAR_M
            if same_level(vehicle, person) and separation(vehicle.outline(), person.outline())[0] <= travel:
                parts = max(parts, self._parts_near((i, j + len(self._vehicles)), now_s, closing))
        if apart_s < math.inf:
            self._people_apart_until_step = step + int(apart_s / self._step_s)
        return parts

    def _parts_near(self, pair: tuple[int, int], now_s: float, closing_mps: float) -> int:
        """The number of parts to take a step in for a vehicle and a person who are near each other.

        In a whole step nobody who is not seen near the other yet comes to touch.
        """
        episode = self._open.get(pair)
        if episode is None:
            unseen = self._people[pair[1] - len(self._vehicles)].crashed and not self._bodies.is_near(pair)
            return self._flight_in_parts if unseen else self._strikes_in_parts
        if now_s - episode.last_s < _TOUCHED_S:
            slides = closing_mps < _PUSHED_MPS or self._runs_ahead(pair)
            return self._flight_in_parts if now_s > episode.pulse_end_s and slides else self._strikes_in_parts
        return self._near_in_parts if self._bodies.is_near(pair) else self._flight_in_parts

    def _runs_ahead(self, pair: tuple[int, int]) -> bool:
        """Whether a person is faster than the vehicle along it, as who slides off the hood of one that brakes: nothing
        strikes them."""
        vehicle, person = self._vehicles[pair[0]], self._people[pair[1] - len(self._vehicles)]
        c, s = math.cos(vehicle.heading), math.sin(vehicle.heading)
        return (person.vx - vehicle.vx) * c + (person.vy - vehicle.vy) * s > 0

    # --- contacts --------------------------------------------------------------------------------------------
    def _begin(
        self, pair: tuple[int, int], before: BodyStates, now: BodyStates, before_s: float, part_s: float
    ) -> ContactEpisode:
        if pair[1] < len(self._vehicles):
            return super()._begin(pair, before, now, before_s, part_s)
        vehicle, person = self._vehicles[pair[0]], self._people[pair[1] - len(self._vehicles)]
        now_s = before_s + part_s
        if person.crashed:
            self._bodies.follow()
        deepest = max(self._bodies.touches[pair], key=lambda touch: touch.depth_m)
        episode = begin_strike(vehicle, person, deepest, now_s, part_s)
        if isinstance(vehicle, Towed):
            by = vehicle.puller
            motion = BodyMotion(by.x, by.y, by.heading, by.vx, by.vy, by.yaw_rate)
            episode = of_combinations(episode, (Pulled(by, motion, motion), None), 0.0)
        person.crashed = True
        self._wheels.react(vehicle, now_s)
        return episode

    def _watch_contacts(self, time_s: float) -> None:
        """Of vehicles the deepest overlap; of strikes whether they are over, or a crash to the vehicle."""
        for pair, episode in self._open.items():
            if pair[1] < len(self._vehicles):
                self._watch_overlap(pair, time_s)
                continue
            if time_s > episode.pulse_end_s and pair not in self._sliding:
                self._sliding.add(pair)
                self._bodies.let_slide(pair)
            if not episode.one.crashed and self._wheels.is_crash(episode.impulse_ns, episode.masses_kg[0]):
                self._wheels.lose(episode.one)
