"""Persistent traffic: slowness does not buy off a conflict, and whoever drives as recorded has the recorded crash."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest

from tests.agents.cases import BACKEND, RIGHT_M, case, crossing, drive, followed, rear_end
from tests.simulation.motions import participant, straight
from tests.verdict.crashes import STREET
from trace_dag.agents.evaluation.agents import Action, Motion, Observation, Recorded
from trace_dag.agents.evaluation.baselines import Replay
from trace_dag.agents.evaluation.evaluate import Conditions, run
from trace_dag.agents.evaluation.metrics import DriveOutcome
from trace_dag.agents.evaluation.persistent import Approach, last_moment_s, pace_ahead, pace_on_foot, pace_to_meet
from trace_dag.agents.evaluation.traffic import Traffic
from trace_dag.scenario.cases import Case, Scenario
from trace_dag.simulation.types import Body, BodyKind

PERSISTENT = Conditions(traffic=Traffic.PERSISTENT)


class StopsAtOnce:
    def reset(self, scenario: Scenario) -> None: ...

    def act(self, observation: Observation) -> Action:
        return Motion(target_speed_mps=0.0)


class StopsLate:
    """Brakes hard once the conflict of :func:`crossing` is 1.2 s away: too late to stop at 15 m/s."""

    def reset(self, scenario: Scenario) -> None: ...

    def act(self, observation: Observation) -> Action:
        return Recorded() if observation.own.x_m < -18.0 else Motion(acceleration_mps2=-9.0)


class EasesOff:
    """Slows down a little all the time: it is a little later at every look."""

    def reset(self, scenario: Scenario) -> None: ...

    def act(self, observation: Observation) -> Action:
        return Motion(acceleration_mps2=-0.8)


def walker() -> Case:
    """A person who walks from the right into the way of number 1, which comes at 12 m/s."""
    adult = Body(BodyKind.PEDESTRIAN, None, 0.3, 0.5, 1.75, 80.0)
    person = participant(1001, straight(0.0, RIGHT_M - 4.0 * 1.5, math.pi / 2, 1.5, until_s=7.0))
    return case(
        STREET,
        participant(1, straight(-4.0 * 12.0 - 2.0, RIGHT_M, 0.0, 12.0, until_s=7.0)),
        replace(person, body=adult),
    )


def slow_leader() -> Case:
    """Number 1 at 20 m/s runs into number 2, which drives at 15 m/s: at 0.6 of its speed it would never reach it."""
    return rear_end(20.0, 15.0)


@pytest.mark.parametrize("of", [rear_end, slow_leader, crossing, followed, walker])
@pytest.mark.parametrize("pace", [0.6, 0.8, 1.0, 1.2])
def test_an_agent_that_never_reacts_collides_at_any_pace(of, pace: float) -> None:
    found = drive(of(), Replay(str(pace)), 1, PERSISTENT)
    assert found.metrics.collided
    if pace == 1.0:
        assert found == drive(of(), Replay(), 1)
        assert found.outcome is DriveOutcome.UNCHANGED


def test_recorded_traffic_lets_slowness_pass() -> None:
    assert not drive(slow_leader(), Replay("0.6"), 1).metrics.collided
    assert not drive(crossing(), Replay("0.6"), 1).metrics.collided


def test_a_full_stop_before_the_conflict_is_counted_apart() -> None:
    found = drive(crossing(), StopsAtOnce(), 1, PERSISTENT)
    assert found.outcome is DriveOutcome.DID_NOT_ARRIVE
    assert not found.metrics.finished


def test_after_the_last_moment_nobody_waits_for_the_agent() -> None:
    """At 15 m/s an attentive human needs 0.75 + 15 / (2 * 0.75 * 9.81) = 1.77 s: the other is on its way by then."""
    assert last_moment_s(15.0, 0.75) == pytest.approx(1.77, abs=0.005)
    of = crossing()
    log = run(of, 1, StopsLate(), PERSISTENT, BACKEND.load(of.network, b"", friction=of.friction))
    before = log.first_contact.time_s if log.first_contact else log.duration_s
    other = log.vehicle_log(2)
    assert np.interp(min(before, 4.0) - 0.1, other.time_s, other.speed_mps) == pytest.approx(15.0, abs=0.3)


def test_a_person_slows_down_for_who_eases_off_and_does_not_start_and_stop() -> None:
    of = walker()
    log = run(of, 1, EasesOff(), PERSISTENT, BACKEND.load(of.network, b"", friction=of.friction))
    assert log.first_contact is not None, "the conflict stays"
    person = log.vehicle_log(1001)
    speed_mps = np.hypot(person.velocity_x_mps, person.velocity_y_mps)[person.time_s < log.first_contact.time_s]
    stands = speed_mps < 0.1
    assert np.count_nonzero(np.diff(stands.astype(int)) == 1) <= 1
    assert speed_mps.min() < 1.4 < speed_mps.max(), "it was slower than recorded for a while"


def test_an_oncoming_party_arrives_with_the_agent_at_its_recorded_pace() -> None:
    """Five seconds left at the recorded pace, seven for the agent: a straight line from the pace to 1 covers them."""
    first = pace_to_meet(5.0, 7.0, 0.2)
    times = np.linspace(0.0, 7.0, 701)
    driven = first + (1.0 - first) * times / 7.0
    assert np.trapezoid(driven, times) == pytest.approx(5.0)


def test_bounds_hold() -> None:
    assert pace_to_meet(5.0, 1000.0, 0.2) == 0.0
    assert pace_to_meet(5.0, 1.0, 0.2) == 1.25
    assert pace_on_foot(5.0, 1.0) == 1.5
    assert pace_ahead(3.0, Approach(3.0, 9.0, 1.0)) == 1.25


def test_the_same_run_gives_the_same_bits() -> None:
    of = crossing()
    simulation = BACKEND.load(of.network, b"", friction=of.friction)
    one, two = (run(of, 1, Replay("0.7"), PERSISTENT, simulation) for _ in range(2))
    assert all(
        np.array_equal(a.x_m, b.x_m) and np.array_equal(a.speed_mps, b.speed_mps)
        for a, b in zip(one.vehicles, two.vehicles, strict=True)
    )
