"""A run of vehicles beside the road: fixed objects, ground that is no pavement, and vehicles out of control.

Steps are taken in short parts while a vehicle may touch an object. Whoever strikes an object is no longer driven,
unless it is driven over; a motorcycle falls even then. Beyond the carriageway tyres hold as on grass or gravel. A
vehicle that skids moves along its trajectory exactly, however it is turned, until it strikes something.
"""

from __future__ import annotations

import math
from collections.abc import Mapping

import shapely
from shapely import MultiPolygon

from trace_dag.crash.record import VehicleClass
from trace_dag.roads.map.network import RoadNetwork
from trace_dag.settings import SimSettings
from trace_dag.sim.driving import Driver
from trace_dag.sim.dynamics import Vehicle
from trace_dag.sim.obstacles import Obstacle, Struck
from trace_dag.sim.outlines import separation
from trace_dag.sim.run_of_vehicles import BOUND, VehicleRun
from trace_dag.sim.surface import Surface
from trace_dag.sim.types import Contact, Participant
from trace_dag.states.objects import FixedObject, Resistance

_NEAR_M = 1.0
_PAVED_REACH_M = 250.0  # farther from the first object nobody slides


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
        after_contact_s: float | None,
        *,
        objects: tuple[FixedObject, ...],
        network: RoadNetwork | None,
    ) -> None:
        super().__init__(settings, surface, friction, participants, time_limit_s, drivers, after_contact_s)
        self._items = objects
        self._obstacles = [Obstacle.of(item) for item in objects]
        self._touching: dict[tuple[int, int], Struck] = {}
        self._struck: list[Struck] = []  # all contacts with objects, in the order they began
        self._paved = _carriageway(network, objects[0]) if network is not None else None
        self._soft_friction = friction / settings.friction * min(settings.roadside_friction, settings.friction)

    def _contacts(self) -> list[Contact]:
        return [*super()._contacts(), *(struck.contact() for struck in self._struck)]

    def _objects(self) -> tuple[FixedObject, ...]:
        return self._items

    @property
    def _first_contact_s(self) -> float | None:
        firsts = [self._struck[0].contact().time_s] if self._struck else []
        others = super()._first_contact_s
        return min([*firsts, *([others] if others is not None else [])], default=None)

    def _no_contact_reason(self) -> str:
        if len(self._vehicles) == 1:
            return f"no contact: vehicle {self._vehicles[0].number} strikes none of {len(self._items)} objects"
        return super()._no_contact_reason()

    # --- the ground ------------------------------------------------------------------------------------------
    def _stand_on_surface(self) -> None:
        super()._stand_on_surface()
        if self._paved is None:
            return
        for vehicle in self._vehicles:
            paved = bool(shapely.contains_xy(self._paved, vehicle.x, vehicle.y))
            vehicle.stand_on(self._friction if paved else self._soft_friction)

    # --- steps -----------------------------------------------------------------------------------------------
    def _advance(self, step: int, forces: list[tuple[float, float, float]]) -> None:
        super()._advance(step, forces)
        self._carry((step + 1) * self._step_s)

    def _place_people(self, time_s: float) -> None:
        self._carry(time_s)

    def _carry(self, time_s: float) -> None:
        """Put every vehicle that skids, and has struck nothing yet, where its trajectory has it."""
        for vehicle in self._vehicles:
            if vehicle.crashed or time_s < vehicle.skids_from_s:
                continue
            vehicle.crashed = time_s >= vehicle.plan_end_s  # nothing was struck: it slides on by itself
            vehicle.carry(time_s, self._step_s)
            self._state = None

    def _contact_possible(self, step: int) -> bool:
        return super()._contact_possible(step) or any(
            self._near(vehicle, obstacle) for vehicle in self._vehicles for obstacle in self._obstacles
        )

    def _near(self, vehicle: Vehicle, obstacle: Obstacle) -> bool:
        outline = obstacle.outline
        travel_m = (math.hypot(vehicle.vx, vehicle.vy) + abs(vehicle.yaw_rate) * vehicle.reach_m) * self._step_s * BOUND
        apart_m = math.hypot(vehicle.x - outline.x_m, vehicle.y - outline.y_m)
        if apart_m > vehicle.reach_m + obstacle.reach_m + travel_m + _NEAR_M:
            return False
        return separation(vehicle.outline(), outline)[0] <= travel_m

    def _forces_now(self, forces: list[float], now_s: float, part_s: float) -> list[float]:
        """The forces on the vehicles with those of the objects they touch."""
        total = list(forces)
        for i, vehicle in enumerate(self._vehicles):
            for j, obstacle in enumerate(self._obstacles):
                struck = self._touching.get((i, j))
                if struck is None or now_s > struck.over_s:
                    if separation(vehicle.outline(), obstacle.outline)[0] > 0:
                        continue
                    struck = self._strike(i, j, now_s)
                for k, value in enumerate(struck.force(now_s, part_s)):
                    total[3 * i + k] += value
        return total

    def _strike(self, i: int, j: int, now_s: float) -> Struck:
        vehicle, obstacle = self._vehicles[i], self._obstacles[j]
        again = self._touching.get((i, j))
        struck = Struck(vehicle, obstacle, now_s, self._settings.restitution)
        self._touching[i, j] = struck
        if again is None or obstacle.item.resistance is not Resistance.DRIVEN_OVER:
            self._struck.append(struck)
        falls = vehicle.model.body.vehicle_class is VehicleClass.MOTORCYCLE
        skids = now_s >= vehicle.skids_from_s
        rolls_over = obstacle.item.resistance is Resistance.DRIVEN_OVER
        vehicle.crashed = vehicle.crashed or falls or skids or not rolls_over
        return struck


def _carriageway(network: RoadNetwork, near: FixedObject) -> MultiPolygon:
    """What is paved around an object, at its level."""
    pose = near.pose
    return network.carriageway_near(pose.x_m, pose.y_m, _PAVED_REACH_M, z_m=pose.z_m)
