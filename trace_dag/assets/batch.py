"""The one step that runs the stages: a batch of crashes, any contiguous choice of stages.

The step logs a materialization for each stage and crash itself, as it is done, and yields nothing; at its end it fails
once if any crash failed. So only the failed stage and those after it show as failed, only for the crashes concerned. A
rejected crash is data: it is materialized at every stage, with the outcome in its metadata.

The check ``verified`` of single crashes, by which the UI filters them by outcome, has one evaluation per partition. It
is evaluated for every finished crash. A crash rejected at an earlier stage fails the check with that reason, because
Dagster shows a check without an evaluation as skipped. A failed check is a warning, since a rejection is data. Gates of
maps and criteria are checked over all crashes (:mod:`trace_dag.assets.summaries`).
"""

import warnings
from collections.abc import Iterator, Mapping, Sequence
from typing import Any, Final

from dagster import (
    AssetCheckEvaluation,
    AssetCheckSeverity,
    AssetCheckSpec,
    AssetExecutionContext,
    AssetKey,
    BackfillPolicy,
    Config,
    Failure,
    MetadataValue,
    Output,
    PreviewWarning,
    multi_asset,
)
from pydantic import Field

from trace_dag.assets.run_requests import CRASHES, PLANNED_TAG, fingerprint
from trace_dag.assets.specs import HOW_TO_FORCE, STAGES, materialization
from trace_dag.common.errors import UserError
from trace_dag.common.messages import markdown
from trace_dag.common.messages.wording import count_of
from trace_dag.common.processes import this_process
from trace_dag.common.provenance import Outcome, OutcomeRecord
from trace_dag.common.settings import ExecutionSettings
from trace_dag.common.stage import Stage
from trace_dag.export.crash_files import make_at_once, note_made
from trace_dag.flow.batch import run_stages
from trace_dag.flow.run_summary import RunSummary
from trace_dag.flow.tasks import MadeFiles, StageEvent
from trace_dag.flow.workspace import Workspace

COHORT_TAG = "trace_dag/cohort"
SUMMARY_TAG = "trace_dag/summary"
STEP_PROCESS_TAG = "trace_dag/step_process"  # that runs the step: if it is gone, so is the run
_FAILURES_NAMED = 20
_DETAIL_SHOWN = 300  # characters
_TRACEBACKS_SHOWN = 3
CRASHES_PER_RUN: int = ExecutionSettings().batch_size
with warnings.catch_warnings():
    warnings.simplefilter("ignore", PreviewWarning)  # of partitions_def
    VERIFIED: Final = AssetCheckSpec(
        "verified",
        asset=Stage.VERDICT.value,
        partitions_def=CRASHES,
        description="The crash is verified. Where it is not, the reason says what it is rejected for.",
    )


class BatchConfig(Config):
    """Options of a batch."""

    force: list[str] = Field(
        default_factory=list, description="Stages to compute again even where nothing has changed; 'all' for all."
    )
    settings: dict[str, Any] = Field(
        default_factory=dict, description="Settings over the root's own, as {section: {name: value}}."
    )


@multi_asset(
    name="crashes",
    specs=STAGES,
    check_specs=[VERIFIED],
    can_subset=True,
    required_resource_keys={"workspace"},
    backfill_policy=BackfillPolicy.multi_run(max_partitions_per_run=CRASHES_PER_RUN),
    description="The stages of the flow for a batch of crashes.",
)
def crashes(context: AssetExecutionContext, config: BatchConfig) -> Iterator[Any]:
    """Run the selected stages for the run's partitions."""
    workspace: Workspace = context.resources.workspace
    context.instance.add_run_tags(context.run.run_id, {STEP_PROCESS_TAG: this_process()})
    stages = [stage for stage in Stage if AssetKey(stage.value) in context.selected_asset_keys]
    force = [stage for stage in stages if "all" in config.force or stage.value in config.force]
    try:
        _check_partitions(context.partition_keys, context.run.tags.get(PLANNED_TAG))
        _check_configuration(config.settings)
        workspace = workspace.with_settings(config.settings)
        context.instance.add_run_tags(context.run.run_id, _tags(workspace, context.partition_keys))
        events = run_stages(
            workspace,
            context.partition_keys,
            stages,
            run_id=context.run.run_id,
            force=force,
            afterwards=make_at_once(workspace.storage, context.partition_keys) if workspace.pages_in_runs else None,
        )
        summary, checks = RunSummary(), CrashChecks(context)
        failed: dict[str, StageEvent] = {}
        made: dict[str, MadeFiles] = {}
        for event in events:
            if event.failed:
                failed.setdefault(event.key, event)
            else:
                context.log_event(materialization(event, workspace.storage, workspace.settings.automation.site_url))
                checks.log(event)
            if event.made is not None:
                made[event.key] = event.made
            summary.note(event)
            if workspace.listener is not None:
                workspace.listener(event)
        note_made(workspace.storage, made)
        finished_checks = list(checks.finish())
    except UserError as error:
        raise Failure(str(error), allow_retries=False) from error
    yield from finished_checks
    done = summary.in_words()
    if not summary.computed and not failed:
        done = f"Nothing was to do: {count_of(len(context.partition_keys), 'crash is', 'crashes are')} up to date."
        context.log.info(HOW_TO_FORCE)
    context.log.info(done)
    context.instance.add_run_tags(context.run.run_id, {SUMMARY_TAG: done})
    if failed:
        raise Failure(
            _summary(failed, len(context.partition_keys)),
            metadata={"failed": MetadataValue.md(_table(failed)), **summary.figures(), **_tracebacks(failed)},
            allow_retries=False,
        )


