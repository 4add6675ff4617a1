"""The planned motion with one row per simulation step, for the driver, and the tracking errors."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from functools import lru_cache

import numpy as np

from trace_dag.common.errors import Failure
from trace_dag.common.geometry import FloatArray
from trace_dag.simulation.states import Trajectory
from trace_dag.simulation.types import Body, BodyKind, Participant, VehicleLog, party_name

_STANDSTILL_MPS = 0.05
_STATURES_M, _MASSES_KG = (0.5, 2.4), (3.0, 300.0)  # a figure of a person can be made of
_WITHERS_M, _ANIMALS_KG = (0.3, 2.4), (3.0, 1200.0)  # and of an animal
_AT_A_TIME = 32  # points whose distance from a path is measured together


@dataclass(frozen=True, eq=False)
class SampledTrajectory:
    """A trajectory sampled at every step from 0 to its end, for the body's centre of gravity.

    ``table[k]``: x, y (m), velocity x, y (m/s), acceleration x, y (m/s2), speed along the body (m/s, negative
    backward), curvature of the path (1/m), heading of the body (rad), z of the surface (m).
    """

    table: FloatArray
    end_s: float

    def __len__(self) -> int:
        return len(self.table)

    def row(self, step: int) -> list[float]:
        """Return a row as Python numbers, made on use, because much of a plan lies beyond the impact."""
        numbers: list[float] = self.table[step].tolist()
        return numbers


def check_participants(participants: Sequence[Participant]) -> None:
    """Raise :class:`Failure` for repeated numbers of participants, or an impossible plan.

    >>> from trace_dag.simulation.run import participants
    >>> check_participants(participants(hypothesis))  # can be driven
    >>> check_participants(participants(hypothesis)[:1] * 2)
    Traceback (most recent call last):
    trace_dag.common.errors.Failure: participants need different numbers; found [1, 1]
    """
    numbers = [participant.number for participant in participants]
    if len(set(numbers)) != len(numbers):
        raise Failure(f"participants need different numbers; found {numbers}")
    for participant in participants:
        _check_plan(participant)


def _check_plan(participant: Participant) -> None:
    """Raise :class:`Failure` for an impossible plan, with the vehicle and the fault."""
    who = party_name(participant.body, participant.number)
    t = participant.trajectory
    arrays = {
        "time_s": t.time_s,
        "x_m": t.x_m,
        "y_m": t.y_m,
        "z_m": t.z_m,
        "heading_rad": t.heading_rad,
        "speed_mps": t.speed_mps,
    }
    lengths = {name: len(values) for name, values in arrays.items()}
    if len(set(lengths.values())) != 1:
        raise Failure(f"{who}: its trajectory's arrays differ in length ({lengths}); they must be equal")
    for name, values in arrays.items():
        if not np.isfinite(values).all():
            first = int(np.flatnonzero(~np.isfinite(values))[0])
            raise Failure(f"{who}: its trajectory's {name}[{first}] is {values[first]}; every value must be finite")
    pose, body = participant.initial_pose, participant.body
    start = (pose.x_m, pose.y_m, pose.z_m, pose.heading_rad, participant.initial_speed_mps)
    if not np.isfinite(start).all():
        raise Failure(f"{who}: its initial state {start} holds a value that is not finite")
    measures = (body.length_m, body.width_m, body.height_m, body.mass_kg)
    if not all(value > 0 and np.isfinite(value) for value in measures):
        raise Failure(f"{who}: length, width, height and mass must be positive and finite, found {body}")
    if body.is_figure:
        _check_figure(who, body)
    if len(t.time_s) == 0:
        raise Failure(f"{who}: its trajectory is empty; it needs two points, or one to stand on")
    if len(t.time_s) == 1 and abs(participant.initial_speed_mps) > _STANDSTILL_MPS:
        raise Failure(
            f"{who}: its trajectory has one point but it starts at {participant.initial_speed_mps:.1f} m/s; "
            "who moves needs two points or more"
        )
    if len(t.time_s) > 1 and not (np.diff(t.time_s) > 0).all():
        raise Failure(f"{who}: its trajectory's times do not increase")
    if t.time_s[0] > 0:
        raise Failure(f"{who}: its trajectory begins at {t.time_s[0]} s; it must cover time 0")


def _check_figure(who: str, body: Body) -> None:
    """Raise :class:`Failure` for a person or animal whose dimensions allow no figure."""
    animal = body.kind is BodyKind.ANIMAL
    low_m, high_m = _WITHERS_M if animal else _STATURES_M
    low_kg, high_kg = _ANIMALS_KG if animal else _MASSES_KG
    height, whose = ("height at the withers", "animal's") if animal else ("stature", "person's")
    if not low_m <= body.height_m <= high_m:
        raise Failure(f"{who}: its height is the {whose} {height}, {low_m} to {high_m} m, found {body}")
    if not low_kg <= body.mass_kg <= high_kg:
        raise Failure(f"{who}: its mass is the {whose}, {low_kg} to {high_kg} kg, found {body}")


@lru_cache(maxsize=16)  # agents drive in the same crash one after the other
def resample(
    trajectory: Trajectory, step_s: float, time_limit_s: float, cg_ahead_m: float, skids_from_s: float = math.inf
) -> SampledTrajectory:
    """Return the plan on steps of ``step_s``, by Hermite splines through positions and velocities.

    ``cg_ahead_m`` moves it from the body's centre to its centre of gravity. From ``skids_from_s`` on the body's heading
    may differ from its direction of motion; its velocity then follows from its positions.

    >>> plan = hypothesis.participants[1].trajectory
    >>> len(resample(plan, 0.01, 1.0, 0.0))  # a second in steps of 0.01 s, both ends included
    101
    """
    t = trajectory
    end_s = min(float(t.time_s[-1]), time_limit_s)
    times = np.arange(round(end_s / step_s) + 1) * step_s
    if len(t.time_s) == 1:
        stands = float(t.heading_rad[0])
        x = float(t.x_m[0]) + cg_ahead_m * math.cos(stands)
        y = float(t.y_m[0]) + cg_ahead_m * math.sin(stands)
        return SampledTrajectory(np.array([[x, y, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, stands, t.z_m[0]]]), 0.0)
    heading = np.unwrap(t.heading_rad)
    at = np.interp(times, t.time_s, np.arange(len(t.time_s)))
    index = np.clip(at.astype(int), 0, len(t.time_s) - 2)
    h = (t.time_s[index + 1] - t.time_s[index])[:, None]
    u = (at - index)[:, None]
    xy = np.stack([t.x_m, t.y_m], axis=-1)
    velocity = t.speed_mps[:, None] * np.stack([np.cos(heading), np.sin(heading)], axis=-1)
    skids = t.time_s >= skids_from_s
    if skids.any():
        velocity[skids] = np.gradient(xy, t.time_s, axis=0)[skids]
    p0, p1, v0, v1 = xy[index], xy[index + 1], velocity[index], velocity[index + 1]
    u2, u3 = u**2, u**3
    position = (2 * u3 - 3 * u2 + 1) * p0 + (u3 - 2 * u2 + u) * h * v0 + (3 * u2 - 2 * u3) * p1 + (u3 - u2) * h * v1
    speed = np.interp(times, t.time_s, t.speed_mps)
    course = np.interp(times, t.time_s, heading)
    z = np.interp(times, t.time_s, t.z_m)
    turning, pulling = np.gradient(np.stack([heading, t.speed_mps]), t.time_s, axis=1)
    yaw_rate, tangential = np.interp(times, t.time_s, turning), np.interp(times, t.time_s, pulling)
    c, s = np.cos(course), np.sin(course)
    moving = np.abs(speed) > 0.3
    curvature = np.where(moving, yaw_rate / np.where(moving, speed, 1.0), 0.0)
    velocity_x, velocity_y = speed * c, speed * s
    if skids.any():
        sideways = times >= skids_from_s
        velocity_x[sideways] = np.interp(times, t.time_s, velocity[:, 0])[sideways]
        velocity_y[sideways] = np.interp(times, t.time_s, velocity[:, 1])[sideways]
    columns = (
        position[:, 0] + cg_ahead_m * c,
        position[:, 1] + cg_ahead_m * s,
        velocity_x - cg_ahead_m * yaw_rate * s,
        velocity_y + cg_ahead_m * yaw_rate * c,
        tangential * c - speed * yaw_rate * s,
        tangential * s + speed * yaw_rate * c,
        speed,
        curvature,
        course,
        z,
    )
    return SampledTrajectory(np.stack(columns, axis=-1), end_s)


def tracking_errors(trajectory: Trajectory, log: VehicleLog, until_s: float) -> tuple[FloatArray, FloatArray]:
    """Return a vehicle's tracking errors up to ``until_s``, per logged step.

    They are the distance of its centre from the planned *path* (m), and the deviation of its speed from the planned one
    (m/s), both non-negative.
    """
    use = log.time_s <= until_s + 1e-9
    x, y = log.x_m[use], log.y_m[use]
    t = trajectory
    if len(t.time_s) == 1:
        return np.hypot(x - t.x_m[0], y - t.y_m[0]), np.abs(log.speed_mps[use])
    distance = _distances_m(x, y, t.x_m, t.y_m)
    planned = np.interp(log.time_s[use], t.time_s, t.speed_mps)
    return distance, np.abs(log.speed_mps[use] - planned)


def _distances_m(x_m: FloatArray, y_m: FloatArray, path_x_m: FloatArray, path_y_m: FloatArray) -> FloatArray:
    """Return the exact distance of each point from a polyline.

    Successive points are near each other, so for a group of them only the segments that can be nearest are tested.
    """
    along_x, along_y = np.diff(path_x_m), np.diff(path_y_m)
    squares = np.maximum(along_x**2 + along_y**2, 1e-12)
    longest = math.sqrt(squares.max())
    start_x, start_y = path_x_m[:-1], path_y_m[:-1]
    distances = np.empty(len(x_m))
    for first in range(0, len(x_m), _AT_A_TIME):
        some = slice(first, first + _AT_A_TIME)
        middle = min(first + _AT_A_TIME // 2, len(x_m) - 1)
        spread = np.hypot(x_m[some] - x_m[middle], y_m[some] - y_m[middle]).max()
        off = np.hypot(start_x - x_m[middle], start_y - y_m[middle])
        near = np.flatnonzero(off <= off.min() + 2 * spread + longest)
        dx, dy = x_m[some, None] - start_x[near], y_m[some, None] - start_y[near]
        ux, uy = along_x[near], along_y[near]
        fraction = np.clip((dx * ux + dy * uy) / squares[near], 0, 1)
        distances[some] = np.sqrt(((dx - fraction * ux) ** 2 + (dy - fraction * uy) ** 2).min(axis=1))
    return distances
