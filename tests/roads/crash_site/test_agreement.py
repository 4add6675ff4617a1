"""The map against the report, and what the report adds where the map is silent."""

from __future__ import annotations

import math

import pytest

from tests.roads.towns import FRAME, SETTINGS, Town, report, vehicle
from trace_dag.common.units import mph_to_mps
from trace_dag.crash.classes import RoadTopology
from trace_dag.crash.record import CrashRecord
from trace_dag.osm.types import OsmExtract
from trace_dag.roads.crash_site.agreement import AGREES, DIFFERS, NOT_COMPARABLE, compare
from trace_dag.roads.crash_site.crossings import add_kinds
from trace_dag.roads.crash_site.gap_filling import GapFilling, fill_gaps
from trace_dag.roads.crash_site.placement import place_crash
from trace_dag.roads.from_osm.convert import convert
from trace_dag.roads.report import Comparison

UNDIVIDED, DIVIDED, ONE_WAY, TURN_LANE, RAMP = 1, 2, 4, 5, 6  # VTRAFWAY
NO_CONTROL, SIGNAL, STOP = 0, 3, 20  # VTRAFCON


def compared(town: Town, record: CrashRecord) -> dict[str, Comparison]:
    network = town.network()
    return {c.attribute: c for c in compare(network, record, place_crash(network, record, SETTINGS))}


def filled(town: Town, record: CrashRecord) -> GapFilling:
    network = town.network()
    return fill_gaps(network, town.extract(), record, place_crash(network, record, SETTINGS))


def one_street(**tags: str) -> Town:
    town = Town()
    town.street([(-200, 0), (200, 0)], name="Main Street", **tags)
    return town


def divided_street(lanes: str = "2") -> Town:
    town = Town()
    for line in ([(-200, -8), (200, -8)], [(200, 8), (-200, 8)]):
        town.street(line, highway="primary", oneway="yes", name="Main Street", lanes=lanes)
    return town


def crossing(main: dict[str, str], elm: dict[str, str]) -> Town:
    town = Town()
    town.street([(-200, 0), (0, 0), (200, 0)], highway="primary", name="Main Street", **main)
    town.street([(0, -200), (0, 0), (0, 200)], name="Elm Street", **elm)
    return town


@pytest.mark.parametrize(
    ("town", "at_m", "lanes", "trafficway", "agreement"),
    [
        (one_street(lanes="2"), (0, 1), 2, UNDIVIDED, AGREES),
        (one_street(lanes="4"), (0, 1), 4, UNDIVIDED, AGREES),
        (one_street(lanes="4"), (0, 1), 2, UNDIVIDED, DIFFERS),
        (one_street(lanes="4"), (0, 1), 2, DIVIDED, AGREES),  # a painted median: only the vehicle's side counts
        (one_street(lanes="5", lanes__both_ways="1"), (0, 1), 5, TURN_LANE, AGREES),
        (one_street(lanes="5", lanes__both_ways="1"), (0, 1), 4, UNDIVIDED, AGREES),  # without the turn lane
        (one_street(lanes="5", lanes__both_ways="1"), (0, 1), 3, UNDIVIDED, DIFFERS),
        (one_street(lanes="4", oneway="yes", turn__lanes="left||through|right"), (0, 1), 2, ONE_WAY, AGREES),
        (one_street(lanes="4", oneway="yes", turn__lanes="left||through|right"), (0, 1), 4, ONE_WAY, AGREES),
        (one_street(lanes="4", oneway="yes", turn__lanes="left||through|right"), (0, 1), 3, ONE_WAY, DIFFERS),
        (divided_street(), (0, -8), 2, DIVIDED, AGREES),
        (divided_street(), (0, -8), 4, DIVIDED, DIFFERS),
        (divided_street(), (0, -8), 4, UNDIVIDED, AGREES),  # both carriageways together
        (divided_street(), (0, -8), 2, UNDIVIDED, DIFFERS),
        (divided_street(), (0, -8), 4, None, AGREES),  # the report does not say which it counts
        (divided_street(), (0, -8), 3, None, DIFFERS),
        (one_street(lanes="3", oneway="yes"), (0, 1), 3, ONE_WAY, AGREES),
        (one_street(lanes="9", oneway="yes"), (0, 1), 7, ONE_WAY, AGREES),  # seven or more
        (one_street(), (0, 1), 2, UNDIVIDED, NOT_COMPARABLE),
        (one_street(lanes="2"), (0, 1), None, UNDIVIDED, NOT_COMPARABLE),
    ],
)  # fmt: skip
def test_lanes_as_fars_counts_them(
    town: Town, at_m: tuple[float, float], lanes: int | None, trafficway: int | None, agreement: str
) -> None:
    car = vehicle(lanes=lanes, trafficway=trafficway)
    result = compared(town, report(car, car, at_m=at_m, street="MAIN ST"))["lanes"]
    assert result.agreement == agreement, result


