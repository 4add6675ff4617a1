"""What the Dagster UI does when its buttons are pressed: its GraphQL requests, and the daemon that carries them out.

All in this process: the code location, the daemon's iterations, and the runs it launches. Dagster has no public name
for one iteration of its daemon; the daemon itself looks every half minute.
"""

from __future__ import annotations

import logging
import sys
from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager
from datetime import UTC, datetime
from pathlib import Path
from typing import Any

import yaml
from dagster import AssetKey, DagsterInstance, DagsterRun, RunsFilter
from dagster._core.definitions.partitions.context import partition_loading_context
from dagster._core.remote_origin import InProcessCodeLocationOrigin
from dagster._core.storage.tags import BACKFILL_ID_TAG
from dagster._core.test_utils import freeze_time
from dagster._core.types.loadable_target_origin import LoadableTargetOrigin
from dagster._core.workspace.context import WorkspaceProcessContext
from dagster._core.workspace.load_target import InProcessWorkspaceLoadTarget
from dagster._daemon.backfill import execute_backfill_iteration
from dagster._daemon.sensor import execute_sensor_iteration
from dagster._scheduler.scheduler import launch_scheduled_runs
from dagster_graphql.test.utils import execute_dagster_graphql

_IN_THIS_PROCESS = {
    "run_launcher": {
        "module": "dagster._core.launcher.sync_in_memory_run_launcher",
        "class": "SyncInMemoryRunLauncher",
    },
    "run_coordinator": {"module": "dagster._core.run_coordinator", "class": "DefaultRunCoordinator"},
}
_LOCATION = """\
from {module} import {flow} as FLOW

from trace_dag.assets.definitions import build_definitions
from trace_dag.flow.workspace import Workspace

defs = build_definitions(Workspace.open({root!r}, FLOW))
"""
_ITERATIONS = 20
_REPOSITORY = {"repositoryName": "__repository__", "repositoryLocationName": "<<in_process>>"}
_START_SENSOR = """
mutation($of: SensorSelector!) {
  startSensor(sensorSelector: $of) { __typename ... on PythonError { message stack } }
}
"""
_START_SCHEDULE = """
mutation($of: ScheduleSelector!) {
  startSchedule(scheduleSelector: $of) { __typename ... on PythonError { message stack } }
}
"""
_LAUNCH = """
mutation($params: LaunchBackfillParams!) {
  launchPartitionBackfill(backfillParams: $params) {
    __typename ... on LaunchBackfillSuccess { backfillId } ... on PythonError { message stack }
  }
}
"""
_AGAIN = """
mutation($params: ReexecutionParams!) {
  reexecutePartitionBackfill(reexecutionParams: $params) {
    __typename ... on LaunchBackfillSuccess { backfillId } ... on PythonError { message stack }
  }
}
"""


_COUNTS = """
query($id: String!) {
  partitionBackfillOrError(backfillId: $id) {
    ... on PartitionBackfill { assetBackfillData { assetBackfillStatuses { ... on AssetPartitionsStatusCounts {
      assetKey { path } numPartitionsMaterialized numPartitionsFailed
    } } } }
  }
}
"""


