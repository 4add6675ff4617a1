"""The traffic around an agent.

It moves as recorded, keeps its distance once the agent does something else, or keeps the conflict
(:mod:`trace_dag.agents.evaluation.persistent`).

Reactive traffic follows the recording while the agent's vehicle is at its recorded place, so that an agent that drives
as recorded has the recorded crash. From the moment it is elsewhere, every other driver continues on its recorded
course, at most at the speed recorded for each place, and keeps its distance from anybody ahead by the intelligent
driver model (:class:`trace_dag.agents.evaluation.baselines.IdmLaneKeeper`). No vehicle leaves its course; people and
parked vehicles follow the recording.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import replace
from enum import StrEnum

import numpy as np

from trace_dag.agents.evaluation.agents import OwnState
from trace_dag.agents.evaluation.baselines import IdmLaneKeeper
from trace_dag.agents.evaluation.loop import AgentDriver
from trace_dag.agents.evaluation.observation import Sensing, Sensor
from trace_dag.common.geometry import FloatArray, arc_lengths
from trace_dag.roads.map.lane_map import path_through
from trace_dag.scenario.cases import Case
from trace_dag.simulation.driving import BodyState, Driver, Pace, Pedals
from trace_dag.simulation.types import Participant

_ELSEWHERE_M = 0.5
"""Simulated vehicles keep to their plans within a few centimetres; a driver sees half a metre."""
_LEAST_COURSE_M = 5.0
_CREEPS_MPS = 0.1


class Traffic(StrEnum):
    """Behaviour of everybody but the agent."""

    RECORDED = "recorded"
    REACTIVE = "reactive"
    PERSISTENT = "persistent"
    SURROUNDING = "surrounding"  # recorded, among the vehicles around the crash


class CourseKeeper(IdmLaneKeeper):
    """Goes along its recorded course no faster than recorded at each place, and keeps its distance."""

    def __init__(self, course_m: FloatArray, speed_mps: FloatArray) -> None:
        self._along_m = arc_lengths(course_m)
        self._speed_mps = speed_mps

    def _desired_mps(self, own: OwnState, at_m: float) -> float:
        return max(float(np.interp(at_m, self._along_m, self._speed_mps)), _CREEPS_MPS)


class ReactiveDriver:
    """A recorded driver who sees where the agent is: a :class:`trace_dag.simulation.driving.Driver`."""

    def __init__(self, watched: Recording, driver: AgentDriver) -> None:
        self.period_s = driver.period_s
        self._watched = watched
        self._driver = driver
        self.has_arrived = True

    def drive(self, time_s: float, states: Mapping[int, BodyState]) -> Pedals | Pace | None:
        return self._driver.drive(time_s, states) if self._watched.is_left(time_s, states) else None


class Recording:
    """The recorded course of the agent's vehicle, and whether the vehicle has left it."""

    def __init__(self, case: Case, ego: int) -> None:
        self._ego = ego
        self._log = case.recorded.vehicle_log(ego)
        self._left = False

    def is_left(self, time_s: float, states: Mapping[int, BodyState]) -> bool:
        """Return whether the vehicle is, or was before, away from its recorded place."""
        if not self._left:
            log, now = self._log, states[self._ego]
            x, y = (float(np.interp(time_s, log.time_s, values)) for values in (log.x_m, log.y_m))
            self._left = math.hypot(now.x_m - x, now.y_m - y) > _ELSEWHERE_M
        return self._left


def reactive_drivers(case: Case, ego: int, *, period_s: float, seed: int) -> dict[int, Driver]:
    """Return drivers, by number, that react to the agent, for all parties but the agent."""
    watched = Recording(case, ego)
    drivers: dict[int, Driver] = {}
    for each in case.going_on:
        if each.number == ego or each.body.is_figure or each.number in case.parked:
            continue
        course = _course(each)
        if course is None:
            continue
        scenario = replace(case.scenario(each.number, period_s=period_s, seed=seed), route=path_through(course[0]))
        sensor = Sensor(each.number, case.bodies, Sensing(), seed)
        drivers[each.number] = ReactiveDriver(watched, AgentDriver(CourseKeeper(*course), scenario, sensor))
    return drivers


def _course(participant: Participant) -> tuple[FloatArray, FloatArray] | None:
    """Return points of the course, shape (n, 2), and the speed recorded at each (m/s); None if it stands or backs."""
    t = participant.trajectory
    points = np.column_stack([t.x_m, t.y_m])
    moved = np.concatenate([[True], np.hypot(*np.diff(points, axis=0).T) > 1e-3])
    points, speed = points[moved], np.asarray(t.speed_mps)[moved]
    if len(points) < 3 or float(speed.min()) < -_CREEPS_MPS or float(arc_lengths(points)[-1]) < _LEAST_COURSE_M:
        return None
    return points, speed
