"""A storage root with fake crashes and a Dagster instance of its own."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import Any

import fake_flow
import pytest
from dagster import AssetKey, DagsterInstance

from trace_dag.assets.launch import RunReport, open_instance, plan_runs, run_batches
from trace_dag.assets.run_requests import CRASHES, add_partitions
from trace_dag.common.stage import Stage
from trace_dag.flow.selection import Selection, select_stale
from trace_dag.flow.workspace import Workspace

SETTINGS: dict[str, Any] = {"execution": {"executor": "in_process", "retry_wait_s": 0.0}}


class Campaign:
    """Fake crashes on a root, run through Dagster."""

    def __init__(self, folder: Path, behaviours: Mapping[str, str]) -> None:
        self.workspace = Workspace.open(str(folder / "root"), fake_flow.FLOW)
        self.workspace = self.workspace.with_settings(SETTINGS)
        self.workspace.registry.register("fakes", fake_flow.write_reports(folder / "reports", behaviours))
        self.instance: DagsterInstance = open_instance(self.workspace)
        add_partitions(self.instance, self.workspace.registry.keys())

    def run(self, selection: Selection | None = None, settings: Mapping[str, Any] = SETTINGS) -> RunReport:
        workspace = self.workspace.with_settings(settings)
        batches = plan_runs(workspace, self.instance, selection or select_stale(workspace))
        return run_batches(self.workspace, self.instance, batches, settings=settings)

    def statuses(self) -> dict[tuple[str, str], str]:
        """What Dagster shows for each stage and crash."""
        keys = self.instance.get_dynamic_partitions("crashes")
        found = {}
        for stage in Stage:
            held = self.instance.get_status_by_partition(AssetKey(stage.value), keys, CRASHES) or {}
            for key in keys:
                status = held.get(key)
                found[stage.value, key] = status.value if status else "MISSING"
        return found


@pytest.fixture
def campaign(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Iterator[Any]:
    """Makes a campaign; Dagster's environment is put back afterwards."""
    for name in ("DAGSTER_HOME", "TRACE_DAG_ROOT"):
        monkeypatch.setenv(name, "to be replaced")
    made = []

    def make(behaviours: Mapping[str, str]) -> Campaign:
        made.append(Campaign(tmp_path, behaviours))
        return made[-1]

    yield make
    for each in made:
        each.instance.dispose()
