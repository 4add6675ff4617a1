"""The loop: an agent seated in a simulation, asked at its own rate, its answers checked and carried out."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from contextlib import contextmanager

from trace_dag.agents.evaluation.agent_protocol import describe_exception, problem_of
from trace_dag.agents.evaluation.agents import Agent, AgentFault, Recorded
from trace_dag.agents.evaluation.control import MotionController
from trace_dag.agents.evaluation.observation import Sensor
from trace_dag.scenario.cases import Scenario
from trace_dag.scenario.progress import Arrival
from trace_dag.simulation.driving import BodyState, Pace, Pedals


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
        """See :class:`trace_dag.simulation.driving.Driver`."""
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
