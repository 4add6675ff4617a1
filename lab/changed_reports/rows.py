"""One changed report of one crash, through all stages, to the row of what came of it; runs in the workers.

Every changed report has a temporary storage of its own, so that no stored artefact is touched. Results that cannot
differ are copied: the extract if the place is the same, the road map if everything that maps depend on is the same.
Does not belong here: which crashes are changed and how (:mod:`lab.changed_reports.study`).
"""

from __future__ import annotations

import hashlib
import json
import math
import tempfile
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

from lab.changed_reports.kinds import KINDS, Changed, Needs, perturb
from lab.changed_reports.places import is_same_street, random_point
from lab.changed_reports.scene import PerturbedScene, Point
from trace_dag.common.errors import Reason
from trace_dag.common.geometry import LocalFrame
from trace_dag.common.provenance import Outcome, OutcomeRecord
from trace_dag.common.stage import Stage
from trace_dag.common.storage.files import Storage
from trace_dag.crash.classes import CollisionType, VehicleTrajectory
from trace_dag.crash.record import CrashRecord, PreCrashMovement
from trace_dag.flow.artefacts import MAP_REPORT, RECORD, VERDICT, VERDICT_JSON, report_file
from trace_dag.flow.cohorts.registry import CrashSource, RegisteredMap, ReportSource
from trace_dag.flow.contract import CrashFiles
from trace_dag.flow.crash_status import FinalState, status_of_valid
from trace_dag.flow.records import Records
from trace_dag.flow.stored_crashes import StoredCrash, read_judged
from trace_dag.flow.tasks import Chunk, CrashTask, Work
from trace_dag.flow.worker import work_on_chunk
from trace_dag.osm.types import OsmExtract
from trace_dag.osm.xml import read_osm
from trace_dag.verdict.controls import JudgedCrash, in_place_of
from trace_dag.verdict.judge import judge_hypothesis

FARTHEST_M = 1000.0
"""Largest distance at which a report is set down from its crash."""
_REPORT = "report.json"


@dataclass(frozen=True)
class PerturbedRow:
    """One changed report of one crash, and what came of it.

    ``verified`` is None where nothing was judged: no map covers the place, or a stage failed. ``own_verified``: whether
    the unchanged simulation is verified by the changed report, the location left its own; no if its record is rejected.
    ``moved_m``: the changed report's place from the crash's. ``same_street``: whether the place lies on a street the
    report names; for reports set down elsewhere alone. ``support`` and ``grade`` are the verdict's, None where it has
    none.
    """

    key: str
    perturbation: str
    draw: int
    seed: int
    detail: str = ""
    other_key: str | None = None
    final_state: FinalState = FinalState.REJECTED
    stage_reached: Stage | None = None
    reason: Reason | None = None
    outcome_detail: str = ""
    verified: bool | None = None
    grade: str | None = None
    support: float | None = None
    own_verified: bool | None = None
    moved_m: float | None = None
    same_street: bool | None = None


@dataclass(frozen=True)
class Change:
    """One change to make: its kind, which draw of it, and the crash whose report is taken instead."""

    kind: str
    draw: int
    other: CrashFiles | None = None


@dataclass(frozen=True)
class PerturbTask:
    """Some changes of one crash; travels to the workers. ``around`` is the map far around it, as OSM XML."""

    crash: CrashFiles
    work: Work
    changes: tuple[Change, ...]
    seed: int
    around: bytes

    def split(self) -> list[PerturbTask]:
        """Return a task for each change."""
        return [replace(self, changes=(change,)) for change in self.changes]


def perturb_all(task: PerturbTask) -> tuple[PerturbedRow, ...]:
    """Return the rows of a task's changes, without those that do not apply to its crash."""
    stored = read_judged(task.crash)
    rows = (_Perturbation(task, stored, change).row() for change in task.changes)
    return tuple(row for row in rows if row is not None)


