"""A person or an animal in a run: moved along its plan until a vehicle touches it, and a MuJoCo figure from then on.

Belongs here: the state of a person or animal in a run. The figure's segments are in
:mod:`trace_dag.simulation.figures`, their physics in :mod:`trace_dag.simulation.scene`.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from itertools import pairwise
from typing import NamedTuple

import numpy as np

from trace_dag.common.errors import Failure
from trace_dag.simulation.driving import BodyState, Pace, Pedals, PlanClock
from trace_dag.simulation.figures import RIDING, Posture, root_height, walking
from trace_dag.simulation.outlines import Outline
from trace_dag.simulation.plan import SampledTrajectory
from trace_dag.simulation.quadrupeds import Stance, trotting
from trace_dag.simulation.surface import Ground
from trace_dag.simulation.types import Body, BodyKind, Participant

_THROWN_REACH = 0.62  # of the stature, of an animal its length: how far limbs reach from the centre of mass
REST_MPS, REST_RPS = 0.08, 0.1  # of the pelvis, and of every joint: dampers let a raised limb fall slowly
_REST_S = 0.1
_HALF_LANE_M = 1.8  # of a lane of 12 ft


@dataclass(frozen=True)
class PersonModel:
    """A person's or animal's body; its centre of mass is in the middle of it."""

    body: Body
    cg_ahead_m: float = 0.0

    @property
    def thrown_reach_m(self) -> float:
        """Return the reach of its limbs once it is thrown."""
        return _THROWN_REACH * (self.body.length_m if self.body.kind is BodyKind.ANIMAL else self.body.height_m)


class PersonTouch(NamedTuple):
    """A point where a person touches a vehicle.

    It has the depth (m), the place (m), the unit normal from the vehicle to the person, and the force on the person
    (N).
    """

    depth_m: float
    point: list[float]
    normal: tuple[float, ...]
    force: tuple[float, ...]


class Person:
    """State of a person at the centre of the outline until touched, and at the centre of mass from then on."""

    def __init__(self, participant: Participant, plan: SampledTrajectory, step_s: float) -> None:
        self.number = participant.number
        self.model = PersonModel(participant.body)
        self.plan_end_s = plan.end_s
        self.ground = Ground(math.inf, math.inf, participant.initial_pose.z_m, 0.0, 0.0)  # not looked at yet
        self.z = participant.initial_pose.z_m
        self.crashed = False
        """True once it was touched."""
        self.stops = False
        self.yaw_rate = 0.0
        self.x = self.y = self.heading = self.vx = self.vy = 0.0
        self.posture: tuple[float, ...] = ()
        """Height of the centre above the road (m), pitch and roll (rad), landmarks (m), as of the last look."""
        self._plan = plan
        self._clock = PlanClock()
        self._step_s = step_s
        self._travelled = _travelled(plan)
        self._still_since_s = math.inf
        self._looked_s = 0.0
        self.walk(0.0)

    @property
    def reach_m(self) -> float:
        """Return the radius of its outline about its centre, seen from above."""
        body = self.model.body
        if self.crashed:
            return self.model.thrown_reach_m * math.sqrt(2)
        return math.hypot(body.length_m / 2, body.width_m / 2)

    def command(self, wanted: Pedals | Pace | None, time_s: float) -> None:
        """Walk at a pace from now on; None means as planned. Raises :class:`Failure` for pedals."""
        if isinstance(wanted, Pedals):
            raise Failure(f"participant {self.number} is a person or an animal and has no pedals; expected a pace")
        self._clock.set_pace(time_s, wanted.pace if wanted else 1.0)

    def walk(self, time_s: float) -> None:
        """Move along the plan to a time."""
        at = self._clock.at(time_s) / self._step_s
        k = min(int(at + 1e-9), len(self._plan) - 1)
        x, y, vx, vy, _, _, _, _, heading, _ = self._plan.row(k)
        into_s = (at - k) * self._step_s
        if k == len(self._plan) - 1:
            vx = vy = into_s = 0.0  # the plan is over: it stands
        pace = self._clock.pace
        self.x, self.y, self.heading = x + vx * into_s, y + vy * into_s, heading
        self.vx, self.vy = pace * vx, pace * vy

    def in_the_lane_s(self, vehicle: Outline, now_s: float) -> float:
        """Return the time that the person was in the lane of the striking vehicle.

        In the lane means within half a lane, or half the vehicle, of its line.
        """
        now = min(int(now_s / self._step_s + 1e-9) + 1, len(self._plan))
        x, y = self._plan.table[:now, 0], self._plan.table[:now, 1]
        ahead_x, ahead_y = vehicle.ahead
        aside_m = np.abs((y - vehicle.y_m) * ahead_x - (x - vehicle.x_m) * ahead_y)
        outside = np.flatnonzero(aside_m > max(_HALF_LANE_M, vehicle.half_width_m))
        return max(now_s - int(outside[-1]) * self._step_s, 0.0) if len(outside) else 0.0

    def walking_posture(self, time_s: float) -> Posture | Stance:
        """Return the figure's posture at a time before it is touched."""
        body = self.model.body
        if body.kind is BodyKind.CYCLIST:
            return RIDING
        if body.kind is BodyKind.CONVEYANCE:
            return Posture()
        k = min(int(self._clock.at(time_s) / self._step_s + 1e-9), len(self._plan) - 1)
        gait = trotting if body.kind is BodyKind.ANIMAL else walking
        return gait(body.height_m, math.hypot(self.vx, self.vy), self._travelled[k])

    def standing_height(self, posture: Posture | Stance) -> float:
        """Return the height of the figure's root above the road (m) in a posture."""
        return root_height(self.model.body, posture)

    def look_for_rest(self, speed_mps: float, fastest_joint: float, now_s: float) -> None:
        """Record whether a touched person still moves, to find later when the person came to rest."""
        if speed_mps > REST_MPS or fastest_joint > REST_RPS:
            self._still_since_s = math.inf
        else:
            self._still_since_s = min(self._still_since_s, now_s)
        self._looked_s = now_s

    @property
    def at_rest(self) -> bool:
        """Return whether the person does not move, and after a touch has not moved for a tenth of a second."""
        if self.crashed:
            return self._looked_s - self._still_since_s >= _REST_S
        return math.hypot(self.vx, self.vy) < REST_MPS

    def outline(self) -> Outline:
        """Return the outline on the road, seen from above; for a thrown person a square around hands and feet."""
        body = self.model.body
        if self.crashed:
            half = self.model.thrown_reach_m
            return Outline(self.x, self.y, self.heading, half, half)
        return Outline(self.x, self.y, self.heading, body.length_m / 2, body.width_m / 2)

    def body_state(self) -> BodyState:
        """Return the state now."""
        return BodyState(self.number, self.x, self.y, self.z, self.heading, self.vx, self.vy, self.yaw_rate)

    def log_row(self) -> tuple[float, ...]:
        """Return the state for the recorder: that of a vehicle without controls, and the posture."""
        state = (self.x, self.y, self.z, self.heading, self.vx, self.vy, self.yaw_rate, 0.0, 0.0, 0.0)
        return (*state, *self.posture)


def _travelled(plan: SampledTrajectory) -> list[float]:
    """Return the distance along the plan at each of its rows."""
    total, found = 0.0, [0.0]
    for (x, y), (then_x, then_y) in pairwise(plan.table[:, :2].tolist()):
        total += math.hypot(then_x - x, then_y - y)
        found.append(total)
    return found
