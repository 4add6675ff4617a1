"""Distributions of unreported speeds, read by :mod:`trace_dag.reconstruction.motion.speed_prior`.

Written by ``lab/fit_speeds.py`` on 2026-11-23, fitted to 318 reported travel speeds of FARS (2012 to 2023, 214 crashes)
and 148 event data recorders of NHTSA CIREN (2017 to 2025). Units: mph, and shares of a speed. The tables are a module
and not a data file, so that an estimate's fingerprint covers them.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import Final

LEVELS: Final = (0.02, 0.05, 0.1, 0.2, 0.3, 0.4, 0.5, 0.6, 0.7, 0.8, 0.9, 0.95, 0.98)
"""Probabilities of the columns below."""

SHIFTS_MPH: Final[Mapping[str, float]] = {
    "going along": -1.34,
    "speeding": 10.49,
    "speeding not coded": -1.77,
    "driver had drunk": -1.44,
    "left the road alone": 2.74,
    "a person was struck": -0.69,
    "curve": -1.14,
    "slowing": -7.94,
    "braked": -2.34,
    "struck from behind": -4.74,
    "ran into one ahead": 1.49,
    "crossing": -0.15,
    "opposite direction": 1.81,
    "motorcycle": 1.02,
    "truck or bus": -0.51,
    "surface not dry": -6.72,
    "rain, snow or fog": -1.92,
    "dark": 0.86,
    "rural": -0.43,
    "freeway": 1.22,
    "signal": -3.82,
    "limit of 30 mph or less": 4.46,
    "turning": -0.93,
    "from a stop sign": 10.0,
}
"""Shifts of the rule by each feature of a report."""

SPREAD_MPH: Final[Mapping[str, tuple[float, ...]]] = {
    "standing": (0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0),
    "slow": (-11.54, -9.07, -9.07, -6.07, -4.07, -1.07, 0.0, 0.93, 2.53, 7.74, 18.37, 20.93, 32.87),
    "speeding": (-37.26, -33.58, -27.72, -11.14, -5.52, -2.6, 0.41, 5.77, 9.88, 17.23, 24.83, 34.68, 35.38),
    "along": (-36.56, -30.78, -20.52, -8.14, -2.76, -1.01, -0.04, 0.5, 1.75, 4.65, 11.93, 22.83, 27.28),
}
"""Residuals by class of vehicles."""

BRAKING: Final[Mapping[str, tuple[float, ...]]] = {
    "turning": (0.135, 0.164, 0.292, 0.389, 0.587, 0.734, 0.75, 0.85, 0.908, 1.0, 1.045, 1.3, 1.3),
    "opposite": (0.348, 0.416, 0.484, 0.587, 0.688, 0.727, 0.801, 0.871, 0.93, 1.0, 1.021, 1.07, 1.3),
    "crossing": (0.281, 0.289, 0.321, 0.677, 0.737, 0.839, 0.881, 0.921, 0.987, 1.024, 1.054, 1.275, 1.294),
    "alone": (0.005, 0.286, 0.381, 0.546, 0.741, 0.868, 0.898, 1.0, 1.023, 1.062, 1.127, 1.3, 1.3),
    "behind": (0.155, 0.337, 0.519, 0.618, 0.729, 0.789, 0.859, 0.884, 0.92, 0.96, 1.021, 1.075, 1.3),
    "ahead": (0.012, 0.026, 0.178, 0.333, 0.355, 0.514, 0.587, 0.777, 0.897, 1.0, 1.024, 1.082, 1.3),
    "other": (0.0, 0.0, 0.004, 0.465, 0.566, 0.677, 0.782, 0.884, 0.938, 1.0, 1.039, 1.124, 1.3),
}
"""Speed at the impact as a share of the one before, by role."""

BRAKING_G: Final = (0.088, 0.108, 0.117, 0.182, 0.252, 0.29, 0.34, 0.402, 0.47, 0.578, 0.7, 0.75, 0.75)
"""Mean deceleration while a speed fell until the impact (g), of the 75 of 124 recorders of NHTSA CIREN in which it fell
by a twentieth; no more than tyres hold."""

LIMITS_MPH: Final[Mapping[str, int]] = {
    "motorway": 65,  # 38 vehicles
    "motorway_link": 55,  # 12
    "trunk": 60,  # 19
    "primary": 50,  # 70
    "secondary": 45,  # 81
    "tertiary": 40,  # 51
    "residential": 35,  # 23
}
"""The median limit that reports of fatal crashes have (``VSPD_LIM``), by the class of the road in OpenStreetMap: 294
vehicles in mapped crashes of FARS 2012 to 2016 and Virginia 2023. The medians by FUNC_SYS there, urban and rural:
interstates 55 and 70 mph, principal arterials 45 and 55, minor arterials 35 and 55, collectors 40 and 50, local roads
28 and 43."""
