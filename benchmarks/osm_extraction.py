"""How long it takes to cut many sites out of one OSM file, beside a bare pyosmium pass over it.

    python benchmarks/osm_extraction.py ../shared/data/osm/tempe-az.osm.pbf

The bare pass reads the file, locates the nodes of its ways, filters by ``highway`` and does nothing. Times are the best
of several runs; "main thread" is CPU time without the threads in which libosmium reads and writes.
"""

from __future__ import annotations

import argparse
import math
import random
import sys
import time
from collections.abc import Callable, Mapping
from pathlib import Path

import osmium
from osmium.filter import KeyFilter

from trace_dag.osm.catalog import MapCatalog, box_around
from trace_dag.osm.extraction import extract_raw
from trace_dag.osm.types import Site
from trace_dag.settings import OsmSettings


def measure(works: Mapping[str, Callable[[], object]], runs: int) -> dict[str, float]:
    """Best wall time of each of ``works``, seconds; printed with the CPU time of the main thread.

    They take turns, so that hours in which the machine is slow hit all of them alike.
    """
    wall_s, cpu_s = dict.fromkeys(works, math.inf), dict.fromkeys(works, math.inf)
    for _ in range(runs):
        for name, work in works.items():
            wall_start, cpu_start = time.perf_counter(), time.thread_time()
            work()
            wall_s[name] = min(wall_s[name], time.perf_counter() - wall_start)
            cpu_s[name] = min(cpu_s[name], time.thread_time() - cpu_start)
    for name in works:
        print(f"{name:50} {wall_s[name]:7.3f} s   main thread {cpu_s[name]:7.3f} s")
    return wall_s


def bare_pass(file: Path, located_in: str = "flex_mem") -> None:
    """Read, locate, filter, do nothing. ``located_in`` is one of libosmium's kinds of tables."""
    for _ in osmium.FileProcessor(str(file)).with_locations(located_in).with_filter(KeyFilter("highway")):
        pass


def main() -> int:
    """Measure and print the ratios."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("file", type=Path)
    parser.add_argument("--sites", type=int, default=100)
    parser.add_argument("--runs", type=int, default=15)
    arguments = parser.parse_args()
    catalog = MapCatalog.open([arguments.file])
    [file] = catalog.files
    bounds = file.header.box
    if bounds is None:
        parser.error(f"{arguments.file} does not say what it covers")
    randomly, settings = random.Random(1), OsmSettings()
    sites = [
        Site(
            str(number),
            randomly.uniform(bounds.south_deg, bounds.north_deg),
            randomly.uniform(bounds.west_deg, bounds.east_deg),
        )
        for number in range(arguments.sites)
    ]
    boxes = [box_around(site, settings.radius_m) for site in sites]
    found = measure(
        {
            "bare pass": lambda: bare_pass(file.path),
            "pass, 1 site": lambda: extract_raw(file.path, file.header, boxes[:1], service_roads=True),
            f"pass, {len(sites)} sites": lambda: extract_raw(file.path, file.header, boxes, service_roads=True),
            f"pass, {len(sites)} sites, cut and made into extracts": lambda: catalog.extract(sites, settings),
        },
        arguments.runs,
    )
    bare_s, *others_s = found.values()
    print("ratios to the bare pass: " + ", ".join(f"{seconds / bare_s:.2f}" for seconds in others_s))
    return 0


if __name__ == "__main__":
    sys.exit(main())
