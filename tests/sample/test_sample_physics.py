"""The truth obeys what real vehicles obey: bodies, lanes, carriageways, speeds. Shapely judges the stored truth."""

from __future__ import annotations

import json
import math
from itertools import pairwise
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import shapely

SAMPLE = Path(__file__).resolve().parents[2] / "data" / "sample"
ROWS = [row for row in json.loads((SAMPLE / "truth.json").read_text(encoding="utf-8"))["crashes"] if row["vehicles"]]
of_crashes = pytest.mark.parametrize("row", ROWS, ids=[row["key"] for row in ROWS])


def _outline(vehicle: dict[str, Any], when: str) -> shapely.Geometry:
    """The bodies of a vehicle at its ``initial_pose`` or ``impact_pose``: its own, and its trailer's."""
    own = _box(vehicle["body"], vehicle[when])
    return own.union(_box(vehicle["trailer"], vehicle["trailer"][when])) if "trailer" in vehicle else own


def _box(body: dict[str, Any], pose: dict[str, float]) -> shapely.Polygon:
    box = shapely.box(-body["length_m"] / 2, -body["width_m"] / 2, body["length_m"] / 2, body["width_m"] / 2)
    turned = shapely.affinity.rotate(box, pose["heading_rad"], origin=(0, 0), use_radians=True)
    return shapely.affinity.translate(turned, pose["x_m"], pose["y_m"])


def _point(pose: dict[str, float]) -> tuple[float, float]:
    return pose["x_m"], pose["y_m"]


@of_crashes
def test_bodies_touch_at_the_impact_and_do_not_overlap(row: dict[str, Any]) -> None:
    one, two = (_outline(vehicle, "impact_pose") for vehicle in row["vehicles"])
    assert one.distance(two) <= 0.004  # two millimetres, and the rounding of poses to one
    assert one.intersection(two).area <= 0.01
    contact = shapely.Point(row["impact_point"]["x_m"], row["impact_point"]["y_m"])
    assert one.distance(contact) <= 0.1
    assert two.distance(contact) <= 0.1


@of_crashes
def test_bodies_are_apart_five_seconds_before(row: dict[str, Any]) -> None:
    one, two = (_outline(vehicle, "initial_pose") for vehicle in row["vehicles"])
    assert one.distance(two) > 0.5


@of_crashes
def test_the_reported_point_is_the_impact_to_a_few_decimetres(row: dict[str, Any]) -> None:
    # A hundredth of a second of arc is 0.31 m north and 0.23 m east here; half of it each way.
    assert math.hypot(*_point(row["impact_point"])) <= 0.20


@of_crashes
def test_the_way_driven_fits_speed_and_time(row: dict[str, Any]) -> None:
    for vehicle in row["vehicles"]:
        path = np.array(vehicle["path"])
        line = shapely.LineString(path)
        driven = line.project(shapely.Point(_point(vehicle["impact_pose"]))) - line.project(
            shapely.Point(_point(vehicle["initial_pose"]))
        )
        speeds = abs(vehicle["initial_speed_mps"]), abs(vehicle["impact_speed_mps"])
        assert min(speeds) * 5 - 0.5 <= driven <= max(speeds) * 5 + 0.5
        if math.isclose(*speeds):
            assert driven == pytest.approx(speeds[0] * 5, abs=0.3)


@of_crashes
def test_vehicles_point_along_their_path_and_start_in_their_lane(row: dict[str, Any]) -> None:
    for vehicle in row["vehicles"]:
        path = np.array(vehicle["path"])
        backing = vehicle["manoeuvre"] == "backing"
        for pose in (vehicle["initial_pose"], vehicle["impact_pose"]):
            steps = np.linalg.norm(path - _point(pose), axis=1)
            nearest = min(int(steps.argmin()), len(path) - 2)
            dx, dy = path[nearest + 1] - path[nearest]
            course = math.atan2(dy, dx) + (math.pi if backing else 0.0)
            # Two metres of path between its points: in the tightest turn half of that is twelve degrees.
            assert abs(math.remainder(course - pose["heading_rad"], math.tau)) < math.radians(13)
            assert shapely.LineString(path).distance(shapely.Point(_point(pose))) < 0.1
        left, right = vehicle["approach"]["room_m"]
        assert min(left, right) > vehicle["body"]["width_m"] / 2 + 0.2
        assert vehicle["body"]["width_m"] < vehicle["approach"]["lane_width_m"]


@of_crashes
def test_lateral_acceleration_stays_within_what_tyres_hold(row: dict[str, Any]) -> None:
    for vehicle in row["vehicles"]:
        path = np.array(vehicle["path"])
        speed = max(abs(vehicle["initial_speed_mps"]), abs(vehicle["impact_speed_mps"]))
        for a, b, c in zip(path, path[2:], path[4:], strict=False):
            turn = math.remainder(math.atan2(*(c - b)[::-1]) - math.atan2(*(b - a)[::-1]), math.tau)
            curvature = abs(turn) / (np.linalg.norm(c - a) / 2)
            assert speed**2 * curvature < 0.7 * 9.81, row["title"]


def test_traffic_keeps_to_the_right_unless_the_story_states_otherwise() -> None:
    """On two-way roads the initial place is right of the carriageway's middle, but for the shared centre lane."""
    checked = 0
    for row in ROWS:
        for vehicle in row["vehicles"]:
            approach = vehicle["approach"]
            left, right = approach["room_m"]
            oncoming = left + right > approach["lanes"] * approach["lane_width_m"] + 0.1
            if oncoming and approach["lane_from_left"] and vehicle["manoeuvre"] != "backing":
                assert left > right, row["title"]
                checked += 1
    assert checked > 50


def test_no_vehicle_leaves_the_carriageway_but_the_one_that_hit_a_mailbox() -> None:
    import make_sample
    from make import town

    roads = town.roads()
    asphalt = []
    for road in roads.values():
        ends = [0.0, *(min(until, road.curve.length) for until, _ in road.sections)]
        for start, end in pairwise(ends):
            left, right = road.section((start + end) / 2).edges()
            stretch = road.curve.part(start, end)
            border = [*stretch.offset(left).xy, *stretch.offset(right).xy[::-1]]
            asphalt.append(shapely.make_valid(shapely.Polygon(border)))
    # Kerbs are rounded at corners and lanes taper: an opening and closing by four metres does both.
    ground = shapely.union_all(asphalt).buffer(4.0).buffer(-4.0)
    off_road = set()
    for crash, collision, _ in make_sample.sample_crashes(roads):
        for unit in crash.units:
            driving = unit.driving()
            for t in np.linspace(collision.t - 5.0, collision.t, 26):
                state = driving.state(t)
                if ground.distance(shapely.Point(state.x_m, state.y_m)) > 0:
                    off_road.add((crash.number, unit.body.kind))
    assert off_road == {(30, "car")}


def test_bodies_never_overlap_before_the_impact() -> None:
    import make_sample
    from make import town
    from make.motion import separation_before

    for crash, collision, _ in make_sample.sample_crashes(town.roads()):
        one, two = (unit.driving() for unit in crash.units)
        gaps = separation_before(one, two, collision)
        assert min(gaps[:-1]) > 0.05, crash.title
        assert gaps[-1] <= 0.002
