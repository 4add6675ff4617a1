"""Tags as found in the wild: what they say of lanes, directions, widths, speeds."""

from __future__ import annotations

import pytest
from hypothesis import given
from hypothesis import strategies as st

from trace_dag.osm.types import OsmWay
from trace_dag.roads.from_osm.tag_values import parse_entries, parse_length_m, parse_speed_mps, parse_turns
from trace_dag.roads.from_osm.tags import WayProfile, read_profile
from trace_dag.roads.map.model import LaneType


def profile(highway: str = "secondary", **tags: str) -> WayProfile:
    """Profile of a way; ``__`` in a key stands for a colon."""
    named = {key.replace("__", ":"): value for key, value in tags.items()}
    return read_profile(OsmWay(1, (1, 2), {"highway": highway, **named}))


def lanes(made: WayProfile) -> tuple[int, int, int]:
    """Driving lanes forward, backward, and centre turn lanes."""
    section = made.section
    driving = [sum(lane.type == LaneType.DRIVING for lane in side) for side in (section.forward, section.backward)]
    centre = section.centre is not None and section.centre.type == LaneType.BIDIRECTIONAL
    return driving[0], driving[1], int(centre)


@pytest.mark.parametrize(
    ("tags", "expected"),
    [
        ({}, (1, 1, 0)),
        ({"lanes": "2"}, (1, 1, 0)),
        ({"lanes": "4"}, (2, 2, 0)),
        ({"lanes": "5"}, (2, 2, 1)),  # an odd count both ways has a centre turn lane in the US
        ({"lanes": "3", "lanes__forward": "2", "lanes__backward": "1"}, (2, 1, 0)),
        ({"lanes": "3", "lanes__forward": "2"}, (2, 1, 0)),
        ({"lanes": "5", "lanes__both_ways": "1"}, (2, 2, 1)),
        ({"lanes": "3", "turn__lanes__both_ways": "left"}, (1, 1, 1)),
        ({"lanes": "2", "lanes__forward": "1", "lanes__backward": "1", "centre_turn_lane": "yes"}, (1, 1, 1)),
        ({"lanes": "4", "lanes__forward": "2", "lanes__backward": "2", "lanes__both_ways": "1"}, (2, 2, 1)),
        ({"lanes": "2", "turn__lanes__backward": "left|through;right"}, (1, 2, 0)),  # a pocket is not counted
        ({"lanes": "6", "turn__lanes__forward": "left|", "turn__lanes__backward": "|right"}, (3, 3, 0)),  # not complete
        ({"turn__lanes__forward": "left|through|right"}, (3, 1, 0)),
        ({"lanes": "1"}, (1, 1, 0)),  # both directions need a lane to drive in
        ({"lanes": "many"}, (1, 1, 0)),
        ({"lanes": "-3"}, (1, 1, 0)),
        ({"lanes": "1000"}, (1, 1, 0)),
        ({"oneway": "yes", "lanes": "3"}, (3, 0, 0)),
        ({"oneway": "yes"}, (2, 0, 0)),
        ({"junction": "roundabout"}, (2, 0, 0)),
        ({"oneway": "yes", "turn__lanes": "left||"}, (3, 0, 0)),
        ({"oneway": "yes", "lanes": "2", "turn__lanes": "left||"}, (3, 0, 0)),  # a pocket is not counted
        ({"oneway": "yes", "lanes": "3", "vehicle__lanes": "yes|yes|no|yes"}, (3, 0, 0)),
        ({"oneway": "yes", "access__lanes": "yes|yes|no"}, (2, 0, 0)),
        ({"oneway": "yes", "bicycle__lanes": "yes|designated"}, (1, 0, 0)),
        ({"oneway": "yes", "lanes": "2", "bus__lanes": "||designated", "turn__lanes": "||"}, (2, 0, 0)),
        ({"oneway": "yes", "lanes": "3", "bus__lanes": "||designated"}, (3, 0, 0)),
        ({"oneway": "yes", "oneway__bus": "no", "lanes": "2", "lanes__backward": "1"}, (1, 1, 0)),
        ({"oneway": "yes", "oneway__psv": "no", "lanes": "3", "lanes__psv__backward": "1"}, (2, 1, 0)),
        ({"oneway": "yes", "lanes": "3", "busway__left": "opposite_lane"}, (2, 1, 0)),
        ({"oneway": "yes", "oneway__bicycle": "no", "lanes": "2", "lanes__backward": "1"}, (2, 0, 0)),
        ({"oneway": "yes", "oneway__bus": "no", "lanes": "2"}, (2, 0, 0)),
    ],
)
def test_lane_counts(tags: dict[str, str], expected: tuple[int, int, int]) -> None:
    assert lanes(profile(**tags)) == expected


def test_a_hint_fills_a_gap_and_overrules_no_tag() -> None:
    silent = OsmWay(1, (1, 2), {"highway": "primary"})
    assert lanes(read_profile(silent, lanes_hint=4, speed_hint_mps=20.0)) == (2, 2, 0)
    assert read_profile(silent, speed_hint_mps=20.0).speed_forward_mps == 20.0
    tagged = OsmWay(1, (1, 2), {"highway": "primary", "lanes": "2", "maxspeed": "25 mph"})
    read = read_profile(tagged, lanes_hint=4, speed_hint_mps=20.0)
    assert lanes(read) == (1, 1, 0)
    assert read.speed_forward_mps == pytest.approx(11.176)


