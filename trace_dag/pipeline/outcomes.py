"""What is recorded of a stage's work on a crash, and what the log says of it.

Belongs here: the words and numbers of a record. Does not belong here: storing it, and whether the stage runs again
(:mod:`trace_dag.pipeline.worker`).
"""

from __future__ import annotations

import logging
import traceback
from collections.abc import Sequence
from dataclasses import dataclass, replace

from trace_dag.errors import Failure, Stage, TransientFailure
from trace_dag.logs import at_work, figures
from trace_dag.pipeline.products import StageProduct
from trace_dag.provenance import Outcome, OutcomeRecord, Provenance
from trace_dag.storage import StoredFile

log = logging.getLogger(__name__)


@dataclass(frozen=True)
class Attempt:
    """A stage's work on a crash: of what, in which run, from when (ISO 8601, UTC) and for how long."""

    key: str
    stage: Stage
    provenance: Provenance
    run_id: str
    started_at: str
    duration_s: float

    def record(self, outcome: Outcome) -> OutcomeRecord:
        """The record of it, without what it came to."""
        return OutcomeRecord(
            key=self.key,
            stage=self.stage,
            outcome=outcome,
            provenance=self.provenance,
            fingerprint=self.provenance.fingerprint,
            run_id=self.run_id,
            started_at=self.started_at,
            duration_s=round(self.duration_s, 4),
        )


def made_record(attempt: Attempt, product: StageProduct, stored: Sequence[StoredFile]) -> OutcomeRecord:
    """The record of a stage that came to a result, an acceptance or a rejection, and left some files."""
    rejection = product.rejection
    return replace(
        attempt.record(Outcome.ACCEPTED if rejection is None else Outcome.REJECTED),
        reason=rejection.reason if rejection else None,
        detail=rejection.detail if rejection else "",
        measured=rejection.measured if rejection else None,
        threshold=rejection.threshold if rejection else None,
        artefacts=tuple(stored),
        figures=dict(product.figures),
    )


def failed_record(attempt: Attempt, error: Exception) -> OutcomeRecord:
    """The record of a stage that came to none."""
    return replace(
        attempt.record(Outcome.FAILED),
        detail=str(error) if isinstance(error, Failure) else f"{type(error).__name__}: {error}",
        error="".join(traceback.format_exception(error)),
        transient=isinstance(error, TransientFailure),
    )


def log_outcome(record: OutcomeRecord) -> None:
    """A line of the log, with the figures of the record for those who collect them."""
    with at_work(record.key, record.stage):
        log.info(
            "%s %s: %s in %.2f s",
            record.key,
            record.stage,
            record.reason or record.outcome,
            record.duration_s,
            extra=figures(
                outcome=record.outcome,
                reason=record.reason,
                detail=record.detail,
                duration_s=record.duration_s,
                attempts=record.attempts,
                artefact_bytes=sum(file.size for file in record.artefacts),
                run_id=record.run_id,
                traceback=record.error,
            ),
        )
