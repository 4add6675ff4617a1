"""Traffic around stored crashes, made in parallel and stored under the root, crash by crash.

``ROOT/traffic/<key>.traffic.json`` has the vehicles and the parameters of their making; the Parquet file of the same
name has a row for each class of road on the map.
"""

from __future__ import annotations

import resource
import time
from collections.abc import Callable, Sequence
from dataclasses import asdict, dataclass, replace
from functools import partial

import numpy as np

from trace_dag.agents.evaluation.table import Row, rows_from_parquet, rows_to_parquet
from trace_dag.agents.evaluation.traffic import Traffic
from trace_dag.agents.stored_cases import StoredCase, load_case, report_each
from trace_dag.common.dataclass_tools import json_adapter
from trace_dag.common.errors import DamagedFile, UserError
from trace_dag.common.provenance import crash_of
from trace_dag.common.schemas import TableSchema
from trace_dag.common.stage import Stage
from trace_dag.common.storage.files import Storage, StoredFile
from trace_dag.flow.artefacts import RECORD, ROAD_MAP, XODR, CrashArtefacts
from trace_dag.flow.contract import CrashFiles
from trace_dag.flow.manifests import list_files, read_listed, sound_manifest
from trace_dag.flow.records import OnProblem
from trace_dag.flow.workspace import Workspace
from trace_dag.scenario.cases import MOST_TIMES, Case
from trace_dag.scenario.drives import drives_of
from trace_dag.scenario.lights import crash_lights
from trace_dag.scenario.traffic.simulation import TrafficRequest, load_traci, surround
from trace_dag.scenario.traffic.sumo_network import sumo_program
from trace_dag.scenario.traffic.surrounding import STEP_S, SurroundingTraffic, overlapping
from trace_dag.scenario.traffic.volumes import Hour, hour_of
from trace_dag.simulation.run import backend

FOLDER = "traffic"
VERSION = "3"
"""Number of the code that makes traffic; see :data:`trace_dag.flow.stages.VERSIONS`."""

TRAFFIC = TableSchema.of_csv(
    "trace_dag.agents",
    "traffic",
    "Traffic around verified crashes by class of road, measured in the minute before they begin",
)


@dataclass(frozen=True, eq=False)
class StoredTraffic:
    """Stored traffic: its crash, request, parameters and vehicles."""

    key: str
    request: TrafficRequest
    at: Hour
    code_version: str
    verdict_fingerprint: str
    traffic: SurroundingTraffic


@dataclass(frozen=True)
class TrafficReport:
    """The traffic of one crash: vehicles, those left out, processor time (s), and the error if it broke."""

    key: str
    vehicles: int = 0
    left_out: int = 0
    cpu_s: float = 0.0
    error: str = ""


def make_traffic(
    workspace: Workspace,
    cases: Sequence[StoredCase],
    request: TrafficRequest,
    *,
    on_progress: Callable[[TrafficReport], None] = lambda _: None,
) -> list[TrafficReport]:
    """Make and store the traffic of some verified crashes; return the reports in order.

    ``on_progress`` is called with each finished crash. Raises :class:`UserError` without SUMO.
    """
    sumo_program("sumo"), sumo_program("netconvert"), load_traci()
    return report_each(workspace, cases, partial(_make, request), TrafficReport, on_progress)


def _make(request: TrafficRequest, stored: StoredCase) -> TrafficReport:
    files, began_s = stored.files.unread(), _cpu_s()
    log, record, network = files.shown_log(), files.load(RECORD), files.load(ROAD_MAP)
    assert log is not None, "a verified crash was simulated"
    at, lights = hour_of(record), next(iter(crash_lights(record, network, log)), None)
    traffic = surround(stored.key, network, files.load(XODR), log, at, request, lights)
    about = StoredTraffic(stored.key, request, at, VERSION, stored.fingerprint, traffic)
    beside = {
        "key": stored.key,
        **at._asdict(),
        **asdict(request),
        "vehicles": len(traffic.vehicles),
        "left_out": traffic.left_out,
        "code_version": VERSION,
        "verdict_fingerprint": stored.fingerprint,
    }
    rows = [{**beside, **asdict(each)} for each in traffic.measured]
    name = traffic_name(stored.key)
    written = [
        files.storage.write(name, traffic_to_json(about)),
        files.storage.write(_rows_name(name), rows_to_parquet(rows, TRAFFIC)),
    ]
    list_files(files.storage, FOLDER, written)
    return TrafficReport(stored.key, len(traffic.vehicles), traffic.left_out, _cpu_s() - began_s)


