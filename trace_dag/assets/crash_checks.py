"""Checks of single crashes, one evaluation per partition: its outcome, the gates of its road map, its criteria.

By the check ``verified`` the UI tells partitions by outcome, and filters them: it holds for the crashes that are
verified and is evaluated for all that are through. The step that runs the stages evaluates the others for the crashes
whose map or verdict it has looked at; a crash that did not get there has none ("skipped"). A check that does not hold
warns: the rejection it stands for is data. Dagster shows an evaluation as current while it names the latest
materialization, so they are logged some at a time, after the materializations whose numbers they need.
"""

from __future__ import annotations

import time
import warnings
from collections.abc import Iterator
from typing import Any, Final

from dagster import (
    AssetCheckEvaluation,
    AssetCheckKey,
    AssetCheckSeverity,
    AssetCheckSpec,
    AssetExecutionContext,
    DagsterEventType,
    Output,
    PreviewWarning,
)

from trace_dag.assets.dagster_internals import looked_at
from trace_dag.assets.partitions import CRASHES
from trace_dag.flow.tasks import Action, StageEvent
from trace_dag.provenance import Outcome, OutcomeRecord
from trace_dag.stage import Stage

_LOGGED_AT_ONCE = 50


def _check(name: str, stage: Stage, description: str) -> AssetCheckSpec:
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", PreviewWarning)  # of partitions_def: the versions it may change in are pinned
        return AssetCheckSpec(name, asset=stage.value, partitions_def=CRASHES, description=description)


_VERIFIED: Final = _check(
    "verified", Stage.VERDICT, "The crash is verified. Where it is not, the reason says what it is rejected for."
)
_OF_ITS_OWN_STAGE: Final = {
    Stage.ROAD_MAP: _check(
        "gates", Stage.ROAD_MAP, "The crash's road map passes every gate, and the crash lies on one of its roads."
    ),
    Stage.VERDICT: _check("criteria", Stage.VERDICT, "The simulated crash meets every criterion that decides."),
}

CRASH_CHECKS: Final = (*_OF_ITS_OWN_STAGE.values(), _VERIFIED)


class CrashChecks:
    """Evaluates the checks of a run's crashes from what its stages say."""

    def __init__(self, context: AssetExecutionContext) -> None:
        self._context = context
        self._waiting: dict[AssetCheckKey, dict[str, OutcomeRecord]] = {
            spec.key: {} for spec in CRASH_CHECKS if spec.key in context.selected_asset_check_keys
        }

    def note(self, event: StageEvent) -> None:
        """Take in what a stage says of a crash, once its materialization is logged."""
        if event.record is None:
            return
        if event.stage is Stage.VERDICT:
            self._note(_VERIFIED, event.key, event.record)
        if event.action in (Action.COMPUTED, Action.UNCHANGED) and event.stage in _OF_ITS_OWN_STAGE:
            self._note(_OF_ITS_OWN_STAGE[event.stage], event.key, event.record)

    def finish(self) -> Iterator[Output[None]]:
        """Log what is still waiting. What is yielded tells Dagster that the step is done with the checks it selected:
        it would log them as missing, since it does not count what a step logs by partition."""
        for check in self._waiting:
            self._log(check)
            yield Output(None, self._context.assets_def.get_output_name_for_asset_check_key(check))

    def _note(self, spec: AssetCheckSpec, key: str, record: OutcomeRecord) -> None:
        waiting = self._waiting.get(spec.key)
        if waiting is None:
            return
        waiting[key] = record
        if len(waiting) >= _LOGGED_AT_ONCE:
            self._log(spec.key)

    def _log(self, check: AssetCheckKey) -> None:
        records = self._waiting[check]
        if not records:
            return
        latest = self._context.instance.get_latest_storage_id_by_partition(
            check.asset_key, DagsterEventType.ASSET_MATERIALIZATION, set(records)
        )
        for key, record in records.items():
            self._context.log_event(
                AssetCheckEvaluation(
                    check.asset_key,
                    check.name,
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
