"""Departures into objects that OpenStreetMap has where the vehicle left the road."""

from __future__ import annotations

import math
from dataclasses import replace

import pytest

from tests.reconstruction.test_run_off_road_planner import LEFT, PLACE, RIGHT, TREE, left_road
from tests.verdict.crashes import STREET
from trace_dag.common.geometry import LocalFrame
from trace_dag.common.settings import SimSettings, StateSettings, VerdictSettings
from trace_dag.osm.surroundings import feature_of_node
from trace_dag.reconstruction.estimate import estimate
from trace_dag.roads.build import things_near
from trace_dag.roads.report import MappedThing
from trace_dag.simulation.embedded import EmbeddedBackend
from trace_dag.simulation.objects import FixedObject, PlacedBy
from trace_dag.simulation.run import simulate
from trace_dag.verdict.judge import judge

GUARDRAIL = 24


def struck(code: int, *things: MappedThing, to: int = RIGHT) -> FixedObject:
    report = replace(PLACE, things=things)
    return estimate(left_road(code, to=to), STREET, report, StateSettings()).best.objects[0]


def sides() -> tuple[tuple[float, float], tuple[float, float]]:
    """Where our trees stand to the right and to the left of the street."""
    right, left = struck(TREE), struck(TREE, to=LEFT)
    return (right.pose.x_m, right.pose.y_m), (left.pose.x_m, left.pose.y_m)


def test_a_tree_of_the_map_is_struck_where_it_stands() -> None:
    (x_m, y_m), _ = sides()
    tree = MappedThing("node/7", "natural=tree", ((x_m + 2.0, y_m),))
    found = struck(TREE, tree)
    assert found.placed_by is PlacedBy.OPENSTREETMAP
    assert found.osm_id == "node/7"
    assert (found.pose.x_m, found.pose.y_m) == (x_m + 2.0, y_m)


def test_a_crash_into_a_tree_of_the_map_is_verified() -> None:
    (x_m, y_m), _ = sides()
    report = replace(PLACE, things=(MappedThing("node/7", "natural=tree", ((x_m + 1.0, y_m - 1.0),)),))
    crash = left_road(TREE)
    made = estimate(crash, STREET, report, StateSettings())
    logs = simulate(EmbeddedBackend(SimSettings()), STREET, b"", made, SimSettings(), record=crash)
    verdict = judge(crash, STREET, report, made, logs, VerdictSettings())
    assert verdict.accepted, verdict.detail
    assert [each.placed_by for each in logs[verdict.hypothesis].objects] == [PlacedBy.OPENSTREETMAP]


def test_objects_right_of_the_other_direction_are_met_in_that_direction() -> None:
    (x_m, y_m), (_, other_side_y_m) = sides()
    tree = MappedThing("node/7", "natural=tree", ((x_m, other_side_y_m),))
    report = replace(PLACE, things=(tree,))
    [vehicle] = estimate(left_road(TREE), STREET, report, StateSettings()).best.participants
    assert other_side_y_m * y_m < 0
    # North of a street along the x axis, who goes west has it at the right.
    assert math.cos(vehicle.impact_pose.heading_rad) * other_side_y_m < 0


def test_only_what_the_report_names_and_near_the_place_is_taken() -> None:
    (x_m, y_m), _ = sides()
    assert struck(TREE, MappedThing("node/7", "power=pole", ((x_m, y_m),))).placed_by is PlacedBy.PROGRAM
    far = MappedThing("node/8", "natural=tree", ((x_m + 6.0, y_m),))
    behind = MappedThing("node/9", "natural=tree", ((x_m - 6.0, y_m),))
    assert struck(TREE, far, behind).placed_by is PlacedBy.PROGRAM  # a verdict allows 5 m along the road


def test_a_guardrail_of_the_map_is_struck_on_its_line() -> None:
    ours = struck(GUARDRAIL)
    y_m = ours.pose.y_m + (1.0 if ours.pose.y_m > 0 else -1.0)
    rail = MappedThing("way/3", "barrier=guard_rail", ((-60.0, y_m), (60.0, y_m)))
    found = struck(GUARDRAIL, rail)
    assert found.placed_by is PlacedBy.OPENSTREETMAP
    assert found.pose.y_m == pytest.approx(y_m, abs=0.02)
    assert abs(found.pose.y_m) > abs(ours.pose.y_m)


def test_objects_near_the_crash_are_in_metres_from_it() -> None:
    frame = LocalFrame(37.0, -77.0)
    north_m = 20.0
    latitude_deg = 37.0 + north_m / 110_962.0  # a degree of the meridian at 37 degrees (WGS84)
    features = [
        feature_of_node(1, -77.0, latitude_deg, {"natural": "tree"}),
        feature_of_node(2, -77.0, 37.01, {"natural": "tree"}),
    ]
    [tree] = things_near(features, frame, PLACE.placement)
    assert (tree.osm_id, tree.tag) == ("node/1", "natural=tree")
    assert tree.xy_m[0] == pytest.approx((0.0, north_m), abs=0.05)
