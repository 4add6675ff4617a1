"""Sensors on watched folders, on crashes registered by any command on any machine, and on the ends of runs.

After a set of runs of stages or studies they bring the warehouse and the benchmark up to date once. A backfill over the
whole graph builds both itself after its last crash, if no crash failed. After a failure Dagster skips everything
downstream, so the sensors request it. Alerts report runs that broke off.
"""

from collections.abc import Sequence

from dagster import (
    DagsterInstance,
    DagsterRun,
    DagsterRunStatus,
    DefaultSensorStatus,
    ResourceParam,
    RunFailureSensorContext,
    RunRequest,
    RunsFilter,
    RunStatusSensorContext,
    RunStatusSensorDefinition,
    SensorEvaluationContext,
    SensorResult,
    SkipReason,
    run_failure_sensor,
    run_status_sensor,
    sensor,
)

from trace_dag.assets.batch import SUMMARY_TAG
from trace_dag.assets.checks import STAGES, SUMMARY_JOB
from trace_dag.assets.run_requests import PROCESS_TAG, UNFINISHED, add_partitions, keys_of, run_requests
from trace_dag.assets.studies import STUDIES
from trace_dag.assets.summaries import benchmark, warehouse
from trace_dag.common.messages.wording import count_of
from trace_dag.common.network.alerts import Alert, AlertKind, alerts_go_out, send
from trace_dag.common.provenance import crash_of
from trace_dag.common.stage import Stage
from trace_dag.flow.cohorts.arrivals import register_arrivals
from trace_dag.flow.selection import Selection
from trace_dag.flow.workspace import Workspace

_INTERVAL_S = 30
_BACKFILL_TAG = "dagster/backfill"  # on each run of a backfill; Dagster's constant for it is private, its text is shown
_BROKEN_OFF = ("CANCELING", "CANCELED", "FAILING", "FAILED")  # status of a backfill
_ENTER_TABLES = frozenset({*(stage.value for stage in Stage), *STUDIES})
_AFTER_RUNS_INTERVAL_S = 10


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


# --- after runs ------------------------------------------------------------------------------------------------------
def _request(context: RunStatusSensorContext) -> RunRequest | SkipReason:
    run = context.dagster_run
    if PROCESS_TAG in run.tags:
        return SkipReason("The command that started this run builds the warehouse itself.")
    if not _changes_tables(run):
        return SkipReason("No stage and no study was run.")
    if _others_to_come(context.instance, run):
        return SkipReason("More runs are to come; the last one brings everything up to date.")
    if _built_by_its_backfill(context.instance, run):
        return SkipReason("The backfill of this run builds the warehouse and the benchmark itself.")
    return RunRequest(run_key=run.run_id)


def _changes_tables(run: DagsterRun) -> bool:
    return any(key.to_user_string() in _ENTER_TABLES for key in run.asset_selection or ())


def _others_to_come(instance: DagsterInstance, run: DagsterRun) -> bool:
    waiting = instance.get_runs(RunsFilter(statuses=[*UNFINISHED]))
    return any(other.run_id != run.run_id and _changes_tables(other) for other in waiting)


def _built_by_its_backfill(instance: DagsterInstance, run: DagsterRun) -> bool:
    backfill = instance.get_backfill(run.tags[_BACKFILL_TAG]) if _BACKFILL_TAG in run.tags else None
    if backfill is None or backfill.status.value in _BROKEN_OFF:
        return False
    if not {warehouse.key, benchmark.key} <= set(backfill.asset_selection or ()):
        return False
    unsuccessful = RunsFilter(
        tags={_BACKFILL_TAG: backfill.backfill_id}, statuses=[DagsterRunStatus.FAILURE, DagsterRunStatus.CANCELED]
    )
    return not any(_changes_tables(other) for other in instance.get_runs(unsuccessful))


def _after(status: DagsterRunStatus, name: str, description: str) -> RunStatusSensorDefinition:
    @run_status_sensor(
        name=name,
        run_status=status,
        request_job=SUMMARY_JOB,
        default_status=DefaultSensorStatus.RUNNING,
        minimum_interval_seconds=_AFTER_RUNS_INTERVAL_S,
        description=description,
    )
    def sensor(context: RunStatusSensorContext) -> RunRequest | SkipReason:
        return _request(context)

    return sensor


summary_after_runs = _after(
    DagsterRunStatus.SUCCESS,
    "summary_after_runs",
    "After the last of the runs: the warehouse, its checks and the benchmark.",
)
summary_after_failed_runs = _after(
    DagsterRunStatus.FAILURE,
    "summary_after_failed_runs",
    "The same after runs in which crashes failed: the others are done all the same.",
)
summary_after_canceled_runs = _after(
    DagsterRunStatus.CANCELED,
    "summary_after_canceled_runs",
    "The same after runs that were stopped: what they had done stands.",
)


@run_failure_sensor(
    name="alert_on_failed_runs",
    default_status=DefaultSensorStatus.RUNNING,
    minimum_interval_seconds=_AFTER_RUNS_INTERVAL_S,
    description="Sends an alert about a run that broke off, where the settings name somebody to alert. Crashes that "
    "fail in a run that gets to its end are alerted of when the warehouse is built.",
)
def alert_on_failed_runs(context: RunFailureSensorContext, workspace: ResourceParam[Workspace]) -> SkipReason | None:
    """Send an alert about a run that did not finish."""
    run, settings = context.dagster_run, workspace.settings.automation
    if SUMMARY_TAG in run.tags:
        return SkipReason("The run got to its end; its crashes are told of when the warehouse is built.")
    if not alerts_go_out(settings):
        return SkipReason("Nobody is to be alerted; see the settings of automation.")
    text = f"trace-dag {workspace.root}: run {run.run_id} of {run.job_name} failed: {context.failure_event.message}"
    send(Alert(AlertKind.RUN_FAILED, workspace.root, text), settings)
    return None


SENSORS = (
    arriving_reports,
    registered_crashes,
    summary_after_runs,
    summary_after_failed_runs,
    summary_after_canceled_runs,
    alert_on_failed_runs,
)
