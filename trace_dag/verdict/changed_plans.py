"""Negative controls of plans: a party late, its side mirrored, or an object or parked vehicle moved.

The verdict of each is made by the rules for the true plan. If one of two parties stands at the place of the crash, no
delay makes them miss; the row then has no control, with that reason. Objects and parked vehicles are placed by the
program, so these controls measure the value of their verdicts.
"""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import dataclass, replace
from typing import Final

import numpy as np

from trace_dag.common.geometry import Pose, rectangle_corners
from trace_dag.common.settings import VerdictSettings
from trace_dag.crash.crash_types import DepartureSide, turn_of
from trace_dag.crash.event_sequence import OFF_THE_ROAD
from trace_dag.crash.parties import EventKind
from trace_dag.crash.road_departure import Departure, departure_of
from trace_dag.reconstruction.motion.walking import CROSSING, reported_directions
from trace_dag.roads.map.network import RoadNetwork
from trace_dag.roads.map.roadside import RoadZone, roadside_at
from trace_dag.simulation.objects import KINDS, FixedObject, ObjectForm, Resistance
from trace_dag.simulation.states import EstimatorRun, Hypothesis, Manoeuvre, ParticipantState, StateEstimate, Trajectory
from trace_dag.simulation.types import SimulationLog
from trace_dag.verdict.controls import ControlRow, JudgedCrash, row_of
from trace_dag.verdict.judge import judge_hypothesis
from trace_dag.verdict.rules import limits_of

STANDING_MPS: Final = 1.0
"""A vehicle slower than this at the planned contact stands there for what a delay can do."""
LEAST_SHIFT_S: Final = 2.0
_PERSON_STANDS_MPS: Final = 0.3
_MISS_BY_M: Final = 10.0
_CROSSES: Final = frozenset({Manoeuvre.CROSS_FROM_LEFT, Manoeuvre.CROSS_FROM_RIGHT})
_ASIDE_M: Final = 3.0
_ALONG_RAD: Final = math.radians(1.5)  # who goes off at less goes along the road
_LOOKED_AT: Final = 4  # steps of the plan between two looks at it


@dataclass(frozen=True, eq=False)
class ChangedPlan:
    """A hypothesis with one party changed: late by ``shift_s``, mirrored or moved (0)."""

    hypothesis: Hypothesis
    vehicle_number: int
    shift_s: float


def make_changed_plans(crash: JudgedCrash, settings: VerdictSettings) -> Iterator[tuple[str, ChangedPlan | None]]:
    """Yield every applicable change of a crash, by name; None if a delay changes nothing.

    >>> [name for name, _ in make_changed_plans(judged_tree, VerdictSettings())]
    ['mirrored', 'moved']
    """
    first = crash.sequence.first
    if first.kind in OFF_THE_ROAD:
        found = [("mirrored", mirror_departure(crash)), ("moved", object_moved(crash, settings))]
        yield from ((name, changed) for name, changed in found if changed is not None)
        return
    if first.kind is EventKind.VEHICLE_CONTACT:
        yield "shifted", late_vehicle(crash)
        if first.parked is not None:
            yield "moved", move_parked(crash, first.parked.number)
        return
    yield "shifted", late_person(crash)
    other_side = mirror_person(crash)
    if other_side is not None:
        yield "mirrored", other_side


def changed_estimate(crash: JudgedCrash, changed: ChangedPlan) -> StateEstimate:
    """Return the estimate with which :func:`trace_dag.simulation.run.simulate` runs a changed plan."""
    return StateEstimate(crash.record.key, (changed.hypothesis,), EstimatorRun("changed plan", "1"))


def changed_row(
    crash: JudgedCrash, name: str, changed: ChangedPlan | None, log: SimulationLog | None, settings: VerdictSettings
) -> ControlRow:
    """Return the judgement of a changed plan; ``changed`` and ``log`` are None if nothing could be changed."""
    if changed is None or log is None:
        detail = "one of the parties stands where they meet: no delay makes them miss"
        return ControlRow(name, crash.record.key, detail=detail)
    verdict = judge_hypothesis(crash.record, crash.network, changed.hypothesis, log, settings)
    shift_s = changed.shift_s if name == "shifted" else None
    return replace(row_of(name, crash.record.key, verdict), shifted_vehicle=changed.vehicle_number, shift_s=shift_s)


# --- late ------------------------------------------------------------------------------------------------------------
def late_vehicle(crash: JudgedCrash) -> ChangedPlan | None:
    """Return the first vehicle late enough that the two should miss, or meet ten metres away or more.

    The delay is the time that the slower one takes for that and for the length of both, at least :data:`LEAST_SHIFT_S`.
    None if one of the two stands at their meeting.

    >>> late = late_vehicle(judged_collision)  # 10 m and half of both lengths (4.85 and 2.20 m), by 6.26 m/s
    >>> late.vehicle_number, round(late.shift_s, 2)
    (1, 2.16)
    """
    one, two = _who_meet_first(crash)
    slower_mps = min(abs(one.impact_speed_mps), abs(two.impact_speed_mps))
    if slower_mps < STANDING_MPS:
        return None
    shift_s = max(LEAST_SHIFT_S, (_MISS_BY_M + (one.length_m + two.length_m) / 2) / slower_mps)
    return _with(crash.hypothesis, delay_party(one, shift_s), shift_s)


