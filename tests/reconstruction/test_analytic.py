"""The analytic estimator on the bundled sample, whose truth is known; ``sim/test_real_crashes.py`` has real crashes."""

from __future__ import annotations

import contextlib
import dataclasses
import math
import os
import subprocess
import sys
from pathlib import Path

import pytest
from cases import SAMPLE, SETTINGS, Case, sample_case, sample_cases
from hypothesis import example, given, settings
from hypothesis import strategies as st
from motion_judge import judge_geometry

from lab.truth.vehicles import SampleTruth, load_truth
from trace_dag.common.errors import Failure, Reason, Rejection
from trace_dag.common.units import clock_difference_h, clock_to_bearing_rad
from trace_dag.crash.crash_types import CRASH_TYPES
from trace_dag.crash.derive import impact_area
from trace_dag.crash.event_sequence import sequence_of
from trace_dag.crash.parties import EventKind
from trace_dag.crash.record import ImpactArea, PreCrashMovement, VehicleClass
from trace_dag.reconstruction.alternatives import bearing_from_rad
from trace_dag.reconstruction.estimate import estimate
from trace_dag.roads.map.network import RoadNetwork
from trace_dag.simulation.states import SpeedSource, StateEstimate, estimate_from_json, estimate_to_json


def estimated(case: Case) -> StateEstimate:
    return estimate(case.record, case.network, case.report, SETTINGS.states)


@pytest.fixture(scope="module")
def sample() -> dict[str, StateEstimate]:
    found = {}
    for case in sample_cases():
        with contextlib.suppress(Rejection):
            found[case.key] = estimated(case)
    return found


@pytest.fixture(scope="module")
def truth() -> SampleTruth:
    return load_truth(SAMPLE / "truth.json")


def test_approach_lane_and_impact_of_the_sample_are_found(sample, truth):
    from lab.truth.vehicles import score_truth

    summary = score_truth(truth, sample).summary
    assert summary.estimated >= 30
    assert summary.approach_correct_share >= 0.94
    assert summary.lane_correct_share >= 0.94
    assert summary.median_impact_point_error_m <= 0.5
    assert summary.median_heading_error_deg <= 5
    assert summary.median_initial_position_error_m <= 3


def test_every_crash_of_the_sample_with_a_truth_gets_an_estimate(sample, truth):
    wanted = {case.key for case in sample_cases()} & {crash.key for crash in truth.crashes if crash.vehicles}
    assert wanted <= set(sample)


def test_reported_speeds_are_kept_exactly(sample):
    records = {case.key: case.record for case in sample_cases()}
    for key, made in sample.items():
        reported = {vehicle.number: vehicle.travel_speed_mps for vehicle in records[key].vehicles}
        for hypothesis in made.hypotheses:
            for state in hypothesis.participants:
                if reported[state.vehicle_number] is None:
                    assert state.speed_source is not SpeedSource.REPORTED
                else:
                    assert state.speed_source is SpeedSource.REPORTED
                    assert abs(state.initial_speed_mps) == pytest.approx(reported[state.vehicle_number], abs=1e-6)


def test_motion_of_every_kept_hypothesis_holds_before_independent_judges(sample):
    records = {case.key: case.record for case in sample_cases()}
    met_first = [key for key in sample if sequence_of(records[key]).first.kind is EventKind.VEHICLE_CONTACT]
    kept = [hypothesis for key in met_first for hypothesis in sample[key].hypotheses]
    assert len(kept) > len(met_first) > 30
    for hypothesis in kept:
        judge_geometry(hypothesis)


def test_hypotheses_are_ranked_and_their_evidence_adds_up(sample):
    for made in sample.values():
        failed = [sum(not check.passed for check in hypothesis.checks) for hypothesis in made.hypotheses]
        assert failed == sorted(failed)
        for hypothesis in made.hypotheses:
            assert sum(hypothesis.evidence.values()) == pytest.approx(hypothesis.score, abs=1e-4)
        assert 0 <= made.ambiguity <= 1
        assert len(made.hypotheses) <= SETTINGS.states.max_hypotheses
        assert len({hypothesis.name for hypothesis in made.hypotheses}) == len(made.hypotheses)


