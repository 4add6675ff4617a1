"""Maps around crashes, cut out of files of every kind."""

from __future__ import annotations

import bz2
import gzip
import math
import random
import re
import shutil
from collections.abc import Callable
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import osmium
import pytest
import shapely

from tests.osm.osm_text import ORIGIN, document, node, place, restriction, save, way
from trace_dag.common.errors import Failure, Reason, Rejection, UserError, UserErrors
from trace_dag.common.geometry import LocalFrame
from trace_dag.common.settings import OsmSettings
from trace_dag.osm.catalog import MapCatalog, box_around
from trace_dag.osm.map_check import MapChecker
from trace_dag.osm.plausibility import check_text
from trace_dag.osm.types import OsmExtract, Site
from trace_dag.osm.xml import read_osm, write_osm

SITE = Site("2023-1", *ORIGIN)
CROSSROADS = (
    node(1, -100, 0),
    node(2, 0, 0, highway="traffic_signals", note="long-standing"),
    node(3, 100, 0),
    node(4, 0, -100),
    node(5, 0, 100),
    way(10, [1, 2, 3], name="Main Street", lanes="2", source__lanes="survey"),
    way(11, [4, 2, 5], name="Elm Street"),
    restriction(20, 10, 2, 11),
)


def extract(*files: Path, site: Site = SITE, **settings: object) -> OsmExtract | Rejection:
    return MapCatalog.open(files).extract([site], OsmSettings(**settings))[site.key]  # type: ignore[arg-type]


def found(result: OsmExtract | Rejection) -> OsmExtract:
    assert isinstance(result, OsmExtract), result
    return result


def rejected(result: OsmExtract | Rejection) -> Rejection:
    assert isinstance(result, Rejection)
    assert result.reason == Reason.NO_MAP_COVERAGE
    return result


def convert(source: Path, target: Path) -> Path:
    """Another format of the same file, by libosmium itself."""
    with osmium.SimpleWriter(str(target)) as writer:
        for element in osmium.FileProcessor(str(source)):
            writer.add(element)
    return target


@pytest.mark.parametrize(("suffix", "opener"), [(".osm", open), (".osm.gz", gzip.open), (".osm.bz2", bz2.open)])
def test_the_rights_named_in_a_file_are_kept(tmp_path: Path, suffix: str, opener: Callable[..., Any]) -> None:
    said = document(*CROSSROADS).replace(b"<osm ", b'<osm copyright="Town of Merrow" license="CC BY 4.0" ')
    with opener(tmp_path / f"town{suffix}", "wb") as stream:
        stream.write(said)
    cut = found(extract(tmp_path / f"town{suffix}"))
    assert cut.attribution == "Town of Merrow, CC BY 4.0"
    assert read_osm(write_osm(cut), name="stored").attribution == cut.attribution


def test_a_file_that_states_nothing_of_its_rights_is_openstreetmap(tmp_path: Path) -> None:
    assert "OpenStreetMap" in found(extract(save(tmp_path / "town.osm", *CROSSROADS))).attribution


@pytest.mark.parametrize("suffix", [".osm", ".osm.gz", ".osm.bz2", ".osm.pbf"])
def test_every_format_gives_the_same_map(tmp_path: Path, suffix: str) -> None:
    plain = save(tmp_path / "plain.osm", *CROSSROADS)
    cut = found(extract(convert(plain, tmp_path / f"town{suffix}") if suffix != ".osm" else plain))
    assert [w.id for w in cut.ways] == [10, 11]
    assert cut.ways[0].tags == {
        "highway": "residential",
        "name": "Main Street",
        "lanes": "2",
        "source:lanes": "survey",
    }
    assert cut.nodes[2].tags == {"highway": "traffic_signals", "note": "long-standing"}
    assert [(m.type, m.id, m.role) for m in cut.relations[0].members] == [
        ("way", 10, "from"),
        ("node", 2, "via"),
        ("way", 11, "to"),
    ]
    assert cut.nodes[3].longitude_deg == pytest.approx(place(100, 0)[1], abs=1e-7)