def late_person(crash: JudgedCrash) -> ChangedPlan | None:
    """Return the first person late: by two seconds if crossing, by more along the road.

    None if the person or the vehicle stands at their meeting.

    >>> late = late_person(judged_pedestrian)  # he crosses the road
    >>> late.vehicle_number, late.shift_s
    (1001, 2.0)
    """
    vehicle, person = _who_meet_first(crash)
    if abs(person.impact_speed_mps) < _PERSON_STANDS_MPS or abs(vehicle.impact_speed_mps) < STANDING_MPS:
        return None
    shift_s = LEAST_SHIFT_S
    if person.manoeuvre not in _CROSSES:
        shift_s = max(shift_s, (_MISS_BY_M + (person.length_m + vehicle.length_m) / 2) / abs(person.impact_speed_mps))
    return _with(crash.hypothesis, delay_party(person, shift_s), shift_s)


def _who_meet_first(crash: JudgedCrash) -> tuple[ParticipantState, ParticipantState]:
    """Return the two parties of the first contact, the lower number first."""
    states = {state.vehicle_number: state for state in crash.hypothesis.participants}
    one, two = crash.sequence.first.pair
    return states[one], states[two]


def delay_party(state: ParticipantState, delay_s: float) -> ParticipantState:
    """Return the same motion later: the vehicle starts further back, straight on at its initial speed.

    >>> first = hypothesis.participants[0]
    >>> late = delay_party(first, 2.0)  # at 6.26 m/s
    >>> round(math.dist(late.initial_pose.xy_m, first.initial_pose.xy_m), 2)  # metres farther back
    12.52
    """
    t = state.trajectory
    pose, speed = state.initial_pose, state.initial_speed_mps
    back_m = speed * delay_s
    x, y = pose.x_m - back_m * math.cos(pose.heading_rad), pose.y_m - back_m * math.sin(pose.heading_rad)
    return replace(
        state,
        initial_pose=Pose(x, y, pose.heading_rad, pose.z_m),
        trajectory=Trajectory(
            time_s=np.concatenate([[0.0], t.time_s + delay_s]),
            x_m=np.concatenate([[x], t.x_m]),
            y_m=np.concatenate([[y], t.y_m]),
            z_m=np.concatenate([[pose.z_m], t.z_m]),
            heading_rad=np.concatenate([[pose.heading_rad], t.heading_rad]),
            speed_mps=np.concatenate([[speed], t.speed_mps]),
        ),
    )


