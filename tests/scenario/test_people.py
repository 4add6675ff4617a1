"""Crashes with people in scenarios: who they are there, that they are struck when and where they were, and by whom."""

from __future__ import annotations

import json
import math
from functools import cache
from pathlib import Path
from xml.etree import ElementTree

import numpy as np
import pytest

from tests.roads import judges
from tests.scenario import esmini
from tests.scenario.player import Scenario
from tests.simulation.motions import CAR, TRUCK, crossing, log_of, participant, straight
from tests.verdict.crashes import STREET, record, vehicle
from trace_dag.common.errors import Failure
from trace_dag.common.settings import SimSettings
from trace_dag.pages.replay_impacts import strikes
from trace_dag.roads.map.writer import write_opendrive
from trace_dag.scenario.carla_blueprints import CHILD_WALKERS, choose_bicycle, choose_walker
from trace_dag.scenario.openscenario import Flavour, OpenScenarios
from trace_dag.simulation.body_sizes import person_body
from trace_dag.simulation.types import BodyKind, SimulationLog

CARLA = Flavour(carla=True)
# A step of a player, and half a hand's breadth that a box reaches beyond the figure in it, at 5 m/s or more.
WHEN_S = 0.03
PEOPLE = {
    "adult before a car": (BodyKind.PEDESTRIAN, 35, CAR, 15.0, 1.4, math.pi / 2),
    "child before a truck": (BodyKind.PEDESTRIAN, 7, TRUCK, 10.0, 1.4, -math.pi / 2),
    "cyclist crossing": (BodyKind.CYCLIST, 35, CAR, 15.0, 4.0, math.pi / 2),
    "cyclist from behind": (BodyKind.CYCLIST, 35, CAR, 18.0, 4.0, 0.0),
    "scooter": (BodyKind.CONVEYANCE, 35, CAR, 12.0, 3.0, 1.2),
}


@cache
def simulated(name: str) -> SimulationLog:
    kind, years, by, speed_mps, walks_mps, walks_rad = PEOPLE[name]
    plans = crossing(by, person_body(kind, years), speed_mps, walks_mps=walks_mps, walks_rad=walks_rad, lead_s=2.0)
    log = log_of(plans, SimSettings(time_limit_s=12.0))
    assert log.first_contact is not None
    return log


@cache
def written(name: str, flavour: Flavour) -> bytes:
    return OpenScenarios(record(vehicle(1, 12), vehicle(2, 9)), STREET, simulated(name)).write(flavour)


def entity(xml: bytes, name: str) -> ElementTree.Element:
    (found,) = (e for e in ElementTree.fromstring(xml).iter("ScenarioObject") if e.get("name") == name)
    return found[0]


@pytest.mark.parametrize("flavour", [Flavour(), CARLA], ids=["1.2", "carla"])
@pytest.mark.parametrize("name", PEOPLE)
def test_a_struck_vehicle_is_struck_at_the_logged_time(name: str, flavour: Flavour) -> None:
    contact = simulated(name).contacts[0]
    for player in (Scenario, esmini.FilteredScenario):
        for step_s in (0.001, 0.02):
            collision = player(written(name, flavour)).play(step_s)
            assert collision is not None
            assert collision.entities == ("V1", "P1")
            assert collision.time_s == pytest.approx(contact.time_s, abs=WHEN_S)
            assert math.dist((collision.x_m, collision.y_m), (contact.x_m, contact.y_m)) < 1.0


@pytest.mark.parametrize("flavour", [Flavour(), CARLA], ids=["1.2", "carla"])
@pytest.mark.parametrize("name", ["adult before a car", "cyclist crossing"])
def test_esmini_shows_the_strike(name: str, flavour: Flavour, tmp_path: Path) -> None:
    (tmp_path / "map.xodr").write_bytes(write_opendrive(STREET))
    (tmp_path / "scenario.xosc").write_bytes(written(name, flavour))
    collision, _, errors = esmini.play(tmp_path / "scenario.xosc", 0.01, tmp_path)
    assert errors == []
    assert collision is not None
    assert collision.time_s == pytest.approx(simulated(name).contacts[0].time_s, abs=WHEN_S)


@pytest.mark.parametrize("name", PEOPLE)
def test_the_middle_of_the_body_is_where_the_log_has_it_on_the_road(name: str) -> None:
    log, scenario = simulated(name), Scenario(written(name, Flavour()))
    person = next(each for each in log.vehicles if each.number == 1001)
    x, y, _ = scenario.centres("P1", person.time_s).T
    assert np.hypot(x - person.x_m, y - person.y_m).max() < 0.02
    assert np.abs(scenario.reference("P1", person.time_s)[:, 2]).max() < 1e-6
    struck_s = log.contacts[0].time_s
    after = scenario.reference("P1", np.array([struck_s, log.duration_s]))[:, 3]
    assert after[1] == pytest.approx(after[0], abs=1e-6)  # it keeps the heading it was struck at


def test_a_pedestrian_is_one_with_its_size_and_mass() -> None:
    child = entity(written("child before a truck", Flavour()), "P1")
    assert (child.tag, child.get("pedestrianCategory"), child.get("mass")) == ("Pedestrian", "pedestrian", "23.0")
    size = child.find("BoundingBox/Dimensions")
    assert float(size.get("height")) == pytest.approx(1.217, abs=0.001)  # CDC: means of boys and girls of 7
    carla = entity(written("child before a truck", CARLA), "P1")
    assert carla.get("model") in CHILD_WALKERS


