"""Values that the fields of a report imply for missing ones: areas of impact, movements, crash types.

Rules follow the FARS/CRSS Coding and Validation Manual's definitions of ``ACC_TYPE``, ``P_CRASH1``, ``P_CRASH2`` and
``IMPACT1``. The caller marks every implied value as such.
"""

from __future__ import annotations

import cmath
import math
from collections.abc import Callable, Mapping, Sequence
from typing import Final

from trace_dag.common.dataclass_tools import replace
from trace_dag.common.units import bearing_to_clock_h, clock_difference_h, clock_to_bearing_rad, mph_to_mps, wrap_angle
from trace_dag.crash.classes import RoadTopology
from trace_dag.crash.codes.elements import CROSSED_CENTRELINE, CURVED, HARM_EV, PERSON_EVENTS, VEHICLE_EVENTS
from trace_dag.crash.crash_types import crash_type, crash_type_of
from trace_dag.crash.record import (
    CrashRecord,
    EventRecord,
    ImpactArea,
    PreCrashMovement,
    VehicleRecord,
    colliding_pair,
    first_vehicle_contact,
)

HOUR_RAD: Final = math.pi / 6
SAME_AREA_H: Final = 1.5
"""Two areas this many hours apart or nearer are taken for the same one."""

_SIDE_AREAS: Final[Mapping[int, tuple[float, float]]] = {
    61: (9.0, 1.5),
    62: (9.75, 0.75),
    63: (8.25, 0.75),
    81: (3.0, 1.5),
    82: (2.25, 0.75),
    83: (3.75, 0.75),
}
"""Centre and half width, in hours, of the areas that are not clock positions: sides run from corner to corner."""


def impact_area(code: int | None) -> ImpactArea | None:
    """Return the area of the body for a code of ``IMPACT1`` or ``AOI``, None for codes without a side.

    >>> impact_area(3).clock_h, impact_area(13)  # 3 o'clock; 13 is the top
    (3.0, None)
    """
    if code is None:
        return None
    if 1 <= code <= 12:
        centre_h, half_width_h = float(code), 0.5
    elif code in _SIDE_AREAS:
        centre_h, half_width_h = _SIDE_AREAS[code]
    else:
        return None
    return ImpactArea(code, centre_h, clock_to_bearing_rad(centre_h), half_width_h * HOUR_RAD)


# --- crash type ----------------------------------------------------------------------------------------------------

_CRASH_TYPE_UNKNOWN: Final = 99


def add_crash_types(vehicles: Sequence[VehicleRecord], events: Sequence[EventRecord]) -> tuple[VehicleRecord, ...]:
    """Return the vehicles; one of a pair without ``ACC_TYPE`` gets the type its partner implies, marked.

    >>> silent = replace(record.vehicles[0], crash_type_code=None)
    >>> car, motorcycle = add_crash_types([silent, record.vehicles[1]], record.events)
    >>> motorcycle.crash_type_code, car.crash_type_code, car.implied  # 69 crossed the turn of a 68
    (69, 68, ('crash_type_code',))
    """
    pair = colliding_pair(vehicles, events)
    if pair is None:
        return tuple(vehicles)
    implied: dict[int, VehicleRecord] = {}
    for vehicle, partner in (pair, pair[::-1]):
        counterpart = crash_type_of(partner).counterpart
        if vehicle.crash_type_code in (None, _CRASH_TYPE_UNKNOWN) and counterpart is not None:
            implied[vehicle.number] = replace(
                vehicle, crash_type_code=counterpart, implied=(*vehicle.implied, "crash_type_code")
            )
    return tuple(implied.get(vehicle.number, vehicle) for vehicle in vehicles)


def in_one_configuration(one: int | None, other: int | None) -> bool:
    """Return whether two ``ACC_TYPE`` form one configuration, such as 20 and 21.

    >>> in_one_configuration(20, 21), in_one_configuration(20, 50)
    (True, False)
    """
    return crash_type(one).counterpart == (other or -1) or crash_type(other).counterpart == (one or -1)


# --- movement ------------------------------------------------------------------------------------------------------

