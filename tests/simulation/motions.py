"""Planned motions made by hand for the simulation's tests: straight lines and bends, exact in closed form."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence

import numpy as np

from trace_dag.common.geometry import Pose
from trace_dag.common.settings import SimSettings
from trace_dag.crash.record import VehicleClass
from trace_dag.simulation.embedded import EmbeddedSimulation
from trace_dag.simulation.objects import FixedObject
from trace_dag.simulation.states import Trajectory
from trace_dag.simulation.surface import Surface
from trace_dag.simulation.types import Body, BodyKind, Participant, SimulationLog

CAR = Body(BodyKind.MOTOR_VEHICLE, VehicleClass.CAR, 4.7, 1.85, 1.45, 1500.0)
TRUCK = Body(BodyKind.MOTOR_VEHICLE, VehicleClass.TRUCK, 8.5, 2.5, 3.2, 12000.0)


def log_of(
    participants: Sequence[Participant],
    settings: SimSettings | None = None,
    *,
    surface: Surface | None = None,
    objects: Sequence[FixedObject] = (),
) -> SimulationLog:
    """What the embedded back-end makes of their plans, on level ground unless told otherwise."""
    settings = settings or SimSettings()
    simulation = EmbeddedSimulation(settings, surface or Surface(), settings.friction)
    return simulation.run(tuple(participants), time_limit_s=settings.time_limit_s, objects=tuple(objects))


def straight(
    x_m: float, y_m: float, heading_rad: float, speed_mps: float, *, until_s: float = 10.0, z_m: float = 0.0
) -> Trajectory:
    """Constant speed along a line."""
    return driven(x_m, y_m, heading_rad, lambda _: speed_mps, lambda _: 0.0, until_s=until_s, z_m=z_m)


def driven(
    x_m: float,
    y_m: float,
    heading_rad: float,
    speed_of_time: Callable[[float], float],
    curvature_of_distance: Callable[[float], float],
    *,
    until_s: float = 10.0,
    z_m: float = 0.0,
) -> Trajectory:
    """A point driven at a speed (m/s, by time) along a curvature (1/m, by distance), integrated finely."""
    per_point, step = 50, 0.1
    fine = step / per_point
    time = np.arange(round(until_s / fine) + 1) * fine
    speed = np.array([speed_of_time(t) for t in time])
    travelled = np.concatenate([[0.0], np.cumsum((speed[1:] + speed[:-1]) / 2 * fine)])
    curvature = np.array([curvature_of_distance(s) for s in travelled])
    heading = heading_rad + np.concatenate(
        [[0.0], np.cumsum((curvature[1:] + curvature[:-1]) / 2 * np.diff(travelled))]
    )
    vx, vy = speed * np.cos(heading), speed * np.sin(heading)
    x = x_m + np.concatenate([[0.0], np.cumsum((vx[1:] + vx[:-1]) / 2 * fine)])
    y = y_m + np.concatenate([[0.0], np.cumsum((vy[1:] + vy[:-1]) / 2 * fine)])
    every = slice(None, None, per_point)
    return Trajectory(time[every], x[every], y[every], np.full_like(x[every], z_m), heading[every], speed[every])


def participant(number: int, trajectory: Trajectory, body: Body = CAR) -> Participant:
    """A vehicle that starts as its plan does."""
    t = trajectory
    start = Pose(float(t.x_m[0]), float(t.y_m[0]), float(t.heading_rad[0]), float(t.z_m[0]))
    return Participant(number, body, start, float(t.speed_mps[0]), trajectory)


def crossing(
    vehicle: Body,
    person: Body,
    speed_mps: float,
    *,
    walks_mps: float = 1.4,
    walks_rad: float = math.pi / 2,
    offset_m: float = 0.0,
    brakes_mps2: float = 7.0,
    lead_s: float = 1.0,
) -> tuple[Participant, Participant]:
    """Vehicle 1, eastbound on the x axis, and person 1001: ``offset_m`` left of its path at the time its front comes to
    x = 0 undisturbed, walking as told. It brakes from just before then."""
    front_m = vehicle.length_m / 2 + 0.3
    brake_s = lead_s - 0.02
    drives = driven(
        -speed_mps * lead_s - front_m,
        0.0,
        0.0,
        lambda t: max(speed_mps - brakes_mps2 * max(t - brake_s, 0.0), 0.0),
        lambda _: 0.0,
    )
    c, s = math.cos(walks_rad), math.sin(walks_rad)
    walks = straight(-walks_mps * lead_s * c, offset_m - walks_mps * lead_s * s, walks_rad, walks_mps)
    return participant(1, drives, vehicle), participant(1001, walks, person)


def meeting(angle_rad: float, speed_1_mps: float, speed_2_mps: float, offset_m: float = 0.0) -> tuple[Participant, ...]:
    """Two cars whose centres would coincide after 2 s but for ``offset_m``, the second at an angle to the first."""
    lead_s = 2.0
    one = straight(-speed_1_mps * lead_s, 0.0, 0.0, speed_1_mps)
    c, s = math.cos(angle_rad), math.sin(angle_rad)
    two = straight(
        -speed_2_mps * lead_s * c - offset_m * s, -speed_2_mps * lead_s * s + offset_m * c, angle_rad, speed_2_mps
    )
    return participant(1, one), participant(2, two)
