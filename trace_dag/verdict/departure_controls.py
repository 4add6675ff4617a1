"""Negative controls of crashes in which a vehicle leaves the road: another report, the other side, the object moved.

As of two vehicles (:mod:`trace_dag.verdict.controls`), judged by the same rules as the true pairing. The objects are
placed by us, so that a verdict can only be worth what these reject: the mirrored side carries it.
"""

from __future__ import annotations

import math
from dataclasses import replace
from typing import Final

import numpy as np

from trace_dag.crash.departures import Departure, DepartureSide, departure_of, overturns_first
from trace_dag.crash.record import CrashRecord
from trace_dag.geometry import Pose, rectangle_corners
from trace_dag.roads.map.network import RoadNetwork
from trace_dag.roads.map.roadside import RoadZone, roadside_at
from trace_dag.settings import VerdictSettings
from trace_dag.states.objects import KINDS, FixedObject, ObjectForm, Resistance
from trace_dag.states.types import Hypothesis, ParticipantState, Trajectory
from trace_dag.verdict.controls import JudgedCrash, Shift
from trace_dag.verdict.departures import observe_departure, reported_zone
from trace_dag.verdict.metrics import clock_error_h
from trace_dag.verdict.rules import RULE_SETS

_ALONG_RAD: Final = math.radians(1.5)  # who goes off at less goes along the road
_LOOKED_AT: Final = 4  # steps of the plan between two looks at it
_ACROSS_M: Final = 3.0


def in_place_of(other: CrashRecord, own: CrashRecord) -> CrashRecord | None:
    """The other report with its vehicle and its events numbered as the own one's; None if either tells of no
    departure.

    >>> [vehicle.number for vehicle in in_place_of(tree_record, tree_record).vehicles], in_place_of(record, tree_record)
    ([1], None)
    """
    theirs, ours = departure_of(other), departure_of(own)
    if theirs is None or ours is None:
        return None
    later = ours.event_number - theirs.event_number
    number = ours.vehicle.number
    events = tuple(
        replace(
            event,
            number=event.number + later,
            party_1=number if event.party_1 == theirs.vehicle.number else None,
            party_2=None,
        )
        for event in other.events
    )
    return replace(other, vehicles=(replace(theirs.vehicle, number=number),), vehicles_in_transport=1, events=events)


def departures_differ(one: CrashRecord, two: CrashRecord, settings: VerdictSettings) -> bool:
    """Whether two reports contradict each other in the side, in whether it was on the roadway, the kind of the first
    object, or the area of impact by more than the threshold: else no simulation tells them apart.
    """
    mine, theirs = departure_of(one), departure_of(two)
    if mine is None or theirs is None:
        return False
    if mine.side and theirs.side and mine.side is not theirs.side:
        return True
    zones = reported_zone(one), reported_zone(two)
    if all(zones) and (zones[0] is RoadZone.ROADWAY) is not (zones[1] is RoadZone.ROADWAY):
        return True
    if overturns_first(one) or not mine.objects or not theirs.objects:
        return False
    own, other = mine.objects[0], theirs.objects[0]
    apart_h = clock_error_h(own.area.clock_h, other.area) if own.area else None
    return own.code != other.code or (apart_h is not None and apart_h > settings.max_clock_error_h)


def mirrored_departure(crash: JudgedCrash) -> Shift | None:
    """The hypothesis with the vehicle leaving to the other side, and the objects there; None if it left straight
    ahead, which is its own mirror image.
    """
    departure, hypothesis = departure_of(crash.record), crash.hypothesis
    if departure is None or departure.side not in (DepartureSide.LEFT, DepartureSide.RIGHT):
        return None
    state = _leaving(departure, hypothesis)
    t = state.trajectory
    k, axis = _last_along_road(crash, state)
    mirror = _Mirror(crash.network, axis)
    x, y, heading = t.x_m.copy(), t.y_m.copy(), t.heading_rad.copy()
    for at in range(k, len(x)):
        x[at], y[at], heading[at] = mirror.of(float(x[at]), float(y[at]), float(heading[at]))
    turned = Trajectory(t.time_s, x, y, t.z_m, np.unwrap(heading), t.speed_mps)
    objects = []
    for item in hypothesis.objects:
        x_m, y_m, along_rad = mirror.of(item.pose.x_m, item.pose.y_m, item.pose.heading_rad)
        if item.resistance is Resistance.SLOPE:
            along_rad += math.pi  # its far side stays on its left
        objects.append(replace(item, pose=Pose(x_m, y_m, math.remainder(along_rad, math.tau), item.pose.z_m)))
    return _with(hypothesis, replace(state, trajectory=turned), tuple(objects))


