"""People and animals of a run: they move along their plans until a vehicle touches them, and are thrown.

Steps are taken in parts of about a millisecond while a vehicle may touch a person, and whole where people only fly and
slide. A striking driver goes on (:mod:`trace_dag.simulation.post_impact_driving`), unless the strike changes the
vehicle's velocity by the threshold of event data recorders. That counts as a crash, for a motorcyclist for example.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from itertools import product

from trace_dag.simulation.dynamics import Vehicle
from trace_dag.simulation.outlines import separation
from trace_dag.simulation.people import Person
from trace_dag.simulation.plan import resample
from trace_dag.simulation.recorder import BodyMotion, ContactEpisode, Pulled, begin_strike, of_combinations
from trace_dag.simulation.run_state import RunState
from trace_dag.simulation.scene import FigureBodies
from trace_dag.simulation.towing import Towed
from trace_dag.simulation.types import Participant
from trace_dag.simulation.vehicle_pairs import BOUND, BOUND_MPS, same_level

_STRIKE_STEP_S = 0.00125
_NEAR_STEP_S = 0.0025
_FLIGHT_STEP_S = 0.005
_TOUCHED_S = 0.03  # so long after a touch the next one of the same strike is waited for with short steps
_PUSHED_MPS = 3.0  # of the pelvis against the vehicle: who moves faster is struck again
_CARRIED_S = 0.8  # longer than this nobody stays on a vehicle: who wraps onto a hood is off it within a second
_ROLLS_OFF_MPS = 3.0
_NEAR_M = 0.1  # a figure's hands and feet may reach so far out of its outline


def people_of(participants: Sequence[Participant], step_s: float, time_limit_s: float) -> list[Person]:
    """Return the people and animals among the participants."""
    people = []
    for participant in participants:
        if not participant.body.is_figure:
            continue
        plan = resample(participant.trajectory, step_s, time_limit_s, 0.0)
        people.append(Person(participant, plan, step_s))
    return people


class ThrownPeople:
    """The people and animals of a run."""

    def __init__(self, run: RunState) -> None:
        self._run = run
        self._on_road = False
        self._sliding: set[tuple[int, int]] = set()  # pairs whose strike is over
        self._touched_s: dict[tuple[int, int], float] = {}  # when each pair touched first
        self._let_go: set[tuple[int, int]] = set()
        self._apart_until_step = 0  # no vehicle can touch a person before it
        self._strikes_in_parts = max(1, math.ceil(run.step_s / _STRIKE_STEP_S - 1e-9))
        self._near_in_parts = max(1, math.ceil(run.step_s / _NEAR_STEP_S - 1e-9))
        self._flight_in_parts = max(1, math.ceil(run.step_s / _FLIGHT_STEP_S - 1e-9))
        settings = run.settings
        self.bodies = FigureBodies(
            [vehicle.model for vehicle in run.vehicles],
            run.people,
            person_friction=min(settings.person_friction, run.friction / settings.friction),
        )
        self._chances = list(product(range(len(run.vehicles)), range(len(run.people))))

    @property
    def could_meet(self) -> list[tuple[Vehicle, Person]]:
        """Return every vehicle with every person."""
        return [(self._run.vehicles[i], self._run.people[j]) for i, j in self._chances]

    @property
    def moving(self) -> bool:
        """Return whether a touched person or animal still moves."""
        return any(person.crashed and not person.at_rest for person in self._run.people)

    def stand_on_road(self) -> None:
        """Put people on the road's surface under them."""
        if not (self._run.surface.flat and self._on_road):
            self.bodies.stand_on_road(self._run.vehicles)
            self._on_road = True

    def look(self, time_s: float) -> None:
        """Record the posture of all people."""
        self.bodies.carry(time_s)
        self.bodies.look(time_s)

    def alone_until(self, until: int) -> int:
        """Return the step before which no vehicle can touch a person, at most another one."""
        return min(until, self._apart_until_step) if self._chances else until

    def walk(self, time_s: float) -> None:
        """Move untouched people along their plans."""
        for person in self._run.people:
            if not person.crashed:
                person.walk(time_s)

    # --- steps -----------------------------------------------------------------------------------------------
    def advance(self, step: int, forces: list[tuple[float, float, float]]) -> None:
        """Take one step under the road's forces on each vehicle."""
        flat = [value for force in forces for value in force]
        end_s = (step + 1) * self._run.step_s
        if self._run.contact_possible(step):
            self._run.step_in_parts(step, flat, self._run.parts)
        elif parts := self._strike_parts(step):
            self._step_of_people(step, flat, parts)
        elif self._run.pairs.crushed or self._vehicles_lean():
            self.bodies.carry(step * self._run.step_s)
            self._run.step_leaning(step, flat)
        elif self.moving:
            if self.bodies.lying_still:
                self._slide(forces, end_s)
            else:
                self._step_of_people(step, flat, self._flight_in_parts)
        else:
            self._run.move_alone(forces)
            self._run.close_ended(end_s)
        self.walk(end_s)
        self.bodies.follow()

    def _step_of_people(self, step: int, forces: list[float], parts: int) -> None:
        """Take a step in which no two vehicles can touch."""
        part_s = self._run.step_s / parts
        self._run.before = None
        self._run.taken_over()
        for part in range(parts):
            start_s = step * self._run.step_s + part * part_s
            walking = not all(person.crashed for person in self._run.people)
            if walking:
                self.bodies.carry(start_s)
            if walking or self._run.hitches:
                self._run.update(*self.bodies.state)
            total = self._run.held(self._run.forces_now(forces, start_s, part_s), part_s)
            for pair, (fx, fy) in self.bodies.step(total, part_s).items():
                if pair not in self._run.open:
                    now = self._run.state or self.bodies.state
                    self._run.open[pair] = self._run.begin(pair, now, now, start_s - part_s, part_s)
                self._run.open[pair].add(fx, fy, start_s + part_s, part_s)
            self._run.watch_contacts(start_s + part_s)
        self._run.update(*self.bodies.state)
        self._run.close_ended((step + 1) * self._run.step_s)

    def _slide(self, forces: list[tuple[float, float, float]], end_s: float) -> None:
        """Take a step in which people slide as one body each, and vehicles move alone."""
        self._run.move_alone(forces)
        self.bodies.slide(self._run.step_s)
        self._run.watch_contacts(end_s)
        self._run.close_ended(end_s)

    def _vehicles_lean(self) -> bool:
        return any(two < len(self._run.vehicles) for _, two in self._run.open)

    def _strike_parts(self, step: int) -> int:
        """Return the number of parts for the next step; 0 if no vehicle can touch a person in it."""
        if step < self._apart_until_step:
            return 0
        now_s = step * self._run.step_s
        apart_s, parts = math.inf, 0
        for i, j in self._chances:
            vehicle, person = self._run.vehicles[i], self._run.people[j]
            if vehicle.at_rest and person.at_rest:
                apart_s = 0.0  # either may move again
                continue
            away_m = math.hypot(vehicle.x - person.x, vehicle.y - person.y) - vehicle.reach_m - person.reach_m - _NEAR_M
            closing = math.hypot(vehicle.vx - person.vx, vehicle.vy - person.vy)
            if away_m > 0:
                apart_s = min(apart_s, away_m / (BOUND * closing + BOUND_MPS))
                continue
            apart_s = 0.0
            travel = (closing + abs(vehicle.yaw_rate) * vehicle.reach_m) * self._run.step_s * BOUND + _NEAR_M
            if same_level(vehicle, person) and separation(vehicle.outline(), person.outline())[0] <= travel:
                parts = max(parts, self._parts_near((i, j + len(self._run.vehicles)), now_s, closing))
        if apart_s < math.inf:
            self._apart_until_step = step + int(apart_s / self._run.step_s)
        return parts

    def _parts_near(self, pair: tuple[int, int], now_s: float, closing_mps: float) -> int:
        """Return the number of parts for a step of a vehicle and a person who are near each other.

        In a whole step, no person can touch a vehicle without being near it before.
        """
        episode = self._run.open.get(pair)
        if episode is None:
            unseen = self._person(pair).crashed and not self.bodies.is_near(pair)
            return self._flight_in_parts if unseen else self._strikes_in_parts
        if now_s - episode.last_s < _TOUCHED_S:
            slides = closing_mps < _PUSHED_MPS or self._runs_ahead(pair)
            return self._flight_in_parts if now_s > episode.pulse_end_s and slides else self._strikes_in_parts
        return self._near_in_parts if self.bodies.is_near(pair) else self._flight_in_parts

    def _runs_ahead(self, pair: tuple[int, int]) -> bool:
        """Return whether a person moves ahead faster than the vehicle, as after sliding off a braking one's hood.

        The vehicle cannot strike such a person.
        """
        vehicle, person = self._vehicle(pair), self._person(pair)
        c, s = math.cos(vehicle.heading), math.sin(vehicle.heading)
        return (person.vx - vehicle.vx) * c + (person.vy - vehicle.vy) * s > 0

    # --- contacts --------------------------------------------------------------------------------------------
    def begin(self, pair: tuple[int, int], now_s: float, part_s: float) -> ContactEpisode:
        """Return a strike that began in a part of a step."""
        vehicle, person = self._vehicle(pair), self._person(pair)
        if person.crashed:
            self.bodies.follow()
        deepest = max(self.bodies.touches[pair], key=lambda touch: touch.depth_m)
        episode = begin_strike(vehicle, person, deepest, now_s, part_s)
        if isinstance(vehicle, Towed):
            by = vehicle.puller
            motion = BodyMotion(by.x, by.y, by.heading, by.vx, by.vy, by.yaw_rate)
            episode = of_combinations(episode, (Pulled(by, motion, motion), None), 0.0)
        seen_for_s = 0.0 if person.crashed else person.in_the_lane_s(vehicle.outline(), now_s)
        person.crashed = True
        self._touched_s.setdefault(pair, now_s)
        self._run.wheels.react(vehicle, now_s, seen_for_s=seen_for_s)
        return episode

    def watch_strike(self, pair: tuple[int, int], episode: ContactEpisode, time_s: float) -> None:
        """Watch whether a strike is over, or a crash to the vehicle."""
        if time_s > episode.pulse_end_s and pair not in self._sliding:
            self._sliding.add(pair)
            self.bodies.let_slide(pair)
        if pair in self._sliding - self._let_go and pair in self.bodies.touches:
            self._let_go_of(pair, time_s)
        if not episode.one.crashed and self._run.wheels.is_crash(episode.impulse_ns, episode.masses_kg[0]):
            self._run.wheels.lose(episode.one)

    def _let_go_of(self, pair: tuple[int, int], time_s: float) -> None:
        """Let a person who is still carried slide off the vehicle when it brakes, or else roll off to its side."""
        vehicle, person = self._vehicle(pair), self._person(pair)
        carried_s = time_s - self._touched_s[pair]
        late = carried_s > _CARRIED_S
        if not late and not (vehicle.stops and carried_s > _CARRIED_S / 2):
            return
        self._let_go.add(pair)
        c, s = math.cos(vehicle.heading), math.sin(vehicle.heading)
        left_m = (person.y - vehicle.y) * c - (person.x - vehicle.x) * s
        off_mps = math.copysign(_ROLLS_OFF_MPS, left_m) if late else 0.0
        self.bodies.let_go(pair, (-off_mps * s, off_mps * c))

    def _vehicle(self, pair: tuple[int, int]) -> Vehicle:
        return self._run.vehicles[pair[0]]

    def _person(self, pair: tuple[int, int]) -> Person:
        return self._run.people[pair[1] - len(self._run.vehicles)]
