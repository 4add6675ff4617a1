"""What everybody was going to do: each party's course without the crash, each driver's route and goal.

What tools for driving ask of a scenario, in the crash's local frame. Belongs here: deriving it from a case. Does not
belong here: the files that say it (:mod:`trace_dag.scenario.driving_files`, :mod:`trace_dag.formats`).
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Final

import numpy as np

from trace_dag.evaluation.cases import Case
from trace_dag.evaluation.lane_map import PathFollower, Route
from trace_dag.geometry import FloatArray, Pose, arc_lengths
from trace_dag.sim.types import Participant

STEP_S: Final = 0.1
"""Time between two states of a course."""
COURSE_COLUMNS: Final = ("x_m", "y_m", "z_m", "heading_rad", "speed_mps")

GOAL_LENGTH_M, GOAL_WIDTH_M = 20.0, 4.0
GOAL_HEADING_RAD: Final = 0.5
GOAL_S: Final = 1.0
_ON_THE_ROUTE_M: Final = 2.0  # about half a lane


@dataclass(frozen=True)
class Goal:
    """Where a driver was going: a rectangle of :data:`GOAL_LENGTH_M` by :data:`GOAL_WIDTH_M` along ``pose``, to be
    reached between two times (s) at the pose's heading within :data:`GOAL_HEADING_RAD`."""

    pose: Pose
    from_s: float
    to_s: float


@dataclass(frozen=True, eq=False)
class Drive:
    """One party without the crash. ``course`` has shape (n, 5), a row per :data:`STEP_S`, columns
    :data:`COURSE_COLUMNS`, headings within half a turn. ``route`` and ``goal`` are None for people and for parked
    vehicles, which nobody drives."""

    participant: Participant
    is_parked: bool
    course: FloatArray
    route: Route | None = None
    goal: Goal | None = None

    @property
    def number(self) -> int:
        """The party's number."""
        return self.participant.number

    @property
    def is_driven(self) -> bool:
        """Whether somebody sits at the wheel."""
        return self.route is not None


def drives_of(case: Case) -> tuple[Drive, ...]:
    """What every party of a case was going to do, in its order."""
    return tuple(_drive(case, each) for each in case.going_on)


def course_of(participant: Participant, end_s: float) -> FloatArray:
    """A participant's plan every :data:`STEP_S` up to a time, columns as :class:`Drive` has them. Who stands stays."""
    t = participant.trajectory
    times = np.arange(0.0, end_s + STEP_S / 2, STEP_S)
    if len(t.time_s) < 2:
        pose = participant.initial_pose
        return np.tile([pose.x_m, pose.y_m, pose.z_m, pose.heading_rad, 0.0], (len(times), 1))
    columns = (t.x_m, t.y_m, t.z_m, np.unwrap(t.heading_rad), t.speed_mps)
    course = np.column_stack([np.interp(times, t.time_s, values) for values in columns])
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


def _goal_pose(course: FloatArray, route: Route) -> Pose:
    """The end of the course where that is on the route; else as far along the route as the course is long. A vehicle
    that left the road was going to stay on it."""
    x, y, z, heading, _ = (float(value) for value in course[-1])
    _, offset_m, _ = PathFollower(route.path).locate_many(course[-1:, :2])
    if abs(float(offset_m[0])) <= _ON_THE_ROUTE_M:
        return Pose(x, y, heading, z)
    return route.path.pose(min(float(arc_lengths(course[:, :2])[-1]), route.path.length_m))
