"""Cutting many sites out of one OSM file, beside a bare pyosmium pass over it: time, CPU and memory.

    python -m benchmarks.osm_extraction ../shared/data/osm/tempe-az.osm.pbf
    python -m benchmarks.osm_extraction virginia.osm.pbf --sites 3000 --runs 1

The bare pass reads the file, locates the nodes of its ways, filters by ``highway`` and does nothing. Each runs in a
process of its own, the best of several counts.
"""

from __future__ import annotations

import argparse
import multiprocessing
import random
import resource
import sys
import time
from collections.abc import Callable, Sequence
from pathlib import Path

import osmium
from osmium.filter import KeyFilter

from trace_dag.osm.catalog import MapCatalog
from trace_dag.osm.extraction import read_header
from trace_dag.osm.types import OsmExtract, Site
from trace_dag.settings import OsmSettings


def bare_pass(file: Path) -> str:
    """Read, locate, filter, do nothing."""
    for _ in osmium.FileProcessor(str(file)).with_locations().with_filter(KeyFilter("highway")):
        pass
    return ""


def extracts(file: Path, sites: Sequence[Site], node_memory_mb: float) -> str:
    """The extracts of all sites."""
    found = MapCatalog.open([file]).extract(sites, OsmSettings(node_memory_mb=node_memory_mb))
    return f"{sum(isinstance(each, OsmExtract) for each in found.values())} of {len(sites)} sites have roads"


def measured(work: Callable[..., str], *arguments: object) -> tuple[float, float, float, str]:
    """CPU seconds, wall seconds and the most memory (MB) of some work in a process of its own, and what it said."""
    with multiprocessing.get_context("spawn").Pool(1) as pool:
        return pool.apply(_measured, (work, arguments))


def _measured(work: Callable[..., str], arguments: Sequence[object]) -> tuple[float, float, float, str]:
    began_s, began_cpu_s = time.perf_counter(), time.process_time()
    said = work(*arguments)
    most_mb = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1024
    return time.process_time() - began_cpu_s, time.perf_counter() - began_s, most_mb, said


def sites_in(file: Path, count: int) -> list[Site]:
    """Places drawn evenly from what a file says that it covers."""
    box, draw = read_header(file).box, random.Random(1)
    if box is None:
        raise SystemExit(f"{file} does not say what it covers")
    return [
        Site(str(number), draw.uniform(box.south_deg, box.north_deg), draw.uniform(box.west_deg, box.east_deg))
        for number in range(count)
    ]


def main() -> int:
    """Measure and print the ratios."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("file", type=Path)
    parser.add_argument("--sites", type=int, default=100)
    parser.add_argument("--runs", type=int, default=5)
    parser.add_argument("--node-memory-mb", type=float, default=OsmSettings().node_memory_mb)
    options = parser.parse_args()
    sites = sites_in(options.file, options.sites)
    works: dict[str, tuple[Callable[..., str], tuple[object, ...]]] = {
        "bare pass": (bare_pass, (options.file,)),
        f"{len(sites):,} sites": (extracts, (options.file, sites, options.node_memory_mb)),
    }
    bare_cpu_s = 0.0
    for name, (work, arguments) in works.items():
        cpu_s, wall_s, most_mb, said = min(measured(work, *arguments) for _ in range(options.runs))
        bare_cpu_s = bare_cpu_s or cpu_s
        ratio = cpu_s / bare_cpu_s
        print(f"{name:16} {cpu_s:8.2f} CPU s ({ratio:.2f}) {wall_s:8.2f} s {most_mb:8.0f} MB  {said}", flush=True)
    return 0


if __name__ == "__main__":
    sys.exit(main())
