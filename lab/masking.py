"""Verified collisions of two vehicles, and what can be hidden of their reports.

A fact is hidden in all fields of a report. Other fields mostly repeat it: a driver reported to have turned left has the
crash type of a left turn. So the recovered fact measures how far the parts of a report agree, not how much is known
beyond the report."""

from __future__ import annotations

import uuid
from collections.abc import Iterator
from dataclasses import dataclass, replace
from functools import cached_property
from pathlib import Path

from lab.cohorts import MAPS, SAMPLE
from lab.estimators import settings_of
from lab.measuring import SHARED
from trace_dag.common.errors import Rejection
from trace_dag.common.settings import Settings
from trace_dag.common.stage import Stage
from trace_dag.crash.event_sequence import sequence_of
from trace_dag.crash.parties import EventKind
from trace_dag.crash.record import CrashRecord, PreCrashMovement, VehicleRecord
from trace_dag.flow.artefacts import MAP_REPORT, RECORD, ROAD_MAP, VERDICT
from trace_dag.flow.batch import run_stages
from trace_dag.flow.cohorts.ingest import ingest
from trace_dag.flow.contract import CrashFiles
from trace_dag.flow.stages import FLOW
from trace_dag.flow.stored_crashes import crash_files
from trace_dag.flow.workspace import Workspace
from trace_dag.reconstruction.analytic_hypotheses import NAME as ANALYTIC
from trace_dag.reconstruction.estimate import Estimator, estimator_factory
from trace_dag.reconstruction.samples.draws import draw_samples
from trace_dag.reconstruction.samples.simulated import SampledRuns, simulate_samples
from trace_dag.reconstruction.scene.scene import place_of
from trace_dag.roads.map.network import RoadNetwork
from trace_dag.roads.report import MapReport
from trace_dag.simulation.states import StateEstimate

_JUDGED = tuple(stage for stage in Stage if stage.position <= Stage.VERDICT.position)


@dataclass(frozen=True)
class Crash:
    """A stored collision of two vehicles, to be estimated again."""

    record: CrashRecord
    network: RoadNetwork
    report: MapReport
    settings: Settings
    draws: int
    estimator: Estimator
    usual: Estimator

    @cached_property
    def whole(self) -> tuple[StateEstimate, SampledRuns] | None:
        """Return the crash estimated as always, from all that is reported."""
        return self._estimated(self.usual, self.record)

    def again(self, record: CrashRecord) -> tuple[StateEstimate, SampledRuns] | None:
        """Return the crash estimated from another record, with its draws; None where no reading lets the vehicles meet,
        and where a language model gives no usable answer.
        """
        return self._estimated(self.estimator, record)

    def _estimated(self, estimator: Estimator, record: CrashRecord) -> tuple[StateEstimate, SampledRuns] | None:
        try:
            found = estimator.estimate(record, self.network, self.report)
        except Rejection:
            return None
        drawn = replace(found, samples=draw_samples(record, found.hypotheses, self.draws))
        place = place_of(self.report.placement)
        return drawn, simulate_samples(self.network, drawn, (), self.settings.sim, record, place)


def collisions(root: str, draws: int, estimator: str) -> Iterator[Crash]:
    """Yield the verified collisions of a root, to be estimated by an estimator: ``analytic``, ``llm:PROMPT@MODEL``,
    ..."""
    workspace = Workspace.open(root)
    usual, asked = (_estimator(workspace, name) for name in (ANALYTIC, estimator))
    asked.require()
    keys = [key for cohort in workspace.registry.cohorts().values() for key in cohort.reports]
    for files in crash_files(workspace, keys):
        if _verified(files):
            record = files.load(RECORD)
            sequence = sequence_of(record)
            met = sequence.first.kind is EventKind.VEHICLE_CONTACT and sequence.first.parked is None
            if met and len(sequence.contacts) == 1:
                yield Crash(
                    record, files.load(ROAD_MAP), files.load(MAP_REPORT), workspace.settings, draws, asked, usual
                )


def _estimator(workspace: Workspace, name: str) -> Estimator:
    """Return the estimator of the settings."""
    states = settings_of(name, workspace.settings.states).model_copy(update={"llm_fallback": "reject"})
    return estimator_factory(states)(states, files=workspace.storage, ledger=f"masked-{uuid.uuid4().hex}")


def _verified(files: CrashFiles) -> bool:
    return files.has(VERDICT) and files.load(VERDICT).accepted


def compute_shared(root: Path) -> None:
    """Compute the shared crashes of Virginia and of FARS, up to their verdicts."""
    workspace = Workspace.open(str(root), FLOW)
    virginia = SHARED / "va-2023"
    ingest(workspace.storage, "virginia", reports=[virginia / "reports"], maps=[virginia / "osm"])
    ingest(workspace.storage, "fars", tables=[("fars-csv", str(SHARED / "fars-csv"))], maps=[SHARED / "osm"])
    _judge(root)


def compute_sample(root: Path) -> None:
    """Compute the crashes of the bundled sample, up to their verdicts."""
    workspace = Workspace.open(str(root), FLOW)
    ingest(workspace.storage, "sample", reports=[SAMPLE / "reports"], maps=[MAPS])
    _judge(root)


def _judge(root: Path) -> None:
    workspace = Workspace.open(str(root), FLOW)
    for _ in run_stages(workspace, workspace.registry.keys(), _JUDGED, run_id="masked"):
        pass


# --- what is hidden --------------------------------------------------------------------------------------------------
def with_vehicle(record: CrashRecord, vehicle: VehicleRecord) -> CrashRecord:
    """Return a record with another vehicle of that number."""
    vehicles = tuple(vehicle if each.number == vehicle.number else each for each in record.vehicles)
    return replace(record, vehicles=vehicles)


def without_area(record: CrashRecord, number: int) -> CrashRecord:
    """Return a record without the places where a vehicle was struck."""
    events = tuple(
        replace(
            event,
            area_1=None if event.party_1 == number else event.area_1,
            area_2=None if event.party_2 == number else event.area_2,
        )
        for event in record.events
    )
    vehicle = next(each for each in record.vehicles if each.number == number)
    hidden = replace(vehicle, impact=None, initial_impact_code=None, damaged_areas=())
    return with_vehicle(replace(record, events=events), hidden)


def without_types(record: CrashRecord) -> CrashRecord:
    """Return a record without crash types."""
    return replace(record, vehicles=tuple(replace(each, crash_type_code=None) for each in record.vehicles))


def without_movement(record: CrashRecord, number: int) -> CrashRecord:
    """Return a record that does not say what a vehicle did before the critical event."""
    vehicle = next(each for each in record.vehicles if each.number == number)
    return with_vehicle(record, replace(vehicle, movement=PreCrashMovement.UNKNOWN))


def without_lanes(record: CrashRecord) -> CrashRecord:
    """Return a record without the lanes of the vehicles: no number of lanes, movement, crash type, area of impact, and
    no word on who left a lane.
    """
    for vehicle in record.vehicles:
        record = without_movement(without_area(record, vehicle.number), vehicle.number)
    vehicles = tuple(
        replace(each, lanes=None, location_code=None, critical_event_code=None)
        for each in without_types(record).vehicles
    )
    return replace(record, vehicles=vehicles)
