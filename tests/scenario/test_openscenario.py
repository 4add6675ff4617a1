"""Scenarios read back by an independent player: they say what the log says, and the crash happens in them."""

from __future__ import annotations

import math
from dataclasses import replace
from xml.etree import ElementTree

import numpy as np
import pytest

from tests.scenario.player import Scenario
from tests.simulation.motions import CAR, TRUCK, driven, participant, straight
from tests.verdict.crashes import CROSSROADS, STREET, record, vehicle
from trace_dag.common.settings import SimSettings
from trace_dag.crash.parties import party_label
from trace_dag.roads.map.model import Cubic
from trace_dag.roads.map.network import RoadNetwork
from trace_dag.scenario.openscenario import Flavour, OpenScenarios
from trace_dag.simulation.embedded import EmbeddedSimulation
from trace_dag.simulation.surface import NetworkSurface
from trace_dag.simulation.types import Participant, SimulationLog
from trace_dag.simulation.vehicles import vehicle_model

RECORD = record(vehicle(1, 12), vehicle(2, 9))
CARLA = Flavour(carla=True)
GRADE = 0.05
HILL = RoadNetwork(STREET.frame, (replace(STREET.roads[0], elevation=(Cubic(0.0, 0.0, GRADE),)),))


def run(*participants: Participant, network: RoadNetwork = STREET) -> SimulationLog:
    settings = SimSettings()
    log = EmbeddedSimulation(settings, NetworkSurface(network), settings.friction).run(participants, time_limit_s=15.0)
    assert log.first_contact is not None
    return log


@pytest.fixture(scope="module")
def crossing() -> SimulationLog:
    """A car from the west, a truck from the north: headings 0 and -90 degrees."""
    truck = straight(1.0, 36.0, -math.pi / 2, 12.0)
    return run(participant(1, straight(-60.0, 0.0, 0.0, 20.0)), participant(2, truck, TRUCK), network=CROSSROADS)


@pytest.fixture(scope="module")
def grazing() -> SimulationLog:
    """Opposite cars whose sides pass 2 cm into each other: they touch for a few milliseconds."""
    there = straight(-40.0, 0.0, 0.0, 20.0)
    back = straight(60.0, CAR.width_m - 0.02, math.pi, 20.0)
    return run(participant(1, there), participant(2, back))


def bounds(log: SimulationLog, scenario: Scenario) -> tuple[float, float]:
    """Largest distance (m) and angle (rad) between the log's bodies and the scenario's boxes at the log's times."""
    distances, angles = [], []
    for logged in log.vehicles:
        x, y, heading = scenario.centres(party_label(logged.number), logged.time_s).T
        distances.append(np.hypot(x - logged.x_m, y - logged.y_m).max())
        angles.append(np.abs(np.angle(np.exp(1j * (heading - logged.heading_rad)))).max())
    return max(distances), max(angles)


@pytest.mark.parametrize("flavour", [Flavour(), CARLA])
@pytest.mark.parametrize("crash", ["crossing", "grazing"])
def test_the_boxes_are_where_the_log_has_the_bodies(crash: str, flavour: Flavour, request) -> None:
    log = request.getfixturevalue(crash)
    scenario = Scenario(OpenScenarios(RECORD, CROSSROADS, log).write(flavour))
    distance_m, angle_rad = bounds(log, scenario)
    assert distance_m < 0.005  # steps are left out where players would keep them in place of the touch
    assert angle_rad < 0.001
    for number, body in log.bodies.items():
        box = scenario.boxes[party_label(number)]
        assert (box.length_m, box.width_m) == pytest.approx((body.length_m, body.width_m))


@pytest.mark.parametrize("crash", ["crossing", "grazing"])
def test_a_player_sees_the_crash_when_and_where_it_was(crash: str, request) -> None:
    log = request.getfixturevalue(crash)
    contact = log.first_contact
    collision = Scenario(OpenScenarios(RECORD, STREET, log).write()).play(step_s=0.001)
    assert collision is not None
    assert collision.time_s == pytest.approx(contact.time_s, abs=0.002)
    assert math.hypot(collision.x_m - contact.x_m, collision.y_m - contact.y_m) < 0.5


def test_nobody_collides_before_the_contact(crossing: SimulationLog) -> None:
    scenario = Scenario(OpenScenarios(RECORD, STREET, crossing).write())
    before_s = crossing.first_contact.time_s - 0.002
    gap_m = scenario.outline("V1", before_s).distance(scenario.outline("V2", before_s))
    assert 0 < gap_m < 0.002 * crossing.first_contact.closing_speed_mps * 2


