"""The interface of an agent: it is given a scenario, then observes and acts, many times a second.

The whole interface of an agent under test, in the project's one frame (local, x east, y north, metres, radians
counter-clockwise from east, m/s)::

    class Polite:
        def reset(self, scenario: Scenario) -> None: ...
        def act(self, observation: Observation) -> Action: ...
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Protocol

from trace_dag.common.geometry import FloatArray
from trace_dag.scenario.cases import Scenario
from trace_dag.simulation.driving import Pedals
from trace_dag.simulation.types import BodyKind


@dataclass(frozen=True, slots=True)
class RoadUser:
    """A body as seen: what it is, centre (m), heading (rad), velocity (m/s), size (m).

    Others' values carry the sensor's noise. A person's number is 1000 + ``PER_NO``; the size is of the person with what
    the person rides.
    """

    number: int
    kind: BodyKind
    x_m: float
    y_m: float
    heading_rad: float
    velocity_x_mps: float
    velocity_y_mps: float
    length_m: float
    width_m: float


@dataclass(frozen=True, slots=True)
class OwnState:
    """The agent's own vehicle, exactly: centre (m), heading (rad), speed along the body (m/s, negative backward)."""

    x_m: float
    y_m: float
    z_m: float
    heading_rad: float
    velocity_x_mps: float
    velocity_y_mps: float
    speed_mps: float
    yaw_rate_rps: float


@dataclass(frozen=True, slots=True)
class Observation:
    """An agent's observation: the time since the scenario began (s), its own state, and the others in sight."""

    time_s: float
    own: OwnState
    others: tuple[RoadUser, ...]


@dataclass(frozen=True, eq=False, slots=True)
class Motion:
    """A wish that the vehicle's own controller turns into pedals: how fast, and where.

    Either a target speed (m/s, 0 or more) or an acceleration (m/s2); where neither is given the speed is kept. The
    wheels are turned to ``steer_rad`` if that is given, else along ``path_m`` (x and y, shape (n, 2), two points or
    more), else along the scenario's route.
    """

    target_speed_mps: float | None = None
    acceleration_mps2: float | None = None
    steer_rad: float | None = None
    path_m: FloatArray | None = None


@dataclass(frozen=True, slots=True)
class Recorded:
    """Let the vehicle do what was recorded for this time: the human driver goes on.

    A ``pace`` other than 1 multiplies the recorded speed at each place (0 or more).
    """

    pace: float = 1.0


Action = Pedals | Motion | Recorded
"""An agent's answer: pedals, a motion, or the recorded driver. Anything else is a fault."""


class Agent(Protocol):
    """Something that drives. One instance drives many scenarios, one after the other."""

    def reset(self, scenario: Scenario) -> None:
        """Begin a new scenario; nothing of an earlier one may influence it."""

    def act(self, observation: Observation) -> Action:
        """Return the action until the next call."""


class AgentFault(Exception):  # noqa: N818 - a finding about an agent, counted, not an error of ours
    """An agent that violated the interface, as the message describes. It scores as faulty for the scenario."""
