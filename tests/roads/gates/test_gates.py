"""The gates hold for maps as they should be, and each fails for the fault it is there for, saying what it measured."""

from __future__ import annotations

import importlib.util
import math
from collections.abc import Callable
from dataclasses import replace

import numpy as np
import pytest

from trace_dag.common.errors import Reason, Rejection
from trace_dag.common.geometry import LocalFrame
from trace_dag.common.settings import RoadSettings
from trace_dag.osm.types import BoundingBox, OsmExtract, OsmNode, OsmWay
from trace_dag.roads.from_osm.convert import convert
from trace_dag.roads.gates import against_osm as map_comparison
from trace_dag.roads.gates.gates import check_map, require
from trace_dag.roads.gates.gates import measures as map_measures
from trace_dag.roads.map.model import Cubic, Lane, LaneRef, Road
from trace_dag.roads.map.network import RoadNetwork
from trace_dag.roads.map.reader import read_opendrive
from trace_dag.roads.map.rules import StoredMap, find_violations
from trace_dag.roads.map.separations import find_separations
from trace_dag.roads.map.writer import write_opendrive
from trace_dag.roads.report import CrashPlacement, MapGate

_FRAME = LocalFrame(40.0, -100.0)


def _extract(*ways: tuple[list[tuple[float, float]], dict[str, str]]) -> OsmExtract:
    """Ways through points in metres; equal points are one node."""
    ids: dict[tuple[float, float], int] = {}
    for points, _ in ways:
        for point in points:
            ids.setdefault(point, len(ids) + 1)
    degrees = _FRAME.to_geographic(np.array(list(ids)))
    nodes = {i: OsmNode(i, float(lat), float(lon)) for i, (lat, lon) in zip(ids.values(), degrees, strict=True)}
    made = tuple(OsmWay(n, tuple(ids[p] for p in points), tags) for n, (points, tags) in enumerate(ways, start=1))
    return OsmExtract(BoundingBox(39.99, -100.01, 40.01, -99.99), nodes, made)


@pytest.fixture(scope="module")
def crossing() -> OsmExtract:
    """A four-lane street and a two-lane one that bends after the crossing."""
    return _extract(
        ([(-250, 0), (0, 0), (250, 0)], {"highway": "primary", "lanes": "4", "name": "Main Street"}),
        ([(0, -200), (0, 0), (0, 90), (60, 160)], {"highway": "residential", "lanes": "2"}),
    )


@pytest.fixture(scope="module")
def network(crossing: OsmExtract) -> RoadNetwork:
    return convert(crossing, _FRAME, RoadSettings())


def _gates(network: RoadNetwork, extract: OsmExtract, placement: CrashPlacement | None = None) -> dict[str, MapGate]:
    return {gate.name: gate for gate in check_map(network, extract, StoredMap(write_opendrive(network)), placement)}


def _changed(network: RoadNetwork, change: Callable[[Road], Road], *, road_id: str | None = None) -> RoadNetwork:
    return replace(
        network,
        roads=tuple(change(road) if road_id in (None, road.id) else road for road in network.roads),
    )


def _street(network: RoadNetwork) -> Road:
    return next(road for road in network.roads if road.junction_id is None and road.name == "Main Street")


def test_a_sound_map_passes_every_gate(network: RoadNetwork, crossing: OsmExtract) -> None:
    lane = network.nearest_lanes(-100, -2, 5)[0]
    pose = network.pose(lane.lane, lane.s_m)
    placement = CrashPlacement(pose.x_m, pose.y_m, 0.0, lane.lane.road_id, 0.0, "nearest", lane)
    gates = _gates(network, crossing, placement)
    unevaluated = {name for name, gate in gates.items() if gate.passed is None}
    assert unevaluated <= {"carla_map"}
    assert all(gate.passed is not False for gate in gates.values()), gates
    assert gates["lanes_against_tags"].detail.startswith(f"{_tagged_roads(network)} roads")
    assert "places" in gates["geodesic_distances"].detail
    require(gates.values())


def _tagged_roads(network: RoadNetwork) -> int:
    return sum(road.junction_id is None for road in network.roads)


def test_a_map_beside_its_ways_is_rejected_with_the_distance(network: RoadNetwork, crossing: OsmExtract) -> None:
    moved = _changed(network, lambda road: replace(road, plan=tuple(replace(e, y_m=e.y_m + 5) for e in road.plan)))
    gates = _gates(moved, crossing)
    assert gates["way_deviation_worst"].value == pytest.approx(5.0, abs=0.2)
    # Half of the ways run across the move, half along it, where the road is beside the way at its ends alone.
    assert 2.0 < gates["way_deviation_mean"].value < 5.0
    with pytest.raises(Rejection, match="way deviation") as caught:
        require(gates.values())
    assert caught.value.reason is Reason.MAP_DISTORTED
    assert caught.value.measured is not None
    assert caught.value.measured > caught.value.threshold  # type: ignore[operator]