@pytest.mark.parametrize("seed", range(4))
def test_the_order_of_objects_in_a_file_does_not_matter(tmp_path: Path, seed: int) -> None:
    sorted_map = found(extract(save(tmp_path / "a.osm", *CROSSROADS)))
    shuffled = random.Random(seed).sample(CROSSROADS, len(CROSSROADS))
    any_order = found(extract(save(tmp_path / "b.osm", *shuffled)))
    assert (any_order.nodes, any_order.ways, any_order.relations) == (
        sorted_map.nodes,
        sorted_map.ways,
        sorted_map.relations,
    )


def test_ways_are_cut_at_the_box(tmp_path: Path) -> None:
    file = save(
        tmp_path / "long.osm",
        node(1, -5000, 20),
        node(2, 5000, 20),
        node(3, 0, -150),
        node(4, 0, 900),
        way(10, [1, 2], highway="primary"),  # no node of it lies in the box
        way(11, [3, 4]),
    )
    cut = found(extract(file, radius_m=200.0))
    frame = LocalFrame(*ORIGIN)
    at = {n.id: frame.to_local(n.latitude_deg, n.longitude_deg) for n in cut.nodes.values()}
    ends = {w.id: [at[i] for i in w.node_ids] for w in cut.ways}
    assert ends[10][0] == pytest.approx([-200, 20], abs=0.6)
    assert ends[10][1] == pytest.approx([200, 20], abs=0.6)
    assert ends[11] == [pytest.approx([0, -150], abs=0.3), pytest.approx([0, 200], abs=0.6)]
    made = [n for n in cut.nodes.values() if n.clipped]
    assert len(made) == 3
    assert all(n.id < 0 for n in made)
    assert not cut.nodes[3].clipped
    again = found(extract(file, radius_m=200.0))
    assert again == cut


def test_a_way_that_comes_back_becomes_two_with_different_ids(tmp_path: Path) -> None:
    file = save(
        tmp_path / "hairpin.osm",
        *(node(1, 0, 0), node(2, 400, 0), node(3, 400, 60), node(4, 0, 60), node(5, 0, 120)),
        way(10, [1, 2, 3, 4]),
        way(11, [4, 5]),
        restriction(20, 10, 4, 11),
    )
    cut = found(extract(file, radius_m=200.0))
    parts = [w for w in cut.ways if w.id != 11]
    assert len({w.id for w in parts}) == 2
    assert 10 in {w.id for w in parts}
    part_at_via = next(w for w in parts if 4 in w.node_ids)
    assert cut.relations[0].members[0].id == part_at_via.id


def test_nodes_that_are_missing_break_a_way_instead_of_bridging_the_gap(tmp_path: Path) -> None:
    file = save(
        tmp_path / "holes.osm",
        *(node(1, 0, 0), node(2, 20, 0), node(4, 80, 0), node(5, 100, 0)),
        way(10, [1, 2, 3, 4, 5]),
        way(11, [6, 7]),
    )
    cut = found(extract(file))
    assert sorted(w.node_ids for w in cut.ways) == [(1, 2), (4, 5)]


def test_only_what_a_vehicle_drives_on_is_kept(tmp_path: Path) -> None:
    ends = [node(i, 10 * i, 0) for i in range(10)]
    file = save(
        tmp_path / "all.osm",
        *ends,
        way(20, [0, 1], highway="footway"),
        way(21, [1, 2], highway="service", service="driveway"),
        way(22, [2, 3], highway="motorway_link"),
        way(23, [3, 4], highway="construction"),
        way(24, [4, 5], highway="residential", access="no"),
        way(25, [5, 6], highway="residential", access="no", motor_vehicle="yes"),
        way(26, [6, 7], highway="residential", access="private"),
        way(27, [7, 8], highway="residential", area="yes"),
        way(28, [8, 9], highway="track"),
        way(29, [8, 9], highway="track", ref="CR 93"),
    )
    assert [w.id for w in found(extract(file)).ways] == [21, 22, 25, 26, 29]
    assert [w.id for w in found(extract(file, service_roads=False)).ways] == [22, 25, 26, 29]


