"""Objects on an OpenDRIVE map: the writing of one, and the fixed objects of a crash with the origin of each.

ASAM OpenDRIVE 1.7, section 11: position and heading are relative to the road's reference line, the origin is the middle
of the object's base. An object placed by the program is marked in its name and in ``userData``.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping, Sequence
from copy import deepcopy
from typing import Final, NamedTuple

from lxml import etree

from trace_dag.roads.map.network import RoadNetwork
from trace_dag.scenario.object_shapes import describe_object, object_category
from trace_dag.simulation.objects import FixedObject, base_m

_LOOK_AROUND_M: Final = 100.0
_PARSER: Final = etree.XMLParser(resolve_entities=False, no_network=True, huge_tree=True)


class PlacedObject(NamedTuple):
    """An ``<object>`` and its road."""

    road_id: str
    element: etree._Element


def add_objects(xodr: bytes, objects: Sequence[PlacedObject]) -> bytes:
    """Return the map with the objects on it, numbered after its own; unchanged if there are none."""
    if not objects:
        return xodr
    root = etree.fromstring(xodr, _PARSER)
    roads = {road.get("id"): road for road in root.iterfind("road")}
    first = 1 + max((int(own.get("id", "")) for own in root.iterfind("road/objects/object")), default=-1)
    for number, placed in enumerate(objects, first):
        element = deepcopy(placed.element)
        element.set("id", str(number))  # readers such as CommonRoad's take whole numbers only
        beside = _objects_of(roads[placed.road_id])
        beside.insert(len(beside.findall("object")), element)  # bridges and tunnels come after all objects
    return etree.tostring(root, xml_declaration=True, encoding="UTF-8") + b"\n"


def fixed_objects(network: RoadNetwork, items: Iterable[FixedObject]) -> list[PlacedObject]:
    """Return the fixed objects of a crash, on the roads nearest to them.

    >>> fixed_objects(network, log.objects)  # nothing was struck beside the road
    []
    """
    placed = []
    for item in items:
        pose = item.pose
        near = network.nearest_lanes(pose.x_m, pose.y_m, _LOOK_AROUND_M, z_m=pose.z_m)
        if not near:
            continue
        road_id = near[0].lane.road_id
        s_m, t_m, _ = network.road_geometry(road_id).line.project(pose.x_m, pose.y_m)
        _, _, heading, _ = network.road_geometry(road_id).line.at(s_m)
        placed.append(PlacedObject(road_id, _fixed_object(item, s_m, t_m, pose.heading_rad - heading)))
    return placed


def new_object(
    category: str, name: str, place: tuple[float, float, float], size_m: Mapping[str, float]
) -> etree._Element:
    """Return an ``<object>``, whose id is set when it is added to the map.

    ``place`` is s and t (m) and the heading (rad) relative to the road, ``size_m`` its ``height`` and its ``radius`` or
    ``length`` and ``width``.

    >>> new_object("pole", "mast", (12.0, -4.5, 0.0), {"height": 8.0, "radius": 0.1}).get("t")  # right of the road
    '-4.5'
    """
    s_m, t_m, turned_rad = place
    attributes = {"id": "", "type": category, "name": name, "s": round_value(max(s_m, 0.0)), "t": round_value(t_m)}
    turned = round_value(math.remainder(turned_rad, math.tau))
    attributes |= {"zOffset": "0", "orientation": "none", "hdg": turned, "pitch": "0", "roll": "0"}
    return etree.Element("object", attributes | {key: round_value(value) for key, value in size_m.items()})


def add_notes(made: etree._Element, notes: Mapping[str, object]) -> None:
    """Add ``userData`` at the end of an object, without empty notes.

    >>> from lxml import etree
    >>> made = etree.Element("object")
    >>> add_notes(made, {"osm_id": "n1"})
    >>> made[0].get("code"), made[0].get("value")
    ('osm_id', 'n1')
    """
    for code, value in notes.items():
        if value != "":
            etree.SubElement(made, "userData", code=code, value=str(value))


def round_value(value: float) -> str:
    """Return a number as text, to four decimals.

    >>> round_value(-0.00001), round_value(1.25)
    ('0', '1.25')
    """
    return f"{round(value, 4) + 0.0:g}"


def _objects_of(road: etree._Element) -> etree._Element:
    found = road.find("objects")
    if found is None:  # their place is behind the lanes
        found = etree.Element("objects")
        lanes = road.find("lanes")
        assert lanes is not None
        lanes.addnext(found)
    return found


def _fixed_object(item: FixedObject, s_m: float, t_m: float, turned_rad: float) -> etree._Element:
    size_m = {"height": item.height_m, "length": item.length_m, "width": item.width_m}
    made = new_object(object_category(item), describe_object(item), (s_m, t_m, turned_rad), size_m)
    made.set("zOffset", round_value(base_m(item)))
    add_notes(made, {"placedBy": item.placed_by, "osmId": item.osm_id, "event": item.event_number, "soe": item.code})
    return made
