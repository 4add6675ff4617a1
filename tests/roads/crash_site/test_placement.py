"""The crash on the map: which road, where on it, which crossing."""

from __future__ import annotations

import math

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from tests.roads.towns import SETTINGS, Town, report, vehicle
from trace_dag.common.errors import Reason, Rejection
from trace_dag.crash.classes import RoadTopology
from trace_dag.crash.record import CrashRecord
from trace_dag.roads.crash_site.placement import place_crash
from trace_dag.roads.report import CrashPlacement


def street_of(town: Town, placement: CrashPlacement) -> str:
    return town.network().road_by_id[placement.road_id].name


def off_road(town: Town, **about: object) -> Rejection:
    with pytest.raises(Rejection) as caught:
        place_crash(town.network(), report(**about), SETTINGS)  # type: ignore[arg-type]
    assert caught.value.reason == Reason.CRASH_OFF_ROAD
    return caught.value


def highway_with_frontage_road() -> Town:
    town = Town()
    town.street([(-200, 0), (200, 0)], highway="residential", name="Frontage Road", lanes="2")
    town.street([(-200, 16), (200, 16)], highway="trunk", name="Superstition Freeway", ref="US 60", lanes="4")
    return town


def test_a_point_on_its_road_stays_where_it_is() -> None:
    town = highway_with_frontage_road()
    placement = place_crash(town.network(), report(at_m=(12, 2), street="FRONTAGE RD"), SETTINGS)
    assert (placement.x_m, placement.y_m) == pytest.approx((12, 2), abs=0.01)
    assert placement.moved_m == 0
    assert street_of(town, placement) == "Frontage Road"
    assert placement.lane is not None
    assert placement.lane.outside_m == 0


@pytest.mark.parametrize("street", ["US-60", "SUPERSTITION FRWY", "US-60/SUPERSTITION FWY"])
def test_the_road_that_is_named_is_chosen_over_a_nearer_one(street: str) -> None:
    town = highway_with_frontage_road()
    placement = place_crash(town.network(), report(at_m=(0, -1), street=street), SETTINGS)
    assert street_of(town, placement) == "Superstition Freeway"
    assert placement.moved_m == pytest.approx(math.dist((0, -1), (placement.x_m, placement.y_m)), abs=0.01)
    assert 9 < placement.y_m < 16
    assert "name" in placement.matched_by


def test_class_and_lanes_decide_where_there_is_no_name() -> None:
    town = Town()
    town.street([(-200, -5), (200, -5)], highway="residential", lanes="2", maxspeed="25 mph")
    town.street([(-200, 8), (200, 8)], highway="primary", lanes="4", maxspeed="45 mph")
    car = vehicle(lanes=4, trafficway=1, limit_mph=45)
    record = report(car, vehicle(2), street="US-17", function_class=3)
    placement = place_crash(town.network(), record, SETTINGS)
    assert town.network().road_by_id[placement.road_id].highway == "primary"


def test_the_named_road_is_chosen_of_two_above_each_other() -> None:
    town = Town()
    town.street([(-200, 0), (-40, 0)], highway="primary", name="Over Street")
    town.street([(-40, 0), (40, 0)], highway="primary", name="Over Street", bridge="yes", layer="1")
    town.street([(40, 0), (200, 0)], highway="primary", name="Over Street")
    town.street([(0, -200), (0, 200)], highway="primary", name="Under Street", level="below")
    for name in ("Over Street", "Under Street"):
        placement = place_crash(town.network(), report(at_m=(1, 1), street=name.upper()), SETTINGS)
        assert street_of(town, placement) == name
        assert placement.moved_m == 0
        assert placement.lane is not None
        assert town.network().road_by_id[placement.lane.lane.road_id].name == name


def test_a_point_too_far_from_any_road_is_off_road() -> None:
    rejection = off_road(highway_with_frontage_road(), at_m=(0, -50), street="FRONTAGE RD")
    assert rejection.measured == pytest.approx(50 - 3.35, abs=0.1)
    assert rejection.threshold == SETTINGS.max_move_m
    assert "46.6 m" in rejection.detail or "46.7 m" in rejection.detail


def test_a_named_road_too_far_away_is_not_replaced_by_one_of_another_name() -> None:
    town = Town()
    town.street([(-200, 0), (200, 0)], name="Elm Street")
    town.street([(-200, 60), (200, 60)], name="Oak Street")
    rejection = off_road(town, at_m=(0, 0), street="OAK ST")
    assert rejection.measured == pytest.approx(60 - 3.35, abs=0.1)
    assert "Elm Street" in rejection.detail


def test_an_unnamed_road_at_hand_does_not_contradict_the_report() -> None:
    town = Town()
    town.street([(-200, 0), (200, 0)])
    town.street([(-200, 60), (200, 60)], name="Oak Street")
    placement = place_crash(town.network(), report(street="OAK ST"), SETTINGS)
    assert placement.moved_m == 0


def test_a_map_without_roads_near_the_crash_is_off_road() -> None:
    town = Town()
    town.street([(500, 500), (600, 600)])
    assert off_road(town).measured is None


def crossing_town() -> Town:
    town = Town()
    town.street([(-200, 0), (0, 0), (120, 0), (200, 0)], highway="primary", name="Main Street", ref="US 1")
    town.street([(0, -200), (0, 0), (0, 200)], name="Elm Street")
    town.street([(120, -200), (120, 0)], name="Oak Street")
    town.street([(120, 0), (120, 200)], name="Oak Street")
    return town