def test_a_restriction_is_dropped_with_the_way_it_speaks_of(tmp_path: Path) -> None:
    file = save(tmp_path / "a.osm", *CROSSROADS[:-2], restriction(20, 10, 2, 11))
    assert found(extract(file)).relations == ()


def test_each_crash_gets_the_file_that_covers_it(tmp_path: Path) -> None:
    west = save(tmp_path / "west.osm", *CROSSROADS, bounds_m=(-150, -150, 150, 150))
    far = (node(1, 50_000, 0), node(2, 50_100, 0), way(10, [1, 2], name="Far Street"))
    east = save(tmp_path / "east.osm", *far)  # does not say what it covers
    (tmp_path / "notes.txt").write_text("not a map")
    sites = [Site("2023-1", *place(0, 0)), Site("2023-2", *place(50_050, 0)), Site("2023-3", *place(20_000, 0))]
    maps = MapCatalog.open([tmp_path]).extract(sites, OsmSettings())
    assert found(maps["2023-1"]).source == west.name
    assert found(maps["2023-2"]).source == east.name
    missing = rejected(maps["2023-3"])
    assert missing.measured == pytest.approx(20_000 - 150, rel=0.01)
    assert "19.8 km" in missing.detail or "19.9 km" in missing.detail


def test_the_file_with_more_road_around_the_crash_is_taken(tmp_path: Path) -> None:
    save(tmp_path / "edge.osm", node(1, 100, 0), node(2, 300, 0), way(10, [1, 2]))
    save(tmp_path / "middle.osm", *CROSSROADS)
    assert found(extract(tmp_path)).source == "middle.osm"


def test_a_box_without_a_drivable_way_is_no_coverage(tmp_path: Path) -> None:
    nothing_near = (node(1, 5000, 0), node(2, 5100, 0), way(10, [1, 2]))
    file = save(tmp_path / "wide.osm", *nothing_near, bounds_m=(-9000, -9000, 9000, 9000))
    assert "no drivable way within 300 m" in rejected(extract(file)).detail


@pytest.mark.parametrize(
    ("latitude", "longitude"),
    [(90.0, 0.0), (-89.9999, 10.0), (51.0, 180.0), (51.0, -180.0), (math.nan, 0.0), (91.0, 0.0), (0.0, 0.0)],
)
def test_sites_at_the_edges_of_the_earth_are_rejected_not_fatal(
    tmp_path: Path, latitude: float, longitude: float
) -> None:
    file = save(tmp_path / "a.osm", *CROSSROADS)
    rejected(extract(file, site=Site("2023-1", latitude, longitude)))


def test_an_empty_map_is_no_coverage(tmp_path: Path) -> None:
    assert "no map data at all" in rejected(extract(save(tmp_path / "empty.osm"))).detail


@pytest.mark.parametrize("suffix", [".osm", ".osm.gz", ".osm.bz2", ".osm.pbf"])
@pytest.mark.parametrize(
    "content", [b"", b"hello", b"<html><body>404</body></html>", b'<osm version="0.5"/>', b"\x00\x01\x02\x03" * 20]
)
def test_a_file_that_is_no_osm_is_named(tmp_path: Path, suffix: str, content: bytes) -> None:
    file = tmp_path / f"broken{suffix}"
    file.write_bytes(content)
    with pytest.raises(UserError, match=f"broken{suffix}"):
        extract(file)


@pytest.mark.parametrize("suffix", [".osm", ".osm.pbf", ".pbf"])
def test_a_file_that_ends_too_early_is_named(tmp_path: Path, suffix: str) -> None:
    plain = save(tmp_path / "plain.osm", *CROSSROADS)
    whole = convert(plain, tmp_path / f"whole{suffix}")
    half = tmp_path / f"half{suffix}"
    half.write_bytes(whole.read_bytes()[: int(0.9 * whole.stat().st_size)])
    failure = extract(half)
    assert isinstance(failure, Failure)
    assert f"cohort maps --drop {half}" in str(failure)
    assert found(extract(half, whole)).source == whole.name, "what another file covers is cut from that"
    with pytest.raises(UserError, match=f"half{suffix}"):
        MapCatalog.checked([half])


