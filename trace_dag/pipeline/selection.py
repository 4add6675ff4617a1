"""Which crashes to run, and from which stage: what is stale, what failed, what was rejected."""

from __future__ import annotations

from collections.abc import Collection
from dataclasses import dataclass, field

from trace_dag.errors import Reason, Stage, UserError
from trace_dag.pipeline.batch import Pipeline
from trace_dag.pipeline.records import read_records
from trace_dag.pipeline.registry import in_order
from trace_dag.pipeline.standing import FinalState, standings


@dataclass(frozen=True)
class Selection:
    """Crashes asked for, and for those that have to run the stage they start at.

    ``force``: stages computed again even where nothing has changed. ``exact``: run these crashes from these stages and
    nothing beside them, the first stage of each computed again even if unchanged.
    """

    asked: tuple[str, ...]
    start: dict[str, Stage] = field(default_factory=dict)
    force: frozenset[Stage] = frozenset()
    exact: bool = False


def registered(pipeline: Pipeline, cohort: str | None, only: Collection[str]) -> tuple[str, ...]:
    """The crashes asked for, in order; :class:`UserError` for keys or cohorts that are not registered."""
    keys = pipeline.registry.keys(cohort)
    if not keys:
        raise UserError(f"no crash is registered in {pipeline.storage.root}; see trace-dag ingest --help")
    if not only:
        return tuple(keys)
    pipeline.registry.sources(only)
    missing = [key for key in only if key not in set(keys)]
    if missing:
        raise UserError(f"crash {missing[0]} is registered, but not in cohort {cohort}")
    return tuple(in_order(only))


def select_stale(
    pipeline: Pipeline, cohort: str | None = None, only: Collection[str] = (), first: Stage | None = None
) -> Selection:
    """Crashes that are not up to date; with ``first`` all crashes, from that stage on at the latest."""
    asked = registered(pipeline, cohort, only)
    start = pipeline.first_stale(asked)
    if first is None:
        return Selection(asked, start)
    for key in asked:
        start[key] = min(start.get(key, first), first, key=lambda stage: stage.position)
    return Selection(asked, start, frozenset(first.and_later()))


def select_again(
    pipeline: Pipeline,
    cohort: str | None = None,
    only: Collection[str] = (),
    *,
    failed: bool = False,
    reason: Reason | None = None,
    first: Stage | None = None,
) -> Selection:
    """Crashes to run again: those that failed, those rejected for a reason, or all that reached a stage."""
    asked = registered(pipeline, cohort, only)
    records = read_records(pipeline.storage, asked)
    start: dict[str, Stage] = {}
    for key, crash in standings(records).items():
        if crash.stage_reached is None:
            continue
        if (failed and crash.final_state is FinalState.FAILED) or (
            reason is not None and crash.final_state is FinalState.REJECTED and crash.reason is reason
        ):
            start[key] = crash.stage_reached
        elif first is not None and crash.stage_reached.position >= first.position:
            start[key] = first
    return Selection(asked, start, frozenset(first.and_later()) if first else frozenset(), exact=True)
