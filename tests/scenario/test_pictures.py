"""Pictures of crashes: what happened is seen where it happened, and what is not known yet is left out."""

from __future__ import annotations

import io
import math
from dataclasses import replace

import numpy as np
import pytest
from PIL import Image

from tests.scenario.pixels import drawn, of_colour
from tests.simulation.motions import straight
from tests.simulation.test_objects import TREE, item
from tests.verdict.crashes import STREET, record, simulated, vehicle
from trace_dag.pages.canvas import Ink, as_png
from trace_dag.pages.map_ground import ASPHALT
from trace_dag.pages.picture_sheet import Sheet
from trace_dag.pages.pictures import draw_crash
from trace_dag.roads.report import CrashPlacement, InferredRoad, MapReport
from trace_dag.scenario.drawn_shapes import VEHICLE_COLOURS
from trace_dag.simulation.states import EstimatorRun, Hypothesis, StateEstimate
from trace_dag.simulation.types import SimulationLog

RECORD = record(vehicle(1, 12, 50, speed_mps=20.0), vehicle(2, 12, 51))
RUN = EstimatorRun("by hand", "1")
REPORT = MapReport("by hand", CrashPlacement(0.0, 0.0, 0.0, "1", 0.0, "by hand"), ())


@pytest.fixture(scope="module")
def crash() -> tuple[Hypothesis, SimulationLog]:
    """Vehicle 1 from the west and vehicle 2 from the east, head-on."""
    return simulated(straight(-62.35, -1.75, 0.0, 20.0), straight(47.35, -1.5, math.pi, 15.0))


def test_the_bodies_meet_in_the_middle_of_the_close_up(crash) -> None:
    _, log = crash
    picture = drawn(draw_crash(RECORD, STREET, REPORT, log=log))
    impact = picture.crop((picture.width // 2, 0, picture.width, picture.height))
    middle = np.array(impact.size) / 2
    metre = impact.width / 32  # about: the panel shows 32 m
    places = [np.median(of_colour(impact, colour), axis=0) for colour in VEHICLE_COLOURS[:2]]
    assert places[0][0] < middle[0] < places[1][0], "the one from the west is left of the other"
    for place in places:
        assert np.abs(place - middle).max() < 5 * metre


def test_unknown_values_are_not_drawn() -> None:
    picture = drawn(draw_crash(RECORD, STREET, REPORT))
    for colour in VEHICLE_COLOURS[:2]:
        assert not len(of_colour(picture, colour))
    assert len(of_colour(picture, ASPHALT)) > 0.05 * picture.width * picture.height


def test_files_show_the_picture() -> None:
    picture = drawn(draw_crash(RECORD, STREET, REPORT))
    stored = np.asarray(Image.open(io.BytesIO(as_png(picture))).convert("RGB"), dtype=float)
    off = np.abs(stored - np.asarray(picture, dtype=float))
    assert off.mean() < 3.0, "a palette changes colours by little"
    assert np.median(off) < 5.0


def test_the_legend_fits_below_the_picture_however_much_there_is_to_say(crash) -> None:
    hypothesis, log = crash
    struck = replace(hypothesis, objects=(item(TREE, 3.0, -6.0),))
    driveway = replace(REPORT, inferred_roads=(InferredRoad("1", "driveway"),))
    for report in (REPORT, driveway):
        estimate = StateEstimate(RECORD.key, (struck,), RUN)
        picture = np.asarray(drawn(draw_crash(RECORD, STREET, report, estimate, log)))
        edge = picture[-30:, -4:].reshape(-1, 3)
        assert (edge == edge[0]).all(), "no letter reaches the right edge"


def test_a_headline_ends_before_the_picture_does() -> None:
    sheet = Sheet()
    sheet.headline(0, " ".join(["course error of person 1 in event 1,"] * 5))  # 188 letters
    sheet.headline(1, " ".join(["criterion"] * 100))
    dark = np.asarray(drawn(sheet.svg(), 1300).convert("L")) < 128
    for rows in (dark[:22], dark[22:50]):
        assert not rows[:, -8:].any()
        assert rows[:, 900:].any(), "and the line is used"


def test_nothing_of_a_panel_is_drawn_outside_it() -> None:
    """Discs and signs that reach over the window's edge, or lie beyond it."""
    sheet = Sheet()
    for column in (0, 1):
        panel = sheet.panel(column, "", (0.0, 0.0, 100.0, 100.0))
        for place in ((0.0, 50.0), (100.0, 50.0), (50.0, 0.0), (50.0, 100.0), (-30.0, 50.0), (130.0, 50.0)):
            panel.discs([place], 6.0, Ink("red"), 10.0)
            panel.symbol("star", *place, 20.0, Ink("red"), 11.0)
    x, y = of_colour(drawn(sheet.svg(), 936), "red").T  # a pixel to a point
    assert len(x) > 100
    assert ((y >= 518 - 26 - 458) & (y <= 518 - 26)).all(), "between the headline and the legend"
    assert ((x <= 460) | (x >= 476)).all(), "not in the gap between the panels"
