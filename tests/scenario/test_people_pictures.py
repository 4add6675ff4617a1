"""People and bicycles in pictures and replays: where the log has them."""

from __future__ import annotations

import io
from dataclasses import replace
from functools import cache
from pathlib import Path

import example_objects
import numpy as np
import pytest
from PIL import Image

from tests.browser import CHROMIUM, Page
from tests.roads.towns import Town
from tests.scenario.pixels import drawn, of_colour
from tests.scenario.replay_data import data_of
from tests.scenario.test_people import simulated
from tests.verdict.crashes import STREET, record, vehicle
from trace_dag.pages.animation import write_animation
from trace_dag.pages.pictures import draw_crash, vehicle_entries
from trace_dag.pages.replay import replay_page
from trace_dag.pages.replay_content import replay_content
from trace_dag.roads.map.network import RoadNetwork
from trace_dag.roads.report import CrashPlacement, MapReport
from trace_dag.scenario.drawn_shapes import VEHICLE_COLOURS, logged_shape, upright_shape
from trace_dag.simulation.body_sizes import person_body
from trace_dag.simulation.figures import LANDMARKS
from trace_dag.simulation.types import BodyKind, SimulationLog, VehicleLog

RECORD = record(vehicle(1, 12), vehicle(2, 9))
REPORT = MapReport("by hand", CrashPlacement(30.0, 30.0, 0.0, "1", 0.0, "by hand"), ())


def person(log: SimulationLog) -> VehicleLog:
    return next(each for each in log.vehicles if each.number == 1001)


@cache
def town() -> RoadNetwork:
    made = Town()
    made.street([(-100, 0), (0, 0), (100, 0)], highway="secondary", cycleway="lane", sidewalk="both")
    made.sign(0, 0, highway="crossing")
    return made.network()


def test_the_legend_has_the_speed_at_which_a_person_walks() -> None:
    """A person who waits at the edge walks at 4.3 ft/s and a fifth more: 3.5 mph."""
    hypothesis = example_objects.made_of("pedestrian_record").state_estimate.hypotheses[0]
    (label,) = [
        sign.label
        for sign in vehicle_entries(example_objects.record_of("pedestrian_record"), hypothesis)
        if sign.label.startswith("P1")
    ]
    assert label.endswith("4 mph inferred")


