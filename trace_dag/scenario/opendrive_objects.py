"""Fixed objects of a crash in its OpenDRIVE map: an ``<object>`` each, on the nearest road, saying who placed it.

ASAM OpenDRIVE 1.7, section 11: position and heading are relative to the road's reference line, the origin is the middle
of the object's base. That the program placed an object is said in its name and in ``userData``.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Final

from lxml import etree

from trace_dag.roads.map.network import RoadNetwork
from trace_dag.scenario.object_shapes import in_words, object_category
from trace_dag.states.objects import FixedObject

_LOOK_AROUND_M: Final = 100.0
_PARSER: Final = etree.XMLParser(resolve_entities=False, no_network=True, huge_tree=True)


def with_fixed_objects(xodr: bytes, network: RoadNetwork, items: Sequence[FixedObject]) -> bytes:
    """The map with the objects on it; the same bytes where there are none. ``network`` is the same map as read."""
    if not items:
        return xodr
    root = etree.fromstring(xodr, _PARSER)
    roads = {road.get("id"): road for road in root.iterfind("road")}
    for item in items:
        pose = item.pose
        near = network.nearest_lanes(pose.x_m, pose.y_m, _LOOK_AROUND_M, z_m=pose.z_m)
        if not near:
            continue
        road_id = near[0].lane.road_id
        s_m, t_m, _ = network.road_geometry(road_id).line.project(pose.x_m, pose.y_m)
        _, _, heading, _ = network.road_geometry(road_id).line.at(s_m)
        _objects_of(roads[road_id]).append(_object(item, s_m, t_m, pose.heading_rad - heading))
    return etree.tostring(root, xml_declaration=True, encoding="UTF-8") + b"\n"


def _objects_of(road: etree._Element) -> etree._Element:
    found = road.find("objects")
    if found is None:  # their place is behind the lanes
        found = etree.Element("objects")
        lanes = road.find("lanes")
        assert lanes is not None
        lanes.addnext(found)
    return found


def _object(item: FixedObject, s_m: float, t_m: float, turned_rad: float) -> etree._Element:
    made = etree.Element(
        "object",
        id=f"fixed_{item.event_number}",
        type=object_category(item),
        name=in_words(item),
        s=_number(max(s_m, 0.0)),
        t=_number(t_m),
        zOffset="0",
        orientation="none",
        hdg=_number(math.remainder(turned_rad, math.tau)),
        pitch="0",
        roll="0",
        height=_number(item.height_m),
        length=_number(item.length_m),
        width=_number(item.width_m),
    )
    said = {"placedBy": str(item.placed_by), "osmId": item.osm_id, "event": item.event_number, "soe": item.code}
    for code, value in said.items():
        if value == "":
            continue
        etree.SubElement(made, "userData", code=code, value=str(value))
    return made


def _number(value: float) -> str:
    return f"{round(value, 4) + 0.0:g}"
