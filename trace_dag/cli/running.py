"""Running crashes: ``run`` and ``rerun``."""

from __future__ import annotations

import sys
from collections import Counter
from collections.abc import Callable, Iterator, Mapping
from contextlib import ExitStack, closing, contextmanager
from dataclasses import replace
from functools import partial
from typing import TYPE_CHECKING, Any

import click

from trace_dag.cli.options import ManyValuesCommand, examples, execution_overrides, executor_options, stage_option
from trace_dag.cli.progress import progress_of, progress_told
from trace_dag.errors import Reason, Stage, UserError

if TYPE_CHECKING:
    from trace_dag.pipeline.batch import Pipeline
    from trace_dag.pipeline.executors import Executor
    from trace_dag.pipeline.home import Home
    from trace_dag.pipeline.selection import Selection
    from trace_dag.pipeline.tasks import StageEvent

_FAILURES_SHOWN = 20


@click.command(
    cls=ManyValuesCommand,
    epilog=examples(
        "trace-dag run",
        "trace-dag run --only 2023-510179 --from road_map",
    ),
)
@click.option("--cohort", help="Only crashes of this cohort.")
@click.option("--only", multiple=True, metavar="KEY", help="Only these crashes, such as 2023-510179.")
@stage_option("--from", "first", help="Compute this stage and all after it again, changed or not.")
@click.option("--estimator", type=click.Choice(["analytic", "llm"]), help="How states are estimated, for this run.")
@executor_options
@click.pass_obj
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

    What is up to date is left alone; failures are tried again. Exit code 1 if a crash failed.
    """
    settings: dict[str, Any] = {"execution": execution_overrides(executor, workers)}
    if estimator:
        settings["states"] = {"estimator": estimator}
    from trace_dag.pipeline.selection import select_stale

    sys.exit(carry_out(root, settings, lambda pipeline: select_stale(pipeline, cohort, only, first)))


@click.command(
    cls=ManyValuesCommand,
    epilog=examples(
        "trace-dag rerun --failed",
        "trace-dag rerun --rejected crash_off_road --cohort virginia",
    ),
)
@click.option("--failed", is_flag=True, help="The crashes that failed, from the stage that broke.")
@click.option("--rejected", type=click.Choice([reason.value for reason in Reason]), help="Those rejected for a reason.")
@stage_option("--from", "first", help="Every crash that got there, from this stage on.")
@click.option("--cohort", help="Only crashes of this cohort.")
@click.option("--only", multiple=True, metavar="KEY", help="Only these crashes.")
@executor_options
@click.pass_obj
def rerun(
    root: str,
    failed: bool,
    rejected: str | None,
    first: Stage | None,
    cohort: str | None,
    only: tuple[str, ...],
    executor: str | None,
    workers: int | None,
) -> None:
    """Run again exactly the crashes and stages asked for, unchanged or not."""
    if failed + (rejected is not None) + (first is not None) != 1:
        raise UserError("rerun: say what to run again with one of --failed, --rejected REASON, --from STAGE")
    settings = {"execution": execution_overrides(executor, workers)}
    from trace_dag.pipeline.selection import select_again

    reason = Reason(rejected) if rejected else None
    sys.exit(
        carry_out(
            root,
            settings,
            lambda pipeline: select_again(pipeline, cohort, only, failed=failed, reason=reason, first=first),
        )
    )


def carry_out(root: str, settings: Mapping[str, Any], select: Callable[[Pipeline], Selection]) -> int:
    """Run a selection through Dagster, in this process, then what is made of all crashes; the exit code."""
    from trace_dag.cli.printing import one_line, print_standings
    from trace_dag.pipeline.home import Home
    from trace_dag.pipeline.records import read_records
    from trace_dag.pipeline.stages import FLOW
    from trace_dag.pipeline.standing import FinalState, standings

    home = Home(root, FLOW)
    pipeline = home.pipeline(settings)
    selection = select(pipeline)
    with ExitStack() as resources:
        if selection.start:
            pipeline.check_requirements({stage for first in selection.start.values() for stage in first.and_later()})
            home = replace(home, executor=resources.enter_context(_started(pipeline)))
        errors = _run_and_summarise(home, pipeline, settings, selection)
    stand = standings(read_records(pipeline.storage, selection.asked))
    print_standings(stand)
    failed = [crash for crash in stand.values() if crash.final_state is FinalState.FAILED]
    for crash in failed[:_FAILURES_SHOWN]:
        click.echo(f"failed: {crash.key} in {crash.stage_reached}: {one_line(crash.detail, 200)}", err=True)
    if len(failed) > _FAILURES_SHOWN:
        click.echo(f"failed: {len(failed) - _FAILURES_SHOWN} more; see trace-dag status", err=True)
    if not failed:
        for error in errors:
            click.echo(f"failed: {one_line(error, 500)}", err=True)
    return 1 if failed or errors else 0


@contextmanager
def _started(pipeline: Pipeline) -> Iterator[Executor]:
    """One executor for all that the command does, its workers starting while this process still reads its modules."""
    from trace_dag.pipeline.executors import make_executor
    from trace_dag.pipeline.worker import get_ready

    with closing(make_executor(pipeline.settings.execution)) as executor:
        executor.prepare(partial(get_ready, pipeline.flow))
        yield executor


def _run_and_summarise(
    home: Home, pipeline: Pipeline, settings: Mapping[str, Any], selection: Selection
) -> tuple[str, ...]:
    """Run a selection, and bring the warehouse and the benchmark up to date; what failed."""
    from trace_dag.assets.launch import open_instance, planned, run_batches, summarise, summary_is_current
    from trace_dag.pipeline.benchmark import benchmark_is_whole
    from trace_dag.pipeline.run_summary import RunSummary

    errors: tuple[str, ...] = ()
    with open_instance(home) as instance:
        batches = planned(pipeline, instance, selection)
        if batches:
            summary, counts = RunSummary(), Counter[str]()
            stages = sum(len(batch.keys) * len(batch.stages) for batch in batches)
            with progress_of("stages", stages) as tell:

                def hear(event: StageEvent) -> None:
                    summary.note(event)
                    if event.record is not None and event.record.stage is event.stage:
                        counts[event.record.outcome.value] += 1
                    tell(f"{event.key} ({counts['rejected']} rejected, {counts['failed']} failed)")

                errors = run_batches(replace(home, listener=hear), instance, batches, settings=settings).errors
            click.echo(summary.in_words())
        elif selection.exact:
            click.echo("Nothing to run again: none of the crashes is one of those asked for.")
        else:
            click.echo("Nothing to run: every crash asked for is up to date.")
        damaged = _damaged_warehouse(home)
        if not damaged and not benchmark_is_whole(pipeline.storage):
            damaged = "Not every page and package is there as it was made."
        if damaged and not batches:
            click.echo(f"{damaged} What is made of all crashes is made again.")
        if batches or damaged or not summary_is_current(home, instance):
            with progress_told("pages") as tell_pages:
                errors += summarise(replace(home, page_listener=tell_pages), instance).errors
    return errors


def _damaged_warehouse(home: Home) -> str:
    """What is wrong with the warehouse, in a sentence; nothing if it is as it was built."""
    from trace_dag.errors import DamagedFile
    from trace_dag.warehouse.query import check_warehouse

    try:
        check_warehouse(home.warehouse)
    except UserError:
        return "There is no warehouse."
    except DamagedFile as damaged:
        return f"{home.warehouse.name}: {damaged.found}."
    return ""
