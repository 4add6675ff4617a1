"""Every crash of the sample through the stages: reconstructed, or rejected for the reason it must be rejected for."""

from __future__ import annotations

import json
from pathlib import Path

import pytest

from lab.truth.vehicles import SampleTruth, score_truth
from trace_dag.common.errors import Reason, Rejection
from trace_dag.common.settings import RoadSettings, Settings
from trace_dag.crash.completeness import check
from trace_dag.crash.folder import identify
from trace_dag.crash.parse import read_report
from trace_dag.osm.catalog import MapCatalog
from trace_dag.osm.types import Site
from trace_dag.reconstruction.estimate import estimate
from trace_dag.roads.build import build_road_map
from trace_dag.roads.map.reader import read_opendrive
from trace_dag.roads.map.writer import write_opendrive
from trace_dag.simulation.embedded import EmbeddedBackend
from trace_dag.simulation.run import simulate
from trace_dag.simulation.states import StateEstimate
from trace_dag.verdict.judge import judge

SAMPLE = Path(__file__).resolve().parents[2] / "data" / "sample"
ROWS = json.loads((SAMPLE / "truth.json").read_text(encoding="utf-8"))["crashes"]
SETTINGS = Settings()
APPROACH_NOT_FOUND = {
    "2023-319046": "both back: only the named court and the driveway of the critical event say where from",
    "2023-319030": "begins with a mailbox beside a road of two directions: nothing says which way the car came",
}


HARM_NOT_FOUND = {
    "2023-319030": "the speed lost at the mailbox is not reported, and decides whether the two graze",
    "2023-319031": "how far one was over the line is not reported: the sides graze",
    "2023-319042": "how far one was over the line is not reported: the sides graze",
}
"""Verified in truth; by the estimated speeds and places the impact may explain no death."""


@pytest.fixture(scope="module")
def maps() -> MapCatalog:
    return MapCatalog.open(sorted((SAMPLE / "osm").glob("*.osm")))


@pytest.fixture(scope="module")
def backend() -> EmbeddedBackend:
    return EmbeddedBackend(SETTINGS.sim)


def _estimated(key: str, maps: MapCatalog, backend: EmbeddedBackend) -> tuple[StateEstimate, int]:
    """Take a crash through all stages; return its estimate and the accepted hypothesis, of the expected label."""
    path = SAMPLE / "reports" / f"crash_{key[-6:]}.xml"
    try:
        released = bool(identify(path.read_bytes(), name=path.name)[1])
    except Rejection:
        released = True
    if not released:
        raise Rejection(Reason.NOT_RELEASED, "no case in the answer")
    record = read_report(path.read_bytes(), name=path.name, settings=SETTINGS.crash)
    check(record, SETTINGS.crash)
    extract = maps.extract([Site(key, record.latitude_deg, record.longitude_deg)], SETTINGS.osm)[key]
    if isinstance(extract, Rejection):
        raise extract
    road_map = build_road_map(extract, record, SETTINGS.roads)
    xodr = write_opendrive(road_map.network)
    network = read_opendrive(xodr, name=key)
    states = estimate(record, network, road_map.report, SETTINGS.states)
    logs = simulate(backend, network, xodr, states, SETTINGS.sim, record=record)
    verdict = judge(record, network, road_map.report, states, logs, SETTINGS.verdict)
    if not verdict.accepted:
        assert verdict.reason is not None
        raise Rejection(verdict.reason, verdict.detail)
    expected = next(row["expected"] for row in ROWS if row["key"] == key)
    if key in HARM_NOT_FOUND and verdict.label != expected["final_state"]:
        pytest.xfail(HARM_NOT_FOUND[key])
    assert verdict.label == expected["final_state"], verdict.reservations
    return states, verdict.hypothesis


def _of_state(*final_states: str) -> pytest.MarkDecorator:
    rows = [row for row in ROWS if row["expected"]["final_state"] in final_states]
    return pytest.mark.parametrize(("key", "reason"), [(row["key"], row["expected"]["reason"]) for row in rows])


@_of_state("verified", "first_event_only")
def test_reconstructed(key: str, reason: None, truth: SampleTruth, maps: MapCatalog, backend: EmbeddedBackend) -> None:
    states, chosen = _estimated(key, maps, backend)
    score = score_truth(truth, {key: states}, hypothesis={key: chosen})
    rows = [row for row in score.rows if row.key == key]
    if key in APPROACH_NOT_FOUND and not all(row.approach_correct for row in rows):
        pytest.xfail(APPROACH_NOT_FOUND[key])
    for row in rows:
        assert row.approach_correct, row
        assert row.lane_correct, row


@_of_state("rejected")
def test_rejected(key: str, reason: str, maps: MapCatalog, backend: EmbeddedBackend) -> None:
    with pytest.raises(Rejection) as rejection:
        _estimated(key, maps, backend)
    assert rejection.value.reason == reason, rejection.value.detail


@pytest.mark.parametrize("case", [319026, 319028, 319031, 319032])
def test_bridges_and_tunnels_are_rejected_without_elevation(case: int, maps: MapCatalog) -> None:
    path = SAMPLE / "reports" / f"crash_{case}.xml"
    record = read_report(path.read_bytes(), name=path.name, settings=SETTINGS.crash)
    extract = maps.extract([Site("k", record.latitude_deg, record.longitude_deg)], SETTINGS.osm)["k"]
    assert not isinstance(extract, Rejection)
    with pytest.raises(Rejection) as rejection:
        build_road_map(extract, record, RoadSettings(elevation=False))
    assert rejection.value.reason is Reason.VERTICAL_GEOMETRY
