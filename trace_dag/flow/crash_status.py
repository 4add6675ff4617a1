"""Final states of the crashes and their estimators, from the stored records alone."""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from enum import StrEnum
from typing import NamedTuple

from trace_dag.common.errors import Reason
from trace_dag.common.gc_pause import gc_paused
from trace_dag.common.messages.wording import count_of
from trace_dag.common.provenance import Outcome, OutcomeRecord
from trace_dag.common.stage import Stage
from trace_dag.flow.records import Records


class FinalState(StrEnum):
    """Final states; every registered crash is in exactly one."""

    VERIFIED = "verified"
    FIRST_EVENT_ONLY = "first_event_only"
    REJECTED = "rejected"
    FAILED = "failed"
    PENDING = "pending"

    @property
    def accepted(self) -> bool:
        """Return whether the crash has a verdict that does not reject it."""
        return self in (FinalState.VERIFIED, FinalState.FIRST_EVENT_ONLY)


@dataclass(frozen=True)
class CrashStatus:
    """The state of a crash.

    ``stage_reached`` is the stage that ended it, or the last one that accepted it.

    ``corroborated``: verified, and supported by more than the criteria. ``without_areas``: verified, but at most
    consistent, since its register has no areas of impact. ``made``: the estimator of its estimate, if any. ``outdated``
    is the first stage whose result could not be made anew, and ``outdated_because`` has the reason; the crash keeps its
    earlier state.
    """

    key: str
    final_state: FinalState
    stage_reached: Stage | None = None
    reason: Reason | None = None
    detail: str = ""
    corroborated: bool = False
    without_areas: bool = False
    made: Made | None = None
    outdated: Stage | None = None
    outdated_because: str = ""


def valid_records(records: Records) -> Records:
    """Return the valid records: those up to the first that did not accept, each made from the outputs before it.

    A record is invalid if an earlier stage has been run again since.
    """
    valid: Records = {}
    made: dict[str, str] = {}  # digests of the artefacts so far, as the inputs of a record name them
    for stage in Stage:
        record = records.get(stage)
        if record is None or record.outcome is Outcome.STARTED:
            break
        inputs = record.provenance.inputs.items()
        if any(made.get(name, "") != digest for name, digest in inputs if name.partition(".")[0] in _STAGE_NAMES):
            break
        valid[stage] = record
        if record.outcome is not Outcome.ACCEPTED:
            break
        made.update((f"{stage.value}.{file.name.partition('.')[2]}", file.sha256) for file in record.artefacts)
    return valid


_STAGE_NAMES = frozenset(stage.value for stage in Stage)


def crash_status(key: str, records: Records) -> CrashStatus:
    """Return the state of one crash."""
    return status_of_valid(key, valid_records(records))


def status_of_valid(key: str, valid: Records) -> CrashStatus:
    """Return the state of one crash by its valid records, as :func:`valid_records` finds them."""
    if not valid:
        return CrashStatus(key, FinalState.PENDING)
    made = maker_of(valid[Stage.STATE_ESTIMATE]) if Stage.STATE_ESTIMATE in valid else None
    outdated = next((record for record in valid.values() if record.failed_attempt is not None), None)
    last: OutcomeRecord = valid[max(valid, key=lambda stage: stage.position)]
    if last.outcome is Outcome.REJECTED:
        state = FinalState.REJECTED
    elif last.outcome is Outcome.FAILED:
        state = FinalState.FAILED
    elif last.stage is Stage.VERDICT:
        state = FinalState(str(last.figures.get("label", FinalState.VERIFIED.value)))
    else:
        state = FinalState.PENDING
    grade = last.figures.get("grade")  # a :class:`trace_dag.verdict.types.Grade`, which is slow to import
    return CrashStatus(
        key,
        state,
        last.stage,
        last.reason,
        last.detail,
        corroborated=state is FinalState.VERIFIED and grade == "corroborated",
        without_areas=state is FinalState.VERIFIED
        and valid[Stage.CRASH_RECORD].figures.get("areas_of_impact") is False,
        made=made,
        outdated=outdated.stage if outdated else None,
        outdated_because=outdated.failed_attempt.detail if outdated and outdated.failed_attempt else "",
    )


@gc_paused()
def crash_statuses(records: Mapping[str, Records]) -> dict[str, CrashStatus]:
    """Return the states of all crashes."""
    return {
        key: crash_status(key, of_crash) if of_crash else CrashStatus(key, FinalState.PENDING)
        for key, of_crash in records.items()
    }


@dataclass(frozen=True)
class FunnelStep:
    """A step of the funnel: crashes that passed it, here and in the published benchmark (None: not published)."""

    step: str
    crashes: int
    published: int | None


# The published benchmark: 100 reports, 65 road maps, 52 reconstructions accepted by their first contact.
_FUNNEL: tuple[tuple[str, Stage | None, int | None], ...] = (
    ("registered", None, 100),
    ("complete", Stage.CRASH_RECORD, None),
    ("mapped", Stage.ROAD_MAP, 65),
    ("estimated", Stage.STATE_ESTIMATE, None),
    ("collided", Stage.SIMULATION_LOG, None),
    ("accepted", Stage.VERDICT, 52),
)


def funnel(crashes: Iterable[CrashStatus]) -> list[FunnelStep]:
    """Return crashes that passed each step, beside the published counts."""
    ends = Counter((crash.stage_reached, crash.final_state) for crash in crashes)
    steps = [
        FunnelStep(step, sum(count for end, count in ends.items() if stage is None or _passed(*end, stage)), published)
        for step, stage, published in _FUNNEL
    ]
    verified = sum(count for (_, state), count in ends.items() if state is FinalState.VERIFIED)
    return [*steps, FunnelStep("verified", verified, None)]


def _passed(reached: Stage | None, state: FinalState, stage: Stage) -> bool:
    if reached is None:
        return False
    ended_there = state in (FinalState.REJECTED, FinalState.FAILED)
    return reached.position >= stage.position + (1 if ended_there else 0)


# --- estimators ------------------------------------------------------------------------------------------------------
class Made(NamedTuple):
    """The estimator of an estimate, and the requested one if that was another."""

    estimator: str
    fallback_from: str | None = None


def maker_of(record: OutcomeRecord) -> Made | None:
    """Return the estimator in a stage's record; None without an estimate."""
    estimator, asked = record.figures.get("estimator"), record.figures.get("fallback_from")
    if not estimator or not record.artefacts or record.reason is not None:
        return None
    return Made(str(estimator), str(asked) if asked else None)


def makers_in_words(estimates: Iterable[Made]) -> str:
    """Return a sentence such as "50 estimates: 14 by llm, 36 by analytic in place of llm (72 %)".

    "" without estimates.
    """
    counts = Counter(estimates)
    total = counts.total()
    if not total:
        return ""
    parts = [
        f"{count} by {made.estimator}"
        + (f" in place of {made.fallback_from} ({100 * count / total:.0f} %)" if made.fallback_from else "")
        for made, count in sorted(
            counts.items(), key=lambda item: (item[0].fallback_from is not None, item[0].estimator)
        )
    ]
    return f"{count_of(total, 'estimate')}: {', '.join(parts)}"
