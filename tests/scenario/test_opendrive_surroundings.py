"""What is beside the roads as objects of the map: where it is, how high, and what is left out."""

from __future__ import annotations

import math

import numpy as np
import pytest
import shapely
from lxml import etree

from tests.verdict.crashes import STREET
from trace_dag.osm.types import OsmFeature
from trace_dag.roads.map.writer import write_opendrive
from trace_dag.scenario.opendrive_surroundings import add_objects, surrounding_objects


def feature(shape: shapely.Geometry, number: int = 1, **tags: str) -> OsmFeature:
    def to_geographic(places_m: np.ndarray) -> np.ndarray:
        return STREET.frame.to_geographic(places_m)[:, ::-1]

    return OsmFeature(f"way/{number}", shapely.transform(shape, to_geographic), tags)


def objects(*features: OsmFeature, **options) -> list[etree._Element]:
    """The objects on the map as another program reads them. The street runs east from x = -300, where s = 0."""
    placed = surrounding_objects(STREET, features, **options)
    return etree.fromstring(add_objects(write_opendrive(STREET), placed)).findall("road/objects/object[@name]")


def test_a_building_has_its_corners_and_its_height():
    house = feature(shapely.box(10.0, 20.0, 30.0, 32.0), building="yes", **{"building:levels": "3"})
    (found,) = objects(house)
    assert (found.get("type"), found.get("height")) == ("building", "9"), "three storeys of 3 m"
    s, t, turned = (float(found.get(name)) for name in ("s", "t", "hdg"))
    assert (s, t, turned) == (pytest.approx(320.0, abs=0.05), pytest.approx(26.0, abs=0.05), 0.0)
    corners = [(float(each.get("u")), float(each.get("v"))) for each in found.findall("outlines/outline/cornerLocal")]
    assert {(round(u), round(v)) for u, v in corners} == {(-10, -6), (10, -6), (10, 6), (-10, 6)}
    assert found.find("outlines/outline").get("closed") == "true"
    assert found.find("userData[@code='osmId']").get("value") == "way/1"
    assert found.find("userData[@code='height']") is None, "that of OpenStreetMap"


def test_trees_are_round_and_walls_are_open_lines():
    tree, wall = objects(
        feature(shapely.Point(-50.0, 12.0), natural="tree"),
        feature(shapely.LineString([(0.0, -15.0), (40.0, -15.0)]), barrier="wall", height="2.5 m"),
    )
    assert tree.get("type") == "tree"
    assert float(tree.get("radius")) > 0.0
    assert tree.find("userData[@code='height']").get("value") == "usual"
    assert (wall.get("type"), wall.get("height")) == ("barrier", "2.5")
    assert wall.find("outlines/outline").get("closed") == "false"
    assert math.isclose(float(wall.get("length")), 40.0, abs_tol=0.05)


def test_ids_are_whole_numbers_that_no_two_objects_share():
    trees = [feature(shapely.Point(x, 12.0), number, natural="tree") for number, x in enumerate((-50.0, 0.0, 50.0))]
    once = add_objects(write_opendrive(STREET), surrounding_objects(STREET, trees))
    twice = etree.fromstring(add_objects(once, surrounding_objects(STREET, trees)))
    ids = [int(each.get("id")) for each in twice.findall("road/objects/object")]
    assert len(ids) == len(set(ids)) == 6


@pytest.mark.parametrize(
    ("shape", "tags"),
    [
        (shapely.box(-100.0, -100.0, 100.0, 100.0), {"natural": "wood"}),
        (shapely.box(10.0, 1.0, 20.0, 9.0), {"building": "yes"}),
        (shapely.box(10.0, 300.0, 20.0, 310.0), {"building": "yes"}),
        (shapely.box(10.0, 20.0, 30.0, 32.0), {"natural": "water"}),
        (shapely.Point(500.0, 12.0), {"natural": "tree"}),
    ],
    ids=["around the road", "on a lane", "far away", "has no type", "beyond the end"],
)
def test_left_out(shape, tags):
    assert objects(feature(shape, **tags)) == []


def test_existing_objects_are_not_added_twice():
    assert objects(feature(shapely.Point(-50.0, 12.0), natural="tree"), without={"way/1"}) == []
