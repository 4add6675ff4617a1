"""The three coverage dimensions of the published table and how FARS codes fall into them.

Source: FARS Analytical User's Manual (``MAN_COLL``, ``TYP_INT``, ``ACC_TYPE``) and the coverage table of the paper.
Classes are mapped by number, never by label: labels of ``ACC_TYPE`` 68-85 changed in 2023.
"""

from __future__ import annotations

from enum import StrEnum
from typing import Final

from trace_dag.crash.codes.crash import NON_JUNCTION, TYP_INT


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
    if TYP_INT.known(typ_int) is None and reljct2 in NON_JUNCTION:
        return RoadTopology.NOT_AN_INTERSECTION
    return _ROAD_TOPOLOGIES.get(typ_int or 0, RoadTopology.OTHERS)
