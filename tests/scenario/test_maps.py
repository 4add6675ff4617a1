"""Drawn road networks: what is painted where, read from the pixels."""

from __future__ import annotations

import io
import math
from dataclasses import replace

import numpy as np
import pytest
from matplotlib.axes import Axes
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.colors import to_rgb
from matplotlib.figure import Figure
from matplotlib.image import imread
from numpy.typing import NDArray

from tests.roads.networks import FRAME, crossroads, one_road
from tests.roads.towns import Town
from trace_dag.geometry import LocalFrame
from trace_dag.roads.map.model import Cubic, Lane, LaneSection, LaneType, PlanElement, Road, RoadMark, Signal
from trace_dag.roads.map.network import RoadNetwork
from trace_dag.scenario import maps
from trace_dag.scenario.map_marks import WHITE
from trace_dag.scenario.map_scene import MapScene, Window
from trace_dag.scenario.map_surfaces import ASPHALT, SURFACES

_PIXELS_PER_M = 8
_HALF_M = 50


def _picture(network: RoadNetwork, **options: bool) -> NDArray[np.uint8]:
    """The window of 100 m around the origin, one image row per 1/8 m, first row north."""
    figure = Figure(figsize=(8, 8), dpi=100)
    canvas = FigureCanvasAgg(figure)
    axes = figure.add_axes((0, 0, 1, 1))
    axes.axis("off")
    maps.draw_network(axes, network, window_m=(-_HALF_M, -_HALF_M, _HALF_M, _HALF_M), **options)
    figure.patch.set_facecolor("white")
    canvas.draw()
    return np.asarray(canvas.buffer_rgba())[:, :, :3]


def test_the_outline_of_a_straight_lane_has_its_corners_alone():
    network = one_road((PlanElement(0, 0, 0, 0, 60.0),), lanes_left=0, lanes_right=1, width_m=3.5)
    (lane,) = MapScene(network, (-10.0, -10.0, 70.0, 10.0)).lanes
    assert {tuple(corner) for corner in lane.outline_m.round(6).tolist()} == {(0, 0), (60, 0), (60, -3.5), (0, -3.5)}


def test_the_outline_of_a_lane_in_a_bend_has_a_point_every_two_metres():
    network = one_road((PlanElement(0, 0, 0, 0, 60.0, curvature_1pm=1 / 50),), lanes_left=0, lanes_right=1, width_m=3.5)
    (lane,) = MapScene(network, (-80.0, -80.0, 80.0, 80.0)).lanes
    assert len(lane.outline_m) == 2 * 31, "a chord of 2 m is 1 cm from an arc of 50 m"


def _at(picture: NDArray[np.uint8], x_m: float, y_m: float) -> tuple[float, ...]:
    row, column = round((_HALF_M - y_m) * _PIXELS_PER_M), round((x_m + _HALF_M) * _PIXELS_PER_M)
    return tuple(float(value) / 255 for value in picture[row, column])


def _is(colour: tuple[float, ...], expected: str, tolerance: float = 0.05) -> bool:
    return bool(np.allclose(colour, to_rgb(expected), atol=tolerance))


def test_asphalt_lies_where_the_lanes_are() -> None:
    picture = _picture(crossroads(), names=False)
    for x, y in ((-30, -1.7), (-30, 1.7), (1.7, 30), (-1.7, -30), (0, 0)):
        assert _is(_at(picture, x, y), ASPHALT, 0.2), (x, y)  # arrows may lie there
    for x, y in ((-30, 6), (-30, -6), (30, 30)):
        assert not _is(_at(picture, x, y), ASPHALT, 0.2), (x, y)


def test_the_centre_line_is_yellow_and_its_gaps_are_where_it_is_broken() -> None:
    def marked(mark: RoadMark, legal: RoadMark | None) -> RoadNetwork:
        network = one_road((PlanElement(0, -50, 0, 0.0, 100.0),), lanes_left=1, lanes_right=1, width_m=3.5)
        section = network.roads[0].lane_sections[0]
        centre = Lane(0, LaneType.NONE, (), mark=mark, legal_mark=legal)
        return RoadNetwork(
            FRAME, (replace(network.roads[0], lane_sections=(LaneSection(0, (*section.lanes, centre)),)),)
        )

    def yellow_share(network: RoadNetwork, **options: bool) -> float:
        picture = _picture(network, names=False, **options)
        rows = picture[_HALF_M * _PIXELS_PER_M - 4 : _HALF_M * _PIXELS_PER_M + 4].astype(int)
        return float(np.mean((rows[:, :, 0] - rows[:, :, 2] > 60).any(axis=0)))

    broken, solid = RoadMark("broken", "yellow"), RoadMark("solid solid", "yellow", "none")
    assert yellow_share(marked(solid, None)) > 0.98
    assert yellow_share(marked(broken, None)) == pytest.approx(10 / 40, abs=0.06)  # 10 ft of every 40 ft
    assert yellow_share(marked(broken, solid)) > 0.98
    assert yellow_share(marked(broken, solid), legal_marks=False) < 0.4


