"""Signals, barriers, islands, tracks and turning circles of OpenStreetMap's nodes, in a file that lxml alone reads."""

from __future__ import annotations

import math
from collections import Counter

import pytest
from lxml import etree
from roads.towns import FRAME, SETTINGS, Town

from trace_dag.roads.build import build_plain_map


def _crossing(**streets: str) -> Town:
    """A crossing of four streets of 150 m at the origin."""
    town = Town()
    for name, end in (("West", (-150, 0)), ("East", (150, 0)), ("South", (0, -150)), ("North", (0, 150))):
        town.street([end, (0, 0)], name=name, highway=streets.get(name, "residential"))
    return town


def _signals(root: etree._Element) -> Counter[tuple[str, str]]:
    """Return street and type of the signals of a file, speed limits left out."""
    return Counter(
        (road.get("name"), signal.get("type"))
        for road in root.iter("road")
        for signal in road.iter("signal")
        if signal.get("type") != "274"
    )


def _all_arms(kind: str) -> dict[tuple[str, str], int]:
    return {(name, kind): 1 for name in ("West", "East", "South", "North")}


@pytest.mark.parametrize(
    ("tags", "kind"),
    [
        ({"highway": "mini_roundabout"}, "205"),
        ({"highway": "traffic_signals"}, "1000001"),
        ({"highway": "traffic_signals", "traffic_signals": "stop"}, "206"),
        ({"highway": "traffic_signals", "traffic_signals": "blinker"}, "-1"),
        ({"highway": "stop", "stop": "all"}, "206"),
    ],
)
def test_a_node_on_a_crossing_is_for_every_arm(tags: dict[str, str], kind: str) -> None:
    town = _crossing()
    town.sign(0, 0, **tags)
    root = town.xodr()
    assert _signals(root) == _all_arms(kind)
    controlled = root.findall("controller")  # lights that go through phases have one, nothing else
    assert bool(controlled) == (kind == "1000001")


def test_stop_minor_is_for_the_minor_arms_alone() -> None:
    town = _crossing(West="secondary", East="secondary")
    town.sign(0, 0, highway="stop", stop="minor")
    assert _signals(town.xodr()) == {("South", "206"): 1, ("North", "206"): 1}


def test_traffic_gives_way_to_a_roundabout() -> None:
    town = Town()
    ring = [(20 * math.cos(math.tau * k / 12), 20 * math.sin(math.tau * k / 12)) for k in range(12)]
    town.street([*ring, ring[0]], junction="roundabout", name="Circle")
    for name, k in (("East", 0), ("North", 3), ("West", 6)):
        x, y = ring[k]
        town.street([(8 * x, 8 * y), ring[k]], name=name)
    town.street([ring[9], (0, -160)], name="South", oneway="yes")  # nobody enters by it
    assert _signals(town.xodr()) == {("East", "205"): 1, ("North", "205"): 1, ("West", "205"): 1}


@pytest.mark.parametrize(
    ("key", "value", "orientation"),
    [("direction", "forward", "+"), ("direction", "backward", "-"), ("stop__direction", "backward", "-")],
)
def test_the_tagged_direction_is_that_of_the_way(key: str, value: str, orientation: str) -> None:
    town = Town()
    town.street([(-150, 0), (0, 0), (150, 0)], name="First")
    town.street([(-150, 90), (0, 90), (150, 90)], name="Second")
    town.street([(0, 0), (0, 40), (0, 90)], name="Link")
    town.sign(0, 40, **{"highway": "stop", key.replace("__", ":"): value})
    (signal,) = town.xodr().findall(".//signal[@type='206']")
    assert signal.get("orientation") == orientation


def test_the_direction_of_a_way_against_its_traffic_is_that_of_the_way_as_drawn() -> None:
    town = Town()
    town.street([(-150, 0), (0, 0), (150, 0)], name="First")
    town.street([(-150, 90), (0, 90), (150, 90)], name="Second")
    link = {"oneway": "-1", "oneway:bus": "no", "lanes": "2", "lanes:forward": "1", "lanes:backward": "1"}
    town.street([(0, 0), (0, 75), (0, 90)], name="Link", **link)
    town.sign(0, 75, **{"highway": "traffic_signals", "traffic_signals:direction": "forward"})
    (signal,) = town.xodr().findall(".//signal[@type='1000001']")
    road = signal.getparent().getparent()
    assert float(road.find("planView/geometry").get("y")) > 50  # the road goes south, along its traffic
    assert signal.get("orientation") == "-"  # and the light is for the buses that go north, to Second


def test_lights_at_a_crossing_for_people_stop_the_road_if_no_other_light_is_near() -> None:
    town = Town()
    town.street([(-300, 0), (0, 0), (300, 0)], name="Main", lanes="4")
    town.sign(0, 0, highway="crossing", crossing="traffic_signals")
    root = town.xodr()
    lights = root.findall(".//signal[@type='1000001']")
    assert sorted(each.get("orientation") for each in lights) == ["+", "-"]
    assert {control.get("signalId") for control in root.iter("control")} == {each.get("id") for each in lights}
    (crosswalk,) = root.findall(".//object[@type='crosswalk']")
    assert crosswalk.find("userData[@code='signals']").get("value") == "true"


def test_lights_at_a_crossing_for_people_beside_a_light_are_no_more_lights() -> None:
    town = Town()
    town.street([(-300, 0), (0, 0), (20, 0), (300, 0)], name="Main")
    town.street([(20, -100), (20, 0), (20, 100)], name="Cross")
    town.sign(0, 0, highway="crossing", crossing="traffic_signals")
    town.sign(20, 0, highway="traffic_signals")
    assert _signals(town.xodr()) == {("Main", "1000001"): 2, ("Cross", "1000001"): 2}