STAR = [node(1, 0, 0), *(node(k, 50 * math.cos(k), 50 * math.sin(k)) for k in range(2, 102))]
STAR += [way(1000 + k, [1, k]) for k in range(2, 102)]


SPIRAL = [node(k, k / 80 * math.cos(k / 40), k / 80 * math.sin(k / 40)) for k in range(1, 20_001)]
SPIRAL += [way(30_000 + k, list(range(k, k + 1_001))) for k in range(1, 19_000, 1_000)]
GRID = [node(100 * x + y, 10 * x - 205, 10 * y - 205) for x in range(1, 41) for y in range(1, 41)]
GRID += [way(10_000 + k, [100 * k + y for y in range(1, 41)]) for k in range(1, 41)]
GRID += [way(20_000 + k, [100 * x + k for x in range(1, 41)]) for k in range(1, 41)]
LEVELS = [node(k, 250 * math.cos(k * math.pi / 400), 250 * math.sin(k * math.pi / 400)) for k in range(1, 801)]
LEVELS += [way(1_000 + k, [k, k + 400], layer=str(k)) for k in range(1, 401)]


@pytest.mark.parametrize(
    ("elements", "said"),
    [
        (SPIRAL, "nodes of roads per square kilometre; the densest towns have less than 20000"),
        (GRID, "places where roads meet per square kilometre"),
        (LEVELS, "metres of road per square kilometre"),
        (STAR, "100 roads meet at node 1"),
        ([*(node(k, k / 50, k % 2) for k in range(1, 5001)), way(9, list(range(1, 5001)))], "way 9 has 5000 nodes"),
        ([*CROSSROADS, way(10**20, [1, 2])], "cannot be read as OSM data"),
        ([*CROSSROADS, way(12, [1, 2], name="x" * 100_000)], "cannot be read as OSM data"),
    ],
    ids=["spiral", "grid", "levels", "star", "zigzag", "id beyond 64 bits", "long name"],
)
def test_maps_beyond_the_limits_fail_with_a_remedy(tmp_path: Path, elements: list[str], said: str) -> None:
    file = save(tmp_path / "town.osm", *elements)
    failure = MapCatalog.of_registered([file]).extract([SITE], OsmSettings())[SITE.key]
    assert isinstance(failure, Failure)
    assert said in str(failure)
    assert f"trace-dag cohort maps --drop {file}" in str(failure)


def test_ids_below_0_as_editors_give_them_are_read(tmp_path: Path) -> None:
    elements = [*CROSSROADS, node(-1, 0, 200), way(-2, [5, -1], name="New Street")]
    cut = found(extract(save(tmp_path / "town.osm", *elements)))
    assert {way.tags.get("name") for way in cut.ways} == {"Main Street", "Elm Street", "New Street"}
    assert all(way.id > 0 and min(way.node_ids) > 0 for way in cut.ways)
    alone = [element.replace('id="', 'id="-').replace('ref="', 'ref="-') for element in CROSSROADS]
    assert len(found(extract(save(tmp_path / "new.osm", *alone))).ways) == 2


def test_objects_deleted_by_an_editor_are_not_on_the_map(tmp_path: Path) -> None:
    deleted = way(-3, [1, 4], name="Removed Road").replace("<way ", '<way action="delete" visible="true" ')
    moved = node(5, 0, 120).replace("<node ", '<node action="modify" visible="true" ')
    cut = found(extract(save(tmp_path / "josm.osm", *CROSSROADS[:4], moved, *CROSSROADS[5:], deleted)))
    assert [each.tags["name"] for each in cut.ways] == ["Main Street", "Elm Street"]
    assert cut.nodes[5].latitude_deg == pytest.approx(place(0, 120)[0], abs=1e-6)
    assert len(cut.relations) == 1


