"""The town's own plane and how it lies on the Earth.

The town is drawn on a plan: u along its east-west streets, v along its north-south streets, metres. The plan is turned
by a few degrees, as railway towns are, so that nothing in it is aligned with the axes. Everything later works in the
town plane (x east, y north, metres): transverse Mercator at the town's centre.
"""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray
from pyproj import Transformer

FloatArray = NDArray[np.float64]

TOWN_LATITUDE_DEG = 41.8300
TOWN_LONGITUDE_DEG = -101.5400
PLAN_ROTATION_RAD = math.radians(7.0)


def plane_points(uv_m: list[tuple[float, float]]) -> FloatArray:
    """Points of the plan to the town plane, shape (n, 2)."""
    c, s = math.cos(PLAN_ROTATION_RAD), math.sin(PLAN_ROTATION_RAD)
    return np.asarray(uv_m, float) @ np.array([[c, s], [-s, c]])


def plane_point(u_m: float, v_m: float) -> FloatArray:
    """One point of the plan to the town plane, shape (2,)."""
    return plane_points([(u_m, v_m)])[0]


class Projection:
    """Transverse Mercator on WGS84, scale 1, origin at a place: the town's plane, or a crash's local frame."""

    def __init__(self, latitude_deg: float, longitude_deg: float) -> None:
        self._transformer = Transformer.from_crs(
            "EPSG:4326",
            f"+proj=tmerc +lat_0={latitude_deg:.9f} +lon_0={longitude_deg:.9f} +k=1 +datum=WGS84 +units=m +no_defs",
            always_xy=True,
        )

    def to_plane(self, latitude_deg: FloatArray | float, longitude_deg: FloatArray | float) -> FloatArray:
        """Degrees to metres, shape (2,) or (n, 2)."""
        return np.stack(self._transformer.transform(longitude_deg, latitude_deg), axis=-1)

    def to_degrees(self, xy_m: FloatArray) -> FloatArray:
        """Metres, shape (..., 2), to (latitude, longitude) in degrees, shape (..., 2)."""
        lon, lat = self._transformer.transform(xy_m[..., 0], xy_m[..., 1], direction="INVERSE")
        return np.stack([np.asarray(lat), np.asarray(lon)], axis=-1)


TOWN = Projection(TOWN_LATITUDE_DEG, TOWN_LONGITUDE_DEG)
