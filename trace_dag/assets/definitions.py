"""The Dagster code location: ``dagster dev -m trace_dag.assets.definitions`` or ``trace-dag ui``.

Belongs here: putting assets, checks, jobs, sensors and resources together (this module), and runs that a command starts
(:mod:`trace_dag.assets.launch`). Does not belong here: the assets themselves (:mod:`trace_dag.assets`).
"""

from datetime import timedelta

from dagster import (
    AssetsDefinition,
    ConfigurableResource,
    Definitions,
    FreshnessPolicy,
    InitResourceContext,
    definitions,
    in_process_executor,
)

from trace_dag.assets.automation import SENSORS, schedules
from trace_dag.assets.batch import crashes
from trace_dag.assets.studies import STUDIES
from trace_dag.assets.summaries import CHECKS, SUMMARY_JOB, benchmark, warehouse
from trace_dag.common.settings import AutomationSettings
from trace_dag.flow.workspace import Workspace, storage_root, stored_settings


class WorkspaceResource(ConfigurableResource[Workspace]):
    """Builds the :class:`Workspace` that assets, checks and sensors work on.

    Its root comes from the environment (TRACE_DAG_ROOT, else ./trace_dag_home), so that no run's configuration can move
    it.
    """

    def create_resource(self, context: InitResourceContext) -> Workspace:
        """Return the home at that root, with the real stages."""
        return Workspace.open(storage_root())


def build_definitions(workspace: Workspace | None = None) -> Definitions:
    """Return the definitions on a workspace, by default on the root that the environment names.

    Raises :class:`trace_dag.common.errors.UserError` for invalid settings.
    """
    automation = workspace.settings.automation if workspace is not None else stored_settings(storage_root()).automation
    return Definitions(
        assets=[crashes, _fresh(warehouse, automation), benchmark, *STUDIES.values()],
        asset_checks=CHECKS,
        jobs=[SUMMARY_JOB],
        sensors=SENSORS,
        schedules=schedules(automation),
        resources={"workspace": workspace if workspace is not None else WorkspaceResource()},
        # The step is parallel within; a process per step would only add to it.
        executor=in_process_executor,
    )


def _fresh(asset: AssetsDefinition, automation: AutomationSettings) -> AssetsDefinition:
    """Return the asset with the age at which it counts as overdue, if the settings name an age."""
    if automation.fresh_within_h is None:
        return asset
    overdue = timedelta(hours=automation.fresh_within_h)
    policy = FreshnessPolicy.time_window(fail_window=overdue, warn_window=overdue * 0.75)
    return asset.map_asset_specs(lambda spec: spec.replace_attributes(freshness_policy=policy))


@definitions
def defs() -> Definitions:
    """Build the definitions when Dagster loads them; the root's settings are not read before."""
    return build_definitions()
