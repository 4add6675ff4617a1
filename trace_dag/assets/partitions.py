"""One partition per registered crash.

Dagster advises at most 100,000 partitions per asset; larger collections are split over several storage roots.
"""

from collections.abc import Collection, Sequence

from dagster import DagsterInstance, DynamicPartitionsDefinition

from trace_dag.flow.cohorts.registry import in_order

CRASHES = DynamicPartitionsDefinition(name="crashes")

_KEYS_PER_STATEMENT = 500  # SQLite refuses statements with tens of thousands of values


def add_partitions(instance: DagsterInstance, keys: Sequence[str]) -> int:
    """Make partitions of the registered crashes that have none yet, in order; how many there were.

    Runs cover ranges in the order of insertion, so keys are added sorted.
    """
    known = set(instance.get_dynamic_partitions("crashes"))
    new = [key for key in in_order(keys) if key not in known]
    for start in range(0, len(new), _KEYS_PER_STATEMENT):
        instance.add_dynamic_partitions("crashes", new[start : start + _KEYS_PER_STATEMENT])
    return len(new)


def remove_partitions(instance: DagsterInstance, keys: Collection[str]) -> int:
    """Take away the partitions of crashes that are registered no more; how many there were."""
    gone = set(instance.get_dynamic_partitions("crashes")) & set(keys)
    for key in gone:
        instance.delete_dynamic_partition("crashes", key)
    return len(gone)
