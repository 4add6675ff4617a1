"""Access, turn restrictions, lanes and names of OpenStreetMap on the map, whose file lxml alone reads."""

from __future__ import annotations

from collections import Counter
from datetime import datetime
from pathlib import Path

import osmium
import pytest
from lxml import etree
from roads.towns import Town

from trace_dag.osm.road_classes import is_drivable
from trace_dag.osm.types import OsmRelation
from trace_dag.reading.road_map import make_map
from trace_dag.roads.from_osm.way_direction import restrictions_at


def _crossing() -> tuple[Town, int, int]:
    """A crossing of four streets; the ways from the west and to the north."""
    town = Town()
    west = town.street([(-150, 0), (0, 0)], name="West Street")
    town.street([(0, 0), (150, 0)], name="East Street")
    town.street([(0, -150), (0, 0)], name="South Street")
    return town, west, town.street([(0, 0), (0, 150)], name="North Street")


def _movements(root: etree._Element) -> Counter[tuple[str, str]]:
    """Return the streets that movements through junctions lead from and to."""
    names = {road.get("id"): road.get("name") for road in root.iter("road") if road.get("junction") == "-1"}
    ends = [
        (road.find("link/predecessor").get("elementId"), road.find("link/successor").get("elementId"))
        for road in root.iter("road")
        if road.get("junction") != "-1"
    ]
    return Counter((names[before], names[after]) for before, after in ends)


@pytest.mark.parametrize(
    ("tags", "forbidden"),
    [
        ({"restriction": "no_left_turn"}, True),
        ({"restriction__motorcar": "no_left_turn"}, True),
        ({"restriction__motor_vehicle": "no_left_turn"}, True),
        ({"restriction__hgv": "no_left_turn"}, False),
        ({"restriction": "no_left_turn", "except": "psv;motorcar"}, False),
        ({"restriction": "no_left_turn_on_red"}, False),
        ({"restriction": "no_turn_on_red"}, False),
        ({"restriction__conditional": "no_left_turn @ (Mo-Fr 07:00-09:00)"}, False),
        ({"restriction": "no_left_turn", "hour_on": "07:00", "hour_off": "09:00"}, False),
    ],
)
def test_a_restriction_forbids_what_it_is_for(tags: dict[str, str], forbidden: bool) -> None:
    town, west, north = _crossing()
    town.restriction(west, (0, 0), north, **tags)
    movements = _movements(town.xodr())
    assert movements["West Street", "North Street"] == (0 if forbidden else 1)
    assert movements.total() == (11 if forbidden else 12)


@pytest.mark.parametrize(
    "tags",
    [
        {"restriction:conditional": "no_left_turn @ (Mo-Fr 07:00-09:00)"},
        {"restriction": "no_left_turn", "day_on": "Monday", "day_off": "Friday", "hour_on": "7:00", "hour_off": "9:00"},
    ],
)
def test_restrictions_hold_at_their_hours(tags: dict[str, str]) -> None:
    relation = OsmRelation(1, (), tags)
    friday, saturday = datetime(2023, 5, 5, 8), datetime(2023, 5, 6, 8)
    assert [each.tags for each in restrictions_at([relation], friday)] == [{"restriction": "no_left_turn"}]
    assert restrictions_at([relation], saturday) == ()
    assert restrictions_at([relation], friday.replace(hour=21)) == ()


def test_an_unknown_restriction_forbids_nothing_and_is_reported() -> None:
    town, west, north = _crossing()
    town.restriction(west, (0, 0), north, restriction="no_parking")
    made = town.made()
    assert _movements(etree.fromstring(made.stored.xodr)).total() == 12
    assert [(each.way_id, "no_parking" in each.what) for each in made.tags_not_followed] == [(west, True)]


@pytest.mark.parametrize(
    ("tags", "drivable"),
    [
        ({"access": "no", "hov": "designated"}, True),
        ({"motor_vehicle": "no", "hov": "designated", "bus": "yes"}, True),
        ({"access": "no", "hov": "no"}, False),
        ({"access": "no"}, False),
    ],
)
def test_car_pools_open_a_carriageway(tags: dict[str, str], drivable: bool) -> None:
    assert is_drivable({"highway": "motorway", **tags}, service_roads=False) is drivable


def _lanes(root: etree._Element) -> list[tuple[str, str, bool]]:
    """Return id, arrows, and whether for buses alone, of the traffic lanes of the first road, from left to right."""
    road = root.find("road")
    return [
        (
            lane.get("id"),
            "".join(lane.xpath("userData[@code='turns']/@value")),
            lane.find("access[@restriction='bus'][@rule='allow']") is not None,
        )
        for lane in road.findall("lanes/laneSection[1]/*/lane")
        if lane.get("type") in ("driving", "bidirectional")
    ]


