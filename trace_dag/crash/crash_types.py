"""FARS crash types read for one vehicle: encounter, manoeuvre and side struck.

``ACC_TYPE`` (1-99) is coded per vehicle from the crash type diagrams of the FARS/CRSS Coding and Validation Manual.
Read by number, never by label (the labels of 68-85 changed in 2023). If ``ACC_TYPE`` is no help (98, 99, single driver
types), the critical event ``P_CRASH2`` often does: where the other vehicle came from and which of the two left its lane
(:func:`critical_event`)."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from enum import StrEnum
from functools import partial
from typing import Final

from trace_dag.crash.classes import VehicleTrajectory
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
    """One row of the table. ``None`` where the diagram does not say.

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


_FRONT, _RIGHT_SIDE, _REAR, _LEFT_SIDE = 12, 3, 6, 9
_STRAIGHT: Final = PreCrashMovement.GOING_STRAIGHT
_MOVEMENT_OF_TURN: Final = {
    Turn.LEFT: PreCrashMovement.TURNING_LEFT,
    Turn.RIGHT: PreCrashMovement.TURNING_RIGHT,
    Turn.U_TURN: PreCrashMovement.U_TURN,
}
_TURN_OF_MOVEMENT: Final = {movement: turn for turn, movement in _MOVEMENT_OF_TURN.items()}


def _table() -> dict[int, CrashType]:
    """Return the table by ``ACC_TYPE``; letters in comments are the manual's configurations."""
    table = {code: CrashType() for code in (0, 98, 99)}
    for code in range(1, 17):  # A to C, single driver
        departure = Side.RIGHT if code <= 5 else Side.LEFT if code <= 10 else None
        table[code] = CrashType(single_driver=True, departure=departure, movement=_STRAIGHT)
    table |= {**_same_direction(), **_opposite_direction(), **_turning(), **_intersecting()}
    table[92] = CrashType(  # M
        role=EncounterRole.ENCROACHING,
        backing=True,
        movement=PreCrashMovement.BACKING,
        impact_code=_REAR,
        counterpart=93,
    )
    table[93] = CrashType(role=EncounterRole.STEADY, counterpart=92)
    return table


def _same_direction() -> dict[int, CrashType]:
    row = partial(CrashType, trajectory=VehicleTrajectory.SAME_DIRECTION)
    table: dict[int, CrashType] = {}
    for code, struck_while in (  # D, rear end
        (20, PreCrashMovement.STOPPED),
        (24, _STRAIGHT),
        (28, PreCrashMovement.DECELERATING),
    ):
        lane, striking, struck = Relation.SAME_LANE, EncounterRole.STRIKING, EncounterRole.STRUCK
        table[code] = row(lane, striking, movement=_STRAIGHT, impact_code=_FRONT, counterpart=code + 1)
        for step, turn in ((1, None), (2, Turn.LEFT), (3, Turn.RIGHT)):
            stopped = struck_while is PreCrashMovement.STOPPED
            movement = struck_while if turn is None or stopped else _MOVEMENT_OF_TURN[turn]
            table[code + step] = row(
                lane, struck, turn, stopped=stopped, movement=movement, impact_code=_REAR, counterpart=code
            )
    table |= {code: row(Relation.SAME_LANE, counterpart=code) for code in (32, 33)}
    table |= _forward_impacts(34, partial(row, Relation.SAME_DIRECTION))  # E
    same, steady, encroaching = Relation.SAME_DIRECTION, EncounterRole.STEADY, EncounterRole.ENCROACHING
    table[44] = row(same, steady, other_from=Side.RIGHT, movement=_STRAIGHT)  # F, angle and sideswipe
    table[45] = row(same, steady, movement=_STRAIGHT)
    for code, side in ((46, Side.RIGHT), (47, Side.LEFT)):
        table[code] = row(same, encroaching, other_from=side, movement=PreCrashMovement.CHANGING_LANES)
    table |= {code: row(same, counterpart=code) for code in (48, 49)}
    return table


def _opposite_direction() -> dict[int, CrashType]:
    row = partial(
        CrashType, Relation.OPPOSITE_DIRECTION, trajectory=VehicleTrajectory.OPPOSITE_DIRECTION, movement=_STRAIGHT
    )
    table = _forward_impacts(54, row)  # H
    for first, impact in ((50, _FRONT), (64, None)):  # G, head-on; I, angle and sideswipe
        table[first] = row(EncounterRole.ENCROACHING, impact_code=impact, counterpart=first + 1)
        table[first + 1] = row(EncounterRole.STEADY, impact_code=impact, counterpart=first)
        table |= {code: row(impact_code=impact, counterpart=code) for code in (first + 2, first + 3)}
    return table


def _forward_impacts(first: int, row: Callable[..., CrashType]) -> dict[int, CrashType]:
    """Return configurations E and H: out of control or avoiding something, into the other's path.

    The other vehicle's type is not coded.
    """
    table: dict[int, CrashType] = {}
    for code in range(first, first + 8, 2):
        table[code] = row(role=EncounterRole.ENCROACHING, movement=_STRAIGHT)
        table[code + 1] = row(role=EncounterRole.STEADY, movement=_STRAIGHT)
    return table | {code: row(movement=_STRAIGHT, counterpart=code) for code in (first + 8, first + 9)}


