"""Evidence of who came from where: greater and lesser roads, stop signs, driveways, names of streets."""

from __future__ import annotations

from types import SimpleNamespace

import pytest

from trace_dag.states.evidence import CrossingVehicle, crossing_terms, driveway_speed_terms, street_terms

STOP_SIGN, SIGNAL = 20, 3


def crossing(highway: str, speed_mps: float, control: int | None = None) -> CrossingVehicle:
    approach = SimpleNamespace(road=SimpleNamespace(highway=highway))
    return CrossingVehicle(SimpleNamespace(traffic_control_code=control), approach, speed_mps)


def test_whoever_crosses_a_greater_road_is_not_the_faster_one():
    slow_off_highway = crossing_terms(crossing("trunk", 25.0), crossing("residential", 8.0))
    slow_on_highway = crossing_terms(crossing("residential", 25.0), crossing("trunk", 8.0))
    assert slow_off_highway == {}
    assert sum(slow_on_highway.values()) < 0
    assert crossing_terms(crossing("residential", 25.0), crossing("residential", 8.0)) == {}


def test_the_stop_sign_stands_on_the_lesser_road():
    assert crossing_terms(crossing("primary", 15.0), crossing("service", 15.0, STOP_SIGN)) == {}
    assert sum(crossing_terms(crossing("primary", 15.0, STOP_SIGN), crossing("service", 15.0)).values()) < 0
    # Where all stop, or a signal tells, the signs say nothing.
    all_way = crossing("primary", 15.0, STOP_SIGN), crossing("service", 15.0, STOP_SIGN)
    assert crossing_terms(*all_way) == crossing_terms(crossing("primary", 15.0, SIGNAL), all_way[1]) == {}


@pytest.mark.parametrize("order", [1, -1])
def test_the_order_of_the_two_does_not_matter(order):
    pair = (crossing("trunk", 8.0, STOP_SIGN), crossing("residential", 25.0))[::order]
    assert set(crossing_terms(*pair)) == {"faster on the lesser road", "stop sign on the greater road alone"}


def test_nobody_comes_out_of_a_driveway_at_the_speed_of_a_road():
    driveway, road = (SimpleNamespace(road=SimpleNamespace(inferred=why)) for why in ("vehicle 1 came out", ""))
    assert driveway_speed_terms(driveway, 5.0) == driveway_speed_terms(road, 30.0) == {}
    fast, faster = (sum(driveway_speed_terms(driveway, speed_mps).values()) for speed_mps in (12.0, 20.0))
    assert faster < fast < 0


def test_a_street_of_the_name_the_report_gives_is_the_other_street_whatever_the_placement_found():
    network = SimpleNamespace(road_by_id={})
    placement = SimpleNamespace(road_id="1", cross_road_ids=("2",), junction_id="j")
    record = SimpleNamespace(trafficway_2="DESERT SHORES DR")
    link = SimpleNamespace(element_type="junction", element_id="j")

    def terms(*names: str) -> dict[str, float]:
        road = SimpleNamespace(id="3", names=names, predecessor=link, successor=None, inferred="")
        return street_terms(network, placement, record, SimpleNamespace(road=road))

    assert terms("Desert Shores Drive") == {}
    assert sum(terms("Ocean Drive").values()) < 0
    assert sum(terms().values()) < 0
