"""The seven stages: thin functions between stored artefacts and the domain packages.

Belongs here: which entry point of a domain package makes which artefact from which others, and the few figures of it
that a person looks at first. Does not belong here: how any of it is done. Domain packages are imported where they are
used, so that a worker loads only what its stages need.
"""

from __future__ import annotations

import hashlib
import os
import tempfile
from collections.abc import Mapping, Sequence
from functools import cache, lru_cache
from pathlib import Path
from typing import TYPE_CHECKING

from trace_dag.errors import Failure, Reason, Rejection, Stage
from trace_dag.pipeline.flow import CrashFiles, Figure, Flow, StageDefinition, StageProduct
from trace_dag.pipeline.registry import MapFile, MapServiceName
from trace_dag.storage import Storage

if TYPE_CHECKING:
    from pydantic import TypeAdapter

    from trace_dag.crash.record import CrashRecord
    from trace_dag.osm.catalog import MapCatalog
    from trace_dag.osm.types import OsmExtract, Site
    from trace_dag.roads.network import RoadNetwork
    from trace_dag.roads.report import MapReport
    from trace_dag.settings import Settings, SimSettings, StateSettings
    from trace_dag.sim.types import Backend, SimulationLog
    from trace_dag.states.llm.client import LlmClient
    from trace_dag.states.types import EstimatorRun, StateEstimate
    from trace_dag.verdict.types import Verdict


# --- artefacts as the later stages read them ---------------------------------------------------------------------
def record_of(crash: CrashFiles) -> CrashRecord:
    """The stored crash record."""
    from trace_dag.crash.tables import record_from_parquet

    return crash.parsed(Stage.CRASH_RECORD, "parquet", record_from_parquet)


def extract_of(crash: CrashFiles) -> OsmExtract:
    """The stored OSM extract."""
    from trace_dag.osm.xml import read_osm

    return crash.parsed(Stage.OSM_EXTRACT, "osm", lambda data: read_osm(data, name=f"{crash.key}.osm"))


def network_of(crash: CrashFiles) -> RoadNetwork:
    """The stored road map, read back from its OpenDRIVE file."""
    from trace_dag.roads.opendrive_reader import read_opendrive

    return crash.parsed(Stage.ROAD_MAP, "xodr", lambda data: read_opendrive(data, name=f"{crash.key}.xodr"))


def map_report_of(crash: CrashFiles) -> MapReport:
    """What is recorded beside the road map."""
    return crash.parsed(Stage.ROAD_MAP, "json", lambda data: _map_reports().validate_json(data))


def estimate_of(crash: CrashFiles) -> StateEstimate:
    """The stored state estimate."""
    from trace_dag.states.json_io import estimate_from_json

    return crash.parsed(Stage.STATE_ESTIMATE, "json", estimate_from_json)


def logs_of(crash: CrashFiles) -> tuple[SimulationLog, ...]:
    """The stored simulation logs, one per hypothesis."""
    from trace_dag.sim.log_io import logs_from_files

    summary = crash.read(Stage.SIMULATION_LOG, "json")
    return crash.parsed(Stage.SIMULATION_LOG, "parquet", lambda steps: logs_from_files(steps, summary))


def verdict_of(crash: CrashFiles) -> Verdict:
    """The stored verdict."""
    from trace_dag.verdict.json_io import verdict_from_json

    return crash.parsed(Stage.VERDICT, "json", verdict_from_json)


@cache
def _map_reports() -> TypeAdapter[MapReport]:
    from pydantic import TypeAdapter

    from trace_dag.roads.report import MapReport

    return TypeAdapter(MapReport)


# --- the stages ----------------------------------------------------------------------------------------------------
def raw_report(crash: CrashFiles) -> StageProduct:
    """The report as its source serves it."""
    from trace_dag.crash.folder import identify

    source = crash.source.report
    try:
        if source.kind == "file":
            data = Path(source.location).read_bytes()
        elif source.kind == "stored":
            data = crash.storage.read(source.location)
        else:
            from trace_dag.pipeline.services import crash_api

            data = crash_api(crash.settings.services, crash.storage).report(crash.key)
    except FileNotFoundError as error:
        raise Failure(f"{source.location}: the report is no longer there; put it back or ingest it again") from error
    if source.sha256 and hashlib.sha256(data).hexdigest() != source.sha256:
        raise Failure(f"{source.location}: the report has changed since it was registered; ingest it again")
    try:
        found = identify(data, name=source.location)
    except Rejection:
        found = None  # what cannot be read is the next stage's to say
    if found is not None and not found[1]:
        raise Rejection(Reason.NOT_RELEASED, "The report holds no case: it is not released yet.")
    return StageProduct({"xml": data}, {"source": source.kind, "bytes": len(data)})


