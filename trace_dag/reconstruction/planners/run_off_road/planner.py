"""The analytic estimator of crashes in which one vehicle leaves the road and strikes fixed objects.

Maps seldom have the objects, and the reported point lies on the road: what is known is the station along the road, the
side, the kind of object and where on the vehicle it was struck. So the vehicle leaves its lane there to that side, in
the reported manner. The object is put where the vehicle's area of impact then is, as far beyond the edge as such
objects usually stand. Objects behind one that breaks or is driven over follow along the same course. Every such object
says that the program placed it. If OpenStreetMap has one of the kind
(:mod:`trace_dag.reconstruction.scene.mapped_objects`), the vehicle is led to that instead.

A vehicle out of control skids: it goes on along its course and turns about itself, so far that the area of impact faces
the object. Angles of departure follow from the lateral acceleration, of which each manner has several; measured angles
(Mak, Sicking and Coon, NCHRP Report 665, 2010) say which is likely. Frame: the local frame.
"""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import dataclass, replace
from typing import Final

import numpy as np

from trace_dag.common.errors import Reason, Rejection
from trace_dag.common.geometry import Pose, body_bearing_rad
from trace_dag.common.paths import Path
from trace_dag.common.units import bearing_to_clock_h
from trace_dag.crash.departure_side import DepartureSide
from trace_dag.crash.road_departure import ON_ROADWAY, ON_SHOULDER, Departure, DepartureManner
from trace_dag.reconstruction import evidence
from trace_dag.reconstruction.assemble import AFTER_IMPACT_M, drive_along
from trace_dag.reconstruction.motion.manoeuvres import Option
from trace_dag.reconstruction.motion.speeds import SpeedProfile, TravelSpeed
from trace_dag.reconstruction.planners.pedestrian_impact.planner import approaches_of
from trace_dag.reconstruction.planners.run_off_road.path import (
    FLATTEST,
    add_skid,
    edge_near,
    end_of_road_m,
    lane_path,
    path_aside,
    rotate_pose,
    sign_of,
    skid_profile,
    slope_of,
)
from trace_dag.reconstruction.planners.run_off_road.priors import LeavingCourse, angle_log_likelihood, courses_of
from trace_dag.reconstruction.pre_crash_scenarios import Party, party
from trace_dag.reconstruction.ranking import Scored, leaders_first
from trace_dag.reconstruction.scene.mapped_objects import mapped_object
from trace_dag.reconstruction.scene.object_ground import beyond_range_m, on_free_ground
from trace_dag.reconstruction.scene.object_placement import (
    Led,
    PlannedContacts,
    as_mapped,
    find_touch_point,
    objects_along,
)
from trace_dag.reconstruction.scene.scene import Scene
from trace_dag.roads.map.roadside import RoadZone, roadside_at
from trace_dag.simulation.objects import KINDS, FixedObject, PlacedBy
from trace_dag.simulation.states import Hypothesis, Manoeuvre, PlannedEvent

_LEAST_OFF_M: Final = 0.2
_CORRECTIONS: Final = 6
_SAME_PLACE_M: Final = 0.02
_LANE_CROSSED: Final = -0.4  # log-likelihood for each lane between the vehicle's lane and the side it left to
_ON_MAP: Final = 1.0  # of a way that passes an object of the reported kind on the reported side
_BEGINS_M: Final = 15.0  # before the place: nearer than that a road that begins led nobody there
_NO_ROAD: Final = -4.0  # of a way that begins where the crash is: off the end of a road, onto it
_POINT_MISSES_M: Final = 2.0
_POINT_SCALE_M: Final = 2.0  # a coded point so much farther off the road is e times likelier beside the side left to
_SIDE_AT_MOST: Final = 3.0  # judgement: a point may be on the wrong side for other reasons
_FARTHEST_OFF_M: Final = 15.0  # farther off the road nothing is placed by a coded point: the clear zone ends there
_NO_GROUND: Final = -6.0  # of a way on which the object would have to stand in a lane, on a shoulder, off its bridge
_OTHER_ZONE: Final = -3.0  # of a way to an object in the median, for one that is reported elsewhere, or the reverse
_BETWEEN: Final = (RoadZone.MEDIAN, RoadZone.GORE)
_ZONES: Final = {**dict.fromkeys((3, 10, 12), RoadZone.MEDIAN), **dict.fromkeys((4, 5, 6), None), 8: RoadZone.GORE}
"""``REL_ROAD`` that places something between two roads, or beside both."""
_ANGLE: Final = "angle of departure"
_NO_END: Final = -4.0  # of a way that does not end, for a departure at the end of the road


