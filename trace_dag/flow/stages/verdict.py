"""Stage ``verdict``: the simulations judged against the report."""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING

from trace_dag.common.errors import Reason, Rejection
from trace_dag.crash.parties import party_in_words
from trace_dag.flow.contract import Figure, StageProduct
from trace_dag.scenario.sight_lines import sight_lines
from trace_dag.verdict.judge import judge
from trace_dag.verdict.types import Label, verdict_to_json

if TYPE_CHECKING:
    from trace_dag.common.settings import VerdictSettings
    from trace_dag.crash.record import CrashRecord
    from trace_dag.osm.types import OsmExtract
    from trace_dag.roads.map.network import RoadNetwork
    from trace_dag.roads.report import MapReport
    from trace_dag.simulation.states import StateEstimate
    from trace_dag.simulation.types import SimulationLog


def verdict(
    record: CrashRecord,
    road_map: RoadNetwork,
    map_report: MapReport,
    estimate: StateEstimate,
    logs: tuple[SimulationLog, ...],
    extract: OsmExtract,
    settings: VerdictSettings,
) -> StageProduct:
    """Return every criterion with value and threshold, the verdict, and the lines of sight."""
    found = judge(record, road_map, map_report, estimate, logs, settings)
    seen = sight_lines(logs[found.hypothesis], extract.surroundings, road_map.frame)
    found = replace(found, sight_lines=seen)
    figures: dict[str, Figure] = {
        "rule_set": found.rule_set,
        "hypothesis": found.hypothesis,
        "label": found.label.value,
        "grade": found.grade.value if found.grade else None,
    }
    if found.label is Label.FIRST_EVENT_ONLY:
        figures["not_verified_because"] = "; ".join(
            each.detail for each in found.reservations if each.doubt.bars_verification
        )
    if found.support is not None:
        figures |= {
            "support": round(found.support.total, 2),
            "independent_facts": found.support.independent_facts,
            "not_corroborated_because": found.support.detail or None,
        }
    for criterion in found.criteria:
        if criterion.threshold is None:  # reported only; the artefact and the warehouse have it
            continue
        vehicle = f" of {party_in_words(criterion.vehicle_number)}" if criterion.vehicle_number is not None else ""
        vehicle += f" in event {criterion.event_number}" if criterion.event_number is not None else ""
        held = {True: "pass", False: "fail", None: "not judged"}[criterion.passed]
        if criterion.reason is None:  # it rejects nothing, so it does not fail
            held = f"limit {criterion.threshold:g}, not required"
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