def test_positions_are_of_the_rear_axle_and_for_scenario_runner_of_the_middle(crossing: SimulationLog) -> None:
    for number, body in crossing.bodies.items():
        model = vehicle_model(body)
        for flavour, middle_m in ((Flavour(), model.rear_axle_m - model.cg_ahead_m), (CARLA, 0.0)):
            scenario = Scenario(OpenScenarios(RECORD, STREET, crossing).write(flavour))
            assert scenario.boxes[f"V{number}"].ahead_m == pytest.approx(middle_m, abs=1e-4)
            entity = scenario.root.find(f"Entities/ScenarioObject[@name='V{number}']/Vehicle")
            rear, front = (float(entity.find(f"Axles/{name}").get("positionX")) for name in ("RearAxle", "FrontAxle"))
            assert rear == 0.0  # the standard's place for it; players move the box by what it is not
            assert front == pytest.approx(model.wheelbase_m, abs=1e-3)


def test_headings_run_on_through_a_full_turn() -> None:
    circle = driven(0.0, -30.0, 0.0, lambda _: 10.0, lambda _: 1 / 20)
    log = run(participant(1, circle), participant(2, straight(-20.0, -10.0, 0.0, 0.0)))
    assert np.abs(np.diff(log.vehicles[0].heading_rad)).max() > 6.0  # the log's own jumps from pi to -pi
    heading = Scenario(OpenScenarios(RECORD, STREET, log).write()).vertices["V1"][:, 4]
    assert np.abs(np.diff(heading)).max() < 0.5


def test_bodies_stand_on_the_slope() -> None:
    """Uphill toward the east: nose up is negative pitch, and the rear axle stands lower than the middle."""
    up, down = straight(-40.0, -1.75, 0.0, 15.0), straight(20.0, -1.75, math.pi, 10.0)
    log = run(
        *(
            replace(each, initial_pose=replace(each.initial_pose, z_m=GRADE * (300 + each.initial_pose.x_m)))
            for each in (participant(1, up), participant(2, down))
        ),
        network=HILL,
    )
    scenario = Scenario(OpenScenarios(RECORD, HILL, log).write())
    for name, pitch_rad in (("V1", -math.atan(GRADE)), ("V2", math.atan(GRADE))):
        x, _, z, _, pitch, roll = scenario.initial[name]
        assert z == pytest.approx(GRADE * (300 + x), abs=0.02)  # the log's height is that under the centre of gravity
        assert pitch == pytest.approx(pitch_rad, abs=1e-3)
        assert roll == pytest.approx(0.0, abs=1e-3)


def test_everyone_starts_where_its_trajectory_does(crossing: SimulationLog) -> None:
    for flavour in (Flavour(), CARLA):
        scenario = Scenario(OpenScenarios(RECORD, STREET, crossing).write(flavour))
        assert scenario.vertices
        for entity, rows in scenario.vertices.items():
            assert rows[0].tolist() == [0.0, *scenario.initial[entity]]
            assert rows[-1, 0] == pytest.approx(crossing.duration_s, abs=1e-6)


@pytest.mark.parametrize("carla", [False, True])
def test_a_free_vehicle_is_left_to_its_controller(crossing: SimulationLog, carla: bool) -> None:
    scenario = Scenario(OpenScenarios(RECORD, STREET, crossing).write(Flavour(carla=carla, free=1)))
    contact_s = crossing.first_contact.time_s
    assert list(scenario.vertices) == ["V2"]
    assert scenario.vertices["V2"][-1, 0] == pytest.approx(contact_s, abs=1e-5)  # no ghost of the crash goes on
    assert scenario.initial.keys() == {"V1", "V2"}
    private = scenario.root.find("Storyboard/Init/Actions/Private[@entityRef='V1']")
    assert private.find(".//ControllerAction") is not None
    stop = scenario.root.find("Storyboard/StopTrigger")
    assert len(stop) == 2  # either is enough
    assert float(stop.find(".//SimulationTimeCondition").get("value")) > contact_s + 1
    assert stop.find(".//TriggeringEntities/EntityRef").get("entityRef") == "V1"
    assert stop.find(".//CollisionCondition/EntityRef").get("entityRef") == "V2"


def test_a_vehicle_that_stood_until_it_was_struck_stands_where_the_other_is_free() -> None:
    """Its way up to the touch has no length, and a trajectory needs two vertices."""
    standing = straight(0.0, 0.0, 0.0, 0.0, until_s=6.0)
    log = run(participant(1, straight(-60.5, 0.0, 0.0, 28.0), TRUCK), participant(2, standing))
    assert log.first_contact is not None
    scenario = Scenario(OpenScenarios(RECORD, STREET, log).write(Flavour(free=1)))
    rows = scenario.vertices["V2"]
    assert len(rows) >= 2
    assert rows[-1, 0] == pytest.approx(log.first_contact.time_s, abs=1e-5)
    assert rows[-1, 1:3] == pytest.approx(rows[0, 1:3], abs=0.01)


