"""Published scenarios: read into the local frame, smoothed to what can be driven, and refused when they are none."""

from __future__ import annotations

import json
import math
from pathlib import Path

import numpy as np
import pytest

from tests.verdict.crashes import record, vehicle
from trace_dag.errors import UserError
from trace_dag.sim.published import PublishedVehicle, constant_speed_trajectory, published_estimate, read_published


def scenario(**changes: object) -> bytes:
    """Vehicle 1 drives south (CARLA's y grows southward), vehicle 2 east."""
    content = {
        "vehicle1": {
            "start_position": {"x": 0.0, "y": -50.0, "z": 0.5},
            "speed_kmh": 36.0,
            "yaw": 90.0,
            "trajectory": [[0.0, -50.0 + 5.0 * i] for i in range(12)],
        },
        "vehicle2": {
            "start_position": {"x": -60.0, "y": 0.0, "z": 0.5},
            "speed_kmh": 54.0,
            "yaw": 0.0,
            "trajectory": [[-60.0 + 5.0 * i, 0.0] for i in range(14)],
        },
        "crash_point": {"x": 0.0, "y": 0.0},
    }
    return json.dumps({**content, **changes}).encode()


def test_carlas_frame_becomes_ours() -> None:
    one, two = read_published(scenario(), name="s.json").vehicles
    assert one.waypoints_m[0] == pytest.approx((0.0, 50.0))  # north of the crash
    assert one.heading_rad == pytest.approx(-math.pi / 2)  # heading south
    assert one.speed_mps == pytest.approx(10.0)
    assert two.heading_rad == pytest.approx(0.0)


def test_a_published_vehicle_keeps_its_speed_and_its_way() -> None:
    estimate = published_estimate(read_published(scenario(), name="s.json"), record(vehicle(1, 12), vehicle(2, 9)))
    for state, speed, heading in zip(estimate.best.participants, (10.0, 15.0), (-math.pi / 2, 0.0), strict=True):
        t = state.trajectory
        travelled = np.hypot(np.diff(t.x_m), np.diff(t.y_m)) / np.diff(t.time_s)
        assert travelled == pytest.approx(speed, rel=0.01)
        assert t.heading_rad == pytest.approx(heading, abs=1e-6)
        assert state.initial_speed_mps == pytest.approx(speed)


def test_jumps_between_lanes_are_smoothed_and_ends_stay() -> None:
    waypoints = np.array([[5.0 * i, 3.5 if i == 6 else 0.0] for i in range(14)])
    t = constant_speed_trajectory(PublishedVehicle(waypoints, 0.0, 20.0))
    lateral = np.abs(np.gradient(np.unwrap(t.heading_rad), t.time_s)) * 20.0
    raw = np.abs(np.diff(np.arctan2(*np.diff(waypoints, axis=0).T[::-1]))).max() / (5.0 / 20.0) * 20.0
    assert lateral.max() < raw / 3
    assert (t.x_m[0], t.y_m[0]) == pytest.approx((0.0, 0.0), abs=0.01)


def test_waypoints_that_can_be_driven_are_kept() -> None:
    """A quarter of a circle of 15 m radius at 8 m/s asks 4.3 m/s2 of the tyres."""
    angle = np.linspace(0.0, math.pi / 2, 6)
    waypoints = 15.0 * np.stack([np.sin(angle), 1 - np.cos(angle)], axis=-1)
    t = constant_speed_trajectory(PublishedVehicle(waypoints, 0.0, 8.0))
    assert np.hypot(t.x_m, t.y_m - 15.0) == pytest.approx(15.0, abs=0.02)


def test_who_points_against_its_way_backs() -> None:
    t = constant_speed_trajectory(PublishedVehicle(np.array([[0.0, 0.0], [-5.0, 0.0], [-10.0, 0.0]]), 0.0, 2.0))
    assert np.cos(t.heading_rad) == pytest.approx(1.0)
    assert set(t.speed_mps) == {-2.0}
    assert t.x_m[-1] < -9.0


def test_a_start_above_the_ground_is_on_the_road_below() -> None:
    vehicle_1 = json.loads(scenario())["vehicle1"]
    vehicle_1["start_position"]["z"] = 12.5
    estimate = published_estimate(
        read_published(scenario(vehicle1=vehicle_1), name="s.json"), record(vehicle(1, 12), vehicle(2, 9))
    )
    assert estimate.best.participants[0].initial_pose.z_m == pytest.approx(12.0)
    assert estimate.best.participants[1].initial_pose.z_m == pytest.approx(0.0)


def test_a_vehicle_without_speed_stands() -> None:
    t = constant_speed_trajectory(PublishedVehicle(np.array([[3.0, 4.0], [8.0, 4.0]]), 0.5, 0.0))
    assert set(t.x_m) == {3.0}
    assert set(t.heading_rad) == {0.5}


@pytest.mark.parametrize(
    "data",
    [
        b"not json",
        b"{}",
        b"[1, 2]",
        scenario(vehicle1={"speed_kmh": 1.0, "yaw": 0.0}),
        scenario(vehicle1={"speed_kmh": 1.0, "yaw": 0.0, "trajectory": []}),
        scenario(vehicle1={"speed_kmh": 1.0, "yaw": 0.0, "trajectory": [[1.0, float("nan")]]}),
        scenario(crash_point=None),
    ],
)
def test_what_is_no_scenario_is_refused_by_name(data: bytes) -> None:
    with pytest.raises(UserError, match=r"s\.json"):
        read_published(data, name="s.json")


def test_every_published_scenario_reads(shared_data: Path) -> None:
    files = sorted((shared_data / "va-2023" / "published" / "simulations").glob("*.json"))
    assert len(files) == 35
    for file in files:
        one, two = read_published(file.read_bytes(), name=file.name).vehicles
        for each in (one, two):
            t = constant_speed_trajectory(each)
            assert np.isfinite(t.x_m).all()
            assert np.hypot(t.x_m - each.waypoints_m[0, 0], t.y_m - each.waypoints_m[0, 1]).min() < 2.0