# --- mirrored --------------------------------------------------------------------------------------------------------
def mirror_person(crash: JudgedCrash) -> ChangedPlan | None:
    """Return the first person coming from the other side; None if the side is not reported.

    The person's motion is mirrored at the line of the striking vehicle.
    """
    strike = crash.sequence.first
    vehicle, person = _who_meet_first(crash)
    told = reported_directions(strike.person, turn_of(strike.vehicle))
    if len(told) != 1 or not told <= CROSSING or abs(person.impact_speed_mps) < _PERSON_STANDS_MPS:
        return None
    axis, at = vehicle.impact_pose.heading_rad, person.impact_pose

    def pose_mirrored(x: np.ndarray, y: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        c, s = math.cos(axis), math.sin(axis)
        ahead, left = (x - at.x_m) * c + (y - at.y_m) * s, (y - at.y_m) * c - (x - at.x_m) * s
        return at.x_m + ahead * c + left * s, at.y_m + ahead * s - left * c

    t = person.trajectory
    x, y = pose_mirrored(t.x_m, t.y_m)
    heading = 2 * axis - t.heading_rad
    start = replace(
        person.initial_pose, x_m=float(x[0]), y_m=float(y[0]), heading_rad=math.remainder(float(heading[0]), math.tau)
    )
    moved = replace(person, initial_pose=start, trajectory=replace(t, x_m=x, y_m=y, heading_rad=heading))
    return _with(crash.hypothesis, moved, 0.0)


def mirror_departure(crash: JudgedCrash) -> ChangedPlan | None:
    """Return the vehicle leaving to the other side, with its objects.

    None if it left straight ahead, which is its own mirror image.
    """
    departure, hypothesis = departure_of(crash.record, crash.sequence), crash.hypothesis
    if departure.side not in (DepartureSide.LEFT, DepartureSide.RIGHT):
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
    return _with(hypothesis, replace(state, trajectory=turned), 0.0, tuple(objects))


class _Mirror:
    """The mirror image across a vehicle's line of travel.

    The line is parallel to its road as far as that exists, and continues straight.
    """

    def __init__(self, network: RoadNetwork, axis: Pose) -> None:
        self._axis = axis
        near = network.nearest_lanes(axis.x_m, axis.y_m, 1.0)
        geometry = network.road_geometry(near[0].lane.road_id) if near else None
        self._line = geometry.line if geometry is not None else None
        self._length_m = geometry.road.length_m if geometry is not None else 0.0
        self._left_m = self._line.project(axis.x_m, axis.y_m)[1] if self._line is not None else 0.0

    def of(self, x_m: float, y_m: float, heading_rad: float) -> tuple[float, float, float]:
        """Return the image of a point and a heading."""
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
    """Return the last moment before the impact at which the vehicle went along its road.

    It is the index, and the pose on the road's line there.
    """
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


# --- moved -----------------------------------------------------------------------------------------------------------
def object_moved(crash: JudgedCrash, settings: VerdictSettings) -> ChangedPlan | None:
    """Return the first object moved along the road, away from the reported point.

    The distance is the one that the verdict allows plus the object's own extent along the road, so that no part of it
    stays within the allowed distance.

    An object along the road would only slide along itself, so it is moved 3 m away from the road. An object across the
    end of a road is not moved (None).

    >>> (tree,) = judged_tree.hypothesis.objects
    >>> (moved,) = object_moved(judged_tree, VerdictSettings()).hypothesis.objects
    >>> tree.length_m, tree.width_m
    (0.4, 0.4)
    >>> 5.4 <= math.dist(tree.pose.xy_m, moved.pose.xy_m) <= 5.0 + math.hypot(0.4, 0.4)  # m; 5 are allowed
    True
    """
    departure, hypothesis = departure_of(crash.record, crash.sequence), crash.hypothesis
    struck = next((event for event in crash.observed.events if event.object_code is not None), None)
    if struck is None or not hypothesis.objects or not departure.objects:
        return None
    state = _leaving(departure, hypothesis)
    first, *rest = hypothesis.objects
    contact, place = struck.contact, struck.departure.place if struck.departure is not None else None
    if KINDS[first.code].form is ObjectForm.LINE:
        if departure.side is DepartureSide.AHEAD:
            return None
        normal = np.array([-math.sin(first.pose.heading_rad), math.cos(first.pose.heading_rad)])
        away = math.copysign(_ASIDE_M, float(normal @ (first.pose.xy_m - state.impact_pose.xy_m)))
        moved = first.pose.xy_m + away * normal
    else:
        along_rad = contact.pose_1.heading_rad if place is None else place.along_rad
        along = np.array([math.cos(along_rad), math.sin(along_rad)])
        extent_m = float(np.ptp(rectangle_corners(first.pose, first.length_m, first.width_m) @ along))
        allowed_m = limits_of(crash.record, settings).max_contact_distance_m
        farther_m = math.copysign(allowed_m + extent_m, float(along @ np.array([contact.x_m, contact.y_m])))
        moved = first.pose.xy_m + farther_m * along
    pose = replace(first.pose, x_m=float(moved[0]), y_m=float(moved[1]))
    return _with(hypothesis, state, 0.0, (replace(first, pose=pose), *rest))


def move_parked(crash: JudgedCrash, parked: int) -> ChangedPlan:
    """Return the parked vehicle of the first contact, 3 m farther from the other vehicle's side."""
    states = {state.vehicle_number: state for state in crash.hypothesis.participants}
    (driven,) = (states[number] for number in crash.sequence.first.pair if number != parked)
    stands = states[parked]
    heading = stands.initial_pose.heading_rad
    normal = np.array([-math.sin(heading), math.cos(heading)])
    away_m = math.copysign(_ASIDE_M, float(normal @ (stands.initial_pose.xy_m - driven.initial_pose.xy_m)))
    dx, dy = (away_m * normal).tolist()
    t = stands.trajectory
    moved = replace(
        stands,
        initial_pose=replace(stands.initial_pose, x_m=stands.initial_pose.x_m + dx, y_m=stands.initial_pose.y_m + dy),
        impact_pose=replace(stands.impact_pose, x_m=stands.impact_pose.x_m + dx, y_m=stands.impact_pose.y_m + dy),
        trajectory=replace(t, x_m=t.x_m + dx, y_m=t.y_m + dy),
    )
    return _with(crash.hypothesis, moved, 0.0)


def _leaving(departure: Departure, hypothesis: Hypothesis) -> ParticipantState:
    return next(each for each in hypothesis.participants if each.vehicle_number == departure.vehicle.number)


def _with(
    hypothesis: Hypothesis, state: ParticipantState, shift_s: float, objects: tuple[FixedObject, ...] | None = None
) -> ChangedPlan:
    states = tuple(state if each.vehicle_number == state.vehicle_number else each for each in hypothesis.participants)
    changed = replace(hypothesis, participants=states, objects=hypothesis.objects if objects is None else objects)
    return ChangedPlan(changed, state.vehicle_number, shift_s)
