"""The loop: an agent seated in a simulation, asked at its own rate, its answers checked and carried out.

A motion that an agent wishes for becomes pedals: along by acceleration, across by pure pursuit of a path (Coulter,
Implementation of the Pure Pursuit Path Tracking Algorithm, CMU-RI-TR-92-01): the front wheels are turned to the arc
that leads the rear axle to a point of the path some way ahead.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping
from contextlib import contextmanager

from trace_dag.agents.evaluation.agent_protocol import describe_exception, problem_of
from trace_dag.agents.evaluation.agents import Agent, AgentFault, Motion, OwnState, Recorded
from trace_dag.agents.evaluation.observation import Sensor
from trace_dag.common.geometry import FloatArray
from trace_dag.common.units import GRAVITY_MPS2
from trace_dag.roads.map.lane_map import PathFollower, path_through
from trace_dag.scenario.cases import Scenario
from trace_dag.scenario.progress import Arrival
from trace_dag.simulation.driving import BodyState, Pace, Pedals

_SPEED_GAIN = 2.0  # 1/s
_LOOKAHEAD_S, _LEAST_LOOKAHEAD_M = 0.6, 3.5
_STANDSTILL_MPS = 0.3
_HOLDING_BRAKE = 0.5


class AgentDriver:
    """An agent at the wheel of one participant; a :class:`trace_dag.simulation.driving.Driver`.

    Any error of the agent becomes an :class:`AgentFault` with its cause and time. A foreign agent is an
    :class:`trace_dag.agents.evaluation.agent_process.AgentProcess`; an agent that is called directly is trusted with
    this process.
    """

    def __init__(self, agent: Agent, scenario: Scenario, sensor: Sensor, arrival: Arrival | None = None) -> None:
        self._arrival = arrival
        self.period_s = scenario.period_s
        self._agent = agent
        self._sensor = sensor
        self._controller = MotionController(scenario)
        with _faults("reset"):
            agent.reset(scenario)

    @property
    def has_arrived(self) -> bool:
        return self._arrival is None or self._arrival.reached

    def drive(self, time_s: float, states: Mapping[int, BodyState]) -> Pedals | Pace | None:
        """See :class:`trace_dag.simulation.driving.Driver`. Raises :class:`AgentFault`."""
        if self._arrival is not None:
            self._arrival.look(time_s, states)
        observation = self._sensor.observe(time_s, states)
        with _faults(f"act at {time_s:.2f} s"):
            action = self._agent.act(observation)
        problem = problem_of(action)
        if problem:
            raise AgentFault(f"act at {time_s:.2f} s: {problem}")
        if isinstance(action, Recorded):
            return Pace(action.pace)
        if isinstance(action, Pedals):
            return action
        try:
            return self._controller.pedals(action, observation.own)
        except ValueError as error:
            raise AgentFault(f"act at {time_s:.2f} s: {error}") from error


@contextmanager
def _faults(when: str) -> Iterator[None]:
    """Turn any exception of an agent into an :class:`AgentFault` that includes ``when``."""
    try:
        yield
    except AgentFault as fault:
        raise AgentFault(f"{when}: {fault}") from fault
    except (Exception, SystemExit) as error:
        raise AgentFault(f"{when}: {describe_exception(error)}") from error


# --- control ---------------------------------------------------------------------------------------------------------
class MotionController:
    """Turns the motions of one agent in one scenario into pedals."""

    def __init__(self, scenario: Scenario) -> None:
        model = scenario.vehicle
        self._model = model
        self._traction_mps2 = min(model.max_acceleration_mps2, scenario.friction * GRAVITY_MPS2)
        self._braking_mps2 = scenario.friction * GRAVITY_MPS2
        self._route = PathFollower(scenario.route)
        self._own_path: tuple[FloatArray, PathFollower] | None = None

    def pedals(self, motion: Motion, own: OwnState) -> Pedals:
        """Return pedals for a motion, from the vehicle's present state."""
        steer_rad = motion.steer_rad if motion.steer_rad is not None else self._toward(self._path(motion), own)
        if motion.acceleration_mps2 is not None:
            wanted_mps2 = motion.acceleration_mps2
        elif motion.target_speed_mps is not None:
            wanted_mps2 = _SPEED_GAIN * (motion.target_speed_mps - own.speed_mps)
            if motion.target_speed_mps <= 0.0 and abs(own.speed_mps) < _STANDSTILL_MPS:
                return Pedals(steer_rad, 0.0, _HOLDING_BRAKE)
        else:
            wanted_mps2 = 0.0
        if wanted_mps2 > 0:
            return Pedals(steer_rad, min(1.0, wanted_mps2 / self._traction_mps2), 0.0)
        if own.speed_mps < 0:  # rolls back: brakes would do nothing else than to slow it
            return Pedals(steer_rad, 0.0, _HOLDING_BRAKE)
        return Pedals(steer_rad, 0.0, min(1.0, -wanted_mps2 / self._braking_mps2))

    def _path(self, motion: Motion) -> PathFollower:
        if motion.path_m is None:
            return self._route
        if self._own_path is None or self._own_path[0] is not motion.path_m:
            self._own_path = motion.path_m, PathFollower(path_through(motion.path_m))
        return self._own_path[1]

    def _toward(self, path: PathFollower, own: OwnState) -> float:
        """Return the steering angle toward a point of the path some way ahead of the rear axle."""
        model = self._model
        back_m = model.rear_axle_m - model.cg_ahead_m
        c, s = math.cos(own.heading_rad), math.sin(own.heading_rad)
        x, y = own.x_m - back_m * c, own.y_m - back_m * s
        here_m, _ = path.locate(x, y)
        ahead_m = max(_LEAST_LOOKAHEAD_M, _LOOKAHEAD_S * abs(own.speed_mps)) + 0.5 * model.wheelbase_m
        target_x, target_y = path.point(here_m + ahead_m)
        dx, dy = target_x - x, target_y - y
        left_m, square_m2 = dy * c - dx * s, max(dx * dx + dy * dy, 1.0)
        steer_rad = math.atan(model.wheelbase_m * 2 * left_m / square_m2)  # both axles slip alike: no understeer
        return max(-model.max_steer_rad, min(model.max_steer_rad, steer_rad))