def test_another_side_comes_before_other_lanes_where_the_point_leaves_it_open():
    """Two cars going straight over a crossing of four ways, and nothing else told. A point exact to 2.5 m is in one
    quarter of the crossing, where cars of two sides alone meet; a point that is off by 15 m tells no quarter."""
    case = sample_case("2023-319001")
    untold = {"crash_type_code": None, "critical_event_code": None, "impact": None, "travel_speed_mps": None}
    vehicles = tuple(dataclasses.replace(vehicle, **untold) for vehicle in case.record.vehicles)
    exact = dataclasses.replace(case.record, vehicles=vehicles)

    def sides(record):
        made = estimate(record, case.network, case.report, SETTINGS.states)
        bearings = [[bearing_from_rad(state) for state in each.participants] for each in made.hypotheses]
        return made, [tuple(round(bearing / (math.pi / 2)) for bearing in each) for each in bearings]

    made, found = sides(exact)
    assert len({frozenset(each) for each in found}) == 1  # of which side each came stays open
    assert made.ambiguity < 0.2  # a share is kept for what nobody thought of
    made, found = sides(dataclasses.replace(exact, position_accuracy_m=15.0))
    assert found[1] != found[0]
    assert made.ambiguity > 0.4


def test_the_same_json_twice_and_in_another_process():
    key = "2023-319022"
    first = estimate_to_json(estimated(sample_case(key)))
    assert estimate_to_json(estimated(sample_case(key))) == first
    code = (
        f"import sys; sys.path.insert(0, {str(Path(__file__).parents[1])!r})\n"
        "from cases import SETTINGS, sample_case\n"
        "from trace_dag.reconstruction.estimate import estimate\n"
        "from trace_dag.simulation.states import estimate_to_json\n"
        f"case = sample_case({key!r})\n"
        "made = estimate(case.record, case.network, case.report, SETTINGS.states)\n"
        "sys.stdout.buffer.write(estimate_to_json(made))\n"
    )
    other = subprocess.run(
        [sys.executable, "-c", code], capture_output=True, check=True, env=os.environ | {"PYTHONHASHSEED": "77"}
    )
    assert other.stdout == first


def test_json_round_trip(sample):
    for made in list(sample.values())[:5]:
        data = estimate_to_json(made)
        assert estimate_to_json(estimate_from_json(data)) == data
    with pytest.raises(Failure, match="not a state estimate"):
        estimate_from_json(b'{"key": 3}')


def test_order_of_vehicles_in_the_record_does_not_matter():
    case = sample_case("2023-319022")
    swapped = dataclasses.replace(case.record, vehicles=case.record.vehicles[::-1])
    made = estimate(swapped, case.network, case.report, SETTINGS.states)
    assert made.best.name == estimated(case).best.name


def test_two_standing_vehicles_are_no_crash():
    case = sample_case("2023-319022")
    standing = tuple(
        dataclasses.replace(vehicle, travel_speed_mps=0.0, movement=PreCrashMovement.STOPPED)
        for vehicle in case.record.vehicles
    )
    with pytest.raises(Rejection, match="in none do the bodies touch") as caught:
        estimate(dataclasses.replace(case.record, vehicles=standing), case.network, case.report, SETTINGS.states)
    assert caught.value.reason is Reason.NO_FEASIBLE_STATE


@pytest.mark.parametrize("lead_time_s", [3.0, 7.5])
def test_the_lead_time_is_a_setting(lead_time_s):
    case = sample_case("2023-319022")
    chosen = SETTINGS.states.model_copy(update={"lead_time_s": lead_time_s})
    best = estimate(case.record, case.network, case.report, chosen).best
    assert best.impact_time_s == lead_time_s
    assert all(check.passed for check in best.checks)


codes = st.sampled_from(sorted(CRASH_TYPES))
areas = st.one_of(st.none(), st.integers(1, 12))
bodies = st.sampled_from(
    [(VehicleClass.MOTORCYCLE, 2.2, 0.8), (VehicleClass.CAR, 4.8, 1.9), (VehicleClass.TRACTOR_TRAILER, 21.0, 2.6)]
)
vehicles = st.tuples(
    codes,
    st.sampled_from(list(PreCrashMovement)),
    areas,
    st.one_of(st.none(), st.just(0.0), st.floats(1e-3, 67)),
    bodies,
    st.sampled_from([None, 10, 15, 17, 54, 62, 66, 71, 99]),
    st.sampled_from([None, 1, 16]),
)


