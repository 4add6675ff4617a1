"""What is counted of a run: throughput, slowest crashes, retries, cost."""

from __future__ import annotations

from dataclasses import replace

from trace_dag.common.provenance import Outcome, OutcomeRecord, Provenance
from trace_dag.common.stage import Stage
from trace_dag.common.storage.files import StoredFile
from trace_dag.flow.run_summary import RunSummary
from trace_dag.flow.tasks import Action, StageEvent


def record(key: str, stage: Stage, **said) -> OutcomeRecord:
    provenance = Provenance("1", {}, {})
    made = OutcomeRecord(key, stage, Outcome.ACCEPTED, provenance, provenance.fingerprint, "run", "2026-01-01")
    return replace(made, **said)


def test_computed_stages_are_counted_and_others_are_not():
    summary = RunSummary()
    estimate = record(
        "2023-510001",
        Stage.STATE_ESTIMATE,
        duration_s=3.0,
        attempts=3,
        figures={"cost_usd": 0.25},
        artefacts=(StoredFile("state_estimate/2023-510001.json", 1000, "0" * 64),),
    )
    log = record("2023-510001", Stage.SIMULATION_LOG, duration_s=1.5)
    rejected = record("2023-510002", Stage.ROAD_MAP, duration_s=2.0, outcome=Outcome.REJECTED)
    failed = record("2023-510003", Stage.ROAD_MAP, duration_s=0.5, outcome=Outcome.FAILED)
    for event in (
        StageEvent("2023-510001", Stage.STATE_ESTIMATE, Action.COMPUTED, estimate),
        StageEvent("2023-510001", Stage.SIMULATION_LOG, Action.COMPUTED, log),
        StageEvent("2023-510002", Stage.ROAD_MAP, Action.COMPUTED, rejected),
        StageEvent("2023-510002", Stage.VERDICT, Action.NOT_REACHED, rejected),
        StageEvent("2023-510003", Stage.ROAD_MAP, Action.COMPUTED, failed),
        StageEvent("2023-510003", Stage.VERDICT, Action.BLOCKED, failed),
        StageEvent("2023-510004", Stage.ROAD_MAP, Action.UNCHANGED, record("2023-510004", Stage.ROAD_MAP)),
    ):
        summary.note(event)
    figures = summary.figures()
    assert (figures["crashes"], figures["crashes_computed"]) == (4, 3)
    assert (figures["stages_computed"], figures["stages_unchanged"]) == (4, 1)
    assert (figures["rejected"], figures["failed"], figures["retries"]) == (1, 1, 2)
    assert (figures["cost_usd"], figures["artefact_bytes"], figures["computing_s"]) == (0.25, 1000, 7.0)
    assert summary.slowest() == [("2023-510001", 4.5), ("2023-510002", 2.0), ("2023-510003", 0.5)]
    assert figures["slowest_stage"] == "state_estimate"


def test_throughput_is_crashes_over_time():
    summary = RunSummary()
    summary.began -= 30.0
    for number in range(10):
        key = f"2023-51000{number}"
        summary.note(StageEvent(key, Stage.VERDICT, Action.COMPUTED, record(key, Stage.VERDICT, duration_s=1.0)))
    assert 19.0 < summary.figures()["crashes_per_minute"] <= 20.0
    assert "10 of 10 crashes" in summary.in_words()
