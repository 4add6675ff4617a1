"""Units at the boundaries. Inside the project: metres, seconds, radians, m/s, kilograms.

Nothing else in the code multiplies by a conversion factor of its own.
"""

from __future__ import annotations

import math
from typing import Final

MPS_PER_MPH: Final = 0.44704  # exact, international mile
MPS_PER_KMH: Final = 1 / 3.6
METRES_PER_FOOT: Final = 0.3048  # exact
KG_PER_LB: Final = 0.45359237  # exact
_CLOCK_DIGITS: Final = 9
GRAVITY_MPS2: Final = 9.80665  # standard gravity, ISO 80000-3


def mph_to_mps(speed_mph: float) -> float:
    """Convert miles per hour to metres per second.

    >>> mph_to_mps(25)
    11.176
    """
    return speed_mph * MPS_PER_MPH


def mps_to_mph(speed_mps: float) -> float:
    """Convert metres per second to miles per hour.

    >>> round(mps_to_mph(11.176), 6)
    25.0
    """
    return speed_mps / MPS_PER_MPH


def kmh_to_mps(speed_kmh: float) -> float:
    """Convert kilometres per hour to metres per second.

    >>> kmh_to_mps(36)
    10.0
    """
    return speed_kmh * MPS_PER_KMH


def mps_to_kmh(speed_mps: float) -> float:
    """Convert metres per second to kilometres per hour.

    >>> mps_to_kmh(10)
    36.0
    """
    return speed_mps / MPS_PER_KMH


def clock_to_bearing_rad(clock_h: float) -> float:
    """Convert a clock position on a vehicle's body to an angle, radians counter-clockwise from the vehicle's front.

    12 o'clock is the front (0), 9 the left (+pi/2), 6 the rear (pi), 3 the right (-pi/2), as in FARS ``IMPACT1``.

    >>> math.degrees(clock_to_bearing_rad(9))
    90.0
    """
    return wrap_angle(-clock_h * math.pi / 6)


def bearing_to_clock_h(bearing_rad: float) -> float:
    """Convert an angle counter-clockwise from the vehicle's front to a clock position in (0, 12], hours.

    >>> bearing_to_clock_h(math.pi / 2)
    9.0
    """
    clock_h = round((-bearing_rad * 6 / math.pi) % 12, _CLOCK_DIGITS) % 12
    return clock_h or 12.0  # straight ahead, whatever its last bit is


def clock_difference_h(a_h: float, b_h: float) -> float:
    """Return the smallest distance between two clock positions, 0 to 6 hours.

    >>> clock_difference_h(11, 1)
    2
    """
    difference = abs(a_h - b_h) % 12
    return min(difference, 12 - difference)


def wrap_angle(angle_rad: float) -> float:
    """Return the same direction in (-pi, pi].

    >>> round(math.degrees(wrap_angle(math.radians(270))), 6)
    -90.0
    """
    wrapped = math.remainder(angle_rad, math.tau)
    return math.pi if wrapped == -math.pi else wrapped
