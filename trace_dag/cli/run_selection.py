"""Shared by ``run``, ``rerun`` and ``demo``: running a selection of crashes and printing the results."""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable, Iterator, Mapping
from contextlib import ExitStack, closing, contextmanager
from dataclasses import replace
from functools import partial
from typing import TYPE_CHECKING, Any

from trace_dag.cli.printing import say
from trace_dag.cli.progress import progress_bar, progress_of
from trace_dag.common.errors import UserError
from trace_dag.common.gc_pause import gc_paused
from trace_dag.common.messages.logs import print_problem

if TYPE_CHECKING:
    from trace_dag.flow.executors import Executor
    from trace_dag.flow.selection import Selection
    from trace_dag.flow.tasks import StageEvent
    from trace_dag.flow.workspace import Workspace

_FAILURES_SHOWN = 20


def run_selection(root: str, settings: Mapping[str, Any], select: Callable[[Workspace], Selection]) -> int:
    """Run a selection through Dagster in this process, then update the summaries; return the exit code."""
    from trace_dag.cli.printing import one_line, print_statuses
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
    from trace_dag.common.errors import DamagedFile
    from trace_dag.warehouse.query import check_warehouse

    try:
        check_warehouse(workspace.warehouse)
    except UserError:
        return "There is no warehouse."
    except DamagedFile as damaged:
        return f"{workspace.warehouse.name}: {damaged.found}."
    return ""