@pytest.mark.parametrize(
    ("tags", "left_m", "right_m"),
    [
        ({"lanes": "2"}, 3.5, 3.5),
        ({"lanes": "3", "lanes__forward": "2"}, 5.25, 5.25),  # the geometry is the middle of the carriageway
        ({"lanes": "2", "width": "20 ft"}, 3.048, 3.048),
        ({"oneway": "yes", "lanes": "3"}, 5.25, 5.25),
        ({"oneway": "yes", "lanes": "3", "placement": "right_of:1"}, 3.5, 7.0),
        ({"oneway": "yes", "lanes": "3", "placement": "middle_of:3"}, 8.75, 1.75),
        ({"lanes": "4", "placement__forward": "left_of:1"}, 7.0, 7.0),
    ],
)
def test_the_carriageway_lies_about_the_way_as_osm_states(tags: dict[str, str], left_m: float, right_m: float) -> None:
    section = profile(**tags).section
    left = section.offset_m + sum(lane.width_m for lane in section.left)
    right = -section.offset_m + sum(lane.width_m for lane in section.forward)
    assert (left, right) == pytest.approx((left_m, right_m))


def test_turns_belong_to_lanes_from_left_to_right() -> None:
    made = profile(oneway="yes", turn__lanes="left|through|through;right")
    assert [lane.turns for lane in made.section.forward] == [("left",), ("through",), ("through", "right")]
    assert profile(oneway="yes", lanes="3", turn__lanes="left|right").section.forward[0].turns == ()


def test_lists_lose_the_entries_that_no_car_uses() -> None:
    made = profile(
        oneway="yes", lanes="3", turn__lanes="left|through|through|right", vehicle__lanes="yes|yes|no|yes"
    ).section
    assert [lane.turns for lane in made.forward] == [("left",), ("through",), ("right",)]


def test_lanes_for_cars_with_several_people_are_lanes_for_cars() -> None:
    made = profile(
        oneway="yes",
        lanes="3",
        hov__lanes="designated||",
        motor_vehicle__lanes="no||",
        turn__lanes="||merge_to_left",
    )
    assert [lane.turns for lane in made.section.forward] == [(), (), ("merge_to_left",)]
    assert made.not_followed == ()


def test_bus_lanes_are_lanes_for_buses() -> None:
    counted = profile(oneway="yes", lanes="3", bus__lanes="||designated").section.forward
    assert [lane.bus for lane in counted] == [False, False, True]
    uncounted = profile(oneway="yes", lanes="2", bus__lanes="||designated").section.forward
    assert [lane.bus for lane in uncounted] == [False, False]
    against = profile(oneway="yes", oneway__bus="no", lanes="2", lanes__backward="1").section
    assert [lane.bus for lane in (*against.forward, *against.backward)] == [False, True]


def test_parking_and_shoulders_where_tagged() -> None:
    made = profile("residential", parking__both="lane", shoulder__right="yes").section
    assert [lane.type for lane in made.forward] == [LaneType.DRIVING, LaneType.SHOULDER, LaneType.PARKING]
    assert [lane.type for lane in made.backward] == [LaneType.DRIVING, LaneType.PARKING]
    one_way = profile("residential", oneway="yes", lanes="1", parking__left="lane").section
    assert [lane.type for lane in one_way.backward] == [LaneType.PARKING]


@pytest.mark.parametrize(
    ("text", "expected"),
    [
        ("35 mph", 15.6464),
        ("60", 16.6667),
        ("60 km/h", 16.6667),
        ("signals", None),
        ("none", None),
        ("0", None),
        ("600 mph", None),
        ("", None),
        (None, None),
    ],
)
def test_speeds(text: str | None, expected: float | None) -> None:
    assert parse_speed_mps(text) == (None if expected is None else pytest.approx(expected, abs=1e-3))


@pytest.mark.parametrize(
    ("text", "expected"), [("3.5", 3.5), ("20 ft", 6.096), ("12'6\"", 3.81), ("wide", None), (None, None)]
)
def test_lengths(text: str | None, expected: float | None) -> None:
    assert parse_length_m(text) == (None if expected is None else pytest.approx(expected))


@pytest.mark.parametrize(
    ("tags", "layer"),
    [({}, 0), ({"layer": "2"}, 2), ({"layer": "ground"}, 0), ({"bridge": "yes"}, 1), ({"tunnel": "yes"}, -1)],
)
def test_layers(tags: dict[str, str], layer: int) -> None:
    assert profile(**tags).layer == layer


@given(st.dictionaries(st.sampled_from(["lanes", "width", "maxspeed", "layer", "turn:lanes", "oneway"]), st.text()))
def test_no_tag_value_breaks_it(tags: dict[str, str]) -> None:
    made = read_profile(OsmWay(1, (1, 2), {"highway": "primary", **tags}))
    assert 1 <= lanes(made)[0] <= 12
    assert all(1.0 <= lane.width_m <= 6.0 for lane in made.section.forward)


