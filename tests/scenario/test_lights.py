"""Traffic lights: who is reported to have run one had red, everybody else green; where nobody is, readings stay."""

from __future__ import annotations

import math
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from lxml import etree

from tests.roads import judges
from tests.roads.towns import Town
from tests.simulation.motions import CAR, log_of, participant, straight
from tests.verdict.crashes import record, vehicle
from trace_dag.crash.record import CrashRecord, NonMotorist, PreCrashMovement
from trace_dag.export.formats.lane_rules import place_of
from trace_dag.pages.replay_content import replay_content
from trace_dag.roads.map.network import RoadNetwork
from trace_dag.roads.map.writer import write_opendrive
from trace_dag.scenario.lights import Colour, LightCycle, Lights, crash_lights
from trace_dag.scenario.openscenario import Flavour, OpenScenarios
from trace_dag.scenario.traffic.simulation import TrafficRequest, surround
from trace_dag.scenario.traffic.volumes import Hour
from trace_dag.simulation.body_sizes import person_body
from trace_dag.simulation.states import Trajectory
from trace_dag.simulation.types import BodyKind, SimulationLog

RED, YELLOW, GREEN = Colour.RED, Colour.YELLOW, Colour.GREEN
LANE_M = 1.75
ADULT = person_body(BodyKind.PEDESTRIAN)
SIGNAL, FLASHING, STOP = 3, 4, 20  # VTRAFCON
EASTBOUND = straight(-60.0, -LANE_M, 0.0, 15.0)
WESTBOUND = straight(90.0, LANE_M, math.pi, 15.0)
NORTHBOUND = straight(LANE_M, -46.0, math.pi / 2, 11.0)  # into the side of who goes east


@pytest.fixture(scope="module")
def network() -> RoadNetwork:
    town = Town()
    town.street([(-200, 0), (0, 0), (200, 0)], highway="secondary", lanes="2", maxspeed="50 mph", name="Main")
    town.street([(0, -200), (0, 0), (0, 200)], highway="residential", lanes="2", maxspeed="25 mph", name="Side")
    town.sign(0, 0, highway="traffic_signals")
    return town.network()


def driven(*ways: Trajectory) -> SimulationLog:
    return log_of([participant(number, way) for number, way in enumerate(ways, 1)])


def reported(*disobeyed: bool | None, control: int | None = SIGNAL, **about: object) -> CrashRecord:
    cars = [vehicle(number, 12) for number in (1, 2)]
    return record(
        *(
            replace(each, traffic_control_code=control, disobeyed_control=said, **about)
            for each, said in zip(cars, disobeyed, strict=True)
        )
    )


@pytest.fixture(scope="module")
def crossed() -> SimulationLog:
    log = driven(EASTBOUND, NORTHBOUND)
    assert log.first_contact is not None
    return log


@pytest.mark.parametrize(("disobeyed", "colours"), [((True, False), (RED, GREEN)), ((False, True), (GREEN, RED))])
def test_who_is_reported_to_have_run_the_light_had_red_and_the_other_green(
    disobeyed, colours, network, crossed
) -> None:
    (lights,) = crash_lights(reported(*disobeyed), network, crossed)
    assert lights.ran == (1 + disobeyed.index(True),)
    for met, expected, way, along in zip(lights.met, colours, (EASTBOUND, NORTHBOUND), (0, 1), strict=True):
        road = next(each for each in network.roads if met.signal_id in {signal.id for signal in each.signals})
        line_m = place_of(network, road.id, next(each for each in road.signals if each.id == met.signal_id))[along]
        front_m = (way.x_m, way.y_m)[along][0] + CAR.length_m / 2
        assert met.time_s == pytest.approx((line_m - front_m) / way.speed_mps[0], abs=0.05)
        assert lights.cycle_of[met.signal_id].at(met.time_s) is met.shown is met.wanted is expected


@pytest.mark.parametrize("disobeyed", [(None, None), (False, False)])
def test_where_the_report_has_nobody_both_readings_stay(disobeyed, network, crossed) -> None:
    one, two = crash_lights(reported(*disobeyed), network, crossed)
    assert (one.ran, [each.shown for each in one.met]) == ((1,), [RED, GREEN])
    assert (two.ran, [each.shown for each in two.met]) == ((2,), [GREEN, RED])


def test_who_meets_the_oncoming_had_green_like_the_other(network) -> None:
    (lights,) = crash_lights(reported(False, False), network, driven(EASTBOUND, WESTBOUND))
    assert lights.ran == ()
    assert [each.shown for each in lights.met] == [GREEN, GREEN]


@pytest.mark.parametrize("control", [FLASHING, STOP])
def test_lights_that_flashed_or_that_the_report_does_not_have_have_no_program(control, network, crossed) -> None:
    assert crash_lights(reported(False, False, control=control), network, crossed) == ()


def test_a_turn_on_red_is_allowed(network, crossed) -> None:
    """Its driver can have had either colour; the other one had green."""
    turns = reported(False, False)
    turns = replace(
        turns, vehicles=(replace(turns.vehicles[0], movement=PreCrashMovement.TURNING_RIGHT), turns.vehicles[1])
    )
    (lights,) = crash_lights(turns, network, crossed)
    assert [each.wanted for each in lights.met] == [None, GREEN]
    assert lights.met[1].shown is GREEN


