"""Cutting the sites of a state or a country out of one large file: memory, and time beside a bare pass.

    python -m benchmarks.big_map                                1.1 GB made of the shared extracts, 3,000 sites
    python -m benchmarks.big_map --bytes 200000000 --sites 500  less
    python -m benchmarks.big_map --bytes 2400000000 --sites 36000 --last-id 12000000000  towards a country

The file is made in the temporary folder (TMPDIR) by :mod:`benchmarks.multiplied_map` and deleted in the end. The bare
pass reads it, locates the nodes of its ways and filters by ``highway``, as osmium does it. The first reading is that of
``ingest``, which finds the long ways; then a run cuts the pieces around all sites, and its workers make extracts of
them. Each runs in a process of its own, whose memory is looked at every half second:
what belongs to the process alone, and with the pages of files that the system may take back at any time.
"""

from __future__ import annotations

import argparse
import multiprocessing
import os
import random
import resource
import sys
import tempfile
import threading
import time
from collections.abc import Callable, Sequence
from pathlib import Path

from benchmarks.measuring import SHARED, Figure, exit_code
from benchmarks.multiplied_map import multiply_map
from benchmarks.osm_extraction import bare_pass
from benchmarks.results import keep
from trace_dag.osm.catalog import MapCatalog, MapFile, box_around
from trace_dag.osm.dividing import divide
from trace_dag.osm.extraction import read_header
from trace_dag.osm.first_look import first_look
from trace_dag.osm.large_map import FOLDER, Around, LargeMap
from trace_dag.osm.surroundings import surroundings_to_geojson
from trace_dag.osm.types import OsmExtract, Site
from trace_dag.osm.xml import write_osm
from trace_dag.settings import ExecutionSettings, OsmSettings
from trace_dag.storage import Storage

_DIGEST = "0" * 64  # nothing asks here what the file holds
_SETTINGS = OsmSettings()
_GOAL_MB, _GOAL_TIMES = 4096.0, 1.5
_LOOK_EVERY_S = 0.5
_LOCATED_IN_MEMORY = 2 * 10**9  # bytes of a map file; its nodes take up to three times as many


def measured(work: Callable[..., str], *arguments: object) -> tuple[float, float, float, float]:
    """CPU and wall seconds of some work in a process of its own, and the most memory it held: own, and with files."""
    with multiprocessing.get_context("spawn").Pool(1) as pool:
        return pool.apply(_measured, (work, arguments))


def _measured(work: Callable[..., str], arguments: Sequence[object]) -> tuple[float, float, float, float]:
    most = [0.0, 0.0]
    done = threading.Event()

    def look() -> None:
        while not done.wait(_LOOK_EVERY_S):
            status = dict(line.split(":", 1) for line in Path("/proc/self/status").read_text().splitlines())
            own_mb, all_mb = (float(status[name].split()[0]) / 1024 for name in ("RssAnon", "VmRSS"))
            most[:] = max(most[0], own_mb), max(most[1], all_mb)

    looking = threading.Thread(target=look)
    looking.start()
    began_s, used = time.perf_counter(), resource.getrusage(resource.RUSAGE_SELF)
    said = work(*arguments)
    wall_s, after = time.perf_counter() - began_s, resource.getrusage(resource.RUSAGE_SELF)
    done.set()
    looking.join()
    cpu_s = after.ru_utime + after.ru_stime - used.ru_utime - used.ru_stime
    print(f"{work.__name__}: {said}{cpu_s:.0f} CPU s, {wall_s:.0f} s, {most[0]:.0f} MB, {most[1]:.0f} MB", flush=True)
    return cpu_s, wall_s, most[0], most[1]


def bare(file: Path) -> str:
    """Read, locate, filter, do nothing. The nodes of a country find no room in memory."""
    if file.stat().st_size < _LOCATED_IN_MEMORY:
        bare_pass(file)
        return ""
    with tempfile.TemporaryDirectory(dir=file.parent) as folder:
        bare_pass(file, f"sparse_file_array,{folder}/locations")
    return "located in a file; "


