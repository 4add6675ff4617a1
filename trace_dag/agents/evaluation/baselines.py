"""The agents that all others are compared with, registered as entry points of the group ``trace_dag.agents``.

They are simple on purpose, each one idea from the literature with its published constants, and none is tuned to these
crashes.
"""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from trace_dag.agents.evaluation.agents import Action, Motion, Observation, OwnState, Recorded, RoadUser
from trace_dag.common.geometry import FloatArray
from trace_dag.common.paths import Path
from trace_dag.common.units import GRAVITY_MPS2
from trace_dag.roads.map.lane_map import PathFollower
from trace_dag.scenario.cases import Scenario
from trace_dag.scenario.conflicts import time_to_contact_s
from trace_dag.simulation.outlines import Outline

_BESIDE_M = 0.3  # room left beside others
_STEP_S = 0.25  # of prediction
_LOOK_AGAIN_M = 10.0  # for the lane's speed limit
_LEAST_LIMIT_MPS = 5.0
_LEAST_GAP_M = 0.1
_STANDS_MPS = 0.1


class Replay:
    """Drives as recorded and never reacts. Its score is that of the crash itself.

    With another ``pace`` it first changes its speed as drivers do, and then drives at that multiple of the recorded
    speed.
    """

    changes_mps2 = 3.4  # what most drivers find comfortable to brake with: AASHTO Green Book, stopping sight distance

    def __init__(self, pace: str = "1") -> None:
        self._wanted = float(pace)

    def reset(self, scenario: Scenario) -> None:
        self._pace = 1.0
        self._step_mps = self.changes_mps2 * scenario.period_s

    def act(self, observation: Observation) -> Action:
        step = self._step_mps / max(abs(observation.own.speed_mps), self._step_mps)
        self._pace += max(-step, min(step, self._wanted - self._pace))
        return Recorded(self._pace)


class BrakeOnTimeToCollision:
    """The recorded driver with automatic emergency braking.

    Full brakes, along the recorded path, from the moment the time to collision with somebody ahead falls to 1.5 s (both
    keeping their velocity), until it stands. Then it drives on along that path, up to the speed that it had.
    """

    trigger_s = 1.5
    goes_on_mps2 = 1.5

    def reset(self, scenario: Scenario) -> None:
        self._scenario = scenario
        self._path = points_of(scenario.recorded_path)
        self._brakes = False
        self._had_mps: float | None = None  # before it braked

    def act(self, observation: Observation) -> Action:
        speed_mps = observation.own.speed_mps
        danger = time_to_collision_ahead_s(observation, self._scenario) <= self.trigger_s
        if danger and self._had_mps is None:
            self._had_mps = speed_mps
        self._brakes = danger or (self._brakes and speed_mps > _STANDS_MPS)
        if self._had_mps is None:
            return Recorded()
        if self._brakes:
            return Motion(acceleration_mps2=-GRAVITY_MPS2, path_m=self._path)
        return Motion(acceleration_mps2=self.goes_on_mps2 if speed_mps < self._had_mps else 0.0, path_m=self._path)


