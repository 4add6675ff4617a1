"""Maps as SVG: where shapes are, and that nothing cuts a hole into what it lies on."""

from __future__ import annotations

import re
from xml.etree import ElementTree

import numpy as np
import pytest
from matplotlib.collections import LineCollection, PolyCollection
from matplotlib.patches import Circle

from trace_dag.scenario.map_svg import SvgPanel

WINDOW = (-10.0, -20.0, 30.0, 20.0)  # 40 m by 40 m
SQUARE = np.array([(0.0, 0.0), (10.0, 0.0), (10.0, 10.0), (0.0, 10.0)])


def corners(path: str) -> list[np.ndarray]:
    """The corners of the rings of a path of relative lines, in its units."""
    rings = re.findall(r"M(\S+) (\S+)l([^Mz]*)", path)
    return [
        np.cumsum([(float(x), float(y)), *np.array(steps.split(), float).reshape(-1, 2)], axis=0)
        for x, y, steps in rings
    ]


def paths(panel: SvgPanel) -> list[ElementTree.Element]:
    return list(ElementTree.fromstring(panel.written()).iter("{http://www.w3.org/2000/svg}path"))


def test_shapes_are_where_they_are_in_centimetres_from_the_north_west():
    panel = SvgPanel.of(WINDOW, 400.0)
    panel.add(PolyCollection([SQUARE], facecolors="#112233", edgecolors="none"))
    (path,) = paths(panel)
    (ring,) = corners(path.get("d"))
    assert {tuple(corner) for corner in ring} == {
        (1000.0, 2000.0),
        (2000.0, 2000.0),
        (2000.0, 1000.0),
        (1000.0, 1000.0),
    }
    assert path.get("fill") == "#112233"


def test_neighbours_of_one_look_are_one_path_all_one_way_round():
    """Of rings that go round opposite ways, what both cover would be a hole."""
    panel = SvgPanel.of(WINDOW, 400.0)
    panel.add(PolyCollection([SQUARE, SQUARE[::-1] + 5.0, SQUARE - 5.0], facecolors=["red", "red", "blue"]))
    first, second = paths(panel)
    rings = [*corners(first.get("d")), *corners(second.get("d"))]
    areas = [(ring[:-1, 0] * ring[1:, 1] - ring[1:, 0] * ring[:-1, 1]).sum() for ring in rings]
    assert len(areas) == 3
    assert len({area > 0.0 for area in areas}) == 1


def test_strokes_have_their_width_in_points_and_lose_needless_points():
    """400 pt over 40 m: a point is 10 cm."""
    panel = SvgPanel.of(WINDOW, 400.0)
    line = np.column_stack([np.linspace(0.0, 20.0, 41), np.zeros(41)])
    panel.add(LineCollection([line, line[:1]], colors="black", linewidths=2.0))
    (path,) = paths(panel)
    assert path.get("stroke-width") == "20"
    assert [len(each) for each in corners(path.get("d"))] == [2]


def test_what_a_map_has_not_is_not_left_out_silently():
    panel = SvgPanel.of(WINDOW, 400.0)
    panel.add(Circle((0.0, 0.0)))
    with pytest.raises(TypeError, match="Circle"):
        panel.written()