def _cpu_s() -> float:
    """Return the processor time of this process and of its ended children, s."""
    of_others = resource.getrusage(resource.RUSAGE_CHILDREN)
    return time.process_time() + of_others.ru_utime + of_others.ru_stime


def read_traffic(crash: CrashArtefacts) -> StoredTraffic | None:
    """Return the traffic made for the present verdict of a stored crash, or None.

    Raises :class:`DamagedFile`.
    """
    if not isinstance(crash, CrashFiles) or Stage.VERDICT not in crash.records:
        return None
    name = traffic_name(crash.key)
    if name not in sound_manifest(crash.storage, FOLDER).files:
        return None
    found = json_adapter(StoredTraffic).validate_json(_read(crash.storage, crash.key, name))
    return found if found.verdict_fingerprint == crash.records[Stage.VERDICT].fingerprint else None


def traffic_of(crash: CrashArtefacts) -> SurroundingTraffic | None:
    """Return the vehicles of :func:`read_traffic`."""
    stored = read_traffic(crash)
    return None if stored is None else stored.traffic


def load_driven(stored: StoredCase, traffic: Traffic) -> Case:
    """Return a case as it is driven in a kind of traffic: among surrounding vehicles if that is asked for.

    They are on the map from the beginning to the crash's end, follow their motion whatever the agent does, and brake to
    stand after it. Vehicles are left out that are in the way of a party without the crash, or that touch another one:
    bodies do not follow SUMO's sideways motion exactly. Raises :class:`UserError` if no traffic was made.
    """
    case = load_case(stored)
    if traffic is not Traffic.SURROUNDING:
        return case
    traffic_around = traffic_of(stored.files) if stored.case_id == stored.key else None
    if traffic_around is None:
        why = "trace-dag traffic makes it; variations and courses have none"
        raise UserError(f"{stored.case_id} has no surrounding traffic: {why}")
    times = np.arange(0.0, case.end_s + STEP_S / 2, STEP_S)
    parties = {
        each.number: (each.participant.body, (each.course[:, 0], each.course[:, 1], each.course[:, 3]))
        for each in drives_of(case)
    }
    vehicles = [each.stopping for each in traffic_around.throughout(case.recorded.duration_s)]
    left_out = overlapping(vehicles, parties, times)
    simulation = backend(stored.files.settings.sim).load(case.network, case.xodr, friction=case.friction)
    while True:
        around = tuple(each.participant for each in vehicles if each.number not in left_out)
        alone = simulation.run(around, time_limit_s=MOST_TIMES * case.end_s) if around else None
        if alone is None or not alone.contacts:
            return replace(case, participants=(*case.participants, *around))
        left_out |= {max(each.number_1, each.number_2) for each in alone.contacts}


def traffic_files(storage: Storage) -> dict[str, list[StoredFile]]:
    """Return the files of the traffic around each crash that has some, by key."""
    found: dict[str, list[StoredFile]] = {}
    for name, file in sorted(sound_manifest(storage, FOLDER).files.items()):
        found.setdefault(crash_of(name), []).append(file)
    return found


def all_rows(storage: Storage, *, on_problem: OnProblem) -> list[Row]:
    """Return all stored rows of :data:`TRAFFIC`.

    ``on_problem`` is called with the error of each damaged file.
    """
    found: list[Row] = []
    for name in sorted(sound_manifest(storage, FOLDER).files):
        if name.endswith(".parquet"):
            try:
                found += rows_from_parquet(_read(storage, crash_of(name), name))
            except DamagedFile as damaged:
                on_problem(damaged)
    return found


def _read(storage: Storage, key: str, name: str) -> bytes:
    return read_listed(storage, name, remedy=f"trace-dag traffic --only {key} makes the crash's traffic again")


def traffic_name(key: str) -> str:
    """Return the path below the root of the traffic around a crash."""
    return f"{FOLDER}/{key}.traffic.json"


def _rows_name(name: str) -> str:
    return name.removesuffix(".json") + ".parquet"


def traffic_to_json(traffic: StoredTraffic) -> bytes:
    """Return traffic as UTF-8 JSON, ending with a newline."""
    return json_adapter(StoredTraffic).dump_json(traffic) + b"\n"
