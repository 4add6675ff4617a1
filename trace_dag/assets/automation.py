"""Sensors and schedules: watched folders, registered crashes, ends of runs, and hours that the settings name.

After a set of runs of stages or studies they bring the warehouse and the benchmark up to date once. A backfill over the
whole graph builds both itself after its last crash, if no crash failed. After a failure Dagster skips everything
downstream, so the sensors request it. Alerts report runs that broke off.
"""

from collections.abc import Callable, Sequence
from functools import partial

from dagster import (
    DagsterInstance,
    DagsterInvalidDefinitionError,
    DagsterRun,
    DagsterRunStatus,
    DefaultScheduleStatus,
    DefaultSensorStatus,
    ResourceParam,
    RunFailureSensorContext,
    RunRequest,
    RunsFilter,
    RunStatusSensorContext,
    RunStatusSensorDefinition,
    ScheduleDefinition,
    ScheduleEvaluationContext,
    SensorEvaluationContext,
    SensorResult,
    SkipReason,
    run_failure_sensor,
    run_status_sensor,
    schedule,
    sensor,
)

from trace_dag.assets.batch import SUMMARY_TAG
from trace_dag.assets.run_requests import PROCESS_TAG, UNFINISHED, add_partitions, keys_of, run_requests
from trace_dag.assets.studies import STUDIES
from trace_dag.assets.summaries import STAGES, SUMMARY_JOB, benchmark, warehouse
from trace_dag.common.errors import UserError
from trace_dag.common.messages.wording import count_of
from trace_dag.common.network.alerts import Alert, AlertKind, alerts_go_out, send
from trace_dag.common.provenance import crash_of
from trace_dag.common.settings import AutomationSettings, Schedule
from trace_dag.common.stage import Stage
from trace_dag.flow.cohorts.arrivals import register_arrivals, register_new_cases
from trace_dag.flow.selection import Selection, not_released, select_stale
from trace_dag.flow.workspace import Workspace

_INTERVAL_S = 30
_BACKFILL_TAG = "dagster/backfill"  # on each run of a backfill; Dagster's constant for it is private, its text is shown
_BROKEN_OFF = ("CANCELING", "CANCELED", "FAILING", "FAILED")  # status of a backfill
_ENTER_TABLES = frozenset({*(stage.value for stage in Stage), *STUDIES})
_AFTER_RUNS_INTERVAL_S = 10
_Look = Callable[[ScheduleEvaluationContext, Workspace], Sequence[RunRequest] | SkipReason]


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


# --- schedules -------------------------------------------------------------------------------------------------------
def schedules(settings: AutomationSettings) -> list[ScheduleDefinition]:
    """Return all schedules.

    Raises :class:`UserError` for an invalid cron expression or a repeated name.
    """
    names = [each.name for each in settings.schedules]
    for name in names:
        if names.count(name) > 1 or name == "newly_released_cases":
            raise UserError(f"setting automation.schedules: the name {name} is taken; each schedule has its own")
    return [_new_cases(settings), *(_cohort(each) for each in settings.schedules)]


def _cohort(asked: Schedule) -> ScheduleDefinition:
    whose = f"cohort {asked.cohort}" if asked.cohort else "all cohorts"

    def look(
        context: ScheduleEvaluationContext, workspace: ResourceParam[Workspace]
    ) -> Sequence[RunRequest] | SkipReason:
        try:
            selection = select_stale(workspace, asked.cohort)
        except UserError as error:
            return SkipReason(str(error))
        if not selection.start:
            return SkipReason(f"Everything of {whose} is up to date.")
        add_partitions(context.instance, workspace.registry.keys())
        return _requests(context, workspace, selection)

    return _defined(
        asked.name,
        asked.cron,
        asked.timezone,
        DefaultScheduleStatus.RUNNING,
        f"Runs what of {whose} is not up to date.",
        look,
    )


def _new_cases(settings: AutomationSettings) -> ScheduleDefinition:
    def look(
        context: ScheduleEvaluationContext, workspace: ResourceParam[Workspace]
    ) -> Sequence[RunRequest] | SkipReason:
        awaited = partial(not_released, workspace.storage)
        cases = register_new_cases(workspace.storage, workspace.settings.services, awaited)
        if not cases.followers:
            return SkipReason("No cohort follows the CrashAPI; trace-dag ingest --crashapi --watch makes one.")
        if not cases.keys:
            return SkipReason(f"Nothing new for {count_of(cases.followers, 'cohort')}.")
        add_partitions(context.instance, cases.keys)
        # Exact, so that the report is asked for again although nothing else has changed.
        selection = Selection(cases.keys, dict.fromkeys(cases.keys, Stage.RAW_REPORT), exact=True)
        return _requests(context, workspace, selection)

    return _defined(
        "newly_released_cases",
        settings.new_cases_cron,
        settings.new_cases_timezone,
        DefaultScheduleStatus.STOPPED,
        "Asks the CrashAPI again for the cases of the cohorts that follow it (trace-dag ingest --crashapi --watch), "
        "registers those listed for the first time, and runs them and those not released before.",
        look,
    )


def _defined(
    name: str, cron: str, timezone: str, status: DefaultScheduleStatus, description: str, look: _Look
) -> ScheduleDefinition:
    try:
        return schedule(
            name=name,
            target=STAGES,
            cron_schedule=cron,
            execution_timezone=timezone,
            default_status=status,
            description=description,
        )(look)
    except DagsterInvalidDefinitionError as error:
        raise UserError(
            f"setting automation: schedule {name}: {cron!r} is not a cron expression; expected one such as 0 2 * * *, "
            "every night at two"
        ) from error


def _requests(context: ScheduleEvaluationContext, workspace: Workspace, selection: Selection) -> list[RunRequest]:
    """Request runs for a selection, each once per hour of the schedule."""
    tick = context.scheduled_execution_time.isoformat()
    return run_requests(context.instance, selection, size=workspace.settings.execution.batch_size, name=tick)
