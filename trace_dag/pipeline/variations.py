"""Families of stored crashes: made in parallel, kept under the root, read back as scenarios like the crashes.

``ROOT/variations/<key>.family.parquet`` lists a crash's family; each variation ``<key>-v001`` has, in the formats of
the crash's own artefacts, ``.estimate.json`` (the plan), ``.steps.parquet`` and ``.log.json`` (the simulation), and
``.json`` (what was changed and how it was made). A family is made anew as a whole. Belongs here: which crashes, the
workers, storage. Does not belong here: what a variation is (:mod:`trace_dag.variations`).
"""

from __future__ import annotations

import math
import traceback
from collections.abc import Callable, Collection, Mapping, Sequence
from dataclasses import asdict, dataclass, field, replace
from functools import cache
from typing import TYPE_CHECKING, Any

import numpy as np

from trace_dag.code_versions import code_version
from trace_dag.errors import DamagedFile, Failure, UserError
from trace_dag.evaluation.table import Row, rows_from_parquet, rows_to_parquet
from trace_dag.geometry import Pose
from trace_dag.pipeline.artefacts import ESTIMATE, MAP_REPORT, OSM_XML, RECORD, REPORT_XML, ROAD_MAP, VERDICT, XODR
from trace_dag.pipeline.batch import Pipeline
from trace_dag.pipeline.evaluations import StoredCase, load_case
from trace_dag.pipeline.executors import WorkerLost, make_executor, run_redoing_lost
from trace_dag.pipeline.ledgers import Complaint, raised, read_listed, sound_ledger, subjects, write_ledger
from trace_dag.settings import Settings
from trace_dag.sim.backends import backend
from trace_dag.sim.log_io import logs_from_files, logs_to_files
from trace_dag.sim.types import Participant, SimulationLog
from trace_dag.states.json_io import estimate_from_json, estimate_to_json
from trace_dag.states.types import EstimatorRun, Hypothesis, ParticipantState, StateEstimate
from trace_dag.storage import Storage, StoredFile
from trace_dag.variations.family import Criteria, Kind, Variation, family
from trace_dag.variations.perturbation import Bounds, Perturbation
from trace_dag.variations.table import VARIATIONS, row

if TYPE_CHECKING:
    from pydantic import TypeAdapter

FOLDER = "variations"
_CODE = ("trace_dag.variations.family", "trace_dag.sim.embedded")


@dataclass(frozen=True)
class FamilyRequest:
    """How families are made: members asked for, seed, how far they may go, and what they have to meet."""

    count: int = 10
    seed: int = 1
    bounds: Bounds = field(default_factory=Bounds)
    criteria: Criteria = field(default_factory=Criteria)


@dataclass(frozen=True)
class FamilyReport:
    """What came of one crash: how many were kept of how many drawn, and an error if it broke."""

    key: str
    kept: int = 0
    near_misses: int = 0
    drawn: int = 0
    error: str = ""


@dataclass(frozen=True)
class AboutVariation:
    """What a variation is, beside its plan and log."""

    variation_id: str
    key: str
    number: int
    kind: Kind
    gap_m: float
    friction: float
    perturbation: Perturbation
    request: FamilyRequest
    code_version: str
    verdict_fingerprint: str


@dataclass(frozen=True, eq=False)
class StoredVariation:
    """A variation as read: a scenario in the terms of any crash."""

    about: AboutVariation
    estimate: StateEstimate
    log: SimulationLog

    @property
    def hypothesis(self) -> Hypothesis:
        """The plan of all vehicles."""
        return self.estimate.best


@dataclass(frozen=True)
class _Task:
    storage: Storage
    settings: Settings
    case: StoredCase
    request: FamilyRequest


def make_families(
    pipeline: Pipeline,
    cases: Sequence[StoredCase],
    request: FamilyRequest,
    *,
    tell: Callable[[FamilyReport], None] = lambda _: None,
) -> list[FamilyReport]:
    """The families of some verified crashes, stored; in their order. ``tell`` hears of each crash as it is done."""
    settings = pipeline.settings
    tasks = [_Task(pipeline.storage, settings, case, request) for case in cases]
    executor = make_executor(settings.execution)
    reports: dict[str, FamilyReport] = {}
    try:
        for answer in run_redoing_lost(executor, _make, tasks, lambda task: [task]):
            found = answer.result
            key = answer.task.case.key
            reports[key] = FamilyReport(key, error=found.detail) if isinstance(found, WorkerLost) else found
            tell(reports[key])
    finally:
        executor.close()
    return [reports[case.key] for case in cases]


