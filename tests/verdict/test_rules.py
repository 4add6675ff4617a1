"""The rules as a truth table: every outcome of the paper's three criteria, alone and together."""

from __future__ import annotations

import itertools
from dataclasses import replace

import pytest

from trace_dag.errors import Reason
from trace_dag.settings import VerdictSettings
from trace_dag.sim.types import SimulationLog, Termination
from trace_dag.verdict.metrics import CrashMeasures, LaterEvent, VehicleMeasures
from trace_dag.verdict.rules import criteria, judgement
from trace_dag.verdict.types import Criterion

VEHICLE = VehicleMeasures(
    number=1,
    clock_h=12.0,
    bearing_clock_h=12.0,
    reported_clock_h=12.0,
    clock_error_h=0.5,
    bearing_clock_error_h=0.5,
    turn_deg=0.0,
    turn_error_deg=3.0,
    initial_speed_mps=20.0,
    impact_speed_mps=20.0,
    reported_speed_mps=20.0,
    initial_speed_error_rel=0.0,
    impact_speed_error_rel=0.0,
    delta_v_mps=10.0,
    pdof_deg=0.0,
    arrival_error_m=0.1,
    path_error_p99_m=0.05,
    tracked_speed_error_p99_rel=0.0,
)
GOOD = CrashMeasures(
    contact_x_m=1.0,
    contact_y_m=0.0,
    contact_distance_m=1.0,
    right_pair=True,
    closing_speed_mps=40.0,
    approach_angle_deg=179.0,
    relation_error_deg=1.0,
    vehicles=(VEHICLE, replace(VEHICLE, number=2)),
    later_events=(),
)
NO_LOG = SimulationLog("embedded", "1", 0.005, (), (), {}, Termination.NO_CONTACT, "they passed 3 m apart", 5.0)
SETTINGS = VerdictSettings()
STRICT = VerdictSettings(rule_set="strict")


def judged(measures: CrashMeasures | None, settings: VerdictSettings = SETTINGS) -> tuple[bool, Reason | None, str]:
    result = judgement(criteria(measures, NO_LOG, settings))
    return result.accepted, result.reason, result.detail


def with_vehicle(measures: CrashMeasures, index: int, **changes: object) -> CrashMeasures:
    vehicles = list(measures.vehicles)
    vehicles[index] = replace(vehicles[index], **changes)
    return replace(measures, vehicles=(vehicles[0], vehicles[1]))


@pytest.mark.parametrize(
    ("near", "clock_1", "clock_2", "turn_1", "turn_2", "relation"), list(itertools.product([True, False], repeat=6))
)
def test_every_criterion_can_reject_and_the_first_one_names_the_reason(
    near: bool, clock_1: bool, clock_2: bool, turn_1: bool, turn_2: bool, relation: bool
) -> None:
    measures = replace(GOOD, contact_distance_m=1.0 if near else 7.0, relation_error_deg=1.0 if relation else 90.0)
    for index, clock, turn in ((0, clock_1, turn_1), (1, clock_2, turn_2)):
        measures = with_vehicle(
            measures, index, clock_error_h=0.5 if clock else 3.1, turn_error_deg=2.0 if turn else 88.0
        )
    if not near:
        expected = Reason.WRONG_LOCATION
    elif not (clock_1 and clock_2):
        expected = Reason.WRONG_IMPACT
    elif not (turn_1 and turn_2 and relation):
        expected = Reason.WRONG_DIRECTION
    else:
        expected = None
    accepted, reason, _ = judged(measures)
    assert reason is expected
    assert accepted is (expected is None)


@pytest.mark.parametrize(
    ("distance", "clock", "turn", "accepted"),
    [(5.0, 2.0, 45.0, True), (5.01, 0.0, 0.0, False), (0.0, 2.01, 0.0, False), (0.0, 0.0, 45.1, False)],
)
def test_thresholds_are_met_inclusively(distance: float, clock: float, turn: float, accepted: bool) -> None:
    measures = replace(GOOD, contact_distance_m=distance)
    measures = with_vehicle(measures, 1, clock_error_h=clock, turn_error_deg=turn)
    assert judged(measures)[0] is accepted


def test_no_contact_is_rejected_with_what_the_simulation_said() -> None:
    accepted, reason, detail = judged(None)
    assert (accepted, reason) == (False, Reason.NO_COLLISION)
    assert "3 m apart" in detail


def test_the_wrong_pair_is_a_wrong_impact() -> None:
    accepted, reason, detail = judged(replace(GOOD, right_pair=False))
    assert (accepted, reason) == (False, Reason.WRONG_IMPACT)
    assert "1 and 2" in detail


