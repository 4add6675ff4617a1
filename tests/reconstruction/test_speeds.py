"""Speeds: what is reported is kept, what is not is inferred and marked, distances are the integral of speed."""

from __future__ import annotations

import dataclasses

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from tests.verdict.crashes import record
from trace_dag.common.units import mph_to_mps
from trace_dag.crash.crash_types import CRASH_TYPES, CrashType, Turn
from trace_dag.crash.record import CrashRecord, PreCrashMovement, VehicleClass, VehicleRecord
from trace_dag.reconstruction.motion.speed_coefficients import BRAKING, LEVELS
from trace_dag.reconstruction.motion.speed_prior import speed_kept_distribution, speed_profile
from trace_dag.reconstruction.motion.speeds import SpeedProfile, travel_speed
from trace_dag.reconstruction.pre_crash_scenarios import party
from trace_dag.roads.map.model import Road
from trace_dag.simulation.states import SpeedSource

CAR = VehicleRecord(1, VehicleClass.CAR, 4.8, 1.9, 1.5, 1500.0)


def profile_of(vehicle: VehicleRecord, speed_mps: float) -> SpeedProfile:
    report = record(vehicle, car(number=2))
    return speed_profile(party(report, vehicle), speed_mps)


def car(**changes: object) -> VehicleRecord:
    return dataclasses.replace(CAR, **changes)


@given(st.floats(0, 70), st.floats(0, 1), st.floats(0.1, 6), st.floats(0.5, 8))
def test_distance_is_the_integral_of_speed_and_the_impact_is_a_sample(initial, share, change_s, lead_s):
    profile = SpeedProfile(initial, initial * share, change_s)
    time, distance, speed = profile.sample(lead_s, 2.0)
    impact = int(np.argmin(np.abs(time - lead_s)))
    assert time[0] == 0
    assert time[impact] == pytest.approx(lead_s, abs=1e-9)
    assert distance[impact] == pytest.approx(0, abs=1e-9)
    braking_s = min(change_s, max(lead_s - 0.5, lead_s / 2))  # it begins half a second after the start, or half way
    held_mps = initial - 0.75 * 9.80665 * braking_s  # tyres hold no more
    in_vain = braking_s < change_s and held_mps > profile.impact_mps
    assert speed[0] == pytest.approx(initial, abs=1e-9)
    assert speed[impact] == pytest.approx(held_mps if in_vain else profile.impact_mps, abs=1e-9)
    integral = np.concatenate([[0], np.cumsum((speed[1:] + speed[:-1]) / 2 * np.diff(time))])
    # Trapezoids miss half a step's worth where the rate sets in.
    assert np.abs((distance - distance[0]) - integral).max() <= 0.02 * 0.02 * initial / braking_s + 1e-6


@given(st.floats(0.1, 67))
def test_a_reported_speed_is_the_initial_speed_exactly(speed):
    for movement in PreCrashMovement:
        vehicle = car(travel_speed_mps=speed, movement=movement, avoidance_code=16, traffic_control_code=20)
        found = travel_speed(vehicle, CRASH_TYPES[68], Turn.LEFT, None, crossing=True)
        assert (found.speed_mps, found.source) == (speed, SpeedSource.REPORTED)
        assert profile_of(vehicle, speed).initial_mps == speed


def test_constant_unless_the_record_states_otherwise():
    assert profile_of(car(movement=PreCrashMovement.TURNING_LEFT), 15.0) == SpeedProfile(15.0, 15.0)
    assert profile_of(car(avoidance_code=6), 15.0) == SpeedProfile(15.0, 15.0)


@pytest.mark.parametrize("avoidance", [2, 3, 4, 8, 9, 15, 16])
def test_braking_reported_is_braking_done(avoidance):
    profile = profile_of(car(avoidance_code=avoidance), 25.0)
    assert profile.impact_mps < 25


