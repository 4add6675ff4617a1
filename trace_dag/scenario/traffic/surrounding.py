"""Vehicles around a crash for all formats: a body and its motion, in the crash's frame and on its clock."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, fields, replace
from typing import Final

import numpy as np

from trace_dag.common.geometry import FloatArray, Pose, Poses, gaps_m
from trace_dag.crash.codes.bodies import BODIES
from trace_dag.crash.parties import SURROUNDING
from trace_dag.crash.record import VehicleClass
from trace_dag.scenario.traffic.volumes import TrafficClass
from trace_dag.simulation.states import Trajectory
from trace_dag.simulation.types import Body, BodyKind, Participant, SimulationLog, VehicleLog

STEP_S: Final = 0.1
_BRAKING_MPS2, _STANDS_S = 3.0, 60.0
_LOGGED: Final = 5  # of a log's steps, one is kept
_COMBINATION_M: Final = 21.0  # AASHTO's WB-62, 69 ft, as one body
_REPORTED: Final = {
    VehicleClass.CAR: BODIES["sedan"],
    VehicleClass.PICKUP: BODIES["pickup"],
    VehicleClass.MOTORCYCLE: BODIES["motorcycle"],
    VehicleClass.BUS: BODIES["transit_bus"],
    VehicleClass.TRUCK: BODIES["large_truck"],
    VehicleClass.TRACTOR_TRAILER: BODIES["tractor_of_trailer"],
}


@dataclass(frozen=True, eq=False)
class SurroundingVehicle:
    """A vehicle that is no party, from its arrival on the map, or the beginning of the crash, until it leaves."""

    number: int
    body: Body
    trajectory: Trajectory

    def poses_at(self, times_s: FloatArray) -> Poses:
        """Return x, y and heading at times of the crash's clock, each shape (n,); NaN while it is off the map."""
        t = self.trajectory
        off = (times_s < t.time_s[0] - 1e-6) | (times_s > t.time_s[-1] + 1e-6)
        x, y, heading = (
            np.where(off, np.nan, np.interp(times_s, t.time_s, values))
            for values in (t.x_m, t.y_m, np.unwrap(t.heading_rad))
        )
        return x, y, heading

    @property
    def stopping(self) -> SurroundingVehicle:
        """Return it as it goes on after its motion: straight ahead, braking until it stands."""
        t = self.trajectory
        speed_mps = np.maximum(float(t.speed_mps[-1]) - _BRAKING_MPS2 * np.arange(0.0, _STANDS_S, STEP_S)[1:], 0.0)
        ahead_m, heading = np.cumsum(speed_mps) * STEP_S, float(t.heading_rad[-1])
        return replace(
            self,
            trajectory=Trajectory(
                np.append(t.time_s, t.time_s[-1] + STEP_S * np.arange(1, len(speed_mps) + 1)),
                np.append(t.x_m, t.x_m[-1] + ahead_m * np.cos(heading)),
                np.append(t.y_m, t.y_m[-1] + ahead_m * np.sin(heading)),
                np.append(t.z_m, np.full(len(speed_mps), t.z_m[-1])),
                np.append(t.heading_rad, np.full(len(speed_mps), heading)),
                np.append(t.speed_mps, speed_mps),
            ),
        )

    @property
    def participant(self) -> Participant:
        """Return it as a body of a simulation that follows its motion."""
        t = self.trajectory
        start = Pose(*(float(values[0]) for values in (t.x_m, t.y_m, t.heading_rad, t.z_m)))
        return Participant(self.number, self.body, start, float(t.speed_mps[0]), t)

    @property
    def course(self) -> tuple[int, FloatArray]:
        """Return the step of :data:`STEP_S` at which it comes, and x, y, z, heading, speed a step from then, (n, 5)."""
        t = self.trajectory
        return round(float(t.time_s[0]) / STEP_S), np.column_stack([t.x_m, t.y_m, t.z_m, t.heading_rad, t.speed_mps])

    def logged(self) -> VehicleLog:
        """Return the motion as a log: on its wheels, with zeros for unknown values."""
        t, none = self.trajectory, np.zeros(len(self.trajectory.time_s))
        states: dict[str, FloatArray] = {each.name: none for each in fields(VehicleLog) if each.name != "number"}
        states |= {each.name: getattr(t, each.name) for each in fields(t)}
        states |= {"velocity_x_mps": t.speed_mps * np.cos(t.heading_rad), "landmarks_m": none.reshape(-1, 1)[:, :0]}
        states |= {"velocity_y_mps": t.speed_mps * np.sin(t.heading_rad), "above_road_m": none + self.body.height_m / 2}
        return VehicleLog(number=self.number, **states)


