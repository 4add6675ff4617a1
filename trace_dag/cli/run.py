"""Running crashes: ``run``."""

from __future__ import annotations

import sys
from typing import TYPE_CHECKING, Any

import click

from trace_dag.cli.options import ManyValuesCommand, examples, execution_overrides, executor_options, stage_option
from trace_dag.stage import Stage

if TYPE_CHECKING:
    pass
from trace_dag.cli.carry_out import carry_out


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
    from trace_dag.flow.selection import select_stale

    sys.exit(carry_out(root, settings, lambda workspace: select_stale(workspace, cohort, only, first)))
