"""Work cut into Dagster runs.

A run covers one contiguous range of partition keys in the order they were added. Crashes between two stale ones may
be taken along (they cost a look and are reported unchanged) where the caller asked for them too; others split the
range.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

from trace_dag.errors import Stage
from trace_dag.pipeline.selection import Selection


@dataclass(frozen=True)
class PlannedBatch:
    """One run: a contiguous range of keys, in partition order, the stages to run for all of them, and those of them
    that are computed again even where nothing has changed."""

    keys: tuple[str, ...]
    stages: tuple[Stage, ...]
    force: frozenset[Stage] = frozenset()


def plan(partitions: Sequence[str], selection: Selection, *, size: int) -> list[PlannedBatch]:
    """Batches of at most ``size`` keys that run every crash of a selection from its stage on.

    An exact selection is kept to the letter, at the price of more runs: no crash is taken along, and none starts at an
    earlier stage than its own.
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
        if current and (len(current) >= size or (selection.exact and start[key] is not start[current[-1]])):
            close()
            if not stale:
                continue
        current.append(key)
    close()
    return batches
