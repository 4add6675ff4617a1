"""Our maps before independent judges: CARLA's library, ASAM's official checker at version 1.7, SUMO's netconvert.

Over the sample's towns, Virginia sites, and FARS crash sites drawn at random.
"""

from __future__ import annotations

import csv
import json
import random
from collections.abc import Iterator
from pathlib import Path

import numpy as np
import pytest

from tests.roads import judges
from trace_dag.common.errors import Rejection
from trace_dag.common.geometry import LocalFrame
from trace_dag.common.settings import OsmSettings, RoadSettings
from trace_dag.osm.catalog import MapCatalog
from trace_dag.osm.types import OsmExtract, Site
from trace_dag.roads.from_osm.convert import convert
from trace_dag.roads.map.network import RoadNetwork
from trace_dag.roads.map.reader import read_opendrive
from trace_dag.roads.map.writer import write_opendrive

_SAMPLE = Path(__file__).resolve().parents[2] / "data" / "sample"
_SAMPLE_SITES = 8
_REAL_SITES = 6  # of each kind; lab/roads.py goes over all of them
_RULES_RUN_AT_1_7 = 22  # of the checker's 23; below 1.7 most are skipped

Maps = dict[str, tuple[RoadNetwork, Path]]


def _convert_all(catalog: MapCatalog, sites: list[Site], folder: Path) -> Maps:
    found = {}
    for key, extract in catalog.extract(sites, OsmSettings()).items():
        assert isinstance(extract, OsmExtract), (key, extract)
        site = next(site for site in sites if site.key == key)
        network = convert(extract, LocalFrame(site.latitude_deg, site.longitude_deg), RoadSettings())
        path = folder / f"{key}.xodr"
        path.write_bytes(write_opendrive(network))
        found[key] = (network, path)
    return found


@pytest.fixture(scope="module")
def sample_maps(tmp_path_factory: pytest.TempPathFactory) -> Maps:
    rows = json.loads((_SAMPLE / "truth.json").read_text())["crashes"]
    rows = [row for row in rows if "latitude_deg" in row]
    chosen = rows[:: max(1, len(rows) // _SAMPLE_SITES)]
    sites = [Site(row["key"], row["latitude_deg"], row["longitude_deg"]) for row in chosen]
    catalog = MapCatalog.open(sorted((_SAMPLE / "osm").glob("*.osm")))
    return _convert_all(catalog, sites, tmp_path_factory.mktemp("sample"))


@pytest.fixture(scope="module")
def real_maps(shared_data: Path, tmp_path_factory: pytest.TempPathFactory) -> Maps:
    folder = tmp_path_factory.mktemp("real")
    virginia = sorted((shared_data / "va-2023" / "osm").glob("*.osm"))[::_REAL_SITES]
    sites = []
    for path in virginia:
        published = shared_data / "va-2023" / "published" / "maps" / path.with_suffix(".xodr").name
        frame = read_opendrive(published.read_bytes(), name=published.name).frame
        sites.append(Site(path.stem, frame.latitude_deg, frame.longitude_deg))
    found = _convert_all(MapCatalog.open(virginia), sites, folder)
    catalog = MapCatalog.open([shared_data / "osm"])
    crashes = random.Random(3).sample(list(_fars_sites(shared_data)), 3 * _REAL_SITES)
    covered = catalog.extract(crashes, OsmSettings())
    near_roads = [site for site in crashes if not isinstance(covered[site.key], Rejection)]
    return found | _convert_all(catalog, near_roads, folder)


def _fars_sites(shared_data: Path) -> Iterator[Site]:
    for path in sorted((shared_data / "fars-csv").glob("*/accident.csv")):
        with path.open(encoding="latin-1", newline="") as file:
            for row in csv.DictReader(file):
                values = {key.upper(): value for key, value in row.items()}
                key = f"{path.parent.name}-{values['ST_CASE']}"
                yield Site(key, float(values["LATITUDE"]), float(values["LONGITUD"]))


@pytest.mark.parametrize("which", ["sample_maps", "real_maps"])
def test_carla_drives_on_without_jumps(which: str, request: pytest.FixtureRequest) -> None:
    """Steps of 1 m along the reference line; on the outside of a bend they are longer, on the inside shorter.

    The sites chosen here have more tight bends than all together, of which lab/roads.py measures the share.
    """
    maps: Maps = request.getfixturevalue(which)
    distances = []
    for key, (_, path) in maps.items():
        steps = judges.carla_steps(judges.carla_map(path.read_bytes())).distances_m
        assert len(steps), key
        assert steps.max() < 2.0, key
        distances.append(steps)
    every = np.concatenate(distances)
    assert np.mean((every >= 0.8) & (every <= 1.25)) > 0.997


@pytest.mark.parametrize("which", ["sample_maps", "real_maps"])
def test_carla_has_every_lane_where_we_have_it(which: str, request: pytest.FixtureRequest) -> None:
    maps: Maps = request.getfixturevalue(which)
    for key, (network, path) in maps.items():
        # CARLA computes in single precision.
        assert judges.distance_from_carla(network, judges.carla_map(path.read_bytes())).max() < 5e-3, key


def test_our_reader_sees_the_published_maps_as_carla_does(shared_data: Path) -> None:
    """Cubics and lane offsets of another converter; CARLA follows cubics by its own approximation of arc length."""
    distances = []
    for path in sorted((shared_data / "va-2023" / "published" / "maps").glob("*.xodr")):
        data = path.read_bytes()
        network = read_opendrive(data, name=path.name)
        distances.append(judges.distance_from_carla(network, judges.carla_map(data)))
    every = np.concatenate(distances)
    assert np.percentile(every, 99) < 0.05
    assert every.max() < 0.5


@pytest.mark.parametrize("which", ["sample_maps", "real_maps"])
def test_the_official_checker_finds_nothing(which: str, request: pytest.FixtureRequest) -> None:
    judges.judges_environment()
    maps: Maps = request.getfixturevalue(which)
    for verdict in judges.official_check([path for _, path in maps.values()]):
        assert len(verdict["rules"]) == _RULES_RUN_AT_1_7, (verdict["skipped"], verdict["broken"])
        errors = [issue for issue in verdict["issues"] if " WARNING" not in issue]
        assert not errors, (verdict["file"], errors[:3])


@pytest.mark.parametrize("which", ["sample_maps", "real_maps"])
def test_sumo_reads_the_same_lanes(which: str, request: pytest.FixtureRequest, tmp_path: Path) -> None:
    judges.judges_environment()
    maps: Maps = request.getfixturevalue(which)
    for network, path in maps.values():
        assert judges.sumo_lanes(path, tmp_path) == judges.our_lanes(network), path.stem