def test_whoever_goes_evenly_is_at_the_contact_where_the_other_is_free(crossing: SimulationLog) -> None:
    """Two vertices are enough for an even motion, and neither need be at the touch."""
    whole, contact = crossing.vehicle_log(2), crossing.first_contact
    rows = Scenario(OpenScenarios(RECORD, CROSSROADS, crossing).write(Flavour(carla=True, free=1))).vertices["V2"]
    assert rows[-1, 0] == pytest.approx(contact.time_s, abs=1e-5)
    assert rows[-1, 1] == pytest.approx(np.interp(contact.time_s, whole.time_s, whole.x_m), abs=0.05)
    assert rows[-1, 2] == pytest.approx(np.interp(contact.time_s, whole.time_s, whole.y_m), abs=0.05)


def test_a_near_miss_is_a_scenario_too() -> None:
    """Nothing to follow only up to, and no contact to end after."""
    settings = SimSettings()
    log = EmbeddedSimulation(settings, NetworkSurface(STREET), settings.friction).run(
        (
            participant(1, straight(-40.0, -1.75, 0.0, 15.0, until_s=4.0)),
            participant(2, straight(40.0, 1.75, math.pi, 15.0, until_s=4.0)),
        ),
        time_limit_s=8.0,
    )
    assert log.first_contact is None
    assert Scenario(OpenScenarios(RECORD, STREET, log).write()).play(step_s=0.01) is None
    free = Scenario(OpenScenarios(RECORD, STREET, log).write(Flavour(free=1)))
    assert free.vertices["V2"][-1, 0] == pytest.approx(log.duration_s)


def test_a_vehicle_that_is_not_there_cannot_be_free(crossing: SimulationLog) -> None:
    with pytest.raises(ValueError, match="vehicle 3"):
        OpenScenarios(RECORD, STREET, crossing).write(Flavour(free=3))


@pytest.mark.parametrize("free", [None, 2])
def test_scenario_runner_finds_what_it_asks_for(crossing: SimulationLog, free: int | None) -> None:
    """What its ``openscenario_parser.py`` and ``openscenario_configuration.py`` of 0.9.16 refuse."""
    root = Scenario(OpenScenarios(RECORD, STREET, crossing).write(Flavour(carla=True, free=free))).root
    header = root.find("FileHeader")
    assert (header.get("revMajor"), header.get("revMinor")) == ("1", "0")
    assert not header.get("description").startswith("CARLA:")  # else y and heading would have to be mirrored here
    assert not root.findall("Storyboard/Init//FollowTrajectoryAction")
    assert all(shape.find("Polyline") is not None for shape in root.iter("Shape"))
    assert all(float(vertex.get("time")) >= 0 for vertex in root.iter("Vertex"))
    assert root.find("RoadNetwork/LogicFile").get("filepath") == "map.xodr"
    types = [
        entity.find("Vehicle/Properties/Property[@name='type']").get("value")
        for entity in root.iterfind("Entities/ScenarioObject")
    ]
    assert types == (["simulation", "ego_vehicle"] if free == 2 else ["ego_vehicle", "simulation"])
    assert all(v.get("name").startswith("vehicle.") for v in root.iterfind("Entities/ScenarioObject/Vehicle"))


def test_scenario_runner_gets_no_negative_speed() -> None:
    backing = straight(12.0, 0.0, 0.0, -5.0)
    log = run(participant(1, backing), participant(2, straight(-10.0, 0.0, 0.0, 0.0)))
    speeds = {
        flavour: float(
            ElementTree.fromstring(OpenScenarios(RECORD, STREET, log).write(flavour))
            .find("Storyboard/Init//Private[@entityRef='V1']//AbsoluteTargetSpeed")
            .get("value")
        )
        for flavour in (Flavour(), CARLA)
    }
    assert speeds == {Flavour(): pytest.approx(-5.0, abs=0.01), CARLA: 0.0}


def test_the_same_log_gives_the_same_bytes(crossing: SimulationLog) -> None:
    assert OpenScenarios(RECORD, STREET, crossing).write() == OpenScenarios(RECORD, STREET, crossing).write()


def test_the_first_touch_is_a_vertex(crossing: SimulationLog) -> None:
    """No logged step falls on it."""
    contact = crossing.first_contact
    scenario = Scenario(OpenScenarios(RECORD, STREET, crossing).write())
    for number, pose in ((contact.number_1, contact.pose_1), (contact.number_2, contact.pose_2)):
        times = scenario.vertices[f"V{number}"][:, 0]
        assert np.abs(times - contact.time_s).min() < 1e-5
        x, y, _ = scenario.centres(f"V{number}", np.array([contact.time_s]))[0]
        assert (x, y) == pytest.approx((pose.x_m, pose.y_m), abs=1e-3)
