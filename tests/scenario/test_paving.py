"""What is paved between the lanes of a junction."""

from __future__ import annotations

import numpy as np
import pytest
import shapely

from trace_dag.common.geometry import FloatArray
from trace_dag.pages.map_ground import find_paved_gaps

_WIDTH_M = 3.5


def _lane(west: float, south: float, east: float, north: float) -> FloatArray:
    return np.array([(west, south), (east, south), (east, north), (west, north)], dtype=float)


def _crossing(gap_m: float) -> list[FloatArray]:
    """Two lanes from west to east and two from south to north, ``gap_m`` between the two of a kind; 30 m long."""
    low, high = -gap_m / 2 - _WIDTH_M, gap_m / 2
    return [
        *(_lane(-15, y, 15, y + _WIDTH_M) for y in (low, high)),
        *(_lane(x, -15, x + _WIDTH_M, 15) for x in (low, high)),
    ]


def test_a_spot_narrower_than_a_lane_is_paved_to_its_edges() -> None:
    gaps = list(find_paved_gaps(_crossing(2.0), [range(4)]))
    middle = [gap for gap in gaps if shapely.Polygon(gap.outline_m).contains(shapely.Point(0, 0))]
    assert len(middle) == 1
    assert set(middle[0].lanes) == {0, 1, 2, 3}
    assert shapely.union_all([shapely.Polygon(gap.outline_m) for gap in gaps]).covers(shapely.box(-1, -1, 1, 1))


def test_an_island_wider_than_a_lane_is_not() -> None:
    gaps = list(find_paved_gaps(_crossing(6.0), [range(4)]))
    assert gaps
    for gap in gaps:
        assert not shapely.Polygon(gap.outline_m).intersects(shapely.Point(0, 0).buffer(2.0))


def test_the_corners_between_the_arms_stay_ground() -> None:
    gaps = list(find_paved_gaps(_crossing(2.0), [range(4)]))
    assert gaps
    for gap in gaps:
        assert not shapely.Polygon(gap.outline_m).intersects(shapely.box(8, 8, 12, 12))


def test_ground_outside_the_junctions_is_not_paved() -> None:
    assert list(find_paved_gaps(_crossing(2.0), [])) == []


def test_a_turn_lane_that_ends_before_a_junction_is_paved_up_to_it() -> None:
    """The lanes beside a centre lane go on through the junction; a crossing lane lies 3 m beyond the end of it."""
    beside = [_lane(0, y, 20, y + _WIDTH_M) for y in (-1.75 - _WIDTH_M, 1.75)]
    crossing, centre = _lane(17, -10, 20, 10), _lane(-20, -1.75, 14, 1.75)
    (gap,) = (gap for gap in find_paved_gaps([*beside, crossing, centre], [range(3)]) if 3 in gap.lanes)
    assert shapely.Polygon(gap.outline_m).area == pytest.approx(3.0 * 3.5, rel=0.01)
