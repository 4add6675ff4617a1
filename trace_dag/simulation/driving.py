"""The interface for drivers that take over a participant from its plan, such as agents under test.

Belongs here: the contract between back-ends and drivers, in the vehicle's own terms. Agents and their observations are
in :mod:`trace_dag.agents.evaluation`.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Protocol


@dataclass(frozen=True, slots=True)
class BodyState:
    """The present state of a participant.

    Centre of its body (m, local frame), heading (rad), velocity (m/s), yaw rate (rad/s).
    """

    number: int
    x_m: float
    y_m: float
    z_m: float
    heading_rad: float
    velocity_x_mps: float
    velocity_y_mps: float
    yaw_rate_rps: float

    @property
    def speed_mps(self) -> float:
        """Return the speed along the body, negative backward."""
        return self.velocity_x_mps * math.cos(self.heading_rad) + self.velocity_y_mps * math.sin(self.heading_rad)


@dataclass(frozen=True, slots=True)
class Pedals:
    """A driver's command: angle of the front wheels (rad, positive to the left), throttle and brake from 0 to 1.

    The vehicle follows as far as its tyres, its power and its steering allow. ``reverse`` selects the reverse gear.
    """

    steer_rad: float = 0.0
    throttle: float = 0.0
    brake: float = 0.0
    reverse: bool = False


@dataclass(frozen=True, slots=True)
class Pace:
    """A driver's command to follow the plan at a multiple of its pace, from the present place.

    1 means as planned, 0 to wait.
    """

    pace: float = 1.0


class PlanClock:
    """The time of a plan while it is followed at changing paces."""

    __slots__ = ("_plan_s", "_since_s", "pace")

    def __init__(self) -> None:
        self._since_s = self._plan_s = 0.0
        self.pace = 1.0

    def at(self, time_s: float) -> float:
        """Return the time of the plan at a time of the run, s."""
        return self._plan_s + self.pace * (time_s - self._since_s)

    def set_pace(self, time_s: float, pace: float) -> None:
        """Continue at another pace from a time of the run on."""
        if pace != self.pace:
            self._since_s, self._plan_s, self.pace = time_s, self.at(time_s), pace

    @property
    def is_as_planned(self) -> bool:
        """Return whether plan and run have the same time."""
        return self.pace == 1.0 and self._since_s == self._plan_s


class Driver(Protocol):
    """A driver of one participant until its first contact."""

    period_s: float
    """Rate at which it is asked; its answer is held until the next time."""

    @property
    def has_arrived(self) -> bool:
        """Return whether it need not drive on; a run without a contact ends once all drivers have arrived."""

    def drive(self, time_s: float, states: Mapping[int, BodyState]) -> Pedals | Pace | None:
        """Return the pedals and steering for now, from the true states of all participants by number.

        A :class:`Pace` of the plan is the only command for people; None keeps to the plan.
        """
