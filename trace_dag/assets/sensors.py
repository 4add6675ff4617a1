"""A sensor on the folders that cohorts watch: what arrives is registered, gets a partition, and is run."""

from dagster import (
    DefaultSensorStatus,
    ResourceParam,
    RunRequest,
    SensorEvaluationContext,
    SensorResult,
    SkipReason,
    sensor,
)

from trace_dag.assets.jobs import ALL_STAGES, STAGE_JOBS
from trace_dag.assets.partitions import add_partitions
from trace_dag.assets.run_requests import range_tags
from trace_dag.cohorts.watched_folders import register_arrivals
from trace_dag.flow.selection import Selection, plan
from trace_dag.flow.workspace import Workspace
from trace_dag.stage import Stage
from trace_dag.wording import counted

_INTERVAL_S = 30


@sensor(
    jobs=[job for job in STAGE_JOBS if job.name == ALL_STAGES],
    minimum_interval_seconds=_INTERVAL_S,
    default_status=DefaultSensorStatus.STOPPED,
    description="Registers the reports that arrive in watched folders (trace-dag ingest --reports DIR --watch) and "
    "runs them through all stages. What is not a report is named in the tick.",
)
def arriving_reports(
    context: SensorEvaluationContext, workspace: ResourceParam[Workspace]
) -> SensorResult | SkipReason:
    """Register what arrived since the last look, and request runs for it."""
    arrivals = register_arrivals(workspace.storage, context.cursor or "")
    if not arrivals.folders:
        return SkipReason("No cohort watches a folder; trace-dag ingest --reports DIR --watch makes one.")
    if arrivals.unread:
        context.log.warning(arrivals.unread)
    if not arrivals.keys:
        context.update_cursor(arrivals.seen)
        return SkipReason(f"Nothing new in {counted(arrivals.folders, 'folder')}. {arrivals.unread}".rstrip())
    add_partitions(context.instance, arrivals.keys)
    selection = Selection(arrivals.keys, dict.fromkeys(arrivals.keys, Stage.RAW_REPORT))
    partitions = context.instance.get_dynamic_partitions("crashes")
    batches = plan(partitions, selection, size=workspace.settings.execution.batch_size)
    return SensorResult(
        run_requests=[
            RunRequest(run_key=f"{arrivals.state}-{number}", tags=range_tags(batch))
            for number, batch in enumerate(batches)
        ],
        cursor=arrivals.seen,
    )


SENSORS = (arriving_reports,)