def test_turn_lanes_that_begin_at_the_crossing_count() -> None:
    town = Town()
    town.street([(-200, 0), (-40, 0)], name="Main Street", lanes="2")
    town.street([(-40, 0), (0, 0)], name="Main Street", lanes="3", lanes__forward="2", lanes__backward="1")
    town.street([(0, 0), (0, 100)], name="Elm Street", lanes="2")
    town.street([(0, 0), (200, 0)], name="Main Street", lanes="2")
    for lanes in (2, 3):
        car = vehicle(lanes=lanes, trafficway=UNDIVIDED)
        record = report(car, car, at_m=(-10, 0), street="MAIN ST", cross="ELM ST", topology=RoadTopology.T)
        assert compared(town, record)["lanes"].agreement == AGREES


def test_each_vehicle_is_compared_with_the_street_it_fits() -> None:
    town = crossing({"lanes": "4", "maxspeed": "45 mph"}, {"lanes": "2", "maxspeed": "25 mph"})
    main, elm = (
        vehicle(1, lanes=4, limit_mph=45, trafficway=UNDIVIDED),
        vehicle(2, lanes=2, limit_mph=25, trafficway=UNDIVIDED),
    )
    about = {"street": "MAIN ST", "cross": "ELM ST", "topology": RoadTopology.FOUR_WAY}
    results = compared(town, report(main, elm, **about))  # type: ignore[arg-type]
    assert {results[name].agreement for name in ("lanes", "speed limit", "trafficway", "intersection type")} == {AGREES}
    neither = vehicle(2, lanes=6, limit_mph=25, trafficway=UNDIVIDED)
    assert compared(town, report(main, neither, **about))["lanes"].agreement == DIFFERS  # type: ignore[arg-type]


@pytest.mark.parametrize(
    ("town", "trafficway", "agreement"),
    [
        (one_street(), UNDIVIDED, AGREES),
        (one_street(), DIVIDED, DIFFERS),
        (divided_street(), DIVIDED, AGREES),
        (divided_street(), UNDIVIDED, DIFFERS),
        (one_street(oneway="yes"), ONE_WAY, AGREES),
        (one_street(highway="motorway_link", oneway="yes"), RAMP, AGREES),
        (one_street(), None, NOT_COMPARABLE),
    ],
)
def test_trafficway(town: Town, trafficway: int | None, agreement: str) -> None:
    car = vehicle(trafficway=trafficway)
    assert compared(town, report(car, car, at_m=(0, -6), street="MAIN ST"))["trafficway"].agreement == agreement


@pytest.mark.parametrize(
    ("maxspeed", "limit_mph", "agreement"),
    [
        ("45 mph", 45, AGREES),
        ("40", 25, AGREES),  # 40 km/h is 24.9 mph
        ("45 mph", 40, DIFFERS),
        ("signals", 45, NOT_COMPARABLE),
        ("45 mph", None, NOT_COMPARABLE),
    ],
)
def test_speed_limits(maxspeed: str, limit_mph: float | None, agreement: str) -> None:
    car = vehicle(limit_mph=limit_mph)
    result = compared(one_street(maxspeed=maxspeed), report(car, car, street="MAIN ST"))["speed limit"]
    assert result.agreement == agreement, result


