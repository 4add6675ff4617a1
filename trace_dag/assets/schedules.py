"""A schedule that asks the CrashAPI, for the cohorts that follow it, what it has released since."""

from collections.abc import Sequence
from functools import partial

from dagster import DefaultScheduleStatus, ResourceParam, RunRequest, ScheduleEvaluationContext, SkipReason, schedule

from trace_dag.assets.jobs import ALL_STAGES, STAGE_JOBS
from trace_dag.assets.partitions import add_partitions
from trace_dag.assets.run_requests import batch_config, range_tags
from trace_dag.cohorts.new_cases import register_new_cases
from trace_dag.flow.selection import Selection, not_released, plan
from trace_dag.flow.workspace import Workspace
from trace_dag.stage import Stage


@schedule(
    job=next(job for job in STAGE_JOBS if job.name == ALL_STAGES),
    cron_schedule="0 6 * * 1",
    execution_timezone="UTC",
    default_status=DefaultScheduleStatus.STOPPED,
    description="Every Monday: asks the CrashAPI again for the cases of the cohorts that follow it (trace-dag ingest "
    "--crashapi --watch), registers those listed for the first time, and runs them and those not released before.",
)
def newly_released_cases(
    context: ScheduleEvaluationContext, workspace: ResourceParam[Workspace]
) -> Sequence[RunRequest] | SkipReason:
    """Register what was released since, and request runs for it."""
    cases = register_new_cases(workspace.storage, workspace.settings.services, partial(not_released, workspace.storage))
    if not cases.followers:
        return SkipReason("No cohort follows the CrashAPI; trace-dag ingest --crashapi --watch makes one.")
    if not cases.keys:
        return SkipReason(f"Nothing new for {cases.followers} cohorts.")
    add_partitions(context.instance, cases.keys)
    # Exact, so that the report is asked for again although nothing else has changed.
    selection = Selection(cases.keys, dict.fromkeys(cases.keys, Stage.RAW_REPORT), exact=True)
    partitions = context.instance.get_dynamic_partitions("crashes")
    batches = plan(partitions, selection, size=workspace.settings.execution.batch_size)
    tick = context.scheduled_execution_time.isoformat()
    return [
        RunRequest(run_key=f"{tick}-{number}", tags=range_tags(batch), run_config=batch_config(batch))
        for number, batch in enumerate(batches)
    ]


SCHEDULES = (newly_released_cases,)