def test_a_recorded_trace_that_jumps_about_is_rejected_for_its_deviation() -> None:
    """A position every 3 m, each up to 4 m off: the way turns back on itself, and no road follows it."""
    scattered = [(3.0 * k + 2.4 * math.sin(2.4 * k + 17), 4.0 * math.sin(2.4 * k)) for k in range(-25, 26)]
    trace = _extract(([(-300, 0), *scattered, (300, 0)], {"highway": "tertiary", "lanes": "2"}))
    with pytest.raises(Rejection, match="way deviation") as caught:
        require(_gates(convert(trace, _FRAME, RoadSettings()), trace).values())
    assert caught.value.reason is Reason.MAP_DISTORTED


@pytest.mark.parametrize("turn_deg", [105, 135, 165])
def test_a_sharp_bend_is_a_road_nonetheless(turn_deg: float) -> None:
    """One fold of a street, or of one street into another, is followed to its point within the limit."""
    after = (150 * math.cos(math.radians(turn_deg)), 150 * math.sin(math.radians(turn_deg)))
    name = {"highway": "residential"}
    bend = _extract(([(-150, 0), (0, 0)], name), ([(0, 0), after], {**name, "highway": "service"}))
    gates = _gates(convert(bend, _FRAME, RoadSettings()), bend)
    assert gates["way_deviation_worst"].passed, gates["way_deviation_worst"]
    require(gates.values())


def test_a_map_of_another_scale_disagrees_with_the_ellipsoid(network: RoadNetwork, crossing: OsmExtract) -> None:
    """2 % too large, as a Mercator projection without its scale factor would be (here 1/cos 11 degrees)."""
    factor = 1.02

    def scaled(road: Road) -> Road:
        plan = tuple(
            replace(
                e,
                s_m=e.s_m * factor,
                x_m=e.x_m * factor,
                y_m=e.y_m * factor,
                length_m=e.length_m * factor,
                curvature_1pm=e.curvature_1pm / factor,
            )
            for e in road.plan
        )
        return replace(road, plan=plan, length_m=road.length_m * factor)

    large = _changed(network, scaled)
    gate = _gates(large, crossing)["geodesic_distances"]
    assert gate.passed is False
    assert gate.value == pytest.approx(0.02 * 500, rel=0.02)  # the ends of Main Street lie 500 m apart


def test_a_lost_lane_is_seen_beside_the_tags(network: RoadNetwork, crossing: OsmExtract) -> None:
    street = _street(network)

    def one_lane_less(road: Road) -> Road:
        sections = tuple(
            replace(section, lanes=tuple(lane for lane in section.lanes if lane.id != 2))
            for section in road.lane_sections
        )
        return replace(road, lane_sections=sections)

    less = _changed(network, one_lane_less, road_id=street.id)
    assert map_comparison.MapComparison(less, crossing).lanes_against_tags()[1].keys() == {street.id}


def test_a_lane_that_jumps_aside_is_a_gap(network: RoadNetwork, crossing: OsmExtract) -> None:
    street = _street(network)
    jumped = _changed(network, lambda road: replace(road, lane_offset=(Cubic(0, 0.3),)), road_id=street.id)
    gate = _gates(jumped, crossing)["link_gap"]
    assert gate.passed is False
    assert gate.value == pytest.approx(0.3, abs=0.01)


def test_a_steep_road_fails_with_its_grade(network: RoadNetwork, crossing: OsmExtract) -> None:
    street = _street(network)
    steep = _changed(network, lambda road: replace(road, elevation=(Cubic(0, 0, 0.11),)), road_id=street.id)
    gates = _gates(steep, crossing)
    assert gates["grade"].value == pytest.approx(0.11)
    assert gates["grade"].passed is False
    assert gates["link_gap"].passed is False  # its end hangs in the air


def test_a_crash_beside_the_road_is_off_road(network: RoadNetwork, crossing: OsmExtract) -> None:
    """The carriageway of four lanes of 3.5 m ends 7 m from its middle; the point lies 20 m away."""
    placement = CrashPlacement(-150.0, 20.0, 0.0, _street(network).id, 0.0, "nearest")
    gates = _gates(network, crossing, placement)
    assert gates["crash_on_road"].value == pytest.approx(13.0, abs=0.05)
    with pytest.raises(Rejection) as caught:
        require(gates.values())
    assert caught.value.reason is Reason.CRASH_OFF_ROAD


