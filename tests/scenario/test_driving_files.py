"""A package's lanes and courses as data say what its map and its motion say, and Python reads the same."""

from __future__ import annotations

import json
import zipfile

import numpy as np
import pytest
import sample_runs
import shapely

import trace_dag
from trace_dag.scenario.driving_files import lane_id
from trace_dag.scenario.polylines import worth_keeping

KEY = "2023-319003"


@pytest.fixture(scope="module")
def crash():
    return trace_dag.open(sample_runs.finished() / "benchmark" / "packages" / f"{KEY}.zip").only


@pytest.fixture(scope="module")
def documents():
    with zipfile.ZipFile(sample_runs.finished() / "benchmark" / "packages" / f"{KEY}.zip") as package:
        return {name: json.loads(package.read(f"{KEY}/{name}")) for name in ("lanes.json", "courses.json")}


def test_lanes_lie_where_the_map_has_them_and_lead_into_each_other(documents, crash):
    lanes = {lane["id"]: lane for lane in documents["lanes.json"]["lanes"]}
    of_the_map = crash.lanes
    drivable = [ref for ref in of_the_map.index if crash.road_map.is_drivable(ref)]
    assert sorted(lanes) == sorted(map(lane_id, drivable))
    for ref in drivable:
        lane = lanes[lane_id(ref)]
        surface = of_the_map.loc[[ref], "surface"].iloc[0]
        drawn = shapely.Polygon([*lane["left_m"], *lane["right_m"][::-1]])
        assert len(lane["left_m"]) == len(lane["right_m"]) == len(lane["z_m"])
        assert drawn.symmetric_difference(surface).area < 0.1 * of_the_map.loc[[ref], "length_m"].iloc[0]
        for after in lane["successors"]:
            assert np.hypot(*np.subtract(lanes[after]["left_m"][0], lane["left_m"][-1])) < 0.6
        for side, other in (("left", "right"), ("right", "left")):
            if lane[side] is not None:
                beside = lanes[lane[side]["id"]]
                back = beside[other if lane[side]["same_way"] else side]
                assert back is not None
                assert back["id"] == lane["id"]


def test_courses_are_the_motion_up_to_the_contact_and_go_on_without_it(documents, crash):
    contact_s = crash.log.first_contact.time_s
    step_s = documents["courses.json"]["step_s"]
    for vehicle in crash.log.vehicles:
        course = documents["courses.json"]["parties"][str(vehicle.number)]["course"]
        times = np.arange(len(course["x_m"])) * step_s
        before = times < contact_s
        away = np.hypot(
            np.interp(times, vehicle.time_s, vehicle.x_m) - course["x_m"],
            np.interp(times, vehicle.time_s, vehicle.y_m) - course["y_m"],
        )
        assert away[before].max() < 0.5, "what a driver plans and what the wheels do"
        assert times[-1] == pytest.approx(contact_s + 5.0, abs=0.2)
        assert course["speed_mps"][-1] > 1.0, "nobody is stopped by the crash"


def test_routes_follow_lanes_that_lead_into_each_other_to_a_goal_on_the_road(documents, crash):
    lanes = {lane["id"]: lane for lane in documents["lanes.json"]["lanes"]}
    for party in documents["courses.json"]["parties"].values():
        for lane, after in zip(party["route"], party["route"][1:], strict=False):
            assert after in lanes[lane]["successors"]
        goal = party["goal"]
        assert crash.road_map.nearest_lanes(goal["x_m"], goal["y_m"], 0.0)
        assert goal["from_s"] < goal["to_s"]


def test_python_reads_the_same_courses_and_routes(documents, crash):
    parties = documents["courses.json"]["parties"]
    assert {str(number) for number in crash.courses["number"]} == {str(number) for number in crash.routes.index}
    assert parties.keys() == {str(number) for number in crash.routes.index}
    for number, rows in crash.courses.groupby("number"):
        for name, values in parties[str(number)]["course"].items():
            np.testing.assert_allclose(rows[name], values, atol=0.006)
    for number, row in crash.routes.iterrows():
        assert [lane_id(ref) for ref in row["lanes"]] == parties[str(number)]["route"]
        assert (
            row["goal"].centroid.distance(
                shapely.Point(parties[str(number)]["goal"]["x_m"], parties[str(number)]["goal"]["y_m"])
            )
            < 0.02
        )
        assert row["goal"].area == pytest.approx(80.0)


def test_only_points_that_bend_one_of_the_lines_are_kept():
    along = np.arange(11.0)
    straight = np.column_stack([along, np.zeros(11)])
    bent = np.column_stack([along, np.where(along > 5, along - 5, 0.0)])
    assert worth_keeping([[straight], [bent]], 0.01) == [[0, 10], [0, 5, 10]]
    assert worth_keeping([[straight, bent]], 0.01) == [[0, 5, 10]]
