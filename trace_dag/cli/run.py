"""Running crashes: ``run``, ``rerun`` for exactly those asked for, and what both share with ``demo``."""

from __future__ import annotations

import sys
from collections import Counter
from collections.abc import Callable, Iterator, Mapping
from contextlib import ExitStack, closing, contextmanager
from dataclasses import replace
from functools import partial
from typing import TYPE_CHECKING, Any

import click

from trace_dag.cli.options import (
    ManyValuesCommand,
    estimator_option,
    examples,
    executor_options,
    pass_root,
    run_overrides,
    stage_option,
)
from trace_dag.cli.printing import one_line, print_statuses, progress_bar, progress_of, say
from trace_dag.common.errors import DamagedFile, Reason, UserError
from trace_dag.common.gc_pause import gc_paused
from trace_dag.common.messages.logs import print_problem
from trace_dag.common.stage import Stage

if TYPE_CHECKING:
    from trace_dag.flow.executors import Executor
    from trace_dag.flow.selection import Selection
    from trace_dag.flow.tasks import StageEvent
    from trace_dag.flow.workspace import Workspace


@click.command(
    cls=ManyValuesCommand, epilog=examples("trace-dag run", "trace-dag run --only 2023-510179 --from road_map")
)
@click.option("--cohort", help="Only crashes of this cohort.")
@click.option("--only", multiple=True, metavar="KEY", help="Only these crashes, such as 2023-510179.")
@stage_option("--from", "first", help="Compute this stage and all after it again, changed or not.")
@estimator_option
@executor_options
@pass_root
def run(
    root: str,
    cohort: str | None,
    only: tuple[str, ...],
    first: Stage | None,
    estimator: str | None,
    executor: str | None,
    workers: int | None,
) -> None:
    """Run the registered crashes through all stages, then build the warehouse and the benchmark.

    Skips stages whose inputs are unchanged; retries failures. Exit code 1 if a crash failed."""
    settings = run_overrides(executor, workers, estimator)
    from trace_dag.flow.selection import select_stale

    sys.exit(run_selection(root, settings, lambda workspace: select_stale(workspace, cohort, only, first)))


@click.command(
    cls=ManyValuesCommand,
    epilog=examples(
        "trace-dag rerun --failed",
        "trace-dag rerun --rejected crash_off_road --cohort virginia",
        "trace-dag rerun --only 2023-510179",
    ),
)
@click.option("--failed", is_flag=True, help="The crashes that failed or are outdated, from the stage that broke.")
@click.option("--rejected", type=click.Choice([reason.value for reason in Reason]), help="Those rejected for a reason.")
@stage_option("--from", "first", help="Every crash that got there, from this stage on.")
@click.option("--cohort", help="Only crashes of this cohort.")
@click.option("--only", multiple=True, metavar="KEY", help="Only these crashes; by itself, all their stages.")
@estimator_option
@executor_options
@pass_root
def rerun(
    root: str,
    failed: bool,
    rejected: str | None,
    first: Stage | None,
    cohort: str | None,
    only: tuple[str, ...],
    estimator: str | None,
    executor: str | None,
    workers: int | None,
) -> None:
    """Run again exactly the crashes and stages asked for, unchanged or not."""
    if failed + (rejected is not None) + (first is not None) > 1:
        raise UserError("rerun: --failed, --rejected REASON and --from STAGE exclude each other; give one of them")
    if not failed and rejected is None and first is None:
        if not only:
            raise UserError("rerun: say what to run again with --failed, --rejected REASON, --from STAGE or --only KEY")
        first = Stage.RAW_REPORT
    settings = run_overrides(executor, workers, estimator)
    from trace_dag.flow.selection import select_again

    reason = Reason(rejected) if rejected else None
    sys.exit(
        run_selection(
            root,
            settings,
            lambda workspace: select_again(workspace, cohort, only, failed=failed, reason=reason, first=first),
        )
    )


_FAILURES_SHOWN = 20


