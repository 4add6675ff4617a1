"""Many crashes get and lose their partitions in few statements."""

from __future__ import annotations

import pytest

from trace_dag.assets.launch import open_instance, plan_runs, run_batches
from trace_dag.assets.run_requests import add_partitions, remove_partitions
from trace_dag.flow.selection import select_stale


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


@pytest.mark.parametrize("moved", [0, 1, 3])
def test_a_planned_run_fails_once_its_range_covers_other_crashes_than_it_was_planned_for(campaign, moved):
    keys = [f"2023-5100{number}" for number in range(10, 14)]
    made = campaign(dict.fromkeys(keys, ""))
    batches = plan_runs(made.workspace, made.instance, select_stale(made.workspace))
    remove_partitions(made.instance, [keys[moved]])
    add_partitions(made.instance, [keys[moved]])  # the last one now
    report = run_batches(made.workspace, made.instance, batches, settings={"execution": {"executor": "in_process"}})
    if moved == len(keys) - 1:
        assert report.errors == (), "the order is as it was"
        return
    (error,) = report.errors
    assert error.startswith("the partitions have changed since this run was planned: its range covers ")
    assert "MATERIALIZED" not in made.statuses().values()
    assert made.run().errors == (), "a new run takes the crashes as they stand now"
