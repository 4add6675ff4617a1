"""Converters from OpenStreetMap side by side: ours, SUMO's netconvert, CARLA's Osm2Odr, CommonRoad's designer.

    TRACE_DAG_JUDGES=.venv-judges python -m lab map_converters ../shared/data/osm [--radius 400]

Around the middle of the roads of each extract every converter gets the same data. Prints one table: the number of maps,
the distance of ways from the axes of their roads outside junctions, roads with the tagged lanes, and errors of ASAM's
checker at version 1.7. It also has the number of maps that CARLA's library and netconvert read, and the CPU time of a
map with its process. CommonRoad's designer makes lanelets: its ways are measured to the nearest border or middle of
one, a way farther than 5 m from all counts as missing, and OpenDRIVE's checker and readers do not apply.
"""

from __future__ import annotations

import argparse
import contextlib
import json
import math
import resource
import subprocess
import sys
import tempfile
from collections.abc import Callable, Iterator
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np
import osmium
import shapely

sys.path.insert(0, str(Path(__file__).resolve().parents[1]))

from tests.roads import judges
from trace_dag.carla.osm2odr import add_way_tags, run_osm2odr
from trace_dag.common.errors import Failure, Rejection, UserError
from trace_dag.common.geometry import LocalFrame
from trace_dag.common.settings import OsmSettings, RoadSettings
from trace_dag.osm.catalog import MapCatalog, box_around
from trace_dag.osm.types import OsmExtract, Site
from trace_dag.osm.xml import write_osm
from trace_dag.roads.build import build_plain_map
from trace_dag.roads.from_osm.way_direction import along_traffic
from trace_dag.roads.gates.against_osm import MapComparison
from trace_dag.roads.map.network import RoadNetwork
from trace_dag.roads.map.reader import read_opendrive

_DESIGNER = "commonroad-scenario-designer==0.8.5"
_LANELETS = """
import json, logging, sys
logging.disable(logging.CRITICAL)
from crdesigner.map_conversion.map_conversion_interface import osm_to_commonroad
found = osm_to_commonroad(sys.argv[1]).lanelet_network.lanelets
lines = [line.tolist() for each in found for line in (each.left_vertices, each.right_vertices, each.center_vertices)]
print("LANELETS" + json.dumps(lines))
"""
_TIME_LIMIT_S = 300.0
_NO_ROAD_M = 5.0  # a way of which most is farther from every lanelet has none
_TROUBLE = (Failure, Rejection, UserError, subprocess.SubprocessError, OSError, ValueError)


@dataclass
class Row:
    """Results of one converter, over all places."""

    tried: int = 0
    times_s: list[float] = field(default_factory=list)
    deviations_m: list[tuple[float, float]] = field(default_factory=list)  # mean, and over how many metres
    worst_m: float = 0.0
    missing: int = 0  # ways outside junctions on which no road lies
    lanes: tuple[int, int] = (0, 0)  # roads compared, and those that differ
    files: list[Path] = field(default_factory=list)

    def measure(self, network: RoadNetwork, extract: OsmExtract) -> None:
        """Add what a map's ways and lanes say."""
        comparison = MapComparison(network, extract)
        deviation = comparison.way_deviation()
        self.deviations_m.append((deviation.mean_m, deviation.length_m))
        self.worst_m = max(self.worst_m, deviation.worst_public_m)
        self.missing += len(deviation.missing_way_ids)
        compared, differing = comparison.lanes_against_tags()
        self.lanes = self.lanes[0] + compared, self.lanes[1] + len(differing)


def _cpu_s() -> float:
    """Return the CPU time of this process and of those that it has waited for: load beside it does not count."""
    used = [resource.getrusage(of) for of in (resource.RUSAGE_SELF, resource.RUSAGE_CHILDREN)]
    return math.fsum(each.ru_utime + each.ru_stime for each in used)


def places(folder: Path, radius_m: float) -> Iterator[tuple[str, OsmExtract, LocalFrame]]:
    """Yield an extract around the node that is in the middle of the public roads of each file."""
    for path in sorted(folder.glob("*.pbf")):
        nodes = [
            (node.lat, node.lon)
            for way in osmium.FileProcessor(str(path)).with_locations().with_filter(osmium.filter.KeyFilter("highway"))
            if way.is_way() and way.tags["highway"] in ("residential", "secondary", "tertiary", "primary")
            for node in list(way.nodes)[:1]
            if node.location.valid()
        ]
        middle = np.median(nodes, axis=0)
        at = min(nodes, key=lambda node: float(np.hypot(*(np.array(node) - middle))))
        extract = MapCatalog.open([path]).extract_box(
            box_around(Site("", *at), radius_m), OsmSettings(), surroundings=False
        )
        yield path.name.split(".")[0], along_traffic(extract), LocalFrame(*at)


def ours(extract: OsmExtract, frame: LocalFrame, folder: Path) -> bytes:
    """Return ours, gates included."""
    return build_plain_map(extract, frame, RoadSettings(), name="map", left_hand=False).stored.xodr


def netconvert(extract: OsmExtract, frame: LocalFrame, folder: Path) -> bytes:
    """Return sUMO's, with its defaults but for the projection."""
    source, target = folder / "net.osm", folder / "net.xodr"
    source.write_bytes(write_osm(extract))
    target.unlink(missing_ok=True)
    command = [judges.judges_environment() / "netconvert", "--osm-files", source, "--opendrive-output", target]
    command += ["--proj", frame.proj, "--offset.disable-normalization", "true"]
    subprocess.run(command, check=True, capture_output=True, timeout=_TIME_LIMIT_S)
    data = target.read_bytes()
    if b"lat_0" not in data:
        data = data.replace(b"</header>", f"<geoReference>{frame.proj}</geoReference></header>".encode(), 1)
    return data


