"""Driveways the report speaks of: drawn where the map has none, on the right side, marked as ours."""

from __future__ import annotations

import math
from dataclasses import replace

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from tests.roads.test_build import built, garbage
from tests.roads.towns import SETTINGS, Town, report, vehicle
from trace_dag.common.errors import Reason
from trace_dag.common.units import wrap_angle
from trace_dag.crash.classes import RoadTopology
from trace_dag.crash.record import CrashRecord, PreCrashMovement
from trace_dag.osm.types import OsmExtract
from trace_dag.roads.build import RoadMap, build_road_map
from trace_dag.roads.map.model import Road

DRIVEWAY = 0  # VTRAFWAY


def crash(codes: tuple[int, int], *, street: str = "MAIN ST", **about: object) -> CrashRecord:
    """Vehicle 1 out of a driveway, vehicle 2 along the street, with these crash types."""
    one = replace(vehicle(1, trafficway=DRIVEWAY), crash_type_code=codes[0], movement=PreCrashMovement.GOING_STRAIGHT)
    two = replace(vehicle(2), crash_type_code=codes[1], movement=PreCrashMovement.GOING_STRAIGHT)
    return report(one, two, street=street, **about)  # type: ignore[arg-type]


def main_street() -> Town:
    town = Town()
    town.street([(-200, 0), (200, 0)], highway="secondary", name="Main Street", lanes="2")
    return town


def drawn(road_map: RoadMap) -> list[Road]:
    return [road for road in road_map.network.roads if road.inferred and road.junction_id is None]


def far_ends(road_map: RoadMap) -> list[tuple[float, float]]:
    """The open ends of the roads that are ours."""
    ends = []
    for road in drawn(road_map):
        line = road_map.network.road_geometry(road.id).line
        for link, s_m in ((road.predecessor, 0.0), (road.successor, road.length_m)):
            if link is None:
                x, y, _, _ = line.at(s_m)
                ends.append((x, y))
    return sorted(ends, key=lambda end: end[1])


def test_a_driveway_comes_from_both_sides_where_the_report_leaves_the_side_open() -> None:
    road_map = build_road_map(main_street().extract(), crash((89, 88)), SETTINGS)
    (x_south, y_south), (x_north, y_north) = far_ends(road_map)
    assert (x_south, x_north) == pytest.approx((0, 0), abs=0.1)
    assert y_south < -40
    assert y_north > 40
    for road in drawn(road_map):
        lanes = [lane for lane in road.lane_sections[0].lanes if lane.type.drivable]
        assert sorted(lane.id for lane in lanes) == [-1, 1]
        assert [lane.widths[0].a for lane in lanes] == pytest.approx([3.05, 3.05])  # 20 ft for both


def test_it_is_marked_as_ours_everywhere_and_joined_to_the_street() -> None:
    road_map = build_road_map(main_street().extract(), crash((89, 88)), SETTINGS)
    text = road_map.stored.xodr.decode()
    assert 'name="Driveway inferred from the crash report"' in text
    assert {road.road_id for road in road_map.report.inferred_roads} == {road.id for road in drawn(road_map)}
    assert all("vehicle 1" in road.why for road in road_map.report.inferred_roads)
    assert all(road.osm_way_ids == () for road in drawn(road_map))
    [junction] = road_map.network.junctions
    incoming = {connection.incoming_road for connection in junction.connections}
    assert incoming >= {road.id for road in drawn(road_map)}
    assert len(incoming) == 4
    assert all(gate.passed is not False for gate in road_map.report.gates)
    assert road_map.network.road_by_id[road_map.report.placement.road_id].name == "Main Street"


def test_the_gates_against_openstreetmap_leave_it_out() -> None:
    town = main_street()
    plain = build_road_map(town.extract(), report(street="MAIN ST"), SETTINGS)
    road_map = build_road_map(town.extract(), crash((89, 88)), SETTINGS)
    length = {
        name: float(gate.detail.split()[1])
        for name, each in (("plain", plain), ("drawn", road_map))
        for gate in each.report.gates
        if gate.name == "way_deviation_mean"
    }
    assert length["drawn"] <= length["plain"] == pytest.approx(400, abs=2)  # and not 100 m of driveways more