def run_selection(root: str, settings: Mapping[str, Any], select: Callable[[Workspace], Selection]) -> int:
    """Run a selection through Dagster in this process, then update the summaries; return the exit code."""
    from trace_dag.flow.batch import check_requirements
    from trace_dag.flow.crash_status import FinalState, crash_statuses
    from trace_dag.flow.records import read_records
    from trace_dag.flow.workspace import Workspace

    workspace, settings = Workspace.open(root, overrides=settings).with_one_ledger(settings)
    selection = select(workspace)
    with ExitStack() as resources:
        if selection.start:
            check_requirements(workspace, {stage for first in selection.start.values() for stage in first.and_later()})
            workspace = replace(workspace, executor=resources.enter_context(_started(workspace)))
        errors = _run_and_summarise(workspace, settings, selection)
    stand = crash_statuses(read_records(workspace.storage, selection.asked))
    print_statuses(stand)
    failed = [crash for crash in stand.values() if crash.final_state is FinalState.FAILED]
    alike: dict[tuple[object, str], list[str]] = {}
    for crash in failed:
        alike.setdefault((crash.stage_reached, crash.detail), []).append(crash.key)
    for (stage, why), (first, *others) in list(alike.items())[:_FAILURES_SHOWN]:
        which = f"{first} and {len(others)} more" if others else first
        print_problem(f"failed: {which} in {stage}: {one_line(why, 300)}")
    if len(alike) > _FAILURES_SHOWN:
        print_problem(f"failed: {sum(map(len, list(alike.values())[_FAILURES_SHOWN:]))} more; see trace-dag status")
    outdated = [crash for crash in stand.values() if crash.outdated]
    for crash in outdated[:_FAILURES_SHOWN]:
        why = one_line(crash.outdated_because, 200)
        print_problem(f"outdated: {crash.key} in {crash.outdated}: the new attempt failed: {why}")
    if len(outdated) > _FAILURES_SHOWN:
        print_problem(f"outdated: {len(outdated) - _FAILURES_SHOWN} more; see trace-dag status")
    if not failed and not outdated:
        for error in errors:
            print_problem(f"failed: {one_line(error, 500)}")
    return 1 if failed or outdated or errors else 0


@contextmanager
def _started(workspace: Workspace) -> Iterator[Executor]:
    """Start one executor for the whole command.

    Its workers start while this process is still importing modules.
    """
    from trace_dag.export.crash_files import MADE_WITH
    from trace_dag.flow.executors import make_executor
    from trace_dag.flow.worker import get_ready

    with closing(make_executor(workspace.settings.execution)) as executor:
        executor.prepare(partial(get_ready, workspace.flow, MADE_WITH))
        yield executor


def _run_and_summarise(workspace: Workspace, settings: Mapping[str, Any], selection: Selection) -> tuple[str, ...]:
    """Run a selection, update the warehouse and the benchmark, and return the errors."""
    with gc_paused():  # which takes an eighth of the time it takes to load Dagster
        from trace_dag.assets.launch import dagster_records, plan_runs, run_batches, summarise, summary_is_current
        from trace_dag.export.build import PAGES_LATER, benchmark_is_whole
        from trace_dag.flow.run_summary import RunSummary

    errors: tuple[str, ...] = ()
    with dagster_records(workspace) as instance:
        batches = plan_runs(workspace, instance, selection)
        if batches:
            summary, counts = RunSummary(), Counter[str]()
            stages = sum(len(batch.keys) * len(batch.stages) for batch in batches)
            with progress_of("stages", stages) as on_progress:

                def count(event: StageEvent) -> None:
                    summary.note(event)
                    if event.record is not None and event.record.stage is event.stage:
                        counts[event.record.outcome.value] += 1
                    on_progress(f"{event.key} ({counts['rejected']} rejected, {counts['failed']} failed)")

                watched = replace(workspace, listener=count)
                errors = run_batches(watched, instance, batches, settings=settings).errors
            say(summary.in_words())
        elif selection.exact:
            say("Nothing to run again: none of the crashes is one of those asked for.")
        else:
            say("Nothing to run: every crash asked for is up to date.")
        damaged = _damaged_warehouse(workspace)
        if not damaged and workspace.pages_in_runs and not benchmark_is_whole(workspace.storage):
            damaged = "Not every page and package is there as it was made."
        if damaged and not batches:
            say(f"{damaged} What is made of all crashes is made again.")
        if batches or damaged or not summary_is_current(workspace, instance):
            with progress_bar("pages") as tell_pages:
                errors += summarise(replace(workspace, page_listener=tell_pages), instance).errors
            if not workspace.pages_in_runs:
                say(PAGES_LATER)
    return errors


def _damaged_warehouse(workspace: Workspace) -> str:
    """Return a sentence on the fault of the warehouse; empty if it is undamaged."""
    from trace_dag.warehouse.query import check_warehouse

    try:
        check_warehouse(workspace.warehouse)
    except UserError:
        return "There is no warehouse."
    except DamagedFile as damaged:
        return f"{workspace.warehouse.name}: {damaged.found}."
    return ""
