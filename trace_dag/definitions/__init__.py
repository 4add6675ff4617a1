"""The Dagster code location: ``dagster dev -m trace_dag.definitions`` or ``trace-dag ui``.

Belongs here: putting assets, checks, jobs, sensors and resources together (this module), and runs that a command starts
(:mod:`trace_dag.definitions.launch`). Does not belong here: the assets themselves (:mod:`trace_dag.assets`).
"""

from typing import Any

from dagster import ConfigurableResource, Definitions, InitResourceContext, in_process_executor

from trace_dag.assets.after_runs import AFTER_RUNS
from trace_dag.assets.batch import crashes
from trace_dag.assets.checks import CHECKS
from trace_dag.assets.jobs import STAGE_JOBS, SUMMARY_JOB
from trace_dag.assets.schedules import SCHEDULES
from trace_dag.assets.sensors import SENSORS
from trace_dag.assets.studies import STUDIES
from trace_dag.assets.summaries import benchmark, warehouse
from trace_dag.flow.workspace import Workspace, storage_root


class WorkspaceResource(ConfigurableResource[Workspace]):
    """Builds the :class:`Workspace` that assets, checks and sensors work on.

    Its root is that of the environment (TRACE_DAG_ROOT, else ./trace_dag_home): no run's configuration can move it.
    """

    def create_resource(self, context: InitResourceContext) -> Workspace:
        """The home at that root, with the real stages."""
        return Workspace.open(storage_root())


def build_definitions(workspace: Any = None) -> Definitions:
    """The definitions, on a workspace, or by default on the one the environment names."""
    return Definitions(
        assets=[crashes, warehouse, benchmark, *STUDIES.values()],
        asset_checks=CHECKS,
        jobs=[*STAGE_JOBS, SUMMARY_JOB],
        sensors=[*SENSORS, *AFTER_RUNS],
        schedules=SCHEDULES,
        resources={"workspace": workspace if workspace is not None else WorkspaceResource()},
        # The step is parallel within; a process per step would only add to it.
        executor=in_process_executor,
    )


defs = build_definitions()