@pytest.mark.parametrize(
    ("topology", "at_m", "agreement"),
    [
        (RoadTopology.FOUR_WAY, (0, 0), AGREES),
        (RoadTopology.T, (0, 0), DIFFERS),
        (RoadTopology.NOT_AN_INTERSECTION, (0, 0), DIFFERS),
        (RoadTopology.NOT_AN_INTERSECTION, (100, 0), AGREES),
        (RoadTopology.FOUR_WAY, (150, 0), DIFFERS),
        (RoadTopology.OTHERS, (0, 0), NOT_COMPARABLE),
    ],
)
def test_intersection_types(topology: RoadTopology, at_m: tuple[float, float], agreement: str) -> None:
    record = report(at_m=at_m, street="MAIN ST", topology=topology)
    assert compared(crossing({}, {}), record)["intersection type"].agreement == agreement


@pytest.mark.parametrize(
    ("cross", "mapped"),
    [
        ("ELM ST", RoadTopology.FOUR_WAY),
        ("OAK ST", RoadTopology.T),
        ("ASH ST", RoadTopology.T),  # not on the map
        ("", RoadTopology.T),
    ],
)
def test_the_type_is_that_of_the_crossing_whose_streets_are_reported(cross: str, mapped: RoadTopology) -> None:
    town = Town()
    town.street([(-200, 0), (0, 0), (120, 0), (200, 0)], name="Main Street")
    town.street([(0, -200), (0, 0), (0, 200)], name="Elm Street")
    town.street([(120, 0), (120, 200)], name="Oak Street")
    record = report(at_m=(110, -2), street="MAIN ST", cross=cross, topology=RoadTopology.FOUR_WAY, junction_relation=3)
    assert compared(town, record)["intersection type"].mapped == mapped.value


def test_a_bend_is_an_l() -> None:
    town = Town()
    town.street([(-150, 0), (-5, 0), (0, 5), (0, 150)], name="Main Street")
    record = report(at_m=(-3, 1), street="MAIN ST", topology=RoadTopology.L)
    assert compared(town, record)["intersection type"].agreement == AGREES


@pytest.mark.parametrize("first", [[(-150, 0), (0, 0)], [(0, 0), (-150, 0)]])
@pytest.mark.parametrize("second", [[(0, 0), (0, 150)], [(0, 150), (0, 0)]])
@pytest.mark.parametrize("at_m", [(-6, 0), (0, 6)])
def test_a_corner_at_which_the_street_changes_its_name_is_an_l(first, second, at_m) -> None:
    town = Town()
    town.street(first, name="Main Street")
    town.street(second, name="Oak Avenue")
    record = report(at_m=at_m, street="MAIN ST", cross="OAK AVE", topology=RoadTopology.L)
    assert compared(town, record)["intersection type"].agreement == AGREES


def test_a_new_name_straight_on_is_no_l() -> None:
    town = Town()
    town.street([(-150, 0), (0, 0)], name="Main Street")
    town.street([(150, 0), (0, 0)], name="Oak Avenue")
    record = report(at_m=(-6, 0), street="MAIN ST", cross="OAK AVE", topology=RoadTopology.L)
    assert compared(town, record)["intersection type"].agreement == DIFFERS


def test_the_report_fills_only_what_osm_leaves_open() -> None:
    town = Town()
    tagged = town.street([(-200, 0), (0, 0)], name="Main Street", lanes="2")
    open_way = town.street([(0, 0), (200, 0)], highway="tertiary", name="Main Street")
    car = vehicle(lanes=4, limit_mph=35, trafficway=UNDIVIDED)
    filling = filled(town, report(car, car, at_m=(50, 0), street="MAIN ST"))
    assert filling.attributes == {"lanes", "speed limit"}
    assert filling.hints[open_way].lanes == 4
    assert filling.hints[open_way].speed_mps == pytest.approx(mph_to_mps(35))
    assert tagged not in filling.hints
    network = convert(town.extract(), FRAME, SETTINGS, filling.hints)
    road = next(road for road in network.roads if open_way in road.osm_way_ids)
    assert sum(lane.type.drivable for lane in road.lane_sections[-1].lanes) == 4
    assert not road.lanes_from_tags


