"""Areas of lanes: put together piece by piece, they are what the surfaces of all lanes are together."""

from __future__ import annotations

import math

import numpy as np
import pytest
import shapely

from tests.roads.networks import WIDTH_M, crossroads, one_road
from trace_dag.roads.map.lane_index import polygon, unite_areas
from trace_dag.roads.map.model import PlanElement
from trace_dag.roads.map.network import RoadNetwork


def street() -> RoadNetwork:
    """600 m toward east, a lane of 3.5 m each way."""
    plan = (PlanElement(0.0, -300.0, 0.0, 0.0, 600.0),)
    return one_road(plan, lanes_left=1, lanes_right=1, width_m=3.5)


def test_the_area_of_a_crossing_has_no_holes_between_lanes() -> None:
    network = crossroads()
    area = network.drivable_area
    whole = area.within((-150.0, -150.0, 150.0, 150.0), 0.0)
    assert len(whole.geoms) == 1
    for ref in network.drivable_lanes():
        pose = network.pose(ref, sum(network.lane_span(ref)) / 2)
        assert area.has(pose.x_m, pose.y_m)
    assert not area.has(30.0, 30.0)


@pytest.mark.parametrize(
    ("x_m", "y_m", "beyond_m"),
    [
        (0.0, 0.0, -3.5),  # between the lanes
        (64.0, 3.0, -0.5),  # where two pieces meet
        (10.0, 10.0, 6.5),
        (-200.0, -203.5, 200.0),  # farther than any piece reaches
        (330.0, 43.5, 50.0),  # beyond the street's end: 30 and 40 m away
    ],
)
def test_distance_of_a_point_beyond_the_edge(x_m: float, y_m: float, beyond_m: float) -> None:
    area = street().drivable_area
    assert area.beyond_m(np.array([x_m]), np.array([y_m])) == pytest.approx([beyond_m])
    assert area.has(x_m, y_m) == (beyond_m < 0)
    if beyond_m > 0:
        assert math.dist(area.nearest(x_m, y_m), (x_m, y_m)) == pytest.approx(beyond_m)


def test_many_points_are_answered_as_the_surfaces_of_all_lanes_answer() -> None:
    network = crossroads()
    whole = unite_areas(polygon(network.geometry(ref)) for ref in network.drivable_lanes())
    x, y = (each.ravel() for each in np.meshgrid(np.arange(-120.25, 120.0, 3.0), np.arange(-30.25, 30.0, 3.0)))
    assert (network.drivable_area.contains(x, y) == shapely.contains_xy(whole, x, y)).all()
    assert [network.drivable_area.has(*xy) for xy in zip(x, y, strict=True)] == shapely.contains_xy(
        whole, x, y
    ).tolist()


@pytest.mark.parametrize(("x_m", "y_m"), [(5.0, 9.0), (31.9, -9.0), (-40.0, 14.0), (64.0, 5.0)])
def test_near_a_place_the_edge_is_that_of_all_lanes(x_m: float, y_m: float) -> None:
    network = crossroads()
    whole = unite_areas(polygon(network.geometry(ref)) for ref in network.drivable_lanes())
    near = shapely.Point(x_m, y_m).buffer(11.9)
    edges = [shapely.intersection(edge, near) for edge in (whole.boundary, network.drivable_area.edge_near(x_m, y_m))]
    assert edges[0].length > 1.0
    assert shapely.hausdorff_distance(*edges) == pytest.approx(0.0, abs=1e-6)


@pytest.mark.parametrize(
    "outlines",
    [
        [[(0.15, 0.95), (0.9, 0.55), (0.4, 0.45), (2.8, 0.75), (1.5, 0.2)]],  # GEOS closes it to one that is not valid
        [
            [(0.15, 0.8), (0.2, 0.2), (1.6, 0.6), (1.5, 0.85)],  # and leaves half of these out
            [(0.75, 0.2), (1.75, 0.25), (2.3, 0.2), (2.6, 0.1)],
            [(1.4, 0.3), (2.4, 0.35), (2.7, 0.5), (1.95, 1.0)],
        ],
    ],
)
def test_borders_that_cross_at_sharp_angles_lose_nothing(outlines: list[list[tuple[float, float]]]) -> None:
    surfaces = [shapely.Polygon(outline) for outline in outlines]
    together = unite_areas(surfaces)
    assert together.is_valid
    assert together.area >= shapely.union_all(shapely.make_valid(surfaces)).area


def test_surfaces_that_geos_cannot_unite_exactly_are_united_on_a_grid(monkeypatch: pytest.MonkeyPatch) -> None:
    union_all = shapely.union_all

    def refusing(areas: object, grid_size: float | None = None) -> object:
        if grid_size is None:
            raise shapely.errors.GEOSException("TopologyException: Ring edge missing at 0 0")
        return union_all(areas, grid_size=grid_size)

    monkeypatch.setattr(shapely, "union_all", refusing)
    assert unite_areas([shapely.box(0.0, 0.0, 5.0, 3.5), shapely.box(0.0, 3.5, 5.0, 7.0)]).area == pytest.approx(35.0)


def test_no_lane_at_the_level_of_a_place_is_an_empty_area() -> None:
    network = street()
    assert not network.carriageway_near(0.0, 0.0, 50.0, z_m=0.0).is_empty
    above = network.carriageway_near(0.0, 0.0, 50.0, z_m=8.0)
    assert above.is_empty
    assert not above.has(0.0, WIDTH_M / 2)
    assert np.isnan(above.beyond_m(np.zeros(1), np.zeros(1))).all()
