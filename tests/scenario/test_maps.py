"""Drawn road networks: what is painted where, read from the pixels."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest
import shapely
from lxml import etree
from numpy.typing import NDArray

from tests.roads.networks import FRAME, crossroads, one_road
from tests.roads.towns import Town
from tests.scenario.pixels import drawn, rgb
from trace_dag.pages.canvas import Canvas, length_pt
from trace_dag.pages.map_ground import ASPHALT, SURFACES, WHITE
from trace_dag.pages.map_scene import MapScene
from trace_dag.pages.maps import GROUND, MapDrawing, draw_network, draw_whole, whole_width_pt
from trace_dag.roads.map.model import Cubic, Lane, LaneSection, LaneType, PlanElement, Road, RoadMark, Signal
from trace_dag.roads.map.network import RoadNetwork

_PIXELS_PER_M = 8
_HALF_M = 50


def _picture(network: RoadNetwork, **options: bool) -> NDArray[np.uint8]:
    """The window of 100 m around the origin, one image row per 1/8 m, first row north."""
    svg = draw_network(network, (-_HALF_M, -_HALF_M, _HALF_M, _HALF_M), width_pt=576.0, **options)
    return np.asarray(drawn(svg, 2 * _HALF_M * _PIXELS_PER_M))


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
    return bool(np.allclose(colour, rgb(expected), atol=tolerance))


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
    """From the violet of the lowest to the yellow of the highest ground."""
    network = one_road((PlanElement(0, -50, 0, 0.0, 100.0),), lanes_left=0, lanes_right=1, width_m=6.0)
    hill = RoadNetwork(FRAME, (replace(network.roads[0], elevation=(Cubic(0, 0.0, 0.05),)),))
    picture = _picture(hill, heights=True, names=False)
    assert _is(_at(picture, -47, -4.5), "#440154", 0.1)
    assert _is(_at(picture, 47, -4.5), "#FDE725", 0.1)


def test_an_empty_window_is_just_ground() -> None:
    picture = np.asarray(drawn(draw_network(crossroads(), (1000.0, 1000.0, 1100.0, 1100.0), heights=True), 50))
    assert np.abs(picture / 255 - rgb(GROUND)).max() < 0.01


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


def test_the_name_of_a_street_is_whole_in_the_window_and_clear_of_what_is_taken() -> None:
    """A name as long as 41 m, on a street of which the last 34 m before the border are shown: not in their middle."""
    town = Town()
    town.street([(16, 0), (300, 0)], name="A very long name of a street")
    window = (-_HALF_M, -_HALF_M, _HALF_M, _HALF_M)
    drawing = MapDrawing(town.network(), window)
    clear, taken = Canvas(window, 200.0), Canvas(window, 200.0, [shapely.box(-20.0, -20.0, 5.0, 20.0)])
    names = []
    for canvas in (clear, taken):
        drawing.draw(canvas)
        names.append([float(text.get("x")) / 100 - _HALF_M for text in etree.fromstring(canvas.svg()).iter("{*}text")])
    half_m = length_pt("A very long name of a street", 6.5) / clear.points_per_m / 2
    assert half_m == pytest.approx(20.5, abs=1.5)
    ((x_m,), none) = names
    assert x_m + half_m < _HALF_M
    assert none == [], "there is no other place for it"


def test_no_name_and_no_board_of_a_limit_covers_a_lane() -> None:
    """A grid of streets 60 m apart: names are shorter, so that each fits between two crossings."""
    town = Town()
    for number in range(4):
        lines = [(60.0 * other, 60.0 * number) for other in range(4)]
        town.street(lines, name=f"East {number} Street")
        town.street([(east, north) for north, east in lines], name=f"North {number} Road")
    town.street([(180, 0), (300, 0)], maxspeed="25 mph")
    network = town.network()
    window = (-20.0, -20.0, 310.0, 200.0)
    lanes = shapely.union_all([shapely.Polygon(lane.outline_m) for lane in MapScene(network, window).lanes])
    texts = list(etree.fromstring(draw_network(network, window)).iter("{*}text"))
    streets = {f"East {number} Street" for number in range(4)} | {f"North {number} Road" for number in range(4)}
    assert {text.text for text in texts} == {"25", *streets}
    for text in texts:
        size_m, angle = float(text.get("font-size")) / 100, 0.0
        x_m, y_m = window[0] + float(text.get("x")) / 100, window[3] - float(text.get("y")) / 100
        if text.get("transform"):
            angle = -math.radians(float(text.get("transform").removeprefix("rotate(").split()[0]))
        half_m = length_pt(text.text, size_m) / 2
        x_m, y_m = x_m - 0.35 * size_m * math.sin(angle), y_m + 0.35 * size_m * math.cos(angle)
        ends = [(x_m + way * half_m * math.cos(angle), y_m + way * half_m * math.sin(angle)) for way in (-1, 1)]
        assert not shapely.LineString(ends).buffer(0.35 * size_m).intersects(lanes), text.text


def test_the_legend_names_what_is_drawn_and_nothing_else() -> None:
    town = Town()
    town.street([(-100, 0), (0, 0), (100, 0)], highway="secondary", cycleway="lane", sidewalk="both", name="Elm Street")
    town.sign(0, 0, highway="crossing")
    words = [text.text for text in etree.fromstring(draw_whole(town.network())).iter("{*}text")]
    assert {"Elm Street", "roadway", "sidewalk", "cycle lane", "crosswalk", "20 m"} <= set(words)
    assert not {"traffic light", "stop sign", "service road", "median"} & set(words)


def test_a_map_of_three_kilometres_is_drawn_larger_and_without_lines_wider_than_its_lanes() -> None:
    town = Town()
    town.street([(-1500, 0), (1500, 0)], lanes="2")
    network = town.network()
    assert whole_width_pt(network) == pytest.approx(3050 / 2.5, rel=0.01)  # with 25 m beside it
    assert "line between" not in draw_whole(network)
    wider = Town()
    wider.street([(-4500, 0), (4500, 0)])
    assert whole_width_pt(wider.network()) == 1540.0, "4,000 pixels, whatever the map's size"
