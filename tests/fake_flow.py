"""A flow of tiny stages whose behaviour is written in the report itself, one word per line.

``reject:<stage>``, ``fail:<stage>``, ``flaky:<stage>``, ``die:<stage>`` (kills its worker), ``stop:<stage>`` (stops
it), ``slow:<stage>``, ``hang:<stage>`` (in Python), ``sleep:<stage>`` (in a library), ``freeze:<stage>`` (in one that
holds Python); at the first, the second or all later calls alone ``fail-once``, ``fail-second``, ``die-once``,
``die-later``. Each stage appends its name to what it was given, so an artefact tells which stages it went through, and
each call is counted in a file, so a test can see what was really computed.
"""

from __future__ import annotations

import ctypes
import io
import os
import signal
import time
from collections.abc import Mapping, Sequence
from pathlib import Path

from trace_dag.common.errors import Reason, Rejection, TransientFailure
from trace_dag.common.settings import (
    CrashSettings,
    OsmSettings,
    RoadSettings,
    SimSettings,
    StateSettings,
    VerdictSettings,
)
from trace_dag.common.stage import Stage
from trace_dag.flow import stages as real
from trace_dag.flow.artefacts import Artefact
from trace_dag.flow.cohorts.registry import RegisteredMap, ReportSource
from trace_dag.flow.cohorts.services import Services
from trace_dag.flow.contract import CrashFiles, Flow, StageDefinition, StageProduct
from trace_dag.language.ledger import SpendingLedger

ORDER = tuple(Stage)
REASON_OF = {
    Stage.CRASH_RECORD: Reason.MALFORMED_REPORT,
    Stage.OSM_EXTRACT: Reason.NO_MAP_COVERAGE,
    Stage.ROAD_MAP: Reason.CRASH_OFF_ROAD,
    Stage.STATE_ESTIMATE: Reason.NO_FEASIBLE_STATE,
    Stage.SIMULATION_LOG: Reason.NO_COLLISION,
    Stage.VERDICT: Reason.WRONG_LOCATION,
}


def count_call(key: str, services: Services, stage: Stage) -> int:
    """Note a call; how many there have been for this crash and stage."""
    root = services.storage.local_root
    assert root is not None
    calls = root / "calls"
    calls.mkdir(exist_ok=True)
    log = calls / f"{stage}-{key}"
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


def _behave(key: str, services: Services, stage: Stage, content: bytes) -> StageProduct:
    times = count_call(key, services, stage)
    words = content.decode().splitlines()
    time.sleep(600.0 if f"sleep:{stage}" in words else 0.2 if f"slow:{stage}" in words else 0.0)
    while f"hang:{stage}" in words:
        # As code does that catches whatever comes: a time limit has to end this stage all the same.
        try:
            time.sleep(0.01)
        except Exception:
            continue
    if f"freeze:{stage}" in words:
        mutex, library = ctypes.create_string_buffer(64), ctypes.PyDLL(None)
        for _ in range(2):  # the second waits for the first for ever, signals or not
            library.pthread_mutex_lock(mutex)
    if f"stop:{stage}" in words:
        os.kill(os.getpid(), signal.SIGSTOP)
    if f"die:{stage}" in words:
        os.kill(os.getpid(), signal.SIGKILL)
    if f"die-once:{stage}" in words and times == 1:
        os.kill(os.getpid(), signal.SIGKILL)
    SpendingLedger(budget_usd=0.0 if f"broke:{stage}" in words else None).reserve()
    if f"fail:{stage}" in words:
        raise RuntimeError(f"{stage} is broken for {key}")
    if (f"fail-once:{stage}" in words and times == 1) or (f"fail-second:{stage}" in words and times == 2):
        raise RuntimeError(f"{stage} is broken for {key}")
    if f"die-later:{stage}" in words and times > 1:
        os.kill(os.getpid(), signal.SIGKILL)
    if f"flaky:{stage}" in words and times == 1:
        raise TransientFailure("no answer")
    rejection = None
    if f"reject:{stage}" in words:
        rejection = Rejection(REASON_OF[stage], "The crash measures 7 m.", measured=7.0, threshold=5.0)
        if stage is not Stage.VERDICT:
            raise rejection
    files = {"txt": content + f"through:{stage}\n".encode()}
    return StageProduct(files, {"words": len(words)}, rejection)


