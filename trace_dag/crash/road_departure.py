"""The departure of one vehicle from the road as its first event: side, manner, and the objects struck there."""

from __future__ import annotations

from dataclasses import dataclass
from enum import StrEnum
from itertools import takewhile
from typing import Final

from trace_dag.crash.codes import elements as codes
from trace_dag.crash.crash_types import DepartureSide, departure_side
from trace_dag.crash.event_sequence import CrashEvent, EventSequence
from trace_dag.crash.parties import EventKind
from trace_dag.crash.record import CrashRecord, VehicleRecord

ON_ROADWAY: Final = frozenset({1, 11})
"""``REL_ROAD`` of what happened on the roadway: nobody left it."""
ON_SHOULDER: Final = 2
"""``REL_ROAD`` of what happened on the shoulder."""


class DepartureManner(StrEnum):
    """Manners of departures from the road."""

    DRIFT = "drift"  # the driver steered, or let it run, off the road
    CONTROL_LOST = "control_lost"  # too fast, a slippery road, a failure: ACC_TYPE 2, 7
    AVOIDANCE = "avoidance"  # something was avoided: ACC_TYPE 3, 8; P_CRASH3 6 to 9, 11, 12
    END_OF_ROAD = "end_of_road"  # SOE 71, ACC_TYPE 14


_CONTROL_LOST_TYPES, _AVOIDANCE_TYPES, _END_OF_ROAD = frozenset({2, 7}), frozenset({3, 8}), 14
_STEERED: Final = frozenset({6, 7, 8, 9, 11, 12})  # P_CRASH3
_SIDEWAYS: Final = frozenset({3, 4, 5, 7})  # PCRASH4


def side_of_first(record: CrashRecord, first: CrashEvent) -> DepartureSide | None:
    """Return the side on which the vehicle of a first event left the road; ahead for an object on the road.

    None if it is not reported.
    """
    if first.code in codes.LYING_OBJECTS and record.road_relation_code in ON_ROADWAY:
        return DepartureSide.AHEAD
    return departure_side(first.vehicle, first.side)


def departure_manner(vehicle: VehicleRecord, side: DepartureSide | None) -> DepartureManner:
    """Return the manner in which a vehicle left the road to a side.

    >>> departure_manner(tree_record.vehicles[0], DepartureSide.RIGHT).value
    'drift'
    """
    if side is DepartureSide.AHEAD and vehicle.crash_type_code in (None, _END_OF_ROAD):
        return DepartureManner.END_OF_ROAD
    if vehicle.crash_type_code in _CONTROL_LOST_TYPES or vehicle.stability_code in _SIDEWAYS:
        return DepartureManner.CONTROL_LOST
    if vehicle.crash_type_code in _AVOIDANCE_TYPES or vehicle.avoidance_code in _STEERED:
        return DepartureManner.AVOIDANCE
    return DepartureManner.DRIFT


@dataclass(frozen=True)
class Departure:
    """A vehicle that leaves the road, or overturns on it, before it touches anybody.

    ``objects`` are its strikes of objects there, in order, up to an event of another kind. ``side`` is None if it is
    not reported, and for a vehicle that overturns on the roadway.
    """

    vehicle: VehicleRecord
    side: DepartureSide | None
    manner: DepartureManner
    objects: tuple[CrashEvent, ...]


def departure_of(record: CrashRecord, sequence: EventSequence) -> Departure:
    """Return the departure that a sequence begins with.

    >>> departure = departure_of(tree_record, tree_sequence)
    >>> departure.side.value, [each.code for each in departure.objects]  # SOE 42: a standing tree
    ('right', [42])
    """
    first = sequence.first
    side = side_of_first(record, first)
    own = takewhile(lambda e: e.kind is EventKind.OBJECT_STRUCK and e.vehicle == first.vehicle, sequence.events)
    manner = departure_manner(first.vehicle, side)
    return Departure(first.vehicle, None if overturns_on_road(record, sequence) else side, manner, tuple(own))


def overturns_on_road(record: CrashRecord, sequence: EventSequence) -> bool:
    """Return whether the crash begins with a vehicle that overturns on the roadway."""
    return sequence.first.kind is EventKind.OVERTURN and record.road_relation_code in ON_ROADWAY
