"""Fixed objects in OpenSCENARIO, one ``MiscObject`` each.

ASAM OpenSCENARIO 1.2: its box is given from its reference point, the middle of its base; a ditch lies below that. A
property marks objects that the program placed.
"""

from __future__ import annotations

from typing import Final

from trace_dag.scenario.object_shapes import object_category
from trace_dag.scenario.openscenario_elements import Element, bounding_box, element, properties, teleport_action
from trace_dag.simulation.objects import FixedObject, base_m

_MASS_KG: Final = 1e5  # the standard wants one; nothing moves it


def misc_object(item: FixedObject) -> Element:
    """Return an object as an entity.

    >>> made = misc_object(tree)
    >>> made.get("name"), made.get("miscObjectCategory")
    ('tree_2', 'tree')
    """
    said = {
        "fars_event_number": str(item.event_number),
        "fars_soe": str(item.code),
        "placed_by": str(item.placed_by),
        **({"osm_id": item.osm_id} if item.osm_id else {}),
    }
    middle_m = base_m(item) + item.height_m / 2
    return element(
        "MiscObject",
        bounding_box(item.width_m, item.length_m, item.height_m, ahead_m=0.0, up_m=middle_m),
        properties(said),
        name=f"{item.name} {item.event_number}".replace(" ", "_"),
        miscObjectCategory=object_category(item),
        mass=_MASS_KG,
    )


def standing_at(item: FixedObject) -> Element:
    """Return the action that puts an object in its place."""
    pose = item.pose
    return teleport_action(*(round(value, 6) + 0.0 for value in (pose.x_m, pose.y_m, pose.z_m, pose.heading_rad)))