def _make(task: _Task) -> FamilyReport:
    try:
        return _make_family(task)
    except Failure as failure:
        return FamilyReport(task.case.key, error=str(failure))
    except Exception as error:
        # One crash without a family keeps no other from having one.
        return FamilyReport(task.case.key, error="".join(traceback.format_exception(error)))


def _make_family(task: _Task) -> FamilyReport:
    request, storage, stored = task.request, task.storage, task.case
    case = load_case(stored, task.settings, storage)
    contact = case.contact
    if contact is None:
        raise Failure(f"{stored.key}: its simulation has no contact; run it again")
    kept, drawn = family(
        case,
        backend(task.settings.sim),
        count=request.count,
        seed=request.seed,
        bounds=request.bounds,
        criteria=request.criteria,
    )
    files = stored.files(task.settings, storage)
    recorded = files.load(ESTIMATE).hypotheses[files.load(VERDICT).hypothesis]
    before = sound_ledger(storage, _subject(stored.key)).files
    code = code_version(_CODE).digest
    rows = []
    written: list[StoredFile] = []
    for variation in kept:
        written += _store(storage, variation, recorded, request, code, stored.fingerprint)
        rows.append(
            row(
                variation,
                (contact.x_m, contact.y_m),
                seed=request.seed,
                code_version=code,
                verdict_fingerprint=stored.fingerprint,
            )
        )
    written.append(storage.write(_family_name(stored.key), rows_to_parquet(rows, VARIATIONS)))
    write_ledger(storage, _subject(stored.key), written)
    for gone in before.keys() - {file.name for file in written}:
        storage.delete(gone)
    near_misses = sum(variation.kind is Kind.NEAR_MISS for variation in kept)
    return FamilyReport(stored.key, len(kept), near_misses, drawn)


def _store(
    storage: Storage, variation: Variation, recorded: Hypothesis, request: FamilyRequest, code: str, fingerprint: str
) -> list[StoredFile]:
    case, name = variation.case, f"{FOLDER}/{variation.variation_id}"
    about = AboutVariation(
        variation.variation_id,
        case.key,
        variation.number,
        variation.kind,
        variation.gap_m,
        case.friction,
        variation.perturbation,
        request,
        code,
        fingerprint,
    )
    estimate = StateEstimate(case.key, (_as_hypothesis(recorded, variation),), EstimatorRun("variation", "1"))
    steps, summary = logs_to_files([case.recorded])
    return [
        storage.write(f"{name}.estimate.json", estimate_to_json(estimate)),
        storage.write(f"{name}.steps.parquet", steps),
        storage.write(f"{name}.log.json", summary),
        storage.write(f"{name}.json", _abouts().dump_json(about, indent=1)),
    ]


def _as_hypothesis(recorded: Hypothesis, variation: Variation) -> Hypothesis:
    """The variation's plan in the terms of an estimate; where it was planned to hit, it does not say."""
    case, contact = variation.case, variation.case.contact
    by_number = {each.number: each for each in case.participants}
    return replace(
        recorded,
        name=f"{recorded.name}, {variation.variation_id}",
        participants=tuple(
            _as_state(state, by_number[state.vehicle_number], case.impact_time_s) for state in recorded.participants
        ),
        impact_time_s=case.impact_time_s,
        impact_point_xy_m=recorded.impact_point_xy_m if contact is None else (contact.x_m, contact.y_m),
        checks=(),
    )


def _as_state(state: ParticipantState, participant: Participant, impact_time_s: float) -> ParticipantState:
    t = participant.trajectory
    x, y, z, heading, speed = (
        float(np.interp(impact_time_s, t.time_s, values))
        for values in (t.x_m, t.y_m, t.z_m, np.unwrap(t.heading_rad), t.speed_mps)
    )
    return replace(
        state,
        initial_pose=participant.initial_pose,
        initial_speed_mps=participant.initial_speed_mps,
        trajectory=t,
        impact_pose=Pose(x, y, math.remainder(heading, math.tau), z),
        impact_speed_mps=speed,
        impact_clock_h=None,
    )