@dataclass(frozen=True, eq=False)
class DeparturePlan(Scored):
    """One way the vehicle can have left the road.

    Its path, the station along it where the first object is struck, and when the others are struck. ``terms`` are
    log-likelihoods.
    """

    departure: Departure
    option: Option
    course: LeavingCourse
    path: Path
    station_m: float
    speed: TravelSpeed
    profile: SpeedProfile
    objects: tuple[FixedObject, ...]
    planned: tuple[tuple[float, tuple[float, float]], ...]  # seconds after the first impact, and place, of each object
    terms: dict[str, float]

    @property
    def name(self) -> str:
        """Return a name that tells this plan from the others of its crash."""
        vehicle, side = self.departure.vehicle.number, self.departure.side
        return f"vehicle {vehicle}: leaves {self.option.approach.name} {side}, {self.course.name}"


def departure_hypotheses(scene: Scene, departure: Departure, *, lead_s: float, most: int) -> tuple[Hypothesis, ...]:
    """Return the ranked hypotheses of a vehicle that leaves the road and strikes what stands there, at most so many.

    Raises :class:`Rejection` (``no_feasible_state``) where no way past the place leads off the road as reported.
    """
    plans = sorted(_plans(scene, departure), key=lambda plan: (-plan.score, plan.name))
    if not plans:
        detail = scene.no_way_that(f"leads off the road to the {departure.side}")
        raise Rejection(Reason.NO_FEASIBLE_STATE, detail, measured=len(scene.approaches))
    chosen = leaders_first(plans, lambda plan: plan.option.approach.side)[:most]
    return tuple(_hypothesis(scene, plan, lead_s) for plan in chosen)


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
        led = _straight_on(scene, departure, base, place_m, course)
        objects, planned = objects_along(departure, led, course, profile.impact_mps)
    else:
        led, objects, planned = _aside_to_object(scene, departure, base, place_m, course, profile.impact_mps)
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
    made = planned[: len(objects)]
    return DeparturePlan(departure, option, course, path, station_m, speed, profile, objects, made, terms)


def _on_free_ground(
    scene: Scene, objects: tuple[FixedObject, ...], planned: PlannedContacts
) -> tuple[FixedObject, ...]:
    """Return the objects up to the first one that cannot stand where it would be struck."""
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
    """Return the log-likelihood of a place by whether it lies between two roads as reported."""
    relation = scene.record.road_relation_code
    if relation not in _ZONES:
        return 0.0
    place = roadside_at(scene.network, *contact_xy_m, z_m=scene.placement.z_m)
    between = place.zone if place is not None and place.zone in _BETWEEN else None
    return 0.0 if between is _ZONES[relation] else _OTHER_ZONE


def _point_off_road_m(scene: Scene) -> float:
    """Return how far beyond the carriageway's edge the reported point is (m), less the error of police and geocoding.

    0 for one on it.
    """
    if scene.carriageway.has(0.0, 0.0):
        return 0.0
    beyond_m = float(scene.carriageway.beyond_m(np.zeros(1), np.zeros(1))[0])
    return max(beyond_m - _POINT_MISSES_M, 0.0)


def _side_of_point(scene: Scene, base: Path, place_m: float, sign: float) -> float:
    """Return the log-likelihood of a departure to a side by the reported point, where that lies off the carriageway."""
    _, left_m = base.project(0.0, 0.0, near_s_m=place_m)
    return 0.0 if left_m * sign > 0 else -min(_point_off_road_m(scene) / _POINT_SCALE_M, _SIDE_AT_MOST)