class CarefulHuman:
    """The careful and competent human driver of UN Regulation No. 157 (annex 3, performance model 1).

    It perceives a risk where somebody ahead is 2 s from touching, both keeping their velocities, or in its way slows
    down harder than 5 m/s2 or is nearer than 2 m. Perceiving takes 0.4 s; 0.75 s later it brakes, up to 0.774 g with
    12.65 m/s3, less hard only where the road gives no more. Once it has reacted it is attentive: without delay. When
    the risk is over it goes on. The model is made for cut-ins, cut-outs and braking ahead on motorways; for crossing
    ways and people it is an extrapolation.
    """

    risk_s = 2.0
    leader_brakes_mps2 = 5.0
    least_gap_m = 2.0
    perceives_s, delay_s = 0.4, 0.75
    most_braking_g = 0.774
    braking_rises_mps3 = 12.65
    goes_on_mps2 = 1.5

    def reset(self, scenario: Scenario) -> None:
        self._scenario = scenario
        self._most_mps2 = min(self.most_braking_g, scenario.friction) * GRAVITY_MPS2
        self._route = PathFollower(scenario.recorded_path)
        self._speeds_mps: dict[int, float] = {}
        self._risk_since_s: float | None = None
        self._has_reacted = False
        self._braking_mps2 = 0.0
        self._pace = 1.0

    def act(self, observation: Observation) -> Action:
        if not self._at_risk(observation):
            self._risk_since_s = None
        elif self._risk_since_s is None:
            self._risk_since_s = observation.time_s
        waits_s = 0.0 if self._has_reacted else self.perceives_s + self.delay_s
        step_s, speed_mps = self._scenario.period_s, abs(observation.own.speed_mps)
        if self._risk_since_s is not None and observation.time_s - self._risk_since_s >= waits_s - step_s / 2:
            self._has_reacted = True
            self._braking_mps2 = min(self._braking_mps2 + self.braking_rises_mps3 * step_s, self._most_mps2)
            lost_mps = self._braking_mps2 * step_s
            self._pace *= max(0.0, 1.0 - lost_mps / max(speed_mps, lost_mps))
        else:
            self._braking_mps2 = 0.0
            self._pace = min(1.0, self._pace + self.goes_on_mps2 * step_s / max(speed_mps, _LEAST_LIMIT_MPS))
        return Recorded(self._pace)

    def _at_risk(self, observation: Observation) -> bool:
        own, body = observation.own, self._scenario.body
        before, self._speeds_mps = self._speeds_mps, {}
        risk = time_to_collision_ahead_s(observation, self._scenario) <= self.risk_s
        at_m, _ = self._route.locate(own.x_m, own.y_m)
        for other in observation.others:
            speed_mps = math.hypot(other.velocity_x_mps, other.velocity_y_mps)
            self._speeds_mps[other.number] = speed_mps
            braking_mps2 = (before.get(other.number, speed_mps) - speed_mps) / self._scenario.period_s
            s_m, offset_m, _ = self._route.locate_many(np.array([[other.x_m, other.y_m]]))
            gap_m = float(s_m[0]) - at_m - (body.length_m + other.length_m) / 2
            if abs(float(offset_m[0])) < (body.width_m + other.width_m) / 2 and gap_m > -body.length_m / 2:
                risk |= braking_mps2 > self.leader_brakes_mps2 or gap_m < self.least_gap_m
        return risk


class IdmLaneKeeper:
    """Keeps to the lanes of its route at the speed limit and its distance from whoever is in its way ahead.

    Treiber, Hennecke and Helbing, Phys. Rev. E 62 (2000) 1805, with Treiber and Kesting's constants for cars on a
    highway (Traffic Flow Dynamics, 2nd ed., table 11.2). It does not see parties that are not yet in its way.
    """

    share_of_limit = 1.0
    time_gap_s = 1.0
    least_gap_m = 2.0
    acceleration_mps2 = 1.0
    comfortable_braking_mps2 = 1.5
    lateral_mps2 = 2.5  # what a bend is taken with

    def reset(self, scenario: Scenario) -> None:
        self._scenario = scenario
        self._body = scenario.body
        self._route = PathFollower(scenario.route)
        self._limit_mps: float | None = None
        self._limit_at_m = 0.0

    def act(self, observation: Observation) -> Action:
        own = observation.own
        at_m, _ = self._route.locate(own.x_m, own.y_m)
        free = self._free(own, at_m)
        acceleration = min(
            (self._behind(own, free, gap_m, speed_mps) for gap_m, speed_mps in self._in_the_way(observation, at_m)),
            default=free,
        )
        if own.speed_mps < 0.1 and acceleration <= 0:
            return Motion(target_speed_mps=0.0)
        return Motion(acceleration_mps2=acceleration)

    def _free(self, own: OwnState, at_m: float) -> float:
        """Return the model's acceleration on a free road (m/s2).

        Above the desired speed it brakes comfortably.
        """
        ratio = max(own.speed_mps, 0.0) / self._desired_mps(own, at_m)
        return max(self.acceleration_mps2 * (1 - ratio**4), -self.comfortable_braking_mps2)

    def _behind(self, own: OwnState, free_mps2: float, gap_m: float, leader_mps: float) -> float:
        """Return the model's acceleration behind a vehicle or person (m/s2), at most full brakes."""
        speed = max(own.speed_mps, 0.0)
        root = 2 * math.sqrt(self.acceleration_mps2 * self.comfortable_braking_mps2)
        wanted_m = self.least_gap_m + max(0.0, speed * self.time_gap_s + speed * (speed - leader_mps) / root)
        interaction = self.acceleration_mps2 * (wanted_m / max(gap_m, _LEAST_GAP_M)) ** 2
        return max(free_mps2 - interaction, -GRAVITY_MPS2)

    def _desired_mps(self, own: OwnState, at_m: float) -> float:
        """Return the lane's speed limit, reduced in bends; without a limit on the map, the initial speed."""
        if self._limit_mps is None or abs(at_m - self._limit_at_m) > _LOOK_AGAIN_M:
            lane_map = self._scenario.lane_map
            match = lane_map.lane_at(own.x_m, own.y_m, own.heading_rad)
            limit = lane_map.speed_limit_mps(match.lane) if match is not None else None
            self._limit_mps = limit or self._limit_mps or max(own.speed_mps, _LEAST_LIMIT_MPS)
            self._limit_at_m = at_m
        stretch_m = own.speed_mps**2 / (2 * self.comfortable_braking_mps2) + 5.0
        bend = math.sqrt(self.lateral_mps2 / max(self._route.sharpest_1pm(at_m, at_m + stretch_m), 1e-3))
        return max(min(self.share_of_limit * self._limit_mps, bend), 1.0)

    def _in_the_way(self, observation: Observation, at_m: float) -> list[tuple[float, float]]:
        """Return the gap (m) and speed along the route (m/s) of each body in the way ahead."""
        return [
            (float(gap[0]), float(along[0]))
            for other in observation.others
            for gap, along, there in (self._encounter(other, np.zeros(1), at_m),)
            if there[0]
        ]

    def _encounter(
        self, other: RoadUser, times_s: FloatArray, at_m: float
    ) -> tuple[FloatArray, FloatArray, NDArray[np.bool_]]:
        """Return the gap along the route (m), the other's speed along it (m/s) and whether it is in the way.

        Each has shape (n,) for the given times from now; the other keeps its velocity.
        """
        velocity = np.array([other.velocity_x_mps, other.velocity_y_mps])
        s_m, offset_m, course = self._route.locate_many(np.array([other.x_m, other.y_m]) + times_s[:, None] * velocity)
        c, s = np.abs(np.cos(other.heading_rad - course)), np.abs(np.sin(other.heading_rad - course))
        half_across = (other.length_m * s + other.width_m * c) / 2
        half_along = (other.length_m * c + other.width_m * s) / 2
        there = (s_m > at_m) & (np.abs(offset_m) <= self._body.width_m / 2 + half_across + _BESIDE_M)
        along = velocity[0] * np.cos(course) + velocity[1] * np.sin(course)
        return s_m - at_m - half_along - self._body.length_m / 2, along, there


