"""Heights: roads clear each other where OSM says so, and nowhere climb or bend as roads cannot."""

from __future__ import annotations

import math
from itertools import pairwise

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from tests.roads.towns import FRAME, SETTINGS, Town
from trace_dag.common.settings import RoadSettings
from trace_dag.osm.types import OsmExtract
from trace_dag.roads.from_osm.convert import convert
from trace_dag.roads.gates.measures import clearance_m, link_gaps
from trace_dag.roads.map.cubic_profile import CubicProfile
from trace_dag.roads.map.model import Road
from trace_dag.roads.map.network import RoadNetwork
from trace_dag.roads.map.separations import find_separations


def overpass(*, highway: str = "secondary", approach_m: float = 300.0, **over_tags: str) -> Town:
    """A street along x at ground level; another that crosses it along y."""
    town = Town()
    town.street([(-400, 0), (400, 0)], highway="motorway", oneway="no", lanes="4", name="Below")
    town.street([(0, -approach_m), (0, -25)], highway=highway, level="over", name="Over")
    town.street([(0, -25), (0, 25)], highway=highway, level="over", name="Over", **over_tags)
    town.street([(0, 25), (0, approach_m)], highway=highway, level="over", name="Over")
    return town


def heights(network: RoadNetwork, name: str) -> list[float]:
    """Heights every metre along the roads of a name."""
    return [z for road in network.roads if road.name == name for z in profile(road)[0]]


def profile(road: Road) -> tuple[np.ndarray, np.ndarray]:
    """Height and slope every metre of a road."""
    cubics = CubicProfile.of(road.elevation)
    s = np.linspace(0.0, road.length_m, max(2, math.ceil(road.length_m)))
    return cubics.sample(s), cubics.sample_slope(s)


def clearances(network: RoadNetwork) -> list[float]:
    """Height (m) between the roads of each crossing of levels."""
    return [clearance_m(network, crossing) for crossing in find_separations(network, between_levels=True)]


@pytest.mark.parametrize("tags", [{"bridge": "yes"}, {"bridge": "yes", "layer": "1"}, {"layer": "2"}])
def test_a_bridge_clears_the_road_below(tags: dict[str, str]) -> None:
    network = overpass(**tags).network()
    assert max(map(abs, heights(network, "Below"))) == 0.0
    (clearance,) = clearances(network)
    assert clearance >= 4.5
    assert heights(network, "Over")[0] == pytest.approx(0.0)


def test_a_tunnel_dives_under_level_ground() -> None:
    network = overpass(tunnel="yes", layer="-1").network()
    assert max(map(abs, heights(network, "Below"))) == 0.0
    assert min(heights(network, "Over")) <= -4.5


def test_a_map_without_levels_is_level() -> None:
    network = overpass().network()
    assert not any(road.elevation for road in network.roads)


def test_a_bridge_over_nothing_stays_on_the_ground() -> None:
    town = Town()
    town.street([(-100, 0), (0, 0)], name="Road")
    town.street([(0, 0), (40, 0)], name="Road", bridge="yes", layer="1")
    town.street([(40, 0), (200, 0)], name="Road")
    assert not any(max(map(abs, profile(road)[0])) > 0 for road in town.network().roads)


def test_three_levels_lie_above_each_other() -> None:
    town = Town()
    for level in (0, 1, 2):
        angle = level * math.pi / 3
        c, s = math.cos(angle), math.sin(angle)
        tags = {"bridge": "yes", "layer": str(level)} if level else {}
        town.street([(-450 * c, -450 * s), (-40 * c, -40 * s)], level=str(level), highway="motorway", oneway="no")
        town.street(
            [(-40 * c, -40 * s), (40 * c, 40 * s)],
            level=str(level),
            highway="motorway",
            oneway="no",
            name="Mid",
            **tags,
        )
        town.street([(40 * c, 40 * s), (450 * c, 450 * s)], level=str(level), highway="motorway", oneway="no")
    found = clearances(town.network())
    assert len(found) == 3
    assert min(found) >= 4.5
    assert max(found) >= 9.0


def test_switched_off_everything_is_level() -> None:
    network = convert(overpass(bridge="yes").extract(), FRAME, RoadSettings(elevation=False))
    assert not any(road.elevation for road in network.roads)


@st.composite
def interchanges(draw: st.DrawFn) -> OsmExtract:
    """Overpasses of any class and length of approach, with ramps and cross streets hung on them."""
    town = Town()
    length = draw(st.floats(110.0, 350.0))
    town.street([(-400, 0), (-120, 0), (120, 0), (400, 0)], highway="motorway", oneway="no", lanes="4")
    highway = draw(st.sampled_from(["primary", "tertiary", "motorway_link"]))
    layer = draw(st.sampled_from(["1", "2", "-1"]))
    structure = {"bridge": "yes"} if layer != "-1" else {"tunnel": "yes"}
    skew = draw(st.floats(-40.0, 40.0))
    town.street([(-skew, -length), (-skew / 5, -30)], highway=highway, level="over")
    town.street([(-skew / 5, -30), (skew / 5, 30)], highway=highway, level="over", layer=layer, **structure)
    town.street([(skew / 5, 30), (skew, length)], highway=highway, level="over")
    if draw(st.booleans()):
        town.street([(-skew, -length), (150, -length)], level="over")
    if draw(st.booleans()):
        town.street([(skew, length), (-90, length + 60)], level="over", highway="service")
    return town.extract()


@settings(max_examples=40)
@given(interchanges())
def test_clearance_grades_and_continuity_hold_together(extract: OsmExtract) -> None:
    network = convert(extract, FRAME, SETTINGS)
    found = clearances(network)
    assert found
    assert min(found) >= 4.5
    for road in network.roads:
        minor = road.highway.endswith("_link") or road.highway == "service"
        assert np.abs(profile(road)[1]).max() <= (0.12 if minor else 0.08) * 1.001
    for gap in link_gaps(network):
        assert gap.height_m == pytest.approx(0.0, abs=1e-3)
    for before, record in (records for road in network.roads for records in pairwise(road.elevation)):
        # None says again what the one before says already (a rule of ASAM's checker).
        ahead = record.s_m + np.linspace(0.0, 50.0, 11)
        assert np.ptp(CubicProfile.of([before]).sample(ahead) - CubicProfile.of([record]).sample(ahead)) > 1e-6