def test_a_bicycle_is_one_with_two_wheels_in_line() -> None:
    bicycle = entity(written("cyclist crossing", Flavour()), "P1")
    assert (bicycle.tag, bicycle.get("vehicleCategory")) == ("Vehicle", "bicycle")
    axles = [bicycle.find(f"Axles/{which}Axle") for which in ("Front", "Rear")]
    assert [float(axle.get("trackWidth")) for axle in axles] == [0.0, 0.0]
    assert float(axles[0].get("positionX")) == pytest.approx(1.04)  # the hubs are 0.52 m off the middle
    centre = bicycle.find("BoundingBox/Center")
    assert float(centre.get("x")) == pytest.approx(0.52)
    assert entity(written("cyclist crossing", CARLA), "P1").get("name") == "vehicle.bh.crossbike"


def test_with_the_vehicle_free_the_person_walks_up_to_the_strike() -> None:
    log = simulated("adult before a car")
    scenario = Scenario(written("adult before a car", Flavour(free=1)))
    assert set(scenario.vertices) == {"P1"}
    assert scenario.vertices["P1"][-1, 0] == pytest.approx(log.contacts[0].time_s, abs=0.05)
    with pytest.raises(ValueError, match="P1 is a person"):
        written("adult before a car", Flavour(free=1001))


def test_the_official_checker_finds_nothing(tmp_path: Path) -> None:
    judges.judges_environment()
    (tmp_path / "map.xodr").write_bytes(write_opendrive(STREET))
    files = []
    for number, (name, flavour) in enumerate(
        (name, flavour) for name in ("adult before a car", "cyclist crossing") for flavour in (Flavour(), CARLA)
    ):
        files.append(tmp_path / f"{number}.xosc")
        files[-1].write_bytes(written(name, flavour))
    for verdict in judges.official_check(files):
        assert [issue for issue in verdict["issues"] if " WARNING" not in issue] == [], verdict["file"]


def test_a_strike_states_trigger_path_and_point() -> None:
    """A car at 15 m/s, its front at x = 0 after 2 s; somebody walks up the y axis at 1.4 m/s from the start."""
    log = simulated("adult before a car")
    (strike,) = strikes(log)
    assert (strike["person"], strike["vehicle"], strike["kind"]) == ("P1", "V1", "pedestrian")
    assert strike["trigger"]["person_sets_off_at_s"] == 0.0
    assert strike["trigger"]["vehicle_speed_mps"] == pytest.approx(15.0, abs=0.01)
    assert strike["trigger"]["vehicle_distance_to_impact_m"] == pytest.approx(30.0, abs=0.5)
    assert strike["impact"]["person_speed_mps"] == pytest.approx(1.4, abs=0.01)
    assert strike["impact"]["x_m"] == pytest.approx(0.0, abs=0.3)
    path = np.array(strike["path"])
    assert path[:, 2] == pytest.approx(-2.8 + 1.4 * path[:, 0], abs=1e-3)
    assert path[-1, 0] < log.contacts[0].time_s
    assert json.loads(json.dumps(strike)) == strike


def test_somebody_who_waits_sets_off_when_they_walk() -> None:
    """From 1.5 s on; the car has 10 m/s times what is left to go."""
    walks = straight(0.0, -0.7, math.pi / 2, 1.4, until_s=4.0)
    waits = type(walks)(
        np.concatenate([[0.0, 1.45], walks.time_s + 1.5]),
        *(np.concatenate([[v[0]] * 2, v]) for v in (walks.x_m, walks.y_m, walks.z_m, walks.heading_rad)),
        np.concatenate([[0.0, 0.0], walks.speed_mps]),
    )
    person = participant(1001, waits, person_body(BodyKind.PEDESTRIAN))
    car = participant(1, straight(-22.5, 0.0, 0.0, 10.0))
    log = log_of((car, person), SimSettings(time_limit_s=12.0))
    (strike,) = strikes(log)
    assert strike["trigger"]["person_sets_off_at_s"] == pytest.approx(1.48, abs=0.05)
    left_m = 10.0 * strike["trigger"]["time_to_impact_s"]
    assert strike["trigger"]["vehicle_distance_to_impact_m"] == pytest.approx(left_m, abs=0.2)


def test_vehicles_alone_strike_nobody() -> None:
    cars = participant(1, straight(-30.0, 0.0, 0.0, 15.0)), participant(2, straight(30.0, 0.0, math.pi, 15.0))
    assert strikes(log_of(cars, SimSettings(time_limit_s=6.0))) == []


def test_walkers_and_bicycles_are_those_the_server_has() -> None:
    adult, child = (person_body(BodyKind.PEDESTRIAN, years) for years in (40, 6))
    assert choose_walker(adult, ["vehicle.audi.a2", "walker.pedestrian.0030"]) == "walker.pedestrian.0030"
    assert choose_walker(child) in CHILD_WALKERS
    assert choose_bicycle(["vehicle.gazelle.omafiets"]) == "vehicle.gazelle.omafiets"
    with pytest.raises(Failure, match="no walkers"):
        choose_walker(adult, ["vehicle.audi.a2"])
    with pytest.raises(Failure, match="no bicycles"):
        choose_bicycle(["vehicle.audi.a2"])
