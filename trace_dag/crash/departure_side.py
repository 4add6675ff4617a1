"""The side on which a vehicle left the road before its first harmful event.

It follows from events, crash type and critical event.

The side is that of the last departure (``SOE`` 63, 64, 71) before the event; else of the crash type (``ACC_TYPE`` 1
to 5 right, 6 to 10 left, 11 to 16 ahead), else of the critical event (``P_CRASH2`` 12 to 14).
"""

from __future__ import annotations

from enum import StrEnum
from typing import Final

from trace_dag.crash.codes import elements as codes
from trace_dag.crash.crash_types import Side, crash_type_of
from trace_dag.crash.record import VehicleRecord


class DepartureSide(StrEnum):
    """Sides of the road, seen by the driver."""

    RIGHT = "right"
    LEFT = "left"
    AHEAD = "ahead"  # where the road ends, or an object in the way


SIDE_OF_EVENT: Final = {
    codes.RAN_OFF_RIGHT: DepartureSide.RIGHT,
    codes.RAN_OFF_LEFT: DepartureSide.LEFT,
    codes.RAN_OFF_AT_END: DepartureSide.AHEAD,
}
"""``SOE`` of a departure from the road to a known side."""
SIDE_AFTER_EVENT: Final = {
    **SIDE_OF_EVENT,
    codes.CROSSED_CENTRELINE: DepartureSide.LEFT,
    codes.CROSSED_MEDIAN: DepartureSide.LEFT,
}
"""Side that a vehicle is on after an event, on which it leaves the road if no later one says so."""
_OVER_THE_MIDDLE: Final = frozenset({codes.CROSSED_CENTRELINE, codes.CROSSED_MEDIAN})
_SIDE_OF_TYPE: Final = {Side.RIGHT: DepartureSide.RIGHT, Side.LEFT: DepartureSide.LEFT}
_OFF_THE_END: Final = 14  # P_CRASH2
_SIDE_OF_CRITICAL: Final = {12: DepartureSide.LEFT, 13: DepartureSide.RIGHT, _OFF_THE_END: DepartureSide.AHEAD}
_FORWARD: Final = frozenset(range(11, 17))  # ACC_TYPE
_END_OF_ROAD: Final = 14  # ACC_TYPE


def side_after(code: int, *, keeps_left: bool) -> DepartureSide:
    """Return the side of :data:`SIDE_AFTER_EVENT`; for the road's middle the opposite one in left-hand traffic.

    >>> side_after(68, keeps_left=True).value  # SOE: crossed the centreline
    'right'
    """
    return DepartureSide.RIGHT if keeps_left and code in _OVER_THE_MIDDLE else SIDE_AFTER_EVENT[code]


def departs_at_end(vehicle: VehicleRecord) -> bool:
    """Return whether a vehicle drove off the end of its road, by its crash type or critical event.

    >>> from dataclasses import replace
    >>> car = tree_record.vehicles[0]
    >>> departs_at_end(car), departs_at_end(replace(car, critical_event_code=14))  # P_CRASH2: off its end
    (False, True)
    """
    return vehicle.crash_type_code == _END_OF_ROAD or vehicle.critical_event_code == _OFF_THE_END


def departure_side(vehicle: VehicleRecord, by_event: DepartureSide | None) -> DepartureSide | None:
    """Return the side on which a vehicle left the road before its first harmful event, or None if not reported.

    ``by_event`` is the side given by its events.

    >>> str(departure_side(tree_record.vehicles[0], None))  # ACC_TYPE 1
    'right'
    """
    if by_event is not None:
        return by_event
    departure = crash_type_of(vehicle).departure
    if departure is not None:
        return _SIDE_OF_TYPE[departure]
    if vehicle.crash_type_code in _FORWARD:
        return DepartureSide.AHEAD
    return _SIDE_OF_CRITICAL.get(vehicle.critical_event_code or 0)