def test_a_level_crossing_has_signs_lights_and_a_track() -> None:
    town = Town()
    town.street([(-150, 0), (0, 0), (150, 0)], name="Depot")
    town.sign(0, 0, **{"railway": "level_crossing", "crossing:light": "yes"})
    root = town.xodr()
    signals = [(each.get("name"), each.get("orientation")) for each in root.iter("signal")]
    assert sorted(signals) == [(name, side) for name in ("RailroadCrossing", "RailroadLights") for side in "+-"]
    (track,) = root.findall(".//object[@name='railway track']")
    assert float(track.get("s")) == pytest.approx(150, abs=0.1)
    assert float(track.get("width")) == pytest.approx(6.7, abs=0.5)  # across both lanes


@pytest.mark.parametrize(
    ("tags", "blocked"),
    [
        ({"barrier": "bollard"}, True),
        ({"barrier": "gate", "access": "no"}, True),
        ({"barrier": "gate"}, False),
        ({"barrier": "gate", "access": "private"}, False),
        ({"barrier": "bollard", "motor_vehicle": "yes"}, False),
        ({"barrier": "cattle_grid"}, False),
    ],
)
@pytest.mark.parametrize("ways", [1, 2])
def test_a_barrier_ends_a_road_for_cars(tags: dict[str, str], blocked: bool, ways: int) -> None:
    town = Town()
    points = [(-150, 0), (0, 0), (150, 0)]
    for part in [points] if ways == 1 else [points[:2], points[1:]]:
        town.street(part, name="Alley")
    town.sign(0, 0, **tags)
    roads = town.xodr().findall("road")
    assert [float(road.get("length")) for road in roads] == pytest.approx([150, 150] if blocked else [300], abs=0.1)
    assert all(road.find("link/*") is None for road in roads)


def test_an_island_is_on_the_middle_of_its_crossing() -> None:
    town = Town()
    town.street([(-150, 0), (0, 0), (150, 0)], name="School")
    town.sign(0, 0, **{"highway": "crossing", "crossing": "marked", "crossing:island": "yes"})
    (island,) = town.xodr().findall(".//object[@type='trafficIsland']")
    left = [float(corner.get("v")) for corner in island.iter("cornerLocal")]
    assert (min(left), max(left)) == (-0.9, 0.9)
    assert float(island.get("s")) == pytest.approx(150, abs=0.1)


@pytest.mark.parametrize(
    ("tags", "radius_m"),
    [
        # The middle of a lane of 3.35 m is half of it inside the edge of the circle.
        ({"highway": "turning_circle", "diameter": "18"}, 9 - 3.35 / 2),
        ({"highway": "turning_loop"}, 12 - 3.35 / 2),
    ],
)
def test_cars_turn_round_at_the_end_of_a_cul_de_sac(tags: dict[str, str], radius_m: float) -> None:
    town = Town()
    town.street([(-150, 0), (0, 0), (150, 0)], name="Main")
    town.street([(0, 0), (0, 90)], name="Aspen Court")
    town.sign(0, 90, **tags)
    root = town.xodr()
    (court,) = [road for road in root.iter("road") if road.get("name") == "Aspen Court"]
    (turn,) = [
        road
        for road in root.iter("road")
        if {link.get("elementId") for link in road.findall("link/*")} == {court.get("id")}
    ]
    curvatures = {round(abs(float(arc.get("curvature"))), 9) for arc in turn.iter("arc")}
    assert curvatures == {round(1 / radius_m, 9)}
    (connection,) = root.findall(f".//connection[@connectingRoad='{turn.get('id')}']")
    assert connection.get("incomingRoad") == court.get("id")
    assert [link.attrib for link in connection] == [{"from": "-1", "to": "-1"}]
    assert bool(root.findall(".//object[@name='turning circle']")) == (tags["highway"] == "turning_circle")


def test_roads_that_cross_without_a_node_are_reported() -> None:
    town = Town()
    town.street([(-200, 0), (200, 0)], name="Main")
    town.street([(0, -200), (0, 200)], name="Elm")
    gate = next(gate for gate in town.made().gates if gate.name == "clearance")
    assert gate.detail == "roads 0 and 1 cross at one level without a junction in OSM, at (0, 0)"


def _island_m(parked: str, *, left_hand: bool) -> list[float]:
    """Return the corners of an island on a one-way street with cars parked on one side, metres left of the road."""
    town = Town()
    tags = {"oneway": "yes", "lanes": "3", f"parking__{parked}": "lane"}
    town.street([(-150, 0), (0, 0), (150, 0)], name="School", **tags)
    town.sign(0, 0, **{"highway": "crossing", "crossing:island": "yes"})
    made = build_plain_map(town.extract(), FRAME, SETTINGS, name="town", left_hand=left_hand)
    (island,) = etree.fromstring(made.stored.xodr).findall(".//object[@type='trafficIsland']")
    return sorted(float(corner.get("v")) for corner in island.iter("cornerLocal"))


def test_an_island_is_mirrored_with_its_street() -> None:
    right = _island_m("left", left_hand=False)
    mirrored = [-each for each in right[::-1]]
    assert right != pytest.approx(mirrored)  # the parked cars move the middle of the carriageway
    assert _island_m("right", left_hand=True) == pytest.approx(mirrored)