def _lanes_crossed(side: DepartureSide | None, option: Option) -> int:
    approach = option.approach
    if side is DepartureSide.LEFT:
        return approach.lane_from_left
    return approach.lanes_along - 1 - approach.lane_from_left if side is DepartureSide.RIGHT else 0


def _aside_to_object(
    scene: Scene, departure: Departure, base: Path, place_m: float, course: LeavingCourse, impact_mps: float
) -> tuple[Led, tuple[FixedObject, ...], PlannedContacts]:
    """Return the way off the road to the left or right, and the objects along it.

    The first object is the map's, if the map has one of that kind where the vehicle left the road.
    """
    sign = sign_of(departure)
    place_m, edge = edge_near(scene, base, place_m, sign)
    code = departure.objects[0].code
    if mapped := mapped_object(scene, base, code, sign):
        station_m, off_m = mapped.station_m, mapped.off_m - KINDS[code].width_m / 2
        for _ in range(_CORRECTIONS):
            led = _aside(departure, base, station_m, off_m, course, impact_mps, mapped.along_rad)
            objects, planned = objects_along(departure, led, course, impact_mps)
            here = base.pose(station_m)
            error = np.array(mapped.xy_m) - objects[0].pose.xy_m
            along, left = here.to_world(np.eye(2)) - here.xy_m
            if mapped.along_rad is None:
                station_m += float(error @ along)
            missed_m = float(error @ left) if mapped.along_rad is not None else float(np.linalg.norm(error))
            if abs(missed_m) < _SAME_PLACE_M:
                return led, (as_mapped(objects[0], mapped.thing), *objects[1:]), planned
            off_m += sign * float(error @ left)
    _, point_m = base.project(0.0, 0.0, near_s_m=place_m)
    point_off_m = sign * point_m - edge
    off_road = _point_off_road_m(scene) > 0.0 and 0.0 < point_off_m <= _FARTHEST_OFF_M
    beyond_m = _beyond_edge_m(scene, base.pose(place_m), sign, edge, code, point_off_m if off_road else None)
    led = _aside(departure, base, place_m, edge + beyond_m, course, impact_mps, None)
    return led, *objects_along(departure, led, course, impact_mps)


def _aside(
    departure: Departure,
    base: Path,
    place_m: float,
    face_m: float,
    course: LeavingCourse,
    impact_mps: float,
    along_rad: float | None,
) -> Led:
    """Return the way off the road to an object whose near face is ``face_m`` to the side of a station of ``base``."""
    sign = sign_of(departure)
    here = base.pose(place_m)
    first = departure.objects[0]
    slope = FLATTEST
    for _ in range(3):  # the spot's position depends on the slope, and the slope on the distance
        turn_rad = sign * math.atan(slope) + course.slip_rad
        point = find_touch_point(departure.vehicle, first, course.slip_rad, sign * math.pi / 2 - turn_rad)
        off_m = face_m - sign * (point.ahead_m * math.sin(turn_rad) + point.left_m * math.cos(turn_rad))
        off_m = max(off_m, _LEAST_OFF_M)
        slope = slope_of(off_m, course.lateral_mps2, impact_mps)
    anchor_m = place_m - (point.ahead_m * math.cos(turn_rad) - point.left_m * math.sin(turn_rad))
    path, station_m = path_aside(base, anchor_m, sign * off_m, slope, course.lateral_mps2, impact_mps)
    return Led(path, station_m, here.heading_rad if along_rad is None else along_rad, ended=False)


