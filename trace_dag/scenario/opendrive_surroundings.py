"""Objects of an OpenDRIVE map: OpenStreetMap features beside the roads, and the fixed objects of a crash.

ASAM OpenDRIVE 1.7, section 11: an object belongs to a road, here the nearest that is in no junction; corners of its
outline are relative to its origin. Water, railways and parking areas have no type there and are left out. So are
features on a carriageway or across a road: woods around a road, buildings above one. Heights are OpenStreetMap's if it
has them; a usual height is marked in ``userData``.

Position and heading are relative to the road's reference line, the origin is the middle
of the object's base. An object placed by the program is marked in its name and in ``userData``.
"""

from __future__ import annotations

import math
from collections.abc import Collection, Iterable, Iterator, Mapping, Sequence
from copy import deepcopy
from typing import TYPE_CHECKING, Final, NamedTuple

import numpy as np
import shapely
from lxml import etree

from trace_dag.roads.from_osm.tag_values import parse_length_m
from trace_dag.roads.map.network import RoadNetwork
from trace_dag.scenario.drawn_shapes import describe_object, object_category
from trace_dag.simulation.objects import FixedObject, base_m

if TYPE_CHECKING:
    from shapely.geometry.base import BaseGeometry

    from trace_dag.common.geometry import FloatArray, LocalFrame
    from trace_dag.osm.types import OsmFeature

_REACH_M: Final = 100.0
_BESIDE_LANES_M: Final = 40.0  # from a reference line; farther away there are no lanes
_STEP_M: Final = 5.0
_SIMPLIFIED_BY_M: Final = 0.3
_STOREY_M: Final = 3.0
_LOOK_AROUND_M: Final = 100.0
_PARSER: Final = etree.XMLParser(resolve_entities=False, no_network=True, huge_tree=True)


class _Kind(NamedTuple):
    """``type`` of OpenDRIVE; the usual height, and the radius of a point feature (m)."""

    category: str
    height_m: float
    radius_m: float = 0.0


_AREAS: Final = {
    ("building", ""): _Kind("building", 2 * _STOREY_M),
    ("natural", "wood"): _Kind("vegetation", 10.0),
    ("landuse", "forest"): _Kind("vegetation", 10.0),
    ("landuse", "orchard"): _Kind("vegetation", 4.0),
    ("natural", "scrub"): _Kind("vegetation", 2.0),
}
_LINES: Final = {
    ("natural", "tree_row"): _Kind("vegetation", 8.0),
    ("barrier", "guard_rail"): _Kind("barrier", 0.8),
    ("barrier", "cable_barrier"): _Kind("barrier", 0.8),
    ("barrier", "jersey_barrier"): _Kind("barrier", 0.8),
    ("barrier", "fence"): _Kind("barrier", 1.5),
    ("barrier", "hedge"): _Kind("vegetation", 1.5),
    ("barrier", "wall"): _Kind("barrier", 1.5),
    ("barrier", "retaining_wall"): _Kind("barrier", 1.5),
    ("barrier", "city_wall"): _Kind("barrier", 5.0),
}
_POINTS: Final = {
    ("natural", "tree"): _Kind("tree", 8.0, 2.0),
    ("highway", "street_lamp"): _Kind("streetLamp", 8.0, 0.1),
    ("power", "pole"): _Kind("pole", 10.0, 0.15),
    ("power", "tower"): _Kind("pole", 30.0, 1.0),
    ("man_made", "utility_pole"): _Kind("pole", 10.0, 0.15),
    ("man_made", "flagpole"): _Kind("pole", 8.0, 0.1),
    ("man_made", "mast"): _Kind("pole", 20.0, 0.3),
}
"""By key and value of a tag; a value of "" is any."""


def surrounding_objects(
    network: RoadNetwork, features: Sequence[OsmFeature], *, without: Collection[str] = ()
) -> list[PlacedObject]:
    """Return the objects of a map for ``features``, in order, without the ids in ``without``.

    >>> surrounding_objects(network, [])
    []
    """
    wanted = [
        (feature, shape, kind)
        for feature in features
        if feature.id not in without
        for shape in local_shapes(feature, network.frame)
        if (kind := usual_kind(feature, shape))
    ]
    if not wanted:
        return []
    roads = _Roads(network, [shape for _, shape, _ in wanted])
    placed = []
    for feature, shape, kind in wanted:
        place = roads.place(shape)
        if place is not None:
            placed.append(PlacedObject(place.road_id, _object(feature, shape, kind, place)))
    return placed


class _Place(NamedTuple):
    """The place of an object: its road with s and t (m), the point (m), and the road's heading (rad)."""

    road_id: str
    s_m: float
    t_m: float
    xy_m: FloatArray
    heading_rad: float


