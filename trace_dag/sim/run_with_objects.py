"""A run of vehicles beside the road: fixed objects, ground that is not a pavement, and vehicles out of control.

Steps are taken in short parts while a vehicle may touch an object. Whoever strikes an object is no longer driven,
unless it is driven over; a motorcycle falls even then. Beyond the carriageway tyres hold as on grass or gravel. A
vehicle that skids moves along its trajectory exactly, however it is turned, until it strikes something; one that an
agent drives does not skid.
"""

from __future__ import annotations

import math
from collections.abc import Mapping

from trace_dag.crash.record import VehicleClass
from trace_dag.settings import SimSettings
from trace_dag.sim.beyond_edge import LEVEL, Bank, BeyondEdge, onto_slope
from trace_dag.sim.driving import Driver
from trace_dag.sim.dynamics import Vehicle
from trace_dag.sim.obstacles import Obstacle, Struck
from trace_dag.sim.outlines import corners, separation
from trace_dag.sim.overturn import Roll
from trace_dag.sim.run_of_vehicles import BOUND, BOUND_MPS, VehicleRun
from trace_dag.sim.run_with_people import PeopleRun
from trace_dag.sim.surface import Ground, Surface
from trace_dag.sim.towing import Towed
from trace_dag.sim.types import OVERTURNED_RAD, Contact, Participant, Termination
from trace_dag.states.objects import FixedObject, Resistance
from trace_dag.units import GRAVITY_MPS2

_NEAR_M = 1.0
_CURB = 33  # SOE
_SQUARELY = 0.7  # cosine between a kerb's normal and the vehicle's side, for its wheels to catch
_SLIDES_MPS = 0.5
_JOINS_M = 1.5  # who is farther from the plan lost control before it, and slides from where it is
_FURROW_M, _FURROW_GRIP = 2.0, 1.8
"""Wheels that slide sideways on soil dig in within so far, and hold so much of the load then: judgement by tests in
which cars tripped on soil were slowed down by 1.0 to 2.0 g (Cooperrider, Thomas and Hammoud, SAE 900366)."""


