"""Fixed objects beside the road: those in OpenStreetMap, and the ground for those placed by the program.

A mapped object of the reported kind where the vehicle left the road is used instead of an object placed by the program,
since a mapped place is more accurate than a rule. It must be within the distance along the road that a verdict allows,
on the reported side, beyond the edge and in the reported zone.

Placed objects stand beside lanes and shoulders, a bridge rail on its bridge, and none inside another one; kerbs, rails
and walls end where a street opens.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Final, TypeAlias

import numpy as np
import shapely
from shapely.geometry.base import BaseGeometry

from trace_dag.common.geometry import FloatArray, Pose, rectangle_corners
from trace_dag.common.paths import Path
from trace_dag.common.settings import VerdictSettings
from trace_dag.crash.codes.elements import LYING_OBJECTS
from trace_dag.crash.road_departure import ON_ROADWAY, ON_SHOULDER
from trace_dag.reconstruction.scene.scene import Scene
from trace_dag.roads.map.network import RoadNetwork
from trace_dag.roads.map.roadside import roadside_at
from trace_dag.roads.report import MappedThing
from trace_dag.simulation.objects import KINDS, FixedObject, ObjectForm

_KINDS_OF: Final[Mapping[str, tuple[int, ...]]] = {
    "natural=tree": (42,),
    "natural=shrub": (41,),
    "natural=rock": (17,),
    "natural=stone": (17,),
    "power=pole": (30, 31),
    "power=tower": (30, 31),
    "power=portal": (30, 31),
    "power=catenary_mast": (30, 31),
    "man_made=utility_pole": (30, 31),
    "man_made=mast": (30, 31),
    "man_made=flagpole": (31,),
    "man_made=embankment": (35,),
    "highway=street_lamp": (30, 31),
    "traffic_sign": (59,),
    "bridge:support": (21, 50),
    "emergency=fire_hydrant": (40,),
    "amenity=letter_box": (53,),
    "barrier=bollard": (31,),
    "barrier=block": (17,),
    "barrier=guard_rail": (24, 26),
    "barrier=jersey_barrier": (25, 26),
    "barrier=cable_barrier": (57,),
    "barrier=wall": (39,),
    "barrier=city_wall": (39,),
    "barrier=retaining_wall": (39,),
    "barrier=fence": (38,),
    "barrier=wire_fence": (38,),
    "barrier=kerb": (33,),
    "barrier=hedge": (41,),
    "waterway=ditch": (34,),
    "waterway=drain": (34,),
}
"""OpenStreetMap's tags, and the ``SOE`` that names such a thing."""

_ALONG_M: Final = VerdictSettings().max_contact_distance_m
_OFF_M: Final = 15.0  # beyond the edge: the trafficway of a freeway ends there
_OF_SHOULDER_M: Final = 3.6
_RUNS_ALONG_RAD: Final = math.radians(35)  # a line that turns farther from the road lies across the course
_AT_THE_EDGE_M: Final = 0.25  # a line this far into the roadway still counts as standing at its edge
_TOUCHING_M: Final = 0.05
_LEAST_M: Final = 1.0
_FAR_M: Final = 1000.0
_BEHIND_M: Final = 0.3  # a shoulder, objects begin
_WIDEST_M: Final = 8.0  # of shoulders, and lanes for parking and cycling, beside each other
_CURB, _BRIDGE_RAIL = 33, 23  # SOE
_OF_BRIDGE_M: Final = 2.5  # so far from a bridge's pavement its rail may stand
_BRIDGE_ENDS_M: Final = 0.9  # beyond what is paved: where the simulated vehicle is held, less than half of one

Struck: TypeAlias = tuple[FixedObject, tuple[float, float]]
"""An object, and where it is struck (x, y; m)."""


@dataclass(frozen=True)
class MappedObject:
    """A mapped object beside a path.

    It has the station, the distance to the path's side (m), the place, and for a long object its direction.
    """

    thing: MappedThing
    station_m: float
    off_m: float
    xy_m: tuple[float, float]
    along_rad: float | None


def things_of_kind(things: Sequence[MappedThing], code: int) -> Iterator[MappedThing]:
    """Yield the mapped objects that an ``SOE`` names: points for compact kinds, lines for those along a road.

    >>> from trace_dag.roads.report import MappedThing
    >>> tree = MappedThing("n1", "natural=tree", ((3.0, 4.0),))
    >>> [each.osm_id for each in things_of_kind([tree], 42)]  # SOE 42: Tree (Standing Only)
    ['n1']
    """
    runs = KINDS[code].form is ObjectForm.LINE
    for thing in things:
        if code in _KINDS_OF.get(thing.tag, ()) and runs == (len(thing.xy_m) > 1):
            yield thing