def test_a_driveway_of_the_map_is_enough() -> None:
    town = Town()
    town.street([(-200, 0), (5, 0), (200, 0)], highway="secondary", name="Main Street", lanes="2")
    town.street([(5, 0), (5, 60)], highway="service", service="driveway")
    road_map = build_road_map(town.extract(), crash((89, 88), junction_relation=8), SETTINGS)
    assert drawn(road_map) == []
    assert road_map.report.inferred_roads == ()


@pytest.mark.parametrize(("codes", "side"), [((89, 88), "right"), ((87, 86), "left")])
def test_beside_one_carriageway_it_comes_from_the_side_that_is_reported(codes: tuple[int, int], side: str) -> None:
    # ACC_TYPE 88 has the other vehicle come from its right, 86 from its left.
    town = Town()
    town.street([(-200, 0), (200, 0)], highway="secondary", name="Main Street", lanes="2", oneway="yes")
    road_map = build_road_map(town.extract(), crash(codes), SETTINGS)
    [(_, y)] = far_ends(road_map)
    assert math.copysign(1, y) == (-1 if side == "right" else 1)  # traffic goes east


def test_on_a_divided_street_it_leads_across_the_median() -> None:
    town = Town()
    town.street([(-200, 0), (200, 0)], highway="trunk", name="Main Street", lanes="2", oneway="yes")
    town.street([(200, 15), (-200, 15)], highway="trunk", name="Main Street", lanes="2", oneway="yes")
    road_map = build_road_map(town.extract(), crash((87, 86)), SETTINGS)
    [(_, y)] = far_ends(road_map)
    assert y > 40
    nodes = {node for junction in road_map.network.junctions for node in junction.osm_node_ids}
    assert len(nodes) == 2  # one on each carriageway
    assert all(gate.passed is not False for gate in road_map.report.gates)


def test_it_ends_at_the_next_road() -> None:
    town = main_street()
    town.street([(-200, 30), (200, 30)], name="Frontage Road")
    road_map = build_road_map(town.extract(), crash((89, 88)), SETTINGS)
    assert all(end[1] < 0 for end in far_ends(road_map))
    assert len(drawn(road_map)) == 2
    assert len(road_map.network.junctions) == 2


def test_none_is_drawn_at_a_reported_intersection_unless_one_is_reported() -> None:
    reported = replace(crash((89, 88)), road_topology=RoadTopology.FOUR_WAY, junction_relation_code=2)
    with_street = replace(reported.vehicles[0], trafficway_code=1)  # VTRAFWAY: a two-way street
    street = replace(reported, vehicles=(with_street, reported.vehicles[1]))
    assert drawn(build_road_map(main_street().extract(), street, SETTINGS)) == []
    assert drawn(build_road_map(main_street().extract(), reported, SETTINGS)) != []


def test_no_driveway_opens_onto_a_motorway() -> None:
    town = Town()
    town.street([(-200, 0), (200, 0)], highway="motorway", ref="I 81", lanes="2", oneway="yes")
    assert drawn(build_road_map(town.extract(), crash((89, 88), street="I-81"), SETTINGS)) == []


def test_nothing_is_drawn_for_vehicles_that_kept_to_the_street() -> None:
    one, two = (replace(vehicle(n), crash_type_code=50 + n, movement=PreCrashMovement.GOING_STRAIGHT) for n in (0, 1))
    assert drawn(build_road_map(main_street().extract(), report(one, two, street="MAIN ST"), SETTINGS)) == []


def test_one_that_turned_left_between_intersections_turned_into_something() -> None:
    one = replace(vehicle(1), crash_type_code=68, movement=PreCrashMovement.TURNING_LEFT)
    two = replace(vehicle(2), crash_type_code=69, movement=PreCrashMovement.GOING_STRAIGHT)
    road_map = build_road_map(main_street().extract(), report(one, two, street="MAIN ST"), SETTINGS)
    headings = [wrap_angle(math.atan2(y, x)) for x, y in far_ends(road_map)]
    assert headings == pytest.approx([-math.pi / 2, math.pi / 2], abs=0.02)


@settings(max_examples=30)
@given(garbage(), st.sampled_from([(89, 88), (87, 86), (76, 77), (80, 81)]))
def test_garbage_gives_a_map_or_a_rejection(extract: OsmExtract, codes: tuple[int, int]) -> None:
    result = built(extract, crash(codes, junction_relation=8))
    assert isinstance(result, RoadMap) or result.reason in (Reason.MAP_DISTORTED, Reason.CRASH_OFF_ROAD)
