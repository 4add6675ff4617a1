"""The CARLA back-end takes the same agents, through its own controls: against the stand-in world."""

from __future__ import annotations

import pytest

pytest.importorskip("carla", reason="the carla extra is not installed")

from tests.agents.cases import rear_end
from tests.simulation.carla_stand_in import StandIn
from trace_dag.agents.evaluation.baselines import BrakeOnTimeToCollision, Replay
from trace_dag.agents.evaluation.evaluate import Conditions, evaluate
from trace_dag.agents.evaluation.metrics import AVOIDED, DriveOutcome
from trace_dag.carla.backend import CarlaBackend
from trace_dag.common.settings import SimSettings


def test_an_agent_brakes_in_carla_as_in_the_embedded_back_end() -> None:
    of = rear_end(12.0)
    outcomes, brakes = {}, {}
    for agent in (Replay(), BrakeOnTimeToCollision()):
        world = StandIn()
        simulation = CarlaBackend(SimSettings(backend="carla"), world).load(of.network, b"<OpenDRIVE/>", friction=0.75)
        outcomes[type(agent)] = evaluate(of, 1, agent, Conditions(), simulation).outcome
        calls = [call.arguments[0] for call in world.named("apply_control")]
        brakes[type(agent)] = sum(control.brake == 1.0 and not control.hand_brake for control in calls)
    # It stops behind the standing car, and so never gets past it.
    assert outcomes[BrakeOnTimeToCollision] is DriveOutcome.DID_NOT_ARRIVE
    assert outcomes[Replay] not in AVOIDED
    assert brakes[BrakeOnTimeToCollision] > brakes[Replay]
