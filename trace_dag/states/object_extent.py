"""How long a placed object is: kerbs, rails and walls end where a street opens."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import replace
from typing import TypeAlias

import numpy as np
import shapely

from trace_dag.geometry import FloatArray, Pose
from trace_dag.roads.map.network import RoadNetwork
from trace_dag.states.objects import KINDS, FixedObject, ObjectForm

_AT_THE_EDGE_M = 0.5  # a line this far into the roadway still counts as standing at its edge
_LEAST_M = 1.0
_FAR_M = 1000.0


Struck: TypeAlias = tuple[FixedObject, tuple[float, float]]
"""An object, and where it is struck (x, y; m)."""


def clear_of_others(
    item: FixedObject, struck_at_xy_m: tuple[float, float], network: RoadNetwork, others: Iterable[Struck] = ()
) -> FixedObject:
    """The part of a lengthwise object around the place where it is struck that lies not across a roadway, and nearer to
    that place than to where another lengthwise object is struck: of one rail that is struck twice each has its part.

    The object is left as it is if it is struck on a roadway itself (an island's kerb) or stands on none.
    """
    if KINDS[item.code].form is not ObjectForm.LINE:
        return item
    ends = item.pose.to_world(np.array([[-item.length_m / 2, 0.0], [item.length_m / 2, 0.0]]))
    axis = shapely.LineString(ends)
    area = network.carriageway_near(item.pose.x_m, item.pose.y_m, item.length_m, z_m=item.pose.z_m)
    clear = axis.difference(area.within(axis.bounds, 2 * _AT_THE_EDGE_M).buffer(-_AT_THE_EDGE_M))
    own = np.array(struck_at_xy_m)
    for other, at_xy_m in others:
        if other is not item and KINDS[other.code].form is ObjectForm.LINE and own.tolist() != list(at_xy_m):
            clear = clear.intersection(_nearer(own, np.array(at_xy_m)))
    struck = axis.interpolate(axis.project(shapely.Point(struck_at_xy_m)))
    parts = [part for part in shapely.get_parts(clear) if part.distance(struck) < _AT_THE_EDGE_M]
    if not parts or clear.length == axis.length:
        return item
    part = max(parts, key=lambda each: each.length)
    if part.length < _LEAST_M:
        return item
    middle = part.interpolate(0.5, normalized=True)
    pose = Pose(round(middle.x, 6), round(middle.y, 6), item.pose.heading_rad, item.pose.z_m)
    return replace(item, pose=pose, length_m=round(part.length, 6))


def _nearer(own: FloatArray, other: FloatArray) -> shapely.Polygon:
    """All that is nearer to one point than to another, as far as any object reaches."""
    towards = (own - other) / np.linalg.norm(own - other)
    across = np.array([-towards[1], towards[0]])
    middle = (own + other) / 2
    corners = [
        middle + _FAR_M * (along * towards + left * across) for along, left in ((0, 1), (1, 1), (1, -1), (0, -1))
    ]
    return shapely.Polygon(corners)
