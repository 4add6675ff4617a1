"""Stage ``state_estimate``: the approaches and speeds of the vehicles."""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING

from trace_dag.crash.parties import party_in_words
from trace_dag.flow.contract import Figure, StageProduct
from trace_dag.reconstruction.estimate import UnusableAnswers
from trace_dag.reconstruction.samples.draws import draw_samples
from trace_dag.simulation.states import estimate_to_json, run_to_json

if TYPE_CHECKING:
    from trace_dag.common.settings import StateSettings
    from trace_dag.crash.record import CrashRecord
    from trace_dag.flow.cohorts.services import Services
    from trace_dag.roads.map.network import RoadNetwork
    from trace_dag.roads.report import MapReport
    from trace_dag.simulation.states import EstimatorRun


def state_estimate(
    record: CrashRecord, road_map: RoadNetwork, map_report: MapReport, settings: StateSettings, services: Services
) -> StageProduct:
    """Estimate the states of a crash: hypotheses, best first."""
    try:
        made = services.estimator(settings).estimate(record, road_map, map_report)
    except UnusableAnswers as unusable:
        return StageProduct({"answers.json": run_to_json(unusable.run)}, _run_figures(unusable.run), unusable)
    made = replace(made, samples=draw_samples(record, made.hypotheses, settings.samples))
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
        figures[party_in_words(state.vehicle_number).replace(" ", "_")] = (
            f"{state.manoeuvre}, {state.initial_speed_mps:.1f} m/s ({state.speed_source})"
        )
    return StageProduct({"json": estimate_to_json(made)}, figures, parsed={"json": made})


def _run_figures(run: EstimatorRun) -> dict[str, Figure]:
    figures: dict[str, Figure] = {"estimator": run.estimator}
    if run.model is not None:
        figures |= {
            "model": run.model,
            "attempts": run.attempts,
            "fallback_from": run.fallback_from,
            "fallback_reason": run.fallback_reason,
            "tokens": run.prompt_tokens + run.completion_tokens,
            "cost_usd": run.cost_usd,
        }
    return figures
