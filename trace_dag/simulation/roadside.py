"""The roadside of a run: fixed objects, ground that is not a pavement, and vehicles out of control.

Steps are taken in short parts while a vehicle may touch an object. A vehicle that strikes an object is no longer
driven, unless the object is driven over; a motorcycle falls even then. Beyond the carriageway tyres have the friction
of grass or gravel. A vehicle that skids moves exactly along its trajectory, at any heading, until it strikes something;
a vehicle driven by an agent does not skid.
"""

from __future__ import annotations

import math

from trace_dag.common.units import GRAVITY_MPS2
from trace_dag.crash.parties import trailer_body
from trace_dag.crash.record import VehicleClass
from trace_dag.simulation.dynamics import Vehicle
from trace_dag.simulation.objects import FixedObject, Resistance
from trace_dag.simulation.obstacles import Obstacle, Struck
from trace_dag.simulation.outlines import corners, separation
from trace_dag.simulation.overturn import Roll
from trace_dag.simulation.roadside_terrain import LEVEL, Bank, RoadsideTerrain, onto_slope
from trace_dag.simulation.run_state import RunState
from trace_dag.simulation.surface import Ground
from trace_dag.simulation.towing import Towed
from trace_dag.simulation.types import OVERTURNED_RAD
from trace_dag.simulation.vehicle_pairs import BOUND, BOUND_MPS

_NEAR_M = 1.0
_CURB = 33  # SOE
_SQUARELY = 0.7  # cosine between a kerb's normal and the vehicle's side, for its wheels to catch
_SLIDES_MPS = 0.5
_SCRAPES = 0.3  # friction of a body along a rail
_JOINS_M = 1.5  # a vehicle farther from its plan lost control earlier, and slides from its present place
_FURROW_M, _FURROW_GRIP = 2.0, 1.8
"""Wheels that slide sideways on soil dig in within so far, and hold so much of the load then: judgement by tests in
which cars tripped on soil were slowed down by 1.0 to 2.0 g (Cooperrider, Thomas and Hammoud, SAE 900366)."""


