"""What kind of intersection a place on the map is."""

from __future__ import annotations

import math

import pytest

from tests.roads.towns import Town
from trace_dag.crash.classes import RoadTopology
from trace_dag.roads.crash_site.crossings import find_crossings

Kind = RoadTopology | None


def rays(town: Town, *bearings_deg: float, **tags: str) -> None:
    """Streets from the middle outwards."""
    for bearing in bearings_deg:
        angle = math.radians(bearing)
        town.street([(0, 0), (150 * math.cos(angle), 150 * math.sin(angle))], **tags)


def divided(town: Town, *, crossing_at: float | None = 0.0, name: str = "US Highway") -> None:
    """Two carriageways west to east, 16 m apart, split where a street crosses them."""
    middle = [] if crossing_at is None else [(crossing_at, 0.0)]
    south = [(-200, -8), *((x, -8) for x, _ in middle), (200, -8)]
    north = [(200, 8), *((x, 8) for x, _ in middle), (-200, 8)]
    for line in (south, north):
        town.street(line, highway="primary", oneway="yes", name=name, lanes="2")


def kinds_near_middle(town: Town, reach_m: float = 60.0) -> set[Kind]:
    crossings = find_crossings(town.network())
    return {crossing.kind for crossing in crossings if math.hypot(*crossing.centre_xy_m) < reach_m}


@pytest.mark.parametrize(
    ("bearings", "kind"),
    [
        ((0, 90, 180, 270), RoadTopology.FOUR_WAY),
        ((20, 100, 195, 285), RoadTopology.FOUR_WAY),
        ((0, 180, 270), RoadTopology.T),
        ((10, 190, 265), RoadTopology.T),
        ((0, 120, 240), RoadTopology.Y),
        ((0, 180, 210), RoadTopology.Y),
        ((0, 72, 144, 216, 288), RoadTopology.FIVE_POINT_OR_MORE),
    ],
)
def test_plain_crossings_by_their_arms(bearings: tuple[float, ...], kind: RoadTopology) -> None:
    town = Town()
    rays(town, *bearings)
    assert kinds_near_middle(town) == {kind}


def test_a_driveway_makes_no_intersection() -> None:
    town = Town()
    rays(town, 0, 180)
    rays(town, 90, highway="service")
    assert kinds_near_middle(town) == {None}


def test_a_private_road_makes_no_intersection() -> None:
    town = Town()
    rays(town, 0, 180)
    rays(town, 90, access="private")
    assert kinds_near_middle(town) == {None}


def test_a_street_across_a_divided_road_is_one_four_way_crossing() -> None:
    town = Town()
    divided(town)
    town.street([(0, -150), (0, -8), (0, 8), (0, 150)], name="Elm Street")
    assert kinds_near_middle(town) == {RoadTopology.FOUR_WAY}


def test_a_street_that_ends_at_a_divided_road_makes_a_t() -> None:
    town = Town()
    divided(town)
    town.street([(0, -150), (0, -8), (0, 8)], name="Elm Street")
    assert kinds_near_middle(town) == {RoadTopology.T}


def test_two_divided_roads_make_one_crossing() -> None:
    town = Town()
    for a, b in (((-200, -8), (200, -8)), ((200, 8), (-200, 8))):
        inner = [(-8.0, a[1]), (8.0, a[1])] if a[0] < 0 else [(8.0, a[1]), (-8.0, a[1])]
        town.street([a, *inner, b], highway="primary", oneway="yes", name="First Avenue")
    for a, b in (((8, -200), (8, 200)), ((-8, 200), (-8, -200))):
        inner = [(a[0], -8.0), (a[0], 8.0)] if a[1] < 0 else [(a[0], 8.0), (a[0], -8.0)]
        town.street([a, *inner, b], highway="primary", oneway="yes", name="Second Avenue")
    assert kinds_near_middle(town) == {RoadTopology.FOUR_WAY}


def test_a_ramp_that_merges_is_no_intersection() -> None:
    town = Town()
    town.street([(-300, 0), (0, 0), (300, 0)], highway="motorway", oneway="yes")
    town.street([(-200, -60), (-60, -10), (0, 0)], highway="motorway_link", oneway="yes")
    assert kinds_near_middle(town) == {None}


def test_a_roundabout_is_one_crossing() -> None:
    town = Town()
    ring = [(20 * math.cos(math.radians(a)), 20 * math.sin(math.radians(a))) for a in range(0, 360, 15)]
    town.street([*ring, ring[0]], junction="roundabout", oneway="yes")
    for index in (0, 6, 12, 18):
        x, y = ring[index]
        town.street([(8 * x, 8 * y), (x, y)])
    assert kinds_near_middle(town) == {RoadTopology.ROUNDABOUT}


def test_one_street_that_crosses_another_with_an_offset_is_one_crossing() -> None:
    town = Town()
    town.street([(-150, 0), (-10, 0), (10, 0), (150, 0)], name="Main Street")
    town.street([(-10, -150), (-10, 0)], name="Elm Street")
    town.street([(10, 0), (10, 150)], name="Elm Street")
    assert kinds_near_middle(town) == {RoadTopology.FOUR_WAY}


def test_two_streets_that_end_near_each_other_are_two_crossings() -> None:
    town = Town()
    town.street([(-150, 0), (-14, 0), (14, 0), (150, 0)], name="Main Street")
    town.street([(-14, -150), (-14, 0)], name="Elm Street")
    town.street([(14, 0), (14, 150)], name="Oak Street")
    found = [c for c in find_crossings(town.network()) if c.kind is not None]
    assert [c.kind for c in found] in ([RoadTopology.T] * 2, [RoadTopology.FOUR_WAY])
    assert len(found) == 2 or set(found[0].junction_ids) == {found[0].junction_ids[0]}


def test_the_triangle_of_a_t_is_one_arm() -> None:
    town = Town()
    town.street([(-150, 0), (-25, 0), (25, 0), (150, 0)], name="Main Street")
    town.street([(-25, 0), (0, -45)], oneway="yes")
    town.street([(0, -45), (25, 0)], oneway="yes")
    town.street([(0, -45), (0, -200)], name="Elm Street")
    kinds = {c.kind for c in find_crossings(town.network())}
    assert RoadTopology.FOUR_WAY not in kinds
    assert RoadTopology.FIVE_POINT_OR_MORE not in kinds
