"""Checks of single crashes, one evaluation per partition: its outcome, the gates of its road map, its criteria.

By the check ``verified`` the UI tells partitions by outcome, and filters them: it holds for the crashes that are
verified. All are evaluated for all crashes that are through: what an earlier stage rejected does not hold either, with
that reason, for Dagster shows a check without an evaluation as skipped. A check that does not hold warns: the rejection
it stands for is data.
"""

from __future__ import annotations

import warnings
from collections.abc import Iterator
from typing import Any, Final

from dagster import (
    AssetCheckEvaluation,
    AssetCheckSeverity,
    AssetCheckSpec,
    AssetExecutionContext,
    Output,
    PreviewWarning,
)

from trace_dag.assets.partitions import CRASHES
from trace_dag.common.provenance import Outcome, OutcomeRecord
from trace_dag.common.stage import Stage
from trace_dag.flow.tasks import StageEvent


def _check(name: str, stage: Stage, description: str) -> AssetCheckSpec:
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", PreviewWarning)  # of partitions_def
        return AssetCheckSpec(name, asset=stage.value, partitions_def=CRASHES, description=description)


CRASH_CHECKS: Final = (
    _check("gates", Stage.ROAD_MAP, "The crash's road map passes every gate, and the crash lies on one of its roads."),
    _check("criteria", Stage.VERDICT, "The simulated crash meets every criterion that decides."),
    _check(
        "verified", Stage.VERDICT, "The crash is verified. Where it is not, the reason says what it is rejected for."
    ),
)


class CrashChecks:
    """Evaluates the checks of a run's crashes from what its stages say."""

    def __init__(self, context: AssetExecutionContext) -> None:
        self._context = context

    def log(self, event: StageEvent) -> None:
        """Log the evaluations that follow from what a stage says of a crash."""
        if event.record is None:
            return
        for check in CRASH_CHECKS:
            if check.asset_key.to_user_string() == event.stage.value:
                self._log(check, event.key, event.record)

    def finish(self) -> Iterator[Output[None]]:
        """Tell Dagster that the step is done with the checks it selected.

        It would log them as missing, since it does not count what a step logs by partition.
        """
        for check in self._context.selected_asset_check_keys:
            yield Output(None, self._context.assets_def.get_output_name_for_asset_check_key(check))

    def _log(self, check: AssetCheckSpec, key: str, record: OutcomeRecord) -> None:
        if check.key not in self._context.selected_asset_check_keys:
            return
        self._context.log_event(
            AssetCheckEvaluation(
                check.asset_key,
                check.name,
                passed=record.outcome is Outcome.ACCEPTED,
                partition=key,
                severity=AssetCheckSeverity.WARN,
                description=record.detail or None,
                metadata=_metadata(record),
            )
        )


def _metadata(record: OutcomeRecord) -> dict[str, Any]:
    metadata: dict[str, Any] = {name: value for name, value in record.figures.items() if value is not None}
    if record.reason is not None:
        metadata = {"reason": record.reason.value, **metadata}
    return metadata
