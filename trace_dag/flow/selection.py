"""The selection of crashes and stages to run, cut into Dagster runs.

A run covers one contiguous range of partition keys in the order they were added, all of one register. Current crashes
between two stale ones may be included if the caller selected them too (checking them is cheap, and they are reported
unchanged); others split the range.
"""

from __future__ import annotations

from collections.abc import Collection, Sequence
from dataclasses import dataclass, field, replace

from trace_dag.common.errors import Reason, UserError
from trace_dag.common.stage import Stage
from trace_dag.common.storage.files import Storage
from trace_dag.crash.keys import parse_key
from trace_dag.flow.batch import first_stale
from trace_dag.flow.cohorts.registry import in_order
from trace_dag.flow.crash_status import FinalState, crash_statuses
from trace_dag.flow.records import read_records
from trace_dag.flow.workspace import Workspace

_LARGE_MAP = 50_000_000  # bytes, which take some 10 s


@dataclass(frozen=True)
class Selection:
    """The selected crashes, and the first stage of those that have to run.

    ``force``: stages computed again even if unchanged. ``exact``: run only these crashes, from these stages on, and
    compute the first stage of each again even if unchanged.
    """

    asked: tuple[str, ...]
    start: dict[str, Stage] = field(default_factory=dict)
    force: frozenset[Stage] = frozenset()
    exact: bool = False


def select_registered(workspace: Workspace, cohort: str | None, only: Collection[str]) -> tuple[str, ...]:
    """Return the selected crashes in order.

    Raises :class:`UserError` for keys or cohorts that are not registered.
    """
    keys = workspace.registry.keys(cohort)
    if not keys:
        raise UserError(f"no crash is registered in {workspace.storage.root}; see trace-dag ingest --help")
    if not only:
        return tuple(keys)
    workspace.registry.sources(only)
    missing = [key for key in only if key not in set(keys)]
    if missing:
        raise UserError(f"crash {missing[0]} is registered, but not in cohort {cohort}")
    return tuple(in_order(only))


def not_released(storage: Storage, keys: Collection[str]) -> list[str]:
    """Return the crashes among ``keys`` whose report was not yet released at the last request."""
    return [
        key
        for key, records in read_records(storage, keys, [Stage.RAW_REPORT]).items()
        if any(record.reason is Reason.NOT_RELEASED for record in records.values())
    ]


def select_stale(
    workspace: Workspace, cohort: str | None = None, only: Collection[str] = (), first: Stage | None = None
) -> Selection:
    """Select crashes that are not up to date; with ``first`` select all, at the latest from that stage on."""
    asked = select_registered(workspace, cohort, only)
    start = first_stale(workspace, asked)
    if first is None:
        return Selection(asked, start)
    for key in asked:
        start[key] = min(start.get(key, first), first, key=lambda stage: stage.position)
    return Selection(asked, start, frozenset(first.and_later()))


def select_again(
    workspace: Workspace,
    cohort: str | None = None,
    only: Collection[str] = (),
    *,
    failed: bool = False,
    reason: Reason | None = None,
    first: Stage | None = None,
) -> Selection:
    """Select crashes to run again: failed or outdated, rejected for a reason, or from a stage on."""
    asked = select_registered(workspace, cohort, only)
    records = read_records(workspace.storage, asked)
    start: dict[str, Stage] = {}
    for key, crash in crash_statuses(records).items():
        if crash.stage_reached is None:
            continue
        if failed and crash.outdated is not None:
            start[key] = crash.outdated
            continue
        if (failed and crash.final_state is FinalState.FAILED) or (
            reason is not None and crash.final_state is FinalState.REJECTED and crash.reason is reason
        ):
            start[key] = crash.stage_reached
        elif first is not None and crash.stage_reached.position >= first.position:
            start[key] = first
    return Selection(asked, start, frozenset(first.and_later()) if first else frozenset(), exact=True)


@dataclass(frozen=True)
class PlannedBatch:
    """One run: a contiguous range of keys, in partition order, and the stages to run for all of them.

    It also has the keys that are computed again even if unchanged.
    """

    keys: tuple[str, ...]
    stages: tuple[Stage, ...]
    force: frozenset[Stage] = frozenset()


def has_large_map(workspace: Workspace) -> bool:
    """Return whether a registered map file is so large that one reading for all batches is worthwhile."""
    return any(file.size >= _LARGE_MAP for cohort in workspace.registry.cohorts().values() for file in cohort.maps)


def plan_maps_first(partitions: Sequence[str], selection: Selection, *, size: int) -> list[PlannedBatch]:
    """Return batches as :func:`plan` does, after batches of any size that run every crash up to its extract."""
    first_half = Stage.OSM_EXTRACT.position
    early = {key: stage for key, stage in selection.start.items() if stage.position <= first_half}
    late = {key: max(stage, Stage.ROAD_MAP, key=lambda each: each.position) for key, stage in selection.start.items()}
    extracts = [
        replace(batch, stages=stages, force=batch.force & set(stages))
        for batch in plan(partitions, replace(selection, start=early), size=len(partitions))
        for stages in [tuple(stage for stage in batch.stages if stage.position <= first_half)]
    ]
    return [*extracts, *plan(partitions, replace(selection, start=late), size=size)]


def plan(partitions: Sequence[str], selection: Selection, *, size: int) -> list[PlannedBatch]:
    """Return batches of at most ``size`` keys that run every crash of a selection from its stage on.

    An exact selection needs more runs: no other crash is included, and none starts before its own stage.
    """
    start, asked = selection.start, set(selection.asked)
    batches: list[PlannedBatch] = []
    current: list[str] = []

    def close() -> None:
        while current and current[-1] not in start:
            current.pop()
        if current:
            earliest = min((start[key] for key in current if key in start), key=lambda stage: stage.position)
            stages = earliest.and_later()
            force = selection.force & set(stages)
            batches.append(PlannedBatch(tuple(current), stages, force | {earliest} if selection.exact else force))
        current.clear()

    for key in partitions:
        stale = key in start
        if not (stale or (current and not selection.exact and key in asked)):
            close()
            continue
        if current and parse_key(key).register != parse_key(current[-1]).register:
            close()
            if not stale:
                continue
        if current and (len(current) >= size or (selection.exact and start[key] is not start[current[-1]])):
            close()
            if not stale:
                continue
        current.append(key)
    close()
    return batches
