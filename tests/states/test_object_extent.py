"""Lengthwise objects end where a street opens; others, and those struck on a roadway, stay as they are."""

from __future__ import annotations

import math
from dataclasses import replace

import pytest

from tests.sim.test_objects import CURB, TREE, item
from tests.verdict.crashes import CROSSROADS, STREET
from trace_dag.states.object_extent import clear_of_others

EDGE_M = 3.5  # of either street from its middle: two lanes of 3.5 m
BESIDE_M = EDGE_M + 0.1


def along(kerb) -> tuple[float, float]:
    return kerb.pose.x_m - kerb.length_m / 2, kerb.pose.x_m + kerb.length_m / 2


def test_a_kerb_ends_where_another_street_opens():
    kerb = replace(item(CURB, -8.0, -BESIDE_M), length_m=24.0)
    cut = clear_of_others(kerb, (-10.0, -EDGE_M), CROSSROADS)
    assert along(cut) == (pytest.approx(-20.0), pytest.approx(-EDGE_M, abs=0.51))
    assert cut.pose.y_m == pytest.approx(-BESIDE_M)


def test_nothing_else_changes():
    kerb = replace(item(CURB, -8.0, -BESIDE_M), length_m=24.0)
    assert clear_of_others(kerb, (-10.0, -EDGE_M), STREET) is kerb, "no street opens"
    tree = item(TREE, 0.0, 0.0)
    assert clear_of_others(tree, (0.0, 0.0), CROSSROADS) is tree
    island = replace(item(CURB, 0.0, 0.0, math.pi / 2), length_m=4.0)
    assert clear_of_others(island, (0.0, -1.0), CROSSROADS) is island, "struck on the roadway"


def test_of_one_rail_that_is_struck_twice_each_has_its_part():
    first = replace(item(CURB, 0.0, -BESIDE_M), length_m=40.0)
    second = replace(item(CURB, 10.0, -BESIDE_M), length_m=40.0)
    struck = [(first, (-4.0, -EDGE_M)), (second, (12.0, -EDGE_M))]
    one, two = (clear_of_others(rail, at, STREET, struck) for rail, at in struck)
    assert along(one) == (pytest.approx(-20.0), pytest.approx(4.0))
    assert along(two) == (pytest.approx(4.0), pytest.approx(30.0))
