"""The picture of a crash, from what is stored of it."""

from __future__ import annotations

from trace_dag.flow.artefacts import ESTIMATE, LOGS, MAP_REPORT, RECORD, ROAD_MAP, VERDICT
from trace_dag.flow.contract import CrashFiles
from trace_dag.scenario.pictures import as_png, as_thumbnail, draw_crash
from trace_dag.scenario.sketch import draw_sketch


def crash_picture(crash: CrashFiles) -> dict[str, bytes]:
    """What is known of a crash from above; nothing while it has no road map."""
    if not crash.has(ROAD_MAP):
        return {}
    estimate = crash.load(ESTIMATE) if crash.has(ESTIMATE) else None
    judged = crash.load(VERDICT) if crash.has(VERDICT) else None
    log = crash.load(LOGS)[judged.hypothesis if judged else 0] if crash.has(LOGS) else None
    record, network = crash.load(RECORD), crash.load(ROAD_MAP)
    drawn = draw_crash(record, network, crash.load(MAP_REPORT), estimate, log, judged)
    return {"png": as_png(drawn), "webp": as_thumbnail(drawn), "svg": draw_sketch(network, log).encode()}
