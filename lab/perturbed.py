"""Reports with one thing changed, through all stages again: ``python -m lab perturbed``."""

from __future__ import annotations

import sys
from collections.abc import Sequence
from dataclasses import asdict
from typing import TYPE_CHECKING, Any

import click

from lab.changed_reports.kinds import KINDS
from lab.changed_reports.rows import PerturbedRow
from lab.changed_reports.study import MOST, Request, perturbed_controls
from lab.commands import run_study
from trace_dag.cli.options import ManyValuesCommand, examples, execution_overrides, executor_options, pass_root
from trace_dag.cli.printing import print_table, progress_bar, say, write_json
from trace_dag.cli.study import Problems, apply_rules, into_warehouse, rules_option, run_for_cohorts
from trace_dag.flow.workspace import Workspace
from trace_dag.verdict.types import Grade

if TYPE_CHECKING:
    from trace_dag.common.settings import RuleSetName


@click.command(
    cls=ManyValuesCommand,
    epilog=examples(
        "python -m lab perturbed --most 12 --cohort va-2023",
        "python -m lab perturbed --only 2023-510179 --kinds 'clock*' foreign_site --draws 5",
    ),
)
@click.option("--cohort", help="Only this cohort; else each by itself.")
@rules_option
@click.option(
    "--most",
    default=MOST,
    show_default=True,
    type=click.IntRange(min=1),
    help="Of a larger cohort, so many crashes drawn at random.",
)
@click.option("--json", "as_json", is_flag=True, help="Every changed report, as JSON.")
@click.option("--only", metavar="KEY", multiple=True, help="Only these crashes.")
@click.option("--kinds", metavar="NAME", multiple=True, help="Only these changes; * and ? match.")
@click.option("--draws", default=1, show_default=True, type=click.IntRange(min=1), help="Of each change that is drawn.")
@click.option("--seed", default=1, show_default=True, type=click.IntRange(min=0), help="Of what is drawn.")
@executor_options
@pass_root
def perturbed(
    root: str,
    cohort: str | None,
    rules: RuleSetName | None,
    most: int,
    as_json: bool,
    only: tuple[str, ...],
    kinds: tuple[str, ...],
    draws: int,
    seed: int,
    executor: str | None,
    workers: int | None,
) -> None:
    """Change one thing of the report of each verified crash and run all stages again.

    Prints for each change how many are still verified, how many corroborated, and how many of the unchanged
    simulations the changed report accepts (own). Every changed report enters the warehouse, as table
    perturbed_controls.
    """
    workspace = apply_rules(Workspace.open(root), rules)
    workspace = workspace.with_settings({"execution": execution_overrides(executor, workers)})
    request, problems = Request(most, only, kinds, draws, seed), Problems()
    with progress_bar("changed reports") as on_progress:
        found = run_for_cohorts(
            workspace,
            cohort,
            lambda name: perturbed_controls(workspace, name, request, on_progress=on_progress, on_problem=problems.add),
            problems,
        )
    into_warehouse(workspace, problems)
    if as_json:
        write_json([{"cohort": name, **asdict(row)} for name, rows in found.items() for row in rows])
        sys.exit(problems.print_all())
    for name, rows in found.items():
        say(f"cohort {name}, {len({row.key for row in rows})} verified crashes, seed {seed}")
        print_table(*perturbed_table(rows))
    sys.exit(problems.print_all())


def perturbed_table(rows: Sequence[PerturbedRow]) -> tuple[list[str], list[tuple[Any, ...]]]:
    """Return a line per perturbation: changed reports judged, verified, corroborated, and verified of the crash's own
    simulation.
    """
    lines: list[tuple[Any, ...]] = []
    for name, kind in KINDS.items():
        of_kind = [row for row in rows if row.perturbation == name]
        if not of_kind:
            continue
        judged = [row for row in of_kind if row.verified is not None]
        own = [row.own_verified for row in of_kind if row.own_verified is not None]
        corroborated = sum(row.grade == Grade.CORROBORATED for row in judged)
        verified = sum(bool(row.verified) for row in judged)
        crashes = len({row.key for row in of_kind})
        lines.append((name, kind.title, crashes, len(judged), verified, corroborated, f"{sum(own)} of {len(own)}"))
    names = ["perturbation", "changed", "crashes", "judged", "verified", "corroborated", "own"]
    return names, lines


if __name__ == "__main__":
    run_study(perturbed)