def crash_record(crash: CrashFiles) -> StageProduct:
    """The report as a typed record, if it says enough; a record that does not is kept to look at."""
    from trace_dag.crash.completeness import check
    from trace_dag.crash.parse import read_report
    from trace_dag.crash.tables import record_to_parquet

    settings = crash.settings.crash
    name = f"{crash.key}.xml"  # not where the report came from: a copy of it gives the same result
    record = read_report(crash.read(Stage.RAW_REPORT, "xml"), name=name, settings=settings, expected_key=crash.key)
    rejection = None
    try:
        check(record, settings)
    except Rejection as shortcoming:
        rejection = shortcoming
    figures: dict[str, Figure] = {
        "summary": record.summary,
        "vehicles": len(record.vehicles),
        "collision_type": record.collision_type.value,
        "road_topology": record.road_topology.value,
        "vehicle_trajectory": record.vehicle_trajectory.value,
        "latitude_deg": record.latitude_deg,
        "longitude_deg": record.longitude_deg,
        "contradictions": "; ".join(record.contradictions),
    }
    return StageProduct({"parquet": record_to_parquet(record)}, figures, rejection)


def osm_extract(crashes: Sequence[CrashFiles]) -> Mapping[str, StageProduct | Rejection | Failure]:
    """The roads around each crash, in one pass over each map file; where none covers it, from the cohort's service."""
    from trace_dag.osm.types import Site
    from trace_dag.osm.xml import write_osm

    answers: dict[str, StageProduct | Rejection | Failure] = {}
    by_maps: dict[tuple[tuple[MapFile, ...], MapServiceName | None], list[CrashFiles]] = {}
    for crash in crashes:
        by_maps.setdefault((crash.source.maps, crash.source.map_service), []).append(crash)
    for (maps, service), together in by_maps.items():
        records = {crash.key: record_of(crash) for crash in together}
        sites = [Site(key, record.latitude_deg, record.longitude_deg) for key, record in records.items()]
        found: dict[str, OsmExtract | Rejection | Failure] = {
            **map_catalog(maps, together[0].storage).extract(sites, together[0].settings.osm)
        }
        if service is not None:
            uncovered = [site for site in sites if isinstance(found[site.key], Rejection)]
            found.update(_ask_map_service(service, uncovered, together[0].settings, together[0].storage))
        for key, answer in found.items():
            if isinstance(answer, Rejection | Failure):
                answers[key] = answer
                continue
            figures: dict[str, Figure] = {
                "ways": len(answer.ways),
                "nodes": len(answer.nodes),
                "turn_restrictions": len(answer.relations),
                "source": answer.source,
                "data_timestamp": answer.data_timestamp,
                "attribution": answer.attribution,
            }
            answers[key] = StageProduct({"osm": write_osm(answer)}, figures)
    return answers


def _ask_map_service(
    name: MapServiceName, sites: Sequence[Site], settings: Settings, storage: Storage
) -> dict[str, OsmExtract | Rejection | Failure]:
    """Extracts from a public service, one by one: what it does not give for one site keeps no other from its own."""
    from trace_dag.pipeline.services import map_service

    source = map_service(name, settings.services, storage)
    answers: dict[str, OsmExtract | Rejection | Failure] = {}
    for site in sites:
        try:
            answers.update(source.extract([site], settings.osm))
        except Failure as failure:
            answers[site.key] = failure
    return answers


