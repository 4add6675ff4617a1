"""How well maps agree with reports: lanes, intersection type, trafficway, control and limit, over two cohorts.

    python benchmarks/map_agreement.py ../shared/data

The cohorts are the published Virginia sites (reports as XML, one map each) and the FARS CSV crashes with two vehicles
inside the OSM extracts. "Comparable" are the crashes of which both the report and OSM's own tags speak.
"""

from __future__ import annotations

import argparse
import sys
from collections import Counter, defaultdict
from collections.abc import Iterable
from pathlib import Path

from trace_dag.crash.fars_csv import FarsCsvSource
from trace_dag.crash.parse import read_report
from trace_dag.crash.record import CrashRecord
from trace_dag.errors import Rejection
from trace_dag.geometry import LocalFrame
from trace_dag.osm.catalog import MapCatalog
from trace_dag.osm.types import Site
from trace_dag.roads.crash_site.agreement import AGREES, DIFFERS, compare
from trace_dag.roads.crash_site.crossings import with_kinds
from trace_dag.roads.crash_site.placement import place_crash
from trace_dag.roads.from_osm.convert import convert
from trace_dag.roads.from_osm.way_direction import along_traffic
from trace_dag.settings import CrashSettings, OsmSettings, RoadSettings

Table = dict[str, Counter[str]]


def records(reports: Iterable[tuple[str, bytes]], vehicles: int | None) -> list[CrashRecord]:
    """The reports that can be read, those with ``vehicles`` vehicles if given."""
    out = []
    for name, data in reports:
        try:
            record = read_report(data, name=name, settings=CrashSettings(vehicles=vehicles))
        except Rejection:
            continue
        if vehicles is None or len(record.vehicles) == vehicles:
            out.append(record)
    return out


def agreement(cohort: str, crashes: list[CrashRecord], maps: Path, verbose: bool) -> Table:
    """Comparisons of one cohort counted by attribute; prints the crashes that are lost, and what differs."""
    sites = [Site(record.key, record.latitude_deg, record.longitude_deg) for record in crashes]
    extracts = MapCatalog.open([maps]).extract(sites, OsmSettings())
    table: Table = defaultdict(Counter)
    lost: Counter[str] = Counter()
    for record in crashes:
        extract = extracts[record.key]
        try:
            if isinstance(extract, Rejection):
                raise extract
            extract, frame = along_traffic(extract), LocalFrame(record.latitude_deg, record.longitude_deg)
            network = with_kinds(convert(extract, frame, RoadSettings()), extract)
            placement = place_crash(network, record, RoadSettings())
        except Rejection as rejection:
            lost[rejection.reason.value] += 1
            continue
        for comparison in compare(network, record, placement):
            table[comparison.attribute][comparison.agreement] += 1
            if verbose and comparison.agreement == DIFFERS:
                print(f"  {record.key} {comparison.attribute}: report {comparison.reported}, map {comparison.mapped}")
    print(f"{cohort}: {len(crashes) - lost.total()} crashes on a map; lost: {dict(lost) or 'none'}")
    return table


def main() -> int:
    """Measure both cohorts and print one table."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("data", type=Path)
    parser.add_argument("--verbose", action="store_true", help="print every difference")
    arguments = parser.parse_args()
    data: Path = arguments.data
    reports = ((path.name, path.read_bytes()) for path in sorted((data / "va-2023" / "reports").glob("*.xml")))
    cohorts = {
        "Virginia 2023": (records(reports, None), data / "va-2023" / "osm"),
        "FARS CSV": (records(FarsCsvSource.open(data / "fars-csv").reports(), 2), data / "osm"),
    }
    tables = {name: agreement(name, *cohort, arguments.verbose) for name, cohort in cohorts.items()}
    tables["both"] = {
        attribute: sum((table[attribute] for table in tables.values()), Counter())
        for attribute in next(iter(tables.values()))
    }
    print(f"\n{'':20}" + "".join(f"{name:>22}" for name in tables))
    for attribute in tables["both"]:
        cells = []
        for table in tables.values():
            agrees, comparable = table[attribute][AGREES], table[attribute][AGREES] + table[attribute][DIFFERS]
            cells.append(f"{agrees}/{comparable} = {agrees / comparable:.0%}" if comparable else "-")
        print(f"{attribute:20}" + "".join(f"{cell:>22}" for cell in cells))
    return 0


if __name__ == "__main__":
    sys.exit(main())
