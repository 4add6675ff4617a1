"""Comparison of estimated directions of travel with reported ones: ``python -m lab compare_directions``."""

from __future__ import annotations

from dataclasses import asdict

import click

from lab.commands import run_study
from lab.compare_estimators import only_cohort
from trace_dag.cli.options import examples, execution_overrides, executor_options, pass_root
from trace_dag.cli.printing import print_table, progress_bar, say, write_json


@click.command(epilog=examples("python -m lab compare_directions --cohort tempe --sample 1500 --seed 1"))
@click.option("--cohort", help="Which cohort; can be left out if there is but one.")
@click.option("--sample", default=1500, show_default=True, type=click.IntRange(min=1), help="Crashes drawn at most.")
@click.option("--seed", default=1, show_default=True, type=click.IntRange(min=0), help="Of the draw.")
@click.option("--json", "as_json", is_flag=True, help="Every crash, as JSON.")
@executor_options
@pass_root
def compare_directions(
    root: str, cohort: str | None, sample: int, seed: int, as_json: bool, executor: str | None, workers: int | None
) -> None:
    """Hide the reported directions of travel, estimate each crash, and compare.

    Takes crashes of two vehicles with a road map and both directions reported, as registers other than FARS have them.
    Each is estimated without the directions and everything that follows from them, and again with them. An estimate is
    right if both vehicles head as reported within 45 degrees; a vehicle that turned may do so after its turn.

    Prints two tables: how often the best hypothesis is right, how often any kept hypothesis is, and how often one drawn
    from the kept ones would be; then the probabilities that the estimates state, beside how often they are right.
    """

    from lab.directions import calibration, hidden_directions, summary
    from trace_dag.flow.workspace import Workspace

    workspace = Workspace.open(root, overrides={"execution": execution_overrides(executor, workers)})
    chosen = cohort or only_cohort(list(workspace.registry.cohorts()), root)
    with progress_bar("crashes") as on_progress:
        rows = hidden_directions(workspace, chosen, most=sample, seed=seed, on_progress=on_progress)
    if as_json:
        write_json([{"cohort": chosen, **asdict(row)} for row in rows])
        return
    for table in (summary(rows), calibration(rows)):
        print_table(list(table[0]), [[str(value) for value in row.values()] for row in table])
        say("")


if __name__ == "__main__":
    run_study(compare_directions)
