"""Departures from the road: planned by the analytic estimator, simulated, judged, and their controls."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest

from tests.verdict.crashes import STREET, area, record, row_of_change, two_way, vehicle
from trace_dag.common.errors import Reason
from trace_dag.common.settings import SimSettings, StateSettings, VerdictSettings
from trace_dag.crash.classes import CrashKind
from trace_dag.crash.parties import thing_party
from trace_dag.crash.record import CrashRecord, EventRecord, VehicleClass
from trace_dag.reconstruction.estimate import estimate
from trace_dag.reconstruction.motion.departure_paths import angle_log_likelihood
from trace_dag.roads.map.network import RoadNetwork
from trace_dag.roads.report import CrashPlacement, MapReport
from trace_dag.simulation.embedded import EmbeddedBackend
from trace_dag.simulation.objects import PlacedBy
from trace_dag.simulation.run import simulate
from trace_dag.simulation.states import StateEstimate
from trace_dag.simulation.types import SimulationLog
from trace_dag.verdict.changed_plans import mirror_departure, object_moved
from trace_dag.verdict.controls import JudgedCrash, changed_reports
from trace_dag.verdict.judge import judge
from trace_dag.verdict.types import Verdict

PLACE = MapReport("by hand", CrashPlacement(0.0, 0.0, 0.0, "1", 0.0, "nearest road"), ())
TREE, POLE, CURB, GUARDRAIL, DITCH, SIGN = 42, 30, 33, 24, 34, 59
RIGHT, LEFT = 63, 64


def left_road(
    *codes: int,
    to: int = RIGHT,
    clock_h: int | None = 12,
    speed_mps: float = 20.0,
    stability: int | None = None,
    vehicle_class: VehicleClass = VehicleClass.CAR,
) -> CrashRecord:
    """A car on the street runs off the road and strikes objects, the first one in the reported area."""
    car = replace(
        vehicle(1, clock_h, 1 if to == RIGHT else 6, speed_mps=speed_mps),
        stability_code=stability,
        vehicle_class=vehicle_class,
    )
    events = [EventRecord(1, to, 1, None, None, None)]
    for number, code in enumerate(codes, 2):
        struck = area(clock_h) if clock_h is not None and number == 2 else None
        events.append(EventRecord(number, code, 1, struck, thing_party(number), None))
    made = record(car, car, events=tuple(events))
    return replace(
        made, vehicles=(car,), vehicles_in_transport=1, first_harmful_event_code=codes[0], road_relation_code=4
    )


def reconstructed(crash: CrashRecord) -> tuple[StateEstimate, tuple[SimulationLog, ...], Verdict]:
    made = estimate(crash, STREET, PLACE, StateSettings())
    logs = simulate(EmbeddedBackend(SimSettings()), STREET, b"", made, SimSettings(), record=crash)
    return made, logs, judge(crash, STREET, PLACE, made, logs, VerdictSettings())


def judged_crash(crash: CrashRecord) -> JudgedCrash:
    made, logs, verdict = reconstructed(crash)
    assert verdict.accepted, verdict.detail
    return JudgedCrash(crash, STREET, made.hypotheses[verdict.hypothesis], logs[verdict.hypothesis])


# --- planned, simulated and judged -----------------------------------------------------------------------------------
@pytest.mark.parametrize("to", [RIGHT, LEFT])
@pytest.mark.parametrize("code", [TREE, POLE, CURB, GUARDRAIL, DITCH, SIGN])
def test_an_object_of_the_reported_kind_is_struck_beside_the_reported_side(code: int, to: int) -> None:
    crash = left_road(code, to=to)
    assert crash.kind is CrashKind.FIXED_OBJECT
    made, logs, verdict = reconstructed(crash)
    assert verdict.accepted, verdict.detail
    hypothesis, log = made.hypotheses[verdict.hypothesis], logs[verdict.hypothesis]
    (item,) = hypothesis.objects
    assert (item.code, item.number, item.placed_by) == (code, 2002, PlacedBy.PROGRAM)
    contact = log.first_contact
    assert contact is not None
    # The street runs along the x axis through the reported point, 3.5 m wide to either side.
    assert abs(contact.x_m) <= 5.0
    came = math.cos(contact.pose_1.heading_rad)
    assert contact.y_m * came * (-1 if to == RIGHT else 1) > 3.5


@pytest.mark.parametrize(("clock_h", "stability"), [(3, 4), (9, 3), (6, None), (4, 4)])
def test_a_vehicle_that_skids_is_turned_until_the_area_faces_the_tree(clock_h: int, stability: int | None) -> None:
    made, _, verdict = reconstructed(left_road(TREE, clock_h=clock_h, stability=stability))
    assert verdict.accepted, verdict.detail
    (car,) = made.hypotheses[verdict.hypothesis].participants
    assert car.skids_from_s is not None
    error = verdict.criterion("clock_error", 1)
    assert error is not None
    assert error.value == pytest.approx(0.0, abs=0.3)


def test_angles_of_departure_are_likely_as_they_were_measured() -> None:
    """877 departures: a mean of 16.9 degrees, a standard deviation of 10.5 (NCHRP Report 665)."""
    roots = np.arange(0.0, 9.0, 0.01)
    angles_deg = roots**2
    weights = np.exp([angle_log_likelihood(math.radians(angle)) for angle in angles_deg])
    mean = np.average(angles_deg, weights=weights)
    assert mean == pytest.approx(16.9, rel=0.02)
    assert math.sqrt(np.average((angles_deg - mean) ** 2, weights=weights)) == pytest.approx(10.5, rel=0.03)


@pytest.mark.parametrize("speed_mps", [15.0, 20.0, 25.0, 30.0])
def test_guardrails_are_struck_as_hard_as_real_ones(speed_mps: float) -> None:
    """In 868 departures the energy across the road was 18.5 kJ in the median and 98.5 in one of ten (NCHRP Report 665,
    table 78): of a car of 1.5 t, 5 and 11.5 m/s across. Who drifts off a narrow street does so from nearby."""
    _, logs, verdict = reconstructed(left_road(GUARDRAIL, speed_mps=speed_mps))
    assert verdict.accepted
    along_mps, across_mps = map(abs, logs[0].first_contact.velocity_1_mps)  # the street runs along x
    assert 2.5 < across_mps < 11.5
    shown = {criterion.name: criterion.value for criterion in verdict.criteria}
    assert shown["angle_to_road"] == pytest.approx(math.degrees(math.atan2(across_mps, along_mps)), abs=1.0)


def test_objects_behind_a_curb_are_struck_after_it() -> None:
    made, logs, verdict = reconstructed(left_road(CURB, POLE))
    assert verdict.accepted, verdict.detail
    log = logs[verdict.hypothesis]
    struck = [contact.number_2 for contact in sorted(log.contacts, key=lambda contact: contact.time_s)]
    assert list(dict.fromkeys(struck)) == [2002, 2003]
    later = next(each for each in verdict.criteria if each.name == "later_object")
    assert (later.event_number, later.passed) == (3, True)
    assert [item.name for item in made.best.objects] == ["curb", "utility pole or light support"]


def test_an_area_that_is_not_known_is_not_evaluated() -> None:
    _, _, verdict = reconstructed(left_road(TREE, clock_h=None))
    assert verdict.accepted
    error = verdict.criterion("clock_error", 1)
    assert error is not None
    assert error.passed is None


def test_another_side_zone_or_object_is_not_what_happened() -> None:
    crash = left_road(TREE)
    made, logs, _ = reconstructed(crash)

    def reason(report: CrashRecord) -> Reason | None:
        return judge(report, STREET, PLACE, made, logs, VerdictSettings()).reason

    on_roadway = replace(crash, road_relation_code=1)
    assert reason(left_road(TREE, to=LEFT)) is Reason.WRONG_SIDE
    assert reason(left_road(POLE)) is Reason.WRONG_PARTY
    assert reason(on_roadway) is Reason.WRONG_ZONE
    assert reason(left_road(TREE, clock_h=6)) is Reason.WRONG_IMPACT


# --- controls ------------------------------------------------------------------------------------------------------
@pytest.mark.parametrize("code", [TREE, GUARDRAIL])
def test_the_other_side_and_a_moved_object_are_rejected(code: int) -> None:
    crash = judged_crash(left_road(code))
    mirrored = row_of_change(crash, "mirrored", mirror_departure(crash))
    moved = row_of_change(crash, "moved", object_moved(crash, VerdictSettings()))
    assert (mirrored.verified, moved.verified) == (False, False)
    assert mirrored.reason in (Reason.WRONG_SIDE, Reason.NO_DEPARTURE)
    assert moved.reason in (Reason.WRONG_LOCATION, Reason.NO_COLLISION)


def test_a_report_of_another_object_does_not_pass_for_the_own_one() -> None:
    crashes = [judged_crash(replace(left_road(code), key=f"2023-{code}")) for code in (TREE, POLE)]
    rows = changed_reports(crashes[0], crashes, VerdictSettings())
    assert [(row.kind, row.other_key, row.reports_differ, row.verified) for row in rows] == [
        ("other_report", "2023-30", True, False)
    ]


@pytest.mark.parametrize("to", [RIGHT, LEFT])
def test_a_coded_point_beside_the_road_states_to_which_side_and_how_far_off(to: int) -> None:
    """The street runs along y = 12 m, its edge is at 8.5: the point is south of it, 8.5 m off."""
    street = RoadNetwork(STREET.frame, (two_way("1", -300.0, 12.0, 0.0, 600.0),))
    place = replace(PLACE, placement=CrashPlacement(0.0, 10.25, 0.0, "1", 10.25, "nearest road"))
    best = estimate(left_road(TREE, to=to), street, place, StateSettings()).best
    (state,), (tree,) = best.participants, best.objects
    assert tree.pose.y_m == pytest.approx(0.0, abs=0.5)
    heading = 1.0 if to == RIGHT else -1.0  # south is to the right of who drives east
    assert math.copysign(1.0, math.cos(state.initial_pose.heading_rad)) == heading
