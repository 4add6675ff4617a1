"""Speeds that nobody reported: what the learned distributions have to be like, whatever they were fitted to."""

from __future__ import annotations

import dataclasses

import pytest
from cases import sample_case

from trace_dag.common.units import mph_to_mps
from trace_dag.crash.record import PreCrashMovement, VehicleRecord
from trace_dag.reconstruction.motion.speed_coefficients import BRAKING, LEVELS, SHIFTS_MPH, SPREAD_MPH
from trace_dag.reconstruction.motion.speed_prior import (
    Distribution,
    Role,
    SpeedClass,
    features,
    speed_kept_distribution,
    travel_speed_distribution,
)
from trace_dag.reconstruction.motion.speeds import travel_speed
from trace_dag.reconstruction.pre_crash_scenarios import Party, party

KEY = "2023-319003"


def unreported(**changes: object) -> Party:
    vehicle = dataclasses.replace(
        sample_case(KEY).record.vehicles[0],
        travel_speed_mps=None,
        speed_limit_mps=mph_to_mps(45),
        movement=PreCrashMovement.GOING_STRAIGHT,
        crash_type_code=88,
        traffic_control_code=0,
        avoidance_code=None,
        speeding=False,
        **changes,
    )
    return party(sample_case(KEY).record, vehicle)


def distribution(own: Party) -> Distribution:
    rule = travel_speed(own.vehicle, own.crash_type, own.turn, None, crossing=True)
    return travel_speed_distribution(own, rule)


def test_the_tables_name_every_feature_class_and_role_at_every_level() -> None:
    own = unreported()
    rule = travel_speed(own.vehicle, own.crash_type, own.turn, None, crossing=True)
    assert set(features(own, rule)) == set(SHIFTS_MPH)
    assert (set(SPREAD_MPH), set(BRAKING)) == (set(SpeedClass), set(Role))
    for values in (*SPREAD_MPH.values(), *BRAKING.values()):
        assert len(values) == len(LEVELS)
        assert list(values) == sorted(values)


def test_through_traffic_drives_about_the_limit_and_speeders_faster() -> None:
    along = distribution(unreported())
    assert along.median == pytest.approx(mph_to_mps(45), abs=mph_to_mps(5))
    assert along.at(0.1) < along.median < along.at(0.9)
    speeding = distribution(dataclasses.replace(own := unreported(), vehicle=changed(own.vehicle, speeding=True)))
    assert speeding.median > mph_to_mps(45 + 10)


def changed(vehicle: VehicleRecord, **changes: object) -> VehicleRecord:
    return dataclasses.replace(vehicle, **changes)


def test_a_standing_vehicle_stands() -> None:
    own = unreported()
    stood = party(sample_case(KEY).record, changed(own.vehicle, movement=PreCrashMovement.STOPPED))
    assert distribution(stood).at(0.9) == 0.0
    assert speed_kept_distribution(stood).at(0.1) == 1.0


def test_braking_takes_speed_unless_the_report_states_that_nothing_was_done() -> None:
    own = unreported()
    kept = speed_kept_distribution(own)
    assert 0.0 < kept.at(0.1) < kept.median <= 1.0
    nothing = party(sample_case(KEY).record, changed(own.vehicle, avoidance_code=1))
    assert speed_kept_distribution(nothing).at(0.1) == 1.0


def test_between_levels_a_distribution_is_straight() -> None:
    found = Distribution(tuple(10 * level for level in LEVELS))
    assert found.at(0.37) == pytest.approx(3.7)


def test_the_tables_are_what_the_data_give(shared_data) -> None:
    """Fitted anew to the reports and recorders at hand, as their docstring says they were."""
    from lab.fit_speeds import fit_braking, fit_shifts, fit_spread, masked, read_reports, recorded_speeds

    tables = sorted((shared_data / "fars-csv").iterdir())
    rows = list(masked(read_reports(tables, [shared_data / "va-2023" / "reports"])))
    recorded = recorded_speeds(shared_data / "ciren" / "cases.json")
    assert (len(rows), len(recorded)) == (318, 148)
    shifts = fit_shifts(rows)
    assert shifts == pytest.approx(SHIFTS_MPH, abs=0.02)
    for fitted, stored in ((fit_spread(rows, shifts), SPREAD_MPH), (fit_braking(recorded), BRAKING)):
        assert set(fitted) == set(stored)
        for name, values in fitted.items():
            assert values == pytest.approx(stored[name], abs=0.02), name
