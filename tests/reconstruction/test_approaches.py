"""Streams past real and sample crashes: the approaches there are, where one can turn, roundabouts, centre lanes."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest
from cases import Case, sample_case

from trace_dag.common.units import GRAVITY_MPS2, wrap_angle
from trace_dag.crash.crash_types import Relation, Turn
from trace_dag.crash.event_sequence import sequence_of
from trace_dag.crash.record import PreCrashMovement
from trace_dag.reconstruction.analytic_hypotheses import build_scene, parties
from trace_dag.reconstruction.candidates import candidates
from trace_dag.reconstruction.evidence import lane_terms
from trace_dag.reconstruction.motion.manoeuvres import make_turn
from trace_dag.reconstruction.pre_crash_scenarios import party, pre_crash_scenarios
from trace_dag.reconstruction.scene.approaches import Approach, ring_through
from trace_dag.reconstruction.scene.scene import Scene
from trace_dag.reconstruction.scene.vehicle_ways import approaches_of
from trace_dag.roads.from_osm.left_hand import mirror_network

FOUR_WAY, T, ROUNDABOUT, CENTRE_LANE, STRAIGHT, DIVIDED, CORNER = (
    "2023-319001",
    "2023-319009",
    "2023-319018",
    "2023-319011",
    "2023-319022",
    "2023-319024",
    "2023-319020",
)


def scene(case: Case) -> Scene:
    return build_scene(case.record, case.network, case.report, lead_time_s=5.0)


def from_direction(approach: Approach) -> int:
    """Where traffic comes from, in eighths of the compass."""
    return round(math.degrees(approach.heading_rad) / 45) % 8


@pytest.fixture(scope="module")
def straight_road() -> Scene:
    return scene(sample_case(STRAIGHT))


def test_a_plain_road_has_one_stream_each_way_on_the_right_of_the_other(straight_road):
    one, two = straight_road.on_road(straight_road.through)
    assert abs(wrap_angle(one.heading_rad - two.heading_rad)) > math.radians(175)
    for here, there in ((one, two), (two, one)):
        pose = there.path.pose(there.station_m)
        assert here.path.project(pose.x_m, pose.y_m)[1] > 2  # oncoming traffic on the left
    assert not any(approach.one_way or approach.wrong_way for approach in (one, two))


def test_a_four_way_crossing_lets_one_go_straight_and_turn_from_where_lanes_allow():
    found = scene(sample_case(FOUR_WAY))
    through = [approach for approach in found.through if not approach.extended]
    assert len({from_direction(approach) for approach in through}) >= 3
    turns = {approach.turn for approach in found.approaches}
    assert {Turn.LEFT, Turn.RIGHT} <= turns
    for approach in found.approaches:
        if approach.turn in (Turn.LEFT, Turn.RIGHT):
            change = wrap_angle(approach.exit_pose.heading_rad - approach.heading_rad)
            assert change > 0 if approach.turn is Turn.LEFT else change < 0


def test_vehicles_striking_a_person_turn_on_turning_lanes_and_back_along_the_road():
    found = scene(sample_case(FOUR_WAY))
    along = {approach.name for approach in found.on_road(found.through)}
    who = party(found.record, found.record.vehicles[0])
    turning = {option.approach.turn for option, _, _ in approaches_of(found, replace(who, turn=Turn.LEFT))}
    assert Turn.LEFT in turning
    assert Turn.RIGHT not in turning
    straight = {option.approach.name for option, _, _ in approaches_of(found, replace(who, turn=None))}
    assert straight == along
    vehicle = replace(who.vehicle, movement=PreCrashMovement.BACKING)
    backing = [option for option, _, _ in approaches_of(found, replace(who, vehicle=vehicle, turn=Turn.LEFT))]
    assert all(option.backing for option in backing)
    assert {option.approach.name for option in backing} == along


def test_the_stem_of_a_t_turns_both_ways_and_only_goes_straight_beyond_the_road():
    found = scene(sample_case(T))
    stems = [approach for approach in found.approaches if approach.extended]
    assert stems
    stem = stems[0]
    own = [approach for approach in found.approaches if approach.road is stem.road and approach.turn is not None]
    assert {approach.turn for approach in own} >= {Turn.LEFT, Turn.RIGHT}


def test_every_entry_of_a_roundabout_leads_around_it_counter_clockwise():
    case = sample_case(ROUNDABOUT)
    found = scene(case)
    around = [
        approach
        for approach in found.through
        if approach.path.heading_rad[-1] - approach.path.heading_rad[0] > math.radians(150)
        or approach.curve_rad > math.radians(60)
    ]
    assert len({approach.road.id for approach in around}) >= 2
    assert all(0 <= approach.share_of_ring <= 1 for approach in around)


def test_a_ring_is_found_from_any_of_its_lanes_and_straight_roads_are_none():
    case = sample_case(ROUNDABOUT)
    network = case.network
    rings = set()
    for ref in network.drivable_lanes():
        ring = ring_through(network, ref, network.centreline)
        if ring:
            rings.add(frozenset(ring))
            assert ref in ring
            turned = sum(float(np.diff(np.unwrap(network.centreline(lane)[:, 3])).sum()) for lane in ring)
            assert turned == pytest.approx(2 * math.pi, abs=0.5)
    assert len(rings) == 1
    plain = sample_case(STRAIGHT).network
    assert not any(ring_through(plain, ref, plain.centreline) for ref in plain.drivable_lanes())


def test_the_shared_lane_in_the_middle_is_used_in_both_directions():
    found = scene(sample_case(CENTRE_LANE))
    centre = [approach for approach in found.approaches if approach.centre_lane]
    headings = [approach.course_rad for approach in centre]
    assert any(abs(wrap_angle(one - two)) > math.radians(170) for one in headings for two in headings)
    assert not any(approach.wrong_way for approach in centre)


def test_halves_of_a_divided_road_are_one_way():
    found = scene(sample_case(DIVIDED))
    halves = found.on_road(found.through)
    assert halves
    assert all(approach.one_way for approach in halves)


def test_the_wrong_way_is_the_same_line_the_other_way():
    found = scene(sample_case(DIVIDED))
    approach = found.on_road(found.through)[0]
    against = found.finder.against(approach)
    assert against.wrong_way
    assert abs(wrap_angle(against.course_rad - approach.course_rad)) > math.radians(179)
    pose = approach.path.pose(approach.station_m)
    assert abs(against.path.project(pose.x_m, pose.y_m)[1]) < 0.2


@pytest.mark.parametrize("speed_mps", [5.0, 8.0, 12.0])
def test_a_corner_is_driven_as_the_speed_allows(speed_mps):
    found = scene(sample_case(CORNER))
    assert found.through
    for approach in found.through:
        fitted = approach.fitted(speed_mps)
        driven = fitted.path.s_m < fitted.station_m + 10
        taken = np.abs(fitted.path.curvature_1pm[driven]).max() * speed_mps**2
        plain = np.abs(approach.path.curvature_1pm).max() * speed_mps**2
        assert taken <= max(0.75 * GRAVITY_MPS2, 0.8 * plain)
        assert fitted.fitted(0.1) is fitted


def test_the_streams_do_not_depend_on_what_was_asked_before():
    case = sample_case(FOUR_WAY)
    names = [approach.name for approach in scene(case).approaches]
    assert names == [approach.name for approach in scene(case).approaches]
    assert len(names) == len(set(names))


@pytest.fixture(scope="module")
def reversible() -> Scene:
    """A divided road of the sample as if each of its halves were reversible and nothing told the hour."""
    case = sample_case(DIVIDED)
    roads = tuple(replace(road, reversible="unknown") if road.one_way else road for road in case.network.roads)
    network = replace(case.network, roads=roads)
    return build_scene(case.record, network, case.report, lead_time_s=5.0)


def test_the_traffic_of_a_reversible_road_may_have_gone_either_way(reversible):
    drawn = [approach for approach in reversible.on_road(reversible.through) if not approach.other_way]
    assert drawn
    by_name = {approach.name: approach for approach in reversible.approaches}
    for approach in drawn:
        back = by_name[f"{approach.name} the other way"]
        assert not back.wrong_way
        assert abs(wrap_angle(back.course_rad - approach.course_rad)) > math.radians(179)
        assert back.lane_from_left == approach.lanes_along - 1 - approach.lane_from_left
        against = reversible.finder.against(back)
        assert against.wrong_way
        assert abs(wrap_angle(against.course_rad - approach.course_rad)) < math.radians(1)


def test_two_vehicles_on_a_reversible_road_meet_head_on_only_if_one_goes_the_wrong_way(reversible):
    first = sequence_of(reversible.record).first
    reading = pre_crash_scenarios(reversible.record, *parties(reversible.record, first))[0]
    found = [
        candidate
        for relation in (Relation.SAME_LANE, Relation.OPPOSITE_DIRECTION)
        for candidate in candidates(reversible, replace(reading, relation=relation))
    ]
    sides = [(each.mover.approach, each.other.approach) for each in found]
    assert any(one.wrong_way or two.wrong_way for one, two in sides)
    assert any(one.other_way and two.other_way for one, two in sides)
    assert all(one.other_way == two.other_way or one.wrong_way or two.wrong_way for one, two in sides)


def test_left_hand_traffic_mirrors_everything():
    case = sample_case(FOUR_WAY)
    placement = replace(case.report.placement, x_m=-case.report.placement.x_m)
    mirrored = build_scene(
        case.record, mirror_network(case.network), replace(case.report, placement=placement), lead_time_s=5.0
    )
    vehicle, other_side = case.record.vehicles[0], {Turn.LEFT: Turn.RIGHT, Turn.RIGHT: Turn.LEFT, None: None}

    def seen(approach: Approach, *, in_mirror: bool) -> tuple[object, ...]:
        turns = [other_side[turn] if in_mirror else turn for turn in (Turn.LEFT, Turn.RIGHT, None)]
        unarrowed = replace(approach, lane_turns=())
        sign = -1 if in_mirror else 1
        return (
            approach.road.id,
            round(sign * approach.offset_m, 3) + 0.0,
            approach.lane_from_centre,
            approach.lanes_along,
            other_side.get(approach.turn, approach.turn) if in_mirror else approach.turn,
            tuple(str(lane_terms(vehicle, unarrowed, turn)) for turn in turns),
        )

    def all_of(found: Scene, *, in_mirror: bool) -> list[tuple[object, ...]]:
        return sorted((seen(approach, in_mirror=in_mirror) for approach in found.approaches), key=str)

    assert all_of(mirrored, in_mirror=True) == all_of(scene(case), in_mirror=False)
    through = next(approach for approach in mirrored.through if not approach.extended)
    (turned_back, *_) = make_turn(through, vehicle, 3.0, Turn.U_TURN, slides=True)
    assert turned_back.turn.angle_rad == -math.pi
