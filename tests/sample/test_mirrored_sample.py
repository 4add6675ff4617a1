"""Traffic on the left: each crash of the sample in a mirrored town has the mirrored course and the same verdict."""

from __future__ import annotations

from pathlib import Path

import pytest

from tests.cases import SAMPLE, SETTINGS
from tests.mirrored import mirror_record
from trace_dag.common.errors import Rejection
from trace_dag.common.geometry import LocalFrame
from trace_dag.crash.completeness import check
from trace_dag.crash.parse import read_report
from trace_dag.crash.record import CrashRecord
from trace_dag.osm.catalog import MapCatalog
from trace_dag.osm.types import OsmExtract, Site
from trace_dag.reconstruction.estimate import estimate
from trace_dag.roads.build import build_road_map
from trace_dag.roads.from_osm.left_hand import mirror_extract
from trace_dag.roads.map.reader import read_opendrive
from trace_dag.roads.map.writer import write_opendrive
from trace_dag.simulation.run import backend, simulate
from trace_dag.verdict.judge import judge


def outcome(record: CrashRecord, extract: OsmExtract) -> tuple[str, str]:
    """The label and the reason of a rejection."""
    try:
        check(record, SETTINGS.crash)
        built = build_road_map(extract, record, SETTINGS.roads)
        xodr = write_opendrive(built.network)
        network = read_opendrive(xodr, name="map")
        estimated = estimate(record, network, built.report, SETTINGS.states)
        logs = simulate(backend(SETTINGS.sim), network, xodr, estimated, SETTINGS.sim, record=record)
        verdict = judge(record, network, built.report, estimated, logs, SETTINGS.verdict)
    except Rejection as rejection:
        return "rejected", rejection.reason
    return verdict.label, verdict.reason or ""


@pytest.mark.parametrize("folder", [SAMPLE, SAMPLE / "people", SAMPLE / "roadside"], ids=lambda each: each.name)
def test_in_a_mirror_every_crash_has_the_same_outcome(folder: Path) -> None:
    records = {}
    for path in sorted((folder / "reports").glob("*.xml")):
        try:
            records[path.stem] = read_report(path.read_bytes(), name=path.name, settings=SETTINGS.crash)
        except Rejection:
            continue
    sites = [Site(key, each.latitude_deg, each.longitude_deg) for key, each in records.items()]
    different = {}
    for key, extract in MapCatalog.open([SAMPLE / "osm"]).extract(sites, SETTINGS.osm).items():
        if isinstance(extract, Rejection):
            continue
        record = records[key]
        axis = LocalFrame(record.latitude_deg, record.longitude_deg)
        mirrored = mirror_record(record, axis.longitude_deg)
        assert mirrored.keeps_left
        found = outcome(record, extract), outcome(mirrored, mirror_extract(extract, axis))
        if found[0] != found[1]:
            different[key] = found
    assert different == {}
