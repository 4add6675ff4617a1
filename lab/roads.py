"""Road maps before every gate and judge: Virginia sites, FARS crash sites, and places drawn at random.

    TRACE_DAG_JUDGES=.venv-judges python -m lab roads ../shared/data [--random 200] [--every 1]

Converts every site and measures it: time, gates (loading in CARLA's library is one), deviation from the OSM ways, the
tightest turn and the shortest element, ASAM's checker at version 1.7, lanes as SUMO's netconvert reads them back. Some
are walked in CARLA's library in steps of 1 m. Without the judges' environment or the ``carla`` extra, what they would
have said is left out. ``lab/map_converters.py`` sets other converters beside ours.
"""

from __future__ import annotations

import argparse
import csv
import math
import os
import random
import re
import sys
import tempfile
import time
from collections import Counter
from collections.abc import Callable, Mapping, Sequence
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path
from typing import TypeVar

import numpy as np
import osmium
import pytest

sys.path.insert(0, str(Path(__file__).resolve().parents[1]))

from tests.roads import judges
from trace_dag.common.errors import Rejection
from trace_dag.common.geometry import LocalFrame
from trace_dag.common.settings import OsmSettings, RoadSettings
from trace_dag.osm.catalog import MapCatalog
from trace_dag.osm.types import OsmExtract, Site
from trace_dag.osm.xml import read_osm
from trace_dag.roads.from_osm.convert import convert
from trace_dag.roads.from_osm.way_direction import along_traffic
from trace_dag.roads.gates.against_osm import MapComparison
from trace_dag.roads.gates.gates import check_map
from trace_dag.roads.map.model import Road
from trace_dag.roads.map.network import RoadNetwork
from trace_dag.roads.map.rules import StoredMap
from trace_dag.roads.map.writer import write_opendrive

Result = TypeVar("Result")
Places = dict[str, tuple[OsmExtract, LocalFrame]]
_LEAST_OF = ("turn_radius", "u_turn_radius", "shortest_element")  # gates


def virginia(data: Path) -> Places:
    """Return the published sites, each in the frame of its published map."""
    found = {}
    for path in sorted((data / "va-2023" / "osm").glob("*.osm")):
        published = (data / "va-2023" / "published" / "maps" / f"{path.stem}.xodr").read_text(errors="replace")
        lat, lon = (float(re.search(rf"\+{key}=(-?[\d.]+)", published)[1]) for key in ("lat_0", "lon_0"))  # type: ignore[index]
        found[path.stem] = (along_traffic(read_osm(path.read_bytes(), name=path.name)), LocalFrame(lat, lon))
    return found


def fars_sites(data: Path) -> list[Site]:
    """Return the reported points of the FARS crashes with two vehicles."""
    sites = []
    for path in sorted((data / "fars-csv").glob("*/accident.csv")):
        with path.open(encoding="latin-1", newline="") as file:
            for row in csv.DictReader(file):
                values = {key.upper(): value for key, value in row.items()}
                if values.get("VE_TOTAL", values.get("VE_FORMS")) == "2":
                    key = f"{path.parent.name}-{values['ST_CASE']}"
                    sites.append(Site(key, float(values["LATITUDE"]), float(values["LONGITUD"])))
    return sites


def random_sites(data: Path, count: int) -> list[Site]:
    """Return nodes of public roads, equally many out of each extract, always the same ones."""
    draw = random.Random(20261121)
    files = sorted((data / "osm").glob("*.pbf"))
    sites = []
    for number, path in enumerate(files):
        nodes = []
        for way in osmium.FileProcessor(str(path)).with_locations().with_filter(osmium.filter.KeyFilter("highway")):
            if way.is_way() and way.tags["highway"] not in ("service", "footway", "path", "cycleway", "track", "steps"):
                nodes += [(node.lat, node.lon) for node in way.nodes if node.location.valid()][:1]
        share = count * (number + 1) // len(files) - count * number // len(files)
        name = path.name.split(".")[0]
        sites += [Site(f"{name}-{i}", *place) for i, place in enumerate(draw.sample(nodes, min(share, len(nodes))))]
    return sites


def cut(data: Path, sites: list[Site]) -> Places:
    """Return extracts of the sites that have any road."""
    extracts = MapCatalog.open([data / "osm"]).extract(sites, OsmSettings())
    return {
        site.key: (along_traffic(extract), LocalFrame(site.latitude_deg, site.longitude_deg))
        for site in sites
        if isinstance(extract := extracts[site.key], OsmExtract)
    }


def measure_ours(places: Places, folder: Path, walk_every: int) -> None:
    """Measure the native converter's maps: their gates, then the judges of all of them."""
    files = convert_all(places, folder)
    walk(list(files)[::walk_every])
    ask_asam(list(files))
    ask_sumo(files, folder)


