"""Running crashes: ``run``, and ``rerun`` for exactly those asked for."""

from __future__ import annotations

import sys

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
from trace_dag.cli.run_selection import run_selection
from trace_dag.common.errors import Reason, UserError
from trace_dag.common.stage import Stage


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
