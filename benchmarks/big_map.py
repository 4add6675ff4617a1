"""Cutting the sites of a state or a country out of one large file: memory, and time beside a bare pass.

    python -m benchmarks.big_map                                1.1 GB made of the shared extracts, 3,000 sites
    python -m benchmarks.big_map --bytes 200000000 --sites 500  less

The file is made in the temporary folder (TMPDIR) by :mod:`benchmarks.multiplied_map` and deleted in the end. The bare
pass reads it, locates the nodes of its ways and filters by ``highway``, as osmium does it. The first reading is that of
``ingest``, which finds the long ways. Each runs in a process of its own, whose memory is looked at every half second:
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
from trace_dag.osm.catalog import MapCatalog
from trace_dag.osm.extraction import extract_raw, read_header
from trace_dag.osm.types import OsmExtract, Site
from trace_dag.settings import OsmSettings

_GOAL_MB, _GOAL_TIMES = 4096.0, 1.5
_LOOK_EVERY_S = 0.5


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
    """Read, locate, filter, do nothing."""
    bare_pass(file)
    return ""


def first_reading(file: Path) -> str:
    """What ``ingest`` does with a new file."""
    extract_raw(file, read_header(file), [], service_roads=True)
    return ""


def cut(file: Path, sites: Sequence[Site]) -> str:
    """Cut all sites out."""
    answers = MapCatalog.open([file]).extract(sites, OsmSettings()).values()
    return f"{sum(isinstance(answer, OsmExtract) for answer in answers)} of {len(sites)} sites have roads; "


def main() -> int:
    """Exit code 1 if a goal is missed."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--bytes", type=int, default=1_100_000_000)
    parser.add_argument("--sites", type=int, default=3_000)
    parser.add_argument("--no-keep", action="store_true", help="print only")
    options = parser.parse_args()
    with tempfile.TemporaryDirectory() as folder:
        file = Path(folder) / "multiplied.osm.pbf"
        places = multiply_map(sorted((SHARED / "osm").glob("*.osm.pbf")), file, options.bytes)
        size_mb = file.stat().st_size / 1e6
        print(f"{size_mb:.0f} MB of {len(places)} copies", flush=True)
        draw = random.Random(1)
        sites = []
        for number in range(options.sites):
            box = draw.choice(places)
            north_deg, east_deg = draw.uniform(box.south_deg, box.north_deg), draw.uniform(box.west_deg, box.east_deg)
            sites.append(Site(str(number), north_deg, east_deg))
        bare_s, _, bare_mb, _ = measured(bare, file)
        first_s, _, first_mb, _ = measured(first_reading, file)
        cut_s, _, own_mb, all_mb = measured(cut, file, sites)
    what = f"cutting {options.sites:,} sites out of {size_mb / 1000:.1f} GB"
    note = f"load {os.getloadavg()[0]:.0f}; with pages of files {all_mb:.0f} MB"
    figures = [
        Figure(
            f"first reading of {size_mb / 1000:.1f} GB",
            first_s,
            "CPU s",
            "bare pass",
            bare_s,
            note=f"{first_mb:.0f} MB",
        ),
        Figure(what, cut_s, "CPU s", "bare pass", bare_s, _GOAL_TIMES, goal_of_ratio=True),
        Figure(f"{what}: memory", own_mb, "MB", "bare pass", bare_mb, _GOAL_MB, note=note),
    ]
    for figure in figures:
        print(f"{figure.name}: {figure.value:.0f} {figure.unit}, {figure.ratio:.2f} times the bare pass {figure.note}")
    if not options.no_keep:
        keep(figures)
    return exit_code(figures)


if __name__ == "__main__":
    sys.exit(main())