@pytest.mark.parametrize("front_m", [-17.6, -8.0])  # the stop line is at -8.35
def test_who_waits_before_the_light_has_red(front_m, network) -> None:
    stands = straight(front_m - CAR.length_m / 2, -LANE_M, 0.0, 0.0)
    log = driven(straight(front_m - 35.0, -LANE_M, 0.0, 12.0), stands)
    (lights,) = crash_lights(reported(False, False), network, log)
    assert [(each.party, each.stood, each.shown) for each in lights.met] == [(2, True, RED)]


@pytest.mark.parametrize(("circumstances", "ran"), [((), [(1001,), (1,)]), ((3,), [(1001,)])])  # NMCC: disobeyed
def test_who_walks_across_the_way_of_a_driver_ran_the_light_or_the_driver_did(circumstances, ran, network) -> None:
    """On the crosswalk at the far side, 10 m beyond the middle; the car's front is there after 4.5 s."""
    walks = straight(10.0, -LANE_M - 1.4 * 4.6, math.pi / 2, 1.4)
    log = log_of([participant(1, EASTBOUND), participant(1001, walks, ADULT)])
    assert log.first_contact is not None
    crash = replace(reported(None, None), non_motorists=(NonMotorist(1, 5, 1, circumstances=circumstances),))
    readings = crash_lights(crash, network, log)
    assert [each.ran for each in readings] == ran
    assert [each.met[0].shown for each in readings] == [GREEN, RED][: len(ran)]


def test_a_program_is_that_of_the_manuals(network, crossed) -> None:
    """Yellow takes 1 s + v / (2 * 3.05 m/s2): 4.7 s at 50 mph, at 25 mph the least, 3 s; nobody has green beside it."""
    (lights,) = crash_lights(reported(True, False), network, crossed)
    main, side = lights.cycles
    for cycle, yellow_s in ((main, 4.7), (side, 3.0)):
        assert sum(duration_s for duration_s, _ in cycle.steps) == pytest.approx(90.0)
        assert sum(duration_s for duration_s, colour in cycle.steps if colour is YELLOW) == pytest.approx(yellow_s)
    for time_s in np.arange(0.05, 90.0, 0.1):
        assert RED in (main.at(time_s), side.at(time_s))
        assert main.at(time_s) is main.at(time_s + 90.0) is main.at(time_s - 90.0)


def test_a_replay_has_the_stop_lines_in_their_colours_and_says_each_reading(network, crossed) -> None:
    """Main Street's stop lines lie across its right lane of 3.5 m, before and behind the crossing."""
    said = replay_content(reported(False, False), network, crossed, in_3d=False).said
    assert len(said["lights"]) == 4
    for (x1, y1), (_, y2) in (
        each["ends"] for each in said["lights"] if abs(each["ends"][0][0] - each["ends"][1][0]) < 0.1
    ):
        assert abs(x1) > 5.0
        assert sorted(map(abs, (y1, y2))) == pytest.approx([0.0, 3.5], abs=0.02)
    assert said["lights_said"] == (
        "The report has nobody who ran the light. "
        "Shown: V1 crossed its stop line on red; V2 crossed its stop line on green. "
        "Or else: V1 crossed its stop line on green; V2 crossed its stop line on red."
    )


def test_openscenario_has_the_programs_and_the_official_checker_finds_nothing(network, crossed, tmp_path: Path) -> None:
    scenarios = OpenScenarios(reported(False, False), network, crossed)
    files = []
    for reading in (0, 1):
        data = scenarios.write(Flavour(lights=reading))
        controllers = etree.fromstring(data).findall("RoadNetwork/TrafficSignals/TrafficSignalController")
        assert [each.get("name") for each in controllers] == [each.id for each in network.controllers]
        met = scenarios.lights[reading].met[0]
        (controller,) = (
            c
            for c in controllers
            if c.find(f"Phase/TrafficSignalState[@trafficSignalId='{met.signal_id}']") is not None
        )
        ends = np.cumsum([float(each.get("duration")) for each in controller])
        assert ends[-1] == pytest.approx(90.0)
        assert controller[int(np.searchsorted(ends, met.time_s))][0].get("state") == met.shown
        files.append(tmp_path / f"{reading}.xosc")
        files[-1].write_bytes(data)
    (tmp_path / "map.xodr").write_bytes(write_opendrive(network))
    assert b"TrafficSignals" not in scenarios.write(Flavour(carla=True))
    judges.judges_environment()
    for verdict in judges.official_check(files):
        assert [issue for issue in verdict["issues"] if " WARNING" not in issue] == [], verdict["file"]


def test_surrounding_vehicles_stop_before_a_light_that_is_red(network, crossed, monkeypatch) -> None:
    """Main Street's stop lines are 8.35 m from the middle; its light is red for ever, the other one green."""
    monkeypatch.setenv("SUMO_HOME", str(judges.sumo_home()))
    main, side = network.controllers
    lights = Lights(
        tuple(LightCycle(c.id, c.signal_ids, ((90.0, shown),)) for c, shown in ((main, RED), (side, GREEN)))
    )
    request, at = TrafficRequest(3.0, seed=3), Hour(rural=False, weekend=False, hour=17)
    found = surround("town", network, write_opendrive(network), crossed, at, request, lights)
    fronts = [
        (np.abs(t.x_m) - each.body.length_m / 2, t.speed_mps)
        for each in found.vehicles
        for t in [each.trajectory]
        if np.abs(np.sin(t.heading_rad)).max() < 0.1 and (t.x_m[0] > 0) == (np.cos(t.heading_rad[0]) < 0)
    ]
    assert any(speed_mps[-1] < 0.1 for _, speed_mps in fronts)
    assert all(to_go_m.min() > 8.0 for to_go_m, _ in fronts)
