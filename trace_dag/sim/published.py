"""Scenarios in the published benchmark's layout (``simulation_<stateCase>.json``) as estimates of this program.

The layout: ``vehicle1`` and ``vehicle2``, each with ``start_position``, ``yaw``, ``speed_kmh`` and ``trajectory``, a
list of waypoints some 5 m apart; ``crash_point``. In CARLA's frame, degrees and km/h. What the vehicles did is their
trajectory at that constant speed; its first waypoint, not ``start_position``, which may lie in another lane, is where
it begins. A vehicle whose ``yaw`` points against its way backs. :mod:`trace_dag.scenario.published_layout` writes it.
"""

from __future__ import annotations

import json
import math
from collections.abc import Iterator
from dataclasses import dataclass
from typing import Any

import numpy as np
from scipy.interpolate import CubicSpline
from scipy.ndimage import gaussian_filter1d

from trace_dag.crash.record import CrashRecord, VehicleClass, VehicleRecord
from trace_dag.errors import UserError
from trace_dag.geometry import FloatArray, Pose, arc_lengths
from trace_dag.sim.carla_frame import heading_from_carla, location_from_carla
from trace_dag.states.types import (
    EstimatorRun,
    Hypothesis,
    Manoeuvre,
    ParticipantState,
    SpeedSource,
    StateEstimate,
    Trajectory,
)
from trace_dag.units import GRAVITY_MPS2, kmh_to_mps

CAR_LENGTH_M, CAR_WIDTH_M = 4.69, 1.85
"""CARLA's Tesla Model 3, with which it was made."""
SPAWN_HEIGHT_M = 0.5
"""How far above the road a vehicle is put, for it to settle."""

_STEP_S = 0.1
_PATH_STEP_M = 1.0
_SMOOTHING_M = (0.0, 1.25, 2.5, 5.0)
_GRIP_MPS2 = 0.75 * GRAVITY_MPS2  # lateral: tyres on dry asphalt
_TIGHTEST_M = 5.0  # radius
_SAME_PLACE_M = 1e-3
_HEIGHT_M, _MASS_KG = 1.44, 1845.0
_STANDS_S = 30.0  # how long a vehicle without speed stands


@dataclass(frozen=True, eq=False)
class PublishedVehicle:
    """One vehicle, in the local frame: waypoints of shape (n, 2), heading at the start, constant speed, height of the
    road at the start."""

    waypoints_m: FloatArray
    heading_rad: float
    speed_mps: float
    z_m: float = 0.0


@dataclass(frozen=True, eq=False)
class PublishedScenario:
    """The two vehicles and the crash point, in the local frame."""

    vehicles: tuple[PublishedVehicle, PublishedVehicle]
    crash_xy_m: tuple[float, float]


def read_published(data: bytes, *, name: str) -> PublishedScenario:
    """Read a published scenario. Raises :class:`UserError`, which names the file ``name`` and what is missing or not a
    number.

    >>> car = {"start_position": {"z": 0.5}, "yaw": 0.0, "speed_kmh": 36, "trajectory": [[0, 0], [5, 0]]}
    >>> text = json.dumps({"vehicle1": car, "vehicle2": car, "crash_point": {"x": 3.0, "y": 4.0}})
    >>> scenario = read_published(text.encode(), name="simulation_510003.json")
    >>> scenario.vehicles[0].speed_mps, scenario.crash_xy_m  # CARLA's y points to the right
    (10.0, (3.0, -4.0))
    """
    try:
        content = json.loads(data)
        crash = content["crash_point"]
        one, two = (_vehicle(content[key]) for key in ("vehicle1", "vehicle2"))
        crash_xy = location_from_carla(float(crash["x"]), float(crash["y"]))
    except (ValueError, KeyError, TypeError, IndexError) as error:
        raise UserError(f"{name}: not a published scenario ({type(error).__name__}: {error})") from error
    return PublishedScenario((one, two), crash_xy)