class RoadsideRun(VehicleRun):
    """A run of vehicles with fixed objects beside the road."""

    def __init__(
        self,
        settings: SimSettings,
        surface: Surface,
        friction: float,
        participants: tuple[Participant, ...],
        time_limit_s: float,
        drivers: Mapping[int, Driver],
        *,
        objects: tuple[FixedObject, ...],
        beyond: BeyondEdge,
    ) -> None:
        super().__init__(settings, surface, friction, participants, time_limit_s, drivers)
        self._items = objects
        self._obstacles = [Obstacle.of(item) for item in objects]
        self._touching: dict[tuple[int, int], Struck] = {}
        self._struck: list[Struck] = []  # all contacts with objects, in the order they began
        self._beyond = beyond
        self._banks = [LEVEL] * len(self._vehicles)  # the ground that each stands on, beyond the edge
        self._ahead = [LEVEL] * len(self._vehicles)  # and that its foremost corner came to
        self._roads = [vehicle.ground for vehicle in self._vehicles]  # the road's surface under or beside each
        self._road_z_m = [vehicle.z for vehicle in self._vehicles]
        self._on_soil = [False] * len(self._vehicles)
        self._furrows_m = [0.0] * len(self._vehicles)  # so far each has slid sideways on soil
        self._overturned_s: float | None = None
        self._clear_until_step = 0  # no vehicle can touch an object before it
        # Where each vehicle was when the objects were looked at last, and how far from there it touches none.
        self._clear = [(vehicle.x, vehicle.y, vehicle.heading, 0.0) for vehicle in self._vehicles]
        self._skids = [vehicle for vehicle in self._vehicles if vehicle.skids_from_s < math.inf]
        for vehicle in self._vehicles:
            vehicle.roll = None if isinstance(vehicle, Towed) else Roll(vehicle.model.body)
        self._soft_friction = friction / settings.friction * min(settings.roadside_friction, settings.friction)

    def _contacts(self) -> list[Contact]:
        return [*super()._contacts(), *(struck.contact() for struck in self._struck)]

    @property
    def _contacts_begun(self) -> int:
        return super()._contacts_begun + len(self._struck)

    def _objects(self) -> tuple[FixedObject, ...]:
        return self._items

    @property
    def _first_contact_s(self) -> float | None:
        firsts = [self._struck[0].start_s if self._struck else None, super()._first_contact_s]
        return min((first for first in (*firsts, self._overturned_s) if first is not None), default=None)

    def _ended(self, until_s: float, after_contact_s: float) -> tuple[Termination, str] | None:
        ended = super()._ended(until_s, after_contact_s)
        slides = any(vehicle.crashed and not vehicle.at_rest for vehicle in self._vehicles)
        if ended is not None and ended[0] is Termination.NO_CONTACT and slides:
            return None  # it may strike something yet, or overturn
        return ended

    def _no_contact_reason(self) -> str:
        if len(self._vehicles) == 1 and not self._people:
            number = self._vehicles[0].number
            things = f"none of {len(self._items)} objects" if len(self._items) > 1 else "nothing"
            return f"no contact: vehicle {number} strikes {things}, and does not overturn"
        return super()._no_contact_reason()

    # --- the ground ------------------------------------------------------------------------------------------
    def _stand_on_surface(self) -> None:
        for i, vehicle in enumerate(self._vehicles):
            vehicle.ground, vehicle.z = self._roads[i], self._road_z_m[i]
        super()._stand_on_surface()
        for i, vehicle in enumerate(self._vehicles):
            self._roads[i], self._road_z_m[i] = vehicle.ground, vehicle.z
            paved = self._beyond.is_paved(vehicle.x, vehicle.y)
            self._on_soil[i] = not paved
            friction = self._friction if paved else self._soft_friction
            vehicle.stand_on(friction)
            if self._beyond.slopes:
                self._stand_on_bank(i, vehicle, paved, friction)
        self._bodies.set_heights([vehicle.z for vehicle in self._vehicles])

    def _stand_on_bank(self, i: int, vehicle: Vehicle, paved: bool, friction: float) -> None:
        """Take the height and the slope of the ground beyond the edge, where there is such."""
        bank = self._banks[i] = self._beyond.at(vehicle.x, vehicle.y, paved=paved)
        vehicle.z += bank.height_m
        if vehicle.crashed and not bank.level:  # drivers hold their course on slopes that can be recovered from
            vehicle.ground = _tilted(vehicle, bank)
            vehicle.stand_on(friction * _pressed(bank))
        self._come_onto(i, vehicle)

    def _come_onto(self, i: int, vehicle: Vehicle) -> None:
        """What the ground does to a vehicle whose foremost corner has come to where it slopes otherwise.

        It is the foremost the way it goes, or towards a ditch or embankment.
        """
        toward_x, toward_y = self._beyond.across(vehicle.x, vehicle.y) or (vehicle.vx, vehicle.vy)
        if toward_x * vehicle.vx + toward_y * vehicle.vy < 0:
            toward_x, toward_y = -toward_x, -toward_y
        ahead = max(corners(vehicle.outline()), key=lambda corner: corner[0] * toward_x + corner[1] * toward_y)
        before, after = self._ahead[i], self._beyond.at(*ahead)
        if (before.slope_x, before.slope_y) == (after.slope_x, after.slope_y):
            return
        if self._is_about_to_strike_slope(i, vehicle):
            return  # it does so in the next step, and comes onto it then
        self._ahead[i] = after
        if not vehicle.crashed:
            return
        body = vehicle.model.body
        push = onto_slope(body.vehicle_class, vehicle.heading, (vehicle.vx, vehicle.vy), before, after)
        if push is None:
            return
        c, s = math.cos(vehicle.heading), math.sin(vehicle.heading)
        left_mps = vehicle.vy * c - vehicle.vx * s
        vehicle.vx += push.x_mps
        vehicle.vy += push.y_mps
        self._state = None
        self._taken_over()
        if vehicle.roll is not None:
            vehicle.roll.push(push.y_mps * c - push.x_mps * s, push.up_mps, left_mps)
        for (one, j), struck in self._touching.items():
            if one == i and self._items[j].resistance is Resistance.SLOPE:
                struck.pushed(struck.last_s, push.x_mps * body.mass_kg, push.y_mps * body.mass_kg)

    def _is_about_to_strike_slope(self, i: int, vehicle: Vehicle) -> bool:
        """Whether a vehicle has come to a ditch or embankment of the report, a contact that has not begun yet."""
        outline = vehicle.outline()
        return any(
            each.item.resistance is Resistance.SLOPE
            and (i, j) not in self._touching
            and separation(outline, each.outline)[0] <= 0
            for j, each in enumerate(self._obstacles)
        )

    # --- steps -----------------------------------------------------------------------------------------------
    def _alone_until(self, step: int) -> int:
        until = super()._alone_until(step)
        for vehicle in self._skids:
            if not vehicle.crashed:  # it is put on its trajectory at the end of each step
                until = min(until, math.floor(vehicle.skids_from_s / self._step_s) - 1)
        return min(until, self._clear_until_step) if self._obstacles else until

    def _advance(self, step: int, forces: list[tuple[float, float, float]]) -> None:
        super()._advance(step, forces)
        self._carry((step + 1) * self._step_s)
        for i, (vehicle, force) in enumerate(zip(self._vehicles, forces, strict=True)):
            if vehicle.roll is not None and vehicle.crashed:
                self._roll(i, vehicle, force, (step + 1) * self._step_s)

    def _roll(self, i: int, vehicle: Vehicle, force: tuple[float, float, float], now_s: float) -> None:
        """Dig in, tip and roll."""
        assert vehicle.roll is not None
        fx, fy, _ = force
        c, s = math.cos(vehicle.heading), math.sin(vehicle.heading)
        left_mps, mass = vehicle.vy * c - vehicle.vx * s, vehicle.model.body.mass_kg
        if self._on_soil[i] and not vehicle.roll.over:
            self._furrows_m[i] += abs(left_mps) * self._step_s
            dug = min(self._furrows_m[i] / _FURROW_M, 1.0)
            vehicle.side_grip = 1.0 + dug * (_FURROW_GRIP / self._soft_friction - 1.0)
        speed_mps = math.hypot(vehicle.vx, vehicle.vy)
        # Weight pulls at the centre of gravity, which tips nothing: what tips is what the tyres give.
        ground = vehicle.ground
        ax, ay = fx / mass + GRAVITY_MPS2 * ground.slope_x, fy / mass + GRAVITY_MPS2 * ground.slope_y
        weight = GRAVITY_MPS2 * _pressed(self._banks[i])
        vehicle.roll.advance(ay * c - ax * s, left_mps, speed_mps, self._step_s, weight)
        if self._overturned_s is None and abs(vehicle.roll.roll_rad) >= OVERTURNED_RAD:
            self._overturned_s = now_s

    def _place_people(self, time_s: float) -> None:
        super()._place_people(time_s)
        self._carry(time_s)

    def _carry(self, time_s: float) -> None:
        """Put every vehicle that skids, and has struck nothing yet, where its trajectory has it."""
        for vehicle in self._skids:
            if vehicle.crashed or time_s < vehicle.skids_from_s or not vehicle.follows_plan:
                continue
            over = time_s >= vehicle.plan_end_s  # nothing was struck: it slides on by itself
            lost = vehicle.from_plan_m(time_s, self._step_s) > _JOINS_M
            vehicle.crashed = over or lost
            if lost:
                continue
            before_mps = vehicle.vx, vehicle.vy
            vehicle.carry(time_s, self._step_s)
            if math.dist(before_mps, (vehicle.vx, vehicle.vy)) > BOUND_MPS / 2:
                self._clear_until_step = 0  # it goes otherwise than was reckoned with
            self._state = None

    def _contact_possible(self, step: int) -> bool:
        if super()._contact_possible(step):
            self._clear_until_step = 0  # what vehicles do to each other changes their speeds at once
            return True
        return self._object_in_reach(step)

    def _object_in_reach(self, step: int) -> bool:
        """Whether a vehicle may come to touch an object within the next step."""
        if step < self._clear_until_step:
            return False
        clear_s = math.inf
        for vehicle in self._vehicles:
            moves_mps = math.hypot(vehicle.vx, vehicle.vy) + abs(vehicle.yaw_rate) * vehicle.reach_m
            travel_m = moves_mps * self._step_s * BOUND
            for obstacle in self._obstacles:
                between_m = _between_m(vehicle, obstacle) - travel_m
                if between_m <= 0:
                    between_m = separation(vehicle.outline(), obstacle.outline)[0] - travel_m
                if between_m <= 0:
                    return True
                clear_s = min(clear_s, between_m / (BOUND * moves_mps + BOUND_MPS))
        if clear_s < math.inf:
            self._clear_until_step = step + int(clear_s / self._step_s)
        return False

    def _forces_now(self, forces: list[float], now_s: float, part_s: float) -> list[float]:
        """The forces on the vehicles with those of the objects they touch."""
        total = super()._forces_now(forces, now_s, part_s)
        for i, vehicle in enumerate(self._vehicles):
            x, y, heading, clear_m = self._clear[i]
            turned_m = abs(vehicle.heading - heading) * vehicle.reach_m
            if math.hypot(vehicle.x - x, vehicle.y - y) + turned_m < clear_m:
                continue
            clear_m = math.inf
            for j, obstacle in enumerate(self._obstacles):
                struck = self._touching.get((i, j))
                if struck is None or now_s > struck.over_s:
                    apart_m = _between_m(vehicle, obstacle)
                    if apart_m <= 0:
                        apart_m = separation(vehicle.outline(), obstacle.outline)[0]
                    if apart_m > 0:
                        clear_m = min(clear_m, apart_m)
                        continue
                    struck = self._strike(i, j, now_s)
                clear_m = 0.0
                for k, value in enumerate(struck.force(now_s, part_s)):
                    total[3 * i + k] += value
            self._clear[i] = vehicle.x, vehicle.y, vehicle.heading, clear_m
        return total

    def _strike(self, i: int, j: int, now_s: float) -> Struck:
        vehicle, obstacle = self._vehicles[i], self._obstacles[j]
        again = self._touching.get((i, j))
        struck = Struck(vehicle, obstacle, now_s, self._settings.restitution)
        self._touching[i, j] = struck
        if again is None or obstacle.item.resistance is not Resistance.DRIVEN_OVER:
            self._struck.append(struck)
        falls = vehicle.model.body.vehicle_class is VehicleClass.MOTORCYCLE
        skids = now_s >= vehicle.skids_from_s and vehicle.follows_plan
        rolls_over = obstacle.item.resistance is Resistance.DRIVEN_OVER
        if falls or skids or not rolls_over:
            self._wheels.lose(vehicle)
        if obstacle.item.code == _CURB:
            self._trip(vehicle, struck)
        return struck

    def _trip(self, vehicle: Vehicle, struck: Struck) -> None:
        """A vehicle that slides sideways against a kerb turns its lateral speed into rotation."""
        c, s = math.cos(vehicle.heading), math.sin(vehicle.heading)
        nx, ny = struck.contact().normal_x, struck.contact().normal_y
        left_mps, ahead_mps = vehicle.vy * c - vehicle.vx * s, vehicle.vx * c + vehicle.vy * s
        if vehicle.roll is None or abs(ny * c - nx * s) < _SQUARELY or abs(left_mps) < _SLIDES_MPS:
            return
        left_mps = vehicle.roll.trip(left_mps)
        vehicle.vx, vehicle.vy = ahead_mps * c - left_mps * s, ahead_mps * s + left_mps * c
        self._wheels.lose(vehicle)
        self._state = None
        self._taken_over()


class RoadsidePeopleRun(RoadsideRun, PeopleRun):
    """People or animals, and what is beside the road."""


def _between_m(vehicle: Vehicle, obstacle: Obstacle) -> float:
    """How far the circles about a vehicle and an object are apart at least: far bodies cost no more than this."""
    away_m = math.hypot(vehicle.x - obstacle.outline.x_m, vehicle.y - obstacle.outline.y_m)
    return away_m - vehicle.reach_m - obstacle.reach_m - _NEAR_M


def _tilted(vehicle: Vehicle, bank: Bank) -> Ground:
    """The ground under a vehicle on a slope beside the road. Its slopes are what of the weight pulls along the plane,
    seen from above: sin times cos of the slope."""
    pulled = _pressed(bank) ** 2
    return Ground(vehicle.x, vehicle.y, vehicle.z, pulled * bank.slope_x, pulled * bank.slope_y)


def _pressed(bank: Bank) -> float:
    """The share of the weight that presses on a slope: its cosine."""
    return 1 / math.sqrt(1 + bank.slope_x**2 + bank.slope_y**2)
