"""Evidence of who came from where: greater and lesser roads, stop signs, driveways, names of streets."""

from __future__ import annotations

import dataclasses
import math
from types import SimpleNamespace

import pytest
from cases import sample_case

from trace_dag.crash.crash_types import Relation
from trace_dag.crash.record import Heading, Moment, Octant
from trace_dag.reconstruction.analytic_hypotheses import build_scene
from trace_dag.reconstruction.evidence import (
    WRONG_HEADING,
    CrossingVehicle,
    crossing_ahead_terms,
    crossing_terms,
    driveway_speed_terms,
    first_street_terms,
    heading_log_likelihood,
    is_cross,
    is_main,
    street_terms,
)

STOP_SIGN, SIGNAL = 20, 3


def crossing(highway: str, speed_mps: float, control: int | None = None) -> CrossingVehicle:
    approach = SimpleNamespace(road=SimpleNamespace(highway=highway))
    return CrossingVehicle(SimpleNamespace(traffic_control_code=control), approach, speed_mps)


def test_whoever_crosses_a_greater_road_is_not_the_faster_one():
    slow_off_highway = crossing_terms(crossing("trunk", 25.0), crossing("residential", 8.0))
    slow_on_highway = crossing_terms(crossing("residential", 25.0), crossing("trunk", 8.0))
    assert slow_off_highway == {}
    assert sum(slow_on_highway.values()) < 0
    assert crossing_terms(crossing("residential", 25.0), crossing("residential", 8.0)) == {}


def test_the_stop_sign_stands_on_the_lesser_road():
    assert crossing_terms(crossing("primary", 15.0), crossing("service", 15.0, STOP_SIGN)) == {}
    assert sum(crossing_terms(crossing("primary", 15.0, STOP_SIGN), crossing("service", 15.0)).values()) < 0
    # Where all stop, or a signal tells, the signs say nothing.
    all_way = crossing("primary", 15.0, STOP_SIGN), crossing("service", 15.0, STOP_SIGN)
    assert crossing_terms(*all_way) == crossing_terms(crossing("primary", 15.0, SIGNAL), all_way[1]) == {}


@pytest.mark.parametrize("order", [1, -1])
def test_the_order_of_the_two_does_not_matter(order):
    pair = (crossing("trunk", 8.0, STOP_SIGN), crossing("residential", 25.0))[::order]
    assert set(crossing_terms(*pair)) == {"faster on the lesser road", "stop sign on the greater road alone"}


def test_nobody_comes_out_of_a_driveway_at_the_speed_of_a_road():
    driveway, road = (SimpleNamespace(road=SimpleNamespace(inferred=why)) for why in ("vehicle 1 came out", ""))
    assert driveway_speed_terms(driveway, 5.0) == driveway_speed_terms(road, 30.0) == {}
    fast, faster = (sum(driveway_speed_terms(driveway, speed_mps).values()) for speed_mps in (12.0, 20.0))
    assert faster < fast < 0


def test_a_street_of_the_name_the_report_gives_is_the_other_street_whatever_the_placement_found():
    network = SimpleNamespace(road_by_id={})
    placement = SimpleNamespace(road_id="1", cross_road_ids=("2",), junction_id="j")
    record = SimpleNamespace(trafficway_2="DESERT SHORES DR")
    link = SimpleNamespace(element_type="junction", element_id="j")

    def terms(*names: str) -> dict[str, float]:
        road = SimpleNamespace(id="3", names=names, predecessor=link, successor=None, inferred="")
        return street_terms(network, placement, record, SimpleNamespace(road=road))

    assert terms("Desert Shores Drive") == {}
    assert sum(terms("Ocean Drive").values()) < 0
    assert sum(terms().values()) < 0


