"""Traffic lights that change together, and roads that return to the junction they begin at."""

from __future__ import annotations

import math

import pytest
from lxml import etree

from tests.roads.towns import Town
from trace_dag.roads.gates.measures import find_stranded_lanes, link_gaps, one_sided_links
from trace_dag.roads.map.network import RoadNetwork
from trace_dag.roads.map.reader import read_opendrive
from trace_dag.roads.map.rules import find_violations
from trace_dag.roads.map.writer import write_opendrive


def phases(network: RoadNetwork) -> list[set[str]]:
    """Streets whose lights change together, by controller."""
    street = {signal.id: road.name for road in network.roads for signal in road.signals}
    return [{street[signal_id] for signal_id in controller.signal_ids} for controller in network.controllers]


def _lights(*bearings_deg: float) -> Town:
    """A crossing with lights on its node and an arm at each bearing, named by it."""
    town = Town()
    for bearing_deg in bearings_deg:
        x, y = math.cos(math.radians(bearing_deg)), math.sin(math.radians(bearing_deg))
        town.street([(0, 0), (150 * x, 150 * y)], highway="secondary", name=f"{bearing_deg:g}")
    town.sign(0, 0, highway="traffic_signals")
    return town


@pytest.mark.parametrize(
    ("bearings_deg", "expected"),
    [
        ((0, 90, 180, 270), [{"0", "180"}, {"90", "270"}]),
        ((0, 180, 270), [{"0", "180"}, {"270"}]),
        ((10, 100, 170, 280), [{"10", "170"}, {"100", "280"}]),  # streets that bend at the crossing
        ((0, 120, 240), [{"0"}, {"120"}, {"240"}]),
    ],
)
def test_opposing_approaches_have_one_controller(bearings_deg: tuple[float, ...], expected: list[set[str]]) -> None:
    network = _lights(*bearings_deg).network()
    (junction,) = network.junctions
    assert phases(network) == expected
    assert junction.controller_ids == tuple(controller.id for controller in network.controllers)
    assert [controller.sequence for controller in network.controllers] == list(range(len(expected)))


def test_a_light_before_the_junction_belongs_to_it_and_one_far_off_stands_alone() -> None:
    town = Town()
    town.street([(-150, 0), (-20, 0), (0, 0), (150, 0), (300, 0)], highway="secondary", name="Main")
    town.street([(0, -150), (0, 0), (0, 150)], highway="secondary", name="Side")
    town.sign(-20, 0, highway="traffic_signals", traffic_signals__direction="forward")
    town.sign(150, 0, highway="traffic_signals")  # a pedestrian crossing, lit towards both sides
    network = town.network()
    (junction,) = network.junctions
    at_junction, crossing = network.controllers
    assert junction.controller_ids == (at_junction.id,)
    assert (len(at_junction.signal_ids), len(crossing.signal_ids)) == (1, 2)


def test_controllers_are_written_as_the_standard_has_them_and_read_back() -> None:
    network = _lights(0, 90, 180, 270).network()
    xodr = write_opendrive(network)
    assert find_violations(xodr) == []
    root = etree.fromstring(xodr)
    signals = {signal.get("id") for signal in root.iterfind("road/signals/signal")}
    assert {control.get("signalId") for control in root.iterfind("controller/control")} == signals
    assert [controller.get("sequence") for controller in root.iterfind("junction/controller")] == ["0", "1"]
    stored = read_opendrive(xodr, name="lights")
    assert stored.controllers == network.controllers
    assert stored.junctions[0].controller_ids == network.junctions[0].controller_ids


@pytest.mark.parametrize(
    ("old", "new", "words"),
    [('control signalId="', 'control signalId="9', "which does not exist"), ("<control ", "<other ", "out of place")],
)
def test_a_controller_of_nothing_breaks_a_rule(old: str, new: str, words: str) -> None:
    text = write_opendrive(_lights(0, 90, 180, 270).network()).decode()
    assert any(words in violation for violation in find_violations(text.replace(old, new, 1).encode()))


# --- roads that return -------------------------------------------------------------------------------------------
def _loop() -> Town:
    """A street that ends in a ring without a name of its own: out of one junction and back into it."""
    town = Town()
    town.street([(-120, 0), (0, 0)], name="Court")
    ring = [(30 - 30 * math.cos(a), 30 * math.sin(a)) for a in (k * math.tau / 16 for k in range(1, 16))]
    town.street([(0, 0), *ring, (0, 0)], name="Court")
    return town


def test_a_ring_at_the_end_of_a_street_is_two_roads_that_meet_its_junction_once_each() -> None:
    network = _loop().network()
    (junction,) = network.junctions
    touching = [
        road.id
        for road in network.roads
        for link in (road.predecessor, road.successor)
        if link is not None and link.element_type == "junction" and link.element_id == junction.id
    ]
    assert len(touching) == 3
    assert len(set(touching)) == 3
    assert not one_sided_links(network)
    assert not find_stranded_lanes(network)
    assert max(gap.position_m for gap in link_gaps(network)) < 0.01


def test_one_can_drive_round_a_ring_and_out_again() -> None:
    network = _loop().network()
    street = next(road for road in network.roads if road.predecessor is None and road.junction_id is None)
    start = next(ref for ref in network.drivable_lanes_of(street) if ref.lane_id < 0)
    reached, waiting = set(), [start]
    while waiting:
        ref = waiting.pop()
        if ref not in reached:
            reached.add(ref)
            waiting.extend(network.successors(ref))
    assert start._replace(lane_id=1) in reached


def test_no_light_stands_where_one_way_traffic_leaves_the_map() -> None:
    town = Town()
    town.street([(-100, 0), (-20, 0), (0, 0), (20, 0), (80, 0)], oneway="yes", highway="secondary")
    town.street([(0, -80), (0, 0), (0, 80)])
    town.sign(-20, 0, highway="traffic_signals")
    town.sign(20, 0, highway="traffic_signals")
    (light,) = (signal for road in town.network().roads for signal in road.signals if signal.dynamic)
    assert light.osm_node_id is not None
    assert town.extract().nodes[light.osm_node_id].longitude_deg < -77.0
