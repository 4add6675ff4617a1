"""Road maps built whole: from an extract and a record to a network that passes its gates, or a rejection."""

from __future__ import annotations

import dataclasses

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from tests.roads.towns import FRAME, SETTINGS, Town, report, vehicle
from trace_dag.common.errors import Reason, Rejection
from trace_dag.common.settings import RoadSettings
from trace_dag.crash.classes import RoadTopology
from trace_dag.crash.record import CrashRecord
from trace_dag.osm.types import BoundingBox, OsmExtract, OsmMember, OsmNode, OsmRelation, OsmWay
from trace_dag.roads.build import RejectedRoadMap, RoadMap, build_road_map
from trace_dag.roads.gates.gates import check_map
from trace_dag.roads.map.reader import read_opendrive
from trace_dag.roads.map.writer import Marks
from trace_dag.roads.report import MapGate


def built(extract: OsmExtract, record: CrashRecord, settings: RoadSettings = SETTINGS) -> RoadMap | Rejection:
    try:
        return build_road_map(extract, record, settings)
    except Rejection as rejection:
        return rejection


def town_with_a_bridge() -> Town:
    town = Town()
    town.street([(-200, 0), (200, 0)], highway="primary", name="Main Street", lanes="2")
    town.street([(60, -200), (60, -30)], name="Over Road")
    town.street([(60, -30), (60, 30)], name="Over Road", bridge="yes", layer="1")
    town.street([(60, 30), (60, 200)], name="Over Road")
    return town


def test_values_filled_from_the_report_are_marked_on_the_map() -> None:
    town = Town()
    town.street([(-200, 0), (200, 0)], highway="secondary", name="Main Street")
    car = vehicle(lanes=4, trafficway=1, limit_mph=45)
    road_map = build_road_map(town.extract(), report(car, car, street="MAIN ST"), SETTINGS)
    [road] = road_map.network.roads
    assert sum(lane.type.drivable for lane in road.lane_sections[0].lanes) == 4
    assert road.speed_mps == pytest.approx(car.speed_limit_mps)
    said = {c.attribute: (c.agreement, c.filled_from_report) for c in road_map.report.comparisons}
    assert said["lanes"] == ("not comparable", True)
    assert said["speed limit"] == ("not comparable", True)
    assert said["intersection type"] == ("agrees", False)
    assert road_map.report.roads == 1
    assert all(gate.passed is not False for gate in road_map.report.gates)


@pytest.mark.parametrize("marks", ["reconstruction", "legal"])
def test_the_stages_after_are_handed_what_the_written_file_states(marks: Marks) -> None:
    road_map = build_road_map(town_with_a_bridge().extract(), report(street="MAIN ST"), RoadSettings(marks=marks))
    assert road_map.stored.network == read_opendrive(road_map.stored.xodr, name="map")


def test_with_elevation_off_a_bridge_near_the_crash_rejects_it_as_published() -> None:
    flat = RoadSettings(elevation=False)
    rejection = built(town_with_a_bridge().extract(), report(street="MAIN ST"), flat)
    assert isinstance(rejection, Rejection)
    assert rejection.reason == Reason.VERTICAL_GEOMETRY
    assert rejection.measured == pytest.approx(60, abs=0.5)
    near_only = RoadSettings(elevation=False, vertical_geometry_radius_m=50.0)
    beyond = built(town_with_a_bridge().extract(), report(street="MAIN ST"), near_only)
    assert isinstance(beyond, RoadMap) or beyond.reason != Reason.VERTICAL_GEOMETRY


def test_a_map_that_its_crash_is_rejected_for_comes_with_the_streets_around() -> None:
    town = Town()
    town.street([(-200, 0), (200, 0)], name="Elm Street")
    town.street([(-200, 60), (200, 60)], name="Oak Street")
    rejected = built(town.extract(), report(at_m=(0, 20), street="OAK ST"))
    assert isinstance(rejected, RejectedRoadMap)
    assert rejected.reason == Reason.CRASH_OFF_ROAD
    half_m = 3.35  # two lanes of a residential street
    assert [(street.name, street.bears_reported_name) for street in rejected.report.streets] == [
        ("Elm Street", False),
        ("Oak Street", True),
    ]
    assert [street.distance_m for street in rejected.report.streets] == pytest.approx(
        [20 - half_m, 40 - half_m], abs=0.1
    )
    elm, oak = (street.nearest_xy_m for street in rejected.report.streets)
    assert elm == pytest.approx((0.0, -20 + half_m), abs=0.1)
    assert oak == pytest.approx((0.0, 40 - half_m), abs=0.1)
    assert len(read_opendrive(rejected.xodr, name="map").roads) == 2


