"""Reactive traffic: the recorded crash for whoever drives as recorded, distance kept from whoever does not."""

from __future__ import annotations

from types import SimpleNamespace

import numpy as np
import pytest

from tests.agents.cases import BACKEND, crossing, drive, followed, rear_end
from trace_dag.agents import stored_traffic
from trace_dag.agents.evaluation.agents import Action, Motion, Observation
from trace_dag.agents.evaluation.baselines import BrakeOnTimeToCollision, Replay
from trace_dag.agents.evaluation.evaluate import Conditions, run
from trace_dag.agents.evaluation.metrics import DriveOutcome
from trace_dag.agents.evaluation.traffic import Traffic
from trace_dag.common.errors import UserError
from trace_dag.common.settings import Settings
from trace_dag.crash.record import VehicleClass
from trace_dag.scenario.cases import Case, Scenario
from trace_dag.scenario.traffic.surrounding import SurroundingTraffic, SurroundingVehicle, body_of_class
from trace_dag.simulation.states import Trajectory

STORED = SimpleNamespace(case_id="1", key="1", files=SimpleNamespace(settings=Settings()))
REACTIVE = Conditions(traffic=Traffic.REACTIVE)


class SteersLeft:
    def reset(self, scenario: Scenario) -> None: ...

    def act(self, observation: Observation) -> Action:
        return Motion(acceleration_mps2=0.0, steer_rad=0.1)


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


def way(number: int, x_m: float, y_m: float, speed_mps: float, until_s: float) -> SurroundingVehicle:
    """A car that goes east."""
    times = np.arange(round(until_s / 0.1) + 1) * 0.1
    still = np.zeros(len(times))
    return SurroundingVehicle(
        number,
        body_of_class(VehicleClass.CAR),
        Trajectory(times, x_m + speed_mps * times, still + y_m, still, still, still + speed_mps),
    )


def among(monkeypatch: pytest.MonkeyPatch, case: Case, *vehicles: SurroundingVehicle) -> Case:
    monkeypatch.setattr(stored_traffic, "load_case", lambda _: case)
    monkeypatch.setattr(stored_traffic, "traffic_of", lambda _: SurroundingTraffic(vehicles, 0, ()))
    return stored_traffic.load_driven(STORED, Traffic.SURROUNDING)


def test_a_vehicle_around_the_crash_can_be_run_into_and_changes_nothing_else(monkeypatch) -> None:
    """It drives 4 m beside the two; whoever steers over to it touches it, whoever drives as recorded has the crash."""
    of = rear_end()
    one = of.participant(1)
    x_m, y_m, speed_mps = one.initial_pose.x_m, one.initial_pose.y_m, one.initial_speed_mps
    until_s = of.recorded.duration_s
    beside, late = way(4001, x_m, y_m + 4.0, speed_mps, until_s), way(4002, x_m, y_m + 9.0, speed_mps, 1.0)
    within, into = (
        way(4003, x_m, y_m + 0.5, speed_mps, until_s),
        way(4004, x_m - 30.0, y_m + 4.0, 1.4 * speed_mps, until_s),
    )
    case = among(monkeypatch, of, beside, late, within, into)
    assert set(case.bodies) == {1, 2, 4001}, "nobody who leaves the map, stands in a party or runs into another one"
    assert drive(case, Replay(), 1).metrics.contact_time_s == drive(of, Replay(), 1).metrics.contact_time_s
    log = run(
        case,
        1,
        SteersLeft(),
        Conditions(traffic=Traffic.SURROUNDING),
        BACKEND.load(of.network, b"", friction=of.friction),
    )
    assert {log.first_contact.number_1, log.first_contact.number_2} == {1, 4001}


def test_a_vehicle_around_the_crash_brakes_to_stand_after_its_motion() -> None:
    """From 12 m/s at 3 m/s2 it stands after 4 s and 24 m, 2 s of which it had gone as recorded."""
    stopping = way(4001, 0.0, 0.0, 12.0, 2.0).stopping.trajectory
    assert stopping.x_m[-1] == pytest.approx(24.0 + 24.0, abs=12.0 * 0.1)
    assert np.interp(6.2, stopping.time_s, stopping.speed_mps) == 0.0
    assert np.interp(5.8, stopping.time_s, stopping.speed_mps) > 0.0


def test_without_traffic_it_is_said_what_makes_it(monkeypatch) -> None:
    monkeypatch.setattr(stored_traffic, "load_case", lambda _: rear_end())
    monkeypatch.setattr(stored_traffic, "traffic_of", lambda _: None)
    with pytest.raises(UserError, match="trace-dag traffic makes it"):
        stored_traffic.load_driven(STORED, Traffic.SURROUNDING)
