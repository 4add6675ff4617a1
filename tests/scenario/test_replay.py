"""Replays: a page that stands alone and says what the log says, and animated pictures that show it."""

from __future__ import annotations

import io
import math
import re
from dataclasses import replace

import numpy as np
import pytest
from PIL import Image

from tests.scenario.replay_data import data_of
from tests.simulation.motions import straight
from tests.verdict.crashes import STREET, record, simulated, vehicle
from trace_dag.common.settings import VerdictSettings
from trace_dag.pages.animation import write_animation
from trace_dag.pages.replay import replay_page
from trace_dag.pages.replay_content import replay_content, replay_windows
from trace_dag.scenario.drawn_shapes import VEHICLE_COLOURS
from trace_dag.simulation.types import SimulationLog
from trace_dag.verdict.judge import judge_hypothesis
from trace_dag.verdict.types import Verdict

RECORD = record(vehicle(1, 12, 50, speed_mps=20.0), vehicle(2, 12, 51))


@pytest.fixture(scope="module")
def crash() -> tuple[SimulationLog, Verdict]:
    hypothesis, log = simulated(straight(-62.35, -1.75, 0.0, 20.0), straight(47.35, -1.5, math.pi, 15.0))
    return log, judge_hypothesis(RECORD, STREET, hypothesis, log, VerdictSettings())


def test_the_page_holds_the_log(crash) -> None:
    log, verdict = crash
    data = data_of(replay_page(replay_content(RECORD, STREET, log, verdict)))
    assert data["time"] == pytest.approx(log.vehicles[0].time_s, abs=1e-3)
    for shown, logged in zip(data["vehicles"], log.vehicles, strict=True):
        assert shown["x"] == pytest.approx(logged.x_m, abs=2e-3)
        assert shown["y"] == pytest.approx(logged.y_m, abs=2e-3)
        assert np.cos(shown["h"]) == pytest.approx(np.cos(logged.heading_rad), abs=1e-3)
    assert data["vehicles"][0]["reported"] == 20.0
    assert data["vehicles"][1]["reported"] is None
    assert data["contact"]["time"] == pytest.approx(log.first_contact.time_s, abs=1e-3)
    assert data["vehicles"][0]["delta_v"]["mps"] == pytest.approx(
        math.hypot(*log.first_contact.delta_v_1_mps), abs=0.01
    )


def test_the_page_needs_nothing_else(crash) -> None:
    page = replay_page(replay_content(RECORD, STREET, *crash)).decode()
    outside = re.findall(r"""(?:src|href|url\()\s*=?\s*["'(]?([^"'\s)>]+)""", page)
    assert all(url.startswith(("data:", "#")) for url in outside if ":" in url)
    assert "http" not in re.sub(r"http://www\.w3\.org/\S+", "", page)
    assert page == replay_page(replay_content(RECORD, STREET, *crash)).decode()


def test_text_of_a_report_stays_text(crash) -> None:
    evil = '</script><script src="evil.js"></script>'
    vehicles = (replace(RECORD.vehicles[0], make_model=evil), RECORD.vehicles[1])
    page = replay_page(replay_content(replace(RECORD, vehicles=vehicles, trafficway_1=evil), STREET, *crash))
    assert evil.encode() not in page
    assert data_of(page)["vehicles"][0]["make"] == evil


def test_a_crash_that_does_not_happen_can_be_watched_too() -> None:
    _, log = simulated(straight(-40.0, -1.75, 0.0, 10.0, until_s=5.0), straight(40.0, 1.75, math.pi, 10.0, until_s=5.0))
    data = data_of(replay_page(replay_content(RECORD, STREET, log)))
    assert data["contact"] is None
    west, south, east, north = replay_windows(log).overview
    for logged in log.vehicles:
        assert west < logged.x_m.min() <= logged.x_m.max() < east
        assert south < logged.y_m.min() <= logged.y_m.max() < north
    assert write_animation(RECORD, STREET, log, panel_px=80)[8:12] == b"WEBP"


def test_frames_show_the_bodies_where_the_log_has_them(crash) -> None:
    log, verdict = crash
    picture = Image.open(io.BytesIO(write_animation(RECORD, STREET, log, verdict, panel_px=200)))
    assert picture.format == "WEBP"
    shown_s = 0.0
    for frame in range(picture.n_frames):
        picture.seek(frame)
        picture.load()
        shown_s += picture.info["duration"] / 1000
    # three seconds before the impact, four after it of which (and of those before) 1.2 s at a quarter of the speed,
    # and the last frame for 1.2 s more; all of the motion if it is shorter
    began, ended = max(0.0, log.first_contact.time_s - 3.0), min(log.duration_s, log.first_contact.time_s + 4.0)
    assert shown_s == pytest.approx(ended - began + 3 * 1.2 + 1.2, abs=0.2)
    panel = np.asarray(picture.convert("RGB"), float)[-200:, -200:]  # the close-up
    west, _, east, north = replay_windows(log).impact
    for index, logged in enumerate(log.vehicles):
        colour = [int(VEHICLE_COLOURS[index][i : i + 2], 16) for i in (1, 3, 5)]
        rows, columns = np.nonzero(np.abs(panel - colour).sum(axis=2) < 60)
        x = west + columns.mean() * (east - west) / 200
        y = north - rows.mean() * (east - west) / 200
        assert math.hypot(x - logged.x_m[-1], y - logged.y_m[-1]) < 2.0
