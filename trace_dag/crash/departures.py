"""One vehicle that leaves the road: which one, to which side, in what manner, what it struck, or its overturn.

The side is that of the last departure (``SOE`` 63, 64, 71) before the first harmful event; else of the crash type
(``ACC_TYPE`` 1 to 5 right, 6 to 10 left, 11 to 16 ahead), else of the critical event (``P_CRASH2`` 12 to 14). Tables
before 2016 often list no events: then the first harmful event is that of the only vehicle.
"""

from __future__ import annotations

from dataclasses import dataclass
from enum import StrEnum
from typing import Final

from trace_dag.crash.codes import events as codes
from trace_dag.crash.contacts import unlisted_vehicles
from trace_dag.crash.crash_types import Side, crash_type_of
from trace_dag.crash.kind import CrashKind
from trace_dag.crash.parties import thing_party
from trace_dag.crash.record import CrashRecord, EventRecord, ImpactArea, VehicleRecord

OF_DEPARTURES: Final = frozenset({CrashKind.FIXED_OBJECT, CrashKind.OVERTURN})
"""Kinds of crash that are reconstructed by how one vehicle leaves the road, or overturns."""
ON_ROADWAY: Final = frozenset({1, 11})
"""``REL_ROAD`` of what happened on the roadway: nobody left it."""
ON_SHOULDER: Final = 2
"""``REL_ROAD`` of what happened on the shoulder."""


class DepartureSide(StrEnum):
    """Where a vehicle left the road, as its driver sees it."""

    RIGHT = "right"
    LEFT = "left"
    AHEAD = "ahead"  # where the road ends, or an object in the way


class DepartureManner(StrEnum):
    """How it came about."""

    DRIFT = "drift"  # the driver steered, or let it run, off the road
    CONTROL_LOST = "control_lost"  # too fast, a slippery road, a failure: ACC_TYPE 2, 7
    AVOIDANCE = "avoidance"  # something was avoided: ACC_TYPE 3, 8; P_CRASH3 6 to 9, 11, 12
    END_OF_ROAD = "end_of_road"  # SOE 71, ACC_TYPE 14


@dataclass(frozen=True)
class ObjectStruck:
    """An object of the report: the number of its event, what it was (``SOE``), where on the vehicle it was struck."""

    event_number: int
    code: int
    area: ImpactArea | None

    @property
    def party(self) -> int:
        """Its party number."""
        return thing_party(self.event_number)


@dataclass(frozen=True)
class Departure:
    """What the report says of the vehicle that left the road.

    ``event_number`` is that of the first harmful event. ``objects`` are what it struck from then on, in order; where it
    overturned first, what it struck afterwards, if anything. ``side`` is None where nothing tells it.
    """

    vehicle: VehicleRecord
    event_number: int
    side: DepartureSide | None
    manner: DepartureManner
    objects: tuple[ObjectStruck, ...]


SIDE_OF_EVENT: Final = {
    codes.RAN_OFF_RIGHT: DepartureSide.RIGHT,
    codes.RAN_OFF_LEFT: DepartureSide.LEFT,
    codes.RAN_OFF_AT_END: DepartureSide.AHEAD,
}
"""``SOE`` of a departure from the road to a known side."""
_SIDE_OF_TYPE: Final = {Side.RIGHT: DepartureSide.RIGHT, Side.LEFT: DepartureSide.LEFT}
_OFF_THE_END: Final = 14  # P_CRASH2
_SIDE_OF_CRITICAL: Final = {12: DepartureSide.LEFT, 13: DepartureSide.RIGHT, _OFF_THE_END: DepartureSide.AHEAD}
_FORWARD: Final = frozenset(range(11, 17))  # ACC_TYPE
_CONTROL_LOST_TYPES, _AVOIDANCE_TYPES, _END_OF_ROAD = frozenset({2, 7}), frozenset({3, 8}), 14
_STEERED: Final = frozenset({6, 7, 8, 9, 11, 12})  # P_CRASH3
_SIDEWAYS: Final = frozenset({3, 4, 5, 7})  # PCRASH4


def departs_at_end(vehicle: VehicleRecord) -> bool:
    """Whether a vehicle drove on where its road ended, by its crash type or critical event.

    >>> from dataclasses import replace
    >>> car = tree_record.vehicles[0]
    >>> departs_at_end(car), departs_at_end(replace(car, critical_event_code=14))  # P_CRASH2: off its end
    (False, True)
    """
    return vehicle.crash_type_code == _END_OF_ROAD or vehicle.critical_event_code == _OFF_THE_END


def is_of_departure(record: CrashRecord) -> bool:
    """Whether the crash is reconstructed by how one vehicle leaves the road.

    >>> is_of_departure(tree_record), is_of_departure(record)
    (True, False)
    """
    return record.kind in OF_DEPARTURES


