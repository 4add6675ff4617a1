"""FARS crash types read for one vehicle: encounter, manoeuvre, side struck, and side on which it left the road.

``ACC_TYPE`` (1-99) is coded per vehicle from the crash type diagrams of the FARS/CRSS Coding and Validation Manual.
Read by number, never by label (the labels of 68-85 changed in 2023). If ``ACC_TYPE`` is no help (98, 99, single driver
types), the critical event ``P_CRASH2`` often does: where the other vehicle came from and which of the two left its lane
(:func:`critical_event`).

The side on which a vehicle left the road before its first harmful event is that of its last departure (``SOE`` 63, 64,
71) before the event; else of the crash type (``ACC_TYPE`` 1 to 5 right, 6 to 10 left, 11 to 16 ahead), else of the
critical event (``P_CRASH2`` 12 to 14).
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from enum import StrEnum
from typing import Any, Final

from trace_dag.common.data_files import read_csv
from trace_dag.crash.classes import VehicleTrajectory
from trace_dag.crash.codes import elements as codes
from trace_dag.crash.record import PreCrashMovement, VehicleRecord


class Relation(StrEnum):
    """Relations of two vehicles before either began its manoeuvre."""

    SAME_LANE = "same_lane"  # rear-end
    SAME_DIRECTION = "same_direction"  # adjacent paths: sideswipe, lane change, passing
    OPPOSITE_DIRECTION = "opposite_direction"
    CROSSING = "crossing"  # from the left or the right


class EncounterRole(StrEnum):
    """Parts of a vehicle in an encounter."""

    STRIKING = "striking"  # with its front, by the diagram
    STRUCK = "struck"
    ENCROACHING = "encroaching"  # left its own path
    STEADY = "steady"  # kept to its path
    UNDETERMINED = "undetermined"


class Turn(StrEnum):
    """Turn at a junction or driveway."""

    LEFT = "left"
    RIGHT = "right"
    U_TURN = "u_turn"


class Side(StrEnum):
    """Side of a vehicle, as its driver sees it."""

    LEFT = "left"
    RIGHT = "right"


@dataclass(frozen=True)
class CrashType:
    """One row of the table, ``crash_types.csv``. ``None`` where the diagram does not say.

    ``turn``: the turn of this vehicle; ``other_from``: the side the other vehicle comes from (crossing) or travels on
    (same direction); ``stopped``, ``backing``: this vehicle's motion. ``trajectory``: the manual's category of the
    configuration; ``single_driver``: no other vehicle's course is involved, and ``departure`` is the side on which this
    vehicle left the road. ``movement`` and ``impact_code``: the matching values of ``P_CRASH1`` and ``IMPACT1``;
    ``shows``: the side this vehicle shows the other one on its way across or into its path. ``counterpart``: the
    ``ACC_TYPE`` of the other vehicle, the first of several.
    """

    relation: Relation | None = None
    role: EncounterRole = EncounterRole.UNDETERMINED
    turn: Turn | None = None
    other_from: Side | None = None
    stopped: bool = False
    backing: bool = False
    trajectory: VehicleTrajectory = VehicleTrajectory.OTHERS
    single_driver: bool = False
    departure: Side | None = None
    movement: PreCrashMovement | None = None
    impact_code: int | None = None
    shows: Side | None = None
    counterpart: int | None = None

    @property
    def of_two(self) -> bool:
        """Return whether this is a configuration of two vehicles; the other one may be unknown."""
        return self.relation is not None or self.counterpart is not None

    @property
    def needs_junction(self) -> bool:
        """Return whether the configuration needs a junction or driveway, because a vehicle turned or two crossed."""
        return self.trajectory in (VehicleTrajectory.TURNING, VehicleTrajectory.INTERSECTING)

    @property
    def turned_across(self) -> Turn | None:
        """Return the turn across or into the other's path; None for a vehicle struck from behind while turning."""
        return self.turn if self.role is EncounterRole.ENCROACHING else None


_MOVEMENT_OF_TURN: Final = {
    Turn.LEFT: PreCrashMovement.TURNING_LEFT,
    Turn.RIGHT: PreCrashMovement.TURNING_RIGHT,
    Turn.U_TURN: PreCrashMovement.U_TURN,
}
_TURN_OF_MOVEMENT: Final = {movement: turn for turn, movement in _MOVEMENT_OF_TURN.items()}
_FIELDS: Final[Mapping[str, Callable[[str], object]]] = {
    "relation": Relation,
    "role": EncounterRole,
    "turn": Turn,
    "other_from": Side,
    "stopped": bool,
    "backing": bool,
    "trajectory": VehicleTrajectory,
    "single_driver": bool,
    "departure": Side,
    "shows": Side,
    "movement": lambda name: PreCrashMovement[name.upper()],
    "impact_code": int,
    "counterpart": int,
}


def _read_types() -> dict[int, CrashType]:
    """Return the rows of ``crash_types.csv``, where an empty cell is a default, by ``ACC_TYPE``."""
    types: dict[int, CrashType] = {}
    for row in read_csv("trace_dag.crash", "crash_types.csv"):
        said: dict[str, Any] = {name: read(row[name]) for name, read in _FIELDS.items() if row[name]}
        types[int(row["acc_type"])] = CrashType(**said)
    return types


_ACROSS: Final = frozenset({68, 69})  # the two types of which the side that traffic keeps tells the turn


