"""A flow of tiny stages whose behaviour is written in the report itself, one word per line.

``reject:<stage>``, ``fail:<stage>``, ``flaky:<stage>``, ``die:<stage>`` (kills its worker), ``slow:<stage>``. Each
stage appends its name to what it was given, so an artefact tells which stages it went through, and each call is
counted in a file, so a test can see what was really computed.
"""

from __future__ import annotations

import io
import os
import signal
import time
from collections.abc import Mapping, Sequence
from dataclasses import replace
from pathlib import Path

from trace_dag.errors import Reason, Rejection, Stage, TransientFailure
from trace_dag.pipeline.flow import CrashFiles, Flow, StageDefinition, StageProduct
from trace_dag.pipeline.registry import ReportSource

ORDER = tuple(Stage)
REASON_OF = {
    Stage.CRASH_RECORD: Reason.MALFORMED_REPORT,
    Stage.OSM_EXTRACT: Reason.NO_MAP_COVERAGE,
    Stage.ROAD_MAP: Reason.CRASH_OFF_ROAD,
    Stage.STATE_ESTIMATE: Reason.NO_FEASIBLE_STATE,
    Stage.SIMULATION_LOG: Reason.NO_COLLISION,
    Stage.VERDICT: Reason.WRONG_LOCATION,
}
SETTINGS = {
    Stage.CRASH_RECORD: "crash",
    Stage.OSM_EXTRACT: "osm",
    Stage.ROAD_MAP: "roads",
    Stage.STATE_ESTIMATE: "states",
    Stage.SIMULATION_LOG: "sim",
    Stage.VERDICT: "verdict",
}


def _count(crash: CrashFiles, stage: Stage) -> int:
    """Note a call; how many there have been for this crash and stage."""
    root = crash.storage.local_root
    assert root is not None
    calls = root / "calls"
    calls.mkdir(exist_ok=True)
    log = calls / f"{stage}-{crash.key}"
    with log.open("a") as file:
        file.write(f"{os.getpid()}\n")
    return len(log.read_text().splitlines())


def calls(root: Path) -> dict[tuple[str, str], int]:
    """How often each stage was called, by stage and key."""
    found = {}
    for log in sorted((root / "calls").glob("*")) if (root / "calls").is_dir() else []:
        stage, _, key = log.name.partition("-")
        found[stage, key] = len(log.read_text().splitlines())
    return found


def _behave(crash: CrashFiles, stage: Stage, content: bytes) -> StageProduct:
    times = _count(crash, stage)
    words = content.decode().splitlines()
    if f"slow:{stage}" in words:
        time.sleep(0.2)
    if f"die:{stage}" in words:
        os.kill(os.getpid(), signal.SIGKILL)
    if f"die-once:{stage}" in words and times == 1:
        os.kill(os.getpid(), signal.SIGKILL)
    if f"fail:{stage}" in words:
        raise RuntimeError(f"{stage} is broken for {crash.key}")
    if f"fail-once:{stage}" in words and times == 1:
        raise RuntimeError(f"{stage} is broken for {crash.key}")
    if f"flaky:{stage}" in words and times == 1:
        raise TransientFailure("no answer")
    rejection = None
    if f"reject:{stage}" in words:
        rejection = Rejection(REASON_OF[stage], "The crash measures 7 m.", measured=7.0, threshold=5.0)
        if stage is not Stage.VERDICT:
            raise rejection
    files = {"txt": content + f"through:{stage}\n".encode()}
    return StageProduct(files, {"words": len(words)}, rejection)


def raw_report(crash: CrashFiles) -> StageProduct:
    return _behave(crash, Stage.RAW_REPORT, Path(crash.source.report.location).read_bytes())


def crash_record(crash: CrashFiles) -> StageProduct:
    return _behave(crash, Stage.CRASH_RECORD, crash.read(Stage.RAW_REPORT, "txt"))


def osm_extract(crashes: Sequence[CrashFiles]) -> Mapping[str, StageProduct | Rejection]:
    answers: dict[str, StageProduct | Rejection] = {}
    for crash in crashes:
        try:
            answers[crash.key] = _behave(crash, Stage.OSM_EXTRACT, crash.read(Stage.CRASH_RECORD, "txt"))
        except Rejection as rejection:
            answers[crash.key] = rejection
    return answers


def pairs(crashes: Sequence[CrashFiles]) -> list[list[str]]:
    keys = [crash.key for crash in crashes]
    return [keys[start : start + 2] for start in range(0, len(keys), 2)]


def road_map(crash: CrashFiles) -> StageProduct:
    return _behave(crash, Stage.ROAD_MAP, crash.read(Stage.OSM_EXTRACT, "txt"))


def state_estimate(crash: CrashFiles) -> StageProduct:
    return _behave(crash, Stage.STATE_ESTIMATE, crash.read(Stage.ROAD_MAP, "txt"))


def simulation_log(crash: CrashFiles) -> StageProduct:
    return _behave(crash, Stage.SIMULATION_LOG, crash.read(Stage.STATE_ESTIMATE, "txt"))


def verdict(crash: CrashFiles) -> StageProduct:
    return _behave(crash, Stage.VERDICT, crash.read(Stage.SIMULATION_LOG, "txt"))


def picture(crash: CrashFiles) -> dict[str, bytes]:
    from PIL import Image

    image, files = Image.new("RGB", (64, 36), (0, 114, 178)), {}
    for extension in ("png", "webp"):
        stream = io.BytesIO()
        image.save(stream, extension)
        files[extension] = stream.getvalue()
    return files | {"svg": b"<svg xmlns='http://www.w3.org/2000/svg'/>"}


def _definition(stage: Stage) -> StageDefinition:
    before = ORDER[stage.position - 1] if stage.position else None
    common = StageDefinition(
        stage,
        function=raw_report,
        inputs=((before, "txt"),) if before else (),
        from_source={Stage.RAW_REPORT: ("report",), Stage.OSM_EXTRACT: ("maps",)}.get(stage, ()),
        settings=SETTINGS.get(stage),
        code=("trace_dag.errors",),
    )
    if stage is Stage.OSM_EXTRACT:
        return replace(common, function=None, batch_function=osm_extract, grouping=pairs)
    return replace(common, function=globals()[stage.value])


FLOW = Flow(tuple(_definition(stage) for stage in Stage), picture=picture)


def write_reports(folder: Path, behaviours: Mapping[str, str]) -> dict[str, ReportSource]:
    """One report per key with its behaviour as content."""
    folder.mkdir(parents=True, exist_ok=True)
    sources = {}
    for key, behaviour in behaviours.items():
        path = folder / f"{key}.txt"
        path.write_text(behaviour + "\n" if behaviour else "")
        sources[key] = ReportSource("file", str(path), sha256=str(hash(behaviour)))
    return sources