@pytest.mark.parametrize(
    ("tags", "buses"),
    [
        ({"oneway": "yes", "lanes": "3", "lanes__bus": "1"}, {"-3"}),
        ({"oneway": "yes", "lanes": "3", "lanes__psv": "1"}, {"-3"}),
        ({"oneway": "yes", "lanes": "3", "busway__right": "lane"}, {"-3"}),
        ({"oneway": "yes", "lanes": "3", "busway__left": "lane"}, {"-1"}),
        ({"oneway": "yes", "lanes": "3", "busway": "lane"}, {"-3"}),
        ({"lanes": "4", "lanes__psv": "2"}, {"-2", "2"}),
        ({"lanes": "4", "busway__both": "lane"}, {"-2", "2"}),
        ({"lanes": "4", "busway__right": "lane"}, {"-2"}),
    ],
)
def test_counted_bus_lanes_are_at_the_kerb(tags: dict[str, str], buses: set[str]) -> None:
    town = Town()
    town.street([(-150, 0), (150, 0)], highway="primary", **tags)
    lanes = _lanes(town.xodr())
    assert len(lanes) == int(tags["lanes"])
    assert {number for number, _, bus in lanes if bus} == buses


@pytest.mark.parametrize(
    "tags",
    [
        {"lanes": "5", "lanes__forward": "2", "lanes__backward": "2", "lanes__reversible": "1"},
        {"lanes": "5", "lanes__reversible": "1"},
        {"lanes": "5", "lanes__both_ways": "1", "turn__lanes__both_ways": "reversible"},
        {"lanes": "5", "lanes__both_ways": "1", "overtaking__lanes__both_ways": "yes"},
    ],
)
def test_a_reversible_middle_lane_is_no_turn_lane_and_is_reported(tags: dict[str, str]) -> None:
    town = Town()
    town.street([(-150, 0), (150, 0)], highway="primary", **tags)
    made = town.made()
    root = etree.fromstring(made.stored.xodr)
    assert len(_lanes(root)) == 5
    assert not root.findall(".//lane[@type='bidirectional']")
    assert any("which way unknown" in each.what for each in made.tags_not_followed)


def test_nothing_beside_an_arrow_is_straight_on() -> None:
    town = Town()
    tags = {"highway": "motorway", "oneway": "yes"}
    town.street(
        [(-300, 0), (0, 0)], name="Freeway", lanes="3", turn__lanes="none|none;slight_right|slight_right", **tags
    )
    town.street([(0, 0), (300, 0)], name="Freeway", lanes="2", **tags)
    town.street([(0, 0), (100, -15), (250, -60)], name="Exit", highway="motorway_link", oneway="yes", lanes="2")
    root = town.xodr()
    lane_links = {
        (road.get("name"), lane.get("id")): lane.find("link/predecessor").get("id")
        for road in root.iter("road")
        if road.get("junction") != "-1"
        for lane in road.iter("lane")
        if lane.find("link/predecessor") is not None
    }
    assert _lanes(root)[1][1] == "through;slight_right"
    through = [value for (name, _), value in lane_links.items() if name == "Freeway"]
    assert sorted(through) == ["-1", "-2"]  # the option lane feeds the second lane of the freeway


def test_the_arrow_of_a_single_lane_binds() -> None:
    town = Town()
    town.street([(-150, 0), (0, 0)], name="West Street", turn__forward="right")
    town.street([(0, 0), (150, 0)], name="East Street")
    town.street([(0, -150), (0, 0)], name="South Street")
    town.street([(0, 0), (0, 150)], name="North Street")
    root = town.xodr()
    assert _lanes(root) == [("1", "", False), ("-1", "right", False)]
    assert [to for origin, to in _movements(root) if origin == "West Street"] == ["South Street"]


def test_a_street_on_a_border_has_both_names() -> None:
    town = Town()
    town.street([(-150, 0), (150, 0)], name__left="State Line Road", name__right="Border Avenue", ref="US 6")
    road = town.xodr().find("road")
    assert road.xpath("userData[@code='altName']/@value") == ["State Line Road", "Border Avenue", "US 6"]


def test_positions_in_the_ways_of_a_pbf_are_read(tmp_path: Path) -> None:
    plain, path = tmp_path / "town.osm", tmp_path / "town.osm.pbf"
    nodes = "".join(f'<node id="{k}" version="1" lat="37.0" lon="{-77.0 + k / 1000}"/>' for k in (1, 2))
    tags = '<tag k="highway" v="primary"/><tag k="name" v="Main Street"/>'
    way = f'<way id="7" version="1"><nd ref="1"/><nd ref="2"/>{tags}</way>'
    plain.write_text(f'<osm version="0.6">{nodes}{way}</osm>')
    with osmium.SimpleWriter(osmium.io.File(str(path), "pbf,locations_on_ways=true")) as writer:
        for each in osmium.FileProcessor(str(plain)).with_locations():
            if each.is_way():  # its nodes have no tags, and are left out
                writer.add(each)
    made = make_map([path], at=(37.0, -76.9985), radius_m=200.0, box=None, left_hand=False)
    assert [road.get("name") for road in etree.fromstring(made.xodr).iter("road")] == ["Main Street"]
