"""Fixed objects on a vehicle's way after its first event.

The object is put where that way has come as far beyond the edge of the carriageway as such objects usually stand, or as
far as the vehicle gets, outside the spot of the area of impact, or of the part that goes first where none is reported.
An object of the kind that the map has on the way is used instead.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from dataclasses import replace
from itertools import islice
from typing import Final

import numpy as np
import shapely

from trace_dag.crash.event_sequence import CrashEvent
from trace_dag.reconstruction.course import Course, Plan, Search
from trace_dag.reconstruction.planners.way_after import STRIKES_MPS, Way, ways_on
from trace_dag.reconstruction.scene.mapped_objects import nearest_of, things_of_kind
from trace_dag.reconstruction.scene.object_ground import Struck, on_free_ground
from trace_dag.reconstruction.scene.object_placement import as_mapped, place_object
from trace_dag.roads.map.network import RoadNetwork
from trace_dag.roads.report import MappedThing
from trace_dag.simulation.objects import KINDS, FixedObject, ObjectForm

_NEAREST_M: Final = 0.1  # beyond the edge
_SHORT_M: Final = 10.0
_MOST_OF_A_WAY: Final = 4  # places for an object that are simulated
_NEARER: Final = (1.0, 0.5, 0.2)  # of the usual distance beyond the edge
_FARTHER_M: Final = 1.0
_BARRIERS: Final = frozenset({23, 24, 25, 26})
"""SOE of rails and barriers: they keep vehicles within the clear zone of a road, and stand in it."""
_CLEAR_ZONE_M: Final = 9.1  # 30 ft, AASHTO Roadside Design Guide


def object_plans(search: Search, course: Course, event: CrashEvent) -> Iterator[Plan | str]:
    """Yield places for the object on the ways that the vehicle can have gone on, first those where the map has it.

    For a way without any, yield the reason."""
    number = event.vehicle.number
    since_s = course.last_event_s(number)
    if since_s is None:
        yield f"vehicle {number} meets nobody before it"
        return
    things = list(things_of_kind(search.scene.things, event.code))
    for mapped in (True, False) if things else (False,):
        for on_its_way, assumed in ways_on(search, course, number, event.side, least_mps=STRIKES_MPS):
            way = Way.of(search.scene.network, on_its_way.log, number, since_s)
            struck = _struck(on_its_way)
            used = {item.osm_id for item, _ in struck}
            if mapped:
                places = _of_map(way, event, [each for each in things if each.osm_id not in used])
            else:
                places = list(islice(_objects(way, event, struck), _MOST_OF_A_WAY))
                if not places:
                    yield way.why_not(event.side)
            for item, at_xy_m in places:
                before = (_beside(each, (item, at_xy_m), way.network) for each in struck)
                yield Plan(on_its_way.states, (*before, item), detail=f"strikes the {item.name}{assumed}")


def _struck(course: Course) -> list[Struck]:
    """Return the objects of a course, each with where it is struck."""
    at = {each.number_2: (each.x_m, each.y_m) for each in reversed(course.log.contacts)}
    return [(item, at.get(item.number, (item.pose.x_m, item.pose.y_m))) for item in course.objects]


def _beside(struck: Struck, added: Struck, network: RoadNetwork) -> FixedObject:
    """Return an object that stood before, less what of it another one takes."""
    item, at_xy_m = struck
    if KINDS[item.code].form is not ObjectForm.LINE:
        return item
    return on_free_ground(item, at_xy_m, network, [added]) or item


def _of_map(way: Way, event: CrashEvent, things: Sequence[MappedThing]) -> list[Struck]:
    """Return the objects that the map has on the vehicle's way, each with where it is struck."""
    found = []
    for k, thing in _mapped(way, event.code, things):
        if way.left_to(event.side, k):
            _, runs_rad = nearest_of(thing, way.poses[k].xy_m)
            item, at_xy_m = place_object(
                event.vehicle, event, way.poses[k], way.slip_rad(k), runs_rad or way.runs_rad(k)
            )
            found.append((as_mapped(item, thing), at_xy_m))
    return found


def _objects(way: Way, event: CrashEvent, struck: Sequence[Struck]) -> Iterator[Struck]:
    """Yield objects that the vehicle would strike on its way where they can stand, and where.

    First as far beyond the edge as is usual, then nearer, then farther.
    """
    kind = KINDS[event.code]
    line = kind.form is ObjectForm.LINE
    if line:
        outermost_m = way.beyond_m.max(axis=1)
        beyond_m = np.where(np.diff(outermost_m, prepend=-math.inf) > 0, outermost_m, -math.inf)
        areas = [event.area] * len(way.poses)
    else:
        touches = way.striking(event.area, _NEAREST_M)
        beyond_m, areas = np.array([beyond for beyond, _ in touches]), [area for _, area in touches]
    beyond_m = np.where(way.speeds_mps >= STRIKES_MPS, beyond_m, -math.inf)
    farthest_m = float(beyond_m.max(initial=0.0))
    if event.code in _BARRIERS:
        farthest_m = min(farthest_m, _CLEAR_ZONE_M)
    wanted = [share * kind.beyond_edge_m for share in _NEARER]
    wanted += [*np.arange(kind.beyond_edge_m + _FARTHER_M, farthest_m, _FARTHER_M), farthest_m]
    steps = [int(np.argmax(beyond_m >= each)) for each in wanted if _NEAREST_M <= each <= farthest_m]
    for k in dict.fromkeys(steps):
        if not way.left_to(event.side, k):
            continue
        # Another vehicle would perhaps come against a long one.
        for length_m in (math.inf, _SHORT_M) if line else (math.inf,):
            seen = replace(event, area=areas[k])
            pose, slip_rad = way.poses[k], way.slip_rad(k)
            item, at_xy_m = place_object(event.vehicle, seen, pose, slip_rad, way.runs_rad(k), straight_m=length_m)
            stands = on_free_ground(item, at_xy_m, way.network, struck)
            if stands is not None:
                yield stands, at_xy_m


def _mapped(way: Way, code: int, things: Sequence[MappedThing]) -> Iterator[tuple[int, MappedThing]]:
    """Yield mapped things of a kind on the vehicle's way beyond the edge, each with the step that touches it."""
    reach_m = 0.0 if KINDS[code].form is ObjectForm.LINE else KINDS[code].width_m / 2
    outside = way.beyond_m.max(axis=1) > 0
    for thing in things:
        shape = shapely.Point(thing.xy_m[0]) if len(thing.xy_m) == 1 else shapely.LineString(thing.xy_m)
        touched = outside & (shapely.distance(way.outlines, shape) <= reach_m)
        if touched.any():
            yield int(np.argmax(touched)), thing
