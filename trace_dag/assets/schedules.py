"""A schedule that asks the CrashAPI, for the cohorts that follow it, what it has released since."""

from collections.abc import Sequence

from dagster import DefaultScheduleStatus, ResourceParam, RunRequest, ScheduleEvaluationContext, SkipReason, schedule

from trace_dag.assets.jobs import ALL_STAGES, STAGE_JOBS
from trace_dag.assets.launch import batch_config, range_tags
from trace_dag.assets.partitions import add_partitions
from trace_dag.errors import Stage
from trace_dag.pipeline.home import Home
from trace_dag.pipeline.planning import plan
from trace_dag.pipeline.releases import register_releases
from trace_dag.pipeline.selection import Selection


@schedule(
    job=next(job for job in STAGE_JOBS if job.name == ALL_STAGES),
    cron_schedule="0 6 * * 1",
    execution_timezone="UTC",
    default_status=DefaultScheduleStatus.STOPPED,
    description="Every Monday: asks the CrashAPI again for the cases of the cohorts that follow it (trace-dag ingest "
    "--crashapi --watch), registers those listed for the first time, and runs them and those not released before.",
)
def newly_released_cases(
    context: ScheduleEvaluationContext, home: ResourceParam[Home]
) -> Sequence[RunRequest] | SkipReason:
    """Register what was released since, and request runs for it."""
    pipeline = home.pipeline()
    releases = register_releases(pipeline)
    if not releases.followers:
        return SkipReason("No cohort follows the CrashAPI; trace-dag ingest --crashapi --watch makes one.")
    if not releases.keys:
        return SkipReason(f"Nothing new for {releases.followers} cohorts.")
    add_partitions(context.instance, releases.keys)
    # Exact, so that the report is asked for again although nothing else has changed.
    selection = Selection(releases.keys, dict.fromkeys(releases.keys, Stage.RAW_REPORT), exact=True)
    partitions = context.instance.get_dynamic_partitions("crashes")
    batches = plan(partitions, selection, size=pipeline.settings.execution.batch_size)
    tick = context.scheduled_execution_time.isoformat()
    return [
        RunRequest(run_key=f"{tick}-{number}", tags=range_tags(batch), run_config=batch_config(batch))
        for number, batch in enumerate(batches)
    ]


SCHEDULES = (newly_released_cases,)
