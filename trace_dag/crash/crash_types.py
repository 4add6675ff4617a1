"""What a FARS crash type says about one vehicle: how it met the other, and what it did.

``ACC_TYPE`` (1-99) is coded per vehicle from the crash type diagrams of the FARS/CRSS Coding and Validation Manual.
Read by number, never by label (the labels of 68-85 changed in 2023). Where ``ACC_TYPE`` is silent (98, 99, single
driver types), ``P_CRASH2``, the critical event, often says the same: from where the other vehicle came and which of
the two left its lane; :func:`critical_event` holds that.
"""

from __future__ import annotations

from dataclasses import dataclass
from enum import StrEnum
from typing import Final

from trace_dag.crash.record import PreCrashMovement, VehicleRecord


class Relation(StrEnum):
    """How the two vehicles approached each other before either began its manoeuvre."""

    SAME_LANE = "same_lane"  # rear-end
    SAME_DIRECTION = "same_direction"  # adjacent paths: sideswipe, lane change, passing
    OPPOSITE_DIRECTION = "opposite_direction"
    CROSSING = "crossing"  # from the left or the right


class EncounterRole(StrEnum):
    """Which part of the encounter the vehicle played."""

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

    ``turn``: what this vehicle does; ``other_from``: the side the other vehicle comes from (crossing) or travels on
    (same direction); ``stopped``, ``backing``: this vehicle's motion.
    """

    relation: Relation | None = None
    role: EncounterRole = EncounterRole.UNDETERMINED
    turn: Turn | None = None
    other_from: Side | None = None
    stopped: bool = False
    backing: bool = False


def _table() -> dict[int, CrashType]:
    same_lane, same, opposite, crossing = Relation
    striking, struck, encroaching, steady, _ = EncounterRole
    left, right = Side.LEFT, Side.RIGHT
    table = {code: CrashType() for code in (0, *range(1, 17), 98, 99)}
    for code in (20, 24, 28):  # configuration D, rear end
        table[code] = CrashType(same_lane, striking)
        for step, turn in ((1, None), (2, Turn.LEFT), (3, Turn.RIGHT)):
            table[code + step] = CrashType(same_lane, struck, turn, stopped=code == 20)
    table[32] = table[33] = CrashType(same_lane)
    for first, relation in ((34, same), (54, opposite)):  # E and H, forward impact
        for code in range(first, first + 8, 2):
            table[code] = CrashType(relation, encroaching)
            table[code + 1] = CrashType(relation, steady)
        table[first + 8] = table[first + 9] = CrashType(relation)
    table[44] = CrashType(same, steady, other_from=right)  # F, angle and sideswipe
    table[45] = CrashType(same, steady)
    table[46] = CrashType(same, encroaching, other_from=right)
    table[47] = CrashType(same, encroaching, other_from=left)
    table[48] = table[49] = CrashType(same)
    for first in (50, 64):  # G head-on, I angle and sideswipe
        table[first] = CrashType(opposite, encroaching)
        table[first + 1] = CrashType(opposite, steady)
        table[first + 2] = table[first + 3] = CrashType(opposite)
    table[68] = CrashType(opposite, encroaching, Turn.LEFT)  # J, turn across path
    table[69] = CrashType(opposite, steady)
    table[70] = CrashType(same, encroaching, Turn.RIGHT, right)
    table[71] = CrashType(same, steady, other_from=left)
    table[72] = CrashType(same, encroaching, Turn.LEFT, left)
    table[73] = CrashType(same, steady, other_from=right)
    table[74] = table[75] = CrashType()
    table[76] = CrashType(crossing, encroaching, Turn.LEFT, right)  # K, turn into path
    table[77] = CrashType(crossing, steady, other_from=left)
    table[78] = CrashType(crossing, encroaching, Turn.RIGHT, left)
    table[79] = CrashType(crossing, steady, other_from=right)
    table[80] = CrashType(crossing, encroaching, Turn.RIGHT, right)
    table[81] = CrashType(crossing, steady, other_from=left)
    table[82] = CrashType(crossing, encroaching, Turn.LEFT, left)
    table[83] = CrashType(crossing, steady, other_from=right)
    table[84] = table[85] = CrashType(crossing)
    table[86] = CrashType(crossing, striking, other_from=left)  # L, straight paths; 86 strikes from the right of 87
    table[87] = CrashType(crossing, struck, other_from=right)
    table[88] = CrashType(crossing, striking, other_from=right)
    table[89] = CrashType(crossing, struck, other_from=left)
    table[90] = table[91] = CrashType(crossing)
    table[92] = CrashType(role=encroaching, backing=True)  # M
    table[93] = CrashType(role=steady)
    return table


CRASH_TYPES: dict[int, CrashType] = _table()


_MOVEMENT_TURN: Final = {
    PreCrashMovement.TURNING_LEFT: Turn.LEFT,
    PreCrashMovement.TURNING_RIGHT: Turn.RIGHT,
    PreCrashMovement.U_TURN: Turn.U_TURN,
}


def crash_type_of(vehicle: VehicleRecord) -> CrashType:
    """The row of the table for a vehicle; one that says nothing where its type is unknown."""
    return CRASH_TYPES.get(vehicle.crash_type_code or 99, CrashType())


def turn_of(vehicle: VehicleRecord) -> Turn | None:
    """The turn a vehicle made: by its movement, else by its crash type."""
    return _MOVEMENT_TURN.get(vehicle.movement, crash_type_of(vehicle).turn)


@dataclass(frozen=True)
class CriticalEvent:
    """What ``P_CRASH2`` says. ``own``: this vehicle's action made the crash; None: the code does not say.

    ``driveway``: the vehicle that came from the crossing path (``crossing_is_other``: the other one) came from a
    driveway or roadside, where the map need not have a road.
    """

    own: bool | None = None
    relation: Relation | None = None
    crossing_is_other: bool = False
    driveway: bool = False


def critical_event(code: int | None) -> CriticalEvent:
    """The meaning of ``P_CRASH2``; everything unknown for codes that do not concern two vehicles' approach."""
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
    """The other side."""
    return Side.RIGHT if side is Side.LEFT else Side.LEFT
