"""Crashes told in the published benchmark's layout: its keys and units, and the crash happens in it as it did."""

from __future__ import annotations

import json
import math
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from tests.sim.motions import CAR, TRUCK, driven, log_of, participant, straight
from tests.verdict.crashes import STREET, record, simulated, vehicle
from trace_dag.errors import UserError
from trace_dag.roads.map.model import Cubic
from trace_dag.roads.map.network import RoadNetwork
from trace_dag.scenario.published_layout import write_published
from trace_dag.settings import SimSettings
from trace_dag.sim.embedded import EmbeddedBackend
from trace_dag.sim.published import published_estimate, read_published
from trace_dag.sim.run import simulate
from trace_dag.sim.types import Body, SimulationLog
from trace_dag.states.types import Hypothesis, SpeedSource, Trajectory

RECORD = record(vehicle(1, 12), vehicle(2, 9))


def crash(*trajectories: Trajectory, bodies: tuple[Body, ...] = (CAR, CAR)) -> tuple[Hypothesis, SimulationLog]:
    """A hypothesis as planned, and its simulation with bodies of these sizes on a plane."""
    hypothesis, _ = simulated(*trajectories)
    states = tuple(
        replace(
            state,
            vehicle_class=body.vehicle_class,
            length_m=body.length_m,
            width_m=body.width_m,
            height_m=body.height_m,
            mass_kg=body.mass_kg,
        )
        for state, body in zip(hypothesis.participants, bodies, strict=True)
    )
    log = log_of(
        [participant(i, t, b) for i, (t, b) in enumerate(zip(trajectories, bodies, strict=True), start=1)],
        SimSettings(time_limit_s=15.0),
    )
    return replace(hypothesis, participants=states), log


def replayed(content: bytes, network: RoadNetwork = STREET) -> SimulationLog:
    """What our own reader and simulator make of it."""
    settings = SimSettings(time_limit_s=30.0)
    states = published_estimate(read_published(content, name="s.json"), RECORD)
    return simulate(EmbeddedBackend(settings), network, b"", states, settings, record=RECORD)[0]


def test_keys_and_types_are_those_of_the_published_files(shared_data: Path) -> None:
    def shape(value: object) -> object:
        if isinstance(value, dict):
            return {key: shape(each) for key, each in value.items()}
        if isinstance(value, list):
            return [shape(value[0])] if value and isinstance(value[0], list) else [type(each) for each in value]
        return type(value)

    published = shared_data / "va-2023" / "published" / "simulations" / "simulation_510009.json"
    ours = write_published(*crash(straight(-40.0, 0.0, 0.0, 15.0), straight(5.0, 30.0, -math.pi / 2, 10.0)))
    assert shape(json.loads(ours)) == shape(json.loads(published.read_bytes()))
    assert list(json.loads(ours)) == list(json.loads(published.read_bytes()))


def test_frame_and_units_are_carlas() -> None:
    """Vehicle 2 comes from the north, where CARLA's y is negative, heading south, which is 90 degrees there."""
    content = json.loads(
        write_published(*crash(straight(-40.0, 0.0, 0.0, 15.0), straight(5.0, 30.0, -math.pi / 2, 10.0)))
    )
    one, two = content["vehicle1"], content["vehicle2"]
    assert (one["speed_kmh"], two["speed_kmh"]) == pytest.approx((54.0, 36.0))
    assert (one["yaw"], two["yaw"]) == pytest.approx((0.0, 90.0), abs=0.1)
    assert two["start_position"]["y"] == pytest.approx(-30.0, abs=1.0)
    assert two["trajectory"][0] == [two["start_position"]["x"], two["start_position"]["y"]]
    assert two["start_position"]["z"] == 0.5
    steps = np.hypot(*np.diff(two["trajectory"], axis=0).T)
    assert steps == pytest.approx(5.0, abs=0.01)
    assert two["trajectory"][-1][1] > 5.0  # past the crash
    assert content["crash_point"] == {"x": 0.0, "y": 0.0}


