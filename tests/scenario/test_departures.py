"""Departures as pictures, pages and packages show them: objects that say who placed them, vehicles that roll."""

from __future__ import annotations

import json
import math

import numpy as np
import pytest
from lxml import etree

from tests.simulation.test_objects import GUARDRAIL, PICKUP_2000P, TREE, item, run
from tests.simulation.test_overturn import STREET, sliding
from tests.verdict.crashes import record, vehicle
from trace_dag.crash.parties import party_label
from trace_dag.pages.picture_motion import draw_thumbnail
from trace_dag.pages.replay import replay_page
from trace_dag.pages.replay_content import replay_content
from trace_dag.pages.solid.objects import object_parts
from trace_dag.roads.map.writer import write_opendrive
from trace_dag.scenario.drawn_shapes import OBJECT_NOTE, describe_object, object_category, outline
from trace_dag.scenario.opendrive_surroundings import add_objects, fixed_objects
from trace_dag.scenario.openscenario import Flavour, OpenScenarios
from trace_dag.scenario.openscenario_entities import misc_object
from trace_dag.simulation.types import moment_of

CRASH = record(vehicle(1, 12), vehicle(1, 12))


def test_an_object_states_that_the_program_placed_it() -> None:
    tree = item(TREE, 6.0, 0.0)
    assert describe_object(tree) == f"tree ({OBJECT_NOTE})"
    assert object_category(tree) == "tree"
    assert party_label(tree.number) == "O2"
    assert np.hypot(*(outline(tree) - (6.0, 0.0)).T).max() <= 0.5


def test_objects_are_in_the_map_where_they_stand() -> None:
    """OpenDRIVE 1.7, section 11: s and t on the road, the heading relative to it. The street runs from x = -200."""
    rail = item(GUARDRAIL, 10.0, -5.0, math.radians(10))
    root = etree.fromstring(add_objects(write_opendrive(STREET), fixed_objects(STREET, [rail])))
    (found,) = root.xpath("//object[@type='barrier']")
    assert (float(found.get("s")), float(found.get("t"))) == (pytest.approx(210.0), pytest.approx(-5.0))
    assert float(found.get("hdg")) == pytest.approx(math.radians(10), abs=1e-4)
    assert found.find("userData[@code='placedBy']").get("value") == "program"
    assert OBJECT_NOTE in found.get("name")
    assert add_objects(b"<OpenDRIVE/>", []) == b"<OpenDRIVE/>"


def test_objects_are_misc_objects_in_a_scenario_but_not_for_carla() -> None:
    log = run(14.0, item(TREE, 6.0, 0.0))
    scenarios = OpenScenarios(CRASH, STREET, log)
    root = etree.fromstring(scenarios.write())
    (tree,) = root.iter("MiscObject")
    assert tree.get("miscObjectCategory") == "tree"
    assert {each.get("name"): each.get("value") for each in tree.iter("Property")}["placed_by"] == "program"
    teleport = root.find(".//Private[@entityRef='O2']//WorldPosition")
    assert teleport is not None
    assert (float(teleport.get("x", "")), float(teleport.get("y", ""))) == (6.0, 0.0)
    assert not list(etree.fromstring(scenarios.write(Flavour(carla=True))).iter("MiscObject"))


def test_a_ditch_is_below_the_ground_and_as_broad_as_it_slopes() -> None:
    """It falls by 1V:3H over 1.8 m to its bottom at y = 9.1, and rises again over as much; south of it is the road."""
    ditch = item(34, 0.0, 10.0)
    assert outline(ditch)[:, 1].min() == pytest.approx(7.3)
    assert outline(ditch)[:, 1].max() == pytest.approx(10.9)
    (placed,) = fixed_objects(STREET, [ditch])
    assert float(placed.element.get("zOffset")) + float(placed.element.get("height")) == pytest.approx(0.0)
    (box,) = misc_object(ditch).iter("Center")
    assert float(box.get("z")) == pytest.approx(-0.3)
    ((_, mesh),) = object_parts(ditch)
    assert mesh.points_m[:, 2].min() == pytest.approx(-0.6)
    assert mesh.points_m[:, 2].max() == 0.0


def test_a_vehicle_that_rolls_rolls_in_the_scenario_and_stays_above_the_road() -> None:
    log = sliding(22.0, network=STREET, y_m=10.0)
    root = etree.fromstring(OpenScenarios(CRASH, STREET, log).write())
    positions = list(root.iter("WorldPosition"))
    rolls = [float(each.get("r", 0.0)) for each in positions]
    assert max(map(abs, rolls)) > math.pi / 2
    body = log.bodies[1]
    for each, roll in zip(positions, rolls, strict=True):
        # The box hangs over the reference point: its lowest corner may touch the road, and not go below it.
        half_width, height = body.width_m / 2, body.height_m
        corners = [(y, z) for y in (half_width, -half_width) for z in (0.0, height)]
        lowest = min(y * math.sin(roll) + z * math.cos(roll) for y, z in corners)
        assert float(each.get("z", 0.0)) + lowest > -0.05


def test_replays_and_thumbnails_show_an_overturn_without_a_contact() -> None:
    log = sliding(22.0, network=STREET, y_m=10.0)
    moment = moment_of(log)
    assert moment is not None
    assert moment.numbers == (1,)
    page = replay_page(replay_content(CRASH, STREET, log)).decode()
    assert '"overturns":[{"time":' in page
    assert draw_thumbnail(STREET, log).startswith("<svg")


def test_the_replay_lists_objects() -> None:
    page = replay_page(replay_content(CRASH, STREET, run(27.8, item(GUARDRAIL, 10.0, 3.0), PICKUP_2000P))).decode()
    assert json.dumps(OBJECT_NOTE)[1:-1] in page