def osm2odr(extract: OsmExtract, frame: LocalFrame, folder: Path) -> bytes:
    """Return cARLA's, in a process of its own."""
    return run_osm2odr(write_osm(extract), frame)


def lanelets(row: Row, extract: OsmExtract, frame: LocalFrame, folder: Path) -> None:
    """Run CommonRoad's designer, in an environment of its own; its lanelets are in the Mercator projection of the
    web."""
    from pyproj import Transformer

    source = folder / "designer.osm"
    source.write_bytes(write_osm(extract))
    command = ["uv", "run", "--quiet", "--isolated", "--no-project", "--python", sys.executable, "--with", _DESIGNER]
    start = _cpu_s()
    done = subprocess.run(
        [*command, "python", "-c", _LANELETS, source], capture_output=True, text=True, check=True, timeout=_TIME_LIMIT_S
    )
    row.times_s.append(_cpu_s() - start)
    lines = json.loads(done.stdout.partition("LANELETS")[2])
    to_degrees = Transformer.from_crs(3857, 4326, always_xy=True)
    local = []
    for line in lines:
        longitudes, latitudes = to_degrees.transform(*np.array(line)[:, :2].T)
        local.append(shapely.LineString(frame.to_local(np.array(latitudes), np.array(longitudes))))
    tree = shapely.STRtree(local)
    comparison = MapComparison(RoadNetwork(frame, ()), extract)
    for way in comparison.ways:
        line = shapely.LineString(comparison.way_line(way))
        points = [line.interpolate(metre) for metre in np.arange(0.0, line.length, 5.0)]
        distances = shapely.distance(points, np.array(local, dtype=object)[tree.nearest(points)])
        if np.median(distances) > _NO_ROAD_M:
            row.missing += 1
            continue
        row.deviations_m.append((float(distances.mean()), 5.0 * len(points)))
        row.worst_m = max(row.worst_m, float(distances.max()))


CONVERTERS: dict[str, Callable[[OsmExtract, LocalFrame, Path], bytes]] = {
    "trace-dag": ours,
    "netconvert": netconvert,
    "Osm2Odr": osm2odr,
}


def convert(row: Row, name: str, place: str, extract: OsmExtract, frame: LocalFrame, folder: Path) -> None:
    """Convert one place and measure the map."""
    row.tried += 1
    try:
        if name == "CommonRoad designer":
            lanelets(row, extract, frame, folder)
            return
        start = _cpu_s()
        xodr = CONVERTERS[name](extract, frame, folder)
        row.times_s.append(_cpu_s() - start)
        network = read_opendrive(xodr, name=name)
        row.measure(network if name == "trace-dag" else add_way_tags(network, extract), extract)
    except _TROUBLE as error:
        print(f"{name}, {place}: {type(error).__name__}: {str(error)[:200]}", file=sys.stderr)
        return
    row.files.append(folder / f"{name}-{place}.xodr")
    row.files[-1].write_bytes(xodr)


def read_by(row: Row, folder: Path) -> tuple[str, str, str]:
    """Return errors of ASAM's checker, and how many maps CARLA's library and netconvert read."""
    if not row.files:
        return "", "", ""
    verdicts = judges.official_check(row.files)
    errors = sum(" WARNING" not in issue for each in verdicts for issue in [*each["issues"], *each["broken"]])
    carla = sumo = 0
    for file in row.files:
        with contextlib.suppress(RuntimeError):
            carla += len(judges.carla_map(file.read_bytes()).generate_waypoints(10.0)) > 0
        command = [judges.judges_environment() / "netconvert", "--opendrive-files", file]
        done = subprocess.run([*command, "-o", folder / "read.net.xml"], capture_output=True, check=False)
        sumo += done.returncode == 0
    return str(errors), f"{carla} of {len(row.files)}", f"{sumo} of {len(row.files)}"


def main() -> int:
    """Print the table."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("folder", type=Path, help="with extracts (.pbf)")
    parser.add_argument("--radius", type=float, default=400.0, help="around each place, metres (default 400)")
    options = parser.parse_args()
    rows = {name: Row() for name in (*CONVERTERS, "CommonRoad designer")}
    names = ("converter", "maps", "ways, mean m", "worst m", "missing", "lanes tagged", "ASAM errors")
    print(f"| {' | '.join((*names, 'carla', 'netconvert', 'CPU s'))} |")
    print("|---|---|---:|---:|---:|---|---:|---|---|---:|", flush=True)
    with tempfile.TemporaryDirectory() as temporary:
        folder = Path(temporary)
        found = list(places(options.folder, options.radius))
        for name, row in rows.items():
            for place, extract, frame in found:
                convert(row, name, place, extract, frame, folder)
            length_m = sum(length for _, length in row.deviations_m)
            mean_m = sum(mean * length for mean, length in row.deviations_m) / length_m if length_m else float("nan")
            errors, carla, sumo = read_by(row, folder)
            compared, differing = row.lanes
            lanes = f"{compared - differing} of {compared}" if compared else ""
            seconds = f"{np.median(row.times_s):.2f}" if row.times_s else ""
            missing = str(row.missing) if row.times_s else ""
            cells = (name, f"{len(row.times_s)} of {row.tried}", f"{mean_m:.3f}", f"{row.worst_m:.2f}", missing, lanes)
            print(f"| {' | '.join((*cells, errors, carla, sumo, seconds))} |", flush=True)
    return 0


if __name__ == "__main__":
    sys.exit(main())
