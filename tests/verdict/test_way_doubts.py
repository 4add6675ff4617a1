"""Doubts about what a simulation needs and no report says."""

from __future__ import annotations

import math
from dataclasses import replace

import example_objects
import numpy as np
import pytest

from tests.simulation.motions import straight
from tests.verdict.crashes import CROSSROADS, FRAME, STREET, area, record, simulated, two_way, vehicle
from tests.verdict.test_course_events import RIGHT, beside, with_events_before
from tests.verdict.test_judge import ANGLE, ANGLE_RECORD, HALF, HEAD_ON, HEAD_ON_RECORD
from trace_dag.common.geometry import Pose
from trace_dag.common.settings import VerdictSettings
from trace_dag.crash.classes import RoadTopology
from trace_dag.crash.event_sequence import sequence_of
from trace_dag.crash.keys import FARS
from trace_dag.crash.record import CrashRecord, EventRecord
from trace_dag.roads.map.model import Crosswalk, Junction
from trace_dag.roads.map.network import RoadNetwork
from trace_dag.simulation.objects import FixedObject, PlacedBy
from trace_dag.simulation.states import Hypothesis
from trace_dag.simulation.types import SimulationLog
from trace_dag.verdict.course_events import course_doubts
from trace_dag.verdict.observation import observe_crash
from trace_dag.verdict.reservations import way_doubts
from trace_dag.verdict.rules import Comparison
from trace_dag.verdict.types import Doubt

PERSON_RECORD = example_objects.record_of("pedestrian_record")
PERSON = example_objects.made_of("pedestrian_record")


def seen(report: CrashRecord, hypothesis: Hypothesis, log: SimulationLog, network: RoadNetwork = STREET) -> Comparison:
    observed = observe_crash(network, hypothesis, log)
    return Comparison.of(report, sequence_of(report), observed, VerdictSettings())


def doubts(comparison: Comparison) -> set[Doubt]:
    return {each.doubt for each in way_doubts(comparison)}


def of_person(
    report: CrashRecord = PERSON_RECORD, network: RoadNetwork = PERSON.network, **changes: object
) -> set[Doubt]:
    hypothesis = PERSON.state_estimate.hypotheses[0]
    changed = tuple(
        replace(state, **changes) if state.vehicle_number > 1000 else state for state in hypothesis.participants
    )
    return doubts(seen(report, replace(hypothesis, participants=changed), PERSON.logs[0], network))


def test_a_crash_on_its_streets_has_none():
    assert doubts(beside(HEAD_ON, HEAD_ON_RECORD)) == set()
    assert doubts(beside(ANGLE, ANGLE_RECORD, CROSSROADS)) == set()


def test_a_way_on_where_the_map_has_no_street_is_doubted():
    """Vehicle 1 drives north over a street that runs east and west: after the crash 60 m of field lie ahead of it."""
    network = RoadNetwork(FRAME, (STREET.roads[0], two_way("2", 0.0, -300.0, math.pi / 2, 300.0)))
    assert doubts(beside(ANGLE, ANGLE_RECORD, network)) == {Doubt.NO_STREET}
    junction = Junction("9", (), kind="t", centre_xy_m=(0.0, 0.0))
    mapped_as_t = RoadNetwork(FRAME, network.roads, (junction,))
    assert doubts(beside(ANGLE, ANGLE_RECORD, mapped_as_t)) == {Doubt.NO_STREET}
    four_way = replace(ANGLE_RECORD, road_topology=RoadTopology.FOUR_WAY)  # the report has the arm that the map lacks
    assert doubts(beside(ANGLE, four_way, mapped_as_t)) == set()
    left = with_events_before(ANGLE_RECORD, RIGHT, of=1)  # it ran off the road, by its report
    assert Doubt.NO_STREET not in doubts(beside(ANGLE, left, network))


@pytest.mark.parametrize(("metres", "far"), [(40.0, False), (50.0, True)])
def test_a_vehicle_that_goes_far_over_fields_is_doubted(metres: float, far: bool):
    """The carriageway ends 3.5 m from its middle; a car that slides beside it is ``metres`` beyond that."""
    hypothesis, log = simulated(*HEAD_ON)
    strayed = replace(log.vehicles[0], y_m=log.vehicles[0].y_m * 0.0 - 3.5 - metres)
    gone = replace(log, vehicles=(strayed, *log.vehicles[1:]))
    assert (Doubt.FAR_OFF_ROAD in doubts(seen(HEAD_ON_RECORD, hypothesis, gone))) is far


