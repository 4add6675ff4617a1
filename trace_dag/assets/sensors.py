"""Sensors on the folders that cohorts watch, and on what is registered, by whatever command on whatever machine."""

from collections.abc import Sequence

from dagster import (
    DefaultSensorStatus,
    ResourceParam,
    RunRequest,
    RunsFilter,
    SensorEvaluationContext,
    SensorResult,
    SkipReason,
    sensor,
)

from trace_dag.assets.jobs import STAGES
from trace_dag.assets.partitions import add_partitions
from trace_dag.assets.run_requests import UNFINISHED, keys_of, run_requests
from trace_dag.common.messages.wording import count_of
from trace_dag.common.provenance import crash_of
from trace_dag.common.stage import Stage
from trace_dag.flow.cohorts.watched_folders import register_arrivals
from trace_dag.flow.selection import Selection
from trace_dag.flow.workspace import Workspace

_INTERVAL_S = 30


@sensor(
    target=STAGES,
    minimum_interval_seconds=_INTERVAL_S,
    default_status=DefaultSensorStatus.STOPPED,
    description="Registers the reports that arrive in watched folders (trace-dag ingest --reports DIR --watch) and "
    "runs them through all stages. What is not a report is named in the tick.",
)
def arriving_reports(
    context: SensorEvaluationContext, workspace: ResourceParam[Workspace]
) -> SensorResult | SkipReason:
    """Register reports that arrived since the last tick, and request runs for them."""
    arrivals = register_arrivals(workspace.storage, context.cursor or "")
    if not arrivals.folders:
        return SkipReason("No cohort watches a folder; trace-dag ingest --reports DIR --watch makes one.")
    if arrivals.unread:
        context.log.warning(arrivals.unread)
    if not arrivals.keys:
        context.update_cursor(arrivals.seen)
        return SkipReason(f"Nothing new in {count_of(arrivals.folders, 'folder')}. {arrivals.unread}".rstrip())
    add_partitions(context.instance, arrivals.keys)
    return SensorResult(run_requests=_runs(context, workspace, arrivals.keys, arrivals.state), cursor=arrivals.seen)


@sensor(
    target=STAGES,
    minimum_interval_seconds=_INTERVAL_S,
    default_status=DefaultSensorStatus.RUNNING,
    description="Makes partitions of crashes that were registered elsewhere, such as with trace-dag ingest on another "
    "machine; with the setting automation.run_registered they are run through all stages.",
)
def registered_crashes(
    context: SensorEvaluationContext, workspace: ResourceParam[Workspace]
) -> SensorResult | SkipReason:
    """Add partitions for crashes that Dagster does not know, if the cohorts have changed since the last tick."""
    listed = workspace.registry.listed()
    if listed == context.cursor:
        return SkipReason("No cohort has changed.")
    keys = workspace.registry.keys()
    added = add_partitions(context.instance, keys)
    waiting = _never_run(context, workspace, keys) if workspace.settings.automation.run_registered else []
    if not waiting:
        context.update_cursor(listed)
        return SkipReason(f"{count_of(added, 'crash', 'crashes')} more than before.")
    return SensorResult(run_requests=_runs(context, workspace, waiting, listed), cursor=listed)


def _never_run(context: SensorEvaluationContext, workspace: Workspace, keys: Sequence[str]) -> list[str]:
    """Return the crashes without any stored result and without a run under way."""
    partitions = context.instance.get_dynamic_partitions("crashes")
    under_way = context.instance.get_runs(RunsFilter(statuses=[*UNFINISHED]))
    known = {key for run in under_way for key in keys_of(run.tags, partitions)}
    known |= {crash_of(name) for name in workspace.storage.list(Stage.RAW_REPORT)}
    return [key for key in keys if key not in known]


def _runs(context: SensorEvaluationContext, workspace: Workspace, keys: Sequence[str], state: str) -> list[RunRequest]:
    """Request runs of some crashes through all stages, once for each ``state``."""
    selection = Selection(tuple(keys), dict.fromkeys(keys, Stage.RAW_REPORT))
    return run_requests(context.instance, selection, size=workspace.settings.execution.batch_size, name=state)


SENSORS = (arriving_reports, registered_crashes)
