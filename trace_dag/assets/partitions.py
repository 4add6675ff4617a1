"""One partition per registered crash.

Dagster advises at most 100,000 partitions per asset; larger collections are split over several storage roots.
"""

from collections.abc import Collection, Sequence

from dagster import DagsterInstance, DynamicPartitionsDefinition

from trace_dag.flow.cohorts.registry import in_order

CRASHES = DynamicPartitionsDefinition(name="crashes")

_KEYS_PER_STATEMENT = 500  # SQLite refuses statements with tens of thousands of values


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
