"""Cases of evaluations: a crash, or a variation of one, as a scenario in which an agent can replace any participant."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from functools import cached_property

import numpy as np

from trace_dag.common.geometry import Pose
from trace_dag.common.paths import Path, straight, through_points
from trace_dag.crash.parties import trailer_body
from trace_dag.roads.map.lane_map import LaneMap, Route
from trace_dag.roads.map.network import RoadNetwork
from trace_dag.scenario.lights import LightCycle, Lights, StopLine, light_ahead, lit_lines
from trace_dag.simulation.driving import BodyState
from trace_dag.simulation.objects import FixedObject
from trace_dag.simulation.states import Trajectory
from trace_dag.simulation.towing import pulled_body
from trace_dag.simulation.types import Body, Contact, Participant, SimulationLog
from trace_dag.simulation.vehicles import VehicleModel, vehicle_model

BEYOND_IMPACT_S = 5.0
"""Time that a scenario goes on after the recorded impact: a crash avoided by then is avoided."""

MOST_TIMES = 2.0
"""An agent that takes so many times the recorded time for its way has not finished it."""

_STANDING_M = 1.0
_STANDING_ROUTE_M = 50.0
_SMOOTHING_M = 0.5
_EXTENSION_STEP_S = 1.0


@dataclass(frozen=True, eq=False)
class Scenario:
    """The scenario that an agent is given before it drives: its vehicle, the map, its destination.

    Nothing about the crash.

    ``route`` follows lanes as far as the vehicle did; ``recorded_path`` is its real path, without the crash.
    ``period_s`` is the time between two calls of ``act``.
    """

    vehicle: VehicleModel
    lane_map: LaneMap
    route: Path
    recorded_path: Path
    period_s: float
    friction: float
    seed: int

    @property
    def body(self) -> Body:
        """Return the body the agent drives."""
        return self.vehicle.body


@dataclass(frozen=True, eq=False)
class Case:
    """A crash to drive in.

    ``participants`` start as recorded and plan past the impact, at ``impact_time_s``, as if it had not happened;
    ``recorded`` is the simulated crash. ``case_id`` is the crash's key or a variation's. ``parked``: numbers of
    vehicles without drivers. ``departed``: the vehicle that left the road by itself, to strike one of the ``objects``
    or to overturn; None if two parties met. ``parts``: the initiator and the responder, by number, as far as reported.
    ``lights``: their first reading.
    """

    case_id: str
    key: str
    network: RoadNetwork
    xodr: bytes
    friction: float
    participants: tuple[Participant, ...]
    impact_time_s: float
    recorded: SimulationLog
    parked: frozenset[int] = frozenset()
    departed: int | None = None
    objects: tuple[FixedObject, ...] = ()
    parts: Mapping[int, str] = field(default_factory=dict)
    lights: Lights | None = None

    @property
    def contact(self) -> Contact | None:
        """Return the recorded first contact; None for a near miss."""
        return self.recorded.first_contact

    @property
    def pair(self) -> tuple[int, int]:
        """Return the numbers of the two parties that collided first, the lower one first.

        For a near miss these are the first two participants; for a departure, twice the vehicle that left the road.
        """
        if self.departed is not None:
            return self.departed, self.departed
        contact = self.contact
        numbers = (contact.number_1, contact.number_2) if contact else [each.number for each in self.participants[:2]]
        low, high = sorted(numbers)
        return low, high

    @property
    def striking(self) -> int:
        """Return the number of the party that closed in faster at the recorded contact.

        For a near miss or a departure it is the first one of the pair.
        """
        contact = self.contact
        if contact is None or self.departed is not None:
            return self.pair[0]
        nx, ny = contact.normal_x, contact.normal_y  # from body 1 to body 2
        toward_2 = contact.velocity_1_mps[0] * nx + contact.velocity_1_mps[1] * ny
        toward_1 = -contact.velocity_2_mps[0] * nx - contact.velocity_2_mps[1] * ny
        return contact.number_2 if toward_1 > toward_2 else contact.number_1

    def role(self, number: int) -> str:
        """Return a vehicle's role in the crash: ``departing``, ``striking`` or ``struck``."""
        if self.departed is not None:
            return "departing"
        return "striking" if number == self.striking else "struck"

    @cached_property
    def bodies(self) -> dict[int, Body]:
        """Return the bodies of all participants, then those of their trailers, by number."""
        pulled = {trailer_body(each.number): pulled_body(each) for each in self.participants}
        parties = {each.number: each.body for each in self.participants}
        return parties | {number: body for number, body in pulled.items() if body is not None}

    def participant(self, number: int) -> Participant:
        """Return a participant as planned."""
        return next(each for each in self.participants if each.number == number)

    @property
    def end_s(self) -> float:
        """Return the end of the evaluation of an agent that drives at the recorded pace."""
        return self.impact_time_s + BEYOND_IMPACT_S

    @cached_property
    def going_on(self) -> tuple[Participant, ...]:
        """Return all participants with plans up to the end of an evaluation, however slow the agent is.

        The plan of a skidding vehicle is kept, since it slides on by itself. No participant loses control as a
        consequence of the crash, which may not happen.
        """
        return tuple(self._going_on(each) for each in self.participants)

    def _going_on(self, participant: Participant) -> Participant:
        losses = participant.losses_of_control
        if self.departed is None:
            losses = tuple(loss for loss in losses if loss.from_s < self.impact_time_s)
        trajectory = participant.trajectory
        if math.isinf(participant.skids_from_s):
            trajectory = extend_motion(trajectory, MOST_TIMES * self.end_s + _EXTENSION_STEP_S)
        return replace(participant, trajectory=trajectory, losses_of_control=losses)

    @cached_property
    def _lit_lines(self) -> list[tuple[StopLine, LightCycle]]:
        return lit_lines(self.network, self.lights)

    def light_ahead(self, number: int, state: BodyState, time_s: float) -> tuple[str, float] | tuple[None, None]:
        """Return the colour of the next light ahead of a participant, and the way to its stop line (m)."""
        return light_ahead(self._lit_lines, state, self.bodies[number].length_m, time_s)

    @cached_property
    def _ways(self) -> dict[int, tuple[Route, Path]]:
        """Return the cache of routes and recorded paths by participant, which are the same for every agent."""
        return {}

    def route(self, number: int) -> Route:
        """Return the route along lanes of a participant."""
        return self._way(number)[0]

    def _way(self, number: int) -> tuple[Route, Path]:
        if number not in self._ways:
            own = self.participant(number)
            recorded = path_of(own.trajectory, own.initial_pose)
            self._ways[number] = LaneMap(self.network).route_along(recorded, own.initial_pose), recorded
        return self._ways[number]

    def scenario(self, ego: int, *, period_s: float, seed: int) -> Scenario:
        """Return the scenario of the agent in a participant's place."""
        own = self.participant(ego)
        route, recorded = self._way(ego)
        return Scenario(
            vehicle=vehicle_model(own.body, own.trailer),
            lane_map=LaneMap(self.network),
            route=route.path,
            recorded_path=recorded,
            period_s=period_s,
            friction=self.friction,
            seed=seed,
        )


