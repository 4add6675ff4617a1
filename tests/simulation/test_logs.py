"""Logs: what is in them, that they are the same every time and everywhere, and their files."""

from __future__ import annotations

import hashlib
import math
import subprocess
import sys
from pathlib import Path

import numpy as np
import pyarrow.parquet as pq
import pytest

from tests.simulation.motions import log_of, meeting, participant, straight
from trace_dag.common.errors import Failure
from trace_dag.common.settings import SimSettings
from trace_dag.simulation.log_io import SIMULATION_STEPS, logs_from_files, logs_to_files
from trace_dag.simulation.outlines import Outline, separation
from trace_dag.simulation.types import SimulationLog, VehicleLog


def two_logs() -> tuple[SimulationLog, SimulationLog]:
    beside_each_other = participant(1, straight(0, 0, 0, 9.0)), participant(2, straight(0, 20, 0, 9.0))
    return (
        log_of(meeting(2.2, 18.0, 22.0, 0.4)),
        log_of(beside_each_other, SimSettings(time_limit_s=3.0)),
    )


def digest() -> str:
    """Of both files of two runs."""
    return hashlib.sha256(b"".join(logs_to_files(two_logs()))).hexdigest()


def test_logs_are_the_same_bits_in_every_process() -> None:
    code = "from tests.simulation.test_logs import digest; print(digest())"
    outputs = {
        subprocess.run(
            [sys.executable, "-c", code], check=True, capture_output=True, text=True, cwd=Path(__file__).parents[2]
        ).stdout.strip()
        for _ in range(2)
    }
    assert outputs == {digest()}


def test_files_give_back_the_logs() -> None:
    logs = two_logs()
    again = logs_from_files(*logs_to_files(logs))
    assert len(again) == len(logs)
    for one, two in zip(logs, again, strict=True):
        assert (one.contacts, one.bodies, one.termination, one.reason) == (
            two.contacts,
            two.bodies,
            two.termination,
            two.reason,
        )
        for a, b in zip(one.vehicles, two.vehicles, strict=True):
            for column in SIMULATION_STEPS.columns[2:]:
                assert np.array_equal(getattr(a, column.name), getattr(b, column.name))


def test_the_parquet_file_names_what_its_columns_are(tmp_path: Path) -> None:
    (tmp_path / "log.parquet").write_bytes(logs_to_files(two_logs())[0])
    table = pq.read_table(tmp_path / "log.parquet")
    assert table.schema.field("speed_mps").metadata[b"unit"] == b"mps"
    assert table.column("hypothesis").unique().to_pylist() == [0, 1]
    assert sorted(table.column("vehicle_number").unique().to_pylist()) == [1, 2]
    assert table.column("time_s").to_numpy().min() == 0.0


def test_files_that_are_no_log_are_refused() -> None:
    steps, summary = logs_to_files(two_logs())
    with pytest.raises(Failure, match="simulate again"):
        logs_from_files(steps, b'[{"hypothesis": 0}]')
    with pytest.raises(Failure, match="no steps of vehicle 7"):
        logs_from_files(steps, summary.replace(b'"vehicle_numbers": [\n   1', b'"vehicle_numbers": [\n   7', 1))


def test_the_log_is_on_its_own_clock_and_ends_at_the_end() -> None:
    log = two_logs()[0]
    time = log.vehicles[0].time_s
    on_the_clock = time[np.abs(time / 0.02 - np.round(time / 0.02)) < 1e-6]
    assert np.diff(on_the_clock)[:-1] == pytest.approx(0.02)
    assert time[-1] == pytest.approx(log.duration_s)
    assert np.hypot(log.vehicles[0].velocity_x_mps[-1], log.vehicles[0].velocity_y_mps[-1]) < 0.1


def test_the_deepest_overlap_of_each_tenth_of_a_second_is_in_the_log() -> None:
    """While the bodies press each other: what lies in a dent later is not a deeper contact."""
    log = two_logs()[0]
    contact = log.contacts[0]
    one, two = log.vehicles
    apart = [separation(outline(log, one, k), outline(log, two, k))[0] for k in range(len(one.time_s))]
    beside_the_clock = np.abs(one.time_s / 0.02 - np.round(one.time_s / 0.02)) > 1e-6
    assert beside_the_clock.any()
    tenths = np.floor(one.time_s[beside_the_clock] / 0.1)
    assert len(set(tenths)) == len(tenths)  # one state in each
    for k in np.flatnonzero(beside_the_clock):
        pressing = one.time_s <= contact.time_s + contact.duration_s
        same = pressing & (one.time_s // 0.1 == one.time_s[k] // 0.1)
        assert apart[k] <= min(np.array(apart)[same], default=0.0)
        assert apart[k] < 0
    first = int(np.flatnonzero(beside_the_clock)[0])
    assert 0 < one.time_s[first] - contact.time_s < contact.duration_s


def outline(log: SimulationLog, logged: VehicleLog, k: int) -> Outline:
    body = log.bodies[logged.number]
    x, y, heading = (float(values[k]) for values in (logged.x_m, logged.y_m, logged.heading_rad))
    return Outline(x, y, heading, body.length_m / 2, body.width_m / 2)


def test_velocities_are_the_derivative_of_positions_before_the_contact() -> None:
    log = two_logs()[0]
    vehicle, contact = log.vehicles[1], log.contacts[0]
    before = vehicle.time_s < contact.time_s - 0.05
    assert np.gradient(vehicle.x_m, vehicle.time_s)[before] == pytest.approx(vehicle.velocity_x_mps[before], abs=0.02)
    assert np.gradient(vehicle.y_m, vehicle.time_s)[before] == pytest.approx(vehicle.velocity_y_mps[before], abs=0.02)
    assert vehicle.heading_rad[0] == pytest.approx(2.2)
    assert math.hypot(vehicle.velocity_x_mps[0], vehicle.velocity_y_mps[0]) == pytest.approx(22.0)