def departure_of(record: CrashRecord) -> Departure | None:
    """What the report says of the departure; None where :func:`untold_departure` says what is missing.

    >>> departure = departure_of(tree_record)
    >>> departure.side.value, [each.code for each in departure.objects]  # SOE 42: a standing tree
    ('right', [42])
    """
    if not is_of_departure(record) or untold_departure(record) is not None:
        return None
    vehicle = _vehicle(record)
    assert vehicle is not None
    events = _events(record, vehicle)
    struck = [event for event in events if event.code in codes.FIXED_OBJECTS]
    objects = []
    for place, event in enumerate(struck):
        first = not place and event is events[0]
        area = vehicle.impact if first and event.area_1 is None else event.area_1
        objects.append(ObjectStruck(event.number, event.code, area))
    side = None if overturns_on_road(record) else _side(record, vehicle)
    manner = _manner(record, vehicle)
    return Departure(vehicle, events[0].number if events else 1, side, manner, tuple(objects))


def untold_departure(record: CrashRecord) -> str | None:
    """What the report leaves open about which vehicle left the road and what it struck, as a sentence.

    None if it leaves nothing open, or if the crash is not reconstructed by a departure.
    """
    if not is_of_departure(record):
        return None
    if _vehicle(record) is None:
        if (unlisted := unlisted_vehicles(record)) is not None:
            return unlisted
        moving = record.moving_vehicles
        which = f"which of {moving} vehicles" if moving > 1 else "which vehicle"
        return f"nothing tells {which} in transport the first harmful event was of"
    return None


def overturns_first(record: CrashRecord) -> bool:
    """Whether the vehicle overturned before it struck anything."""
    return record.kind is CrashKind.OVERTURN


def overturns_on_road(record: CrashRecord) -> bool:
    """Whether the vehicle overturned on the roadway, so that it left it to no side."""
    return overturns_first(record) and record.road_relation_code in ON_ROADWAY


def untold_side(record: CrashRecord) -> str | None:
    """A sentence saying that the report does not tell where the vehicle left the road.

    None if it does tell, or if the crash is not reconstructed by a departure.
    """
    departure = departure_of(record)
    if departure is None or departure.side is not None or overturns_on_road(record):
        return None
    vehicle = departure.vehicle
    said = "not reported" if vehicle.crash_type_code is None else str(vehicle.crash_type_code)
    critical = "not reported" if vehicle.critical_event_code is None else str(vehicle.critical_event_code)
    return (
        f"nothing tells to which side vehicle {vehicle.number} left the road: no departure to a side among its events, "
        f"ACC_TYPE {said}, P_CRASH2 {critical}"
    )


def _vehicle(record: CrashRecord) -> VehicleRecord | None:
    """The vehicle of the first harmful event."""
    first = _first_harmful(record)
    moving = [vehicle for vehicle in record.vehicles if vehicle.in_transport]
    if first is None or first.party_1 is None:
        return moving[0] if len(moving) == 1 and record.moving_vehicles == 1 else None
    return next((vehicle for vehicle in record.vehicles if vehicle.number == first.party_1), None)


def _first_harmful(record: CrashRecord) -> EventRecord | None:
    """The first event that can be the first harmful one: of its code, else any harmful one."""
    code = record.first_harmful_event_code
    named = next((event for event in record.events if event.code == code), None)
    return named or next((event for event in record.events if event.is_harmful), None)


def _events(record: CrashRecord, vehicle: VehicleRecord) -> tuple[EventRecord, ...]:
    """The vehicle's events from the first harmful one on; what that implies where the report lists none."""
    first = _first_harmful(record)
    if first is not None:
        return tuple(e for e in record.events if e.number >= first.number and e.party_1 == vehicle.number)
    code = record.first_harmful_event_code
    if code is None:
        return ()
    return (EventRecord(1, code, vehicle.number, vehicle.impact, thing_party(1), None, ("code", "party_1", "area_1")),)


def _side(record: CrashRecord, vehicle: VehicleRecord) -> DepartureSide | None:
    first = _first_harmful(record)
    before = [e for e in record.events if first is not None and e.number < first.number and e.party_1 == vehicle.number]
    sides = [SIDE_OF_EVENT[event.code] for event in before if event.code in SIDE_OF_EVENT]
    if sides:
        return sides[-1]
    departure = crash_type_of(vehicle).departure
    if departure is not None:
        return _SIDE_OF_TYPE[departure]
    if vehicle.crash_type_code in _FORWARD:
        return DepartureSide.AHEAD
    return _SIDE_OF_CRITICAL.get(vehicle.critical_event_code or 0)


def _manner(record: CrashRecord, vehicle: VehicleRecord) -> DepartureManner:
    if _side(record, vehicle) is DepartureSide.AHEAD and vehicle.crash_type_code in (None, _END_OF_ROAD):
        return DepartureManner.END_OF_ROAD
    if vehicle.crash_type_code in _CONTROL_LOST_TYPES or vehicle.stability_code in _SIDEWAYS:
        return DepartureManner.CONTROL_LOST
    if vehicle.crash_type_code in _AVOIDANCE_TYPES or vehicle.avoidance_code in _STEERED:
        return DepartureManner.AVOIDANCE
    return DepartureManner.DRIFT
