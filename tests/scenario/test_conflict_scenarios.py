"""Scenarios that keep a conflict: whoever is at the free vehicle's wheel meets the other one, however slow it is."""

from __future__ import annotations

import math
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest
from lxml import etree

from tests.scenario import esmini
from tests.scenario.player import driven_without_reacting
from tests.simulation.motions import CAR, driven, log_of, participant, straight
from tests.verdict.crashes import CROSSROADS, record, vehicle
from trace_dag.common.settings import SimSettings
from trace_dag.roads.map.writer import write_opendrive
from trace_dag.scenario.openscenario import Flavour, OpenScenarios
from trace_dag.simulation.types import Body, BodyKind, SimulationLog

RECORD = record(vehicle(1, 12), vehicle(2, 9))
KEPT = Flavour(free=1, keeps_conflict=True)
ADULT = Body(BodyKind.PEDESTRIAN, None, 0.3, 0.5, 1.75, 80.0)


def crossing(body: Body = CAR, speed_mps: float = 12.0) -> SimulationLog:
    """Number 1 from the west with 15 m/s; a car or a person from the south, who are in one place after five seconds."""
    other = straight(1.75, -1.75 - 5.0 * speed_mps, math.pi / 2, speed_mps)
    number = 1001 if body.is_figure else 2
    return log_of(
        [participant(1, straight(-75.0, -1.75, 0.0, 15.0)), participant(number, other, body)],
        SimSettings(time_limit_s=9.0),
    )


def following() -> SimulationLog:
    """Number 1 with 15 m/s behind number 2 with 5 m/s, which it runs into after five seconds."""
    ahead = participant(2, straight(-20.0, -1.75, 0.0, 5.0))
    return log_of([participant(1, straight(-75.0, -1.75, 0.0, 15.0)), ahead], SimSettings(time_limit_s=9.0))


def written(log: SimulationLog, flavour: Flavour) -> etree._Element:
    return etree.fromstring(OpenScenarios(RECORD, CROSSROADS, log).write(flavour))


@pytest.mark.parametrize("log_of_crash", [crossing, following])
@pytest.mark.parametrize("pace", [0.6, 0.8, 1.0, 1.2])
def test_esmini_has_the_contact_at_any_pace(
    log_of_crash: Callable[[], SimulationLog], pace: float, tmp_path: Path
) -> None:
    log = log_of_crash()
    (tmp_path / "map.xodr").write_bytes(write_opendrive(CROSSROADS))
    scenarios = OpenScenarios(RECORD, CROSSROADS, log)
    contact_s = log.first_contact.time_s
    kept = driven_without_reacting(scenarios.write(KEPT), scenarios.write(), "V1", contact_s, pace)
    (tmp_path / "kept.xosc").write_bytes(kept)
    collision, _, errors = esmini.play(tmp_path / "kept.xosc", 0.02, tmp_path)
    assert not errors
    assert collision.entities == ("V1", "V2")
    assert collision.time_s == pytest.approx(contact_s / pace, abs=0.15)


@pytest.mark.parametrize("pace", [0.6, 1.2])
def test_in_esmini_a_vehicle_that_would_have_to_brake_or_drive_too_hard_keeps_its_speed(
    pace: float, tmp_path: Path
) -> None:
    """From 25 m/s, 0.6 times the pace needs 5 m/s2 of braking, 1.2 times it 35 m/s."""
    log = crossing(CAR, 25.0)
    (tmp_path / "map.xodr").write_bytes(write_opendrive(CROSSROADS))
    scenarios = OpenScenarios(RECORD, CROSSROADS, log)
    kept = driven_without_reacting(scenarios.write(KEPT), scenarios.write(), "V1", log.first_contact.time_s, pace)
    (tmp_path / "kept.xosc").write_bytes(kept)
    _, places, errors = esmini.play(tmp_path / "kept.xosc", 0.02, tmp_path)
    assert not errors
    speeds_mps = np.hypot(*np.diff(places["V2"][::10, 1:3], axis=0).T) / 0.2
    assert speeds_mps == pytest.approx(np.full(len(speeds_mps), 25.0), abs=1.0)


def test_a_free_vehicle_that_stood_leaves_the_other_one_to_the_clock() -> None:
    """It waits for a second and then drives off, with an even 3 m/s2, into who comes from the south."""
    waits = driven(-24.0, -1.75, 0.0, lambda t: 3.0 * max(t - 1.0, 0.0), lambda _: 0.0)
    other = participant(2, straight(1.75, -1.75 - 60.0, math.pi / 2, 12.0))
    log = log_of([participant(1, waits), other], SimSettings(time_limit_s=9.0))
    assert log.first_contact is not None
    assert written(log, KEPT).find(".//SynchronizeAction") is None


def test_whoever_would_have_to_brake_too_hard_at_the_recorded_pace_goes_by_the_clock() -> None:
    """It stops from 20 m/s with 8 m/s2 before it drives on into the contact."""
    speed = lambda t: max(20.0 - 8.0 * t, 0.0) if t < 4.0 else 6.0 * (t - 4.0)  # noqa: E731
    other = participant(2, driven(1.75, -1.75 - 28.0, math.pi / 2, speed, lambda _: 0.0))
    log = log_of([participant(1, straight(-75.0, -1.75, 0.0, 15.0)), other], SimSettings(time_limit_s=9.0))
    assert log.first_contact is not None
    assert written(log, KEPT).find(".//SynchronizeAction") is None


def test_a_vehicle_arrives_together_with_the_free_one_at_its_recorded_speed() -> None:
    log = crossing()
    action = written(log, KEPT).find(".//SynchronizeAction")
    assert action.get("masterEntityRef") == "V1"
    assert float(action.find("FinalSpeed/AbsoluteSpeed").get("value")) == pytest.approx(12.0, abs=0.05)
    assert written(log, Flavour(free=1)).find(".//SynchronizeAction") is None


def test_a_person_sets_out_by_the_time_to_collision_at_the_start() -> None:
    log = crossing(ADULT, 1.5)
    scenario = written(log, KEPT)
    condition = scenario.find(".//TimeToCollisionCondition")
    assert float(condition.get("value")) == pytest.approx(log.first_contact.time_s, abs=1e-3)
    assert scenario.find(".//ManeuverGroup//Timing").get("domainAbsoluteRelative") == "relative"
    begins = scenario.find(".//Init//Private[@entityRef='P1']//AbsoluteTargetSpeed")
    assert float(begins.get("value")) == 0.0, "until it sets out it stands"


def test_whoever_stands_goes_by_the_clock() -> None:
    standing = participant(2, straight(0.0, -1.75, 0.0, 0.0))
    log = log_of([participant(1, straight(-60.0, -1.75, 0.0, 15.0)), standing], SimSettings(time_limit_s=9.0))
    assert written(log, KEPT).find(".//SynchronizeAction") is None


def test_a_vehicle_ahead_arrives_at_the_recorded_share_of_the_free_speed() -> None:
    final = written(following(), KEPT).find(".//FinalSpeed/RelativeSpeedToMaster")
    assert final.get("speedTargetValueType") == "factor"
    assert float(final.get("value")) == pytest.approx(5.0 / 15.0, abs=0.01)