def test_nothing_is_filled_where_osm_speaks_or_the_report_contradicts_itself() -> None:
    two, four = vehicle(1, lanes=2, limit_mph=35), vehicle(2, lanes=4, limit_mph=45)
    assert (
        filled(one_street(lanes="2", maxspeed="25 mph"), report(two, two, street="MAIN ST")).attributes == frozenset()
    )
    assert filled(one_street(), report(two, four, street="MAIN ST")).attributes == frozenset()


@pytest.mark.parametrize(
    ("tags", "lanes", "trafficway", "expected"),
    [
        ({}, 2, DIVIDED, 4),  # one line on the map for a road whose sides the report counts singly
        ({"oneway": "yes"}, 4, UNDIVIDED, 2),
        ({"oneway": "yes"}, 3, ONE_WAY, 3),
        ({"oneway": "yes"}, 3, UNDIVIDED, None),
        ({}, 2, ONE_WAY, None),
    ],
)
def test_lane_counts_are_filled_as_the_road_object_has_them(
    tags: dict[str, str], lanes: int, trafficway: int, expected: int | None
) -> None:
    car = vehicle(lanes=lanes, trafficway=trafficway)
    hints = filled(one_street(**tags), report(car, car, street="MAIN ST")).hints
    assert [hint.lanes for hint in hints.values()] == ([] if expected is None else [expected])


def added_nodes(town: Town, filling: GapFilling) -> list[tuple[dict[str, str], tuple[float, float]]]:
    before = town.extract().nodes
    new = [n for i, n in filling.extract.nodes.items() if before.get(i) != n]
    return [(n.tags, tuple(FRAME.to_local(n.latitude_deg, n.longitude_deg).tolist())) for n in new]


def test_a_reported_signal_is_put_on_the_crossing() -> None:
    town = crossing({}, {})
    car = vehicle(control=SIGNAL)
    filling = filled(town, report(car, car, street="MAIN ST", cross="ELM ST", topology=RoadTopology.FOUR_WAY))
    assert filling.attributes == {"traffic control"}
    [(tags, place)] = added_nodes(town, filling)
    assert tags == {"highway": "traffic_signals"}
    assert math.hypot(*place) < 0.1


def test_a_reported_stop_sign_stands_before_the_crossing_on_the_lesser_street_and_faces_who_comes() -> None:
    town = crossing({}, {})
    cars = vehicle(1, control=NO_CONTROL), vehicle(2, control=STOP)
    filling = filled(town, report(*cars, street="MAIN ST", cross="ELM ST", topology=RoadTopology.FOUR_WAY))
    signs = added_nodes(town, filling)
    assert sorted(place[1] for _, place in signs) == [pytest.approx(-10, abs=0.1), pytest.approx(10, abs=0.1)]
    assert all(abs(place[0]) < 0.1 and tags["highway"] == "stop" for tags, place in signs)
    south = next(tags for tags, place in signs if place[1] < 0)
    assert south["direction"] == "forward"  # the way runs north: who comes from the south goes along it
    assert {tags["direction"] for tags, _ in signs} == {"forward", "backward"}
    refs_of(filling.extract)


def refs_of(extract: OsmExtract) -> None:
    for way in extract.ways:
        assert all(node_id in extract.nodes for node_id in way.node_ids)
    add_kinds(convert(extract, FRAME, SETTINGS), extract)


def test_a_control_that_osm_has_is_left_alone() -> None:
    town = crossing({}, {})
    town.sign(0, 0, highway="traffic_signals")
    car = vehicle(control=STOP)
    record = report(car, car, street="MAIN ST", cross="ELM ST", topology=RoadTopology.FOUR_WAY)
    network = town.network()
    if not any(signal.type == "1000001" for road in network.roads for signal in road.signals):
        pytest.skip("the converter places no signals")
    assert "traffic control" not in filled(town, record).attributes
    assert compared(town, record)["traffic control"].agreement == DIFFERS
