"""Distributions of speeds that nobody reported: what :mod:`trace_dag.states.speed_prior` reads.

Written by ``benchmarks/fit_speeds.py`` on 2026-11-23, fitted to 318 reported travel speeds of FARS (2012 to 2023, 214
crashes) and 148 event data recorders of NHTSA CIREN (2017 to 2025). Units: mph, and shares of a speed. The tables are a
module and not a data file, so that an estimate's fingerprint covers them.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import Final

LEVELS: Final = (0.02, 0.05, 0.1, 0.2, 0.3, 0.4, 0.5, 0.6, 0.7, 0.8, 0.9, 0.95, 0.98)
"""Probabilities of the columns below."""

SHIFTS_MPH: Final[Mapping[str, float]] = {
    "going along": -1.4,
    "speeding": 10.45,
    "speeding not coded": -1.37,
    "driver had drunk": -1.16,
    "left the road alone": 2.57,
    "a person was struck": -0.36,
    "curve": -1.04,
    "slowing": -7.62,
    "braked": -2.16,
    "struck from behind": -4.56,
    "ran into one ahead": 1.36,
    "crossing": 0.39,
    "opposite direction": 1.77,
    "motorcycle": 0.7,
    "truck or bus": -0.56,
    "surface not dry": -6.68,
    "rain, snow or fog": -1.85,
    "dark": 0.79,
    "rural": -0.39,
    "freeway": 1.04,
    "signal": -4.11,
    "limit of 30 mph or less": 4.41,
    "no limit reported": -7.93,
    "turning": -0.93,
    "from a stop sign": 10.0,
}
"""What each feature of a report adds to the rule."""

SPREAD_MPH: Final[Mapping[str, tuple[float, ...]]] = {
    "standing": (0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0),
    "slow": (-11.54, -9.07, -9.07, -6.07, -4.07, -1.07, 0.0, 0.93, 2.53, 7.74, 18.37, 20.93, 32.87),
    "speeding": (-36.94, -32.13, -26.02, -10.9, -5.48, -2.21, 0.45, 5.78, 10.05, 21.03, 24.96, 34.82, 35.62),
    "along": (-36.82, -30.82, -20.59, -8.24, -3.11, -0.78, 0.02, 0.53, 1.83, 4.58, 11.53, 23.05, 26.84),
}
"""What is left, by class of vehicles."""

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