_MOVEMENT_OF_CRITICAL_EVENT: Final[Mapping[int, PreCrashMovement]] = {
    10: PreCrashMovement.GOING_STRAIGHT,
    11: PreCrashMovement.GOING_STRAIGHT,
    12: PreCrashMovement.GOING_STRAIGHT,
    13: PreCrashMovement.GOING_STRAIGHT,
    15: PreCrashMovement.TURNING_LEFT,
    16: PreCrashMovement.TURNING_RIGHT,
    17: PreCrashMovement.GOING_STRAIGHT,
    18: PreCrashMovement.DECELERATING,
    20: PreCrashMovement.BACKING,
    21: PreCrashMovement.U_TURN,
}
_MOVEMENT_OF_MOTORIST: Final[Mapping[int, PreCrashMovement]] = {
    1: PreCrashMovement.TURNING_LEFT,
    2: PreCrashMovement.TURNING_RIGHT,
    3: PreCrashMovement.GOING_STRAIGHT,
}
"""``MOTMAN``."""
_MOVEMENT_OF_GROUP: Final[Mapping[int, PreCrashMovement]] = {
    200: PreCrashMovement.BACKING,
    **dict.fromkeys((310, 400, 600, 720, 740, 750, 910), PreCrashMovement.GOING_STRAIGHT),
}
"""``PEDCGP``: working, walking along, in the roadway, multiple threat, dash, crossing before one that does not turn."""
_MOVEMENT_OF_CYCLIST_GROUP: Final[Mapping[int, PreCrashMovement]] = {
    210: PreCrashMovement.TURNING_LEFT,
    215: PreCrashMovement.TURNING_RIGHT,
    600: PreCrashMovement.BACKING,
    **dict.fromkeys((145, 158, 230, 310), PreCrashMovement.GOING_STRAIGHT),
}
"""``BIKECGP``: motorist turns, backs, overtakes, or meets a cyclist who failed to yield."""
_FASTEST_TURN_MPS: Final = mph_to_mps(25)
"""No vehicle turns faster at an intersection: at the 15 m radius of a wide left turn that takes 0.85 g."""
UNSAID_MOVEMENTS: Final = frozenset({PreCrashMovement.OTHER, PreCrashMovement.UNKNOWN})


def implied_movement(vehicle: VehicleRecord) -> PreCrashMovement | None:
    """Return the movement implied by ``ACC_TYPE``, else by ``P_CRASH2``, else by a speed of zero; None without them.

    >>> implied_movement(record.vehicles[0]).name  # ACC_TYPE 68
    'TURNING_LEFT'
    """
    movement = crash_type_of(vehicle).movement
    if movement is None:
        movement = _MOVEMENT_OF_CRITICAL_EVENT.get(vehicle.critical_event_code or 0)
    if movement is None and vehicle.travel_speed_mps == 0:
        movement = PreCrashMovement.STOPPED
    if movement is PreCrashMovement.GOING_STRAIGHT and vehicle.alignment_code in CURVED:
        return PreCrashMovement.NEGOTIATING_CURVE
    return movement


def movement_of_crash(record: CrashRecord, vehicle: VehicleRecord) -> PreCrashMovement | None:
    """Return the movement that other fields of the crash imply for a vehicle, or None.

    The typing of the person that it strikes names its manoeuvre (``MOTMAN``, ``PEDCGP``, ``BIKECGP``). A vehicle goes
    straight if it strikes a person with its front away from intersections, strikes one after another vehicle did, meets
    a vehicle that has crossed the centreline, or is too fast to turn.

    >>> silent = replace(pedestrian_record.vehicles[0], movement=PreCrashMovement.UNKNOWN)
    >>> movement_of_crash(pedestrian_record, silent).name
    'GOING_STRAIGHT'
    """
    strikes = [event for event in record.events if event.code in PERSON_EVENTS]
    for index, event in enumerate(strikes):
        if event.party_1 != vehicle.number:
            continue
        person = next((each for each in record.non_motorists if each.party == event.party_2), None)
        if person is not None:
            movement = (
                _MOVEMENT_OF_MOTORIST.get(person.motorist_manoeuvre_code or 0)
                or _MOVEMENT_OF_GROUP.get(person.pedestrian_group_code or 0)
                or _MOVEMENT_OF_CYCLIST_GROUP.get(person.cyclist_group_code or 0)
            )
            if movement is not None:
                return movement
        front = vehicle.impact is not None and is_near(vehicle.impact, _FRONT)
        if index or (front and record.road_topology is RoadTopology.NOT_AN_INTERSECTION):
            return PreCrashMovement.GOING_STRAIGHT
    if (vehicle.travel_speed_mps or 0.0) > _FASTEST_TURN_MPS:
        return PreCrashMovement.GOING_STRAIGHT
    crossed = {event.party_1 for event in record.events if event.code == CROSSED_CENTRELINE}
    pair = {each.number for each in record.colliding_vehicles or ()}
    return PreCrashMovement.GOING_STRAIGHT if vehicle.number in pair and crossed & pair else None


