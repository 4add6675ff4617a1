"""Stage ``simulation_log``: the simulated hypotheses, and draws of unreported quantities."""

from __future__ import annotations

from typing import TYPE_CHECKING, Final

from trace_dag.common.errors import Reason, Rejection
from trace_dag.crash.event_sequence import sequence_of
from trace_dag.crash.parties import EventKind
from trace_dag.flow.contract import Figure, StageProduct
from trace_dag.reconstruction.samples.simulated import samples_to_json, simulate_samples
from trace_dag.reconstruction.scene.scene import place_of
from trace_dag.simulation.log_io import logs_to_files
from trace_dag.simulation.run import backend, simulate
from trace_dag.simulation.types import VehicleLog, overturned_at

if TYPE_CHECKING:
    from trace_dag.common.settings import SimSettings
    from trace_dag.crash.record import CrashRecord
    from trace_dag.roads.map.network import RoadNetwork
    from trace_dag.roads.report import MapReport
    from trace_dag.simulation.states import StateEstimate


def simulation_log(
    record: CrashRecord,
    road_map: RoadNetwork,
    map_report: MapReport,
    xodr: bytes,
    estimate: StateEstimate,
    settings: SimSettings,
) -> StageProduct:
    """Simulate all hypotheses; reject a crash without a collision in any of them, but keep its logs."""
    logs = simulate(backend(settings), road_map, xodr, estimate, settings, record=record)
    steps, summary = logs_to_files(logs)
    files = {"parquet": steps, "json": summary}
    parsed: dict[str, object] = {"parquet": logs}
    collided = [log for log in logs if log.first_contact is not None or any(map(_overturns, log.vehicles))]
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
    if shown.first_contact is not None and estimate.samples:
        sampled = simulate_samples(road_map, estimate, logs, settings, record, place_of(map_report.placement))
        files["samples.json"], parsed["samples.json"] = samples_to_json(sampled), sampled
        figures["draws"] = f"{sampled.drawn}, worth {sampled.effective:g} of equal weight"
    rejection = None
    first = sequence_of(record).first.kind
    if not collided and first is not EventKind.OVERTURN:  # the verdict says so
        rejection = Rejection(
            Reason.NO_COLLISION,
            f"{_WHO.get(first, 'The vehicles')} do not touch in any of {len(logs)} simulated hypotheses "
            f"({shown.reason}).",
            measured=0.0,
            threshold=1.0,
        )
    return StageProduct(files, figures, rejection, parsed)


def _overturns(vehicle: VehicleLog) -> bool:
    return overturned_at(vehicle) is not None


_WHO: Final = {
    EventKind.PERSON_STRUCK: "Vehicle and person",
    EventKind.ANIMAL_STRUCK: "Vehicle and animal",
    EventKind.OBJECT_STRUCK: "The vehicle and the objects beside the road",
}
