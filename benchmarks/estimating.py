"""Time the analytic estimator takes per crash, on the bundled sample or on reports and maps of your own.

    python benchmarks/estimating.py [--reports DIR --maps DIR]

Maps are made and read back first; a second figure leaves out what a network prepares when it is first asked.
"""

from __future__ import annotations

import argparse
import statistics
import time
from pathlib import Path

from trace_dag.crash.completeness import check
from trace_dag.crash.parse import read_report
from trace_dag.errors import Rejection
from trace_dag.osm.catalog import MapCatalog
from trace_dag.osm.types import Site
from trace_dag.roads.build import build_road_map
from trace_dag.roads.map.reader import read_opendrive
from trace_dag.roads.map.writer import write_opendrive
from trace_dag.settings import Settings
from trace_dag.states.estimate import estimate

SAMPLE = Path(__file__).resolve().parents[1] / "data" / "sample"


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--reports", type=Path, default=SAMPLE / "reports")
    parser.add_argument("--maps", type=Path, default=SAMPLE / "osm")
    options = parser.parse_args()
    settings = Settings()
    records = {}
    for path in sorted(options.reports.glob("*.xml")):
        try:
            record = read_report(path.read_bytes(), name=path.name, settings=settings.crash)
            check(record, settings.crash)
        except Rejection:
            continue
        records[record.key] = record
    sites = [Site(key, record.latitude_deg, record.longitude_deg) for key, record in records.items()]
    first, again = [], []
    for key, extract in MapCatalog.open([options.maps]).extract(sites, settings.osm).items():
        try:
            if isinstance(extract, Rejection):
                raise extract
            built = build_road_map(extract, records[key], settings.roads)
            network = read_opendrive(write_opendrive(built.network), name=key)
            for times in (first, again):
                started = time.process_time()
                estimate(records[key], network, built.report, settings.states)
                times.append(time.process_time() - started)
        except Rejection as rejection:
            print(f"{key}: {rejection}")
    print(f"{len(first)} crashes, milliseconds of one core per crash")
    for name, times in (("network as read", first), ("network prepared", again)):
        mean, worst = statistics.mean(times) * 1e3, max(times) * 1e3
        print(f"{name:17} mean {mean:5.1f}  median {statistics.median(times) * 1e3:5.1f}  worst {worst:5.1f}")


if __name__ == "__main__":
    main()
