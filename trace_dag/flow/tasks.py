"""The messages between a run and its workers, and the records of their work.

Belongs here: crashes and stages to run, the action of each stage, and the content of a record. Does not belong here:
the work (:mod:`trace_dag.flow.worker`), its division (:mod:`trace_dag.flow.batch`), and the staleness of stored results
(:mod:`trace_dag.flow.staleness`).
"""

from __future__ import annotations

import logging
import traceback
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from enum import StrEnum
from functools import cached_property

from trace_dag.common.errors import Failure, TransientFailure
from trace_dag.common.messages.logs import figures, log_context
from trace_dag.common.provenance import Outcome, OutcomeRecord, Provenance
from trace_dag.common.settings import Settings
from trace_dag.common.stage import Stage
from trace_dag.common.storage.files import Storage, StoredFile
from trace_dag.flow.cohorts.registry import CrashSource
from trace_dag.flow.contract import CrashFiles, Flow, StageProduct
from trace_dag.flow.records import Records
from trace_dag.flow.staleness import Recipe


class Action(StrEnum):
    """Actions of a stage of a run on a crash."""

    COMPUTED = "computed"
    UNCHANGED = "unchanged"  # its record is current
    NOT_REACHED = "not_reached"  # an earlier stage rejected the crash
    BLOCKED = "blocked"  # an earlier stage failed or has not run


@dataclass(frozen=True)
class MadeFiles:
    """Files made from the present results of a crash, with a digest of these."""

    files: tuple[StoredFile, ...]
    made_of: str


@dataclass(frozen=True)
class StageEvent:
    """The action of one stage of a run on one crash.

    ``record`` is the stage's own, or the earlier one that ended it.

    The last event of a crash has in ``no_picture`` the reason why its picture could not be drawn, and in ``made`` the
    files made afterwards.
    """

    key: str
    stage: Stage
    action: Action
    record: OutcomeRecord | None
    no_picture: str = ""
    made: MadeFiles | None = None

    @property
    def failed(self) -> bool:
        """Return whether the crash is failed at this stage after the run."""
        if self.action is Action.BLOCKED:
            return True
        return self.record is not None and self.record.outcome is Outcome.FAILED


@dataclass(frozen=True)
class Work:
    """The shared facts of all chunks of a run, sent to the workers.

    ``installed`` has the versions of this package, its stages and libraries that all workers need. ``afterwards`` is
    called with each crash after its last stage of the run, if any stage was computed.
    """

    storage: Storage
    settings: Settings
    flow: Flow
    run_id: str
    installed: Mapping[str, str]
    force: frozenset[Stage] = frozenset()
    afterwards: Callable[[CrashFiles], MadeFiles | None] | None = None

    def attempt(
        self, key: str, stage: Stage, provenance: Provenance, started_at: str, duration_s: float, attempts: int = 1
    ) -> OutcomeRecord:
        """Return the record of an attempt at a stage, without its outcome, begun at a time (ISO 8601, UTC)."""
        return OutcomeRecord(
            key=key,
            stage=stage,
            outcome=Outcome.STARTED,
            provenance=provenance,
            fingerprint=provenance.fingerprint,
            run_id=self.run_id,
            started_at=started_at,
            duration_s=round(duration_s, 4),
            attempts=attempts,
        )

    @cached_property
    def recipes(self) -> Mapping[Stage, Recipe]:
        """Return the recipe of each stage of the flow."""
        return self.flow.recipes(self.settings)


@dataclass(frozen=True)
class CrashTask:
    """One crash to work on, with its records as they were when the task was made."""

    key: str
    source: CrashSource
    records: Records = field(default_factory=dict)


@dataclass(frozen=True)
class Chunk:
    """Some crashes and the stages to run for them. ``last``: no later chunk of this run has these crashes.

    ``again``: the chunk's worker died; its finished results are in storage.
    """

    work: Work
    crashes: tuple[CrashTask, ...]
    stages: tuple[Stage, ...]
    last: bool = True
    again: bool = False

    def split(self) -> list[Chunk]:
        """Return one chunk per crash, to be tried again."""
        return [replace(self, crashes=(crash,), again=True) for crash in self.crashes]


log = logging.getLogger(__name__)


def build_record(attempt: OutcomeRecord, product: StageProduct, stored: Sequence[StoredFile]) -> OutcomeRecord:
    """Return the record of an attempt that accepted or rejected the crash, with its stored files."""
    rejection = product.rejection
    return replace(
        attempt,
        outcome=Outcome.ACCEPTED if rejection is None else Outcome.REJECTED,
        reason=rejection.reason if rejection else None,
        detail=rejection.detail if rejection else "",
        measured=rejection.measured if rejection else None,
        threshold=rejection.threshold if rejection else None,
        artefacts=tuple(stored),
        figures=dict(product.figures),
    )


def build_failed_record(attempt: OutcomeRecord, error: Exception) -> OutcomeRecord:
    """Return the record of an attempt that failed."""
    return replace(
        attempt,
        outcome=Outcome.FAILED,
        detail=str(error) if isinstance(error, Failure) else f"{type(error).__name__}: {error}",
        error="".join(traceback.format_exception(error)),
        transient=isinstance(error, TransientFailure),
    )


def log_outcome(record: OutcomeRecord) -> None:
    """Log an outcome, with the figures of the record as fields."""
    with log_context(record.key, record.stage):
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
