"""After the last of a set of runs, what is made of all crashes together is brought up to date."""

from dagster import (
    DagsterInstance,
    DagsterRun,
    DagsterRunStatus,
    DefaultSensorStatus,
    RunRequest,
    RunsFilter,
    RunStatusSensorContext,
    SkipReason,
    run_status_sensor,
)

from trace_dag.assets.jobs import SUMMARY_JOB
from trace_dag.assets.launch import PROCESS_TAG
from trace_dag.errors import Stage

_UNFINISHED = [
    DagsterRunStatus.QUEUED,
    DagsterRunStatus.NOT_STARTED,
    DagsterRunStatus.STARTING,
    DagsterRunStatus.STARTED,
]
_STAGES = frozenset(stage.value for stage in Stage)


def _request(context: RunStatusSensorContext) -> RunRequest | SkipReason:
    run = context.dagster_run
    if PROCESS_TAG in run.tags:
        return SkipReason("The command that started this run builds the warehouse itself.")
    if not _runs_stages(run):
        return SkipReason("No stage was run.")
    if _others_to_come(context.instance, run):
        return SkipReason("More runs are to come; the last one brings everything up to date.")
    return RunRequest(run_key=run.run_id)


def _runs_stages(run: DagsterRun) -> bool:
    return any(key.to_user_string() in _STAGES for key in run.asset_selection or ())


def _others_to_come(instance: DagsterInstance, run: DagsterRun) -> bool:
    waiting = instance.get_runs(RunsFilter(statuses=_UNFINISHED))
    return any(other.run_id != run.run_id and _runs_stages(other) for other in waiting)


@run_status_sensor(
    run_status=DagsterRunStatus.SUCCESS,
    request_job=SUMMARY_JOB,
    default_status=DefaultSensorStatus.RUNNING,
    description="After the last of the runs: the warehouse, its checks and the benchmark.",
)
def summary_after_runs(context: RunStatusSensorContext) -> RunRequest | SkipReason:
    """After runs without failures."""
    return _request(context)


@run_status_sensor(
    run_status=DagsterRunStatus.FAILURE,
    request_job=SUMMARY_JOB,
    default_status=DefaultSensorStatus.RUNNING,
    description="The same after runs in which crashes failed: the others are done all the same.",
)
def summary_after_failed_runs(context: RunStatusSensorContext) -> RunRequest | SkipReason:
    """After runs with failures."""
    return _request(context)


AFTER_RUNS = (summary_after_runs, summary_after_failed_runs)