# --- impact --------------------------------------------------------------------------------------------------------

_FRONT, _REAR = 12, 6
_FRONT_TO_REAR, _FRONT_TO_FRONT, _REAR_TO_REAR = 1, 2, 10


def _implied_impact_of_manner(man_coll: int | None, partner: ImpactArea | None) -> ImpactArea | None:
    """Return the area that ``MAN_COLL`` implies for a vehicle, given the other vehicle's area."""
    if man_coll == _FRONT_TO_FRONT:
        return impact_area(_FRONT)
    if man_coll == _REAR_TO_REAR:
        return impact_area(_REAR)
    if man_coll == _FRONT_TO_REAR and partner is not None:
        if is_near(partner, _FRONT):
            return impact_area(_REAR)
        if is_near(partner, _REAR):
            return impact_area(_FRONT)
    return None


def implied_impact_of_damage(damaged_areas: Sequence[int]) -> ImpactArea | None:
    """Return the mean of the damaged clock positions with an interval that covers them; None if they are spread.

    >>> implied_impact_of_damage([11, 12, 1]).code
    12
    """
    bearings = [clock_to_bearing_rad(code) for code in damaged_areas if 1 <= code <= 12]
    if not bearings:
        return None
    ahead, left = math.fsum(map(math.cos, bearings)), math.fsum(map(math.sin, bearings))
    mean = complex(ahead, left) / len(bearings)
    if abs(mean) < _DAMAGE_CONCENTRATION:
        return None
    centre_rad = wrap_angle(cmath.phase(mean))
    spread_rad = max(abs(wrap_angle(bearing - centre_rad)) for bearing in bearings)
    clock_h = bearing_to_clock_h(centre_rad)
    return ImpactArea(round(clock_h) or 12, clock_h, centre_rad, spread_rad + HOUR_RAD / 2)


_DAMAGE_CONCENTRATION: Final = 0.7
"""Mean resultant length below which damage says nothing about one impact: positions over more than 150 degrees."""


def is_near(area: ImpactArea, clock_h: float, tolerance_h: float = SAME_AREA_H) -> bool:
    """Return whether a clock position lies in an area, or within ``tolerance_h`` of its centre.

    >>> struck = record.vehicles[0].impact  # at 3 o'clock
    >>> is_near(struck, 4.0), is_near(struck, 6.0)
    (True, False)
    """
    reach_h = max(tolerance_h, area.half_width_rad / HOUR_RAD)
    return clock_difference_h(area.clock_h, clock_h) <= reach_h


