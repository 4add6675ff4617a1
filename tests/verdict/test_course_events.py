"""Reported events that are not harmful beside the simulated course, and the road that each vehicle drives along."""

from __future__ import annotations

import math
from dataclasses import replace

import example_objects
import numpy as np
import pytest

from tests.simulation.motions import straight
from tests.verdict.crashes import CROSSROADS, STREET, one_way, simulated, vehicle
from tests.verdict.test_judge import ANGLE, ANGLE_RECORD, HALF, HEAD_ON, HEAD_ON_RECORD, REPORT
from trace_dag.common.errors import Reason
from trace_dag.common.settings import VerdictSettings
from trace_dag.crash.classes import CollisionType, RoadTopology
from trace_dag.crash.crash_types import SIDE_OF_EVENT, DepartureSide
from trace_dag.crash.event_sequence import sequence_of
from trace_dag.crash.record import CrashRecord, EventRecord
from trace_dag.roads.crash_site.agreement import compare
from trace_dag.roads.map.network import RoadNetwork
from trace_dag.verdict.course_events import course_doubts
from trace_dag.verdict.judge import judge_hypothesis
from trace_dag.verdict.observation import observe_crash
from trace_dag.verdict.reservations import simulation_doubts
from trace_dag.verdict.rules import Comparison
from trace_dag.verdict.types import Doubt

CENTRELINE, MEDIAN, RIGHT, BACK, AIRBORNE = 68, 65, 63, 69, 67
DIVIDED = RoadNetwork(STREET.frame, (one_way("1", -300.0, 0.0, 0.0, 600.0), one_way("2", 300.0, 16.0, math.pi, 600.0)))
# As HEAD_ON, with vehicle 2 in its own lane and vehicle 1 over the centreline: y is 0 on it, positive in the lane of 2.
OVER_THE_LINE = (
    straight(-HALF - 60.0, 1.5, 0.0, 20.0, until_s=8.0),
    straight(HALF + 45.0, 1.75, math.pi, 15.0, until_s=8.0),
)


def beside(trajectories: tuple, report: CrashRecord, network: RoadNetwork = STREET) -> Comparison:
    seen = observe_crash(network, *simulated(*trajectories))
    return Comparison.of(report, sequence_of(report), seen, VerdictSettings())


def with_events_before(report: CrashRecord, *codes: int, of: int = 1) -> CrashRecord:
    before = tuple(EventRecord(number, code, of, None, None, None) for number, code in enumerate(codes, 1))
    collision = replace(report.events[0], number=len(codes) + 1)
    return replace(report, events=(*before, collision))


@pytest.mark.parametrize(
    ("trajectories", "of", "doubts"),
    [
        (OVER_THE_LINE, 1, []),  # vehicle 1 is in the lane of vehicle 2
        (OVER_THE_LINE, 2, [Doubt.CENTRELINE_NOT_CROSSED]),  # vehicle 2 keeps to its own
        (HEAD_ON, 2, []),
        (HEAD_ON, 1, [Doubt.CENTRELINE_NOT_CROSSED]),
    ],
)
def test_a_reported_crossing_of_the_centreline_is_looked_for(trajectories: tuple, of: int, doubts: list[Doubt]) -> None:
    report = with_events_before(HEAD_ON_RECORD, CENTRELINE, of=of)
    assert [each.doubt for each in course_doubts(beside(trajectories, report))] == doubts


def test_departures_returns_and_flights_that_do_not_happen_are_doubts_with_their_names() -> None:
    report = with_events_before(HEAD_ON_RECORD, RIGHT, BACK, AIRBORNE, MEDIAN, of=1)
    found = {each.doubt: each.detail for each in course_doubts(beside(HEAD_ON, report))}
    assert list(found) == [
        Doubt.NOT_AIRBORNE,
        Doubt.MEDIAN_NOT_CROSSED,
        Doubt.DEPARTURE_MISSED,
        Doubt.RETURN_MISSED,
    ]
    assert "vehicle 1 does not leave the road" in found[Doubt.DEPARTURE_MISSED]


@pytest.mark.parametrize(
    ("y_m", "doubts"), [(-1.75, [Doubt.MEDIAN_NOT_CROSSED]), (8.0, [Doubt.MEDIAN_NOT_CROSSED]), (17.75, [])]
)
def test_a_median_is_crossed_on_the_lanes_of_the_other_carriageway(y_m: float, doubts: list[Doubt]) -> None:
    """Eastbound lanes end at y = 0, westbound ones begin at y = 16; a car in the median between has only entered it."""
    met = (straight(-HALF - 60.0, y_m, 0.0, 20.0, until_s=8.0), straight(HALF + 45.0, y_m, math.pi, 15.0, until_s=8.0))
    report = with_events_before(HEAD_ON_RECORD, MEDIAN, of=1)
    assert [each.doubt for each in course_doubts(beside(met, report, DIVIDED))] == doubts