def convert_all(places: Places, folder: Path) -> dict[Path, RoadNetwork]:
    """Convert the sites, measure the maps, and write them down."""
    times_s, deviations = [], []
    failed: Counter[str] = Counter()
    lanes_compared = lanes_differing = loaded = returning = 0
    least = dict.fromkeys(_LEAST_OF, math.inf)
    files: dict[Path, RoadNetwork] = {}
    for key, (extract, frame) in places.items():
        start = time.thread_time()
        try:
            network = convert(extract, frame, RoadSettings())
        except Rejection as rejection:
            failed["conversion"] += 1
            print(f"  {key}: {rejection}")
            continue
        times_s.append(time.thread_time() - start)
        xodr = write_opendrive(network)
        for gate in check_map(network, extract, StoredMap(xodr, name=key)):
            loaded += gate.name == "carla_map" and gate.passed is True
            if gate.name in least and gate.value is not None:
                least[gate.name] = min(least[gate.name], gate.value)
            if gate.passed is False:
                failed[gate.name] += 1
                print(f"  {key}: {gate.name} {gate.value} {gate.unit} ({gate.detail[:100]})")
        comparison = MapComparison(network, extract)
        deviations.append(comparison.way_deviation())
        compared, differing = comparison.lanes_against_tags()
        lanes_compared, lanes_differing = lanes_compared + compared, lanes_differing + differing
        returning += sum(map(_returns, network.roads))
        path = folder / f"{key}.xodr"
        path.write_bytes(xodr)
        files[path] = network
    length = sum(d.length_m for d in deviations)
    print(f"converted {len(times_s)} of {len(places)}, {1e3 * np.mean(times_s):.0f} ms of CPU on average")
    print(f"gates that do not hold: {dict(failed) or 'none'}")
    print(
        f"OSM centre lines: mean {sum(d.mean_m * d.length_m for d in deviations) / length:.3f} m, "
        f"{sum(d.share_within_1m * d.length_m for d in deviations) / length:.2%} within 1 m, worst public way "
        f"{max(d.worst_public_m for d in deviations):.2f} m, over {length / 1e3:.0f} km outside junctions"
    )
    print(f"lane counts: {lanes_compared - lanes_differing} of {lanes_compared} tagged roads as tagged")
    print(f"carla.Map: {loaded} of {len(files)} load with lanes to drive on")
    print("least of all maps: " + ", ".join(f"{name.replace('_', ' ')} {value:.4g} m" for name, value in least.items()))
    print(f"roads that begin and end at one junction: {returning}")
    return files


def _returns(road: Road) -> bool:
    """Return whether a road begins and ends at the same junction, so that a connection's incoming road has two ends
    there.
    """
    before, after = road.predecessor, road.successor
    return before is not None and before == after and before.element_type == "junction"


def walk(files: Sequence[Path]) -> None:
    """Walk in steps of 1 m along every lane in CARLA's library."""
    steps = []
    for path in files:
        step = judged(lambda path=path: judges.carla_steps(judges.carla_map(path.read_bytes())).distances_m)
        if step is None:
            return
        if len(step) and step.max() > 2.0:
            print(f"  {path.stem}: a step of {step.max():.2f} m in carla.Map")
        steps.append(step)
    every = np.concatenate(steps)
    inside = np.mean((every >= 0.8) & (every <= 1.25))
    print(
        f"carla.Map: {len(steps)} walked, {len(every)} steps of 1 m, {inside:.3%} in 0.8 to 1.25 m, "
        f"longest {every.max():.2f} m"
    )


def ask_asam(files: Sequence[Path]) -> None:
    """Return the findings of ASAM's checker, and the number of its rules that ran."""
    verdicts = judged(lambda: judges.official_check(files))
    if verdicts is None:
        return
    rules = Counter(len(verdict["rules"]) for verdict in verdicts)
    wrong = [verdict for verdict in verdicts if verdict["broken"] or any(_is_error(i) for i in verdict["issues"])]
    print(
        f"ASAM checker at 1.7: {len(verdicts) - len(wrong)} of {len(verdicts)} without error; "
        f"maps by number of rules run: {dict(rules)}, broken off: {sum(len(v['broken']) for v in verdicts)}"
    )
    for verdict in wrong:
        errors = [*verdict["broken"], *filter(_is_error, verdict["issues"])]
        print(f"  {Path(verdict['file']).stem}: {len(errors)}, such as {errors[0][:150]}")


def _is_error(issue: str) -> bool:
    return " WARNING" not in issue


def ask_sumo(files: Mapping[Path, RoadNetwork], folder: Path) -> None:
    """Return whether netconvert reads the same lanes back."""
    with ThreadPoolExecutor(os.cpu_count()) as pool:
        answers = list(pool.map(lambda path: judged(lambda: judges.sumo_lanes(path, folder)), files))
    if None in answers:
        return
    differing = [path for path, lanes in zip(files, answers, strict=True) if lanes != judges.our_lanes(files[path])]
    print(f"netconvert: {len(files) - len(differing)} of {len(files)} re-imported with the same lanes in every road")
    for path in differing:
        print(f"  {path.stem}: netconvert reads other lanes")


def judged(judge: Callable[[], Result]) -> Result | None:
    """Return a judge's findings, or nothing where it is not installed."""
    try:
        return judge()
    except pytest.skip.Exception:
        return None


def main() -> int:
    """Measure the three cohorts one after the other."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("data", type=Path)
    parser.add_argument("--random", type=int, default=200, help="sites drawn at random (default 200)")
    parser.add_argument("--every", type=int, default=1, help="measure every n-th site only")
    parser.add_argument("--walk", type=int, default=1, help="every n-th measured site walked in carla.Map")
    arguments = parser.parse_args()
    data: Path = arguments.data
    cohorts = {
        "Virginia": virginia(data),
        "FARS, two vehicles": cut(data, fars_sites(data)),
        "random": cut(data, random_sites(data, arguments.random)),
    }
    for name, places in cohorts.items():
        chosen = dict(list(places.items())[:: arguments.every])
        print(f"\n{name}: {len(chosen)} sites")
        with tempfile.TemporaryDirectory() as folder:
            measure_ours(chosen, Path(folder), arguments.walk)
    return 0


if __name__ == "__main__":
    sys.exit(main())