def extend_motion(trajectory: Trajectory, until_s: float) -> Trajectory:
    """Return the same motion, extended straight at its last speed to a time.

    It is unchanged if it already lasts that long or is a single point.
    """
    t = trajectory
    if len(t.time_s) < 2 or float(t.time_s[-1]) >= until_s:
        return t
    steps = math.ceil((until_s - float(t.time_s[-1])) / _EXTENSION_STEP_S)
    more = np.arange(1, steps + 1) * _EXTENSION_STEP_S
    heading, speed = float(t.heading_rad[-1]), float(t.speed_mps[-1])
    return Trajectory(
        time_s=np.concatenate([t.time_s, t.time_s[-1] + more]),
        x_m=np.concatenate([t.x_m, t.x_m[-1] + more * speed * math.cos(heading)]),
        y_m=np.concatenate([t.y_m, t.y_m[-1] + more * speed * math.sin(heading)]),
        z_m=np.concatenate([t.z_m, np.full(steps, t.z_m[-1])]),
        heading_rad=np.concatenate([t.heading_rad, np.full(steps, heading)]),
        speed_mps=np.concatenate([t.speed_mps, np.full(steps, speed)]),
    )


def path_of(trajectory: Trajectory, start: Pose) -> Path:
    """Return the path of a motion in its direction of travel; straight ahead for a standing participant."""
    points = np.column_stack([trajectory.x_m, trajectory.y_m, trajectory.z_m])
    if float(np.hypot(*np.diff(points[:, :2], axis=0).T).sum()) < _STANDING_M:
        return straight(start, back_m=0.0, ahead_m=_STANDING_ROUTE_M)
    return through_points(points, sigma_m=_SMOOTHING_M)