def _vehicle(content: dict[str, Any]) -> PublishedVehicle:
    waypoints = np.array(content["trajectory"], float)
    if waypoints.ndim != 2 or waypoints.shape[1] < 2 or not len(waypoints) or not np.isfinite(waypoints).all():
        raise ValueError(f"trajectory of shape {waypoints.shape}; finite points x, y are needed")
    waypoints = np.array([location_from_carla(x, y) for x, y in waypoints[:, :2].tolist()])
    return PublishedVehicle(
        waypoints,
        heading_from_carla(float(content["yaw"])),
        kmh_to_mps(float(content["speed_kmh"])),
        float(content["start_position"]["z"]) - SPAWN_HEIGHT_M,
    )


def published_estimate(scenario: PublishedScenario, record: CrashRecord) -> StateEstimate:
    """The scenario as an estimate with one hypothesis, both bodies the car it was made with.

    >>> east = PublishedVehicle(np.array([[-20.0, 0.0], [20.0, 0.0]]), 0.0, 10.0)
    >>> north = PublishedVehicle(np.array([[0.0, -20.0], [0.0, 20.0]]), math.pi / 2, 10.0)
    >>> estimate = published_estimate(PublishedScenario((east, north), (0.0, 0.0)), record)
    >>> round(estimate.hypotheses[0].impact_time_s, 1)  # 20 m at 10 m/s
    2.0
    """
    pair = record.colliding_vehicles
    if pair is None:
        raise UserError(f"{record.key}: no two vehicles touch in the report; a published scenario is of two that do")
    vehicles = sorted(pair, key=lambda vehicle: vehicle.number)
    participants = tuple(
        _participant(published, vehicle, scenario.crash_xy_m)
        for published, vehicle in zip(scenario.vehicles, vehicles, strict=True)
    )
    hypothesis = Hypothesis(
        name="published",
        score=0.0,
        evidence={},
        participants=participants,
        impact_time_s=min(_nearest(p.trajectory, scenario.crash_xy_m)[1] for p in participants),
        impact_point_xy_m=scenario.crash_xy_m,
    )
    return StateEstimate(record.key, (hypothesis,), EstimatorRun(estimator="published", version="FSE Companion '26"))


def _participant(
    published: PublishedVehicle, vehicle: VehicleRecord, crash_xy_m: tuple[float, float]
) -> ParticipantState:
    trajectory = constant_speed_trajectory(published)
    impact_pose, _ = _nearest(trajectory, crash_xy_m)
    return ParticipantState(
        vehicle_number=vehicle.number,
        vehicle_class=VehicleClass.CAR,
        length_m=CAR_LENGTH_M,
        width_m=CAR_WIDTH_M,
        height_m=_HEIGHT_M,
        mass_kg=_MASS_KG,
        manoeuvre=Manoeuvre.STRAIGHT if published.speed_mps else Manoeuvre.STOPPED,
        initial_pose=Pose(
            *(float(each[0]) for each in (trajectory.x_m, trajectory.y_m, trajectory.heading_rad, trajectory.z_m))
        ),
        initial_speed_mps=float(trajectory.speed_mps[0]),
        impact_pose=impact_pose,
        impact_speed_mps=float(trajectory.speed_mps[-1]),
        speed_source=SpeedSource.INFERRED_CLASS,
        trajectory=trajectory,
    )


