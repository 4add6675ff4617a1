"""CARLA's frame: the map's x east, but y south; degrees clockwise as seen from above; km/h in published files.

The only place where the two conventions meet. Map coordinates and the project's local frame share their origin.
"""

from __future__ import annotations

import math
from typing import Any

from trace_dag.common.geometry import Pose
from trace_dag.common.units import wrap_angle


def location_from_carla(x_m: float, y_m: float) -> tuple[float, float]:
    """Convert CARLA's x, y to the local frame.

    >>> location_from_carla(10.0, 3.0)
    (10.0, -3.0)
    """
    return x_m, -y_m


def location_to_carla(x_m: float, y_m: float) -> tuple[float, float]:
    """Convert x, y of the local frame to CARLA's.

    >>> location_to_carla(10.0, -3.0)
    (10.0, 3.0)
    """
    return x_m, -y_m


def heading_from_carla(yaw_deg: float) -> float:
    """Convert CARLA's yaw to radians counter-clockwise from east, in (-pi, pi]."""
    return wrap_angle(-math.radians(yaw_deg))


def heading_to_carla(heading_rad: float) -> float:
    """Return radians counter-clockwise from east to CARLA's yaw, in [-180, 180).

    >>> heading_to_carla(math.pi / 2)
    -90.0
    """
    return -math.degrees(wrap_angle(heading_rad))


def yaw_rate_from_carla(yaw_rate_dps: float) -> float:
    """Convert CARLA's angular velocity about z (degrees/s, clockwise from above) to radians/s counter-clockwise."""
    return -math.radians(yaw_rate_dps)


def yaw_rate_to_carla(yaw_rate_rps: float) -> float:
    """Return radians/s counter-clockwise to CARLA's angular velocity about z, degrees/s.

    >>> yaw_rate_to_carla(math.pi)
    -180.0
    """
    return -math.degrees(yaw_rate_rps)


def transform_to_carla(carla: Any, pose: Pose, above_m: float = 0.0) -> Any:
    """Convert a pose to ``carla.Transform``, ``above_m`` over the surface; ``carla`` is the module.

    >>> from types import SimpleNamespace
    >>> module = SimpleNamespace(Transform=SimpleNamespace, Location=SimpleNamespace, Rotation=SimpleNamespace)
    >>> module.Transform = lambda location, rotation: (location.y, rotation.yaw)
    >>> transform_to_carla(module, Pose(1.0, 2.0, math.pi / 2))  # left-handed: y to the south, yaw clockwise
    (-2.0, -90.0)
    """
    x, y = location_to_carla(pose.x_m, pose.y_m)
    return carla.Transform(
        carla.Location(x=x, y=y, z=pose.z_m + above_m), carla.Rotation(yaw=heading_to_carla(pose.heading_rad))
    )


def pose_from_carla(transform: Any) -> Pose:
    """Convert a ``carla.Transform`` to a pose without pitch and roll.

    >>> from types import SimpleNamespace
    >>> there = SimpleNamespace(location=SimpleNamespace(x=1.0, y=-2.0, z=0.0), rotation=SimpleNamespace(yaw=0.0))
    >>> pose_from_carla(there).y_m
    2.0
    """
    x, y = location_from_carla(transform.location.x, transform.location.y)
    return Pose(x, y, heading_from_carla(transform.rotation.yaw), transform.location.z)