class CautiousLaneKeeper(IdmLaneKeeper):
    """The lane keeper, slower and farther off, which also gives way.

    It looks four seconds ahead, takes others to keep their velocity, and stops short of where one of them will be in
    its way when it could be there.
    """

    share_of_limit = 0.85
    time_gap_s = 2.0
    horizon_s = 4.0
    margin_s = 1.0
    emergency_s = 1.5
    _times_s = np.arange(0.0, horizon_s + _STEP_S / 2, _STEP_S)

    def act(self, observation: Observation) -> Action:
        if time_to_collision_ahead_s(observation, self._scenario) <= self.emergency_s:
            return Motion(acceleration_mps2=-GRAVITY_MPS2)
        return super().act(observation)

    def _in_the_way(self, observation: Observation, at_m: float) -> list[tuple[float, float]]:
        found = []
        speed = max(observation.own.speed_mps, 1.0)
        for other in observation.others:
            gap, along, there = self._encounter(other, self._times_s, at_m)
            if gap[0] < 0 and along[0] > 0:
                continue  # follows or overtakes: to keep off is up to it
            if there[0]:
                found.append((float(gap[0]), float(along[0])))
            meets = there & (np.abs(gap / speed - self._times_s) <= self.margin_s)
            if meets.any():
                first = int(meets.argmax())
                found.append((float(gap[first]), min(float(along[first]), 0.0)))
        return found


def time_to_collision_ahead_s(observation: Observation, scenario: Scenario) -> float:
    """Return the least time to collision with anybody ahead if all keep velocity and heading, s.

    Infinity if there is none. Bodies that come from behind are ignored, because braking would not help.
    """
    own, body = observation.own, scenario.body
    mine = Outline(own.x_m, own.y_m, own.heading_rad, body.length_m / 2, body.width_m / 2)
    velocity = own.velocity_x_mps, own.velocity_y_mps
    ahead_x, ahead_y = math.cos(own.heading_rad), math.sin(own.heading_rad)
    least_s = math.inf
    for other in observation.others:
        if (other.x_m - own.x_m) * ahead_x + (other.y_m - own.y_m) * ahead_y <= 0:
            continue
        theirs = Outline(other.x_m, other.y_m, other.heading_rad, other.length_m / 2, other.width_m / 2)
        least_s = min(least_s, time_to_contact_s(mine, velocity, theirs, (other.velocity_x_mps, other.velocity_y_mps)))
    return least_s


def points_of(path: Path) -> FloatArray:
    """Return the points of a path, shape (n, 2), in the form that a motion takes."""
    return np.column_stack([path.x_m, path.y_m])
