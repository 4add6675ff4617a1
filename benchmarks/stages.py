"""Single stages beside peers in the same run: cutting maps, converting them, estimating, simulating.

Real sites (``../shared``) where they are present, else the bundled sample. Peers that are not installed (``osmium``,
CARLA's Osm2Odr, SUMO's netconvert) are left out.
"""

from __future__ import annotations

import shutil
import subprocess
import tempfile
from collections.abc import Iterator
from pathlib import Path

from benchmarks.cohorts import MAPS, SAMPLE
from benchmarks.measuring import SHARED, Figure, Work, medians, wall_s
from trace_dag.crash.completeness import check
from trace_dag.crash.parse import read_report
from trace_dag.errors import Failure, Rejection, UserError
from trace_dag.gc_pause import gc_paused
from trace_dag.geometry import LocalFrame
from trace_dag.osm.catalog import MapCatalog, box_around
from trace_dag.osm.types import OsmExtract, Site
from trace_dag.osm.xml import write_osm
from trace_dag.roads.build import build_road_map
from trace_dag.roads.from_osm.convert import convert
from trace_dag.roads.map.reader import read_opendrive
from trace_dag.roads.map.writer import write_opendrive
from trace_dag.settings import Settings
from trace_dag.states.estimate import estimate

SETTINGS = Settings()
SITES = 100
CRASHES = 12


def measure(runs: int) -> Iterator[Figure]:
    """All four, with garbage left alone as in the workers of a run."""
    with gc_paused():
        yield from _extraction(runs)
        yield from _conversion_and_estimation(runs)
        yield from _simulation(runs)


def _extraction(runs: int) -> Iterator[Figure]:
    from benchmarks.osm_extraction import bare_pass, sites_in

    file = SHARED / "osm" / "tempe-az.osm.pbf"
    file = file if file.is_file() else MAPS / "merrow.osm"
    catalog = MapCatalog.open([file])
    sites = sites_in(file, SITES)
    ours, bare = medians(runs, lambda: catalog.extract(sites, SETTINGS.osm), lambda: bare_pass(file), clock=wall_s)
    yield Figure(f"cutting {SITES} sites out of {file.name}", ours, "s", "bare pyosmium pass", bare)
    osmium = shutil.which("osmium")
    if osmium is None:
        return
    box = box_around(sites[0], SETTINGS.osm.radius_m)
    edges = f"{box.west_deg},{box.south_deg},{box.east_deg},{box.north_deg}"
    with tempfile.TemporaryDirectory() as folder:
        command = [osmium, "extract", "-b", edges, "-o", f"{folder}/out.osm", "--overwrite", str(file)]
        one, theirs = medians(
            runs,
            lambda: catalog.extract(sites[:1], SETTINGS.osm),
            lambda: subprocess.run(command, check=True, capture_output=True),
            clock=wall_s,
        )
    yield Figure(f"cutting one site out of {file.name}", one, "s", "osmium extract", theirs)


def _conversion_and_estimation(runs: int) -> Iterator[Figure]:
    records = {}
    for path in sorted((SAMPLE / "reports").glob("*.xml")):
        try:
            record = read_report(path.read_bytes(), name=path.name, settings=SETTINGS.crash)
            check(record, SETTINGS.crash)
        except Rejection:
            continue
        records[record.key] = record
    sites = [Site(key, record.latitude_deg, record.longitude_deg) for key, record in records.items()]
    centres = {site.key: LocalFrame(site.latitude_deg, site.longitude_deg) for site in sites}
    extracts: dict[str, OsmExtract] = {}
    built = {}
    for key, extract in MapCatalog.open([MAPS]).extract(sites, SETTINGS.osm).items():
        try:
            if isinstance(extract, OsmExtract) and len(built) < CRASHES:
                built[key] = build_road_map(extract, records[key], SETTINGS.roads)
                extracts[key] = extract
        except Rejection:
            continue

    def convert_ours() -> None:
        for key, extract in extracts.items():
            write_opendrive(convert(extract, centres[key], SETTINGS.roads))

    per_map = 1e3 / len(extracts)
    for name, peer in _converters(extracts, centres):
        try:
            ours, theirs = medians(runs, convert_ours, peer)
        except (Failure, UserError, Rejection, subprocess.CalledProcessError):
            continue
        yield Figure(
            "converting a map", ours * per_map, "CPU ms", f"{name}, its process included", theirs * per_map, 60.0
        )
    maps = {key: write_opendrive(each.network) for key, each in built.items()}

    def read_back() -> None:
        for key, xodr in maps.items():
            read_opendrive(xodr, name=key)

    def estimate_all() -> None:
        for key, xodr in maps.items():
            estimate(records[key], read_opendrive(xodr, name=key), built[key].report, SETTINGS.states)

    both, reading = medians(runs, estimate_all, read_back)
    yield Figure(
        "estimating a crash", (both - reading) * per_map, "CPU ms", "reading its map", reading * per_map, 100.0
    )


def _converters(extracts: dict[str, OsmExtract], frames: dict[str, LocalFrame]) -> Iterator[tuple[str, Work]]:
    from trace_dag.roads.from_osm.osm2odr import convert_with_osm2odr

    yield "Osm2Odr", lambda: [convert_with_osm2odr(extract, frames[key]) for key, extract in extracts.items()]
    netconvert = shutil.which("netconvert") or _in_judges("netconvert")
    if netconvert is None:
        return
    with tempfile.TemporaryDirectory() as folder:
        files = []
        for key, extract in extracts.items():
            files.append(Path(folder) / f"{key}.osm")
            files[-1].write_bytes(write_osm(extract))

        def convert_all() -> None:
            for file in files:
                command = [netconvert, "--osm-files", str(file), "--opendrive-output", str(file.with_suffix(".xodr"))]
                subprocess.run(command, check=True, capture_output=True)

        yield "netconvert", convert_all


def _in_judges(name: str) -> str | None:
    found = Path(__file__).resolve().parents[1] / ".venv-judges" / "bin" / name
    return str(found) if found.is_file() else None


def _simulation(runs: int) -> Iterator[Figure]:
    from benchmarks import simulation

    backend = simulation.EmbeddedSimulation(simulation.SimSettings(), simulation.Surface(), 0.75)
    for name, (participants, objects) in simulation.CRASHES.items():
        simulated_s = backend.run(participants, time_limit_s=20.0, objects=objects).duration_s

        def run(participants: object = participants, objects: object = objects) -> None:
            simulation.logs_to_files([backend.run(participants, time_limit_s=20.0, objects=objects)])

        [taken] = medians(max(runs, 5), run)
        goal = 1 / 150 if any(p.body.is_figure for p in participants) else 1 / 100 if len(participants) > 2 else 1 / 200
        yield Figure(f"simulating: {name}", taken, "CPU s", "real time", simulated_s, goal, goal_of_ratio=True)
