"""Agents and people: who is seen and as what, what hides them, what the baselines do, whose place is taken."""

from __future__ import annotations

import math

import pytest

from tests.agents.cases import RIGHT_M, case, drive, standing
from tests.agents.test_loop import Answers
from tests.simulation.motions import CAR, participant, straight
from tests.verdict.crashes import STREET
from trace_dag.agents.evaluation.agents import Recorded
from trace_dag.agents.evaluation.baselines import BrakeOnTimeToCollision, CautiousLaneKeeper, Replay
from trace_dag.agents.evaluation.metrics import AVOIDED, DriveOutcome
from trace_dag.agents.evaluation.observation import Sensing, Sensor
from trace_dag.agents.stored_cases import AgentRole, number_of
from trace_dag.scenario.cases import Case
from trace_dag.simulation.body_sizes import person_body
from trace_dag.simulation.driving import BodyState
from trace_dag.simulation.types import BodyKind

PEDESTRIAN, CYCLIST = person_body(BodyKind.PEDESTRIAN), person_body(BodyKind.CYCLIST)


def walked_into(kind: BodyKind = BodyKind.PEDESTRIAN, speed_mps: float = 14.0, walks_mps: float = 1.4) -> Case:
    """Somebody comes from the right into the way of vehicle 1, whose front is there after four seconds."""
    way_m = 4.0 * speed_mps + CAR.length_m / 2
    return case(
        STREET,
        participant(1, straight(-way_m, RIGHT_M, 0.0, speed_mps, until_s=7.0)),
        participant(
            1001, straight(0.0, RIGHT_M - 4.0 * walks_mps, math.pi / 2, walks_mps, until_s=7.0), person_body(kind)
        ),
    )


def ridden_into() -> Case:
    """Vehicle 1 at 15 m/s runs into a bicycle of 4 m/s ahead of it after four seconds."""
    gap_m = 4.0 * 11.0 + (CAR.length_m + CYCLIST.length_m) / 2
    return case(
        STREET,
        participant(1, straight(-gap_m, RIGHT_M, 0.0, 15.0, until_s=7.0)),
        participant(1001, straight(0.0, RIGHT_M, 0.0, 4.0, until_s=7.0), CYCLIST),
    )


@pytest.mark.parametrize("kind", [BodyKind.PEDESTRIAN, BodyKind.CYCLIST, BodyKind.CONVEYANCE])
def test_a_road_user_has_a_kind(kind: BodyKind) -> None:
    agent = Answers(Recorded())
    drive(walked_into(kind), agent)
    (other,) = agent.seen[0].others
    assert (other.number, other.kind) == (1001, kind)
    assert other.velocity_y_mps == pytest.approx(1.4, abs=0.01)
    assert other.width_m == person_body(kind).width_m


def seen(*states: BodyState) -> set[int]:
    bodies = {each.number: PEDESTRIAN if each.number > 1000 else CAR for each in (standing(1, 0.0), *states)}
    sensor = Sensor(1, bodies, Sensing(occlusion=True), seed=1)
    observed = sensor.observe(0.0, {each.number: each for each in (standing(1, 0.0), *states)})
    return {other.number for other in observed.others}


def test_a_vehicle_hides_a_person_and_a_person_nobody() -> None:
    """On one line: a car 20 m ahead, somebody 10 m behind it; then the two the other way round."""
    assert seen(standing(2, 20.0), standing(1001, 30.0)) == {2}
    assert seen(standing(2, 30.0), standing(1001, 20.0)) == {2, 1001}
    assert seen(standing(1001, 20.0), standing(1002, 21.0)) == {1001, 1002}
    assert seen(standing(2, 20.0), standing(1001, 30.0, 4.0)) == {2, 1001}  # beside the car's shadow


@pytest.mark.parametrize("of", [walked_into, ridden_into])
def test_the_recorded_drive_strikes_the_person_again(of) -> None:
    crash = of()
    assert crash.contact is not None
    found = drive(crash, Replay())
    assert found.outcome is DriveOutcome.UNCHANGED
    assert found.metrics is not None
    assert found.metrics.contact_time_s == pytest.approx(crash.contact.time_s, abs=0.05)


@pytest.mark.parametrize("agent", [BrakeOnTimeToCollision, CautiousLaneKeeper])
@pytest.mark.parametrize("of", [walked_into, ridden_into])
def test_the_baselines_react_to_people(of, agent) -> None:
    """From 1.5 s before at 15 m/s full brakes, 7.4 m/s2, leave less than 4 m/s or nothing."""
    found = drive(of(), agent())
    assert found.outcome in AVOIDED | {DriveOutcome.MITIGATED}


def test_the_agent_drives_the_vehicle_of_a_crash_with_a_person() -> None:
    assert {number_of(walked_into(), role) for role in AgentRole} == {1}
