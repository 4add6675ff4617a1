"""The interface of agents: what they see, what they may answer, and what counts as a fault."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
import pytest

from tests.agents.cases import drive, rear_end, standing
from tests.simulation.motions import CAR
from trace_dag.agents.evaluation.agents import Action, AgentFault, Motion, Observation
from trace_dag.agents.evaluation.evaluate import Conditions
from trace_dag.agents.evaluation.metrics import DriveOutcome
from trace_dag.agents.evaluation.observation import Sensing, Sensor
from trace_dag.agents.evaluation.registry import list_agents, make_agent, resolve, set_arguments
from trace_dag.common.errors import UserError
from trace_dag.scenario.cases import Scenario
from trace_dag.simulation.driving import BodyState, Pedals


class CarefulFollower:
    """The example of the tutorial for driving stacks: slows down to stop ten metres short of whoever is ahead."""

    def reset(self, scenario: Scenario) -> None:
        self.body = scenario.body
        self.cruise_mps = None

    def act(self, observation: Observation) -> Action:
        own = observation.own
        self.cruise_mps = self.cruise_mps or own.speed_mps
        gaps = [
            math.hypot(other.x_m - own.x_m, other.y_m - own.y_m) - (other.length_m + self.body.length_m) / 2
            for other in observation.others
        ]
        room_m = max(min(gaps, default=math.inf) - 10.0, 0.0)
        return Motion(target_speed_mps=min(self.cruise_mps, math.sqrt(2 * 3.0 * room_m)))


class Answers:
    """Answers always the same; notes what it sees."""

    def __init__(self, answer: object) -> None:
        self.answer = answer
        self.seen: list[Observation] = []

    def reset(self, scenario: Scenario) -> None:
        self.seen = []

    def act(self, observation: Observation) -> Action:
        self.seen.append(observation)
        if isinstance(self.answer, BaseException):
            raise self.answer
        return self.answer  # type: ignore[return-value]


def test_the_example_agent_avoids_a_rear_end_crash():
    found = drive(rear_end(), CarefulFollower())
    assert found.outcome is DriveOutcome.DID_NOT_ARRIVE
    assert found.metrics is not None
    assert found.metrics.max_deceleration_mps2 < 7.0  # full brakes would be 7.35


@pytest.mark.parametrize(
    ("answer", "said"),
    [
        (ValueError("no plan"), "ValueError: no plan"),
        (SystemExit(2), "SystemExit"),
        (RecursionError(), "RecursionError"),
        ("brake", "answered str"),
        (None, "answered NoneType"),
        (Pedals(steer_rad=math.nan), "Pedals.steer_rad is nan"),
        (Pedals(throttle="full"), "Pedals.throttle is str"),  # type: ignore[arg-type]
        (Motion(target_speed_mps=math.inf), "Motion.target_speed_mps is inf"),
        (Motion(target_speed_mps=-1.0), "expected 0 or more"),
        (Motion(target_speed_mps=1.0, acceleration_mps2=1.0), "expected one of them"),
        (Motion(path_m=np.zeros((4, 3))), "shape (n, 2)"),
        (Motion(path_m=np.full((4, 2), np.nan)), "not finite"),
        (Motion(path_m=np.zeros((4, 2))), "two points or more"),
    ],
)
def test_a_faulty_answer_is_a_result_that_names_what_was_wrong(answer, said):
    found = drive(rear_end(), Answers(answer))
    assert found.outcome is DriveOutcome.FAULTY
    assert said in found.fault
    assert found.metrics is None


@pytest.mark.parametrize("rate_hz", [20.0, 100.0])
def test_agents_act_at_their_rate_and_see_the_others_approach(rate_hz):
    agent = Answers(Motion())
    drive(rear_end(), agent, conditions=Conditions(rate_hz))
    times = np.array([seen.time_s for seen in agent.seen])
    assert np.diff(times) == pytest.approx(1 / rate_hz)
    gaps = [seen.others[0].x_m - seen.own.x_m for seen in agent.seen]
    assert gaps[0] == pytest.approx(84.7, abs=0.01)
    assert gaps == sorted(gaps, reverse=True)


@pytest.mark.parametrize("rate_hz", [19.0, 101.0])
def test_other_rates_are_refused(rate_hz):
    with pytest.raises(UserError, match="20 to 100"):
        Conditions(rate_hz)


def test_pedals_steer_to_the_left_where_positive():
    agent = Answers(Pedals(steer_rad=0.05))
    drive(rear_end(), agent)
    assert agent.seen[20].own.y_m > agent.seen[0].own.y_m + 0.5


# --- seeing ------------------------------------------------------------------------------------------------------
THREE = {1: standing(1, 0, 0), 2: standing(2, 20, 0), 3: standing(3, 40, 0.2)}


def seen(states: dict[int, BodyState], sensing: Sensing, seed: int = 1) -> dict[int, tuple[float, float]]:
    sensor = Sensor(1, dict.fromkeys(states, CAR), sensing, seed)
    return {other.number: (other.x_m, other.y_m) for other in sensor.observe(0.0, states).others}


def test_range_and_occlusion_decide_who_is_seen():
    assert seen(THREE, Sensing()).keys() == {2, 3}
    assert seen(THREE, Sensing(range_m=30.0)).keys() == {2}
    assert seen(THREE, Sensing(occlusion=True)).keys() == {2}
    beside = {**THREE, 3: standing(3, 40, 6.0)}
    assert seen(beside, Sensing(occlusion=True)).keys() == {2, 3}


def test_noise_is_of_the_given_size_and_the_same_for_a_seed():
    noisy = Sensing(noise_m=0.5)
    assert seen(THREE, noisy) == seen(THREE, noisy)
    assert seen(THREE, noisy, seed=2) != seen(THREE, noisy)
    sensor = Sensor(1, dict.fromkeys(THREE, CAR), noisy, 1)
    x = [sensor.observe(0.0, THREE).others[0].x_m for _ in range(2000)]
    assert np.std(x) == pytest.approx(0.5, rel=0.1)
    assert np.mean(x) == pytest.approx(20.0, abs=0.05)


# --- names -------------------------------------------------------------------------------------------------------
def test_baselines_are_offered_by_name():
    assert {"replay", "brake", "idm", "cautious"} <= list_agents().keys()


@pytest.mark.parametrize("name", ["nobody", "no_such_package:Agent", "os.path:", "a b:C"])
def test_names_that_lead_nowhere_are_the_callers_mistake(name):
    with pytest.raises(UserError, match="--agent"):
        resolve(name)


@dataclass
class Trained:
    """An agent that is told what to load."""

    checkpoint: str
    device: str = "cpu"

    def reset(self, *_: object) -> None: ...

    def act(self, *_: object) -> None: ...


def test_an_agent_is_made_with_its_arguments():
    agent = resolve(set_arguments(f"{__name__}:Trained", ["checkpoint=runs/a b&c=1.pt", "device="]))
    assert make_agent(agent) == Trained("runs/a b&c=1.pt", "")
    with pytest.raises(AgentFault, match="checkpoint"):
        make_agent(f"{__name__}:Trained")
    with pytest.raises(UserError, match="--agent-arg checkpoint: expected NAME=VALUE"):
        set_arguments("idm", ["checkpoint"])


@pytest.mark.parametrize("reference", ["math:pi", "math:no_such_thing", "json:JSONDecoder"])
def test_an_object_that_is_no_agent_is_a_fault(reference):
    with pytest.raises(AgentFault):
        make_agent(reference)