def by_map_files(crashes: Sequence[CrashFiles]) -> list[list[str]]:
    """Crashes that lie in the same map files together, so that a file is read once; small groups joined.

    Those that lie in none have nothing to read together.
    """
    most = crashes[0].settings.execution.chunk_size
    groups: dict[tuple[tuple[MapFile, ...], tuple[int, ...]], list[str]] = {}
    for crash in crashes:
        figures = crash.figures(Stage.CRASH_RECORD)
        latitude_deg, longitude_deg = float(figures["latitude_deg"] or 0), float(figures["longitude_deg"] or 0)
        boxes = [file.header.box for file in map_catalog(crash.source.maps, crash.storage).files]
        covering = tuple(
            index for index, box in enumerate(boxes) if box is None or box.contains(latitude_deg, longitude_deg)
        )
        groups.setdefault((crash.source.maps, covering), []).append(crash.key)
    alone = [keys for (_, covering), keys in groups.items() if not covering]
    shared = [keys for (_, covering), keys in groups.items() if covering]
    pieces = [keys[start : start + most] for keys in alone for start in range(0, len(keys), most)]
    joined: list[list[str]] = []
    for group in sorted([*shared, *pieces], key=len, reverse=True):
        if joined and len(joined[-1]) + len(group) <= most:
            joined[-1].extend(group)
        else:
            joined.append(group)
    return joined


@lru_cache(maxsize=8)
def map_catalog(maps: tuple[MapFile, ...], storage: Storage) -> MapCatalog:
    """The map files of a cohort; opened once per process."""
    from trace_dag.osm.catalog import MapCatalog

    return MapCatalog.open([_local_map(file, storage) for file in maps])


def _local_map(file: MapFile, storage: Storage) -> Path:
    """A map file where it can be read from disk; one kept in storage is fetched once per machine."""
    if not file.stored:
        path = Path(file.location)
        if not path.is_file():
            raise Failure(f"{path}: the map file is no longer there; put it back or ingest the maps again")
        return path
    cache = Path(tempfile.gettempdir()) / f"trace-dag-maps-{os.getuid()}"
    copy = cache / file.location
    if not copy.is_file() or copy.stat().st_size != file.size:
        Storage(cache).write(file.location, storage.read(file.location))
    return copy


def road_map(crash: CrashFiles) -> StageProduct:
    """The OpenDRIVE road map, with the crash's place on it, its gates and its agreement with the report."""
    from trace_dag.roads.build import build_road_map

    built = build_road_map(extract_of(crash), record_of(crash), crash.settings.roads)
    report = built.report
    figures: dict[str, Figure] = {
        "roads": report.roads,
        "junctions": report.junctions,
        "converter": report.converter,
        "moved_m": report.placement.moved_m,
        "matched_by": report.placement.matched_by,
        "gates_passed": sum(gate.passed is True for gate in report.gates),
        "gates_failed": sum(gate.passed is False for gate in report.gates),
        "attributes_that_differ": sum(each.agreement == "differs" for each in report.comparisons),
    }
    files = {"xodr": built.stored.xodr, "json": _map_reports().dump_json(report, indent=1)}
    return StageProduct(files, figures, parsed={"xodr": built.stored.network})


@lru_cache(maxsize=1)
def llm_client_of(settings: StateSettings, storage: Storage, run_id: str) -> LlmClient:
    """One client per process and run; answers, budget and rate are kept in storage, where all workers find them."""
    from trace_dag.states.estimate import llm_client

    return llm_client(settings, files=storage, ledger=run_id or "run")


def road_map_requires(settings: Settings) -> None:
    """The converter the settings name has to be installed."""
    if settings.roads.converter == "osm2odr":
        from trace_dag.roads.osm2odr import require_osm2odr

        require_osm2odr()


def state_estimate(crash: CrashFiles) -> StageProduct:
    """Where the vehicles came from and how fast: hypotheses, best first."""
    from trace_dag.states.estimate import estimate
    from trace_dag.states.json_io import estimate_to_json, run_to_json
    from trace_dag.states.llm.estimator import UnusableAnswers

    settings = crash.settings.states
    llm = llm_client_of(settings, crash.storage, crash.run_id) if settings.estimator == "llm" else None
    try:
        made = estimate(record_of(crash), network_of(crash), map_report_of(crash), settings, llm=llm)
    except UnusableAnswers as unusable:
        return StageProduct({"answers.json": run_to_json(unusable.run)}, _run_figures(unusable.run), unusable)
    best = made.best
    figures: dict[str, Figure] = {
        **_run_figures(made.run),
        "hypotheses": len(made.hypotheses),
        "best": best.name,
        "ambiguity": made.ambiguity,
        "evidence": ", ".join(f"{term} {value:+.2f}" for term, value in best.evidence.items() if value),
        "impact_time_s": best.impact_time_s,
    }
    for state in best.participants:
        figures[f"vehicle_{state.vehicle_number}"] = (
            f"{state.manoeuvre}, {state.initial_speed_mps:.1f} m/s ({state.speed_source})"
        )
    return StageProduct({"json": estimate_to_json(made)}, figures)