# --- shapes --------------------------------------------------------------------------------------------------------
@pytest.mark.parametrize("name", ["adult before a car", "cyclist crossing"])
def test_a_figure_is_drawn_where_its_landmarks_are(name: str) -> None:
    log = simulated(name)
    logged, body = person(log), log.bodies[1001]
    for k in (0, len(logged.time_s) // 2, len(logged.time_s) - 1):
        shape = logged_shape(logged, k, body)
        points = logged.landmarks_m[k].reshape(-1, 3)[:, :2] + (logged.x_m[k], logged.y_m[k])
        assert shape.head == pytest.approx(points[LANDMARKS.index("head")])
        assert shape.torso == pytest.approx(points[[LANDMARKS.index("pelvis"), LANDMARKS.index("neck")]])
        assert len(shape.ridden) == (4 if body.kind is BodyKind.CYCLIST else 0)


def test_a_thrown_body_lies() -> None:
    """Head and feet of somebody 1.7 m tall who lies are about that far apart from above; upright they are not."""
    log = simulated("adult before a car")
    logged, body = person(log), log.bodies[1001]
    feet = [
        np.hypot(*(s.limbs.reshape(-1, 2) - s.head).T).max() for s in (logged_shape(logged, k, body) for k in (0, -1))
    ]
    assert feet[0] < 0.6
    assert feet[1] > 0.9


def test_without_landmarks_somebody_stands_or_rides_along_the_heading() -> None:
    body = person_body(BodyKind.CYCLIST)
    shape = upright_shape(np.array([3.0, 4.0]), np.pi / 2, body)
    wheels = shape.ridden.reshape(-1, 2)
    assert np.ptp(wheels[:, 1]) == pytest.approx(1.73, abs=0.05)  # a bicycle is 1.75 m long
    assert np.ptp(shape.shoulders[:, 0]) == pytest.approx(0.25 * body.height_m)
    log = simulated("cyclist crossing")
    bare = replace(person(log), landmarks_m=np.zeros((len(person(log).time_s), 0)))
    assert logged_shape(bare, 0, body).head == pytest.approx([bare.x_m[0], bare.y_m[0]], abs=0.1)


# --- pictures ------------------------------------------------------------------------------------------------------
@pytest.mark.parametrize("name", ["adult before a car", "cyclist from behind", "scooter"])
def test_somebody_struck_is_in_the_middle_of_the_close_up(name: str) -> None:
    picture = drawn(draw_crash(RECORD, STREET, REPORT, log=simulated(name)))
    impact = picture.crop((picture.width // 2, 40, picture.width, picture.height - 40))
    metre = impact.width / 16  # about: the panel shows 16 m
    middle = np.array(impact.size) / 2
    near = of_colour(impact.crop((*(middle - 1.5 * metre), *(middle + 1.5 * metre))), VEHICLE_COLOURS[1])
    assert len(near) > 0.1 * metre**2  # a body from above covers some tenth of a square metre


def test_frames_of_a_moving_picture_show_the_person() -> None:
    log = simulated("cyclist crossing")
    frames = Image.open(io.BytesIO(write_animation(RECORD, STREET, log)))
    assert frames.n_frames > 20
    frames.seek(frames.n_frames // 2)
    assert len(of_colour(frames.convert("RGB"), VEHICLE_COLOURS[1])) > 20


# --- replays -------------------------------------------------------------------------------------------------------
def test_a_replay_holds_the_figure_of_every_state() -> None:
    log = simulated("cyclist crossing")
    shown = data_of(replay_page(replay_content(RECORD, STREET, log)))["vehicles"][1]
    logged = person(log)
    assert (shown["name"], shown["kind"], shown["ridden"]) == ("P1", "cyclist", 4)
    assert len(shown["lines"]) == len(logged.time_s)
    assert {len(row) for row in shown["lines"]} == {4 * len(shown["widths"])}
    assert shown["up"] == pytest.approx(logged.above_road_m, abs=0.006)


def test_contacts_after_the_first_are_marked_when_they_happen() -> None:
    log = simulated("adult before a car")
    again = replace(log.contacts[0], time_s=log.contacts[0].time_s + 0.5, number_1=2, x_m=9.0)
    data = data_of(replay_page(replay_content(RECORD, STREET, replace(log, contacts=(*log.contacts, again)))))
    assert data["contact"]["time"] == pytest.approx(log.contacts[0].time_s, abs=1e-3)
    assert [(each["x"], each["time"]) for each in data["later"]] == [(9.0, pytest.approx(again.time_s, abs=1e-3))]


@pytest.mark.skipif(CHROMIUM is None, reason="no Chromium on this computer")
def test_in_a_browser_the_head_is_where_the_log_has_it(tmp_path: Path) -> None:
    log = simulated("cyclist crossing")
    logged = person(log)
    (tmp_path / "replay.html").write_bytes(replay_page(replay_content(RECORD, STREET, log)))
    with Page(tmp_path / "profile") as page:
        page.open((tmp_path / "replay.html").as_uri())
        for k in (0, len(logged.time_s) // 2, len(logged.time_s) - 1):
            place = page.run(
                f"line.show({float(logged.time_s[k])}); ['cx', 'cy'].map("
                "name => Number(document.querySelector('#bodies > circle').getAttribute(name)))"
            )
            expected = logged_shape(logged, k, log.bodies[1001]).head
            assert place == pytest.approx([expected[0], -expected[1]], abs=0.02)
        assert page.run("document.querySelector('#rings text').textContent") == "P1"
        assert page.errors == []
