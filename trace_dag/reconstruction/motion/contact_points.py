"""Contact points on a vehicle: that of a reported area of impact, and those beside it."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Final

from trace_dag.crash.record import ImpactArea

_FRONT_RAD: Final = math.radians(45)
_REAR_RAD: Final = math.radians(135)
_EDGE: Final = 0.85  # share of half the width: what moves along and is struck at a side is caught by the corner


@dataclass(frozen=True)
class ContactPoint:
    """A point of a vehicle's outline, in its own axes, with the outward normal of the face."""

    ahead_m: float
    left_m: float
    normal: tuple[float, float]


def contact_points_of(area: ImpactArea | None, half_length: float, half_width: float) -> list[ContactPoint]:
    """Return contact points to try: that of the area, then the corner beside it, then the middle of the front.

    >>> contact_points_of(None, 2.4, 0.9)[0]  # nothing reported: the middle of the front
    ContactPoint(ahead_m=2.4, left_m=0.0, normal=(1.0, 0.0))
    """
    bearing = 0.0 if area is None else area.centre_rad
    side = math.copysign(1.0, bearing)

    def front(share: float) -> ContactPoint:
        return ContactPoint(half_length, share * half_width, (1.0, 0.0))

    def rear(share: float) -> ContactPoint:
        return ContactPoint(-half_length, share * half_width, (-1.0, 0.0))

    if abs(bearing) <= _FRONT_RAD:
        first = front(max(-_EDGE, min(_EDGE, math.tan(bearing))))
        return [first, rear(0.0)] if area is None else [first]
    if abs(bearing) >= _REAR_RAD:
        return [rear(max(-_EDGE, min(_EDGE, -math.tan(bearing))))]
    along = half_length / math.tan(abs(bearing))
    beside = ContactPoint(along, side * half_width, (0.0, side))
    return [beside, front(side * _EDGE) if along >= 0 else rear(side * _EDGE), front(side * _EDGE)]