def constant_speed_trajectory(vehicle: PublishedVehicle) -> Trajectory:
    """Along the waypoints at the vehicle's speed; without speed it stands at the first one.

    Published waypoints jump between lanes by metres over a few metres, up to fifteen times what tyres can follow at the
    speeds given. Waypoints that cannot be driven are smoothed (Gaussian), as a driver who looks ahead would do, just
    enough to make them drivable and at most over their own spacing.

    >>> east = PublishedVehicle(np.column_stack([np.arange(0.0, 101.0, 10.0), np.zeros(11)]), 0.0, 10.0)
    >>> driven = constant_speed_trajectory(east)
    >>> round(float(np.interp(5.0, driven.time_s, driven.x_m)), 3)  # 5 s at 10 m/s
    50.0
    """
    points = vehicle.waypoints_m
    points = points[np.concatenate([[True], np.hypot(*np.diff(points, axis=0).T) > _SAME_PLACE_M])]
    if vehicle.speed_mps <= 0 or len(points) < 2:
        time = np.array([0.0, _STANDS_S])
        still = np.zeros(2)
        x, y = points[0]
        return Trajectory(time, still + x, still + y, still + vehicle.z_m, still + vehicle.heading_rad, still)
    path = next((path for path in _smoothed(points) if _drivable(path, vehicle.speed_mps)), None)
    spline, length_m = _spline(path if path is not None else _smooth(points, _SMOOTHING_M[-1]))
    time = np.arange(0.0, length_m / vehicle.speed_mps, _STEP_S)
    xy, slope = spline(time * vehicle.speed_mps), spline(time * vehicle.speed_mps, 1)
    course = np.unwrap(np.arctan2(slope[:, 1], slope[:, 0]))
    backing = math.cos(vehicle.heading_rad - course[0]) < 0
    still = np.zeros_like(time)
    return Trajectory(
        time,
        xy[:, 0],
        xy[:, 1],
        still + vehicle.z_m,
        course + (math.pi if backing else 0.0),
        still + (-vehicle.speed_mps if backing else vehicle.speed_mps),
    )


def _smoothed(points_m: FloatArray) -> Iterator[FloatArray]:
    """The points unchanged, then with more and more smoothing."""
    return (points_m if sigma_m == 0 else _smooth(points_m, sigma_m) for sigma_m in _SMOOTHING_M)


def _spline(path_m: FloatArray) -> tuple[CubicSpline, float]:
    """Position by distance along the path, and its length."""
    s = arc_lengths(path_m)
    return CubicSpline(s, path_m), float(s[-1])


def _drivable(path_m: FloatArray, speed_mps: float) -> bool:
    """Whether tyres can follow the path at a constant speed."""
    spline, length_m = _spline(path_m)
    s = np.linspace(0.0, length_m, max(2, math.ceil(length_m / _PATH_STEP_M) + 1))
    (dx, dy), (ddx, ddy) = spline(s, 1).T, spline(s, 2).T
    curvature_1pm = np.abs(dx * ddy - dy * ddx) / np.hypot(dx, dy) ** 3
    return bool(curvature_1pm.max() <= min(1 / _TIGHTEST_M, _GRIP_MPS2 / speed_mps**2))


def _smooth(points_m: FloatArray, sigma_m: float) -> FloatArray:
    """The polyline at even steps, smoothed by ``sigma_m``; its ends stay where they are."""
    s = arc_lengths(points_m)
    even = np.linspace(0.0, s[-1], max(2, math.ceil(s[-1] / _PATH_STEP_M) + 1))
    xy = np.stack([np.interp(even, s, points_m[:, i]) for i in (0, 1)], axis=-1)
    reach = len(xy) - 1
    mirrored = np.concatenate([2 * xy[0] - xy[reach:0:-1], xy, 2 * xy[-1] - xy[-2 : -reach - 2 : -1]])
    smoothed: FloatArray = gaussian_filter1d(mirrored, sigma_m * reach / s[-1], axis=0)
    return smoothed[reach : reach + len(xy)]


def _nearest(trajectory: Trajectory, xy_m: tuple[float, float]) -> tuple[Pose, float]:
    i = int(np.hypot(trajectory.x_m - xy_m[0], trajectory.y_m - xy_m[1]).argmin())
    pose = Pose(float(trajectory.x_m[i]), float(trajectory.y_m[i]), float(trajectory.heading_rad[i]))
    return pose, float(trajectory.time_s[i])