def test_a_reported_direction_is_wrong_as_often_as_two_in_a_rear_end_are_reported_to_go_two_ways():
    assert pytest.approx(0.975) == (1 - WRONG_HEADING) ** 2
    east = Heading(Octant.EAST)
    assert heading_log_likelihood(east, 0.0) == pytest.approx(0.0)
    # The wrong way round it is one of seven wrong octants, and no worse than any other of them.
    against = heading_log_likelihood(east, math.pi)
    assert against == pytest.approx(math.log(WRONG_HEADING / 7 / (1 - WRONG_HEADING + WRONG_HEADING / 7)), abs=1e-6)
    assert heading_log_likelihood(east, math.radians(100)) == pytest.approx(against, abs=0.1)
    assert heading_log_likelihood(east, math.radians(10)) > -0.2  # police name the compass by the street


@pytest.mark.parametrize(
    ("moment", "fits"),
    [
        (Moment.BEFORE, {Octant.EAST}),
        (Moment.AFTER, {Octant.NORTH}),
        (Moment.UNKNOWN, {Octant.EAST, Octant.NORTH_EAST, Octant.NORTH}),
    ],
)
def test_directions_before_and_after_a_left_turn_off_an_eastbound_street(moment, fits):
    found = {octant: heading_log_likelihood(Heading(octant, moment), 0.0, math.pi / 2) for octant in Octant}
    assert {octant for octant, value in found.items() if value > -1.5} == fits
    assert all(found[octant] < -4.0 for octant in (Octant.WEST, Octant.SOUTH, Octant.SOUTH_WEST))


def test_octants_are_headings_counter_clockwise_from_east():
    degrees = {octant.value: round(math.degrees(octant.heading_rad)) % 360 for octant in Octant}
    assert degrees == {
        "east": 0, "north_east": 45, "north": 90, "north_west": 135, "west": 180, "south_west": 225, "south": 270,
        "south_east": 315,
    }  # fmt: skip


def test_a_vehicle_struck_from_behind_near_a_crossing_was_approaching_it():
    """A rear end 20 m west of a crossing, related to it (RELJCT2 3): eastbound lanes alone lead there."""
    case = sample_case("2023-319004")
    scene = build_scene(case.record, case.network, case.report, lead_time_s=5.0)
    assert case.record.junction_relation_code == 3
    along = [approach for approach in scene.through if abs(math.cos(approach.heading_rad)) > 0.9]
    eastbound = {approach.name for approach in along if math.cos(approach.heading_rad) > 0}
    told = {each.name: crossing_ahead_terms(scene, Relation.SAME_LANE, each) for each in along}
    assert eastbound == {name for name, terms in told.items() if not terms} != set(told)
    assert {round(sum(terms.values()), 2) for terms in told.values()} == {0.0, round(math.log(0.09 / 0.91), 2)}
    assert not any(crossing_ahead_terms(scene, Relation.CROSSING, approach) for approach in along)
    at_crossing = dataclasses.replace(scene, record=dataclasses.replace(case.record, junction_relation_code=2))
    assert not any(crossing_ahead_terms(at_crossing, Relation.SAME_LANE, approach) for approach in along)


def test_the_vehicle_going_straight_drove_on_the_first_named_street():
    """A crossing of two named streets: a leader and its follower are both on the first, of two that cross one is, and
    of one that turns before another that other; around a roundabout traffic of both streets goes."""
    case = sample_case("2023-319001")
    scene = build_scene(case.record, case.network, case.report, lead_time_s=5.0)
    assert case.record.trafficway_2
    on_first = [each for each in scene.through if is_main(scene.network, scene.placement, each.road)]
    on_other = [each for each in scene.through if is_cross(scene.network, scene.placement, case.record, each.road)]
    (first, *_), (other, *_) = on_first, on_other
    assert first_street_terms(scene, [first, first]) == {}
    assert sum(first_street_terms(scene, [first, other]).values()) < -2.0
    assert sum(first_street_terms(scene, [other]).values()) < -2.0
    assert first_street_terms(scene, [first, other], cross=True) == {}
    assert sum(first_street_terms(scene, [other, other], cross=True).values()) < -2.0
    assert first_street_terms(scene, []) == {}  # both turn
    assert first_street_terms(scene, [dataclasses.replace(other, share_of_ring=0.5)]) == {}
    alone = dataclasses.replace(scene, record=dataclasses.replace(case.record, trafficway_2=""))
    assert first_street_terms(alone, [other]) == {}