def _run_figures(run: EstimatorRun) -> dict[str, Figure]:
    figures: dict[str, Figure] = {"estimator": run.estimator}
    if run.model is not None:
        figures |= {
            "model": run.model,
            "attempts": run.attempts,
            "fallback": run.fallback,
            "tokens": run.prompt_tokens + run.completion_tokens,
            "cost_usd": run.cost_usd,
        }
    return figures


def simulation_log(crash: CrashFiles) -> StageProduct:
    """All hypotheses simulated; a crash none of which collides is rejected, its logs kept."""
    from trace_dag.sim.log_io import logs_to_files
    from trace_dag.sim.run import simulate

    settings = crash.settings.sim
    logs = simulate(
        backend(settings),
        network_of(crash),
        crash.read(Stage.ROAD_MAP, "xodr"),
        estimate_of(crash),
        settings,
        record=record_of(crash),
    )
    steps, summary = logs_to_files(logs)
    collided = [log for log in logs if log.first_contact is not None]
    shown = collided[0] if collided else logs[0]
    figures: dict[str, Figure] = {
        "backend": f"{shown.backend} {shown.backend_version}",
        "hypotheses": len(logs),
        "hypotheses_that_collide": len(collided),
        "termination": shown.termination.value,
        "simulated_s": shown.duration_s,
    }
    if shown.first_contact is not None:
        figures["contact_time_s"] = shown.first_contact.time_s
        figures["closing_speed_mps"] = shown.first_contact.closing_speed_mps
    rejection = None
    if not collided:
        rejection = Rejection(
            Reason.NO_COLLISION,
            f"The vehicles do not touch in any of {len(logs)} simulated hypotheses ({shown.reason}).",
            measured=0.0,
            threshold=1.0,
        )
    return StageProduct({"parquet": steps, "json": summary}, figures, rejection)


def simulation_log_requires(settings: Settings) -> None:
    """The simulator the settings name has to be there."""
    if settings.sim.backend == "carla":
        from trace_dag.sim.carla_backend import require_carla

        require_carla(settings.sim)


@lru_cache(maxsize=1)
def backend(settings: SimSettings) -> Backend:
    """The back-end the settings name, connected once per process."""
    if settings.backend == "embedded":
        from trace_dag.sim.embedded import EmbeddedBackend

        return EmbeddedBackend(settings)
    from trace_dag.sim.carla_backend import CarlaBackend

    return CarlaBackend(settings)


def verdict(crash: CrashFiles) -> StageProduct:
    """Every criterion with its value and threshold, and whether they hold together."""
    from trace_dag.verdict.json_io import verdict_to_json
    from trace_dag.verdict.judge import judge

    found = judge(
        record_of(crash),
        network_of(crash),
        map_report_of(crash),
        estimate_of(crash),
        logs_of(crash),
        crash.settings.verdict,
    )
    figures: dict[str, Figure] = {"rule_set": found.rule_set, "hypothesis": found.hypothesis}
    for criterion in found.criteria:
        if criterion.threshold is None:  # reported only; the artefact and the warehouse have it
            continue
        vehicle = f" of vehicle {criterion.vehicle_number}" if criterion.vehicle_number is not None else ""
        held = {True: "pass", False: "fail", None: "not judged"}[criterion.passed]
        value = "not evaluated"
        if criterion.value is not None:
            value = f"{round(criterion.value, 2) + 0.0:g} {criterion.unit}".rstrip()  # no minus before a zero
        figures[f"{criterion.name}{vehicle}"] = f"{value} ({held})"
    rejection = None
    if not found.accepted:
        reason = found.reason or Reason.WRONG_LOCATION
        broken = next((each for each in found.criteria if each.reason is reason and each.passed is False), None)
        rejection = Rejection(
            reason,
            found.detail,
            measured=broken.value if broken else None,
            threshold=broken.threshold if broken else None,
        )
    return StageProduct({"json": verdict_to_json(found)}, figures, rejection)


