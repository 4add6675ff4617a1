"""Dagster runs started from this process: the same assets, instance and records that the UI shows.

Belongs here: the instance of a storage root, and running planned batches through it. Does not belong here: deciding
what to run (:mod:`trace_dag.flow.selection`).
"""

import logging
import os
from collections.abc import Collection, Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import dataclass, field, replace
from importlib.util import find_spec
from pathlib import Path
from typing import Any

from dagster import (
    AssetKey,
    DagsterError,
    DagsterInstance,
    DagsterRunStatus,
    ExecuteInProcessResult,
    JsonMetadataValue,
    RunsFilter,
)
from sqlalchemy import NullPool, create_engine, make_url
from sqlalchemy.exc import ArgumentError, SQLAlchemyError
from yaml import YAMLError  # type: ignore[import-untyped]

from trace_dag.assets.batch import STEP_PROCESS_TAG
from trace_dag.assets.definitions import build_definitions
from trace_dag.assets.run_requests import CRASHES, PROCESS_TAG, add_partitions, batch_config, range_tags
from trace_dag.assets.summaries import DAMAGED, SUMMARY
from trace_dag.common.errors import DamagedFile, Failure, UserError
from trace_dag.common.processes import is_gone, this_process
from trace_dag.common.stage import Stage
from trace_dag.common.storage.disk_errors import disk_failure
from trace_dag.common.storage.files import Storage, writable_folder
from trace_dag.flow.selection import PlannedBatch, Selection, has_large_map, plan, plan_maps_first
from trace_dag.flow.workspace import ROOT_VARIABLE, Workspace

log = logging.getLogger(__name__)

# By this the UI counts a run started here among those of its job.
_REPOSITORY = {".dagster/repository": "__repository__@trace_dag.assets.definitions"}
_UNFINISHED = [DagsterRunStatus.STARTING, DagsterRunStatus.STARTED, DagsterRunStatus.CANCELING]

POSTGRES_VARIABLE = "TRACE_DAG_POSTGRES"
"""Names the PostgreSQL database (an URL) that Dagster's records of a new root are kept in, in place of SQLite files."""
_INSTANCE_SETTINGS = """\
# Dagster's records of this storage root. Nothing is sent anywhere, and no dialog asks for it.
telemetry:
  enabled: false
nux:
  enabled: false
# A run uses all cores by itself.
concurrency:
  runs:
    max_concurrent_runs: 2
# Stages say everything in the log. To capture what they print, Dagster starts four processes for each step, which
# answer Ctrl-C with a traceback. Its class that captures nothing is public and documented under this name alone.
compute_logs:
  module: dagster._core.storage.noop_compute_log_manager
  class: NoOpComputeLogManager
"""
_OLDER = b"trace_dag.assets.event_log"  # of an earlier version, with tables of its own in Dagster's databases
_ON_POSTGRES = f"""\
storage:
  postgres:
    postgres_url:
      env: {POSTGRES_VARIABLE}
"""
_CONNECT_S = 5
_INTERRUPTED = "UNEXPECTED_TERMINATION"  # Dagster's reason for the failure of a run that was broken off


@dataclass(frozen=True)
class RunReport:
    """The runs of one call: their number, and the crashes that failed, by run."""

    runs: int = 0
    errors: tuple[str, ...] = field(default=())


def _prepare_dagster_home(workspace: Workspace, folder: Path) -> None:
    """Make Dagster's folder of a root if it is missing, and set ``DAGSTER_HOME`` in this process."""
    settings = folder / "dagster.yaml"
    if settings.is_file() and _OLDER in settings.read_bytes():
        aside = folder.with_name(f"{folder.name}-of-earlier-version")
        log.warning("Dagster's records are of an earlier version of the program; they were moved to %s", aside)
        folder.rename(aside)
    folder.mkdir(parents=True, exist_ok=True)
    if not settings.exists():
        settings.write_text(_INSTANCE_SETTINGS + (_ON_POSTGRES if POSTGRES_VARIABLE in os.environ else ""))
    os.environ["DAGSTER_HOME"] = str(folder)
    os.environ[ROOT_VARIABLE] = Storage(workspace.root).root


