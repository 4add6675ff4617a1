"""Drawings as SVG: shapes are where they are meant, cut no holes into others, and end with the window."""

from __future__ import annotations

import re
from xml.etree import ElementTree

import numpy as np
import pytest

from tests.scenario.pixels import drawn, of_colour
from trace_dag.pages.canvas import Canvas, Ink, pixels_of

WINDOW = (-10.0, -20.0, 30.0, 20.0)  # 40 m by 40 m
SQUARE = np.array([(0.0, 0.0), (10.0, 0.0), (10.0, 10.0), (0.0, 10.0)])


@pytest.fixture
def canvas() -> Canvas:
    """400 pt over 40 m: a point is 10 cm."""
    return Canvas(WINDOW, 400.0)


def corners(path: str) -> list[np.ndarray]:
    """The corners of the rings of a path of relative lines, in its units."""
    rings = re.findall(r"M(\S+) (\S+)l([^Mz]*)", path)
    return [
        np.cumsum([(float(x), float(y)), *np.array(steps.split(), float).reshape(-1, 2)], axis=0)
        for x, y, steps in rings
    ]


def paths(canvas: Canvas) -> list[ElementTree.Element]:
    return list(ElementTree.fromstring(canvas.svg()).iter("{http://www.w3.org/2000/svg}path"))


def test_shapes_are_where_they_are_in_centimetres_from_the_north_west(canvas):
    canvas.polygons([SQUARE], Ink("#112233"), 1.0)
    (path,) = paths(canvas)
    (ring,) = corners(path.get("d"))
    assert {tuple(corner) for corner in ring} == {(1000, 2000), (2000, 2000), (2000, 1000), (1000, 1000)}
    assert path.get("fill") == "#112233"


def test_rings_of_one_look_are_one_path_all_one_way_round(canvas):
    """Of rings that go round opposite ways, what both cover would be a hole."""
    canvas.polygons([SQUARE, SQUARE[::-1] + 5.0], Ink("red"), 1.0)
    (path,) = paths(canvas)
    areas = [(ring[:-1, 0] * ring[1:, 1] - ring[1:, 0] * ring[:-1, 1]).sum() for ring in corners(path.get("d"))]
    assert len(areas) == 2
    assert len({area > 0.0 for area in areas}) == 1


def test_shapes_outside_the_window_are_not_drawn(canvas):
    canvas.polygons([SQUARE + 100.0], Ink("red"), 1.0)
    canvas.polygons([SQUARE + 100.0, SQUARE], Ink("blue"), 1.0)
    assert [len(corners(path.get("d"))) for path in paths(canvas) if path.get("d")] == [1]


def test_strokes_have_their_width_in_points_and_lose_needless_points(canvas):
    line = np.column_stack([np.linspace(0.0, 20.0, 41), np.zeros(41)])
    canvas.lines([line, line[:1]], Ink(stroke="black", width_pt=2.0), 1.0)
    (path,) = paths(canvas)
    assert path.get("stroke-width") == "20"
    assert [len(each) for each in corners(path.get("d"))] == [2]


def test_shapes_that_leave_the_window_end_at_its_edge(canvas):
    canvas.polygons([SQUARE * 100.0], Ink("red"), 1.0)  # from the middle far beyond the corner
    canvas.lines([np.array([(-500.0, 0.0), (500.0, 0.0)])], Ink(stroke="black", width_pt=1.0), 2.0)
    area, line = (np.concatenate(corners(path.get("d"))) for path in paths(canvas))
    for points in (area, line):
        assert points.min() >= 0.0
        assert points.max() <= 4000.0
    assert {tuple(each) for each in line} == {(0.0, 2000.0), (4000.0, 2000.0)}


def test_a_ring_without_area_that_leaves_the_window_harms_nothing(canvas):
    there_and_back = np.array([(0.0, 0.0), (500.0, 0.0), (0.0, 0.0)])
    canvas.polygons([there_and_back, SQUARE], Ink("red"), 1.0)
    assert len(of_colour(drawn(canvas.svg(), 40), "#ff0000")) == 100


def test_higher_things_cover_lower_ones_whatever_the_order_of_drawing(canvas):
    canvas.polygons([SQUARE], Ink("#0000ff"), 2.0)
    canvas.polygons([SQUARE], Ink("#ff0000"), 1.0)
    picture = drawn(canvas.svg(), 40)
    assert len(of_colour(picture, "#0000ff")) == 100, "10 m by 10 m, a pixel each metre"
    assert not len(of_colour(picture, "#ff0000"))


def test_letters_of_other_languages_are_reduced_to_english_in_pixels_alone(canvas):
    canvas.text("Peñón <1>", 10.0, 0.0, 40.0, "black", 1.0)
    assert "Peñón &lt;1&gt;" in canvas.svg()
    plain = Canvas(WINDOW, 400.0)
    plain.text("Penon <1>", 10.0, 0.0, 40.0, "black", 1.0)
    assert np.array_equal(np.asarray(drawn(canvas.svg(), 400)), np.asarray(drawn(plain.svg(), 400)))


@pytest.mark.parametrize("text", ["ELM \x1b[31m ST", "ELM\x00ST", "\udc80 ST", "<ELM & ST>", "\ufffe"])
def test_a_text_that_cannot_be_drawn_costs_no_picture(canvas, text):
    canvas.text(text, 10.0, 0.0, 12.0, "black", 1.0)
    ElementTree.fromstring(canvas.svg())
    assert pixels_of(canvas.svg(), 40).size == (40, 40)