def _across_from_the_left(kind: CrashType) -> CrashType:
    """Return a type of a turn across oncoming traffic for left-hand traffic: a turn to the right."""
    turn = None if kind.turn is None else Turn.RIGHT
    shows = None if kind.shows is None else opposite_side(kind.shows)
    return replace(kind, turn=turn, shows=shows, movement=kind.movement if turn is None else _MOVEMENT_OF_TURN[turn])


CRASH_TYPES: dict[int, CrashType] = _read_types()
_UNKNOWN: Final = CrashType()


def crash_type(acc_type: int | None) -> CrashType:
    """Return the row of the table for an ``ACC_TYPE``; an empty row for unknown types and None.

    >>> crash_type(69).counterpart, crash_type(69).movement.name
    (68, 'GOING_STRAIGHT')
    """
    return CRASH_TYPES.get(acc_type or 0, _UNKNOWN)


def crash_type_of(vehicle: VehicleRecord) -> CrashType:
    """Return the row of the table for a vehicle; an empty row if its type is unknown.

    >>> crash_type_of(record.vehicles[0]).turn.value  # ACC_TYPE 68: turns across the path of an oncoming vehicle
    'left'
    """
    kind = crash_type(vehicle.crash_type_code)
    return _across_from_the_left(kind) if vehicle.keeps_left and vehicle.crash_type_code in _ACROSS else kind


def turn_of(vehicle: VehicleRecord) -> Turn | None:
    """Return the turn of a vehicle, from its movement or else from its crash type.

    >>> turn_of(record.vehicles[0]).value  # P_CRASH1 11: turning left
    'left'
    """
    return _TURN_OF_MOVEMENT.get(vehicle.movement, crash_type_of(vehicle).turn)


def vehicle_trajectory(acc_types: Sequence[int | None]) -> VehicleTrajectory:
    """Return the class of a crash from the ``ACC_TYPE`` of the vehicles that collided, first party first.

    A vehicle with a type of a pair outweighs one without. If two types name different classes, that of the first party
    counts; :func:`trajectories_disagree` reports this case.

    >>> str(vehicle_trajectory([98, 86]))  # other, and straight paths that intersect
    'intersecting'
    """
    named = [crash_type(code).trajectory for code in acc_types]
    return next((each for each in named if each is not VehicleTrajectory.OTHERS), VehicleTrajectory.OTHERS)


def trajectories_disagree(acc_types: Sequence[int | None]) -> bool:
    """Return whether the vehicles' known ``ACC_TYPE`` values fall into different classes.

    >>> trajectories_disagree([86, 87]), trajectories_disagree([86, 50]), trajectories_disagree([86, None])
    (False, True, False)
    """
    return len({crash_type(code).trajectory for code in acc_types if code is not None}) > 1


@dataclass(frozen=True)
class CriticalEvent:
    """The meaning of ``P_CRASH2``.

    ``own``: this vehicle's action made the crash; None: the code does not say.

    ``driveway``: the vehicle that came from the crossing path (``crossing_is_other``: the other one) came from a
    driveway or roadside, where the map need not have a road.
    """

    own: bool | None = None
    relation: Relation | None = None
    crossing_is_other: bool = False
    driveway: bool = False


_CRITICAL_EVENTS: Final[Mapping[int, CriticalEvent]] = {
    **dict.fromkeys((*range(1, 7), 8, 9, *range(10, 17), 18, 20, 21), CriticalEvent(own=True)),
    17: CriticalEvent(own=True, relation=Relation.CROSSING),
    **dict.fromkeys(range(50, 54), CriticalEvent(relation=Relation.SAME_LANE)),  # another one in this vehicle's lane
    # The oncoming vehicle was in "this vehicle's lane": as a rule, because this one was in its lane.
    54: CriticalEvent(own=True, relation=Relation.OPPOSITE_DIRECTION),
    **dict.fromkeys((60, 61), CriticalEvent(own=False, relation=Relation.SAME_DIRECTION)),
    **dict.fromkeys((62, 63), CriticalEvent(own=False, relation=Relation.OPPOSITE_DIRECTION)),
    **dict.fromkeys(range(65, 69), CriticalEvent(own=False, relation=Relation.CROSSING, crossing_is_other=True)),
    **dict.fromkeys(
        (64, *range(70, 74)),
        CriticalEvent(own=False, relation=Relation.CROSSING, crossing_is_other=True, driveway=True),
    ),
    **dict.fromkeys((55, 74, 78), CriticalEvent(own=False)),
}


def critical_event(code: int | None) -> CriticalEvent:
    """Return the meaning of ``P_CRASH2``; all unknown for codes that do not concern two vehicles.

    >>> critical_event(62).own, str(critical_event(62).relation)  # the other one came from the opposite direction
    (False, 'opposite_direction')
    """
    return _CRITICAL_EVENTS.get(code or 0, CriticalEvent())


def opposite_side(side: Side) -> Side:
    """Return the opposite side.

    >>> opposite_side(Side.LEFT).value
    'right'
    """
    return Side.RIGHT if side is Side.LEFT else Side.LEFT


# --- departures ------------------------------------------------------------------------------------------------------
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
        return DepartureSide(departure)
    if vehicle.crash_type_code in _FORWARD:
        return DepartureSide.AHEAD
    return _SIDE_OF_CRITICAL.get(vehicle.critical_event_code or 0)
