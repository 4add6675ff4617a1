"""Fixed objects in OpenStreetMap: the one of the reported kind where the vehicle left the road.

It is used instead of an object placed by the program, since a mapped place is more accurate than a rule. It must be
within the distance along the road that a verdict allows, on the reported side, beyond the edge and in the reported
zone.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from typing import Final

import shapely

from trace_dag.common.geometry import FloatArray
from trace_dag.common.paths import Path
from trace_dag.common.settings import VerdictSettings
from trace_dag.crash.road_departure import ON_ROADWAY, ON_SHOULDER
from trace_dag.reconstruction.scene.scene import Scene
from trace_dag.roads.report import MappedThing
from trace_dag.simulation.objects import KINDS, ObjectForm

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