def _check_partitions(keys: Sequence[str], planned: str | None) -> None:
    """Raise :class:`UserError` if the range of a run covers no crash, or others than planned.

    Dagster 1.13 gives a step no partition at all if the ends of its range have changed order.
    """
    if not keys or planned not in (None, fingerprint(keys)):
        covered = count_of(len(keys), "crash", "crashes")
        raise UserError(
            f"the partitions have changed since this run was planned: its range covers {covered}, and not those meant; "
            "start a new run (trace-dag run, or Materialize in the UI) in place of executing this one again"
        )


def _check_configuration(settings: Mapping[str, Any]) -> None:
    """Raise :class:`UserError` for settings of files, services or workers, which only the root may set.

    A run's configuration may come from anybody with access to the UI.
    """
    execution = settings.get("execution")
    if "services" in settings or (isinstance(execution, Mapping) and "dask_address" in execution):
        raise UserError(
            "a run's settings: services and execution.dask_address are set in settings.toml or the environment alone"
        )


def _tags(workspace: Workspace, keys: Sequence[str]) -> dict[str, str]:
    """Return the cohorts a run is for, however it was started."""
    return {COHORT_TAG: ",".join(sorted({source.cohort for source in workspace.registry.sources(keys).values()}))}


def _summary(failed: dict[str, StageEvent], total: int) -> str:
    named = [f"{key} in {_stage(event)} ({_detail(event)})" for key, event in list(failed.items())[:_FAILURES_NAMED]]
    more = f" and {len(failed) - len(named)} more" if len(failed) > len(named) else ""
    return f"{len(failed)} of {count_of(total, 'crash', 'crashes')} failed: {', '.join(named)}{more}"


def _table(failed: dict[str, StageEvent]) -> str:
    rows = [(key, _stage(event), _detail(event)) for key, event in failed.items()]
    return markdown.table(["crash", "stage", "what happened"], rows)


def _detail(event: StageEvent) -> str:
    return (event.record.detail if event.record else "has not run")[:_DETAIL_SHOWN]


def _tracebacks(failed: dict[str, StageEvent]) -> dict[str, MetadataValue[Any]]:
    """Return the traceback of the first crash that failed, for each thing that happened."""
    first: dict[str, StageEvent] = {}
    for event in failed.values():
        if event.record is not None and event.record.error:
            first.setdefault(event.record.error.strip().rpartition("\n")[2], event)
    return {
        f"traceback of {event.key}": MetadataValue.md(markdown.code_block(event.record.error if event.record else ""))
        for event in list(first.values())[:_TRACEBACKS_SHOWN]
    }


def _stage(event: StageEvent) -> Stage:
    return event.record.stage if event.record else event.stage


# --- the check of single crashes -------------------------------------------------------------------------------------
class CrashChecks:
    """Evaluates the check for a run's crashes from the results of its stages."""

    def __init__(self, context: AssetExecutionContext) -> None:
        self._context = context

    def log(self, event: StageEvent) -> None:
        """Log the evaluation that follows from the last stage's record of a crash."""
        record = event.record
        if record is None or event.stage is not Stage.VERDICT:
            return
        if VERIFIED.key not in self._context.selected_asset_check_keys:
            return
        self._context.log_event(
            AssetCheckEvaluation(
                VERIFIED.asset_key,
                VERIFIED.name,
                passed=record.outcome is Outcome.ACCEPTED,
                partition=event.key,
                severity=AssetCheckSeverity.WARN,
                description=record.detail or None,
                metadata=_figures(record),
            )
        )

    def finish(self) -> Iterator[Output[None]]:
        """Yield an output for each selected check, so that Dagster does not log it as missing.

        Dagster does not count evaluations that a step logs by partition.
        """
        for check in self._context.selected_asset_check_keys:
            yield Output(None, self._context.assets_def.get_output_name_for_asset_check_key(check))


def _figures(record: OutcomeRecord) -> dict[str, Any]:
    metadata: dict[str, Any] = {name: value for name, value in record.figures.items() if value is not None}
    if record.reason is not None:
        metadata = {"reason": record.reason.value, **metadata}
    return metadata
