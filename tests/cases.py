"""Crashes as the estimator gets them: record, road network as stored, and map report."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cache
from pathlib import Path

from trace_dag.common.errors import Rejection
from trace_dag.common.settings import Settings
from trace_dag.crash.completeness import check
from trace_dag.crash.parse import read_report
from trace_dag.crash.record import CrashRecord
from trace_dag.osm.catalog import MapCatalog
from trace_dag.osm.types import Site
from trace_dag.roads.build import build_road_map
from trace_dag.roads.map.network import RoadNetwork
from trace_dag.roads.map.reader import read_opendrive
from trace_dag.roads.map.writer import write_opendrive
from trace_dag.roads.report import MapReport

SAMPLE = Path(__file__).resolve().parents[1] / "data" / "sample"
SETTINGS = Settings()


@dataclass(frozen=True, eq=False)
class Case:
    """One crash with its map, after the round trip through OpenDRIVE."""

    key: str
    record: CrashRecord
    network: RoadNetwork
    xodr: bytes
    report: MapReport


def cases(reports: dict[str, bytes], maps: Path) -> list[Case]:
    """The crashes whose record and map are accepted."""
    records = {}
    for name, data in sorted(reports.items()):
        try:
            record = read_report(data, name=name, settings=SETTINGS.crash)
            check(record, SETTINGS.crash)
        except Rejection:
            continue
        records[record.key] = record
    sites = [Site(key, record.latitude_deg, record.longitude_deg) for key, record in records.items()]
    found = []
    for key, extract in MapCatalog.open([maps]).extract(sites, SETTINGS.osm).items():
        if isinstance(extract, Rejection):
            continue
        try:
            built = build_road_map(extract, records[key], SETTINGS.roads)
        except Rejection:
            continue
        xodr = write_opendrive(built.network)
        network = read_opendrive(xodr, name=f"{key}.xodr")
        found.append(Case(key, records[key], network, xodr, built.report))
    return found


@cache
def sample_cases() -> tuple[Case, ...]:
    """The bundled sample's crashes."""
    reports = {path.name: path.read_bytes() for path in (SAMPLE / "reports").glob("*.xml")}
    return tuple(cases(reports, SAMPLE / "osm"))


@cache
def sample_case(key: str) -> Case:
    """One crash of the bundled sample."""
    name = f"crash_{key.partition('-')[2]}.xml"
    (case,) = cases({name: (SAMPLE / "reports" / name).read_bytes()}, SAMPLE / "osm")
    return case
