"""Traffic around a crash: as much as the tables say, in nobody's way, stopping for who stands, the crash as it was."""

from __future__ import annotations

import math
from itertools import combinations

import numpy as np
import pytest
import shapely
from lxml import etree

from tests.roads import judges
from tests.roads.towns import Town
from tests.simulation.motions import participant, straight
from tests.verdict.crashes import record, vehicle
from trace_dag.common.geometry import Pose, rectangle_corners
from trace_dag.common.settings import SimSettings
from trace_dag.crash.parties import party_label
from trace_dag.export.formats.sumo import floating_car_data
from trace_dag.roads.map.network import RoadNetwork
from trace_dag.roads.map.writer import write_opendrive
from trace_dag.scenario.lights import Party
from trace_dag.scenario.openscenario import OpenScenarios
from trace_dag.scenario.traffic.demand import Streets
from trace_dag.scenario.traffic.simulation import TrafficRequest, surround
from trace_dag.scenario.traffic.sumo_network import network_xml
from trace_dag.scenario.traffic.surrounding import SurroundingTraffic, add_traffic, take_traffic
from trace_dag.scenario.traffic.volumes import Hour, TrafficClass, hourly_volume, vehicle_mix
from trace_dag.simulation.embedded import EmbeddedSimulation
from trace_dag.simulation.surface import NetworkSurface
from trace_dag.simulation.types import Participant, SimulationLog

RUSH_HOUR = Hour(rural=False, weekend=False, hour=17)
LANE_M = 1.75  # from a two-lane street's middle to that of its lane, of 3.5 m


@pytest.fixture(scope="module")
def network() -> RoadNetwork:
    town = Town()
    town.street([(-300, 0), (0, 0), (300, 0)], highway="secondary", lanes="2", maxspeed="45 mph")
    town.street([(0, -300), (0, 0), (0, 300)], highway="residential", lanes="2")
    return town.network()