def test_the_newest_version_of_a_history_counts_where_it_is_visible(tmp_path: Path) -> None:
    def version(element: str, number: int, visible: str) -> str:
        return element.replace('version="1"', f'version="{number}" visible="{visible}"')

    history = [
        version(node(1, -60, 0), 1, "true"),
        version(node(1, -100, 0), 2, "true"),
        *CROSSROADS[1:5],
        version(way(10, [1, 2], lanes="1"), 1, "true"),
        version(way(10, [1, 2, 3], lanes="4"), 10, "true"),
        version(way(10, [1, 2], lanes="2"), 9, "true"),
        version(way(11, [4, 2, 5]), 1, "true"),
        version('<way id="11" version="1"></way>', 2, "false"),
    ]
    cut = found(extract(save(tmp_path / "history.osm", *history)))
    assert [(each.id, each.node_ids, each.tags["lanes"]) for each in cut.ways] == [(10, (1, 2, 3), "4")]
    assert cut.nodes[1].longitude_deg == pytest.approx(place(-100, 0)[1], abs=1e-6)


def test_a_history_in_binary_form_is_refused_with_what_makes_a_map_of_it(tmp_path: Path) -> None:
    path, header = tmp_path / "town.osm.pbf", osmium.io.Header()
    header.has_multiple_object_versions = True
    with osmium.SimpleWriter(osmium.io.File(str(path), "osh.pbf"), header=header) as writer:
        osmium.apply(str(save(tmp_path / "town.osm", *CROSSROADS)), writer)
    with pytest.raises(UserError, match=r"town\.osm\.pbf: a history file.*osmium time-filter"):
        MapCatalog.open([path])


@pytest.mark.parametrize("suffix", [".osm", ".osm.gz"])
def test_places_in_the_ways_are_read_as_overpass_gives_them(tmp_path: Path, suffix: str) -> None:
    def located(number: int) -> str:
        latitude, longitude = place(*{1: (-100, 0), 2: (0, 0), 3: (100, 0), 4: (0, -100), 5: (0, 100)}[number])
        return f'<nd ref="{number}" lat="{latitude:.7f}" lon="{longitude:.7f}"/>'

    def geometry(element: str) -> str:
        bounds = '<bounds minlat="36.9" minlon="-77.1" maxlat="37.1" maxlon="-76.9"/>'
        return re.sub(r'<nd ref="(\d)"/>', lambda nd: located(int(nd[1])), element).replace("><nd", f">{bounds}<nd", 1)

    member = restriction(20, 10, 2, 11).replace('role="from"/>', f'role="from">{located(1)}{located(2)}</member>')
    plain = document(geometry(CROSSROADS[5]), geometry(CROSSROADS[6]), member)
    (tmp_path / f"town{suffix}").write_bytes(gzip.compress(plain) if suffix == ".osm.gz" else plain)
    cut = found(extract(tmp_path / f"town{suffix}"))
    whole = found(extract(save(tmp_path / "whole.osm", *CROSSROADS)))
    assert (cut.ways, cut.relations) == (whole.ways, whole.relations)
    assert {number: each[1:3] for number, each in cut.nodes.items()} == {
        number: each[1:3] for number, each in whole.nodes.items()
    }


@pytest.mark.parametrize("text", [b"a", b"<a>", b"-"], ids=["letters", "tags", "dashes"])
def test_a_comment_without_end_is_refused_before_it_is_parsed(tmp_path: Path, text: bytes) -> None:
    with gzip.open(tmp_path / "long.osm.gz", "wb") as stream:
        stream.write(b'<osm version="0.6"><!--' + text * 3_000_000 + b"--></osm>")
    with pytest.raises(UserError, match="one tag or comment has more than"):
        check_text(tmp_path / "long.osm.gz")


def test_a_map_that_takes_more_memory_than_it_may_is_refused(tmp_path: Path) -> None:
    deleted = way(-3, [1, 4], name="Removed Road").replace("<way ", '<way action="delete" ')
    file = tmp_path / "large.osm.gz"
    file.write_bytes(gzip.compress(document(*CROSSROADS, *[deleted] * 500_000)))
    with (
        MapChecker(memory_mb=300) as checker,
        pytest.raises(UserError, match=r"large\.osm\.gz: takes more than 300 MB"),
    ):
        checker.check(file)


def refusal(path: Path) -> str | None:
    """Why a file is not read as OSM XML, None if it is."""
    try:
        check_text(path)
    except UserError as error:
        return str(error)
    return None


