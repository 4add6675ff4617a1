"""Places of the objects of a departure: along the course, so that each is struck with its reported area of impact."""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from typing import Final

import numpy as np

from trace_dag.common.geometry import Pose
from trace_dag.common.paths import Path
from trace_dag.crash.event_sequence import CrashEvent
from trace_dag.crash.record import VehicleClass, VehicleRecord
from trace_dag.crash.road_departure import ON_ROADWAY, ON_SHOULDER, Departure
from trace_dag.reconstruction.motion.contact import ContactPoint, contact_points_of
from trace_dag.reconstruction.motion.departure_paths import (
    FLATTEST,
    GOES_ON_M,
    LeavingCourse,
    edge_near,
    end_of_road_m,
    path_aside,
    rotate_pose,
    sign_of,
    slope_of,
)
from trace_dag.reconstruction.scene.roadside_objects import beyond_range_m, mapped_object
from trace_dag.reconstruction.scene.scene import Scene
from trace_dag.roads.map.roadside import roadside_at
from trace_dag.roads.report import MappedThing
from trace_dag.simulation.objects import KINDS, FixedObject, ObjectForm, PlacedBy, Resistance

_NEXT_M: Final = 1.5  # the next object stands at least this much farther out
_BREAKS_J: Final = 30e3  # an object that takes no more energy than this is passed
_MEETS: Final = 0.1  # a face that moves so little ahead strikes nothing
_CROSSES: Final = 0.5  # sine of the angle above which something lies across the course
_FARTHER_ON: Final = 0.2  # share of its length: the middle of an object along the road is beyond where it is struck
_LEAST_OFF_M: Final = 0.2
_CORRECTIONS: Final = 6
_SAME_PLACE_M: Final = 0.02
_POINT_MISSES_M: Final = 2.0
_FARTHEST_OFF_M: Final = 15.0  # farther off the road nothing is placed by a coded point: the clear zone ends there
_ARROW_M: Final = 0.25  # how far the ends of a straight object may lie off a curved road's edge


PlannedContacts = tuple[tuple[float, tuple[float, float]], ...]
"""Seconds after the first impact and place, for each object."""


@dataclass(frozen=True, eq=False)
class Led:
    """A path off the road, with the station of the first object and the objects' direction (rad).

    ``ends``: the road ends there.
    """

    path: Path
    station_m: float
    along_rad: float
    ended: bool


def as_mapped(item: FixedObject, thing: MappedThing) -> FixedObject:
    """Return an object at its mapped place, marked as the map's.

    >>> on_map = as_mapped(tree, MappedThing("n1", "natural=tree", ((3.0, 4.0),)))
    >>> on_map.pose.x_m, on_map.pose.y_m, on_map.placed_by.value
    (3.0, 4.0, 'openstreetmap')
    """
    pose = item.pose
    if len(thing.xy_m) == 1:
        pose = replace(pose, x_m=thing.xy_m[0][0], y_m=thing.xy_m[0][1])
    return replace(item, pose=pose, placed_by=PlacedBy.OPENSTREETMAP, osm_id=thing.osm_id)


def find_touch_point(vehicle: VehicleRecord, struck: CrashEvent, slip_rad: float, outward_rad: float) -> ContactPoint:
    """Return the point of the vehicle that an object touches.

    For a compact object it is the point of the area of impact, for one along the edge the foremost corner towards
    ``outward_rad`` (in the vehicle's axes).

    >>> car = tree_record.vehicles[0]
    >>> find_touch_point(car, replace(departure.objects[0], area=None), 0.0, 0.0).ahead_m  # half its length
    2.425
    """
    half_length, half_width = vehicle.length_m / 2, vehicle.width_m / 2
    if KINDS[struck.code].form is ObjectForm.LINE:
        outward = np.array([math.cos(outward_rad), math.sin(outward_rad)])
        corners = [(a * half_length, b * half_width) for a in (1, -1) for b in (1, -1)]
        ahead, left = max(corners, key=lambda corner: (round(float(np.array(corner) @ outward), 6), corner[0]))
        return ContactPoint(ahead, left, (float(outward[0]), float(outward[1])))
    goes = np.array([math.cos(slip_rad), -math.sin(slip_rad)])
    points = contact_points_of(struck.area, half_length, half_width)
    return next((point for point in points if float(goes @ np.array(point.normal)) > _MEETS), points[-1])


def objects_along(
    departure: Departure, led: Led, course: LeavingCourse, impact_mps: float
) -> tuple[tuple[FixedObject, ...], PlannedContacts]:
    """Return the objects on the vehicle's course, with the time and place of each strike.

    Each is placed at its area of impact.

    >>> straight_on = Led(way_past_the_tree.path(), station_m=100.0, along_rad=0.0, ended=False)
    >>> objects, planned = objects_along(departure, straight_on, LeavingCourse("drifting", 0.8, 0.0, 0.0), 20.0)
    >>> [(item.name, after_s) for item, (after_s, _) in zip(objects, planned, strict=True)]  # struck first, at 0 s
    [('tree', 0.0)]
    """
    path, station_m, along_rad = led.path, led.station_m, led.along_rad
    objects: list[FixedObject] = []
    planned: list[tuple[float, tuple[float, float]]] = []
    first = path.pose(station_m)
    out_rad = abs(math.sin(first.heading_rad - along_rad))  # how much farther from the edge it gets, per metre
    beyond_m = KINDS[departure.objects[0].code].beyond_edge_m
    on_m = 0.0
    for struck in departure.objects:
        kind = KINDS[struck.code]
        if objects:
            farther_m = max(kind.beyond_edge_m, beyond_m + _NEXT_M) - beyond_m
            on_m += farther_m / max(out_rad, 0.02)
            beyond_m += farther_m
        if on_m > GOES_ON_M:
            break
        pose = rotate_pose(path.pose(station_m + on_m), course.slip_rad)
        straight_m = _straight_m(path, pose)
        item, contact = place_object(departure.vehicle, struck, pose, course.slip_rad, along_rad, straight_m=straight_m)
        objects.append(item)
        planned.append((on_m / impact_mps, contact))
        if not _passes(departure, item):
            break
    return tuple(objects), tuple(planned)


