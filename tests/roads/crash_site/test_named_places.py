"""Places by the names of two streets, on a map of our own whose coordinates are worked out by hand.

At 40 degrees north a degree of latitude has 111,034.6 m and one of longitude 85,393.7 m (the series of the WGS84
ellipsoid's arcs). Oak Street runs west to east; Elm Road begins in it and leads 500 m north-east; Ash Lane crosses Oak
Street twice.
"""

from __future__ import annotations

from pathlib import Path

import pytest
from sample_runs import SAMPLE

from trace_dag.crash.record import Octant
from trace_dag.crash.reported_place import FromCrossing, Place, look_up
from trace_dag.roads.crash_site.named_places import find_places
from trace_dag.roads.crash_site.street_names import StreetIndex

LATITUDE_M, LONGITUDE_M = 111_034.6, 85_393.7
FT_300_M = 91.44
NODES = {  # metres east and north of the crossing of Oak Street and Elm Road
    1: (-600, 0), 2: (0, 0), 3: (400, 0), 4: (800, 0), 5: (353.553, 353.553),
    6: (-600, 100), 7: (-600, -100), 8: (800, 100), 9: (800, -100), 10: (0, 900),
}  # fmt: skip
WAYS = {"Oak Street": (1, 2, 3, 4), "Elm Road": (2, 5), "Ash Lane": (6, 1, 7, 9, 4, 8), "Far Road": (8, 10)}


def at(east_m: float, north_m: float) -> tuple[float, float]:
    return 40.0 + north_m / LATITUDE_M, -100.0 + east_m / LONGITUDE_M


@pytest.fixture
def town(tmp_path: Path) -> Path:
    nodes = ""
    for number, metres in NODES.items():
        latitude_deg, longitude_deg = at(*metres)
        nodes += f'<node id="{number}" lat="{latitude_deg:.7f}" lon="{longitude_deg:.7f}"/>'
    ways = ""
    for number, (name, members) in enumerate(WAYS.items(), 1):
        refs = "".join(f'<nd ref="{member}"/>' for member in members)
        ways += f'<way id="{number}">{refs}<tag k="highway" v="residential"/><tag k="name" v="{name}"/></way>'
    path = tmp_path / "town.osm"
    path.write_text(f'<osm version="0.6">{nodes}{ways}</osm>')
    return path


DIAGONAL = FT_300_M / 2**0.5


@pytest.mark.parametrize(
    ("wanted", "metres"),
    [
        (FromCrossing("OAK ST", "ELM RD"), [(0, 0)]),
        (FromCrossing("Elm Road", "Oak Street"), [(0, 0)]),
        (FromCrossing("OAK ST", "ELM RD", FT_300_M, Octant.WEST), [(-FT_300_M, 0)]),
        (FromCrossing("OAK ST", "ELM RD", FT_300_M, Octant.SOUTH_EAST), [(FT_300_M, 0)]),
        (FromCrossing("ELM RD", "OAK ST", FT_300_M, Octant.NORTH), [(DIAGONAL, DIAGONAL)]),
        (FromCrossing("ELM RD", "OAK ST", FT_300_M, Octant.EAST), [(DIAGONAL, DIAGONAL)]),
        (FromCrossing("ELM RD", "OAK ST", FT_300_M, Octant.SOUTH), []),  # it does not lead there
        (FromCrossing("ELM RD", "OAK ST", 600.0, Octant.NORTH), []),  # nor so far
        (FromCrossing("OAK ST", "ASH LN"), [(-600, 0), (800, 0)]),
        (FromCrossing("OAK ST", "FAR RD"), []),
        (FromCrossing("OKA STREET", "ELM RD"), []),  # too short for a typing error
    ],
)
def test_places_are_where_the_map_has_them(town: Path, wanted: FromCrossing, metres: list[tuple[float, float]]) -> None:
    found = find_places([town], [wanted])[wanted]
    assert sorted(found) == [pytest.approx(at(*each), abs=3e-6) for each in sorted(metres)]  # 0.3 m


def test_streets_of_the_sample_cross_where_a_crash_happened() -> None:
    wanted = FromCrossing("MAIN ST", "N BIRCH STREET")
    ((latitude_deg, longitude_deg),) = find_places([SAMPLE / "osm"], [wanted])[wanted]
    north_m, east_m = (latitude_deg - 41.82980556) * 111_070, (longitude_deg + 101.541525) * 83_071
    assert (north_m**2 + east_m**2) ** 0.5 < 12  # 2023-319001, in that crossing


def test_a_street_with_a_typing_error_is_found_unless_another_is_spelled_so() -> None:
    assert StreetIndex([("Franklin Road",), ("Elm Road",)]).same("FRANKLN RD") == [("Franklin Road",)]
    both = StreetIndex([("Franklin Road",), ("Frankln Road",)])
    assert both.same("FRANKLN RD") == [("Frankln Road",)]
    assert StreetIndex([("US 60",), ("Apache Boulevard", "US 60")]).same("US-60") == [
        ("US 60",),
        ("Apache Boulevard", "US 60"),
    ]


def test_the_reason_for_an_unknown_place_is_given() -> None:
    here, there = FromCrossing("A", "B"), FromCrossing("A", "C")
    wanted = {"1": here, "2": there, "3": None, "4": FromCrossing("A", "D")}
    places, unknown = look_up(wanted, lambda asked: {here: [Place(1.0, 2.0)], there: [Place(1.0, 2.0)] * 2})
    assert places == {"1": Place(1.0, 2.0)}
    assert "lead to 2 places of the maps" in unknown["2"]
    assert "no two streets" in unknown["3"]
    assert "lead to nowhere on the maps" in unknown["4"]
    assert all("no --maps" in why for name, why in look_up(wanted, None)[1].items() if name != "3")
    assert FromCrossing.said("A", "B", 10.0, None) is None, "a distance without a direction is no place"
    assert FromCrossing.said("A", "B", 0.0, Octant.NORTH) == here
