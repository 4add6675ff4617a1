"""The picture and the page of a crash whose map is what failed: the point, the streets around, and how far they are."""

from __future__ import annotations

import numpy as np
import pytest
from lxml import etree

from tests.roads.towns import SETTINGS, Town, report
from tests.scenario.page_rows import crash
from tests.scenario.pixels import drawn, rgb
from tests.scenario.test_crash_page import RIGHTS, seen, shown
from trace_dag.pages.crash_page import CrashPage
from trace_dag.pages.map_ground import ASPHALT
from trace_dag.pages.picture_sheet import Sheet, square
from trace_dag.pages.pictures import draw_rejected_map
from trace_dag.roads.build import RejectedRoadMap, build_road_map

RECORD = report(at_m=(0, 20), street="OAK ST")


@pytest.fixture(scope="module")
def two_streets() -> tuple[Town, RejectedRoadMap]:
    """Elm Street 20 m south of the reported point, Oak Street, which the report names, 40 m north of it."""
    town = Town()
    town.street([(-200, 0), (200, 0)], name="Elm Street")
    town.street([(-200, 60), (200, 60)], name="Oak Street")
    with pytest.raises(RejectedRoadMap) as caught:
        build_road_map(town.extract(), RECORD, SETTINGS)
    return town, caught.value


def test_the_picture_shows_streets_on_both_sides_of_the_point(two_streets) -> None:
    town, rejected = two_streets
    svg = draw_rejected_map(RECORD, rejected.network, town.extract(), rejected.report, rejected.detail)
    picture = drawn(svg)
    of_asphalt = np.abs(np.asarray(picture, float) / 255 - rgb(ASPHALT)).max(axis=2) < 0.05
    rows = np.flatnonzero(of_asphalt[:, picture.width // 20]) - picture.height / 2  # downward, west of the point
    elm, oak = rows[rows > 0], rows[rows < 0]
    assert 0 < elm.mean() < -oak.mean(), "Elm Street is south of the point and nearer than Oak Street north of it"


def test_two_streets_that_are_nearest_at_one_place_are_written_apart() -> None:
    """Letters of 7.5 points; 458 points show 200 m, and an SVG has 100 units to the metre."""
    sheet = Sheet()
    panel = sheet.panel(0, "Streets around", square((0.0, 0.0), 100.0))
    for name in ("Elm Street", "Oak Street"):
        sheet.write_at(panel, (10.0, 10.0), name)
    written = {text.text: float(text.get("y")) for text in etree.fromstring(sheet.svg()).iter("{*}text")}
    assert abs(written["Elm Street"] - written["Oak Street"]) > 7.5 * 200 / 458 * 100


def test_the_page_states_which_streets_are_around_and_which_is_reported(two_streets) -> None:
    _, rejected = two_streets
    row = crash(1, final_state="rejected", reason=str(rejected.reason), detail=rejected.detail)
    page = shown(CrashPage(row, [], RIGHTS, record=RECORD, rejected_map=rejected.report, picture="../pictures/x.png"))
    assert "Why the map is rejected" in seen(page)
    assert "The report names OAK ST" in seen(page)
    [table] = page.xpath("//*[@aria-label='Streets around the reported point']//tbody")
    rows = [[seen(cell) for cell in row] for row in table.iter("tr")]
    assert [(name, said) for name, _, _, said in rows] == [
        ("Elm Street", "another name"),
        ("Oak Street", "the reported name"),
    ]
    assert [float(distance) for _, _, distance, _ in rows] == pytest.approx([16.65, 36.65], abs=0.15)