CRASHES = {
    "crossing": (straight(-60.0, 0.0, 0.0, 15.0), straight(5.0, 40.0, -math.pi / 2, 10.0), CAR, CAR),
    "truck": (straight(-60.0, 0.0, 0.0, 15.0), straight(5.0, 40.0, -math.pi / 2, 9.0), CAR, TRUCK),
    "standing": (straight(-60.0, 0.3, 0.0, 15.0), straight(10.0, 0.0, 0.0, 0.0), CAR, TRUCK),
    "braking": (
        driven(-70.0, 0.0, 0.0, lambda t: max(22.0 - 2.0 * t, 3.0), lambda _: 0.0),
        straight(8.0, 42.0, -math.pi / 2, 10.0),
        CAR,
        CAR,
    ),
    "turning": (
        straight(-50.0, -1.75, 0.0, 15.0),
        driven(30.0, 1.75, math.pi, lambda _: 7.0, lambda s: 1 / 12 if 15.0 < s < 35.0 else 0.0),
        CAR,
        CAR,
    ),
    "backing": (straight(-60.0, 0.0, 0.0, 15.0), straight(6.0, 22.0, math.pi / 2, -5.0), CAR, CAR),
}


@pytest.mark.parametrize("name", CRASHES)
def test_the_crash_happens_in_it_as_it_did(name: str) -> None:
    *trajectories, one, two = CRASHES[name]
    hypothesis, log = crash(*trajectories, bodies=(one, two))
    ours = log.first_contact
    assert ours is not None
    again = replayed(write_published(hypothesis, log)).first_contact
    assert again is not None
    assert math.hypot(again.x_m - ours.x_m, again.y_m - ours.y_m) < 1.0
    for pose, other in ((ours.pose_1, again.pose_1), (ours.pose_2, again.pose_2)):
        assert abs(math.remainder(pose.heading_rad - other.heading_rad, math.tau)) < math.radians(10)


def test_a_reported_speed_is_kept_and_an_inferred_one_becomes_the_mean() -> None:
    *trajectories, one, two = CRASHES["braking"]
    hypothesis, log = crash(*trajectories, bodies=(one, two))
    driven_one, contact_s = log.vehicles[0], log.first_contact.time_s
    travelled_m = float(np.interp(contact_s, driven_one.time_s, driven_one.x_m)) - driven_one.x_m[0]
    speeds = {}
    for source in (SpeedSource.REPORTED, SpeedSource.INFERRED_LIMIT):
        states = tuple(replace(state, speed_source=source) for state in hypothesis.participants)
        content = json.loads(write_published(replace(hypothesis, participants=states), log))
        speeds[source] = content["vehicle1"]["speed_kmh"] / 3.6
    assert speeds[SpeedSource.REPORTED] == pytest.approx(22.0, abs=0.01)
    assert speeds[SpeedSource.INFERRED_LIMIT] == pytest.approx(travelled_m / contact_s, rel=0.01)


def test_on_a_hill_cars_start_above_the_road() -> None:
    network = RoadNetwork(STREET.frame, (replace(STREET.roads[0], elevation=(Cubic(0.0, 7.0),)),))
    hypothesis, log = crash(straight(-40.0, 0.0, 0.0, 15.0, z_m=7.0), straight(5.0, 30.0, -math.pi / 2, 10.0, z_m=7.0))
    content = write_published(hypothesis, log)
    assert json.loads(content)["vehicle1"]["start_position"]["z"] == pytest.approx(7.5)
    assert replayed(content, network).vehicles[0].z_m[0] == pytest.approx(7.0, abs=0.01)


def test_a_crash_that_does_not_happen_cannot_be_told() -> None:
    hypothesis, log = crash(straight(-40.0, 0.0, 0.0, 15.0, until_s=4.0), straight(5.0, 300.0, 0.0, 10.0, until_s=4.0))
    with pytest.raises(UserError, match="without a contact"):
        write_published(hypothesis, log)