def test_one_unknown_impact_is_not_evaluated_and_said_so() -> None:
    accepted, _, detail = judged(with_vehicle(GOOD, 0, clock_error_h=None))
    assert accepted
    assert "clock error of vehicle 1" in detail


def test_nothing_known_is_never_a_silent_pass() -> None:
    unknown = with_vehicle(with_vehicle(GOOD, 0, clock_error_h=None), 1, clock_error_h=None)
    assert judged(unknown)[:2] == (False, Reason.INCOMPLETE_IMPACT)
    undirected = replace(GOOD, relation_error_deg=None)
    for index in (0, 1):
        undirected = with_vehicle(undirected, index, turn_error_deg=None)
    assert judged(undirected)[:2] == (False, Reason.INCOMPLETE_TRAJECTORY)
    found = {(c.name, c.vehicle_number): c for c in criteria(unknown, NO_LOG, SETTINGS)}
    assert found["clock_error", 1].passed is None
    assert found["clock_error", 1].value is None


def test_residuals_are_kept_when_they_pass_and_when_they_fail() -> None:
    def residuals(found: tuple[Criterion, ...]) -> dict[str, float | None]:
        return {criterion.name: criterion.value for criterion in found if criterion.vehicle_number in (None, 2)}

    passed = residuals(criteria(GOOD, NO_LOG, SETTINGS))
    assert passed["contact_distance"] == 1.0
    assert passed["clock_error"] == 0.5
    assert passed["direction_error"] == 3.0
    failed = residuals(criteria(replace(GOOD, contact_distance_m=37.5), NO_LOG, SETTINGS))
    assert failed["contact_distance"] == 37.5


@pytest.mark.parametrize("error", [-0.3, 0.3])
def test_speeds_are_shown_and_reject_only_under_strict_rules(error: float) -> None:
    measures = with_vehicle(GOOD, 0, initial_speed_error_rel=error)
    found = criteria(measures, NO_LOG, SETTINGS)
    assert judgement(found).accepted
    speed = next(c for c in found if c.name == "initial_speed_error" and c.vehicle_number == 1)
    assert (speed.value, speed.passed, speed.reason) == (error, False, None)
    accepted, reason, detail = judged(measures, STRICT)
    assert (accepted, reason) == (False, Reason.WRONG_SPEED)
    assert f"{error:+.0%}" in detail
    assert judged(with_vehicle(measures, 0, initial_speed_error_rel=0.1), STRICT)[0]


@pytest.mark.parametrize(("settings", "beyond_the_paper"), [(SETTINGS, False), (STRICT, True)])
def test_strict_rules_are_the_papers_and_speeds(settings: VerdictSettings, beyond_the_paper: bool) -> None:
    rejecting = {c.name: c.reason for c in criteria(GOOD, NO_LOG, settings) if c.reason is not None}
    assert rejecting.keys() - {"initial_speed_error"} == {
        "contact",
        "contact_distance",
        "clock_error",
        "direction_error",
        "relation_error",
    }
    assert ("initial_speed_error" in rejecting) is beyond_the_paper


def test_a_report_need_not_give_speeds() -> None:
    unknown = GOOD
    for index in (0, 1):
        unknown = with_vehicle(unknown, index, initial_speed_error_rel=None)
    accepted, _, detail = judged(unknown, STRICT)
    assert accepted
    assert "initial speed error of vehicle 2" in detail  # said to be not evaluated


def test_later_events_that_are_not_simulated_are_not_evaluated() -> None:
    measures = replace(GOOD, later_events=(LaterEvent(2, 12, True), LaterEvent(3, 42, None)))
    found = [c for c in criteria(measures, NO_LOG, SETTINGS) if c.name == "later_event"]
    assert [c.passed for c in found] == [True, None]


def test_thresholds_come_from_settings() -> None:
    far = replace(GOOD, contact_distance_m=7.0)
    assert not judged(far)[0]
    assert judged(far, VerdictSettings(max_contact_distance_m=8.0))[0]


def test_the_published_procedure_measures_toward_the_other_centre_within_ten_metres() -> None:
    published = VerdictSettings(rule_set="published", max_contact_distance_m=1.0)
    measures = with_vehicle(replace(GOOD, contact_distance_m=9.0), 0, clock_error_h=4.0, bearing_clock_error_h=1.0)
    assert judged(measures)[1] is Reason.WRONG_LOCATION
    assert judged(measures, published)[0]
    assert judged(with_vehicle(measures, 0, clock_error_h=0.0, bearing_clock_error_h=2.5), published)[1] is (
        Reason.WRONG_IMPACT
    )
    assert not judged(replace(measures, contact_distance_m=10.5), published)[0]