def _passes(departure: Departure, item: FixedObject) -> bool:
    """Return whether the vehicle continues on its course past an object."""
    if departure.vehicle.vehicle_class is VehicleClass.MOTORCYCLE:
        return False
    return item.resistance is Resistance.DRIVEN_OVER or (item.energy_j is not None and item.energy_j <= _BREAKS_J)


def place_object(
    vehicle: VehicleRecord,
    struck: CrashEvent,
    pose: Pose,
    slip_rad: float,
    along_rad: float,
    *,
    straight_m: float = math.inf,
) -> tuple[FixedObject, tuple[float, float]]:
    """Return an object that touches a vehicle in a pose, and the point of contact.

    A compact object lies outside the struck point. The near face of an object along the edge goes through the vehicle's
    foremost corner; the object has the direction ``along_rad`` and at most the length ``straight_m``. ``slip_rad``: the
    vehicle's heading less its course.

    >>> at_origin = Pose(0.0, 0.0, 0.0)  # heading east
    >>> item, touched = place_object(departure.vehicle, departure.objects[0], at_origin, 0.0, 0.0)
    >>> touched, item.pose.x_m  # at the middle of the front of a car of 4.85 m; the trunk is 0.4 m thick
    ((2.425, 0.0), 2.625)
    """
    kind = KINDS[struck.code]
    course_rad = pose.heading_rad - slip_rad
    if kind.form is ObjectForm.LINE:
        heading = along_rad if math.cos(along_rad - course_rad) >= 0 else along_rad + math.pi
        length_m = min(kind.length_m, straight_m)
        outward = heading + math.copysign(math.pi / 2, math.sin(course_rad - heading))
        point = find_touch_point(vehicle, struck, slip_rad, outward - pose.heading_rad)
        depth_m = kind.width_m / 2
        on_m = 0.0 if abs(math.sin(course_rad - heading)) > _CROSSES else _FARTHER_ON * length_m
    else:
        heading, length_m, on_m = pose.heading_rad, kind.length_m, 0.0
        point = find_touch_point(vehicle, struck, slip_rad, 0.0)
        depth_m = (kind.length_m if abs(point.normal[0]) > abs(point.normal[1]) else kind.width_m) / 2
    contact = pose.to_world(np.array([point.ahead_m, point.left_m]))
    normal = pose.to_world(np.array(point.normal)) - pose.xy_m
    centre = contact + depth_m * normal + on_m * np.array([math.cos(heading), math.sin(heading)])
    if kind.resistance is Resistance.SLOPE and math.sin(course_rad - heading) < 0:
        heading += math.pi  # its far side is on its left
    placed = Pose(
        round(float(centre[0]), 6),
        round(float(centre[1]), 6),
        round(math.remainder(heading, math.tau), 6),
        round(pose.z_m, 6),
    )
    item = FixedObject.of_kind(
        struck.code, number=struck.party, event_number=struck.number, pose=placed, length_m=round(length_m, 6)
    )
    return item, (round(float(contact[0]), 6), round(float(contact[1]), 6))


def _straight_m(path: Path, pose: Pose) -> float:
    """Return the longest straight object (metres) along a road with the path's curvature."""
    at, _ = path.project(pose.x_m, pose.y_m)
    near = np.abs(path.s_m - at) < 15.0
    curvature = abs(float(np.mean(path.curvature_1pm[near]))) if near.any() else 0.0
    return max(2 * math.sqrt(2 * _ARROW_M / curvature), 4.0) if curvature > 1e-5 else math.inf


# --- where a departure leads to its first object ---------------------------------------------------------------------
def point_off_road_m(scene: Scene) -> float:
    """Return the distance (m) of the reported point beyond the carriageway's edge, 0 for a point on it.

    The error of police and geocoding is subtracted.
    """
    if scene.carriageway.has(0.0, 0.0):
        return 0.0
    beyond_m = float(scene.carriageway.beyond_m(np.zeros(1), np.zeros(1))[0])
    return max(beyond_m - _POINT_MISSES_M, 0.0)


def aside_to_object(
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
    off_road = point_off_road_m(scene) > 0.0 and 0.0 < point_off_m <= _FARTHEST_OFF_M
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
    """Return the path off the road to an object whose near face is ``face_m`` to the side of a station of ``base``."""
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


def straight_on(scene: Scene, departure: Departure, base: Path, place_m: float, course: LeavingCourse) -> Led:
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
    """Return the distance (m) of the object beyond the edge, within the reported zone.

    It is the distance of the reported point if that is off the road. Otherwise it is the usual distance for its kind,
    behind a shoulder, or less if another road is in the way.
    """
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