def picture(crash: CrashFiles) -> dict[str, bytes]:
    """What is known of a crash from above; nothing while it has no road map."""
    if not crash.has(Stage.ROAD_MAP, "xodr"):
        return {}
    from trace_dag.scenario.pictures import as_png, as_thumbnail, draw_crash
    from trace_dag.scenario.sketch import draw_sketch

    estimate = estimate_of(crash) if crash.has(Stage.STATE_ESTIMATE, "json") else None
    judged = verdict_of(crash) if crash.has(Stage.VERDICT, "json") else None
    log = None
    if crash.has(Stage.SIMULATION_LOG, "json"):
        log = logs_of(crash)[judged.hypothesis if judged else 0]
    drawn = draw_crash(record_of(crash), network_of(crash), map_report_of(crash), estimate, log, judged)
    sketch = draw_sketch(network_of(crash), log).encode()
    return {"png": as_png(drawn), "webp": as_thumbnail(drawn), "svg": sketch}


# --- the flow ------------------------------------------------------------------------------------------------------
_RECORD: tuple[Stage, str] = (Stage.CRASH_RECORD, "parquet")
_MAP: tuple[tuple[Stage, str], ...] = ((Stage.ROAD_MAP, "xodr"), (Stage.ROAD_MAP, "json"))
_ESTIMATE: tuple[Stage, str] = (Stage.STATE_ESTIMATE, "json")
_LOGS: tuple[tuple[Stage, str], ...] = ((Stage.SIMULATION_LOG, "parquet"), (Stage.SIMULATION_LOG, "json"))
_READS_RECORD, _READS_NETWORK = "trace_dag.crash.tables", "trace_dag.roads.opendrive_reader"
_READS_ESTIMATE, _READS_LOGS = "trace_dag.states.json_io", "trace_dag.sim.log_io"

FLOW = Flow(
    stages=(
        StageDefinition(
            Stage.RAW_REPORT,
            function=raw_report,
            from_source=("report",),
            code=("trace_dag.crash.folder",),
        ),
        StageDefinition(
            Stage.CRASH_RECORD,
            function=crash_record,
            inputs=((Stage.RAW_REPORT, "xml"),),
            settings="crash",
            code=("trace_dag.crash.parse", "trace_dag.crash.completeness", _READS_RECORD),
        ),
        StageDefinition(
            Stage.OSM_EXTRACT,
            batch_function=osm_extract,
            grouping=by_map_files,
            inputs=(_RECORD,),
            from_source=("maps",),
            settings="osm",
            code=("trace_dag.osm.catalog", "trace_dag.osm.services", "trace_dag.osm.xml", _READS_RECORD),
        ),
        StageDefinition(
            Stage.ROAD_MAP,
            function=road_map,
            inputs=(_RECORD, (Stage.OSM_EXTRACT, "osm")),
            settings="roads",
            code=("trace_dag.roads.build", "trace_dag.roads.opendrive_writer", "trace_dag.osm.xml", _READS_RECORD),
            requires=road_map_requires,
        ),
        StageDefinition(
            Stage.STATE_ESTIMATE,
            function=state_estimate,
            inputs=(_RECORD, *_MAP),
            settings="states",
            code=("trace_dag.states.estimate", _READS_ESTIMATE, _READS_RECORD, _READS_NETWORK),
        ),
        StageDefinition(
            Stage.SIMULATION_LOG,
            function=simulation_log,
            inputs=(_RECORD, _MAP[0], _ESTIMATE),
            settings="sim",
            requires=simulation_log_requires,
            code=(
                "trace_dag.sim.run",
                "trace_dag.sim.embedded",
                "trace_dag.sim.carla_backend",
                _READS_LOGS,
                _READS_RECORD,
                _READS_NETWORK,
                _READS_ESTIMATE,
            ),
        ),
        StageDefinition(
            Stage.VERDICT,
            function=verdict,
            inputs=(_RECORD, *_MAP, _ESTIMATE, *_LOGS),
            settings="verdict",
            code=(
                "trace_dag.verdict.judge",
                "trace_dag.verdict.json_io",
                _READS_RECORD,
                _READS_NETWORK,
                _READS_ESTIMATE,
                _READS_LOGS,
            ),
        ),
    ),
    picture=picture,
)