@given(st.integers(1, 6), st.integers(1, 6), st.booleans())
def test_seen_from_its_other_end_twice_is_as_before(forward: int, backward: int, centre: bool) -> None:
    made = profile(
        lanes__forward=str(forward), lanes__backward=str(backward), lanes__both_ways=str(int(centre)), maxspeed="50"
    )
    assert made.reversed().section.forward == made.section.backward
    twice = made.reversed().reversed()
    assert twice.section.offset_m == pytest.approx(made.section.offset_m)
    assert (twice.section.forward, twice.section.left) == (made.section.forward, made.section.left)


@pytest.mark.parametrize(
    ("name", "expected"),
    [
        ("Terry&apos;s Way", ("Terry's Way",)),
        ("J &amp; R Drive", ("J & R Drive",)),
        ("First Street;A &amp; B Road", ("First Street", "A & B Road")),
        ("Q & A Lane", ("Q & A Lane",)),
        ("Terry's Way", ("Terry's Way",)),
    ],
)
def test_names_that_their_source_escaped_twice_are_read_plainly(name: str, expected: tuple[str, ...]) -> None:
    made = profile(name=name)
    assert made.names == expected
    assert made.name == ";".join(expected)


def test_turn_words_are_split_by_lane() -> None:
    assert [parse_turns(entry) for entry in parse_entries("left|none|through;right|")] == [
        ("left",), (), ("through", "right"), (),
    ]  # fmt: skip
    assert parse_entries("|" * 40) == ()


@pytest.mark.parametrize(
    ("tags", "widths_m"),
    [
        # From kerb to kerb: 11.4 m with parking of 2.2 m on both sides leave 7 m to drive in.
        ({"lanes": "2", "width": "11.4", "parking__both": "lane"}, [3.5, 3.5]),
        ({"lanes": "2", "width": "10", "cycleway__both": "lane"}, [3.5, 3.5]),  # 1.5 m each
        ({"lanes": "2", "width": "11", "shoulder": "both", "shoulder__width": "2"}, [3.5, 3.5]),
        ({"lanes": "2", "width": "22'6\""}, [3.429, 3.429]),
        ({"oneway": "yes", "lanes": "2", "width__lanes": "3.0|4.2"}, [3.0, 4.2]),
        ({"oneway": "yes", "lanes": "2", "width": "8", "width__lanes": "3.0|"}, [3.0, 5.0]),
        ({"oneway": "yes", "lanes": "1", "width": "11'"}, [3.3528]),
        ({"lanes": "4", "width": "5"}, [3.5, 3.5, 3.5, 3.5]),  # too narrow for four lanes: one of the two is wrong
    ],
)
def test_widths(tags: dict[str, str], widths_m: list[float]) -> None:
    section = profile(**tags).section
    driving = [lane.width_m for lane in (*section.left, *section.forward) if lane.type.drivable]
    assert driving == pytest.approx(widths_m)


@pytest.mark.parametrize(
    "tags",
    [{"lanes": "1", "width": "3"}, {"width": "3.0"}, {"lanes": "2", "width": "3", "access": "official"}],
)
def test_service_roads_are_never_wider_than_tagged(tags: dict[str, str]) -> None:
    section = profile("service", **tags).section
    assert sum(lane.width_m for lane in (*section.left, *section.forward)) == pytest.approx(3.0)


def test_each_lane_has_its_own_limit() -> None:
    made = profile(oneway="yes", lanes="2", maxspeed__lanes="65 mph|55 mph")
    assert [lane.speed_mps for lane in made.section.forward] == pytest.approx([29.0576, 24.5872])
    assert made.speed_forward_mps == pytest.approx(29.0576)


@pytest.mark.parametrize(
    ("tags", "what"),
    [
        ({"lanes": "4", "lanes__forward": "2", "lanes__backward": "2", "lanes__both_ways": "1"}, "lanes=4"),
        ({"lanes__forward": "1", "turn__lanes__forward": "left|through"}, "turn:lanes is for 2"),
        ({"maxspeed": "45 mph;35 mph"}, "maxspeed=45 mph;35 mph"),
        ({"lanes": "4", "width": "5"}, "width=5 m"),
        ({"oneway": "yes", "lanes": "2", "placement": "right_of:5"}, "placement=right_of:5"),
        ({"oneway": "yes", "lanes": "2", "lanes__backward": "1"}, "lanes:backward"),
        ({"lanes": "many"}, "lanes=many"),
    ],
)
def test_tags_that_are_not_followed_are_reported(tags: dict[str, str], what: str) -> None:
    (sentence,) = profile(**tags).not_followed
    assert sentence.startswith(what)


@pytest.mark.parametrize(
    "tags", [{}, {"lanes": "2", "maxspeed": "35 mph"}, {"maxspeed": "signals"}, {"lanes": "5", "lanes__forward": "2"}]
)
def test_nothing_is_reported_where_nothing_contradicts(tags: dict[str, str]) -> None:
    assert profile(**tags).not_followed == ()
