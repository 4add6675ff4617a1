"""What a vehicle strikes beside the road after its first event: a fixed object on its way.

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
from trace_dag.reconstruction.planners.way_after import Way, ways_on
from trace_dag.roads.report import MappedThing
from trace_dag.states.mapped_objects import nearest_of, things_of_kind
from trace_dag.states.object_extent import clear_of_others
from trace_dag.states.object_placement import as_mapped, placed
from trace_dag.states.objects import KINDS, FixedObject, ObjectForm

_NEAREST_M: Final = 0.1  # beyond the edge
_SHORT_M: Final = 10.0
_MOST_OF_A_WAY: Final = 4  # places for an object that are simulated
_NEARER: Final = (1.0, 0.5, 0.2)  # of the usual distance beyond the edge
_BARRIERS: Final = frozenset({23, 24, 25, 26})
"""SOE of rails and barriers: they keep vehicles within the clear zone of a road, and stand in it."""
_CLEAR_ZONE_M: Final = 9.1  # 30 ft, AASHTO Roadside Design Guide


def object_plans(search: Search, course: Course, event: CrashEvent) -> Iterator[Plan | str]:
    """Places for the object on the ways that the vehicle can have gone on; of a way without any, why."""
    number = event.vehicle.number
    since_s = course.last_event_s(number)
    if since_s is None:
        yield f"vehicle {number} meets nobody before it"
        return
    for on_its_way, assumed in ways_on(search, course, number, event.side):
        way = Way.of(search.scene.network, on_its_way.log, number, since_s)
        places = list(islice(_objects(way, event, search.scene.things), _MOST_OF_A_WAY))
        if not places:
            yield way.why_not(event.side)
        for item in places:
            yield Plan(on_its_way.states, (*on_its_way.objects, item), detail=f"strikes the {item.name}{assumed}")


def _objects(way: Way, event: CrashEvent, things: Sequence[MappedThing]) -> Iterator[FixedObject]:
    """Objects that the vehicle would strike on its way: first as far beyond the edge as is usual, then nearer."""
    kind = KINDS[event.code]
    line = kind.form is ObjectForm.LINE
    if line:
        outermost_m = way.beyond_m.max(axis=1)
        beyond_m = np.where(np.diff(outermost_m, prepend=-math.inf) > 0, outermost_m, -math.inf)
        areas = [event.area] * len(way.poses)
    else:
        touches = way.striking(event.area, _NEAREST_M)
        beyond_m, areas = np.array([beyond for beyond, _ in touches]), [area for _, area in touches]
    farthest_m = float(beyond_m.max(initial=0.0))
    if event.code in _BARRIERS:
        farthest_m = min(farthest_m, _CLEAR_ZONE_M)
    for k, thing in _mapped(way, event.code, things):
        if way.left_to(event.side, k):
            _, runs_rad = nearest_of(thing, way.poses[k].xy_m)
            yield as_mapped(_placed(way, replace(event, area=areas[k]), k, runs_rad), thing)
    wanted = [share * kind.beyond_edge_m for share in _NEARER] + [farthest_m]
    steps = [int(np.argmax(beyond_m >= each)) for each in wanted if _NEAREST_M <= each <= farthest_m]
    for k in dict.fromkeys(steps):
        if not way.left_to(event.side, k):
            continue
        yield _placed(way, replace(event, area=areas[k]), k, None)
        if line:  # another vehicle would perhaps come against a long one
            yield _placed(way, event, k, None, length_m=_SHORT_M)


def _placed(way: Way, event: CrashEvent, k: int, runs_rad: float | None, *, length_m: float = math.inf) -> FixedObject:
    """An object that touches the vehicle at a step, running as the road does where no direction is given."""
    along_rad = way.runs_rad(k) if runs_rad is None else runs_rad
    item, at_xy_m = placed(event.vehicle, event, way.poses[k], way.slip_rad(k), along_rad, straight_m=length_m)
    return clear_of_others(item, at_xy_m, way.network)


def _mapped(way: Way, code: int, things: Sequence[MappedThing]) -> Iterator[tuple[int, MappedThing]]:
    """Things of a kind that the map has on the vehicle's way beyond the edge, each with the first step that touches
    it."""
    reach_m = 0.0 if KINDS[code].form is ObjectForm.LINE else KINDS[code].width_m / 2
    outside = way.beyond_m.max(axis=1) > 0
    for thing in things_of_kind(things, code):
        shape = shapely.Point(thing.xy_m[0]) if len(thing.xy_m) == 1 else shapely.LineString(thing.xy_m)
        touched = outside & (shapely.distance(way.outlines, shape) <= reach_m)
        if touched.any():
            yield int(np.argmax(touched)), thing
