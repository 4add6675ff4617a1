"""Osm2Odr behind the converter's interface; joining the roads of a street changes names, not where one can drive."""

from __future__ import annotations

import math
from pathlib import Path

import pytest

from tests.roads.towns import Town, report, vehicle
from trace_dag.carla import osm2odr
from trace_dag.common.errors import Failure, UserError
from trace_dag.common.geometry import LocalFrame
from trace_dag.common.settings import OsmSettings, RoadSettings
from trace_dag.osm.catalog import MapCatalog
from trace_dag.osm.types import OsmExtract, Site
from trace_dag.osm.xml import write_osm
from trace_dag.roads.build import build_road_map
from trace_dag.roads.gates.gates import check_map
from trace_dag.roads.map.network import RoadNetwork
from trace_dag.roads.map.reader import read_opendrive
from trace_dag.roads.map.rules import StoredMap
from trace_dag.roads.map.writer import write_opendrive

_TOWN = Path(__file__).resolve().parents[3] / "data" / "sample" / "osm" / "merrow.osm"


@pytest.fixture(scope="module")
def site() -> tuple[OsmExtract, LocalFrame]:
    """The middle of the sample's town."""
    whole = MapCatalog.open([_TOWN])
    box = whole.files[0].header.box
    assert box is not None
    place = Site("town", (box.south_deg + box.north_deg) / 2, (box.west_deg + box.east_deg) / 2)
    extract = whole.extract([place], OsmSettings(radius_m=600.0))["town"]
    assert isinstance(extract, OsmExtract)
    return extract, LocalFrame(place.latitude_deg, place.longitude_deg)


@pytest.fixture(scope="module")
def raw(site: tuple[OsmExtract, LocalFrame]) -> RoadNetwork:
    pytest.importorskip("carla", reason="the carla extra is not installed")
    extract, frame = site
    return osm2odr.drop_dangling_links(read_opendrive(osm2odr.run_osm2odr(write_osm(extract), frame), name="raw"))


def _drives(network: RoadNetwork) -> set[tuple[tuple[float, ...], ...]]:
    """Every drivable lane and what follows it, told by places alone, in decimetres."""
    found = set()
    for ref in network.drivable_lanes():
        begin, end = network.centreline(ref)[[0, -1], :2]
        for following in [*network.successors(ref), None]:
            then = network.centreline(following)[-1, :2] if following is not None else end
            found.add(tuple((round(float(x), 1), round(float(y), 1)) for x, y in (begin, end, then)))
    return found


def test_joined_streets_lead_where_they_led(raw: RoadNetwork) -> None:
    joined = osm2odr.merge_directions(raw)
    streets = [road for road in raw.roads if road.junction_id is None]
    kept = [road for road in joined.roads if road.junction_id is None]
    both_ways = [road for road in kept if any(lane.id > 0 for lane in road.lane_sections[0].lanes)]
    assert len(both_ways) == len(streets) - len(kept) > 10
    assert len(joined.drivable_lanes()) == len(raw.drivable_lanes())
    before, after = _drives(raw), _drives(joined)
    # The two reference lines of a street are up to half a metre apart, its lanes then move with the one kept.
    lost = [drive for drive in before if not any(_close(drive, other) for other in after)]
    assert not lost


def _close(a: tuple[tuple[float, ...], ...], b: tuple[tuple[float, ...], ...]) -> bool:
    return all(math.dist(p, q) < 0.8 for p, q in zip(a, b, strict=True))


def test_its_maps_go_through_the_same_gates(site: tuple[OsmExtract, LocalFrame]) -> None:
    pytest.importorskip("carla", reason="the carla extra is not installed")
    extract, frame = site
    network = osm2odr.convert_with_osm2odr(extract, frame)
    assert "Osm2Odr" in network.converter
    streets = [road for road in network.roads if road.junction_id is None]
    assert sum(bool(road.highway) for road in streets) > 0.9 * len(streets)
    gates = {
        gate.name: gate
        for gate in check_map(
            network, extract, StoredMap(write_opendrive(network)), limits=osm2odr.Osm2OdrConverter.limits
        )
    }
    assert gates["carla_map"].passed
    assert gates["geodesic_distances"].passed, gates["geodesic_distances"]


def test_a_crash_gets_its_road_map_by_it() -> None:
    """The whole stage with the setting: converted, placed, gated and written; each street's directions in one road."""
    pytest.importorskip("carla", reason="the carla extra is not installed")
    town = Town()
    town.street([(-250, 0), (0, 0), (250, 0)], highway="secondary", name="Main Street", lanes="4")
    town.street([(0, -250), (0, 0), (0, 250)], name="Elm Street")
    car = vehicle(lanes=4, trafficway=1)
    record = report(car, car, at_m=(-100, -2), street="MAIN ST")
    road_map = build_road_map(town.extract(), record, RoadSettings(converter="osm2odr"))
    assert road_map.report.converter.startswith("CARLA Osm2Odr ")
    assert road_map.report.converter in write_opendrive(road_map.network).decode()
    road = road_map.network.road_by_id[road_map.report.placement.road_id]
    assert "Main Street" in road.names
    lanes = [lane.id for lane in road.lane_sections[0].lanes if lane.type.drivable]
    assert sorted(lanes) == [-2, -1, 1, 2]


def test_without_carla_it_names_what_to_install(
    site: tuple[OsmExtract, LocalFrame], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(osm2odr.importlib.util, "find_spec", lambda name: None)
    with pytest.raises(UserError, match=r"trace-dag\[carla\]"):
        osm2odr.convert_with_osm2odr(*site)


def test_a_converter_that_breaks_is_a_failure(
    site: tuple[OsmExtract, LocalFrame], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(osm2odr.importlib.util, "find_spec", lambda name: True)
    monkeypatch.setattr(osm2odr, "SCRIPT", "import sys; sys.exit('no map today')")
    with pytest.raises(Failure, match="no map today"):
        osm2odr.convert_with_osm2odr(*site)