class _Mirror:
    """The mirror image across the line along which a vehicle went: parallel to its road as far as that goes, else
    straight on."""

    def __init__(self, network: RoadNetwork, axis: Pose) -> None:
        self._axis = axis
        near = network.nearest_lanes(axis.x_m, axis.y_m, 1.0)
        geometry = network.road_geometry(near[0].lane.road_id) if near else None
        self._line = geometry.line if geometry is not None else None
        self._length_m = geometry.road.length_m if geometry is not None else 0.0
        self._left_m = self._line.project(axis.x_m, axis.y_m)[1] if self._line is not None else 0.0

    def of(self, x_m: float, y_m: float, heading_rad: float) -> tuple[float, float, float]:
        """The image of a point and a heading."""
        if self._line is not None:
            s_m, t_m, _ = self._line.project(x_m, y_m)
            if 0.0 < s_m < self._length_m:
                at_x, at_y, along, _ = self._line.at(s_m)
                left_m = 2 * self._left_m - t_m
                return at_x - left_m * math.sin(along), at_y + left_m * math.cos(along), 2 * along - heading_rad
        ahead_m, left_m = self._axis.to_body(np.array([x_m, y_m]))
        x, y = self._axis.to_world(np.array([ahead_m, -left_m]))
        return float(x), float(y), 2 * self._axis.heading_rad - heading_rad


def _last_along_road(crash: JudgedCrash, state: ParticipantState) -> tuple[int, Pose]:
    """The last moment before the impact at which the vehicle went along its road: its index, and the pose of who goes
    exactly along it there."""
    t = state.trajectory
    impact = int(np.searchsorted(t.time_s, crash.hypothesis.impact_time_s))
    for k in range(min(impact, len(t.time_s) - 1), 0, -_LOOKED_AT):
        x, y, heading = float(t.x_m[k]), float(t.y_m[k]), float(t.heading_rad[k])
        place = roadside_at(crash.network, x, y, z_m=float(t.z_m[k]))
        if place is None or place.zone is not RoadZone.ROADWAY:
            continue
        apart = math.remainder(heading - place.along_rad, math.pi)
        if abs(apart) < _ALONG_RAD:
            return k, Pose(x, y, heading - apart)
    return 0, Pose(float(t.x_m[0]), float(t.y_m[0]), float(t.heading_rad[0]))


def object_moved(crash: JudgedCrash, settings: VerdictSettings) -> Shift | None:
    """The hypothesis with its first object farther from the reported point along the road: by the distance that the
    verdict allows and by what the object itself extends along the road, so that no part of it is as near as allowed.

    What runs along the road would stay where it is by that, and is moved 3 m away from it. None of what lies across the
    end of a road.

    >>> (tree,) = judged_tree.hypothesis.objects
    >>> (moved,) = object_moved(judged_tree, VerdictSettings()).hypothesis.objects
    >>> tree.length_m, tree.width_m
    (0.4, 0.4)
    >>> 5.4 <= math.dist(tree.pose.xy_m, moved.pose.xy_m) <= 5.0 + math.hypot(0.4, 0.4)  # m; 5 are allowed
    True
    """
    departure, hypothesis = departure_of(crash.record), crash.hypothesis
    observed = observe_departure(crash.network, hypothesis, crash.log)
    if departure is None or observed is None or not hypothesis.objects:
        return None
    state = _leaving(departure, hypothesis)
    first, *rest = hypothesis.objects
    contact, place = observed.first.contact, observed.first.place
    if KINDS[first.code].form is ObjectForm.LINE:
        if departure.side is DepartureSide.AHEAD:
            return None
        normal = np.array([-math.sin(first.pose.heading_rad), math.cos(first.pose.heading_rad)])
        away = math.copysign(_ACROSS_M, float(normal @ (first.pose.xy_m - state.impact_pose.xy_m)))
        moved = first.pose.xy_m + away * normal
    else:
        along_rad = contact.pose_1.heading_rad if place is None else place.along_rad
        along = np.array([math.cos(along_rad), math.sin(along_rad)])
        extent_m = float(np.ptp(rectangle_corners(first.pose, first.length_m, first.width_m) @ along))
        allowed_m = (RULE_SETS[settings.rule_set].limits or settings).max_contact_distance_m
        farther_m = math.copysign(allowed_m + extent_m, float(along @ np.array([contact.x_m, contact.y_m])))
        moved = first.pose.xy_m + farther_m * along
    pose = replace(first.pose, x_m=float(moved[0]), y_m=float(moved[1]))
    return _with(hypothesis, state, (replace(first, pose=pose), *rest))


def _leaving(departure: Departure, hypothesis: Hypothesis) -> ParticipantState:
    return next(each for each in hypothesis.participants if each.vehicle_number == departure.vehicle.number)


def _with(hypothesis: Hypothesis, state: ParticipantState, objects: tuple[FixedObject, ...]) -> Shift:
    states = tuple(state if each.vehicle_number == state.vehicle_number else each for each in hypothesis.participants)
    return Shift(replace(hypothesis, participants=states, objects=objects), state.vehicle_number, 0.0)