@pytest.fixture
def sumo(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("SUMO_HOME", str(judges.sumo_home()))


def simulated(network: RoadNetwork, *participants: Participant) -> SimulationLog:
    settings = SimSettings()
    simulation = EmbeddedSimulation(settings, NetworkSurface(network), settings.friction)
    return simulation.run(participants, time_limit_s=15.0)


@pytest.fixture(scope="module")
def crash(network: RoadNetwork) -> SimulationLog:
    """A car from the west at 20 m/s, and one from the south that runs into its side at the crossing."""
    log = simulated(
        network,
        participant(1, straight(-100.0, -LANE_M, 0.0, 20.0)),
        participant(2, straight(LANE_M, -50.0, math.pi / 2, 10.0)),
    )
    assert log.first_contact is not None
    return log


def around(network: RoadNetwork, log: SimulationLog, factor: float) -> SurroundingTraffic:
    return surround("town", network, write_opendrive(network), log, RUSH_HOUR, TrafficRequest(factor, seed=3))


def box(x: float, y: float, heading: float, size_m: tuple[float, float]) -> shapely.Polygon:
    return shapely.Polygon(rectangle_corners(Pose(x, y, heading), *size_m))


def test_nobody_stands_in_another_and_the_crash_is_as_it_was(network, crash, sumo) -> None:
    """Three times the usual traffic, through which cars cross that take no notice of it: some are left out."""
    found = around(network, crash, 3.0)
    assert found.left_out > 0, "none was in the way: the test shows nothing"
    assert len(found.vehicles) > 10
    parties = [Party(crash.bodies[each.number], each) for each in crash.vehicles]
    for time_s in np.arange(0.0, crash.duration_s, 0.1):
        there = [
            box(*(float(each[0]) for each in poses), (vehicle.body.length_m, vehicle.body.width_m))
            for vehicle in (*found.vehicles, *parties)
            if not np.isnan((poses := vehicle.poses_at(np.array([time_s])))[0][0])
        ]
        meet = [
            pair
            for pair in combinations(range(len(there)), 2)
            if there[pair[0]].intersection(there[pair[1]]).area > 1e-3
        ]
        of_parties = (len(there) - 2, len(there) - 1)
        assert set(meet) <= {of_parties}
        if time_s < crash.first_contact.time_s - 0.1:
            assert not meet


def test_the_same_request_gives_the_same_traffic(network, crash, sumo) -> None:
    one, two = around(network, crash, 1.0), around(network, crash, 1.0)
    assert [each.number for each in one.vehicles] == [each.number for each in two.vehicles]
    for a, b in zip(one.vehicles, two.vehicles, strict=True):
        np.testing.assert_array_equal(a.trajectory.x_m, b.trajectory.x_m)


def test_traffic_stops_behind_a_party_that_stands_in_its_lane(network, sumo) -> None:
    """A driver from the west at 45 mph has 150 m to see the car that stands 50 m before the crossing."""
    stands, far_off = straight(-50.0, -LANE_M, 0.0, 0.0), straight(250.0, LANE_M, math.pi, 5.0)
    log = simulated(network, participant(1, stands), participant(2, far_off))
    found = around(network, log, 3.0)
    behind = [
        each
        for each in found.vehicles
        if abs(each.trajectory.y_m[-1] + LANE_M) < 1.0 and -80.0 < each.trajectory.x_m[-1] < -50.0
    ]
    assert behind
    assert min(each.trajectory.speed_mps[-1] for each in behind) < 0.2
    came_later = [
        each for each in found.vehicles if each.trajectory.x_m[0] < -60.0 and abs(each.trajectory.heading_rad[0]) < 0.1
    ]
    assert all(each.trajectory.x_m[-1] < -50.0 for each in came_later), "nobody drives through it"


def test_forms_that_write_a_log_have_the_vehicles_while_they_are_there(network, crash, sumo) -> None:
    found = around(network, crash, 2.0)
    moments = etree.fromstring(floating_car_data(add_traffic(crash, found))).findall("timestep")
    for moment in (moments[0], moments[40]):
        time_s = float(moment.get("time"))
        names = {each.get("id") for each in moment if each.get("id").startswith("S")}
        there = [v for v in found.vehicles if v.trajectory.time_s[0] <= time_s <= v.trajectory.time_s[-1]]
        assert names == {party_label(each.number) for each in there}
        assert names
    all_the_time = add_traffic(crash, found, throughout=True)
    document = etree.fromstring(OpenScenarios(record(vehicle(1, 12), vehicle(2, 9)), network, all_the_time).write())
    entities = {each.get("name") for each in document.iter("ScenarioObject")}
    assert {"V1", "V2"} < entities < {"V1", "V2", *(party_label(each.number) for each in found.vehicles)}


def test_crashes_and_persons_number_as_in_the_tables(network, sumo) -> None:
    """1,899,000 vehicles a year and lane are 5,203 a day, on weekdays 0.762365 * 7 / 5 times that, 7.743 % at 17 h.

    That is 430 an hour; of a residential street 191 / 1899 of it, 43. Poisson: within four standard deviations.
    """
    net = network_xml(str(judges.sumo_home() / "bin" / "netconvert"), "town", network, write_opendrive(network))
    streets = Streets(etree.fromstring(net), network)
    trips = streets.trips(RUSH_HOUR, from_s=0.0, until_s=36_000.0, factor=1.0, seed=1)
    assert len(streets.entries) == 4
    for highway, per_hour in ((TrafficClass.ARTERIAL, 430.0), (TrafficClass.LOCAL, 43.26)):
        came = sum(streets.edges[trip.edges[0]].traffic_class is highway for trip in trips)
        expected = 2 * 10 * per_hour  # two entries of one lane, ten hours
        assert abs(came - expected) < 4 * math.sqrt(expected)


def test_volumes_and_vehicles_are_those_of_the_sources() -> None:
    night = Hour(rural=True, weekend=True, hour=3)
    # 1,885,000 a year / 365, of a week 0.27882 * 7 / 2 a weekend day, 0.679 % of it from 3 h on.
    assert hourly_volume(TrafficClass.INTERSTATE, night) == pytest.approx(5164.4 * 0.97587 * 0.00679, rel=1e-3)
    mix = vehicle_mix(TrafficClass.INTERSTATE, night)
    assert sum(mix.values()) == pytest.approx(1.0)
    assert mix["tractor_trailer"] == pytest.approx(49_104 / 245_687, rel=1e-3)  # of all motor vehicles, VM-1
    days = [
        hourly_volume(TrafficClass.ARTERIAL, Hour(False, weekend, hour))
        for weekend in (False, True)
        for hour in range(24)
    ]
    of_week = 5 * sum(days[:24]) + 2 * sum(days[24:])
    assert of_week == pytest.approx(7 * 1_899_000 / 365, rel=1e-3)


def test_a_log_gives_the_vehicles_back_that_were_put_into_it(network, crash, sumo) -> None:
    found = around(network, crash, 1.0)
    log, taken = take_traffic(add_traffic(crash, found))
    assert [each.number for each in log.vehicles] == [each.number for each in crash.vehicles]
    assert set(log.bodies) == set(crash.bodies)
    for one, other in zip(taken.vehicles, found.vehicles, strict=True):
        assert (one.number, one.body) == (other.number, other.body)
        times = one.trajectory.time_s
        np.testing.assert_allclose(one.trajectory.x_m, np.interp(times, other.trajectory.time_s, other.trajectory.x_m))
    assert take_traffic(crash)[1] is None