def open_instance(workspace: Workspace, home: Path | None = None) -> DagsterInstance:
    """Open Dagster's instance of this root, or the one in ``home``.

    Runs whose process is gone are closed as failed.
    """
    home = home or workspace.dagster_home
    _prepare_dagster_home(workspace, home)
    folder = str(home)
    if _ON_POSTGRES in (Path(folder) / "dagster.yaml").read_text(errors="replace"):
        _reach_postgres(folder)
    try:
        instance = DagsterInstance.get()
        _close_orphans(instance)
        instance.has_dynamic_partition("crashes", "")  # a database that was emptied has no table for it
    except (DagsterError, SQLAlchemyError, YAMLError, UnicodeDecodeError) as error:
        raise _unusable(folder, error) from error
    return instance


@contextmanager
def dagster_records(workspace: Workspace) -> Iterator[DagsterInstance]:
    """Open Dagster's instance for a command; on a read-only disk, open a copy.

    An error of its databases is raised as :class:`Failure`, also later, since most of a damaged file shows only when it
    is read.
    """
    with writable_folder(workspace.dagster_home) as home, open_instance(workspace, home) as instance:
        try:
            yield instance
        except SQLAlchemyError as error:
            raise _unusable(str(workspace.dagster_home), error) from error


def _reach_postgres(folder: str) -> None:
    """Connect to PostgreSQL once, to fail early: Dagster tries for 18 seconds and shows tracebacks.

    Raises :class:`UserError` if the driver or the address is missing, :class:`Failure` if the server refuses.
    """
    kept = f"Dagster's records of {folder} are in PostgreSQL"
    if find_spec("dagster_postgres") is None:
        raise UserError(f"{kept}, which needs dagster-postgres: pip install 'trace-dag[postgres]'")
    try:
        # SQLAlchemy 2.1 takes psycopg 3 where no driver is named, and dagster-postgres brings psycopg2.
        url = make_url(os.environ.get(POSTGRES_VARIABLE, "")).set(drivername="postgresql+psycopg2")
    except ArgumentError as error:
        expected = "postgresql://user:password@host/database"
        raise UserError(f"{kept}, and {POSTGRES_VARIABLE} does not name the database: set it to {expected}") from error
    os.environ[POSTGRES_VARIABLE] = url.render_as_string(hide_password=False)
    try:
        create_engine(url, poolclass=NullPool, connect_args={"connect_timeout": _CONNECT_S}).connect().close()
    except SQLAlchemyError as error:
        raise _refused(error) from error


def _refused(error: SQLAlchemyError) -> Failure:
    return Failure(
        f"Dagster's database, which {POSTGRES_VARIABLE} names, does not answer: {getattr(error, 'orig', None)}; "
        "see that the server runs and that user, password and database are right, and run again"
    )


def _unusable(folder: str, error: BaseException) -> Failure:
    if POSTGRES_VARIABLE in os.environ and isinstance(error, SQLAlchemyError):
        return _refused(error)
    found = f"Dagster cannot read its records ({type(error).__name__})"
    remedy = "delete that folder; trace-dag verify --repair tells Dagster anew"
    return disk_failure(error, f"a database of Dagster in {folder}") or DamagedFile(folder, found, remedy)


def find_missing_records(instance: DagsterInstance, keys: Collection[str]) -> dict[str, Stage]:
    """Return crashes with a stage that Dagster does not show as materialized, each with the first such stage."""
    partitions = instance.get_dynamic_partitions("crashes")
    wanted = set(keys)
    found: dict[str, Stage] = {}
    for stage in Stage:
        status = instance.get_status_by_partition(AssetKey(stage.value), partitions, CRASHES) or {}
        for key in partitions:
            held = status.get(key)
            if key in wanted and (held is None or held.value != "MATERIALIZED"):
                found.setdefault(key, stage)
    return found


def plan_runs(workspace: Workspace, instance: DagsterInstance, selection: Selection) -> list[PlannedBatch]:
    """Return the runs of a selection.

    Crashes that are up to date but unknown to Dagster are run too, so that it records them.
    """
    add_partitions(instance, workspace.registry.keys())
    start = dict(selection.start)
    if not selection.exact:
        for key, stage in find_missing_records(instance, selection.asked).items():
            start[key] = min(start.get(key, stage), stage, key=lambda each: each.position)
    partitions = instance.get_dynamic_partitions("crashes")
    planning = plan_maps_first if has_large_map(workspace) else plan
    return planning(partitions, replace(selection, start=start), size=workspace.settings.execution.batch_size)