@settings(max_examples=40)
@given(vehicles, vehicles, st.integers(0, 2))
@example(  # backs at 87 mph; the turn that it comes to lies beyond the impact
    (0, PreCrashMovement.NO_DRIVER, None, None, (VehicleClass.MOTORCYCLE, 2.2, 0.8), None, None),
    (0, PreCrashMovement.BACKING, 1, 39.0, (VehicleClass.TRACTOR_TRAILER, 21.0, 2.6), None, None),
    1,
)
@example(  # at 150 mph the map ends too near for the time before the impact
    (22, PreCrashMovement.NO_DRIVER, None, 67.0, (VehicleClass.TRACTOR_TRAILER, 21.0, 2.6), None, None),
    (28, PreCrashMovement.NO_DRIVER, None, 3.0, (VehicleClass.MOTORCYCLE, 2.2, 0.8), 10, None),
    0,
)
def test_the_motion_of_any_record_holds_or_the_crash_is_rejected(one, two, place):
    case = sample_cases()[place]
    changed = []
    for vehicle, (code, movement, area, speed, body, event, avoidance) in zip(
        case.record.vehicles, (one, two), strict=True
    ):
        impact = None
        if area is not None:
            impact = ImpactArea(area, float(area), clock_to_bearing_rad(area), math.radians(15))
        changed.append(
            dataclasses.replace(
                vehicle,
                crash_type_code=code,
                movement=movement,
                impact=impact,
                travel_speed_mps=speed,
                vehicle_class=body[0],
                length_m=body[1],
                width_m=body[2],
                critical_event_code=event,
                avoidance_code=avoidance,
            )
        )
    record = dataclasses.replace(case.record, vehicles=tuple(changed))
    try:
        made = estimate(record, case.network, case.report, SETTINGS.states)
    except Rejection as rejection:
        event_of(rejection)
        return
    for hypothesis in made.hypotheses:
        judge_geometry(hypothesis)
        for state, vehicle in zip(hypothesis.participants, changed, strict=True):
            if vehicle.travel_speed_mps is not None:
                assert abs(state.initial_speed_mps) == pytest.approx(vehicle.travel_speed_mps, abs=1e-6)
    data = estimate_to_json(made)
    assert estimate_to_json(estimate_from_json(data)) == data


def event_of(rejection: Rejection) -> None:
    """Check that a rejection is one of this stage."""
    if rejection.reason not in (Reason.NO_FEASIBLE_STATE, Reason.MAP_TOO_SMALL):
        raise rejection


def test_a_map_without_roads_is_a_rejection():
    case = sample_case("2023-319022")
    empty = RoadNetwork(case.network.frame, ())
    for movement in (PreCrashMovement.GOING_STRAIGHT, PreCrashMovement.BACKING):
        vehicles = tuple(dataclasses.replace(vehicle, movement=movement) for vehicle in case.record.vehicles)
        record = dataclasses.replace(case.record, vehicles=vehicles)
        with pytest.raises(Rejection, match="no lane of the map passes the crash"):
            estimate(record, empty, case.report, SETTINGS.states)


@pytest.mark.parametrize("clock", [1, 11])
def test_oncoming_vehicles_meet_with_the_sides_that_are_reported(clock: int):
    """A vehicle that comes from the left, across the other's whole lane, is struck on the right, as is the other."""
    case = sample_case("2023-319022")  # a car crosses the centreline
    vehicles = tuple(dataclasses.replace(each, impact=impact_area(clock)) for each in case.record.vehicles)
    events = tuple(
        dataclasses.replace(each, area_1=impact_area(clock), area_2=impact_area(clock)) if each.party_2 else each
        for each in case.record.events
    )
    record = dataclasses.replace(case.record, vehicles=vehicles, events=events)
    best = estimate(record, case.network, case.report, SETTINGS.states).best
    for state in best.participants:
        assert clock_difference_h(state.impact_clock_h, clock) <= 0.7
