"""Animals in scenarios, pictures, the 3D view and the forms of other tools."""

from __future__ import annotations

from dataclasses import replace
from functools import cache
from xml.etree import ElementTree

import numpy as np
import pytest

from tests.scenario.player import Scenario
from tests.simulation.motions import CAR, crossing, log_of
from tests.verdict.crashes import STREET, record, vehicle
from trace_dag.common.settings import SimSettings
from trace_dag.crash.record import VehicleClass
from trace_dag.export.formats.sumo import floating_car_data
from trace_dag.pages.solid.figures import animal_nodes, animal_places
from trace_dag.scenario.drawn_shapes import logged_shape, upright_shape
from trace_dag.scenario.openscenario import Flavour, OpenScenarios
from trace_dag.simulation.quadrupeds import LANDMARKS
from trace_dag.simulation.types import Body, BodyKind, SimulationLog, VehicleLog

DEER = Body(BodyKind.ANIMAL, VehicleClass.OTHER, 1.60, 0.42, 0.92, 68.0)


@cache
def simulated() -> SimulationLog:
    car, deer = crossing(CAR, DEER, 18.0, walks_mps=2.8, lead_s=2.0)
    return log_of((car, replace(deer, number=2001)), SimSettings(time_limit_s=12.0))


def deer() -> VehicleLog:
    return simulated().vehicle_log(2001)


@pytest.mark.parametrize("flavour", [Flavour(), Flavour(carla=True)], ids=["1.2", "carla"])
def test_an_animal_is_a_pedestrian_of_its_own_category_and_is_struck_when_it_was(flavour: Flavour) -> None:
    xml = OpenScenarios(record(vehicle(1, 12), vehicle(2, 9)), STREET, simulated()).write(flavour)
    (found,) = (each for each in ElementTree.fromstring(xml).iter("ScenarioObject") if each.get("name") == "O1")
    entity = found[0]
    assert entity.tag == "Pedestrian"
    assert entity.get("pedestrianCategory") == "animal"
    assert float(entity.get("mass", "0")) == 68.0
    assert dict(entity.find("BoundingBox/Dimensions").attrib) == {"width": "0.42", "length": "1.6", "height": "0.92"}  # type: ignore[union-attr]
    collision = Scenario(xml).play(0.01)
    assert collision is not None
    assert collision.entities == ("V1", "O1")
    assert collision.time_s == pytest.approx(simulated().contacts[0].time_s, abs=0.05)


def test_an_animal_is_drawn_where_its_landmarks_are() -> None:
    logged = deer()
    for k in (0, len(logged.time_s) // 2, -1):
        shape = logged_shape(logged, k, DEER)
        points = logged.landmarks_m[k].reshape(-1, 3)[:, :2] + (logged.x_m[k], logged.y_m[k])
        at = dict(zip(LANDMARKS, points, strict=True))
        assert shape.torso == pytest.approx(np.array([at["rump"], at["withers"]]))
        assert shape.head == pytest.approx((at["poll"] + at["nose"]) / 2)
        assert len(shape.limbs) == 8


def test_one_that_stands_is_as_long_and_wide_as_its_body_and_faces_ahead() -> None:
    shape = upright_shape(np.array([3.0, 4.0]), np.pi / 2, DEER)
    points = np.concatenate([line for line, _ in shape.lines])
    assert np.ptp(points[:, 1]) < DEER.length_m
    assert np.ptp(points[:, 0]) < DEER.width_m
    assert shape.head[1] > points[:, 1].mean() + 0.4


def test_the_solid_animal_has_every_part_where_the_log_has_it() -> None:
    nodes = {node.name: node for node in animal_nodes(deer(), DEER, "O1", "#D55E00")}
    assert len(nodes) == 3 + 2 * 4
    places = animal_places(deer())
    middle = (places["rump"][0] + places["withers"][0]) / 2
    assert nodes["O1 trunk"].translation == pytest.approx(middle, abs=1e-6)
    assert places["nose"][0][2] > places["foot_fl"][0][2] + 0.6


def test_other_forms_name_it_an_animal() -> None:
    root = ElementTree.fromstring(floating_car_data(simulated()))
    kinds = {each.get("id"): (each.tag, each.get("type")) for each in root[0]}
    assert kinds == {"V1": ("vehicle", "passenger"), "O1": ("person", "animal")}
