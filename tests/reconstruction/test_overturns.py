"""Overturns as first harmful event: estimated, simulated and judged, on a street made by hand."""

from __future__ import annotations

from dataclasses import replace

import pytest

from tests.reconstruction.test_run_off_road_planner import PLACE, left_road
from tests.verdict.crashes import STREET, row_of_change
from trace_dag.common.errors import Reason
from trace_dag.common.settings import SimSettings, StateSettings, VerdictSettings
from trace_dag.crash.classes import CrashKind
from trace_dag.crash.record import CrashRecord, EventRecord, VehicleClass
from trace_dag.reconstruction.estimate import estimate
from trace_dag.simulation.embedded import EmbeddedBackend
from trace_dag.simulation.run import simulate
from trace_dag.simulation.states import SpeedSource, StateEstimate
from trace_dag.simulation.types import SimulationLog, overturned_at
from trace_dag.verdict.changed_plans import mirror_departure
from trace_dag.verdict.controls import JudgedCrash
from trace_dag.verdict.judge import judge
from trace_dag.verdict.types import Verdict

OVERTURN, RIGHT, LEFT = 1, 63, 64


def overturned(
    *, to: int = RIGHT, speed_mps: float | None = 28.0, vehicle_class: VehicleClass = VehicleClass.SUV, zone: int = 4
) -> CrashRecord:
    """A vehicle on the street runs off the road and overturns; in zone 1 it overturns on the roadway."""
    crash = left_road(OVERTURN, to=to, clock_h=None, vehicle_class=vehicle_class)
    (car,) = crash.vehicles
    if vehicle_class is VehicleClass.MOTORCYCLE:
        car = replace(car, length_m=2.2, width_m=0.8, height_m=1.4, mass_kg=300.0)
    events = crash.events if zone != 1 else (EventRecord(1, OVERTURN, 1, None, None, None),)
    return replace(crash, vehicles=(replace(car, travel_speed_mps=speed_mps),), events=events, road_relation_code=zone)


def reconstructed(crash: CrashRecord) -> tuple[StateEstimate, tuple[SimulationLog, ...], Verdict]:
    made = estimate(crash, STREET, PLACE, StateSettings())
    logs = simulate(EmbeddedBackend(SimSettings()), STREET, b"", made, SimSettings(), record=crash)
    return made, logs, judge(crash, STREET, PLACE, made, logs, VerdictSettings())


@pytest.mark.parametrize("to", [RIGHT, LEFT])
@pytest.mark.parametrize("vehicle_class", [VehicleClass.SUV, VehicleClass.MOTORCYCLE])
def test_a_vehicle_overturns_beside_the_reported_side_at_the_reported_station(
    vehicle_class: VehicleClass, to: int
) -> None:
    crash = overturned(to=to, vehicle_class=vehicle_class)
    assert crash.kind is CrashKind.OVERTURN
    _, logs, verdict = reconstructed(crash)
    assert verdict.accepted, verdict.detail
    (vehicle,) = logs[verdict.hypothesis].vehicles
    over = overturned_at(vehicle)
    assert over is not None
    assert abs(vehicle.x_m[over]) <= 5.0
    assert abs(vehicle.y_m[over]) > 3.5
    assert logs[verdict.hypothesis].contacts == ()


def test_a_motorcycle_that_falls_on_the_roadway_leaves_it_to_no_side() -> None:
    _, _, verdict = reconstructed(overturned(vehicle_class=VehicleClass.MOTORCYCLE, zone=1))
    assert verdict.accepted, verdict.detail
    side = verdict.criterion("departure_side", 1)
    assert side is not None
    assert side.passed is None


def test_a_reported_speed_that_cannot_tip_a_car_is_kept_and_the_crash_rejected() -> None:
    made, _, verdict = reconstructed(overturned(speed_mps=8.0, vehicle_class=VehicleClass.CAR))
    assert verdict.reason is Reason.NO_OVERTURN
    assert made.best.participants[0].initial_speed_mps == pytest.approx(8.0)


@pytest.mark.parametrize(("limit_mps", "overturns"), [(20.0, True), (12.0, False)])
def test_a_speed_that_nobody_reported_is_raised_as_far_as_some_drive(limit_mps: float, overturns: bool) -> None:
    """One in twenty drives 30 % faster than the limit."""
    crash = overturned(speed_mps=None)
    (car,) = crash.vehicles
    made, _, verdict = reconstructed(replace(crash, vehicles=(replace(car, speed_limit_mps=limit_mps),)))
    assert verdict.accepted is overturns, verdict.detail
    (state,) = made.hypotheses[verdict.hypothesis].participants
    assert state.initial_speed_mps <= 1.3 * limit_mps + 1e-6
    if overturns:
        assert state.initial_speed_mps > limit_mps
        assert state.speed_source is SpeedSource.INFERRED_MANOEUVRE


def test_the_other_side_is_rejected() -> None:
    crash = overturned()
    made, logs, verdict = reconstructed(crash)
    h = verdict.hypothesis
    judged = JudgedCrash(crash, STREET, made.hypotheses[h], logs[h])
    row = row_of_change(judged, "mirrored", mirror_departure(judged))
    assert row.verified is False
    assert row.reason in (Reason.WRONG_SIDE, Reason.NO_DEPARTURE, Reason.NO_OVERTURN)
