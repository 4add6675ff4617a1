"""Elements that OpenDRIVE has for what the map knows, in a file that lxml alone reads."""

from __future__ import annotations

from itertools import product

from lxml import etree
from roads.towns import Town

from trace_dag.roads.map.rules import find_violations
from trace_dag.scenario.opendrive_surroundings import PlacedObject, add_objects, new_object


def _tee() -> Town:
    """A street from the south that ends at a greater one."""
    town = Town()
    town.street([(-150, 0), (0, 0)], name="West", highway="secondary")
    town.street([(0, 0), (150, 0)], name="East", highway="secondary")
    town.street([(0, -150), (0, -12), (0, 0)], name="South")
    return town


def test_bridges_and_tunnels_are_objects_along_their_roads() -> None:
    town = Town()
    town.street([(-150, 0), (-50, 0)], name="River")
    town.street([(-50, 0), (50, 0)], name="River", bridge="yes", layer="1")
    town.street([(50, 0), (150, 0)], name="River")
    town.street([(0, -200), (0, 200)], name="Low", tunnel="yes", layer="-1")
    root = town.xodr()
    for tag, length_m in (("bridge", 100.0), ("tunnel", 400.0)):
        (element,) = root.findall(f"road/objects/{tag}")
        road = element.getparent().getparent()
        assert element.get("length") == road.get("length")
        assert abs(float(element.get("length")) - length_m) < 0.5


def test_traffic_that_gives_way_has_no_priority() -> None:
    town = _tee()
    town.sign(0, -12, highway="give_way")
    root = town.xodr()
    roads = {road.get("id"): road for road in root.iter("road")}
    origins = {
        road_id: roads[road.find("link/predecessor").get("elementId")].get("name")
        for road_id, road in roads.items()
        if road.get("junction") != "-1"
    }
    low = {road_id for road_id, name in origins.items() if name == "South"}
    pairs = {(each.get("high"), each.get("low")) for each in root.findall("junction/priority")}
    assert len(low) == 2
    assert pairs == set(product(set(origins) - low, low))


def test_connecting_roads_of_a_junction_with_lights_refer_to_them() -> None:
    town = _tee()
    town.sign(0, 0, highway="traffic_signals")
    root = town.xodr()
    light_of = {road.get("id"): road.find("signals/signal").get("id") for road in root.findall("road[@junction='-1']")}
    connecting = [road for road in root.iter("road") if road.get("junction") != "-1"]
    assert len(connecting) == 6
    for road in connecting:
        (reference,) = road.findall("signals/signalReference")
        assert reference.get("id") == light_of[road.find("link/predecessor").get("elementId")]
        assert reference.find("validity").attrib == {"fromLane": "-1", "toLane": "-1"}
    assert not root.findall("junction/priority")


def test_a_limit_that_nobody_tagged_is_marked_as_assumed() -> None:
    town = Town()
    town.street([(-150, 0), (0, 0)], name="Tagged", maxspeed="30 mph")
    town.street([(0, 100), (100, 100)], name="Untagged")
    roads = {road.get("name"): road for road in town.xodr().iter("road")}
    assert roads["Tagged"].find("type/speed").attrib == {"max": "30", "unit": "mph"}
    assert roads["Tagged"].find("userData[@code='assumedSpeedMph']") is None
    assert roads["Untagged"].find("type/speed") is None
    assert roads["Untagged"].find("userData[@code='assumedSpeedMph']").get("value") == "25"  # residential


def test_no_piece_of_a_road_is_shorter_than_ten_centimetres() -> None:
    town = Town()
    town.street([(-100, 0), (0, 0), (0.06, 0.01), (40, 25), (40.05, 25.06), (120, 20)], name="Jagged")
    town.street([(40, -60), (40, 25), (40, 90)], name="Cross")
    lengths = [float(piece.get("length")) for piece in town.xodr().iter("geometry")]
    assert min(lengths) >= 0.1 - 1e-3


def test_things_of_a_scenario_come_before_bridges_and_have_numbers_of_their_own() -> None:
    town = Town()
    town.street([(-150, 0), (0, 0), (150, 0)], name="River", bridge="yes")
    town.sign(0, 0, **{"highway": "crossing", "crossing:island": "yes"})
    placed = PlacedObject("0", new_object("pole", "mast", (12.0, -4.5, 0.0), {"height": 8.0, "radius": 0.1}))
    xodr = add_objects(town.made().stored.xodr, [placed])
    assert find_violations(xodr) == []
    objects = etree.fromstring(xodr).find("road/objects")
    assert [each.tag for each in objects] == ["object", "object", "object", "bridge"]
    assert sorted(int(each.get("id")) for each in objects.findall("object")) == [0, 1, 2]
