"""Partitions, one per registered crash, and runs of planned crashes, the same for schedules, sensors and commands.

Dagster advises at most 100,000 partitions per asset; larger collections are split over several storage roots.
"""

from collections.abc import Collection, Mapping, Sequence
from hashlib import sha256
from typing import Any

from dagster import AssetKey, DagsterInstance, DagsterRunStatus, DynamicPartitionsDefinition, RunRequest

from trace_dag.common.stage import Stage
from trace_dag.flow.cohorts.registry import in_order
from trace_dag.flow.selection import PlannedBatch, Selection, plan

PROCESS_TAG = "trace_dag/process"
"""Names the command that started a run."""

UNFINISHED = (
    DagsterRunStatus.QUEUED,
    DagsterRunStatus.NOT_STARTED,
    DagsterRunStatus.STARTING,
    DagsterRunStatus.STARTED,
)
"""Statuses of runs that are under way or to come."""

PLANNED_TAG = "trace_dag/planned"
"""Holds the fingerprint of the crashes that a run was planned for."""

_PARTITION_TAG = "dagster/partition"
_RANGE_START_TAG = "dagster/asset_partition_range_start"
_RANGE_END_TAG = "dagster/asset_partition_range_end"
CRASHES = DynamicPartitionsDefinition(name="crashes")

_KEYS_PER_STATEMENT = 500  # SQLite refuses statements with tens of thousands of values


def batch_config(batch: PlannedBatch, settings: Mapping[str, Any] | None = None) -> dict[str, Any]:
    """Return the configuration of a batch's run, with settings that override the root's."""
    forced = [stage.value for stage in Stage if stage in batch.force]
    return {"ops": {"crashes": {"config": {"force": forced, "settings": dict(settings or {})}}}}


def range_tags(batch: PlannedBatch) -> dict[str, str]:
    """Return the tags by which Dagster knows the partitions of a run, with their fingerprint.

    Dagster stores only the ends of a range and looks up the partitions between them when the run starts. By then,
    partitions that were removed and added again have changed their order.
    """
    ends = {_RANGE_START_TAG: batch.keys[0], _RANGE_END_TAG: batch.keys[-1]}
    return {**ends, PLANNED_TAG: fingerprint(batch.keys)}


def fingerprint(keys: Sequence[str]) -> str:
    """Return a short digest of partition keys in any order."""
    return sha256("\n".join(sorted(keys)).encode()).hexdigest()[:16]


def run_requests(instance: DagsterInstance, selection: Selection, *, size: int, name: str) -> list[RunRequest]:
    """Return runs of at most ``size`` crashes each for a selection.

    Dagster starts the runs of one ``name`` only once.
    """
    batches = plan(instance.get_dynamic_partitions("crashes"), selection, size=size)
    return [
        RunRequest(
            run_key=f"{name}-{number}",
            tags=range_tags(batch),
            run_config=batch_config(batch),
            asset_selection=[AssetKey(stage.value) for stage in batch.stages],
        )
        for number, batch in enumerate(batches)
    ]


def keys_of(tags: Mapping[str, str], partitions: Sequence[str]) -> Sequence[str]:
    """Return the partitions that a run with these tags covers, in order.

    None if the tags name no known partition.
    """
    single = tags.get(_PARTITION_TAG)
    ends = tags.get(_RANGE_START_TAG, single), tags.get(_RANGE_END_TAG, single)
    if not all(end in partitions for end in ends):
        return ()
    first, last = (partitions.index(end) for end in ends if end is not None)
    return partitions[first : last + 1]


def add_partitions(instance: DagsterInstance, keys: Sequence[str]) -> int:
    """Add partitions for registered crashes that have none, in order; return their number.

    Runs cover ranges in the order of insertion, so keys are added sorted.
    """
    known = set(instance.get_dynamic_partitions("crashes"))
    new = [key for key in in_order(keys) if key not in known]
    for start in range(0, len(new), _KEYS_PER_STATEMENT):
        instance.add_dynamic_partitions("crashes", new[start : start + _KEYS_PER_STATEMENT])
    return len(new)


def remove_partitions(instance: DagsterInstance, keys: Collection[str]) -> int:
    """Remove the partitions of crashes that are no longer registered; return their number."""
    gone = set(instance.get_dynamic_partitions("crashes")) & set(keys)
    for key in gone:
        instance.delete_dynamic_partition("crashes", key)
    return len(gone)