def test_vehicles_without_reported_braking_lose_speed_by_their_role():
    """ACC_TYPE 20 runs into one that stands, 86 crosses; recorders have the shares. Of many crashes as many brake, and
    half keep no more than half of the recorders; each has the same draw every time."""
    for crash_type, role in ((20, "behind"), (86, "crossing"), (1, "alone")):
        vehicle = car(crash_type_code=crash_type)
        crashes = [survived(record(vehicle, car(number=2)), f"2015-{number}") for number in range(400)]
        found = [speed_profile(party(crash, vehicle), 20.0) for crash in crashes]
        assert found[:20] == [speed_profile(party(crash, vehicle), 20.0) for crash in crashes[:20]]
        brake = float(np.interp(1.0, BRAKING[role], LEVELS))
        assert np.mean([each.impact_mps < 20.0 for each in found]) == pytest.approx(brake, abs=0.07)
        kept = min(float(np.interp(0.5, LEVELS, BRAKING[role])), 1.0)
        assert np.median([each.impact_mps for each in found]) == pytest.approx(20.0 * kept, abs=1.0)
        lost = [(20.0 - each.impact_mps) / each.change_time_s / 9.81 for each in found if each.change_time_s]
        assert 0.25 < np.median(lost) < 0.5, "half of the recorders that braked had 0.34 g"
        assert max(lost) <= 0.8, "no more than tyres hold"
        assert max(each.change_time_s for each in found) <= 4.0


def test_a_death_counts_faster_impacts_more():
    """By the table half of those behind (ACC_TYPE 20) keep at most 0.859 of their speed. Counted by the power 1.5 of it
    (trapezoids over the table: 0.259 below the median, 0.479 above), they are 35 % in fatal crashes."""
    vehicle = car(crash_type_code=20)
    keys = [f"2015-{number}" for number in range(400)]
    lived, died = (
        [speed_profile(party(of(record(vehicle, car(number=2)), key), vehicle), 20.0).impact_mps for key in keys]
        for of in (survived, lambda crash, key: dataclasses.replace(crash, key=key))
    )
    assert all(one <= other for one, other in zip(lived, died, strict=True))
    assert np.mean(np.array(died) <= 20.0 * 0.859) == pytest.approx(0.35, abs=0.07)


def test_a_death_says_nothing_of_the_speed_of_a_vehicle_struck_from_behind():
    """ACC_TYPE 23, struck while slower: the slower it is, the harder it is struck."""
    vehicle = car(crash_type_code=23)
    crash = record(vehicle, car(number=2))
    lived = speed_kept_distribution(party(survived(crash, crash.key), vehicle))
    assert speed_kept_distribution(party(crash, vehicle)) == lived


def survived(crash: CrashRecord, key: str) -> CrashRecord:
    return dataclasses.replace(crash, key=key, register="a register of all crashes", fatalities=0)


def test_a_road_without_a_limit_has_the_one_that_fatal_crashes_report_there():
    for highway, mph in (("residential", 35), ("tertiary", 40), ("service", 10)):
        road = Road("1", 100.0, (), (), highway=highway)
        found = travel_speed(CAR, CrashType(), None, road, crossing=False)
        assert (found.speed_mps, found.source) == (pytest.approx(mph_to_mps(mph)), SpeedSource.INFERRED_CLASS)


def test_starting_begins_at_rest():
    vehicle = car(movement=PreCrashMovement.STARTING)
    found = travel_speed(vehicle, CrashType(), None, None, crossing=False)
    assert found.speed_mps == 0
    assert profile_of(vehicle, 0.0).impact_mps > 3


@pytest.mark.parametrize(
    ("vehicle", "crash_type", "turn", "expected", "source"),
    [
        (car(movement=PreCrashMovement.STOPPED), CrashType(), None, 0.0, SpeedSource.INFERRED_MANOEUVRE),
        (CAR, CRASH_TYPES[21], None, 0.0, SpeedSource.INFERRED_MANOEUVRE),
        (car(speed_limit_mps=mph_to_mps(45)), CrashType(), None, mph_to_mps(45), SpeedSource.INFERRED_LIMIT),
        (car(speed_limit_mps=mph_to_mps(45)), CrashType(), Turn.LEFT, mph_to_mps(15), SpeedSource.INFERRED_MANOEUVRE),
        (CAR, CrashType(), None, mph_to_mps(35), SpeedSource.INFERRED_CLASS),
    ],
)
def test_unreported_speeds_say_where_they_come_from(vehicle, crash_type, turn, expected, source):
    found = travel_speed(vehicle, crash_type, turn, None, crossing=False)
    assert found.speed_mps == pytest.approx(expected)
    assert found.source is source