def mapped_object(scene: Scene, base: Path, code: int, side_sign: float) -> MappedObject | None:
    """Return the nearest mapped object of a kind where a vehicle on ``base`` may have left the road, or None.

    ``side_sign`` is 1 to the left of the path and -1 to the right.

    >>> from dataclasses import replace
    >>> from trace_dag.reconstruction.motion.departure_paths import rotate_pose
    >>> path = way_past_the_tree.path()
    >>> here = path.pose(path.project(*tree_scene.place_xy_m)[0])
    >>> x_m, y_m = here.xy_m + 4.0 * rotate_pose(here, -math.pi / 2).forward  # 4 m to its right
    >>> mapped = replace(tree_scene, things=(MappedThing("n1", "natural=tree", ((x_m, y_m),)),))
    >>> float(round(mapped_object(mapped, path, 42, -1.0).off_m, 3))  # SOE 42: a standing tree
    4.0
    >>> mapped_object(mapped, path, 42, 1.0) is None  # none to the left
    True
    """
    if scene.record.road_relation_code in ON_ROADWAY or not side_sign:
        return None
    farthest_m = _OF_SHOULDER_M if scene.record.road_relation_code == ON_SHOULDER else _OFF_M
    place_m, _ = base.project(*scene.place_xy_m)
    found = []
    for thing in things_of_kind(scene.things, code):
        xy_m, along_rad = nearest_of(thing, base.pose(place_m).xy_m)
        station_m, left_m = base.project(*xy_m)
        beyond_m = side_sign * left_m - scene.carriageway.edge_beside_m(base.pose(station_m), side_sign)
        apart_m = abs(station_m - place_m)
        if apart_m > _ALONG_M or not 0.0 < beyond_m <= farthest_m:
            continue
        if along_rad is not None and abs(math.sin(along_rad - base.pose(station_m).heading_rad)) > math.sin(
            _RUNS_ALONG_RAD
        ):
            continue
        found.append(
            (round(apart_m, 3), thing.osm_id, MappedObject(thing, station_m, side_sign * left_m, xy_m, along_rad))
        )
    return min(found, key=lambda each: each[:2])[2] if found else None


def nearest_of(thing: MappedThing, to_xy_m: FloatArray) -> tuple[tuple[float, float], float | None]:
    """Return the point of a mapped object that is nearest to another point, and a line's direction there.

    >>> from trace_dag.roads.report import MappedThing
    >>> wall = MappedThing("w1", "barrier=wall", ((0.0, 0.0), (10.0, 0.0)))
    >>> nearest_of(wall, (4.0, 3.0))  # the foot of the perpendicular; the wall runs east
    ((4.0, 0.0), 0.0)
    """
    if len(thing.xy_m) == 1:
        return thing.xy_m[0], None
    line = shapely.LineString(thing.xy_m)
    at = line.project(shapely.Point(to_xy_m))
    here, ahead, behind = line.interpolate(at), line.interpolate(at + 0.5), line.interpolate(max(at - 0.5, 0.0))
    return (here.x, here.y), math.atan2(ahead.y - behind.y, ahead.x - behind.x)


# --- ground for objects ----------------------------------------------------------------------------------------------
def on_free_ground(
    item: FixedObject,
    struck_at_xy_m: tuple[float, float],
    network: RoadNetwork,
    others: Iterable[Struck] = (),
    *,
    relation: int | None = None,
) -> FixedObject | None:
    """Return the object, shortened to free ground, or None if it cannot stand there.

    It cannot stand on a lane or shoulder, off its bridge (for a bridge rail), or in another object.

    A lengthwise object keeps the part around the place of its strike that lies across no roadway and nearer to that
    place than to the strike of another lengthwise object: a rail that is struck twice is divided. ``relation`` is the
    ``REL_ROAD`` of the event. An object that is struck on the roadway may stand or lie there (the kerb of an island).
    """
    if relation in ON_ROADWAY or item.code in LYING_OBJECTS:
        return item
    pose, reach_m = item.pose, item.length_m + item.width_m
    if relation == ON_SHOULDER:
        area = network.carriageway_near(pose.x_m, pose.y_m, reach_m, z_m=pose.z_m)
    else:
        area = network.kept_clear_near(pose.x_m, pose.y_m, reach_m, z_m=pose.z_m)
    outline = _outline(item, item.width_m)
    around = outline.buffer(2 * _AT_THE_EDGE_M)
    taken = shapely.intersection(area.within(around.bounds, _TOUCHING_M), around)
    apart = [(other, at_xy_m) for other, at_xy_m in others if other.number != item.number]
    if KINDS[item.code].form is not ObjectForm.LINE:
        blocks = [taken, *(_outline(other, other.width_m) for other, _ in apart)]
        free = not any(shapely.intersection(each, outline).buffer(-_TOUCHING_M).area > 0 for each in blocks)
        return item if free else None
    ends = pose.to_world(np.array([[-item.length_m / 2, 0.0], [item.length_m / 2, 0.0]]))
    axis = shapely.LineString(ends)
    narrow = _outline(item, max(item.width_m - 2 * _AT_THE_EDGE_M, 2 * _TOUCHING_M))
    across = _spans(axis, shapely.intersection(taken.buffer(-_AT_THE_EDGE_M), narrow))
    clear: BaseGeometry = axis.difference(across)
    if item.code == _BRIDGE_RAIL:
        clear = _on_bridge(clear, network, pose, reach_m)
    own = np.array(struck_at_xy_m)
    for other, at_xy_m in apart:
        if KINDS[other.code].form is not ObjectForm.LINE:
            clear = clear.difference(_spans(axis, shapely.intersection(_outline(other, other.width_m), narrow)))
        elif own.tolist() != list(at_xy_m) and _outline(other, other.width_m).distance(outline) < _AT_THE_EDGE_M:
            clear = clear.intersection(_nearer(own, np.array(at_xy_m)))
    struck = axis.interpolate(axis.project(shapely.Point(struck_at_xy_m)))
    parts = [part for part in shapely.get_parts(clear) if part.distance(struck) < _AT_THE_EDGE_M]
    part = max(parts, key=lambda each: float(each.length), default=None)
    if part is None or part.length < _LEAST_M:
        return None
    if part.length > axis.length - _TOUCHING_M:
        return item
    middle = part.interpolate(0.5, normalized=True)
    moved = Pose(round(middle.x, 6), round(middle.y, 6), pose.heading_rad, pose.z_m)
    return replace(item, pose=moved, length_m=round(part.length, 6))