def raw_report(key: str, report: ReportSource, services: Services) -> StageProduct:
    return _behave(key, services, Stage.RAW_REPORT, Path(report.location).read_bytes())


def crash_record(key: str, report_text: bytes, services: Services, settings: CrashSettings) -> StageProduct:
    return _behave(key, services, Stage.CRASH_RECORD, report_text)


def osm_extract(
    record_text: Mapping[str, bytes],
    maps: Mapping[str, tuple[RegisteredMap, ...]],
    services: Services,
    settings: OsmSettings,
) -> Mapping[str, StageProduct | Rejection]:
    answers: dict[str, StageProduct | Rejection] = {}
    for key, text in record_text.items():
        try:
            answers[key] = _behave(key, services, Stage.OSM_EXTRACT, text)
        except Rejection as rejection:
            answers[key] = rejection
    return answers


def pairs(crashes: Sequence[CrashFiles]) -> list[list[str]]:
    keys = [crash.key for crash in crashes]
    return [keys[start : start + 2] for start in range(0, len(keys), 2)]


def road_map(key: str, extract_text: bytes, services: Services, settings: RoadSettings) -> StageProduct:
    return _behave(key, services, Stage.ROAD_MAP, extract_text)


def state_estimate(key: str, map_text: bytes, services: Services, settings: StateSettings) -> StageProduct:
    return _behave(key, services, Stage.STATE_ESTIMATE, map_text)


def simulation_log(key: str, estimate_text: bytes, services: Services, settings: SimSettings) -> StageProduct:
    return _behave(key, services, Stage.SIMULATION_LOG, estimate_text)


def verdict(key: str, log_text: bytes, services: Services, settings: VerdictSettings) -> StageProduct:
    return _behave(key, services, Stage.VERDICT, log_text)


def picture(crash: CrashFiles) -> dict[str, bytes]:
    from PIL import Image

    stream = io.BytesIO()
    Image.new("RGB", (64, 36), (0, 114, 178)).save(stream, "png")
    return {"png": stream.getvalue(), "svg": b"<svg xmlns='http://www.w3.org/2000/svg'/>"}


ARTEFACTS = {
    name: Artefact(stage, ("txt",))
    for name, stage in zip(
        ("report_text", "record_text", "extract_text", "map_text", "estimate_text", "log_text"), Stage, strict=False
    )
}
FLOW = Flow(
    tuple(
        StageDefinition(stage, f"fake_flow:{stage}", grouping="fake_flow:pairs" if stage is Stage.OSM_EXTRACT else None)
        for stage in Stage
    ),
    ARTEFACTS,
    picture="fake_flow:picture",
)

ASKING = Flow((real.FLOW.definition(Stage.RAW_REPORT),), picture="fake_flow:picture")
"""The real first stage, which asks the service that has the reports; and no other."""


def write_reports(folder: Path, behaviours: Mapping[str, str]) -> dict[str, ReportSource]:
    """One report per key with its behaviour as content."""
    folder.mkdir(parents=True, exist_ok=True)
    sources = {}
    for key, behaviour in behaviours.items():
        path = folder / f"{key}.txt"
        path.write_text(behaviour + "\n" if behaviour else "")
        sources[key] = ReportSource("file", str(path), sha256=str(hash(behaviour)))
    return sources


def broken(key: str) -> StageProduct:
    """A stage that breaks for every crash."""
    raise RuntimeError("the simulator is broken")
