"""A bad road that the crash cannot use is left out of the map; one that it can use rejects it."""

from __future__ import annotations

import pytest

from tests.roads.towns import SETTINGS, Town, report
from trace_dag.common.errors import Reason, Rejection
from trace_dag.common.settings import RoadSettings
from trace_dag.crash.record import CrashRecord
from trace_dag.roads.crash_site.placement import place_crash
from trace_dag.roads.from_osm.converter import MapLimits
from trace_dag.roads.gates.gates import require
from trace_dag.roads.gates.scope import CheckedMap, check_in_scope, drop_roads, roads_in_use
from trace_dag.roads.map.network import RoadNetwork
from trace_dag.roads.map.rules import find_violations
from trace_dag.roads.map.writer import write_opendrive

_NO_BRIDGES = MapLimits(grade=0.02)
"""No converter keeps this: any overpass of a main road is steeper."""
_ON_MAIN_STREET = report(street="Main Street")


def _town(overpass_m: float) -> Town:
    """A street east and west of the crash with an overpass across it, and side streets on the way there."""
    town = Town()
    places = [-60.0, 0.0, 60.0, 150.0, overpass_m - 80, overpass_m + 80]
    town.street([(x, 0) for x in places], name="Main Street", highway="secondary")
    for x in (60.0, 150.0):
        town.street([(x, 0), (x, 80)], name="Side Street")
    town.street([(overpass_m, -150), (overpass_m, -40)], highway="secondary", name="High Street")
    town.street([(overpass_m, -40), (overpass_m, 40)], highway="secondary", bridge="yes", layer="1", name="High Street")
    town.street([(overpass_m, 40), (overpass_m, 150)], highway="secondary", name="High Street")
    return town


def _checked(town: Town, settings: RoadSettings = SETTINGS, record: CrashRecord = _ON_MAIN_STREET) -> CheckedMap:
    network = town.network()
    placement = place_crash(network, record, settings)
    return check_in_scope(
        network, town.extract(), placement, name="made by hand", limits=_NO_BRIDGES, settings=settings
    )


def test_a_bad_road_far_away_is_left_out_and_reported() -> None:
    checked = _checked(_town(400.0))
    require(checked.gates)
    assert {road.name for road in checked.left_out} == {"High Street"}
    assert all(road.why.startswith("grade") for road in checked.left_out)
    assert {road.name for road in checked.network.roads if road.name} == {"Main Street", "Side Street"}
    assert find_violations(write_opendrive(checked.network)) == []


def test_a_road_of_the_crash_rejects_its_map() -> None:
    checked = _checked(_town(400.0), record=report(at_m=(400.0, 100.0), street="High Street"))
    assert checked.left_out == ()
    with pytest.raises(Rejection) as rejected:
        require(checked.gates)
    assert rejected.value.reason == Reason.MAP_DISTORTED


def test_with_the_scope_of_all_roads_each_rejects_the_map() -> None:
    with pytest.raises(Rejection):
        require(_checked(_town(400.0), RoadSettings(gate_scope="all")).gates)


@pytest.mark.parametrize(("at_m", "is_left_out"), [(400.0, True), (100.0, False)])
def test_a_way_of_which_no_road_was_made_counts_only_where_the_crash_can_use_it(at_m: float, is_left_out: bool) -> None:
    town = _town(600.0)
    network = town.network()  # made before the map had the last street
    street = town.street([(at_m, 30), (at_m, 90)], name="New Street")
    placement = place_crash(network, _ON_MAIN_STREET, SETTINGS)
    checked = check_in_scope(
        network, town.extract(), placement, name="made by hand", limits=MapLimits(), settings=SETTINGS
    )
    (missing,) = (gate for gate in checked.gates if gate.name == "ways_missing")
    assert missing.passed is is_left_out
    assert [each.osm_way_ids for each in checked.left_out] == ([(street,)] if is_left_out else [])


def test_roads_are_in_use_up_to_200_m_along_the_streets() -> None:
    network = _town(400.0).network()
    used = roads_in_use(network, place_crash(network, report(street="Main Street"), SETTINGS))
    names = [network.road_by_id[road_id].name for road_id in used]
    assert "Side Street" in names
    assert "High Street" not in names


def test_nothing_is_left_of_a_road_that_is_left_out(network: RoadNetwork) -> None:
    assert network.roads
    for road in network.roads:
        xodr = write_opendrive(drop_roads(network, [road.id]))
        assert find_violations(xodr) == []
        for named in ("elementId", "incomingRoad", "connectingRoad"):
            assert f'{named}="{road.id}"' not in xodr.decode().replace(f'"junction" elementId="{road.id}"', "")


@pytest.fixture(name="network")
def _network() -> RoadNetwork:
    town = Town()
    town.street([(-100, 0), (0, 0), (100, 0)], lanes="4", name="Main Street", sidewalk="both")
    town.street([(0, -100), (0, 0), (0, 100)], name="Side Street", sidewalk="both")
    town.sign(0, 0, highway="traffic_signals")
    return town.network()