@pytest.mark.parametrize(
    ("name", "reported", "other"), [("Far St", "", True), ("Near St", "", False), ("Far St", "FAR ST", False)]
)
def test_a_vehicle_that_comes_onto_another_street_over_the_ground_is_doubted(name: str, reported: str, other: bool):
    """Two streets, 30 m apart, and a car that slides from the one over to the other."""
    near, far = (
        replace(STREET.roads[0], names=("Near St",)),
        replace(two_way("2", -300.0, -30.0, 0.0, 600.0), names=(name,)),
    )
    hypothesis, log = simulated(*HEAD_ON)
    slid = replace(log.vehicles[0], y_m=np.linspace(0.0, -30.0, len(log.vehicles[0].y_m)))
    gone = replace(log, vehicles=(slid, *log.vehicles[1:]))
    record = replace(HEAD_ON_RECORD, trafficway_1=reported, trafficway_2="")
    network = RoadNetwork(FRAME, (near, far))
    assert (Doubt.OTHER_CARRIAGEWAY in doubts(seen(record, hypothesis, gone, network))) is other


def test_a_spin_before_the_first_event_is_doubted_unless_a_sideways_skid_is_reported():
    hypothesis, log = simulated(*HEAD_ON)
    first_s = log.contacts[0].time_s
    driven = log.vehicles[0]
    spinning = replace(driven, heading_rad=driven.heading_rad + math.pi * (driven.time_s / first_s).clip(0.0, 1.0))
    spun = replace(log, vehicles=(spinning, *log.vehicles[1:]))
    assert Doubt.SPUN in doubts(seen(HEAD_ON_RECORD, hypothesis, spun))
    clockwise = replace(HEAD_ON_RECORD.vehicles[0], stability_code=3)
    told = replace(HEAD_ON_RECORD, vehicles=(clockwise, HEAD_ON_RECORD.vehicles[1]))
    assert Doubt.SPUN not in doubts(seen(told, hypothesis, spun))
    backing = replace(driven, heading_rad=driven.heading_rad + math.pi)
    assert Doubt.SPUN not in doubts(
        seen(HEAD_ON_RECORD, hypothesis, replace(log, vehicles=(backing, *log.vehicles[1:])))
    )


def test_a_crossing_person_beginning_in_a_lane_is_doubted():
    assert of_person() == set()
    (state,) = (each for each in PERSON.state_estimate.hypotheses[0].participants if each.vehicle_number > 1000)
    within = replace(state.initial_pose, x_m=state.impact_pose.x_m, y_m=state.impact_pose.y_m)
    assert of_person(initial_pose=within) == {Doubt.STARTS_IN_LANE}


def test_a_strike_beside_the_reported_crosswalk_is_in_another_zone():
    (person,) = PERSON_RECORD.non_motorists
    crossing = replace(PERSON_RECORD, non_motorists=(replace(person, pedestrian_position_code=2),))  # in a crosswalk
    plain = [replace(road, crosswalks=()) for road in PERSON.network.roads]
    none_drawn = RoadNetwork(PERSON.network.frame, tuple(plain), PERSON.network.junctions)
    assert Doubt.OTHER_ZONE not in of_person(crossing, none_drawn)
    far_off = replace(plain[0], crosswalks=(Crosswalk("1", 1.0, ((0.0, -4.0), (3.0, -4.0), (3.0, 4.0), (0.0, 4.0))),))
    elsewhere = RoadNetwork(PERSON.network.frame, (far_off, *plain[1:]), PERSON.network.junctions)
    assert Doubt.OTHER_ZONE in of_person(crossing, elsewhere)
    assert Doubt.OTHER_ZONE not in of_person(PERSON_RECORD, elsewhere)


def with_junction(kind: str) -> RoadNetwork:
    roads = tuple(replace(road, junction_id="9") for road in CROSSROADS.roads)
    return RoadNetwork(FRAME, roads, (Junction("9", (), kind=kind, centre_xy_m=(0.0, 0.0)),))


@pytest.mark.parametrize(
    ("relation", "kind", "doubted"),
    [
        (1, "four_way", True),  # away from any junction
        (3, "four_way", True),  # on an approach
        (2, "four_way", False),
        (8, "four_way", False),  # of a driveway
        (1, "not_an_intersection", False),  # a driveway by the map
    ],
)
def test_a_contact_where_streets_cross_is_in_an_intersection(relation: int, kind: str, doubted: bool):
    report = replace(ANGLE_RECORD, junction_relation_code=relation)
    assert (Doubt.OTHER_JUNCTION in doubts(beside(ANGLE, report, with_junction(kind)))) is doubted


@pytest.mark.parametrize(("ahead_m", "doubted"), [(0.0, True), (-8.0, False)])
def test_a_vehicle_that_waits_for_a_junction_does_not_stand_in_it(ahead_m: float, doubted: bool):
    """The crossing street is 7 m wide. Both are struck west of it; one of them stands with its middle in it."""
    at_m = ahead_m - 2.0
    comes, stands = (straight(x_m, -1.75, 0.0, mps, until_s=8.0) for x_m, mps in ((at_m - 70.0, 20.0), (at_m, 0.0)))
    report = replace(record(vehicle(1, 12, 20), vehicle(2, 6, 21)), junction_relation_code=3)
    assert (Doubt.OTHER_JUNCTION in doubts(beside((comes, stands), report, with_junction("four_way")))) is doubted