class _Roads:
    """The reference lines of roads near some shapes: of roads outside junctions, by place, and of all."""

    def __init__(self, network: RoadNetwork, shapes: Sequence[BaseGeometry]) -> None:
        self._network = network
        west, south, east, north = shapely.total_bounds(shapes).tolist()
        roads = network.roads_within((west - _REACH_M, south - _REACH_M, east + _REACH_M, north + _REACH_M))
        self._ids = [road.id for road in roads if road.junction_id is None]
        lines = {road.id: _line(network, road.id, road.length_m) for road in roads}
        self._streets = shapely.STRtree([lines[road_id] for road_id in self._ids])
        self._all = shapely.STRtree(list(lines.values()))

    def place(self, shape: BaseGeometry) -> _Place | None:
        """Return the place of a shape; None if it is far from all roads or would stand on one."""
        if len(self._all.query(shape, predicate="intersects")):
            return None
        if len(self._all.query(shape, predicate="dwithin", distance=_BESIDE_LANES_M)) and any(
            self._network.nearest_lanes(x, y, 0.0) for x, y in shapely.get_coordinates(shape).tolist()
        ):
            return None
        x, y = shapely.get_coordinates(shape.centroid)[0].tolist()
        near = self._streets.query(shape, predicate="dwithin", distance=_REACH_M)
        for number in sorted(near.tolist(), key=lambda each: shape.distance(self._streets.geometries[each])):
            line = self._network.road_geometry(self._ids[number]).line
            s_m, t_m, _ = line.project(x, y)
            if 0.0 <= s_m <= line.length_m:  # a shape beyond a road's end has no s on it
                _, _, heading_rad, _ = line.at(s_m)
                return _Place(self._ids[number], s_m, t_m, np.array([x, y]), heading_rad)
        return None


def _line(network: RoadNetwork, road_id: str, length_m: float) -> shapely.LineString:
    along = np.linspace(0.0, length_m, max(2, int(length_m / _STEP_M) + 1))
    return shapely.LineString(network.road_geometry(road_id).line.sample(along)[:, :2])


def local_shapes(feature: OsmFeature, frame: LocalFrame) -> Iterator[BaseGeometry]:
    """Yield the shapes of a feature in the local frame (m)."""

    def to_local(places: FloatArray) -> FloatArray:
        return frame.to_local(places[:, 1], places[:, 0])

    yield from shapely.get_parts(shapely.transform(feature.geometry, to_local))


def usual_kind(feature: OsmFeature, shape: BaseGeometry) -> _Kind | None:
    table = {"Polygon": _AREAS, "LineString": _LINES, "Point": _POINTS}.get(shape.geom_type, {})
    for (key, value), kind in table.items():
        if key in feature.tags and value in ("", feature.tags[key]):
            return kind
    return None


def _object(feature: OsmFeature, shape: BaseGeometry, kind: _Kind, place: _Place) -> etree._Element:
    told_m = told_height_m(feature)
    size_m = {"height": kind.height_m if told_m is None else told_m}
    name = feature.tags.get("name") or kind.category
    if kind.radius_m:
        size_m["radius"] = kind.radius_m
        made = new_object(kind.category, name, (place.s_m, place.t_m, 0.0), size_m)
    else:
        cos, sin = np.cos(place.heading_rad), np.sin(place.heading_rad)
        corners_m = (_corners(shape) - place.xy_m) @ np.array([[cos, -sin], [sin, cos]])
        size_m["length"], size_m["width"] = np.ptp(corners_m, axis=0).tolist()
        made = new_object(kind.category, name, (place.s_m, place.t_m, 0.0), size_m)
        _add_outline(made, corners_m, size_m["height"], closed=isinstance(shape, shapely.Polygon))
    add_notes(made, {"osmId": feature.id, "height": "usual" if told_m is None else ""})
    return made


def _corners(shape: BaseGeometry) -> FloatArray:
    """Return the corners of a shape (m); those of an area counter-clockwise and without repetition."""
    if isinstance(shape, shapely.Polygon):
        ring = shapely.geometry.polygon.orient(shape).exterior.simplify(_SIMPLIFIED_BY_M)
        return shapely.get_coordinates(ring)[:-1]
    return shapely.get_coordinates(shape.simplify(_SIMPLIFIED_BY_M))


def told_height_m(feature: OsmFeature) -> float | None:
    """Return the height by OpenStreetMap, tagged or from the number of storeys."""
    height_m = parse_length_m(feature.tags.get("height"))
    if height_m is None and (storeys := parse_length_m(feature.tags.get("building:levels"))):
        height_m = storeys * _STOREY_M
    return height_m if height_m is not None and 0.0 < height_m < 1000.0 else None


def _add_outline(made: etree._Element, local_m: FloatArray, height_m: float, *, closed: bool) -> None:
    outline = etree.SubElement(etree.SubElement(made, "outlines"), "outline", id="0", closed=str(closed).lower())
    for u, v in local_m.tolist():
        etree.SubElement(
            outline, "cornerLocal", u=round_value(u), v=round_value(v), z="0", height=round_value(height_m)
        )


# --- objects ---------------------------------------------------------------------------------------------------------
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
