"""Intended drives: each party's course without the crash, each driver's route and goal.

Driving tools need this from a scenario, in the crash's local frame. Belongs here: deriving it from a case. Does not
belong here: the files with it (:mod:`trace_dag.scenario.driving_files`, :mod:`trace_dag.export.formats`).
"""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from typing import Final

import numpy as np

from trace_dag.common.geometry import FloatArray, Pose, arc_lengths, gaps_m
from trace_dag.crash.parties import trailer_body
from trace_dag.roads.map.lane_map import PathFollower, Route
from trace_dag.scenario.cases import Case
from trace_dag.simulation.towing import pulled_body
from trace_dag.simulation.types import Participant

STEP_S: Final = 0.1
"""Time between two states of a course."""
COURSE_COLUMNS: Final = ("x_m", "y_m", "z_m", "heading_rad", "speed_mps")

GOAL_LENGTH_M, GOAL_WIDTH_M = 20.0, 4.0
GOAL_HEADING_RAD: Final = 0.5
GOAL_S: Final = 1.0
_ON_THE_ROUTE_M: Final = 2.0  # about half a lane


@dataclass(frozen=True)
class Goal:
    """A driver's goal: a rectangle along ``pose`` to be reached between two times (s).

    It is :data:`GOAL_LENGTH_M` by :data:`GOAL_WIDTH_M`, at the pose's heading within :data:`GOAL_HEADING_RAD`.
    """

    pose: Pose
    from_s: float
    to_s: float


@dataclass(frozen=True, eq=False)
class Drive:
    """One body without the crash: a party, or the trailer of one.

    ``course`` has shape (n, 5), a row per :data:`STEP_S`, columns :data:`COURSE_COLUMNS`, headings within half a turn.
    ``route`` and ``goal`` are None for people, parked vehicles and trailers.
    """

    participant: Participant
    is_parked: bool
    course: FloatArray
    route: Route | None = None
    goal: Goal | None = None

    @property
    def number(self) -> int:
        """Return the party's number, or the body's of a trailer."""
        return self.participant.number

    @property
    def is_driven(self) -> bool:
        """Return whether the body has a driver."""
        return self.route is not None


def drives_of(case: Case) -> tuple[Drive, ...]:
    """Return the intended drive of every party of a case, in its order, then of every trailer.

    A trailer follows its vehicle.
    """
    parties = tuple(_drive(case, each) for each in case.going_on)
    return *parties, *(trailer for each in parties if (trailer := _trailer(each)) is not None)


def meets(own: Drive, other: Drive) -> bool:
    """Return whether two bodies would touch, each on its course."""
    (x1, y1, _, h1, _), (x2, y2, _, h2, _) = own.course.T, other.course.T
    (size_1, size_2) = ((each.body.length_m, each.body.width_m) for each in (own.participant, other.participant))
    return bool((gaps_m((x1, y1, h1), size_1, (x2, y2, h2), size_2) < 0.0).any())


def course_of(participant: Participant, end_s: float) -> FloatArray:
    """Return a participant's plan every :data:`STEP_S` up to a time, with the columns of :class:`Drive`.

    After its end the motion continues with its last velocity. The speed of a skidding vehicle is that over the ground.
    """
    t = participant.trajectory
    times = np.arange(0.0, end_s + STEP_S / 2, STEP_S)
    if len(t.time_s) < 2:
        pose = participant.initial_pose
        return np.tile([pose.x_m, pose.y_m, pose.z_m, pose.heading_rad, 0.0], (len(times), 1))
    columns = (t.x_m, t.y_m, t.z_m, np.unwrap(t.heading_rad), t.speed_mps)
    course = np.column_stack([np.interp(times, t.time_s, values) for values in columns])
    last_mps = np.diff([t.x_m[-2:], t.y_m[-2:]])[:, 0] / (t.time_s[-1] - t.time_s[-2])
    course[:, :2] += np.outer(np.maximum(times - t.time_s[-1], 0.0), last_mps)
    skids = times >= participant.skids_from_s
    course[skids, 4] = np.hypot(*np.gradient(course[:, :2], STEP_S, axis=0).T)[skids]
    course[:, 3] = np.remainder(course[:, 3] + math.pi, math.tau) - math.pi
    return course


def _drive(case: Case, participant: Participant) -> Drive:
    parked = participant.number in case.parked
    course = course_of(participant, case.end_s)
    if parked or participant.body.is_figure:
        return Drive(participant, parked, course)
    route = case.route(participant.number)
    last_s = (len(course) - 1) * STEP_S
    return Drive(participant, parked, course, route, Goal(_goal_pose(course, route), last_s - GOAL_S, last_s))


def _trailer(drive: Drive) -> Drive | None:
    """Return the trailer of a party on the tractrix of its hitch, from its initial place; None without one."""
    puller, body = drive.participant, pulled_body(drive.participant)
    if body is None or puller.trailer is None:
        return None
    x, y, z, heading, _ = drive.course.T
    trailing = puller.trailer.following((x, y, heading), puller.body.length_m, from_rad=puller.trailer_heading_rad)
    trailer_x, trailer_y, _ = puller.trailer.behind((x, y, heading), puller.body.length_m, trailing)
    turned = np.remainder(trailing + math.pi, math.tau) - math.pi
    hitch_x, hitch_y = puller.trailer.hitch((x, y, heading), puller.body.length_m)
    ahead_mps = (np.gradient(hitch_x) * np.cos(trailing) + np.gradient(hitch_y) * np.sin(trailing)) / STEP_S
    course = np.column_stack([trailer_x, trailer_y, z, turned, ahead_mps])
    start = Pose(float(trailer_x[0]), float(trailer_y[0]), float(turned[0]), float(z[0]))
    own = replace(puller, number=trailer_body(puller.number), body=body, initial_pose=start, trailer=None)
    return Drive(own, drive.is_parked, course)


def _goal_pose(course: FloatArray, route: Route) -> Pose:
    """Return the end of the course if it is on the route; else the point at the course's length along the route.

    A vehicle that left the road was going to stay on it.
    """
    x, y, z, heading, _ = (float(value) for value in course[-1])
    _, offset_m, _ = PathFollower(route.path).locate_many(course[-1:, :2])
    if abs(float(offset_m[0])) <= _ON_THE_ROUTE_M:
        return Pose(x, y, heading, z)
    return route.path.pose(min(float(arc_lengths(course[:, :2])[-1]), route.path.length_m))