@pytest.mark.parametrize("at_m", [(0, 0), (5, 2), (-15, 1), (70, 1)])
def test_an_intersection_crash_belongs_to_the_crossing_of_the_named_streets(at_m: tuple[float, float]) -> None:
    town = crossing_town()
    record = report(at_m=at_m, street="US-1", cross="ELM ST", topology=RoadTopology.FOUR_WAY)
    placement = place_crash(town.network(), record, SETTINGS)
    network = town.network()
    assert placement.junction_id is not None
    assert network.junction_by_id[placement.junction_id].centre_xy_m == pytest.approx((0, 0), abs=0.5)
    assert network.road_by_id[placement.road_id].name == "Main Street"
    assert {network.road_by_id[i].name for i in placement.cross_road_ids} == {"Elm Street"}
    assert placement.moved_m == 0


def test_the_nearest_crossing_is_taken_where_no_street_is_named() -> None:
    town = crossing_town()
    placement = place_crash(town.network(), report(at_m=(118, 3), topology=RoadTopology.FOUR_WAY), SETTINGS)
    assert placement.junction_id is not None
    centre = town.network().junction_by_id[placement.junction_id].centre_xy_m
    assert centre == pytest.approx((120, 0), abs=1.0)


def test_a_crash_between_crossings_has_no_junction() -> None:
    placement = place_crash(crossing_town().network(), report(at_m=(60, 2), street="MAIN ST"), SETTINGS)
    assert placement.junction_id is None
    assert placement.cross_road_ids == ()


def test_a_crash_at_a_driveway_knows_the_driveway() -> None:
    town = Town()
    town.street([(-200, 0), (0, 0), (200, 0)], highway="primary", name="Main Street")
    drive = town.street([(0, 0), (0, 60)], highway="service", service="driveway")
    record = report(at_m=(3, -2), street="MAIN ST", junction_relation=8)
    network = town.network()
    placement = place_crash(network, record, SETTINGS)
    assert network.road_by_id[placement.road_id].name == "Main Street"
    assert placement.junction_id is not None
    assert [network.road_by_id[i].osm_way_ids for i in placement.cross_road_ids] == [(drive,)]


NETWORK = crossing_town().network()


def placed_or_rejected(record: CrashRecord) -> CrashPlacement | Rejection:
    try:
        return place_crash(NETWORK, record, SETTINGS)
    except Rejection as rejection:
        return rejection


@settings(max_examples=80)
@given(
    x_m=st.floats(-160, 160),
    y_m=st.floats(-160, 160),
    street=st.sampled_from(["", "MAIN ST", "US-1", "ELM ST", "OAK ST", "NOWHERE LN"]),
    cross=st.sampled_from(["", "ELM ST", "MAIN ST"]),
    topology=st.sampled_from(list(RoadTopology)),
)
def test_a_placed_crash_is_on_a_road_and_was_not_moved_too_far(
    x_m: float, y_m: float, street: str, cross: str, topology: RoadTopology
) -> None:
    record = report(at_m=(x_m, y_m), street=street, cross=cross, topology=topology)
    placement = placed_or_rejected(record)
    if isinstance(placement, Rejection):
        assert placement.reason == Reason.CRASH_OFF_ROAD
        return
    assert placement.moved_m <= SETTINGS.max_move_m + 3.0  # to just inside the lane
    assert placement.moved_m == pytest.approx(math.dist((x_m, y_m), (placement.x_m, placement.y_m)), abs=0.01)
    assert NETWORK.nearest_lanes(placement.x_m, placement.y_m, 1.0)[0].outside_m == pytest.approx(0, abs=1e-6)
    assert placement.road_id in NETWORK.road_by_id
    assert all(road_id in NETWORK.road_by_id for road_id in placement.cross_road_ids)


def test_a_road_beside_the_point_is_not_taken_for_its_limit_alone() -> None:
    town = Town()
    town.street([(-200, 0), (200, 0)], highway="residential", maxspeed="25 mph")
    arterial, local = 3, 7
    fits = place_crash(town.network(), report(vehicle(limit_mph=25), at_m=(0, 15), function_class=local), SETTINGS)
    assert fits.moved_m > 10
    with pytest.raises(Rejection, match="but its limit"):
        place_crash(town.network(), report(vehicle(limit_mph=25), at_m=(0, 15), function_class=arterial), SETTINGS)


def test_an_interstate_is_no_street_of_a_town() -> None:
    town = Town()
    town.street([(-200, 0), (200, 0)], highway="residential")
    assert "interstate" in off_road(town, function_class=1).detail


def test_a_crash_on_a_ramp_is_not_on_the_mainline() -> None:
    town = Town()
    town.street([(-300, 0), (0, 0), (300, 0)], highway="motorway", oneway="yes", name="Big Freeway", ref="I 9")
    town.street([(0, 0), (200, -30), (300, -60)], highway="motorway_link", oneway="yes")
    record = report(at_m=(150, -10), street="I-9", junction_relation=20, function_class=1)
    placement = place_crash(town.network(), record, SETTINGS)
    assert town.network().road_by_id[placement.road_id].highway == "motorway_link"
    assert "ramp" in placement.matched_by