def test_a_bridge_covers_what_passes_under_it() -> None:
    lanes = (LaneSection(0, (Lane(-1, LaneType.DRIVING, (Cubic(0, 8.0),)),)),)
    under = Road(
        "1",
        100,
        (PlanElement(0, -50, 4, 0, 100),),
        (LaneSection(0, (replace(lanes[0].lanes[0], type=LaneType.MEDIAN),)),),
    )
    over = Road("2", 100, (PlanElement(0, -4, -50, math.pi / 2, 100),), lanes, layer=1, bridge=True)
    picture = _picture(RoadNetwork(FRAME, (over, under)), names=False)
    assert _is(_at(picture, 2.5, 2.5), ASPHALT, 0.25)
    assert _is(_at(picture, 30, 2.5), SURFACES[LaneType.MEDIAN], 0.05)


def test_signs_stand_beside_the_road_on_their_side() -> None:
    network = one_road((PlanElement(0, -50, 0, 0.0, 100.0),), lanes_left=1, lanes_right=1, width_m=3.5)
    stop = Signal("1", 70.0, -6.0, "206")
    signed = RoadNetwork(FRAME, (replace(network.roads[0], signals=(stop,)),))
    picture = _picture(signed, names=False)
    # A symbol of some 8 points, which are 11 pixels of these.
    assert all(
        _is(_at(picture, 20 + east, -6 + north), "#C1272D", 0.1) for east in (-0.4, 0, 0.4) for north in (0, 0.3)
    )
    assert not _is(_at(picture, 21, -6), "#C1272D", 0.1)
    assert not _is(_at(_picture(network, names=False), 20, -6), "#C1272D", 0.1)


def test_heights_colour_the_surface() -> None:
    plan = (PlanElement(0, -50, 0, 0.0, 100.0),)
    network = one_road(plan, lanes_left=0, lanes_right=1, width_m=6.0)
    hill = RoadNetwork(FRAME, (replace(network.roads[0], elevation=(Cubic(0, 0.0, 0.05),)),))
    figure = Figure(figsize=(4, 4))
    FigureCanvasAgg(figure)
    maps.draw_network(figure.subplots(), hill, window_m=(-50, -50, 50, 50), heights=True)
    assert len(figure.axes) == 2  # the map and its colour bar
    assert figure.axes[1].get_ylim() == pytest.approx((0.0, 5.0), abs=0.2)


def test_maps_with_other_origins_show_the_same_ground(monkeypatch: pytest.MonkeyPatch) -> None:
    """The second map's origin lies 20 m east of the first's: its window reaches 20 m further west."""
    windows = []
    drawn = maps.draw_network

    def spy(axes: Axes, network: RoadNetwork, *, window_m: Window) -> None:
        windows.append(window_m)
        drawn(axes, network, window_m=window_m)

    monkeypatch.setattr(maps, "draw_network", spy)
    latitude, longitude = FRAME.to_geographic(np.array([20.0, 0.0]))
    there = replace(crossroads(), frame=LocalFrame(float(latitude), float(longitude)))
    png = maps.draw_side_by_side([("a", crossroads()), ("b", there)], window_m=(-50, -40, 50, 40), dpi=40)
    assert windows[0] == pytest.approx((-50, -40, 50, 40), abs=1e-3)
    assert windows[1] == pytest.approx((-70, -40, 30, 40), abs=1e-3)
    assert imread(io.BytesIO(png)).std() > 0.05


def test_an_empty_window_is_just_ground() -> None:
    figure = Figure(figsize=(2, 2))
    FigureCanvasAgg(figure)
    axes = figure.subplots()
    maps.draw_network(axes, crossroads(), window_m=(1000, 1000, 1100, 1100), heights=True)
    assert axes.get_xlim() == (1000, 1100)
    assert len(figure.axes) == 1


def test_crosswalks_are_barred_and_cycle_lanes_coloured() -> None:
    """Two lanes of 3.5 m and two cycle lanes of 1.5 m: eight bars and gaps of 1.25 m from edge to edge, 10 m."""
    town = Town()
    town.street([(-100, 0), (0, 0), (100, 0)], highway="secondary", cycleway="lane", sidewalk="both")
    town.sign(0, 0, highway="crossing")
    picture = _picture(town.network())
    assert _is(_at(picture, 0.0, -1.875), WHITE)
    assert _is(_at(picture, 0.0, -2.5), ASPHALT)
    assert _is(_at(picture, 20.0, -1.875), ASPHALT)
    for side in (-1, 1):
        assert _is(_at(picture, 20.0, side * 4.25), SURFACES[LaneType.BIKING])
        assert _is(_at(picture, 20.0, side * 5.75), SURFACES[LaneType.SIDEWALK])
