"""Fixed objects for pictures and replays: their outlines, and the origin of their place."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import replace
from typing import Final

import numpy as np

from trace_dag.common.geometry import FloatArray, rectangle_corners
from trace_dag.simulation.objects import FixedObject, PlacedBy, Resistance, slope_profile_m

_LEAST_M: Final = 0.5  # nothing thinner is drawn
_ROUND_M: Final = 1.0  # compact objects smaller than this are drawn round
OBJECT_NOTE: Final = "placed by the program: the map has none of the kind there"


def outline(item: FixedObject) -> FloatArray:
    """Return corners of an object seen from above, shape (n, 2); for a ditch or embankment, of the whole slope.

    >>> from trace_dag.common.geometry import Pose
    >>> barrier = FixedObject(1001, 1, 25, "concrete barrier", Pose(0.0, 0.0, 0.0), 20.0, 2.0, 1.0, Resistance.RIGID)
    >>> float(np.ptp(outline(barrier)[:, 0]))
    20.0
    """
    if item.resistance is Resistance.SLOPE:
        (near_m, _), *_, (far_m, _) = slope_profile_m(item)
        middle = item.pose.to_world(np.array([0.0, (near_m + far_m) / 2]))
        pose = replace(item.pose, x_m=float(middle[0]), y_m=float(middle[1]))
        return rectangle_corners(pose, item.length_m, far_m - near_m)
    length_m, width_m = max(item.length_m, _LEAST_M), max(item.width_m, _LEAST_M)
    if max(item.length_m, item.width_m) < _ROUND_M:
        angles = np.linspace(0.0, 2 * np.pi, 13)[:-1]
        return item.pose.xy_m + np.column_stack([np.cos(angles), np.sin(angles)]) * max(length_m, width_m) / 2
    return rectangle_corners(item.pose, length_m, width_m)


def is_ours(item: FixedObject) -> bool:
    """Return whether the program placed the object."""
    return item.placed_by is PlacedBy.PROGRAM


def describe_object(item: FixedObject) -> str:
    """Return the object's kind and the origin of its place.

    >>> describe_object(tree)
    'tree (placed by the program: the map has none of the kind there)'
    """
    return f"{item.name} ({OBJECT_NOTE if is_ours(item) else 'OpenStreetMap ' + item.osm_id})"


def names(items: Iterable[FixedObject]) -> str:
    """Return the names of some objects, without repetitions, in their order.

    >>> names([tree, tree])
    'tree'
    """
    return ", ".join(dict.fromkeys(item.name for item in items))


_CATEGORIES: Final = {
    **dict.fromkeys((23, 24, 25, 26, 57), "barrier"),
    **dict.fromkeys((19, 21, 50), "building"),
    **dict.fromkeys((30, 31, 46, 59), "pole"),
    42: "tree",
    41: "vegetation",
}


def object_category(item: FixedObject) -> str:
    """Return the object's category, common to OpenDRIVE (``e_objectType``) and OpenSCENARIO (``MiscObjectCategory``).

    >>> object_category(tree)
    'tree'
    """
    return _CATEGORIES.get(item.code, "obstacle")