class DagsterUi:
    """The buttons of the UI."""

    def __init__(self, workspace: WorkspaceProcessContext) -> None:
        self._workspace = workspace
        self._instance: DagsterInstance = workspace.instance

    def materialize(
        self, partitions: Mapping[str, Sequence[str] | None], config: Mapping[str, Any] | None = None
    ) -> str:
        """Start a backfill of neighbouring partitions of assets (None: an asset without partitions); its id."""
        by_asset = [
            {"assetKey": {"path": [name]}, "partitions": None if keys is None else _range(keys)}
            for name, keys in partitions.items()
        ]
        return self._launched(_LAUNCH, {"partitionsByAssets": by_asset, "runConfigData": dict(config or {})})

    def counts(self, backfill: str) -> dict[str, tuple[int, int]]:
        """How many partitions of each asset the page of a backfill says succeeded and failed."""
        statuses = self._ask(_COUNTS, {"id": backfill})["assetBackfillData"]["assetBackfillStatuses"]
        return {
            status["assetKey"]["path"][0]: (status["numPartitionsMaterialized"], status["numPartitionsFailed"])
            for status in statuses
        }

    def execute_again_from_failure(self, backfill: str) -> str:
        """Start a backfill of what an earlier one did not materialize; its id."""
        return self._launched(_AGAIN, {"parentRunId": backfill, "strategy": "FROM_FAILURE"})

    def start_sensor(self, name: str) -> None:
        """Switch a sensor on."""
        assert self._ask(_START_SENSOR, {"of": {**_REPOSITORY, "sensorName": name}})["__typename"] == "Sensor"

    def start_schedule(self, name: str) -> None:
        """Switch a schedule on."""
        said = self._ask(_START_SCHEDULE, {"of": {**_REPOSITORY, "scheduleName": name}})
        assert said["__typename"] == "ScheduleStateResult", said

    def let_daemon_look(self, at_s: float) -> None:
        """One iteration of the daemon's, over sensors and schedules, at a moment (epoch seconds)."""
        with freeze_time(at_s):
            logger = logging.getLogger("daemon")
            found = [
                *launch_scheduled_runs(self._workspace, logger, datetime.fromtimestamp(at_s, UTC), {}),
                *execute_sensor_iteration(self._workspace, logger, None, None),
            ]
        assert not any(found), found

    def runs_of(self, backfill: str) -> list[DagsterRun]:
        """The runs of a backfill, the first one first."""
        return self._instance.get_runs(RunsFilter(tags={BACKFILL_ID_TAG: backfill}), ascending=True)

    def runs(self, asset: str) -> list[DagsterRun]:
        """The runs that were to materialize an asset, the first one first."""
        return [
            run for run in self._instance.get_runs(ascending=True) if AssetKey(asset) in (run.asset_selection or ())
        ]

    def _launched(self, mutation: str, params: Mapping[str, Any]) -> str:
        said = self._ask(mutation, {"params": params})
        assert said["__typename"] == "LaunchBackfillSuccess", said
        for _ in range(_ITERATIONS):
            errors = list(execute_backfill_iteration(self._workspace, logging.getLogger("backfill")))
            assert not any(errors), errors
            backfill = self._instance.get_backfill(said["backfillId"])
            if backfill.status.value not in ("REQUESTED", "COMPLETING"):
                return str(said["backfillId"])
        raise AssertionError(f"the backfill has not ended: {backfill}")

    def _ask(self, question: str, variables: Mapping[str, Any]) -> Any:
        """The one field of an answer of GraphQL's."""
        request = self._workspace.create_request_context()
        with partition_loading_context(dynamic_partitions_store=self._instance):
            answer = execute_dagster_graphql(request, question, variables)
        (said,) = answer.data.values()
        return said


def _range(keys: Sequence[str]) -> dict[str, Any]:
    return {"ranges": [{"start": keys[0], "end": keys[-1]}]}


def launch_in_this_process(dagster_home: Path) -> None:
    """Let an instance opened after this carry out runs as they are launched, in this process."""
    file = dagster_home / "dagster.yaml"
    settings = yaml.safe_load(file.read_text())
    del settings["concurrency"]  # of the queue, which there is none of now
    file.write_text(yaml.safe_dump(settings | _IN_THIS_PROCESS))


@contextmanager
def dagster_ui(instance: DagsterInstance, root: str, folder: Path, flow: str = "fake_flow:FLOW") -> Iterator[DagsterUi]:
    """The UI over a root whose crashes run through a flow, ``module:name``."""
    module, _, name = flow.partition(":")
    location = folder / "code_location.py"
    location.write_text(_LOCATION.format(root=root, module=module, flow=name))
    origin = LoadableTargetOrigin(
        executable_path=sys.executable, python_file=str(location), working_directory=str(folder)
    )
    target = InProcessWorkspaceLoadTarget(InProcessCodeLocationOrigin(origin))
    with WorkspaceProcessContext(instance, target) as workspace:
        yield DagsterUi(workspace)