class _Perturbation:
    """One change of one crash, from the changed report to the row."""

    def __init__(self, task: PerturbTask, stored: StoredCrash, change: Change) -> None:
        self._task = task
        self._crash: CrashFiles = task.crash
        self._judged: JudgedCrash = stored.judged
        self._kind = KINDS[change.kind]
        self._change = change
        self._rng = draw_stream(task.seed, task.crash.key, change.kind, change.draw)
        self._row = PerturbedRow(task.crash.key, change.kind, change.draw, task.seed)

    def row(self) -> PerturbedRow | None:
        """Return the row of this change; None if the change does not apply."""
        scene = PerturbedScene(self._judged.record, self._rng, self._point())
        if scene.point is None and self._kind.needs in (Needs.OTHER_STREET, Needs.SAME_STREET):
            return None
        source = self._change.other or self._crash
        changed = perturb(self._kind, report_file(source)[1], scene)
        if changed is None:
            return None
        other_key = None if self._change.other is None else source.key
        self._row = replace(self._row, detail=changed.detail, other_key=other_key)
        with tempfile.TemporaryDirectory(prefix="trace-dag-perturbed-") as folder:
            return self._judge(changed, source.key, Storage(folder), scene.point)

    def _point(self) -> Point | None:
        if self._kind.needs not in (Needs.OTHER_STREET, Needs.SAME_STREET):
            return None
        record = self._judged.record
        return random_point(
            self._around(),
            LocalFrame(record.latitude_deg, record.longitude_deg),
            self._names_here(),
            self._rng,
            on_same_street=self._kind.needs is Needs.SAME_STREET,
            most_m=FARTHEST_M,
        )

    def _around(self) -> OsmExtract:
        return read_osm(self._task.around, name=f"map around {self._crash.key}")

    def _names_here(self) -> tuple[str, ...]:
        """Return names of the streets the crash was placed on, and those it reports."""
        placed, roads = self._crash.load(MAP_REPORT).placement, self._judged.network.road_by_id
        here = [name for road in (placed.road_id, *placed.cross_road_ids) for name in roads[road].names]
        return tuple(dict.fromkeys((*here, *_reported_names(self._judged.record))))

    def _judge(self, changed: Changed, key: str, storage: Storage, point: Point | None) -> PerturbedRow:
        records = self._through_all_stages(changed, key, storage)
        files = CrashFiles.recorded(key, self._crash.source, self._crash.settings, storage, records)
        # All of them count: to valid_records an extract that was kept would be none of the changed record's.
        stands = status_of_valid(key, records)
        judged = stands.final_state is not FinalState.FAILED and stands.reason is not Reason.NO_MAP_COVERAGE
        row = replace(
            self._row,
            final_state=stands.final_state,
            stage_reached=stands.stage_reached,
            reason=stands.reason,
            outcome_detail=stands.detail,
            verified=stands.final_state is FinalState.VERIFIED if judged else None,
        )
        if files.has(RECORD):
            record = files.load(RECORD)
            row = replace(
                row,
                own_verified=self._own_verified(record, records[Stage.CRASH_RECORD].outcome),
                moved_m=_apart_m(self._judged.record, record),
                same_street=point.same_street if point else self._is_named_here(record),
            )
        if files.has(VERDICT):
            grade, support = _grade_of(files)
            row = replace(row, grade=grade, support=support)
        return row

    def _is_named_here(self, record: CrashRecord) -> bool | None:
        """Return whether another crash's report happens to name a street of this place."""
        if self._change.other is None:
            return None
        return is_same_street(_reported_names(record), self._names_here())

    def _own_verified(self, record: CrashRecord, outcome: Outcome) -> bool | None:
        if outcome is not Outcome.ACCEPTED:
            return False  # The changed report says too little to be judged, by any simulation.
        crash = self._judged
        if self._change.other is not None:
            foreign = in_place_of(record, crash.record)
            if foreign is None:
                return None
            record = foreign
        settings = self._crash.settings.verdict
        return judge_hypothesis(record, crash.network, crash.hypothesis, crash.log, settings).verified

    def _through_all_stages(self, changed: Changed, key: str, storage: Storage) -> Records:
        """Return the outcomes of all stages on the changed report, in a storage of its own."""
        storage.write(_REPORT, changed.report)
        work = replace(self._task.work, storage=storage)
        task = CrashTask(key, self._source(storage))
        records: Records = {}
        for segment in work.flow.segments(tuple(Stage)):
            for definition in segment:
                stage = definition.stage
                outcome = self._kept(stage, records, storage)
                if outcome is None:
                    (event,) = work_on_chunk(Chunk(work, (replace(task, records=records),), (stage,), last=False))
                    outcome = event.record
                if outcome is not None:
                    records = {**records, stage: outcome}
                if outcome is None or outcome.outcome is not Outcome.ACCEPTED:
                    return records
        return records

    def _source(self, storage: Storage) -> CrashSource:
        """Return the changed report, and the map where it may be cut from another place."""
        own, report = self._crash.source, ReportSource("stored", _REPORT)
        if not self._task.around:
            return replace(own, report=report)
        file = storage.write("maps/around.osm", self._task.around)
        path = str(Path(storage.path(file.name)))
        return CrashSource(own.cohort, report, (RegisteredMap(path, file.sha256, file.size),))

    def _kept(self, stage: Stage, records: Records, storage: Storage) -> OutcomeRecord | None:
        """Return copies the crash's own outcome of a stage, if the changed report cannot give another."""
        if stage not in (Stage.OSM_EXTRACT, Stage.ROAD_MAP) or self._change.other is not None:
            return None
        before, now = self._judged.record, self._record(records, storage)
        same = _is_same_place if stage is Stage.OSM_EXTRACT else has_same_map
        return self._copied(stage, storage) if same(before, now) else None

    def _copied(self, stage: Stage, storage: Storage) -> OutcomeRecord | None:
        outcome = self._crash.records.get(stage)
        for file in outcome.artefacts if outcome else ():
            storage.write(file.name, self._crash.read(stage, file.name.partition(".")[2]))
        return outcome

    def _record(self, records: Records, storage: Storage) -> CrashRecord:
        crash = self._crash
        return CrashFiles.recorded(crash.key, crash.source, crash.settings, storage, records).load(RECORD)


