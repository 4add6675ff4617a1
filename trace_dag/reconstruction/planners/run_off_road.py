"""A vehicle leaves the road and strikes fixed objects: as the first event of a crash, or on its way after one.

Maps seldom have the objects, and the reported point lies on the road: what is known is the station along the road, the
side, the kind of object and where on the vehicle it was struck. So the vehicle leaves its lane there to that side, in
the reported manner. The object is put where the vehicle's area of impact then is, as far beyond the edge as such
objects usually stand. Objects behind one that breaks or is driven over follow along the same course. Every such object
says that the program placed it. If OpenStreetMap has one of the kind
(:mod:`trace_dag.reconstruction.scene.roadside_objects`), the vehicle is led to that instead.

A vehicle out of control skids: it goes on along its course and turns about itself, so far that the area of impact faces
the object. Angles of departure follow from the lateral acceleration, of which each manner has several; measured angles
(Mak, Sicking and Coon, NCHRP Report 665, 2010) say which is likely.

After another event an object is put on the vehicle's way at the usual distance of such objects from the edge, or where
the vehicle stops if that is nearer. It is put outside the reported area of impact, or outside the leading part of the
vehicle if no area is reported. Frame: the local frame.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from itertools import islice
from typing import Final

import numpy as np
import shapely

from trace_dag.common.errors import Reason, Rejection
from trace_dag.common.geometry import body_bearing_rad
from trace_dag.common.paths import Path
from trace_dag.common.settings import StateSettings
from trace_dag.common.units import bearing_to_clock_h
from trace_dag.crash.crash_types import DepartureSide
from trace_dag.crash.event_sequence import CrashEvent
from trace_dag.crash.road_departure import Departure, DepartureManner, departure_of
from trace_dag.reconstruction import evidence
from trace_dag.reconstruction.assemble import AFTER_IMPACT_M, Drive, drive_along, planned_hypothesis
from trace_dag.reconstruction.course import Course, Plan, Search
from trace_dag.reconstruction.motion.departure_paths import (
    LeavingCourse,
    add_skid,
    angle_log_likelihood,
    courses_of,
    lane_path,
    rotate_pose,
    sign_of,
    skid_profile,
)
from trace_dag.reconstruction.motion.manoeuvres import Option
from trace_dag.reconstruction.motion.speeds import TravelSpeed
from trace_dag.reconstruction.planners.way_after import STRIKES_MPS, Way, ways_on
from trace_dag.reconstruction.pre_crash_scenarios import Party, party
from trace_dag.reconstruction.ranking import Scored, leaders_first
from trace_dag.reconstruction.scene.object_placement import (
    PlannedContacts,
    as_mapped,
    aside_to_object,
    objects_along,
    place_object,
    point_off_road_m,
    straight_on,
)
from trace_dag.reconstruction.scene.roadside_objects import Struck, nearest_of, on_free_ground, things_of_kind
from trace_dag.reconstruction.scene.scene import Scene
from trace_dag.reconstruction.scene.vehicle_ways import approaches_of
from trace_dag.roads.map.network import RoadNetwork
from trace_dag.roads.map.roadside import RoadZone, roadside_at
from trace_dag.roads.report import MappedThing
from trace_dag.simulation.objects import KINDS, FixedObject, ObjectForm, PlacedBy
from trace_dag.simulation.states import Hypothesis, Manoeuvre, PlannedEvent

_LANE_CROSSED: Final = -0.4  # log-likelihood for each lane between the vehicle's lane and the side it left to
_ON_MAP: Final = 1.0  # of a way that passes an object of the reported kind on the reported side
_BEGINS_M: Final = 15.0  # before the place: nearer than that a road that begins led nobody there
_NO_ROAD: Final = -4.0  # of a way that begins where the crash is: off the end of a road, onto it
_POINT_SCALE_M: Final = 2.0  # a coded point so much farther off the road is e times likelier beside the side left to
_SIDE_AT_MOST: Final = 3.0  # judgement: a point may be on the wrong side for other reasons
_NO_GROUND: Final = -6.0  # of a way on which the object would have to stand in a lane, on a shoulder, off its bridge
_OTHER_ZONE: Final = -3.0  # of a way to an object in the median, for one that is reported elsewhere, or the reverse
_BETWEEN: Final = (RoadZone.MEDIAN, RoadZone.GORE)
_ZONES: Final = {**dict.fromkeys((3, 10, 12), RoadZone.MEDIAN), **dict.fromkeys((4, 5, 6), None), 8: RoadZone.GORE}
"""``REL_ROAD`` that places something between two roads, or beside both."""
_ANGLE: Final = "angle of departure"
_NO_END: Final = -4.0  # of a way that does not end, for a departure at the end of the road
_NEAREST_M: Final = 0.1  # beyond the edge
_SHORT_M: Final = 10.0
_MOST_OF_A_WAY: Final = 4  # places for an object that are simulated
_NEARER: Final = (1.0, 0.5, 0.2)  # of the usual distance beyond the edge
_FARTHER_M: Final = 1.0
_BARRIERS: Final = frozenset({23, 24, 25, 26})
"""SOE of rails and barriers: they keep vehicles within the clear zone of a road, and stand in it."""
_CLEAR_ZONE_M: Final = 9.1  # 30 ft, AASHTO Roadside Design Guide


@dataclass(frozen=True, eq=False)
class DeparturePlan(Scored):
    """One possible departure of the vehicle.

    It has the path, the station of the first object's strike, and the times of the others. ``terms`` are
    log-likelihoods.
    """

    departure: Departure
    drive: Drive
    course: LeavingCourse
    objects: tuple[FixedObject, ...]
    planned: tuple[tuple[float, tuple[float, float]], ...]  # seconds after the first impact, and place, of each object
    terms: dict[str, float]

    @property
    def name(self) -> str:
        """Return a name that is unique among the plans of the crash."""
        vehicle, side = self.departure.vehicle.number, self.departure.side
        return f"vehicle {vehicle}: leaves {self.drive.option.approach.name} {side}, {self.course.name}"


def departure_hypotheses(search: Search, settings: StateSettings) -> tuple[Hypothesis, ...]:
    """Return ranked hypotheses of a vehicle that leaves the road and strikes objects there, as many as are kept.

    Raises :class:`Rejection` (``no_feasible_state``) if no path past the place leads off the road as reported.
    """
    scene = search.scene
    departure = departure_of(scene.record, search.sequence)
    plans = sorted(_plans(scene, departure), key=lambda plan: (-plan.score, plan.name))
    if not plans:
        detail = scene.no_way_that(f"leads off the road to the {departure.side}")
        raise Rejection(Reason.NO_FEASIBLE_STATE, detail, measured=len(scene.approaches))
    chosen = leaders_first(plans, lambda plan: plan.drive.option.approach.side)[: settings.max_hypotheses]
    return tuple(_hypothesis(scene, plan, settings.lead_time_s) for plan in chosen)


def _plans(scene: Scene, departure: Departure) -> Iterator[DeparturePlan]:
    who = party(scene.record, departure.vehicle)
    for option, speed, terms in approaches_of(scene, who):
        courses = courses_of(departure, option, speed.speed_mps)
        tried = (_plan(scene, departure, who, option, speed, terms, course) for course in courses)
        plans = [plan for plan in tried if plan is not None]
        # Angles tell the courses of one way apart, not the ways: from a lane farther inside all of them are steeper.
        likeliest = max((plan.terms.get(_ANGLE, 0.0) for plan in plans), default=0.0)
        for plan in plans:
            if _ANGLE in plan.terms:
                plan.terms[_ANGLE] -= likeliest
            yield plan


def _plan(
    scene: Scene,
    departure: Departure,
    who: Party,
    option: Option,
    speed: TravelSpeed,
    terms: dict[str, float],
    course: LeavingCourse,
) -> DeparturePlan | None:
    profile = skid_profile(who, speed.speed_mps, course.slip_rad)
    if profile.impact_mps < 1.0 or not departure.objects:
        return None
    base = lane_path(scene, option)
    place_m, _ = base.project(*scene.place_xy_m)
    ahead = departure.side is DepartureSide.AHEAD
    if ahead:
        led = straight_on(scene, departure, base, place_m, course)
        objects, planned = objects_along(departure, led, course, profile.impact_mps)
    else:
        led, objects, planned = aside_to_object(scene, departure, base, place_m, course, profile.impact_mps)
    path, station_m, ended = led.path, led.station_m, led.ended
    contact = planned[0][1]
    own = replace(departure.vehicle, impact=departure.objects[0].area)
    pose = rotate_pose(path.pose(station_m), course.slip_rad)
    bearing = body_bearing_rad(*own.clock_body(pose), np.array(contact))
    terms = terms | {"manner of leaving": course.log_prior}
    if own.impact is not None:
        area = evidence.impact_area_log_likelihood(own, np.array([bearing]))
        terms[f"impact area (vehicle {own.number})"] = float(area[0])
    if ahead and not ended and departure.manner is DepartureManner.END_OF_ROAD:
        terms["a road that goes on"] = _NO_END
    if option.approach.station_m - option.approach.mapped_from_m < _BEGINS_M:
        terms["a road that begins here"] = _NO_ROAD
    if objects[0].placed_by is PlacedBy.OPENSTREETMAP:
        terms["object on the map"] = _ON_MAP
    if not ahead:
        along = base.pose(base.project(pose.x_m, pose.y_m, near_s_m=place_m)[0])
        course_rad = path.pose(station_m).heading_rad - along.heading_rad
        terms[_ANGLE] = angle_log_likelihood(math.remainder(course_rad, math.tau))
        terms["side of the reported point"] = _side_of_point(scene, base, place_m, sign_of(departure))
    stood = _on_free_ground(scene, objects, planned)
    if not stood:
        terms["no ground for the object"] = _NO_GROUND
    objects = stood or objects[:1]
    terms["zone of the object"] = _zone_term(scene, contact)
    terms["lanes crossed"] = _LANE_CROSSED * _lanes_crossed(departure.side, option)
    option = replace(option, manoeuvre=Manoeuvre.LEAVE_ROAD)
    drive = Drive(who, option, path, station_m, speed, profile)
    return DeparturePlan(departure, drive, course, objects, planned[: len(objects)], terms)


def _on_free_ground(
    scene: Scene, objects: tuple[FixedObject, ...], planned: PlannedContacts
) -> tuple[FixedObject, ...]:
    """Return the objects up to the first one that cannot stand at the place of its strike."""
    struck = [(item, xy_m) for item, (_, xy_m) in zip(objects, planned, strict=True)]
    found: list[FixedObject] = []
    for item, xy_m in struck:
        relation = None if found else scene.record.road_relation_code
        mapped = item.placed_by is PlacedBy.OPENSTREETMAP
        stands = item if mapped else on_free_ground(item, xy_m, scene.network, struck, relation=relation)
        if stands is None:
            break
        found.append(stands)
    return tuple(found)


def _zone_term(scene: Scene, contact_xy_m: tuple[float, float]) -> float:
    """Return the log-likelihood of a place, by whether it lies between two roads as reported."""
    relation = scene.record.road_relation_code
    if relation not in _ZONES:
        return 0.0
    place = roadside_at(scene.network, *contact_xy_m, z_m=scene.placement.z_m)
    between = place.zone if place is not None and place.zone in _BETWEEN else None
    return 0.0 if between is _ZONES[relation] else _OTHER_ZONE


def _side_of_point(scene: Scene, base: Path, place_m: float, sign: float) -> float:
    """Return the log-likelihood of a departure to a side, given a reported point off the carriageway."""
    _, left_m = base.project(0.0, 0.0, near_s_m=place_m)
    return 0.0 if left_m * sign > 0 else -min(point_off_road_m(scene) / _POINT_SCALE_M, _SIDE_AT_MOST)


def _lanes_crossed(side: DepartureSide | None, option: Option) -> int:
    approach = option.approach
    if side is DepartureSide.LEFT:
        return approach.lane_from_left
    return approach.lanes_along - 1 - approach.lane_from_left if side is DepartureSide.RIGHT else 0


def _hypothesis(scene: Scene, plan: DeparturePlan, lead_s: float) -> Hypothesis:
    vehicle = plan.departure.vehicle
    after_s = max(plan.planned[-1][0] + 1.0, AFTER_IMPACT_M / max(plan.drive.profile.impact_mps, 2.5))
    state = drive_along(scene.network, plan.drive, lead_time_s=lead_s, after_s=after_s)
    if plan.course.slip_rad:
        state = add_skid(state, plan.course.slip_rad, lead_s)
    first_xy = plan.planned[0][1]
    bearing = body_bearing_rad(*vehicle.clock_body(state.impact_pose), np.array(first_xy))
    state = replace(state, impact_clock_h=round(bearing_to_clock_h(bearing), 3))
    planned = tuple(
        PlannedEvent(item.event_number, vehicle.number, item.number, round(lead_s + later_s, 6), xy_m)
        for item, (later_s, xy_m) in zip(plan.objects, plan.planned, strict=True)
    )
    return planned_hypothesis(plan, [state], lead_s, first_xy, planned=planned, objects=plan.objects)


# --- later -----------------------------------------------------------------------------------------------------------
def object_plans(search: Search, course: Course, event: CrashEvent) -> Iterator[Plan | str]:
    """Yield places for the object on the vehicle's possible paths, first those where the map has it.

    For a path without a place it yields the reason.
    """
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
    """Return the objects of a course, each with the place of its strike."""
    at = {each.number_2: (each.x_m, each.y_m) for each in reversed(course.log.contacts)}
    return [(item, at.get(item.number, (item.pose.x_m, item.pose.y_m))) for item in course.objects]


def _beside(struck: Struck, added: Struck, network: RoadNetwork) -> FixedObject:
    """Return an earlier object without the part that another one occupies."""
    item, at_xy_m = struck
    if KINDS[item.code].form is not ObjectForm.LINE:
        return item
    return on_free_ground(item, at_xy_m, network, [added]) or item


def _of_map(way: Way, event: CrashEvent, things: Sequence[MappedThing]) -> list[Struck]:
    """Return the mapped objects on the vehicle's path, each with the place of its strike."""
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
    """Yield objects that the vehicle would strike on its path, with possible places.

    First come places at the usual distance from the edge, then nearer, then farther ones.
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
    """Yield mapped things of a kind on the vehicle's path beyond the edge, each with the step that touches it."""
    reach_m = 0.0 if KINDS[code].form is ObjectForm.LINE else KINDS[code].width_m / 2
    outside = way.beyond_m.max(axis=1) > 0
    for thing in things:
        shape = shapely.Point(thing.xy_m[0]) if len(thing.xy_m) == 1 else shapely.LineString(thing.xy_m)
        touched = outside & (shapely.distance(way.outlines, shape) <= reach_m)
        if touched.any():
            yield int(np.argmax(touched)), thing
