"""The loop: an agent seated in a simulation, asked at its own rate, its answers checked and carried out."""

from __future__ import annotations

import math
import traceback
from collections.abc import Mapping
from dataclasses import fields

import numpy as np

from trace_dag.evaluation.agents import Action, Agent, AgentFault, Motion, Recorded, Scenario
from trace_dag.evaluation.control import MotionController
from trace_dag.evaluation.observation import Sensor
from trace_dag.sim.driving import BodyState, Pedals

_MESSAGE_CHARACTERS = 400


class AgentDriver:
    """An agent at the wheel of one participant; a :class:`trace_dag.sim.driving.Driver`.

    Whatever the agent does wrong becomes an :class:`AgentFault` with what it was and when.
    """

    def __init__(self, agent: Agent, scenario: Scenario, sensor: Sensor) -> None:
        self.period_s = scenario.period_s
        self._agent = agent
        self._sensor = sensor
        self._controller = MotionController(scenario)
        try:
            agent.reset(scenario)
        except (Exception, SystemExit) as error:
            raise AgentFault(f"reset: {described(error)}") from error

    def drive(self, time_s: float, states: Mapping[int, BodyState]) -> Pedals | None:
        """See :class:`trace_dag.sim.driving.Driver`. Raises :class:`AgentFault`."""
        observation = self._sensor.observe(time_s, states)
        try:
            action = self._agent.act(observation)
        except (Exception, SystemExit) as error:
            raise AgentFault(f"act at {time_s:.2f} s: {described(error)}") from error
        problem = _problem(action)
        if problem:
            raise AgentFault(f"act at {time_s:.2f} s: {problem}")
        if isinstance(action, Recorded):
            return None
        if isinstance(action, Pedals):
            return action
        try:
            return self._controller.pedals(action, observation.own)
        except ValueError as error:
            raise AgentFault(f"act at {time_s:.2f} s: {error}") from error


def described(error: BaseException) -> str:
    """An agent's exception in one line: what it was, and the last line of code it came through."""
    frames = traceback.extract_tb(error.__traceback__)
    where = f" ({frames[-1].name}, line {frames[-1].lineno})" if frames else ""
    text = f"{type(error).__name__}: {error}" if str(error) else type(error).__name__
    return " ".join(text.split())[:_MESSAGE_CHARACTERS] + where


def _problem(action: Action | object) -> str:
    """What is wrong with an answer; empty if nothing."""
    if isinstance(action, Recorded):
        return ""
    if not isinstance(action, Pedals | Motion):
        return f"answered {type(action).__name__}; expected Pedals, Motion or Recorded"
    for field in fields(action):
        value = getattr(action, field.name)
        if value is None or isinstance(value, bool) or field.name == "path_m":
            continue
        if not isinstance(value, int | float | np.floating | np.integer):
            return f"{type(action).__name__}.{field.name} is {type(value).__name__}; expected a number"
        if not math.isfinite(value):
            return f"{type(action).__name__}.{field.name} is {value}; expected a finite number"
    if isinstance(action, Motion):
        return _problem_of_motion(action)
    return ""


def _problem_of_motion(action: Motion) -> str:
    if action.target_speed_mps is not None and action.acceleration_mps2 is not None:
        return "Motion has a target speed and an acceleration; expected one of them"
    if action.target_speed_mps is not None and action.target_speed_mps < 0:
        return f"Motion.target_speed_mps is {action.target_speed_mps}; expected 0 or more"
    path = action.path_m
    if path is None:
        return ""
    if not isinstance(path, np.ndarray) or path.ndim != 2 or path.shape[1] != 2 or path.dtype.kind not in "fi":
        return "Motion.path_m is no array of numbers of shape (n, 2)"
    return "" if np.isfinite(path).all() else "Motion.path_m holds a value that is not finite"
