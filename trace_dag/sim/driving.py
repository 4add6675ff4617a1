"""The interface for drivers that take over a participant from its plan, such as agents under test.

Belongs here: the contract between back-ends and drivers, in the vehicle's own terms. Agents and their observations are
in :mod:`trace_dag.evaluation`.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Protocol


@dataclass(frozen=True, slots=True)
class BodyState:
    """The present state of a participant: centre of its body (m, local frame), heading (rad), velocity (m/s), yaw rate
    (rad/s)."""

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
        """Speed along the body, negative backward."""
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


class Driver(Protocol):
    """Drives one participant until its first contact; after that it is not driven."""

    period_s: float
    """How often it is asked; what it does is held until the next time."""

    def drive(self, time_s: float, states: Mapping[int, BodyState]) -> Pedals | None:
        """The pedals and steering for now, given the true state of every participant by number; None keeps to the
        plan."""