def add_impacts(
    vehicles: Sequence[VehicleRecord], events: Sequence[EventRecord], man_coll: int | None
) -> tuple[VehicleRecord, ...]:
    """Return the vehicles with ``impact`` from any field that gives it, marked as implied unless from ``IMPACT1``.

    ``IMPACT1`` is the vehicle's first impact with anything. If a vehicle struck something else before its collision
    with the other vehicle, the event has the area of the collision, and a reconstruction needs that one.

    >>> silent = [replace(vehicle, impact=None, initial_impact_code=None) for vehicle in record.vehicles]
    >>> [vehicle.impact.clock_h for vehicle in add_impacts(silent, record.events, 6)]  # by the event's areas
    [3.0, 1.0]
    """
    collision = first_vehicle_contact(events)
    pair = colliding_pair(vehicles, events) or ()
    found = {
        vehicle.number: _with_own_impact(vehicle, events, collision, in_pair=vehicle in pair) for vehicle in vehicles
    }
    for vehicle, partner in (pair, pair[::-1]) if pair else ():
        if found[vehicle.number].impact is None:
            area = _implied_impact_of_manner(man_coll, found[partner.number].impact)
            if area is None and not _harmful_before(vehicle.number, events, None):
                area = implied_impact_of_damage(vehicle.damaged_areas)
            if area is not None:
                found[vehicle.number] = _implied(found[vehicle.number], area)
    return tuple(found[vehicle.number] for vehicle in vehicles)


def _with_own_impact(
    vehicle: VehicleRecord, events: Sequence[EventRecord], collision: EventRecord | None, *, in_pair: bool
) -> VehicleRecord:
    initial = impact_area(vehicle.initial_impact_code)
    of_event = area_in(collision, vehicle.number) if collision else None
    if of_event is not None and (initial is None or _harmful_before(vehicle.number, events, collision)):
        unchanged = initial is not None and initial.code == of_event.code
        return replace(vehicle, impact=initial) if unchanged else _implied(vehicle, of_event)
    if initial is not None:
        return replace(vehicle, impact=initial)
    own = next((area for event in events if (area := area_in(event, vehicle.number)) is not None), None)
    area = impact_area(crash_type_of(vehicle).impact_code) if in_pair else own
    return _implied(vehicle, area) if area is not None else vehicle


def area_in(event: EventRecord, number: int) -> ImpactArea | None:
    """Return the area of a numbered vehicle that an event touched.

    >>> area_in(record.events[0], 1).clock_h
    3.0
    """
    if event.party_1 == number:
        return event.area_1
    return event.area_2 if event.party_2 == number else None


def _harmful_before(number: int, events: Sequence[EventRecord], collision: EventRecord | None) -> bool:
    """Return whether the vehicle had another harmful event before ``collision``, or at all if that is None."""
    for event in events:
        if event is collision:
            return False
        if number in (event.party_1, event.party_2) and event.code in HARM_EV.meanings:
            if collision is None and event.code in VEHICLE_EVENTS:
                continue
            if area_in(event, number) is not None:
                return True
    return False


def _implied(vehicle: VehicleRecord, area: ImpactArea) -> VehicleRecord:
    return replace(vehicle, impact=area, implied=(*vehicle.implied, "impact"))


# --- manner of collision ------------------------------------------------------------------------------------------

CORNER_H: Final = 2.0
"""From the middle of a side to the body's corner, in hours: a corner belongs to both of its sides."""


def agrees_with_manner(man_coll: int | None, one: ImpactArea | None, other: ImpactArea | None) -> bool | None:
    """Return whether ``MAN_COLL`` allows these areas to meet, or None if it or an area is unknown."""
    needs = _MANNERS.get(man_coll or 0)
    return None if needs is None or one is None or other is None else needs(one, other) or needs(other, one)


def is_on_side(area: ImpactArea, tolerance_h: float = CORNER_H) -> bool:
    """Return whether an area is on the left or right side; corners (1, 5, 7, 11) count unless excluded."""
    return is_near(area, 3, tolerance_h) or is_near(area, 9, tolerance_h)


_MANNERS: Final[dict[int, Callable[[ImpactArea, ImpactArea], bool]]] = {
    _FRONT_TO_REAR: lambda a, b: is_near(a, _FRONT) and is_near(b, _REAR),
    _FRONT_TO_FRONT: lambda a, b: is_near(a, _FRONT) and is_near(b, _FRONT),
    **dict.fromkeys((6, 7, 8), lambda a, b: is_on_side(a) or is_on_side(b)),
    9: lambda a, b: is_near(a, _REAR) and is_on_side(b),
    _REAR_TO_REAR: lambda a, b: is_near(a, _REAR) and is_near(b, _REAR),
}