def test_a_vehicle_off_the_road_before_the_contact_has_left_it() -> None:
    """The carriageway ends 3.5 m from the centreline; a car 1.8 m wide whose middle is 5 m from it is beyond."""
    outside = (
        straight(-HALF - 60.0, -5.0, 0.0, 20.0, until_s=8.0),
        straight(HALF + 45.0, -5.0, math.pi, 15.0, until_s=8.0),
    )
    report = with_events_before(HEAD_ON_RECORD, RIGHT, of=1)
    assert Doubt.DEPARTURE_MISSED not in {each.doubt for each in course_doubts(beside(outside, report))}


def test_each_vehicle_is_compared_with_the_road_that_it_drives_along() -> None:
    """Road 1 runs east and has a limit of 20 m/s, road 2 runs north and has 10 m/s. Vehicle 1 drives north."""
    roads = [replace(road, speed_mps=limit) for road, limit in zip(CROSSROADS.roads, (20.0, 10.0), strict=True)]
    network = RoadNetwork(CROSSROADS.frame, tuple(roads))
    seen = beside(ANGLE, ANGLE_RECORD, network).observed.events[0].vehicles
    assert {number: drove.road_id for number, drove in seen.items()} == {1: "2", 2: "1"}
    fast = replace(ANGLE_RECORD.vehicles[0], speed_limit_mps=20.0)
    report = replace(ANGLE_RECORD, vehicles=(fast, ANGLE_RECORD.vehicles[1]))
    limit = compare(network, report, REPORT.placement, {1: "2", 2: "1"})[-1]
    assert (limit.attribute, limit.agreement) == ("speed limit", "differs")
    assert compare(network, report, REPORT.placement, {1: "1", 2: "2"})[-1].agreement == "agrees"


def test_a_vehicle_on_neither_of_the_named_streets_is_on_another_one() -> None:
    roads = [
        replace(road, name=name, names=(name,))
        for road, name in zip(CROSSROADS.roads, ("Main Street", "Oak Street"), strict=True)
    ]
    network = RoadNetwork(CROSSROADS.frame, tuple(roads))
    at = replace(ANGLE_RECORD, road_topology=RoadTopology.FOUR_WAY, trafficway_1="MAIN ST")

    def other_streets(second: str) -> list[str]:
        report = replace(at, trafficway_2=second)
        found = simulation_doubts(beside(ANGLE, report, network), ())
        return [each.detail for each in found if each.doubt is Doubt.OTHER_STREET]

    assert other_streets("OAK ST") == []
    assert other_streets("SR-17") == []  # a number cannot be compared with a name
    (detail,) = other_streets("PINE RD")
    assert detail == "vehicle 1 comes along Oak Street; the report names MAIN ST and PINE RD"


@pytest.mark.parametrize(
    ("location", "departs", "doubted"), [(1, False, True), (1, True, False), (4, False, False), (None, False, False)]
)
def test_a_departure_that_no_event_reports_is_a_doubt(location: int | None, departs: bool, doubted: bool) -> None:
    """A car leaves the road into a tree; ``PCRASH5`` 1: it stayed in its lane, 4: it left the roadway."""
    tree = example_objects.record_of("tree_record")
    events = tuple(event for event in tree.events if departs or event.code not in SIDE_OF_EVENT)
    report = replace(tree, vehicles=(replace(tree.vehicles[0], location_code=location),), events=events)
    made = example_objects.made_of("tree_record")
    seen = observe_crash(made.network, made.state_estimate.hypotheses[0], made.logs[0])
    found = course_doubts(Comparison.of(report, sequence_of(report), seen, VerdictSettings()))
    assert (Doubt.UNREPORTED_DEPARTURE in {each.doubt for each in found}) is doubted