def _straight_on(scene: Scene, departure: Departure, base: Path, place_m: float, course: LeavingCourse) -> Led:
    """Return the way straight on: to the end of the road if it ends there, else to an object ahead."""
    first = departure.objects[0]
    half_width_m = departure.vehicle.width_m / 2
    ends = [end_of_road_m(scene, base, place_m, left_m) for left_m in (0.0, half_width_m, -half_width_m)]
    end_m = None if None in ends else max(each for each in ends if each is not None)
    reach_m = place_m
    if end_m is not None:
        across = rotate_pose(base.pose(end_m), -math.pi / 2)
        least_m, most_m = beyond_range_m(scene.network, across, 1.0, first.code)
        reach_m = end_m + min(max(KINDS[first.code].beyond_edge_m, least_m), most_m)
    slip = course.slip_rad
    point = find_touch_point(departure.vehicle, first, slip, -slip)
    spot_m = point.ahead_m * math.cos(slip) - point.left_m * math.sin(slip)
    here = base.pose(reach_m)
    across_rad = here.heading_rad + math.pi / 2
    if end_m is not None:
        edge = roadside_at(scene.network, here.x_m, here.y_m, z_m=scene.placement.z_m)
        if edge is not None and abs(math.sin(edge.along_rad - here.heading_rad)) > 0.5:
            across_rad = edge.along_rad
    return Led(base, reach_m - spot_m, across_rad, ended=end_m is not None)


def _beyond_edge_m(scene: Scene, here: Pose, sign: float, edge: float, code: int, point_off_m: float | None) -> float:
    """Return how far beyond the edge the object stands (metres).

    It is that of the reported point where that is off the road, else usual for its kind, behind a shoulder, nearer
    if another road is in the way, within the reported zone."""
    usual = KINDS[code].beyond_edge_m
    relation = scene.record.road_relation_code
    if relation in ON_ROADWAY:
        return -0.5
    at_edge = here.to_world(np.array([0.0, sign * (edge + 0.1)]))
    if relation == ON_SHOULDER:
        place = roadside_at(scene.network, float(at_edge[0]), float(at_edge[1]), z_m=here.z_m)
        usual = min(usual, 0.8 * place.shoulder_m if place is not None else usual)
        wanted = [usual, usual / 2, 0.3]
    else:
        at = Pose(float(at_edge[0]), float(at_edge[1]), here.heading_rad, here.z_m)
        least_m, most_m = beyond_range_m(scene.network, at, sign, code)
        first = [min(max(each, least_m), most_m) for each in (point_off_m or usual, usual)]
        wanted = [*first, least_m, usual / 2, 0.3]
    for beyond_m in wanted:
        at_m = here.to_world(np.array([0.0, sign * (edge + beyond_m + 0.2)]))
        if not scene.carriageway.has(float(at_m[0]), float(at_m[1])):
            return beyond_m
    return min(usual, 0.1)


def _hypothesis(scene: Scene, plan: DeparturePlan, lead_s: float) -> Hypothesis:
    vehicle = plan.departure.vehicle
    after_s = max(plan.planned[-1][0] + 1.0, AFTER_IMPACT_M / max(plan.profile.impact_mps, 2.5))
    state = drive_along(
        scene.network,
        vehicle,
        plan.option,
        plan.path,
        plan.station_m,
        plan.speed,
        plan.profile,
        lead_time_s=lead_s,
        after_s=after_s,
    )
    if plan.course.slip_rad:
        state = add_skid(state, plan.course.slip_rad, lead_s)
    first_xy = plan.planned[0][1]
    bearing = body_bearing_rad(*vehicle.clock_body(state.impact_pose), np.array(first_xy))
    state = replace(state, impact_clock_h=round(bearing_to_clock_h(bearing), 3))
    planned = tuple(
        PlannedEvent(item.event_number, vehicle.number, item.number, round(lead_s + later_s, 6), xy_m)
        for item, (later_s, xy_m) in zip(plan.objects, plan.planned, strict=True)
    )
    return Hypothesis(
        name=plan.name,
        score=plan.score,
        evidence={name: round(value, 6) for name, value in sorted(plan.terms.items())},
        participants=(state,),
        impact_time_s=lead_s,
        impact_point_xy_m=first_xy,
        planned=planned,
        objects=plan.objects,
    )
