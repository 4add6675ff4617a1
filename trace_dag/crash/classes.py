"""Classes of crashes: the three coverage dimensions of the published table, and the kind that every crash has.

Source: FARS Analytical User's Manual (``MAN_COLL``, ``TYP_INT``, ``ACC_TYPE``) and the coverage table of the paper.
Classes are mapped by number, never by label: labels of ``ACC_TYPE`` 68-85 changed in 2023.

The kind comes from the first harmful event if that was with a person, a parked vehicle or an animal. Else it comes from
the number of vehicles, if several in transport may have touched. Else it comes from the first harmful event again.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from enum import StrEnum
from typing import Final

from trace_dag.crash.codes import elements as codes


class CollisionType(StrEnum):
    """From ``MAN_COLL``."""

    FRONT_TO_REAR = "front_to_rear"
    FRONT_TO_FRONT = "front_to_front"
    ANGLE = "angle"
    SIDESWIPE_SAME_DIRECTION = "sideswipe_same_direction"
    SIDESWIPE_OPPOSITE_DIRECTION = "sideswipe_opposite_direction"
    REAR_TO_SIDE = "rear_to_side"
    REAR_TO_REAR = "rear_to_rear"
    OTHERS = "others"


class RoadTopology(StrEnum):
    """From ``TYP_INT``."""

    NOT_AN_INTERSECTION = "not_an_intersection"
    FOUR_WAY = "four_way"
    T = "t"
    Y = "y"
    ROUNDABOUT = "roundabout"
    FIVE_POINT_OR_MORE = "five_point_or_more"
    L = "l"
    OTHERS = "others"


class VehicleTrajectory(StrEnum):
    """From the ``ACC_TYPE`` of the vehicle pair, by :mod:`trace_dag.crash.crash_types`."""

    SAME_DIRECTION = "same_direction"
    OPPOSITE_DIRECTION = "opposite_direction"
    TURNING = "turning"
    INTERSECTING = "intersecting"
    OTHERS = "others"


_COLLISION_TYPES: Final = {
    1: CollisionType.FRONT_TO_REAR,
    2: CollisionType.FRONT_TO_FRONT,
    6: CollisionType.ANGLE,
    7: CollisionType.SIDESWIPE_SAME_DIRECTION,
    8: CollisionType.SIDESWIPE_OPPOSITE_DIRECTION,
    9: CollisionType.REAR_TO_SIDE,
    10: CollisionType.REAR_TO_REAR,
}
_ROAD_TOPOLOGIES: Final = {
    1: RoadTopology.NOT_AN_INTERSECTION,
    2: RoadTopology.FOUR_WAY,
    3: RoadTopology.T,
    4: RoadTopology.Y,
    5: RoadTopology.ROUNDABOUT,
    6: RoadTopology.ROUNDABOUT,
    7: RoadTopology.FIVE_POINT_OR_MORE,
    10: RoadTopology.L,
}


def collision_type(man_coll: int | None) -> CollisionType:
    """Return the class of ``MAN_COLL``; unlisted codes and None are others.

    >>> str(collision_type(6))
    'angle'
    """
    return _COLLISION_TYPES.get(man_coll or 0, CollisionType.OTHERS)


def road_topology(typ_int: int | None, reljct2: int | None = None) -> RoadTopology:
    """Return the class of ``TYP_INT``; unlisted codes and None are others.

    If ``TYP_INT`` is unknown, a ``RELJCT2`` away from intersections means that the crash was at none.

    >>> str(road_topology(2)), str(road_topology(None, reljct2=1))
    ('four_way', 'not_an_intersection')
    """
    if codes.TYP_INT.known(typ_int) is None and reljct2 in codes.NON_JUNCTION:
        return RoadTopology.NOT_AN_INTERSECTION
    return _ROAD_TOPOLOGIES.get(typ_int or 0, RoadTopology.OTHERS)


# --- kinds -----------------------------------------------------------------------------------------------------------
class CrashKind(StrEnum):
    """Kinds of crashes.

    Codes are those of the first harmful event (``HARM_EV``).
    """

    TWO_VEHICLES = "two_vehicles"
    MULTI_VEHICLE = "multi_vehicle"
    PEDESTRIAN = "pedestrian"  # 8, and 15 on a personal conveyance
    CYCLIST = "cyclist"  # 9
    PARKED = "parked"  # 14, 45
    FIXED_OBJECT = "fixed_object"  # 17-59 but those named here, 93
    LYING_OBJECT = "lying_object"  # 18, 91: on the road or beside it, and not fixed
    OVERTURN = "overturn"  # 1
    ANIMAL = "animal"  # 11, 49
    OTHER = "other"


JUDGED_KINDS: Final = frozenset(set(CrashKind) - {CrashKind.OTHER})
"""Kinds that can be judged."""

_BEFORE_ALL: Final[Mapping[int, CrashKind]] = {
    **dict.fromkeys((codes.PEDESTRIAN, codes.PERSON_ON_CONVEYANCE), CrashKind.PEDESTRIAN),
    codes.CYCLIST: CrashKind.CYCLIST,
    **dict.fromkeys(codes.STRUCK_STANDING, CrashKind.PARKED),
    **dict.fromkeys(codes.ANIMALS, CrashKind.ANIMAL),
    **dict.fromkeys(codes.TRAINS, CrashKind.OTHER),
}
_OF_ONE_VEHICLE: Final[Mapping[int, CrashKind]] = {
    codes.OVERTURN: CrashKind.OVERTURN,
    **dict.fromkeys(codes.FIXED_OBJECTS, CrashKind.FIXED_OBJECT),
    **dict.fromkeys(codes.LYING_OBJECTS, CrashKind.LYING_OBJECT),
}
_OF_VEHICLES: Final = frozenset({codes.MOTOR_VEHICLE_IN_TRANSPORT, codes.VEHICLE_OUTSIDE_TRAFFICWAY})


def kind_of_codes(harm_ev: int | None, vehicles: int | None, events: Sequence[int]) -> CrashKind | None:
    """Return the kind of a crash from its codes: ``HARM_EV``, ``VE_FORMS``, and the ``SOE`` of its events in order.

    If ``HARM_EV`` is unknown, the first harmful one of the events is used. None if both the first harmful event and the
    number of vehicles are unknown.

    >>> str(kind_of_codes(8, 1, [])), str(kind_of_codes(12, 3, [12])), str(kind_of_codes(42, 1, []))  # 42: a tree
    ('pedestrian', 'multi_vehicle', 'fixed_object')
    """
    harmful = [code for code in events if codes.HARM_EV.meaning(code)]
    first = codes.HARM_EV.known(harm_ev)
    if first is None and harmful:
        first = harmful[0]
    if first is not None and first in _BEFORE_ALL:
        return _BEFORE_ALL[first]
    may_have_touched = not harmful or not codes.VEHICLE_CONTACTS.isdisjoint(harmful) or first in _OF_VEHICLES
    if vehicles is not None and vehicles > 1 and may_have_touched:
        return CrashKind.TWO_VEHICLES if vehicles == 2 else CrashKind.MULTI_VEHICLE
    if first is None:
        return None if vehicles is None else CrashKind.OTHER
    return _OF_ONE_VEHICLE.get(first, CrashKind.OTHER)
