"""What the UI offers to repair, and what the command runs again, are the same stages of the same crashes."""

from __future__ import annotations

from pathlib import Path

import fake_flow
import pytest
from dagster import AssetKey

from trace_dag.assets.definitions import build_definitions
from trace_dag.assets.run_requests import range_tags
from trace_dag.common.stage import Stage
from trace_dag.flow.selection import PlannedBatch, select_again

KEYS = [f"2023-5100{number:02}" for number in range(1, 6)]
BROKEN = {KEYS[1]: Stage.ROAD_MAP, KEYS[3]: Stage.SIMULATION_LOG}
BEHAVIOURS = {key: f"fail-once:{BROKEN[key]}" if key in BROKEN else "" for key in KEYS}
REPAIRED = {(stage.value, key) for key, broken in BROKEN.items() for stage in broken.and_later()}


def by_command(made) -> None:
    """``trace-dag rerun --failed``."""
    assert made.run(select_again(made.workspace, failed=True)).errors == ()


def by_failed_pairs(made) -> None:
    """The UI's "only failed and missing partitions within selection", and a backfill executed again from failure."""
    for key in BROKEN:
        in_ui(made, key, {stage for (stage, of), status in made.statuses().items() if of == key and status == "FAILED"})


def by_failed_partitions(made) -> None:
    """The UI's "Failed and missing" over all assets: every stage of the crashes that are not materialized."""
    for key in {of for (_, of), status in made.statuses().items() if status in ("FAILED", "MISSING")}:
        in_ui(made, key, {stage.value for stage in Stage})


def in_ui(made, key: str, stages: set[str]) -> None:
    """One run as a backfill of the UI launches it, without anything the command adds."""
    job = build_definitions(made.workspace).resolve_implicit_global_asset_job_def()
    done = job.execute_in_process(
        run_config={"ops": {"crashes": {"config": {"settings": {"execution": {"executor": "in_process"}}}}}},
        instance=made.instance,
        asset_selection=[AssetKey(stage) for stage in stages],
        tags=range_tags(PlannedBatch((key,), tuple(Stage))),
    )
    assert done.success


@pytest.mark.parametrize("repair", [by_command, by_failed_pairs, by_failed_partitions])
def test_exactly_the_stages_and_crashes_that_broke_are_computed(campaign, repair):
    made = campaign(BEHAVIOURS)
    made.run()
    assert {where for where, status in made.statuses().items() if status != "MATERIALIZED"} == REPAIRED
    before = fake_flow.calls(Path(made.workspace.storage.root))
    repair(made)
    after = fake_flow.calls(Path(made.workspace.storage.root))
    assert {where for where in after if after[where] != before.get(where)} == REPAIRED
    assert set(made.statuses().values()) == {"MATERIALIZED"}