def test_comments_tags_and_blocks_of_real_files_are_no_comments_without_end(tmp_path: Path) -> None:
    whole = document(*CROSSROADS).replace(b"<node", b"<!-- a > b < c -->" * 10 + b"<node") + b"\n" * 100
    (tmp_path / "town.osm").write_bytes(b'<?xml version="1.0"?>' + b"<!-- x -->" * 400_000 + whole.partition(b"?>")[2])
    real = (tmp_path / "town.osm", Path(__file__).parents[2] / "data/sample/osm/merrow.osm")
    assert [refusal(path) for path in real] == [None, None]


def test_a_disk_without_room_for_the_roads_is_named(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(shutil, "disk_usage", lambda folder: SimpleNamespace(free=1))
    with pytest.raises(UserError, match=r"0 MB free.*TMPDIR"):
        extract(save(tmp_path / "plain.osm", *CROSSROADS), node_memory_mb=0.0)


def test_paths_that_are_no_maps_are_named(tmp_path: Path) -> None:
    (tmp_path / "map.txt").write_bytes(document(*CROSSROADS))
    for path, said in ((tmp_path, "no OSM file"), (tmp_path / "map.txt", "by its name"), (tmp_path / "x", "no such")):
        with pytest.raises(UserError, match=said):
            MapCatalog.open([path])


def test_every_way_that_touches_a_box_is_found_and_none_else(shared_data: Path) -> None:
    """Against a plain reading of the whole file and shapely's intersections."""
    file = shared_data / "osm" / "tempe-az.osm.pbf"
    randomly = random.Random(7)
    sites = [Site(str(i), randomly.uniform(33.305, 33.448), randomly.uniform(-111.978, -111.888)) for i in range(60)]
    settings = OsmSettings(service_roads=False, radius_m=250.0)
    maps = MapCatalog.open([file]).extract(sites, settings)
    classes = {"motorway", "trunk", "primary", "secondary", "tertiary", "unclassified", "residential", "living_street"}
    lines: dict[int, shapely.LineString] = {}
    for obj in osmium.FileProcessor(str(file)).with_locations():
        if not obj.is_way() or obj.tags.get("highway", "").removesuffix("_link") not in classes:
            continue
        if {obj.tags.get(key) for key in ("access", "vehicle", "motor_vehicle", "motorcar", "area")} == {None}:
            places = [n.location for n in obj.nodes]
            if len(places) > 1 and all(p.valid() for p in places):
                lines[obj.id] = shapely.LineString([(p.lon, p.lat) for p in places])
    ids, tree = list(lines), shapely.STRtree(list(lines.values()))
    checked = 0
    for site in sites:
        box = box_around(site, settings.radius_m)
        area = shapely.box(box.west_deg, box.south_deg, box.east_deg, box.north_deg)
        expected = {ids[i] for i in tree.query(area, predicate="intersects")}
        cut = maps[site.key]
        actual = {w.id for w in cut.ways if w.id in lines} if isinstance(cut, OsmExtract) else set()
        assert actual == expected
        checked += len(expected)
    assert checked > 500


def test_every_published_site_has_its_own_map(shared_data: Path) -> None:
    """The maps cover one site each; crash and map carry the same case number in their names."""
    folder = shared_data / "va-2023"
    sites = []
    for report in sorted((folder / "reports").glob("*.xml")):
        text = report.read_text(encoding="utf-8", errors="replace")
        latitude, longitude = (float(text.split(f"<{tag}>")[1].split("<")[0]) for tag in ("LATITUDE", "LONGITUD"))
        sites.append(Site(report.stem.removeprefix("crash_"), latitude, longitude))
    maps = MapCatalog.open([folder / "osm"]).extract(sites, OsmSettings())
    with_map = {path.stem.removeprefix("map_") for path in (folder / "osm").glob("*.osm")}
    assert {key for key, cut in maps.items() if isinstance(cut, OsmExtract)} == with_map
    assert all(found(maps[key]).source == f"map_{key}.osm" for key in with_map)
    assert all(rejected(maps[key]).measured for key in maps.keys() - with_map)


def test_all_files_that_cannot_be_read_are_named_at_once(tmp_path: Path) -> None:
    for name in ("a.osm.pbf", "b.osm.gz"):
        (tmp_path / name).write_bytes(b"hello")
    with pytest.raises(UserErrors) as raised:
        MapCatalog.open([tmp_path])
    assert [Path(said.partition(":")[0]).name for said in raised.value.messages] == ["a.osm.pbf", "b.osm.gz"]


# --- files that touch ------------------------------------------------------------------------------------------------
_WEST = (node(1, -200, 0), node(2, -100, 0), node(3, 40, 0), way(10, [1, 2, 3], name="Main Street"))
_EAST = (node(3, 40, 0), node(4, 150, 0), node(5, 200, 0), way(11, [3, 4, 5], name="Main Street"))
_SOUTH = (node(5, 200, 0), node(6, 200, -100), node(7, 200, -200), way(12, [5, 6, 7], name="Side Street"))


@pytest.mark.parametrize("order", [("a", "b", "c"), ("c", "b", "a"), ("b", "a", "c")])
def test_files_that_touch_are_joined_whatever_their_order(tmp_path: Path, order: tuple[str, ...]) -> None:
    for name, content in zip(order, (_WEST, _EAST, _SOUTH), strict=True):
        save(tmp_path / f"{name}.osm", *content)
    joined = found(extract(tmp_path))
    assert {each.id: each.node_ids for each in joined.ways} == {10: (1, 2, 3), 11: (3, 4, 5), 12: (5, 6, 7)}
    assert not any(each.clipped for each in joined.nodes.values())


def test_a_way_that_both_files_cut_at_the_line_between_them_is_whole(tmp_path: Path) -> None:
    """As ``osmium extract --strategy simple`` leaves it: each file lacks the nodes beyond the line."""
    nodes = {number: node(number, x, 0) for number, x in enumerate((-200, -100, 0, 100, 200, 250), 1)}
    road = way(10, [1, 2, 3, 4, 5, 6])
    save(
        tmp_path / "west.osm",
        nodes[1],
        nodes[2],
        nodes[3],
        road,
        node(8, -100, 90),
        node(9, -100, 50),
        way(7, [8, 9, 2]),
    )
    save(tmp_path / "east.osm", nodes[3], nodes[4], nodes[5], nodes[6], road, node(12, 100, 90), way(6, [12, 4]))
    joined = found(extract(tmp_path))
    assert {each.id: each.node_ids for each in joined.ways} == {10: (1, 2, 3, 4, 5, 6), 7: (8, 9, 2), 6: (12, 4)}


def test_files_of_the_same_ground_are_not_joined(tmp_path: Path) -> None:
    """The one with most road is taken alone; the other has a street that is gone."""
    save(
        tmp_path / "new.osm", *CROSSROADS, node(40, 50, 50), node(41, 60, 90), node(42, -90, 99), way(41, [40, 41, 42])
    )
    save(tmp_path / "old.osm", *CROSSROADS, node(30, 20, 20), way(31, [1, 30]))
    assert found(extract(tmp_path)).source == "new.osm"


def test_files_whose_numbers_agree_by_chance_are_not_joined(tmp_path: Path) -> None:
    save(tmp_path / "a.osm", *_WEST)
    elsewhere = (node(3, 100, 80), node(4, 150, 80), way(11, [3, 4]))
    save(tmp_path / "b.osm", *elsewhere)
    assert found(extract(tmp_path)).source == "a.osm"


def test_the_nodes_where_the_data_end_are_marked(tmp_path: Path) -> None:
    """At the border of the file, and where the file lacks the next node; not at the end of a street."""
    cut = (node(1, -200, 0), node(2, -100, 0), node(3, 40, 0), way(10, [1, 2, 3]), node(5, -100, 60), way(12, [2, 5]))
    file = save(tmp_path / "west.osm", *cut, way(11, [2, 77]), bounds_m=(-900, -900, 40, 900))
    assert {each.id for each in found(extract(file)).nodes.values() if each.clipped} == {3}
    file = save(tmp_path / "lacking.osm", *cut[:3], way(10, [1, 2, 3, 77]))
    assert {each.id for each in found(extract(file)).nodes.values() if each.clipped} == {3}