@pytest.mark.parametrize(("relation", "doubted"), [(2, True), (3, False), (1, False)])
def test_an_intersection_needs_a_junction_of_the_map(relation: int, doubted: bool):
    report = replace(HEAD_ON_RECORD, junction_relation_code=relation)
    assert (Doubt.OTHER_JUNCTION in doubts(beside(HEAD_ON, report))) is doubted
    bend = replace(report, road_topology=RoadTopology.L)  # of one street, by a map
    assert Doubt.OTHER_JUNCTION not in doubts(beside(HEAD_ON, bend))


def test_a_corner_is_not_the_middle_of_a_side():
    """Vehicle 1 is struck in the middle of its left side, then at its rear corner, near 7.5 o'clock by its outline."""
    corner = (ANGLE[0], straight(-HALF - 36.0 + 0.8, -1.75 - 2.9, 0.0, 12.0, until_s=8.0))
    comparison = beside(corner, ANGLE_RECORD, CROSSROADS)
    assert comparison.observed.first.sides[1].clock_h < 7.6
    assert doubts(comparison) == {Doubt.OTHER_FACE}
    whole_side = replace(ANGLE_RECORD, register="narrative")  # names a side, not a place on it
    assert Doubt.OTHER_FACE not in doubts(beside(corner, whole_side, CROSSROADS))
    rear_left = replace(ANGLE_RECORD.vehicles[0], impact=area(8))
    told = replace(ANGLE_RECORD, vehicles=(rear_left, ANGLE_RECORD.vehicles[1]))
    collision = replace(told.events[0], area_1=rear_left.impact)
    assert doubts(beside(corner, replace(told, events=(collision,)), CROSSROADS)) == set()


@pytest.mark.parametrize(
    ("apart_m", "placed_by", "doubted"),
    [(0.2, PlacedBy.PROGRAM, True), (2.0, PlacedBy.PROGRAM, False), (0.2, PlacedBy.OPENSTREETMAP, False)],
)
def test_two_placed_objects_do_not_stand_in_one_place(apart_m: float, placed_by: PlacedBy, doubted: bool):
    trees = tuple(
        replace(
            FixedObject.of_kind(
                42, number=2000 + event, event_number=event, pose=Pose(50.0 + event * apart_m, 8.0, 0.0)
            ),
            placed_by=placed_by,
        )
        for event in (2, 3)
    )
    hypothesis, log = simulated(*HEAD_ON)
    found = doubts(seen(HEAD_ON_RECORD, replace(hypothesis, objects=trees), log))
    assert (Doubt.OBJECTS_OVERLAP in found) is doubted


@pytest.mark.parametrize(("mps", "doubted"), [(4.0, True), (5.0, False)])
def test_a_later_object_is_not_touched_slowly_where_the_vehicle_rests_anyway(mps: float, doubted: bool):
    """Vehicle 1 touches a tree just before it rests (16 km/h: 4.4 m/s); one that the map has may stand."""
    hypothesis, log = simulated(*HEAD_ON)
    driven, collision = log.vehicles[0], log.contacts[0]
    rests_s = float(driven.time_s[np.hypot(driven.velocity_x_mps, driven.velocity_y_mps) >= 0.5].max())
    tree = FixedObject.of_kind(42, number=2002, event_number=2, pose=Pose(0.0, -8.0, 0.0))
    touch = replace(collision, number_2=2002, time_s=rests_s - 0.1, closing_speed_mps=mps)
    report = replace(HEAD_ON_RECORD, events=(*HEAD_ON_RECORD.events, EventRecord(2, 42, 1, None, 2002, None)))
    for placed_by, expected in ((PlacedBy.PROGRAM, doubted), (PlacedBy.OPENSTREETMAP, False)):
        stands = (replace(tree, placed_by=placed_by),)
        struck = replace(log, contacts=(collision, touch), objects=stands)
        for register, counts in ((FARS, expected), ("city", False)):  # FARS has crashes that killed somebody alone
            told = replace(report, register=register)
            found = doubts(seen(told, replace(hypothesis, objects=stands), struck))
            assert (Doubt.OBJECT_AT_REST in found) is counts


def test_an_earlier_departure_to_the_other_side_is_looked_for_too():
    """A car that leaves the road to the left, by its report to the right and then, over the centreline, to the left."""
    made, report = example_objects.made_of("tree_record"), example_objects.record_of("tree_record")
    hypothesis, log = made.state_estimate.hypotheses[0], made.logs[0]
    tree = next(event for event in report.events if event.is_harmful)
    first = next(event for event in report.events if event.code == RIGHT)

    def missed(*events) -> bool:
        told = replace(report, events=tuple(replace(event, number=k) for k, event in enumerate(events, 1)))
        found = course_doubts(seen(told, hypothesis, log, made.network))
        return Doubt.DEPARTURE_MISSED in {each.doubt for each in found}

    left = replace(first, code=64)
    assert not missed(first, tree)  # the criterion on the first event judges this one
    assert missed(left, first, tree)