def first_reading(file: Path, folder: Path) -> str:
    """What ``ingest`` does with a new file."""
    first_look(LargeMap(file, read_header(file), _DIGEST, Storage(folder)))
    return ""


def pieces(file: Path, folder: Path, sites: Sequence[Site]) -> str:
    """The one pass of a run: the pieces around all sites."""
    around = [
        Around(
            site.key,
            box_around(site, _SETTINGS.radius_m),
            box_around(site, _SETTINGS.surroundings_radius_m),
        )
        for site in sites
    ]
    divide(LargeMap(file, read_header(file), _DIGEST, Storage(folder)), around, service_roads=True)
    names = Storage(folder).list(FOLDER)
    return f"{len(names)} files, {sum(entry.size for entry in names.values()) / 1e6:.0f} MB; "


def extracts(file: Path, folder: Path, sites: Sequence[Site]) -> str:
    """What workers then do: the extracts, some at a time, as they are stored."""
    catalog = MapCatalog((MapFile(file, read_header(file), _DIGEST),), storage=Storage(folder))
    found, chunk = 0, ExecutionSettings().chunk_size
    for start in range(0, len(sites), chunk):
        for answer in catalog.extract(sites[start : start + chunk], _SETTINGS).values():
            if isinstance(answer, OsmExtract):
                write_osm(answer)
                surroundings_to_geojson(answer.surroundings, answer.attribution)
                found += 1
    return f"{found} of {len(sites)} sites have roads; "


def main() -> int:
    """Exit code 1 if a goal is missed."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--bytes", type=int, default=1_100_000_000)
    parser.add_argument("--sites", type=int, default=3_000)
    parser.add_argument("--last-id", type=int, default=0, help="spread the ids up to here: 12000000000 for a country")
    parser.add_argument("--no-keep", action="store_true", help="print only")
    options = parser.parse_args()
    with tempfile.TemporaryDirectory() as folder:
        file, root = Path(folder) / "multiplied.osm.pbf", Path(folder) / "root"
        extracts_shared = sorted((SHARED / "osm").glob("*.osm.pbf"))
        places = multiply_map(extracts_shared, file, options.bytes, options.last_id)
        size_mb = file.stat().st_size / 1e6
        print(f"{size_mb:.0f} MB of {len(places)} copies", flush=True)
        draw = random.Random(1)
        sites = []
        for number in range(options.sites):
            box = draw.choice(places)
            north_deg, east_deg = draw.uniform(box.south_deg, box.north_deg), draw.uniform(box.west_deg, box.east_deg)
            sites.append(Site(str(number), north_deg, east_deg))
        bare_s, _, bare_mb, _ = measured(bare, file)
        first_s, _, first_mb, first_all_mb = measured(first_reading, file, root)
        cut_s, _, cut_mb, cut_all_mb = measured(pieces, file, root, sites)
        made_s, _, _, _ = measured(extracts, file, root, sites)
    of_file = f"{size_mb / 1000:.1f} GB"
    what = f"pieces of {options.sites:,} sites out of {of_file}"
    note = f"load {os.getloadavg()[0]:.0f}; with pages of files {{:.0f}} MB"
    figures = [
        Figure(f"first reading of {of_file}", first_s, "CPU s", "bare pass", bare_s),
        Figure(what, cut_s, "CPU s", "bare pass", bare_s, _GOAL_TIMES, goal_of_ratio=True),
        Figure(f"extracts of {options.sites:,} sites from their pieces", made_s, "CPU s", "bare pass", bare_s),
        *(
            Figure(f"{name}: memory", mb, "MB", "bare pass", bare_mb, _GOAL_MB, note=note.format(all_mb))
            for name, mb, all_mb in (
                (f"first reading of {of_file}", first_mb, first_all_mb),
                (what, cut_mb, cut_all_mb),
            )
        ),
    ]
    for figure in figures:
        print(f"{figure.name}: {figure.value:.0f} {figure.unit}, {figure.ratio:.2f} times the bare pass {figure.note}")
    if not options.no_keep:
        keep(figures)
    return exit_code(figures)


if __name__ == "__main__":
    sys.exit(main())