@dataclass(frozen=True)
class Measured:
    """Traffic of one class of road over the minute before the crash, beside the values of the tables.

    ``volume`` is vehicles an hour and lane, ``lane_km`` the length of its lanes on the map.
    """

    traffic_class: TrafficClass
    lane_km: float
    table_volume: float
    limit_mps: float
    volume: float
    speed_mps: float | None
    density_per_km: float


@dataclass(frozen=True, eq=False)
class SurroundingTraffic:
    """Traffic around a crash: vehicles by number, and the number of vehicles left out to keep the crash unchanged."""

    vehicles: tuple[SurroundingVehicle, ...]
    left_out: int
    measured: tuple[Measured, ...]

    def throughout(self, until_s: float) -> list[SurroundingVehicle]:
        """Return those that are on the map from the beginning until a time."""
        ways = ((each, each.trajectory.time_s) for each in self.vehicles)
        return [each for each, time_s in ways if time_s[0] <= 0.0 and time_s[-1] >= until_s - 2 * STEP_S]


def add_traffic(log: SimulationLog, traffic: SurroundingTraffic | None, *, throughout: bool = False) -> SimulationLog:
    """Return a log with the vehicles around a crash as further bodies, for formats that write a log.

    ``throughout``: only vehicles that are on the map all the time, for formats in which bodies cannot come and go.
    """
    vehicles = () if traffic is None else traffic.throughout(log.duration_s) if throughout else traffic.vehicles
    return replace(
        log,
        vehicles=(*log.vehicles, *(each.logged() for each in vehicles)),
        bodies=log.bodies | {each.number: each.body for each in vehicles},
    )


def take_traffic(log: SimulationLog) -> tuple[SimulationLog, SurroundingTraffic | None]:
    """Return a log without the vehicles around a crash, and these; None if it has none."""
    names = [each.name for each in fields(Trajectory)]
    around = tuple(
        SurroundingVehicle(
            each.number, log.bodies[each.number], Trajectory(**{name: getattr(each, name)[::_LOGGED] for name in names})
        )
        for each in log.vehicles
        if each.number > SURROUNDING
    )
    kept = tuple(each for each in log.vehicles if each.number <= SURROUNDING)
    bodies = {number: body for number, body in log.bodies.items() if number <= SURROUNDING}
    return replace(log, vehicles=kept, bodies=bodies), SurroundingTraffic(around, 0, ()) if around else None


def body_of_class(vehicle_class: VehicleClass) -> Body:
    """Return the typical body of a surrounding vehicle of a class; a combination is one body.

    >>> body_of_class(VehicleClass.CAR).length_m, body_of_class(VehicleClass.TRACTOR_TRAILER).length_m
    (4.85, 21.0)
    """
    typical = _REPORTED[vehicle_class]
    length_m = _COMBINATION_M if vehicle_class is VehicleClass.TRACTOR_TRAILER else typical.length_m
    return Body(
        BodyKind.MOTOR_VEHICLE, vehicle_class, length_m, typical.width_m, typical.height_m, float(typical.mass_kg)
    )


def overlapping(
    vehicles: Sequence[SurroundingVehicle], parties: Mapping[int, tuple[Body, Poses]], times_s: FloatArray
) -> set[int]:
    """Return the numbers of vehicles that overlap a party, or a vehicle with a lower number, at any of the times.

    ``parties`` has the body of each party and its poses at the times.
    """
    found: set[int] = set()
    fixed = [(body, poses) for body, poses in parties.values()]
    for each in sorted(vehicles, key=lambda vehicle: vehicle.number):
        own, size_m = each.poses_at(times_s), (each.body.length_m, each.body.width_m)
        if any(
            bool((gaps_m(own, size_m, poses, (body.length_m, body.width_m)) < 0).any()) for body, poses in fixed
        ):  # NaN, where one of them is not there, is no overlap
            found.add(each.number)
        else:
            fixed.append((each.body, own))
    return found