# --- reading -------------------------------------------------------------------------------------------------------
def read_variation(storage: Storage, name: str) -> StoredVariation:
    """A stored variation by its id. Raises :class:`DamagedFile` where it is not as its family's ledger says."""
    key = name.rpartition("-")[0]

    def read(extension: str) -> bytes:
        return _read(storage, key, f"{FOLDER}/{name}.{extension}")

    about = _abouts().validate_json(read("json"))
    estimate = estimate_from_json(read("estimate.json"), name=name)
    (log,) = logs_from_files(read("steps.parquet"), read("log.json"))
    return StoredVariation(about, estimate, log)


def stored_variations(
    pipeline: Pipeline, cases: Sequence[StoredCase], *, complain: Complaint = raised
) -> list[StoredCase]:
    """The stored variations of some crashes that were made of them as they are now.

    ``complain`` hears of the families that are damaged. Raises :class:`UserError` if there are no variations.
    """
    of_crash = {case.key: case for case in cases}
    found = [
        replace(of_crash[key], variation=each["variation_id"])
        for key, rows in _families(pipeline.storage, complain, of_crash).items()
        for each in rows
        if each["verdict_fingerprint"] == of_crash[key].fingerprint
    ]
    if not found:
        raise UserError(f"no variation of the {len(cases)} crashes asked for is stored; trace-dag vary makes them")
    return found


def all_rows(storage: Storage, *, complain: Complaint = raised) -> list[Row]:
    """Every stored variation as a row; ``complain`` hears of the families that are damaged."""
    return [each for rows in _families(storage, complain).values() for each in rows]


def _families(storage: Storage, complain: Complaint, keys: Collection[str] | None = None) -> dict[str, list[Row]]:
    """The lists of the families there are, of some crashes or all, by key."""
    listed = {subject.rpartition("/")[2] for subject in subjects(storage, FOLDER)}
    there = {name for name in storage.list(FOLDER) if name.endswith(".family.parquet")}
    listed |= {name.rpartition("/")[2].partition(".")[0] for name in there}
    found = {}
    for key in sorted(listed if keys is None else listed & set(keys)):
        try:
            found[key] = rows_from_parquet(_read(storage, key, _family_name(key)))
        except DamagedFile as damaged:
            complain(damaged)
    return found


def _read(storage: Storage, key: str, name: str) -> bytes:
    return read_listed(
        storage, _subject(key), name, remedy=f"trace-dag vary --only {key} makes the crash's variations again"
    )


def _subject(key: str) -> str:
    return f"{FOLDER}/{key}"


def _family_name(key: str) -> str:
    return f"{FOLDER}/{key}.family.parquet"


@cache
def _abouts() -> TypeAdapter[AboutVariation]:
    from pydantic import TypeAdapter

    return TypeAdapter(AboutVariation)


# --- packages ------------------------------------------------------------------------------------------------------
def package_of(pipeline: Pipeline, stored: StoredCase) -> Mapping[str, bytes]:
    """The scenario package of a variation, like that of a crash; a verdict beside it says how it compares with the
    report."""
    from trace_dag.scenario.package import PackageInput, package_files
    from trace_dag.verdict.judge import judge

    if stored.variation is None:
        raise ValueError(f"{stored.key} is no variation")
    files = stored.files(pipeline.settings, pipeline.storage)
    varied = read_variation(pipeline.storage, stored.variation)
    record, network, map_report = files.load(RECORD), files.load(ROAD_MAP), files.load(MAP_REPORT)
    about: dict[str, Any] = _abouts().dump_python(varied.about, mode="json")
    verdict = judge(record, network, map_report, varied.estimate, [varied.log], pipeline.settings.verdict)
    return package_files(
        PackageInput(
            record=record,
            report_xml=files.load(REPORT_XML),
            osm_xml=files.load(OSM_XML),
            map_xodr=files.load(XODR),
            provenance={"variation": {"code": varied.about.code_version, "request": asdict(varied.about.request)}},
            network=network,
            map_report=map_report,
            estimate=varied.estimate,
            log=varied.log,
            verdict=verdict,
            variation=about,
        )
    )
