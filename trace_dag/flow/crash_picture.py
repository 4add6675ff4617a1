"""The picture of a crash, from what is stored of it."""

from __future__ import annotations

from trace_dag.flow.artefacts import (
    ESTIMATE,
    EXTRACT,
    LOGS,
    MAP_REPORT,
    RECORD,
    REJECTED_MAP,
    REJECTED_REPORT,
    ROAD_MAP,
    VERDICT,
)
from trace_dag.flow.contract import CrashFiles
from trace_dag.scenario.pictures import as_png, as_thumbnail, draw_crash
from trace_dag.scenario.rejected_map import draw_rejected_map
from trace_dag.scenario.sketch import draw_sketch
from trace_dag.stage import Stage


def crash_picture(crash: CrashFiles) -> dict[str, bytes]:
    """What is known of a crash from above; nothing while it has no road map, be it one it is rejected for."""
    if crash.has(REJECTED_MAP):
        return _rejected_map(crash)
    if not crash.has(ROAD_MAP):
        return {}
    estimate = crash.load(ESTIMATE) if crash.has(ESTIMATE) else None
    judged = crash.load(VERDICT) if crash.has(VERDICT) else None
    log = crash.load(LOGS)[judged.hypothesis if judged else 0] if crash.has(LOGS) else None
    record, network = crash.load(RECORD), crash.load(ROAD_MAP)
    drawn = draw_crash(record, network, crash.load(MAP_REPORT), estimate, log, judged)
    return {"png": as_png(drawn), "webp": as_thumbnail(drawn), "svg": draw_sketch(network, log).encode()}


def _rejected_map(crash: CrashFiles) -> dict[str, bytes]:
    network, report = crash.load(REJECTED_MAP), crash.load(REJECTED_REPORT)
    why = crash.records[Stage.ROAD_MAP].detail
    drawn = draw_rejected_map(crash.load(RECORD), network, crash.load(EXTRACT), report, why)
    return {"png": as_png(drawn), "webp": as_thumbnail(drawn), "svg": draw_sketch(network).encode()}
