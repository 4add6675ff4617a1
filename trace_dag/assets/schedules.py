"""Schedules, as the settings say: running cohorts at given hours, and asking the CrashAPI for what it has released."""

from collections.abc import Callable, Sequence
from functools import partial

from dagster import (
    DagsterInvalidDefinitionError,
    DefaultScheduleStatus,
    ResourceParam,
    RunRequest,
    ScheduleDefinition,
    ScheduleEvaluationContext,
    SkipReason,
    schedule,
)

from trace_dag.assets.checks import STAGES
from trace_dag.assets.run_requests import add_partitions, run_requests
from trace_dag.common.errors import UserError
from trace_dag.common.messages.wording import count_of
from trace_dag.common.settings import AutomationSettings, Schedule
from trace_dag.common.stage import Stage
from trace_dag.flow.cohorts.arrivals import register_new_cases
from trace_dag.flow.selection import Selection, not_released, select_stale
from trace_dag.flow.workspace import Workspace

_Look = Callable[[ScheduleEvaluationContext, Workspace], Sequence[RunRequest] | SkipReason]


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
            f"setting automation: schedule {name}: {cron!r} is nothing that cron knows; 0 2 * * * is every night at two"
        ) from error


def _requests(context: ScheduleEvaluationContext, workspace: Workspace, selection: Selection) -> list[RunRequest]:
    """Request runs for a selection, each once per hour of the schedule."""
    tick = context.scheduled_execution_time.isoformat()
    return run_requests(context.instance, selection, size=workspace.settings.execution.batch_size, name=tick)
