"""Fixed objects as OpenSCENARIO has them: a ``MiscObject`` each, that stands where it is.

ASAM OpenSCENARIO 1.2: its box is given from its reference point, the middle of its base; a ditch lies below that.
Whether the program placed it is said in a property.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, Final

from trace_dag.scenario.object_shapes import object_category
from trace_dag.scenario.openscenario_vehicles import rounded_m
from trace_dag.states.objects import FixedObject, base_m

if TYPE_CHECKING:
    from scenariogeneration import xosc

_MASS_KG: Final = 1e5  # the standard wants one; nothing moves it


def misc_object(item: FixedObject) -> xosc.MiscObject:
    """An object as an entity.

    >>> made = misc_object(tree)
    >>> made.name, made.category.get_name()
    ('tree_2', 'tree')
    """
    from scenariogeneration import xosc

    box = xosc.BoundingBox(
        rounded_m(item.width_m),
        rounded_m(item.length_m),
        rounded_m(item.height_m),
        0.0,
        0.0,
        rounded_m(base_m(item) + item.height_m / 2),
    )
    category = getattr(xosc.MiscObjectCategory, object_category(item))
    made = xosc.MiscObject(f"{item.name} {item.event_number}".replace(" ", "_"), _MASS_KG, category, box)
    made.add_property("fars_event_number", str(item.event_number))
    made.add_property("fars_soe", str(item.code))
    made.add_property("placed_by", str(item.placed_by))
    if item.osm_id:
        made.add_property("osm_id", item.osm_id)
    return made


def standing_at(item: FixedObject) -> xosc.TeleportAction:
    """Puts an object where it stands.

    >>> standing_at(tree).position.x == round(tree.pose.x_m, 6)
    True
    """
    from scenariogeneration import xosc

    pose = item.pose
    values = (pose.x_m, pose.y_m, pose.z_m, pose.heading_rad)
    return xosc.TeleportAction(xosc.WorldPosition(*(round(value, 6) + 0.0 for value in values)))