@pytest.mark.parametrize(("height_m", "passed"), [(5.0, True), (3.0, False)])
def test_clearance_is_measured_where_levels_cross(height_m: float, passed: bool) -> None:
    extract = _extract(
        ([(-200, 0), (200, 0)], {"highway": "primary"}),
        ([(0, -200), (0, 200)], {"highway": "primary", "bridge": "yes", "layer": "1"}),
    )
    network = convert(extract, _FRAME, RoadSettings())
    above = _changed(network, lambda road: replace(road, elevation=(Cubic(0, height_m if road.bridge else 0.0),)))
    gate = _gates(above, extract)["clearance"]
    assert gate.value == pytest.approx(height_m)
    assert gate.passed is passed


def test_a_way_without_a_road_is_missing(network: RoadNetwork) -> None:
    extract = _extract(
        ([(-250, 0), (0, 0), (250, 0)], {"highway": "primary"}),
        ([(0, -200), (0, 0), (0, 90), (60, 160)], {"highway": "residential"}),
        ([(-250, 60), (-100, 60)], {"highway": "residential"}),
    )
    gate = _gates(network, extract)["ways_missing"]
    assert (gate.value, gate.passed, gate.detail) == (1, False, "way 3")


def test_two_points_are_too_few_for_geodesics() -> None:
    extract = _extract(([(-5, 0), (5, 0)], {"highway": "residential"}))
    gate = _gates(convert(extract, _FRAME, RoadSettings()), extract)["geodesic_distances"]
    assert gate.passed is None
    assert "needed" in gate.detail


@pytest.mark.skipif(importlib.util.find_spec("carla") is None, reason="the carla extra is not installed")
def test_carla_reads_the_map(network: RoadNetwork, crossing: OsmExtract) -> None:
    gate = _gates(network, crossing)["carla_map"]
    assert gate.passed
    assert gate.value is not None
    assert gate.value >= 12  # the movements of a crossing alone


# --- rules of the file ------------------------------------------------------------------------------------------
@pytest.mark.parametrize(
    ("old", "new", "words"),
    [
        ('revMinor="7"', 'revMinor="4"', "expected 1.7"),
        ('type="driving"', 'type="asphalt"', "not in the enumeration"),
        ('sOffset="0" a="3.', 'sOffset="1" a="3.', "expected 0"),
        ('<lane id="-2"', '<lane id="-5"', "expected -1 to -n"),
        ('elementType="junction" elementId="', 'elementType="junction" elementId="9', "does not exist"),
        ('laneLink from="-1"', 'laneLink from="-7"', "does not exist"),
        ('connectingRoad="', 'connectingRoad="9', "does not exist"),
        ('curvature="0.', 'curvature="0.9', "after geometry"),
    ],
)
def test_broken_rules_are_found(network: RoadNetwork, old: str, new: str, words: str) -> None:
    text = write_opendrive(network).decode()
    assert find_violations(text.encode()) == []
    assert old in text
    found = find_violations(text.replace(old, new, 1).encode())
    assert any(words in violation for violation in found), found


def test_a_file_that_breaks_rules_is_measured_no_further(network: RoadNetwork, crossing: OsmExtract) -> None:
    xodr = write_opendrive(network).replace(b'type="driving"', b'type="asphalt"', 1)
    (gate,) = check_map(network, crossing, StoredMap(xodr))
    assert (gate.name, gate.passed) == ("opendrive_rules", False)
    assert len(gate.road_ids) == 1
    assert set(gate.road_ids) <= set(network.road_by_id)
    with pytest.raises(Rejection, match="enumeration"):
        require([gate])


def test_links_that_one_side_does_not_know_are_found(network: RoadNetwork) -> None:
    data = write_opendrive(network)
    assert map_measures.one_sided_links(read_opendrive(data, name="sound")) == {}
    two = replace(network, roads=(replace(_street(network), predecessor=None, successor=None),), junctions=())
    street = two.roads[0]
    section = street.lane_sections[0]
    halves = (
        replace(section, lanes=tuple(_linked(lane, successor=lane.id) for lane in section.lanes)),
        replace(section, s_m=street.length_m / 2),
    )
    broken = replace(two, roads=(replace(street, lane_sections=halves),))
    assert len(map_measures.one_sided_links(broken)) == sum(ref.lane_id < 0 for ref in _first_section(broken))


def _linked(lane: Lane, *, successor: int) -> Lane:
    return replace(lane, successor=successor if lane.id else None)


def _first_section(network: RoadNetwork) -> list[LaneRef]:
    return [ref for ref in network.drivable_lanes() if ref.section == 0]


# --- measures ---------------------------------------------------------------------------------------------------
def test_crossings_of_one_junction_are_none(network: RoadNetwork) -> None:
    assert find_separations(network) == []


def test_link_gaps_cover_every_movement(network: RoadNetwork) -> None:
    gaps = map_measures.link_gaps(network)
    expected = sum(len(network.successors(ref)) for ref in network.drivable_lanes())
    assert len(gaps) == expected > 20
    assert max(gap.position_m for gap in gaps) < 0.01
    assert max(gap.heading_rad for gap in gaps) < math.radians(1)
