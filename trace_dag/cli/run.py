"""Running crashes: ``run``."""

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
