"""Crashes made by hand for agents to drive in, in closed form, on a street and a crossroads."""

from __future__ import annotations

import math

from tests.simulation.motions import participant, straight
from tests.verdict.crashes import CROSSROADS, STREET
from trace_dag.agents.evaluation.agents import Agent
from trace_dag.agents.evaluation.evaluate import Conditions, Evaluation, evaluate
from trace_dag.common.settings import SimSettings
from trace_dag.roads.map.network import RoadNetwork
from trace_dag.scenario.cases import Case
from trace_dag.simulation.driving import BodyState
from trace_dag.simulation.embedded import EmbeddedBackend
from trace_dag.simulation.types import Participant

RIGHT_M = -1.75  # centre of the lane along the x axis
BACKEND = EmbeddedBackend(SimSettings())
FRICTION = 0.75


def standing(number: int, x_m: float, y_m: float = 0.0) -> BodyState:
    """A body that stands there and faces east."""
    return BodyState(number, x_m, y_m, 0.0, 0.0, 0.0, 0.0, 0.0)


def case(network: RoadNetwork, *participants: Participant, impact_time_s: float = 4.0) -> Case:
    """A case whose recorded crash is the simulation of its participants."""
    recorded = BACKEND.load(network, b"", friction=FRICTION).run(participants, time_limit_s=20.0)
    return Case("2023-1", "2023-1", network, b"", FRICTION, participants, impact_time_s, recorded)


def rear_end(speed_mps: float = 20.0, leader_mps: float = 0.0) -> Case:
    """Number 1 runs into number 2 ahead of it after four seconds."""
    gap_m = 4.0 * (speed_mps - leader_mps) + 4.7
    return case(
        STREET,
        participant(1, straight(-gap_m, RIGHT_M, 0.0, speed_mps, until_s=7.0)),
        participant(2, straight(0.0, RIGHT_M, 0.0, leader_mps, until_s=7.0)),
    )


def crossing(speed_mps: float = 15.0) -> Case:
    """Number 2, from the right, drives into number 1's way at a crossroads after four seconds."""
    way_m = 4.0 * speed_mps
    return case(
        CROSSROADS,
        participant(1, straight(-way_m, RIGHT_M, 0.0, speed_mps, until_s=7.0)),
        participant(2, straight(1.75, RIGHT_M - way_m, math.pi / 2, speed_mps, until_s=7.0)),
    )


def drive(of: Case, agent: Agent, ego: int = 1, conditions: Conditions | None = None) -> Evaluation:
    """An evaluation in the embedded back-end."""
    simulation = BACKEND.load(of.network, of.xodr, friction=of.friction)
    return evaluate(of, ego, agent, conditions or Conditions(), simulation)


def followed() -> Case:
    """Number 1 ahead at 10 m/s, number 2 behind it at 20 m/s: the recorded rear-end crash after four seconds."""
    gap_m = 4.0 * 10.0 + 4.7
    return case(
        STREET,
        participant(1, straight(0.0, RIGHT_M, 0.0, 10.0, until_s=7.0)),
        participant(2, straight(-gap_m, RIGHT_M, 0.0, 20.0, until_s=7.0)),
    )
