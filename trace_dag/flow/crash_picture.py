"""The picture of a stored crash."""

from __future__ import annotations

from trace_dag.common.stage import Stage
from trace_dag.flow.artefacts import (
    ESTIMATE,
    EXTRACT,
    MAP_REPORT,
    RECORD,
    REJECTED_MAP,
    REJECTED_REPORT,
    ROAD_MAP,
    VERDICT,
    CrashArtefacts,
    surroundings_of,
)
from trace_dag.flow.contract import CrashFiles
from trace_dag.pages.canvas import as_png, pixels_of
from trace_dag.pages.pictures import WIDTH_PX, draw_crash, draw_rejected_map


def crash_picture(crash: CrashFiles) -> dict[str, bytes]:
    """Return a picture of the crash from above with all that is known so far.

    Empty before the crash has a map, even a rejected one.
    """
    svg = draw_sketch(crash)
    return {} if svg is None else {"png": as_png(pixels_of(svg, WIDTH_PX))}


def draw_sketch(crash: CrashArtefacts) -> str | None:
    """Return the sketch of the crash as SVG; None before it has a map, even a rejected one."""
    if isinstance(crash, CrashFiles) and crash.has(REJECTED_MAP):
        why = crash.records[Stage.ROAD_MAP].detail
        network, report = crash.load(REJECTED_MAP), crash.load(REJECTED_REPORT)
        around = surroundings_of(crash)
        return draw_rejected_map(crash.load(RECORD), network, crash.load(EXTRACT), report, why, surroundings=around)
    if not crash.has(ROAD_MAP):
        return None
    estimate = crash.load(ESTIMATE) if crash.has(ESTIMATE) else None
    judged = crash.load(VERDICT) if crash.has(VERDICT) else None
    record, network = crash.load(RECORD), crash.load(ROAD_MAP)
    return draw_crash(
        record,
        network,
        crash.load(MAP_REPORT),
        estimate,
        crash.shown_log(),
        judged,
        surroundings=surroundings_of(crash),
    )