def run_batches(
    workspace: Workspace, instance: DagsterInstance, batches: Sequence[PlannedBatch], *, settings: Mapping[str, Any]
) -> RunReport:
    """Run planned batches one by one, each as one Dagster run in this process."""
    job = build_definitions(workspace).resolve_implicit_global_asset_job_def()
    errors: list[str] = []
    for batch in batches:
        result = job.execute_in_process(
            run_config=_quiet(batch_config(batch, settings)),
            instance=instance,
            asset_selection=[AssetKey(stage.value) for stage in batch.stages],
            tags={**range_tags(batch), **_REPOSITORY, PROCESS_TAG: this_process()},
            raise_on_error=False,
        )
        errors.extend(_errors(result))
    return RunReport(len(batches), tuple(errors))


def summarise(workspace: Workspace, instance: DagsterInstance) -> RunReport:
    """Build the summaries of all crashes: the warehouse, the benchmark and their checks."""
    result = (
        build_definitions(workspace)
        .resolve_job_def(SUMMARY)
        .execute_in_process(
            run_config=_quiet({}),
            instance=instance,
            tags={**_REPOSITORY, PROCESS_TAG: this_process()},
            raise_on_error=False,
        )
    )
    damaged = [
        said
        for event in result.get_asset_materialization_events()
        for said in _listed(event.materialization.metadata.get(DAMAGED))
    ]
    return RunReport(1, (*damaged, *_errors(result)))


def _listed(value: object) -> list[str]:
    return list(value.value) if isinstance(value, JsonMetadataValue) and isinstance(value.value, list) else []


def summary_is_current(workspace: Workspace, instance: DagsterInstance) -> bool:
    """Return whether the warehouse and the benchmark match the code and the registered crashes."""
    from trace_dag.export.build import is_made_by_this_code
    from trace_dag.warehouse.build import is_built_by_this_code
    from trace_dag.warehouse.query import query

    newest = instance.get_runs(limit=1)
    done = bool(newest) and newest[0].job_name == SUMMARY and newest[0].status is DagsterRunStatus.SUCCESS
    made = not workspace.pages_in_runs or is_made_by_this_code(Storage(workspace.root))
    if not (done and made and is_built_by_this_code(workspace.warehouse)):
        return False
    return {row[0] for row in query(workspace.warehouse, "SELECT key FROM crashes")[1]} == set(
        workspace.registry.keys()
    )


def _quiet(config: Mapping[str, Any]) -> dict[str, Any]:
    return {**config, "loggers": {"console": {"config": {"log_level": "CRITICAL"}}}}


def _errors(result: ExecuteInProcessResult) -> list[str]:
    """Return the errors of a run, as the message of the failed step if there is one.

    Raises ``KeyboardInterrupt`` if that ended the run; Dagster returns a failed run instead.
    """
    if result.success:
        return []
    messages = []
    for event in result.all_events:
        if event.is_step_failure:
            data = event.step_failure_data
            stated = data.user_failure_data.description if data.user_failure_data else None
            messages.append(stated or _innermost(data.error) or event.message or "a step failed")
        elif event.is_run_failure and _reason(event.job_failure_data) == _INTERRUPTED:
            raise KeyboardInterrupt
        elif event.is_run_failure and not messages:
            messages.append(_innermost(event.job_failure_data.error) or event.message or "the run failed")
    return messages


def _reason(failure: Any) -> str | None:
    return failure.failure_reason.value if failure.failure_reason is not None else None


def _innermost(error: Any) -> str:
    # What a worker process raised is caused by its traceback as text, which is not a message.
    while error is not None and error.cause is not None and error.cause.cls_name != "_RemoteTraceback":
        error = error.cause
    return error.message.strip() if error else ""


def _close_orphans(instance: DagsterInstance) -> None:
    """Close runs whose process on this machine was killed; Dagster would show them as running for ever."""
    for run in instance.get_runs(RunsFilter(statuses=_UNFINISHED)):
        if is_gone(run.tags.get(STEP_PROCESS_TAG, "")) or is_gone(run.tags.get(PROCESS_TAG, "")):
            instance.report_run_failed(run, "The process of this run is gone; run again to finish what it had not.")