def test_a_gate_that_does_not_hold_leaves_the_map_and_what_was_measured(monkeypatch: pytest.MonkeyPatch) -> None:
    def strict(*given: object, **limits: object) -> tuple[MapGate, ...]:
        return tuple(
            dataclasses.replace(gate, passed=gate.name != "way_deviation_mean") for gate in check_map(*given, **limits)
        )

    monkeypatch.setattr("trace_dag.roads.gates.scope.check_map", strict)
    rejected = built(town_with_a_bridge().extract(), report(street="MAIN ST"))
    assert isinstance(rejected, RejectedRoadMap)
    assert rejected.reason == Reason.MAP_DISTORTED
    assert [gate.name for gate in rejected.report.gates if not gate.passed] == ["way_deviation_mean"]


def test_an_extract_without_roads_is_rejected() -> None:
    empty = OsmExtract(BoundingBox(36.99, -77.01, 37.01, -76.99), {}, ())
    rejection = built(empty, report())
    assert isinstance(rejection, Rejection)
    assert rejection.reason == Reason.MAP_DISTORTED


COORDINATES = st.sampled_from([0.0, 1e-7, 10.0, 10.0, 25.0, -40.0, 60.0, -80.0, 150.0, -150.0, 2000.0])
TAG_VALUES = st.sampled_from(
    ["many", "ground", "signals", "yes", "no", "-1", "2", "2;3", "", "0", "99", "|", "left|right", "NaN", "1e9", "ü"]
)
TAGS = st.dictionaries(
    st.sampled_from(
        (
            *("lanes", "layer", "maxspeed", "oneway", "bridge", "tunnel", "width", "turn:lanes", "junction", "name"),
            *("lanes:forward", "lanes:backward", "lanes:both_ways", "incline", "placement", "shoulder", "ref"),
        )
    ),
    TAG_VALUES,
    max_size=5,
)
HIGHWAYS = st.sampled_from(["motorway", "motorway_link", "primary", "residential", "service", "footway", "many"])


@st.composite
def garbage(draw: st.DrawFn) -> OsmExtract:
    """Extracts as nobody draws them: loops, doubled nodes, nodes at one place, ways of one node, senseless tags."""
    nodes = {}
    for number in range(1, draw(st.integers(1, 9)) + 1):
        latitude, longitude = FRAME.to_geographic([draw(COORDINATES), draw(COORDINATES)]).tolist()  # type: ignore[arg-type]
        highway = draw(st.sampled_from(["", "traffic_signals", "stop", "crossing"]))
        node_tags = {"highway": highway, "ele": draw(TAG_VALUES)} if highway else {}
        nodes[number] = OsmNode(number, latitude, longitude, node_tags)
    refs = st.lists(st.sampled_from(sorted(nodes)), min_size=1, max_size=7).map(tuple)
    ways = tuple(
        OsmWay(number, draw(refs), {"highway": draw(HIGHWAYS), **draw(TAGS)})
        for number in range(1, draw(st.integers(0, 5)) + 1)
    )
    member = st.builds(
        OsmMember, st.sampled_from(["node", "way"]), st.integers(1, 10), st.sampled_from(["from", "via", "to"])
    )
    members = draw(st.lists(member, max_size=4).map(tuple))
    relation = OsmRelation(
        1, members, {"type": "restriction", "restriction": draw(st.sampled_from(["no_u_turn", "x"]))}
    )
    return OsmExtract(BoundingBox(36.99, -77.01, 37.01, -76.99), nodes, ways, (relation,))


@settings(max_examples=60)
@given(
    garbage(), st.sampled_from(list(RoadTopology)), st.sampled_from([None, 1, 2, 7]), st.sampled_from([None, 0, 3, 20])
)
def test_garbage_gives_a_map_or_a_rejection(
    extract: OsmExtract, topology: RoadTopology, lanes: int | None, control: int | None
) -> None:
    car = vehicle(lanes=lanes, trafficway=2, control=control, limit_mph=35)
    result = built(extract, report(car, car, street="US-1/MAIN ST", topology=topology))
    assert isinstance(result, RoadMap) or result.reason in (Reason.MAP_DISTORTED, Reason.CRASH_OFF_ROAD)


@pytest.mark.parametrize("nodes", [2000])
def test_a_way_of_very_many_nodes(nodes: int) -> None:
    town = Town()
    town.street([(-150 + 300 * i / nodes, 3 * (i % 2) * 1e-3) for i in range(nodes)], name="Main Street")
    assert isinstance(built(town.extract(), report(street="MAIN ST")), RoadMap | Rejection)


@pytest.mark.parametrize(("latitude", "longitude"), [(51.9, 179.9999), (51.9, -179.9999), (89.99, 0.0), (-89.99, 10.0)])
def test_places_where_degrees_are_strange(latitude: float, longitude: float) -> None:
    nodes = {i: OsmNode(i, latitude + 1e-4 * i * (-1 if latitude > 0 else 1), longitude) for i in (0, 1, 2)}
    extract = OsmExtract(BoundingBox(-90, -180, 90, 180), nodes, (OsmWay(1, (0, 1, 2), {"highway": "residential"}),))
    record = dataclasses.replace(report(), latitude_deg=latitude, longitude_deg=longitude)
    assert isinstance(built(extract, record), RoadMap | Rejection)
