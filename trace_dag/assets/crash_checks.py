"""Checks of single crashes, one evaluation per partition: the gates of its road map, the criteria of its verdict.

The step that runs the stages evaluates them itself, for the crashes whose map or verdict it has looked at; a crash
that did not get there has none ("skipped"). A check that does not hold warns: the rejection it stands for is data.
Dagster shows an evaluation as current while it names the latest materialization, so they are logged some at a time,
after the materializations whose numbers they need.
"""

from __future__ import annotations

import time
import warnings
from typing import Any

from dagster import (
    AssetCheckEvaluation,
    AssetCheckSeverity,
    AssetCheckSpec,
    AssetExecutionContext,
    AssetKey,
    DagsterEventType,
    PreviewWarning,
)

from trace_dag.assets.dagster_internals import looked_at
from trace_dag.assets.partitions import CRASHES
from trace_dag.flow.tasks import Action, StageEvent
from trace_dag.provenance import Outcome, OutcomeRecord
from trace_dag.stage import Stage

_LOGGED_AT_ONCE = 50

with warnings.catch_warnings():
    warnings.simplefilter("ignore", PreviewWarning)  # of partitions_def: the versions it may change in are pinned
    _CHECKS = {
        Stage.ROAD_MAP: AssetCheckSpec(
            "gates",
            asset=Stage.ROAD_MAP.value,
            partitions_def=CRASHES,
            description="The crash's road map passes every gate, and the crash lies on one of its roads.",
        ),
        Stage.VERDICT: AssetCheckSpec(
            "criteria",
            asset=Stage.VERDICT.value,
            partitions_def=CRASHES,
            description="The simulated crash meets every criterion that decides.",
        ),
    }

CRASH_CHECKS = tuple(_CHECKS.values())


class CrashChecks:
    """Evaluates the checks of a run's crashes from what its stages say."""

    def __init__(self, context: AssetExecutionContext) -> None:
        self._context = context
        self._waiting: dict[Stage, dict[str, OutcomeRecord]] = {
            stage: {} for stage, spec in _CHECKS.items() if spec.key in context.selected_asset_check_keys
        }

    def note(self, event: StageEvent) -> None:
        """Take in what a stage says of a crash, once its materialization is logged."""
        own = event.action in (Action.COMPUTED, Action.UNCHANGED)
        if not own or event.record is None or event.stage not in self._waiting:
            return
        waiting = self._waiting[event.stage]
        waiting[event.key] = event.record
        if len(waiting) >= _LOGGED_AT_ONCE:
            self._log(event.stage)

    def finish(self) -> None:
        """Log what is still waiting."""
        for stage in self._waiting:
            self._log(stage)

    def _log(self, stage: Stage) -> None:
        records = self._waiting[stage]
        if not records:
            return
        asset = AssetKey(stage.value)
        latest = self._context.instance.get_latest_storage_id_by_partition(
            asset, DagsterEventType.ASSET_MATERIALIZATION, set(records)
        )
        for key, record in records.items():
            self._context.log_event(
                AssetCheckEvaluation(
                    asset,
                    _CHECKS[stage].name,
                    passed=record.outcome is Outcome.ACCEPTED,
                    partition=key,
                    severity=AssetCheckSeverity.WARN,
                    description=record.detail or None,
                    metadata=_metadata(record),
                    target_materialization_data=looked_at(latest[key], self._context.run.run_id, time.time()),
                )
            )
        records.clear()


def _metadata(record: OutcomeRecord) -> dict[str, Any]:
    metadata: dict[str, Any] = {name: value for name, value in record.figures.items() if value is not None}
    if record.reason is not None:
        metadata = {"reason": record.reason.value, **metadata}
    return metadata