def beyond_range_m(network: RoadNetwork, edge: Pose, sign: float, code: int) -> tuple[float, float]:
    """Return the least and largest distance of an object from the edge of the carriageway (m).

    It stands behind the mapped shoulder and lanes for parking and cycling, and behind the usual shoulder of such a
    road. For a kerb these do not count; a bridge ends there. ``edge`` is a place at the edge, in the direction of the
    traffic beside it. ``sign`` is 1 for the left of it, -1 for the right.
    """
    away = np.arange(0.0, _WIDEST_M, 0.25)
    at = edge.to_world(np.column_stack([np.zeros(len(away)), sign * (away + _TOUCHING_M)]))
    area = network.kept_clear_near(edge.x_m, edge.y_m, _WIDEST_M, z_m=edge.z_m)
    taken = area.contains(at[:, 0], at[:, 1])
    paved_m = 0.0 if taken.all() else float(away[int(np.argmin(taken))])
    place = roadside_at(network, float(at[1, 0]), float(at[1, 1]), z_m=edge.z_m)
    if place is not None and network.road_by_id[place.lane.lane.road_id].bridge:
        return paved_m + _BEHIND_M, paved_m + _BRIDGE_ENDS_M
    if code == _CURB:
        return paved_m, math.inf
    return max(paved_m, 0.0 if place is None else place.shoulder_m) + _BEHIND_M, math.inf


def _outline(item: FixedObject, width_m: float) -> shapely.Polygon:
    return shapely.Polygon(rectangle_corners(item.pose, item.length_m, width_m))


def _on_bridge(clear: BaseGeometry, network: RoadNetwork, pose: Pose, reach_m: float) -> BaseGeometry:
    """Return the part of a line beside a bridge, or the whole line if no bridge is near."""
    bridges = network.paved_near(pose.x_m, pose.y_m, reach_m, z_m=pose.z_m, of=lambda road: road.bridge)
    near = bridges.within(shapely.Point(pose.xy_m).buffer(reach_m).bounds, _TOUCHING_M)
    return clear if near.is_empty else clear.intersection(near.buffer(_OF_BRIDGE_M))


def _spans(axis: shapely.LineString, shape: BaseGeometry) -> BaseGeometry:
    """Return the stretches of an axis beside which some shapes lie."""
    found = []
    for part in shapely.get_parts(shape):
        if part.is_empty:
            continue
        along = shapely.line_locate_point(axis, shapely.points(shapely.get_coordinates(part)))
        begin, end = (axis.interpolate(float(each)) for each in (along.min(), along.max()))
        found.append(shapely.LineString([begin, end]).buffer(_TOUCHING_M))
    return shapely.union_all(found)


def _nearer(own: FloatArray, other: FloatArray) -> shapely.Polygon:
    """Return the area nearer to one point than to another, within the reach of objects."""
    towards = (own - other) / np.linalg.norm(own - other)
    across = np.array([-towards[1], towards[0]])
    middle = (own + other) / 2
    corners = [
        middle + _FAR_M * (along * towards + left * across) for along, left in ((0, 1), (1, 1), (1, -1), (0, -1))
    ]
    return shapely.Polygon(corners)
