"""The check of single crashes, one evaluation per partition: ``verified``, by which the UI filters them by outcome.

It is evaluated for every finished crash. A crash rejected at an earlier stage fails the check with that reason, because
Dagster shows a check without an evaluation as skipped. A failed check is a warning, since a rejection is data. Gates of
maps and criteria are checked over all crashes (:mod:`trace_dag.assets.checks`).
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

with warnings.catch_warnings():
    warnings.simplefilter("ignore", PreviewWarning)  # of partitions_def
    VERIFIED: Final = AssetCheckSpec(
        "verified",
        asset=Stage.VERDICT.value,
        partitions_def=CRASHES,
        description="The crash is verified. Where it is not, the reason says what it is rejected for.",
    )


class CrashChecks:
    """Evaluates the check for a run's crashes from the results of its stages."""

    def __init__(self, context: AssetExecutionContext) -> None:
        self._context = context

    def log(self, event: StageEvent) -> None:
        """Log the evaluation that follows from the last stage's record of a crash."""
        record = event.record
        if record is None or event.stage is not Stage.VERDICT:
            return
        if VERIFIED.key not in self._context.selected_asset_check_keys:
            return
        self._context.log_event(
            AssetCheckEvaluation(
                VERIFIED.asset_key,
                VERIFIED.name,
                passed=record.outcome is Outcome.ACCEPTED,
                partition=event.key,
                severity=AssetCheckSeverity.WARN,
                description=record.detail or None,
                metadata=_metadata(record),
            )
        )

    def finish(self) -> Iterator[Output[None]]:
        """Yield an output for each selected check, so that Dagster does not log it as missing.

        Dagster does not count evaluations that a step logs by partition.
        """
        for check in self._context.selected_asset_check_keys:
            yield Output(None, self._context.assets_def.get_output_name_for_asset_check_key(check))


def _metadata(record: OutcomeRecord) -> dict[str, Any]:
    metadata: dict[str, Any] = {name: value for name, value in record.figures.items() if value is not None}
    if record.reason is not None:
        metadata = {"reason": record.reason.value, **metadata}
    return metadata