def _grade_of(files: CrashFiles) -> tuple[str | None, float | None]:
    """Return the grade and support of a stored verdict, None where it has none."""
    verdict = json.loads(files.load(VERDICT_JSON))
    support = verdict.get("support")
    if isinstance(support, dict):
        support = support.get("total")
    return verdict.get("grade"), support


def _reported_names(record: CrashRecord) -> tuple[str, ...]:
    return tuple(name for name in (record.trafficway_1, record.trafficway_2) if name)


def _apart_m(before: CrashRecord, now: CrashRecord) -> float:
    to_local = LocalFrame(before.latitude_deg, before.longitude_deg).to_local
    x_m, y_m = to_local(now.latitude_deg, now.longitude_deg).tolist()
    return round(math.hypot(x_m, y_m), 2)


def _is_same_place(before: CrashRecord, now: CrashRecord) -> bool:
    return (before.latitude_deg, before.longitude_deg) == (now.latitude_deg, now.longitude_deg)


def has_same_map(before: CrashRecord, now: CrashRecord) -> bool:
    """Return whether two records differ only in what no road map depends on: what the vehicles were and did."""
    return _for_maps(before) == _for_maps(now)


def _for_maps(record: CrashRecord) -> tuple[CrashRecord, tuple[int, ...]]:
    """Return a record without what the vehicles were and did, and the numbers of the pair whose road it is."""
    pair = record.colliding_vehicles or ()
    vehicles = tuple(
        replace(
            vehicle,
            movement=PreCrashMovement.UNKNOWN,
            critical_event_code=None,
            crash_type_code=None,
            travel_speed_mps=None,
            travel_speed_is_lower_bound=False,
            impact=None,
            initial_impact_code=None,
            damaged_areas=(),
            implied=(),
        )
        for vehicle in record.vehicles
    )
    same = replace(
        record,
        vehicles=vehicles,
        events=(),
        non_motorists=(),
        collision_type=CollisionType.OTHERS,
        vehicle_trajectory=VehicleTrajectory.OTHERS,
        manner_of_collision_code=None,
        first_harmful_event_code=None,
        implied=(),
        contradictions=(),
        summary="",
    )
    return same, tuple(vehicle.number for vehicle in pair)


def draw_stream(seed: int, key: str, name: str, draw: int) -> np.random.Generator:
    """Return a random stream for each draw: the result does not depend on the other kinds or on the number of
    workers."""
    digest = hashlib.sha256(f"{seed}/{key}/{name}/{draw}".encode()).digest()
    return np.random.default_rng(int.from_bytes(digest[:16], "big"))
