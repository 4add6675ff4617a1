"""Every way that is tagged drivable is a road, a movement through a junction, or named in the report."""

from __future__ import annotations

import pytest
from lxml import etree
from roads.towns import Town


def _ways(root: etree._Element) -> set[int]:
    """Return the ways that roads and movements of a file name."""
    noted = root.xpath("road/userData[@code='osmWays']/@value")
    return {int(number) for value in noted for number in value.split()}


def _divided_road(apart_m: float, lanes: str = "3") -> tuple[Town, int]:
    """A divided road along x whose eastbound carriageway lies south, and a one-way link across the median."""
    town, half_m = Town(), apart_m / 2
    tags = {"highway": "primary", "name": "Big Road", "oneway": "yes", "lanes": lanes}
    town.street([(-250, -half_m), (0, -half_m), (250, -half_m)], **tags)
    town.street([(250, half_m), (0, half_m), (-250, half_m)], **tags)
    return town, town.street([(0, -half_m), (0, half_m)], highway="primary_link", oneway="yes")


@pytest.mark.parametrize("apart_m", [18.0, 26.0, 40.0])
def test_a_median_crossover_can_be_driven(apart_m: float) -> None:
    town, crossover = _divided_road(apart_m)
    root = town.xodr()
    assert crossover in _ways(root)
    ahead = {road.get("id"): {link.get("elementId") for link in road.find("link")} for road in root.iter("road")}
    for junction in root.iter("junction"):
        for each in junction.iter("connection"):
            ahead[each.get("incomingRoad")].add(each.get("connectingRoad"))
    starts = {
        road.get("id"): tuple(float(road.find("planView/geometry").get(key)) for key in "xy")
        for road in root.iter("road")
        if road.get("junction") == "-1"
    }
    (eastbound,) = [road_id for road_id, (x, y) in starts.items() if x < -240 and y < 0]
    (westbound,) = [road_id for road_id, (x, y) in starts.items() if -40 < x < 0 < y]
    reached, waiting = set(), [eastbound]
    while waiting:
        road_id = waiting.pop()
        if road_id in ahead and road_id not in reached:
            reached.add(road_id)
            waiting += ahead[road_id]
    assert westbound in reached


def test_a_crossover_too_narrow_to_turn_in_is_named_in_the_report() -> None:
    town, crossover = _divided_road(4.0, lanes="1")  # a car's circle is 7.4 m wide
    made = town.made()
    gate = next(gate for gate in made.gates if gate.name == "ways_without_road")
    assert crossover not in _ways(etree.fromstring(made.stored.xodr))
    assert gate.way_ids == (crossover,)
    assert "through which no movement leads along it" in gate.detail


def test_a_way_drawn_twice_is_one_road_and_named_in_the_report() -> None:
    town = Town()
    first = town.street([(-100, 0), (0, 0), (100, 0)], name="Main Street")
    twice = town.street([(-100, 0), (0, 0)], name="Main Street")
    made = town.made()
    assert _ways(etree.fromstring(made.stored.xodr)) == {first}
    gate = next(gate for gate in made.gates if gate.name == "ways_without_road")
    assert (gate.value, gate.way_ids) == (1, (twice,))
    assert f"way {twice} lies on way {first}" in gate.detail


def test_movements_of_a_joined_crossing_name_the_ways_inside() -> None:
    town = Town()
    for points in ([(-200, -8), (0, -8), (200, -8)], [(200, 8), (0, 8), (-200, 8)]):
        town.street(points, highway="primary", name="Big Road", oneway="yes", lanes="2")
    town.street([(0, -200), (0, -8)], name="Cross Street")
    first = town.street([(0, -8), (0, 0)], name="Cross Street")  # the piece between the carriageways in two ways
    second = town.street([(0, 0), (0, 8)], name="Cross Street")
    town.street([(0, 8), (0, 200)], name="Cross Street")
    assert {first, second} <= _ways(town.xodr())