def _turning() -> dict[int, CrashType]:
    opposite, same, crossing = Relation.OPPOSITE_DIRECTION, Relation.SAME_DIRECTION, Relation.CROSSING
    left, right = Side.LEFT, Side.RIGHT
    row = partial(CrashType, trajectory=VehicleTrajectory.TURNING)
    table: dict[int, CrashType] = {}
    # The code of who turns; the turn; where each of the two sees the other; the side each shows the other. Who turns
    # left across the path of oncoming traffic (68) shows it its right side and comes from its left (69); who turns left
    # into the path of traffic from its right (76) comes from that one's left (77), who turns right (78) from its right
    # (79), left into the opposite direction (82) too (83), being met from the left.
    for code, relation, turn, turner_sees, other_sees, turner_shows, other_shows in (
        (68, opposite, Turn.LEFT, None, None, right, left),  # J, turn across path
        (70, same, Turn.RIGHT, right, left, None, None),
        (72, same, Turn.LEFT, left, right, None, None),
        (76, crossing, Turn.LEFT, right, left, right, left),  # K, turn into path
        (78, crossing, Turn.RIGHT, left, right, left, right),
        (80, crossing, Turn.RIGHT, right, left, None, None),
        (82, crossing, Turn.LEFT, left, right, left, right),
    ):
        table[code] = row(
            relation,
            EncounterRole.ENCROACHING,
            turn,
            turner_sees,
            movement=_MOVEMENT_OF_TURN[turn],
            shows=turner_shows,
            counterpart=code + 1,
        )
        table[code + 1] = row(
            relation,
            EncounterRole.STEADY,
            other_from=other_sees,
            movement=_STRAIGHT,
            shows=other_shows,
            counterpart=code,
        )
    table |= {code: row(counterpart=code) for code in (74, 75)}
    return table | {code: row(crossing, counterpart=code) for code in (84, 85)}


def _intersecting() -> dict[int, CrashType]:
    row = partial(CrashType, Relation.CROSSING, trajectory=VehicleTrajectory.INTERSECTING, movement=_STRAIGHT)
    striking, struck = EncounterRole.STRIKING, EncounterRole.STRUCK
    return {  # L, straight paths; 86 strikes from the right of 87
        86: row(striking, other_from=Side.LEFT, impact_code=_FRONT, counterpart=87),
        87: row(struck, other_from=Side.RIGHT, impact_code=_RIGHT_SIDE, counterpart=86),
        88: row(striking, other_from=Side.RIGHT, impact_code=_FRONT, counterpart=89),
        89: row(struck, other_from=Side.LEFT, impact_code=_LEFT_SIDE, counterpart=88),
        90: row(counterpart=90),
        91: row(counterpart=91),
    }


_ACROSS: Final = frozenset({68, 69})  # the two types of which the side that traffic keeps tells the turn


def _across_from_the_left(kind: CrashType) -> CrashType:
    """Return a type of a turn across oncoming traffic for left-hand traffic: a turn to the right."""
    turn = None if kind.turn is None else Turn.RIGHT
    shows = None if kind.shows is None else opposite_side(kind.shows)
    return replace(kind, turn=turn, shows=shows, movement=kind.movement if turn is None else _MOVEMENT_OF_TURN[turn])


CRASH_TYPES: dict[int, CrashType] = _table()
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


def critical_event(code: int | None) -> CriticalEvent:
    """Return the meaning of ``P_CRASH2``; all unknown for codes that do not concern two vehicles.

    >>> critical_event(62).own, str(critical_event(62).relation)  # the other one came from the opposite direction
    (False, 'opposite_direction')
    """
    if code is None:
        return CriticalEvent()
    if code in (1, 2, 3, 4, 5, 6, 8, 9, 10, 11, 12, 13, 14, 15, 16, 18, 20, 21):
        return CriticalEvent(own=True)
    if code == 17:
        return CriticalEvent(own=True, relation=Relation.CROSSING)
    if code in (50, 51, 52, 53):  # another vehicle in this vehicle's lane, same direction
        return CriticalEvent(relation=Relation.SAME_LANE)
    if code == 54:  # the oncoming vehicle was in "this vehicle's lane": as a rule, because this one was in its lane
        return CriticalEvent(own=True, relation=Relation.OPPOSITE_DIRECTION)
    if code in (60, 61):
        return CriticalEvent(own=False, relation=Relation.SAME_DIRECTION)
    if code in (62, 63):
        return CriticalEvent(own=False, relation=Relation.OPPOSITE_DIRECTION)
    if code in (65, 66, 67, 68):
        return CriticalEvent(own=False, relation=Relation.CROSSING, crossing_is_other=True)
    if code in (64, 70, 71, 72, 73):
        return CriticalEvent(own=False, relation=Relation.CROSSING, crossing_is_other=True, driveway=True)
    if code in (55, 74, 78):
        return CriticalEvent(own=False)
    return CriticalEvent()


def opposite_side(side: Side) -> Side:
    """Return the opposite side.

    >>> opposite_side(Side.LEFT).value
    'right'
    """
    return Side.RIGHT if side is Side.LEFT else Side.LEFT