@pytest.mark.parametrize(("critical_event", "doubted"), [(62, True), (54, True), (1, False), (13, False), (80, False)])
def test_another_vehicle_that_made_it_critical_has_to_be_there(critical_event: int, doubted: bool) -> None:
    """``P_CRASH2``: 62 and 54 are oncoming vehicles, 1 and 13 this one's tyre and its departure, 80 a pedestrian."""
    made, tree = example_objects.made_of("tree_record"), example_objects.record_of("tree_record")
    report = replace(tree, vehicles=(replace(tree.vehicles[0], critical_event_code=critical_event),))
    seen = observe_crash(made.network, made.state_estimate.hypotheses[0], made.logs[0])
    found = course_doubts(Comparison.of(report, sequence_of(report), seen, VerdictSettings()))
    assert (Doubt.OTHER_VEHICLE_MISSING in {each.doubt for each in found}) is doubted


@pytest.mark.parametrize(("turned_deg", "doubted"), [(45.0, True), (-45.0, False)])
def test_who_comes_back_and_leaves_to_the_other_side_does_what_no_event_reports(
    turned_deg: float, doubted: bool
) -> None:
    """A car strikes a tree beside the road, and slides on at 30 m/s: back across the road, or farther away from it."""
    made, report = example_objects.made_of("tree_record"), example_objects.record_of("tree_record")
    log, (driven,) = made.logs[0], made.logs[0].vehicles
    (side,) = {SIDE_OF_EVENT[event.code] for event in report.events if event.code in SIDE_OF_EVENT}
    met = log.contacts[0]
    since_s = np.clip(driven.time_s - met.time_s, 0.0, None)
    lane = made.network.nearest_lanes(met.x_m, met.y_m, 30.0)[0]
    along_rad = made.network.pose(lane.lane, lane.s_m).heading_rad
    came_rad = float(np.interp(met.time_s, driven.time_s, np.unwrap(driven.heading_rad)))
    along_rad += math.pi if math.cos(came_rad - along_rad) < 0 else 0.0
    course_rad = along_rad + math.radians(turned_deg) * (1 if side is DepartureSide.RIGHT else -1)
    gone = since_s > 0
    moved = replace(
        driven,
        x_m=np.where(gone, met.x_m + 30.0 * since_s * math.cos(course_rad), driven.x_m),
        y_m=np.where(gone, met.y_m + 30.0 * since_s * math.sin(course_rad), driven.y_m),
        heading_rad=np.where(gone, along_rad, driven.heading_rad),
        velocity_x_mps=np.where(gone, 30.0 * math.cos(course_rad), driven.velocity_x_mps),
        velocity_y_mps=np.where(gone, 30.0 * math.sin(course_rad), driven.velocity_y_mps),
    )
    seen = observe_crash(made.network, made.state_estimate.hypotheses[0], replace(log, vehicles=(moved,)))
    found = course_doubts(Comparison.of(report, sequence_of(report), seen, VerdictSettings()))
    assert (Doubt.UNREPORTED_DEPARTURE in {each.doubt for each in found}) is doubted


@pytest.mark.parametrize(
    ("term", "value", "doubted"),
    [
        ("alignment", -1.5, True),  # a curve to the left, reported to the right
        ("alignment", -0.75, False),  # a straight road, reported as a curve
        ("turn from this lane", -3.0, True),  # straight on in a centre turn lane
        ("turn from this lane", -1.0, False),  # a turn out of the second lane
        ("speed for this road", -1.5, False),
    ],
)
def test_evidence_against_a_vehicles_lane_is_a_doubt(term: str, value: float, doubted: bool) -> None:
    made = beside(ANGLE, ANGLE_RECORD)
    hypothesis = replace(made.observed.hypothesis, evidence={f"{term} (vehicle 2)": value})
    found = simulation_doubts(replace(made, observed=replace(made.observed, hypothesis=hypothesis)), ())
    assert any(each.detail.startswith("vehicle 2: ") for each in found) is doubted


@pytest.mark.parametrize(("manner", "accepted"), [(CollisionType.FRONT_TO_FRONT, True), (CollisionType.ANGLE, False)])
def test_two_fronts_that_meet_head_on_are_no_angle_crash(manner: CollisionType, accepted: bool) -> None:
    report = replace(HEAD_ON_RECORD, collision_type=manner)
    verdict = judge_hypothesis(report, STREET, *simulated(*HEAD_ON), VerdictSettings())
    assert verdict.accepted is accepted
    if not accepted:
        assert verdict.reason is Reason.WRONG_IMPACT
        assert "head on angle" in verdict.detail


def test_an_angle_crash_into_a_side_keeps_its_right_angle() -> None:
    report = replace(ANGLE_RECORD, collision_type=CollisionType.ANGLE, vehicles=(vehicle(1, 9, 89), vehicle(2, 12, 88)))
    assert judge_hypothesis(report, CROSSROADS, *simulated(*ANGLE), VerdictSettings()).accepted
