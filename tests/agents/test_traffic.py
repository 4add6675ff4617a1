"""Reactive traffic: the recorded crash for whoever drives as recorded, distance kept from whoever does not."""

from __future__ import annotations

import numpy as np
import pytest

from tests.agents.cases import BACKEND, crossing, drive, followed, rear_end
from trace_dag.agents.evaluation.agents import Action, Motion, Observation
from trace_dag.agents.evaluation.baselines import BrakeOnTimeToCollision, Replay
from trace_dag.agents.evaluation.evaluate import Conditions, run
from trace_dag.agents.evaluation.metrics import DriveOutcome
from trace_dag.agents.evaluation.traffic import Traffic
from trace_dag.scenario.cases import Scenario

REACTIVE = Conditions(traffic=Traffic.REACTIVE)


class BrakesAtOnce:
    def reset(self, scenario: Scenario) -> None: ...

    def act(self, observation: Observation) -> Action:
        return Motion(acceleration_mps2=-4.0)


@pytest.mark.parametrize("ego", [1, 2])
@pytest.mark.parametrize("of", [rear_end, crossing, followed])
def test_the_recorded_drive_has_the_recorded_crash(of, ego) -> None:
    found = drive(of(), Replay(), ego, REACTIVE)
    assert found == drive(of(), Replay(), ego)
    assert found.outcome is DriveOutcome.UNCHANGED
    assert found.metrics.contact_shift_m == 0.0


def test_a_car_that_brakes_is_not_run_into_by_a_recording() -> None:
    """Braking at 4 m/s2 from 10 m/s it stands after 2.5 s and 12.5 m; the other has 44.7 - 4.7 + 12.5 m to stop from
    20 m/s, for which 3.8 m/s2 are enough. As recorded it drives into the standing car."""
    assert drive(followed(), BrakesAtOnce(), 1).metrics.collided
    assert not drive(followed(), BrakesAtOnce(), 1, REACTIVE).metrics.collided


def test_the_others_keep_to_their_courses() -> None:
    of = crossing()
    log = run(of, 1, BrakeOnTimeToCollision(), REACTIVE, BACKEND.load(of.network, b"", friction=of.friction))
    other = next(each for each in log.vehicles if each.number == 2)
    assert np.abs(other.x_m - 1.75).max() < 0.1
    assert not log.contacts


def test_striking_is_who_closes_in_faster() -> None:
    assert drive(rear_end(), Replay(), 1).role == "striking"
    assert drive(rear_end(), Replay(), 2).role == "struck"
