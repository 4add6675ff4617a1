"""Many crashes get and lose their partitions in few statements."""

from __future__ import annotations

from trace_dag.assets.launch import open_instance
from trace_dag.assets.partitions import add_partitions, remove_partitions


def test_thousands_are_added_in_order_and_taken_away_with_what_is_asked_for_alone(campaign):
    instance = campaign({}).instance
    keys = [f"2023-{number}" for number in range(510001, 512502)]
    assert add_partitions(instance, reversed(keys)) == len(keys)
    assert list(instance.get_dynamic_partitions("crashes")) == keys
    assert remove_partitions(instance, [*keys[1:100], "2023-599999"]) == 99
    assert list(instance.get_dynamic_partitions("crashes")) == [keys[0], *keys[100:]]
    assert remove_partitions(instance, keys[1:100]) == 0


def test_partitions_that_another_process_has_added_or_taken_away_are_seen(campaign):
    made = campaign({})
    keys = ["2023-510003", "2023-510001", "2023-510002"]
    made.instance.add_dynamic_partitions("crashes", keys)
    made.instance.add_dynamic_partitions("others", ["something"])
    assert list(made.instance.get_dynamic_partitions("crashes")) == keys, "in the order in which they came"
    with open_instance(made.workspace) as another:
        another.delete_dynamic_partition("crashes", keys[2])
        another.add_dynamic_partitions("crashes", ["2023-510004"])
    assert list(made.instance.get_dynamic_partitions("crashes")) == [*keys[:2], "2023-510004"]
    assert list(made.instance.get_dynamic_partitions("nobody")) == []