class Roadside:
    """The roadside of a run: the ground, fixed objects, and vehicles out of control."""

    def __init__(self, run: RunState, objects: tuple[FixedObject, ...], beyond: RoadsideTerrain) -> None:
        self._run = run
        self.items = objects
        self.struck: list[Struck] = []
        """All contacts with objects, in the order they began."""
        self._obstacles = [Obstacle.of(item) for item in objects]
        self._touching: dict[tuple[int, int], Struck] = {}
        self._beyond = beyond
        gone = [each.number for each in run.participants if each.breaks_rail]
        self._break_rails = {*gone, *map(trailer_body, gone)}
        self._banks = [LEVEL] * len(run.vehicles)  # the ground that each stands on, beyond the edge
        self._ahead = [LEVEL] * len(run.vehicles)  # the ground that its foremost corner has reached
        self._roads = [vehicle.ground for vehicle in run.vehicles]  # the road's surface under or beside each
        self._road_z_m = [vehicle.z for vehicle in run.vehicles]
        self._on_soil = [False] * len(run.vehicles)
        self._furrows_m = [0.0] * len(run.vehicles)  # so far each has slid sideways on soil
        self._lead_paved = [False] * len(run.vehicles)  # the wheels that lead were on pavement in the step before
        self._overturned_s: float | None = None
        self._clear_until_step = 0  # no vehicle can touch an object before it
        # Where each vehicle was when the objects were looked at last, and how far from there it touches none.
        self._clear = [(vehicle.x, vehicle.y, vehicle.heading, 0.0) for vehicle in run.vehicles]
        self._skids = [vehicle for vehicle in run.vehicles if vehicle.skids_from_s < math.inf]
        for vehicle in run.vehicles:
            vehicle.roll = None if isinstance(vehicle, Towed) else Roll(vehicle.model.body)
        settings = run.settings
        self._soft_friction = run.friction / settings.friction * min(settings.roadside_friction, settings.friction)

    @property
    def firsts_s(self) -> list[float]:
        """Return the times of the first object strike and the first overturn, if any."""
        return [
            each for each in (self.struck[0].start_s if self.struck else None, self._overturned_s) if each is not None
        ]

    def no_contact_reason(self, number: int) -> str:
        """Return a sentence that the only vehicle struck nothing."""
        things = f"none of {len(self.items)} objects" if len(self.items) > 1 else "nothing"
        return f"no contact: vehicle {number} strikes {things}, and does not overturn"

    # --- the ground ------------------------------------------------------------------------------------------
    def take_off_ground(self) -> None:
        """Put every vehicle back on the road's surface, for the next search from there."""
        for i, vehicle in enumerate(self._run.vehicles):
            vehicle.ground, vehicle.z = self._roads[i], self._road_z_m[i]

    def stand_on_ground(self) -> None:
        """Put every vehicle on the ground under it."""
        for i, vehicle in enumerate(self._run.vehicles):
            self._roads[i], self._road_z_m[i] = vehicle.ground, vehicle.z
            paved = self._beyond.is_paved(vehicle.x, vehicle.y)
            self._on_soil[i] = vehicle.off_road = not paved
            friction = self._run.friction if paved else self._soft_friction
            vehicle.stand_on(friction)
            if self._beyond.slopes:
                self._stand_on_bank(i, vehicle, paved, friction)
            if vehicle.number not in self._break_rails:
                self._hold_on_bridge(vehicle)
        self._run.bodies.set_heights([vehicle.z for vehicle in self._run.vehicles])

    def _hold_on_bridge(self, vehicle: Vehicle) -> None:
        """Remove the component of a vehicle's velocity over the edge of a bridge, and the loss by scraping along it."""
        for corner in corners(vehicle.outline()):
            away = self._beyond.off_bridge(*corner)
            into_mps = 0.0 if away is None else vehicle.vx * away[0] + vehicle.vy * away[1]
            if away is None or into_mps <= 0:
                continue
            vehicle.vx, vehicle.vy = vehicle.vx - into_mps * away[0], vehicle.vy - into_mps * away[1]
            along_mps = math.hypot(vehicle.vx, vehicle.vy)
            kept = max(along_mps - _SCRAPES * into_mps, 0.0) / along_mps if along_mps > 0 else 0.0
            vehicle.vx, vehicle.vy, vehicle.yaw_rate = vehicle.vx * kept, vehicle.vy * kept, vehicle.yaw_rate * kept
            vehicle.crashed = True
            self._run.state = None

    def _stand_on_bank(self, i: int, vehicle: Vehicle, paved: bool, friction: float) -> None:
        """Apply the height and the slope of the ground beyond the edge, if there is any."""
        bank = self._banks[i] = self._beyond.at(vehicle.x, vehicle.y, paved=paved)
        vehicle.z += bank.height_m
        if vehicle.crashed and not bank.level:  # drivers hold their course on slopes that can be recovered from
            vehicle.ground = _tilted(vehicle, bank)
            vehicle.stand_on(friction * _pressed(bank))
        self._come_onto(i, vehicle)

    def _come_onto(self, i: int, vehicle: Vehicle) -> None:
        """Apply a change of slope to a vehicle whose foremost corner has reached it.

        The corner is the foremost in its direction of motion, or towards a ditch or embankment.
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
        self._run.state = None
        self._run.taken_over()
        if vehicle.roll is not None:
            vehicle.roll.push(push.y_mps * c - push.x_mps * s, push.up_mps, left_mps)
        for (one, j), struck in self._touching.items():
            if one == i and self.items[j].resistance is Resistance.SLOPE:
                struck.pushed(struck.last_s, push.x_mps * body.mass_kg, push.y_mps * body.mass_kg)

    def _is_about_to_strike_slope(self, i: int, vehicle: Vehicle) -> bool:
        """Return whether a vehicle has reached a reported ditch or embankment, with a contact not yet begun."""
        outline = vehicle.outline()
        return any(
            each.item.resistance is Resistance.SLOPE
            and (i, j) not in self._touching
            and separation(outline, each.outline)[0] <= 0
            for j, each in enumerate(self._obstacles)
        )

    # --- steps -----------------------------------------------------------------------------------------------
    def alone_until(self, until: int) -> int:
        """Return the step before which no vehicle can touch an object or lose control, at most ``until``."""
        for vehicle in self._skids:
            if not vehicle.crashed:  # it is put on its trajectory at the end of each step
                until = min(until, math.floor(vehicle.skids_from_s / self._run.step_s) - 1)
        return min(until, self._clear_until_step) if self._obstacles else until

    def advance(self, step: int, forces: list[tuple[float, float, float]]) -> None:
        """Update vehicles after a step: place skidding ones, and tip and roll those out of control."""
        end_s = (step + 1) * self._run.step_s
        self.carry(end_s)
        for i, (vehicle, force) in enumerate(zip(self._run.vehicles, forces, strict=True)):
            if vehicle.roll is not None and vehicle.crashed:
                self.roll(i, vehicle, force, end_s)

    def roll(self, i: int, vehicle: Vehicle, force: tuple[float, float, float], now_s: float) -> None:
        """Dig in, tip and roll."""
        assert vehicle.roll is not None
        fx, fy, _ = force
        c, s = math.cos(vehicle.heading), math.sin(vehicle.heading)
        left_mps, mass = vehicle.vy * c - vehicle.vx * s, vehicle.model.body.mass_kg
        digs_in = self._on_soil[i] or vehicle.digs_in
        if digs_in and not vehicle.roll.over:
            self._furrows_m[i] += abs(left_mps) * self._run.step_s
            dug = min(self._furrows_m[i] / _FURROW_M, 1.0)
            grip = self._soft_friction if self._on_soil[i] else self._run.friction
            vehicle.side_grip = 1.0 + dug * (_FURROW_GRIP / grip - 1.0)
        if vehicle.digs_in and not vehicle.roll.over:
            left_mps = self._catch_at_kerb(i, vehicle, left_mps)
        speed_mps = math.hypot(vehicle.vx, vehicle.vy)
        # Weight pulls at the centre of gravity, which tips nothing: what tips is what the tyres give.
        ground = vehicle.ground
        ax, ay = fx / mass + GRAVITY_MPS2 * ground.slope_x, fy / mass + GRAVITY_MPS2 * ground.slope_y
        weight = GRAVITY_MPS2 * _pressed(self._banks[i])
        vehicle.roll.advance(ay * c - ax * s, left_mps, speed_mps, self._run.step_s, weight)
        if self._overturned_s is None and abs(vehicle.roll.roll_rad) >= OVERTURNED_RAD:
            self._overturned_s = now_s

    def _catch_at_kerb(self, i: int, vehicle: Vehicle, left_mps: float) -> float:
        """Trip a vehicle whose leading wheels slide over a kerb, and return its remaining lateral speed."""
        c, s = math.cos(vehicle.heading), math.sin(vehicle.heading)
        lead_m = math.copysign(vehicle.model.body.width_m / 2, left_mps)
        x_m, y_m = vehicle.x - lead_m * s, vehicle.y + lead_m * c
        was_paved, self._lead_paved[i] = self._lead_paved[i], self._beyond.is_paved(x_m, y_m)
        if not was_paved or self._lead_paved[i] or abs(left_mps) < _SLIDES_MPS or not self._beyond.has_kerb(x_m, y_m):
            return left_mps
        return self._turned_over_kerb(vehicle, left_mps)

    def _turned_over_kerb(self, vehicle: Vehicle, left_mps: float) -> float:
        """Turn the lateral speed of a vehicle at a kerb into rotation, and return the remaining one."""
        assert vehicle.roll is not None
        c, s = math.cos(vehicle.heading), math.sin(vehicle.heading)
        lost_mps = vehicle.roll.trip(left_mps) - left_mps
        vehicle.vx, vehicle.vy = vehicle.vx - lost_mps * s, vehicle.vy + lost_mps * c
        self._run.state = None
        self._run.taken_over()
        return left_mps + lost_mps

    def carry(self, time_s: float) -> None:
        """Place every skidding vehicle that has struck nothing yet on its trajectory."""
        for vehicle in self._skids:
            if vehicle.crashed or time_s < vehicle.skids_from_s or not vehicle.follows_plan:
                continue
            over = time_s >= vehicle.plan_end_s  # nothing was struck: it slides on by itself
            lost = vehicle.from_plan_m(time_s, self._run.step_s) > _JOINS_M
            vehicle.crashed = over or lost
            if lost:
                continue
            before_mps = vehicle.vx, vehicle.vy
            vehicle.carry(time_s, self._run.step_s)
            if math.dist(before_mps, (vehicle.vx, vehicle.vy)) > BOUND_MPS / 2:
                self._clear_until_step = 0  # it goes otherwise than was reckoned with
            self._run.state = None

    def look_again(self) -> None:
        """Look in the next step whether an object is in reach."""
        self._clear_until_step = 0

    def object_in_reach(self, step: int) -> bool:
        """Return whether a vehicle may touch an object within the next step."""
        if step < self._clear_until_step:
            return False
        clear_s = math.inf
        for vehicle in self._run.vehicles:
            moves_mps = math.hypot(vehicle.vx, vehicle.vy) + abs(vehicle.yaw_rate) * vehicle.reach_m
            travel_m = moves_mps * self._run.step_s * BOUND
            for obstacle in self._obstacles:
                between_m = _between_m(vehicle, obstacle) - travel_m
                if between_m <= 0:
                    between_m = separation(vehicle.outline(), obstacle.outline)[0] - travel_m
                if between_m <= 0:
                    return True
                clear_s = min(clear_s, between_m / (BOUND * moves_mps + BOUND_MPS))
        if clear_s < math.inf:
            self._clear_until_step = step + int(clear_s / self._run.step_s)
        return False

    def press(self, total: list[float], now_s: float, part_s: float) -> list[float]:
        """Return the forces on the vehicles plus those of the objects they touch."""
        for i, vehicle in enumerate(self._run.vehicles):
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
        vehicle, obstacle = self._run.vehicles[i], self._obstacles[j]
        again = self._touching.get((i, j))
        struck = Struck(vehicle, obstacle, now_s, self._run.settings.restitution)
        self._touching[i, j] = struck
        if again is None or obstacle.item.resistance is not Resistance.DRIVEN_OVER:
            self.struck.append(struck)
        falls = vehicle.model.body.vehicle_class is VehicleClass.MOTORCYCLE
        skids = now_s >= vehicle.skids_from_s and vehicle.follows_plan
        rolls_over = obstacle.item.resistance is Resistance.DRIVEN_OVER
        if falls or skids or not rolls_over:
            self._run.wheels.lose(vehicle)
        if obstacle.item.code == _CURB:
            self._trip(vehicle, struck)
        return struck

    def _trip(self, vehicle: Vehicle, struck: Struck) -> None:
        """Turn the lateral speed of a vehicle that slides against a kerb into rotation."""
        c, s = math.cos(vehicle.heading), math.sin(vehicle.heading)
        nx, ny = struck.contact().normal_x, struck.contact().normal_y
        left_mps = vehicle.vy * c - vehicle.vx * s
        if vehicle.roll is None or abs(ny * c - nx * s) < _SQUARELY or abs(left_mps) < _SLIDES_MPS:
            return
        self._turned_over_kerb(vehicle, left_mps)
        self._run.wheels.lose(vehicle)


def _between_m(vehicle: Vehicle, obstacle: Obstacle) -> float:
    """Return the least distance between the circles around a vehicle and an object, a cheap first test."""
    away_m = math.hypot(vehicle.x - obstacle.outline.x_m, vehicle.y - obstacle.outline.y_m)
    return away_m - vehicle.reach_m - obstacle.reach_m - _NEAR_M


def _tilted(vehicle: Vehicle, bank: Bank) -> Ground:
    """Return the ground under a vehicle on a slope beside the road.

    Its slopes give the horizontal pull of the weight along the plane: sin times cos of the slope.
    """
    pulled = _pressed(bank) ** 2
    return Ground(vehicle.x, vehicle.y, vehicle.z, pulled * bank.slope_x, pulled * bank.slope_y)


def _pressed(bank: Bank) -> float:
    """Return the share of the weight that presses on a slope, its cosine."""
    return 1 / math.sqrt(1 + bank.slope_x**2 + bank.slope_y**2)
