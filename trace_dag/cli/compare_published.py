"""Beside a published benchmark: ``compare-published``."""

from __future__ import annotations

import sys
from pathlib import Path
from typing import TYPE_CHECKING

import click

from trace_dag.cli.options import examples, pass_root
from trace_dag.cli.printing import print_table, write_json
from trace_dag.cli.study import into_warehouse, judged_by, of_cohorts, rules_option
from trace_dag.messages.logs import print_problem

if TYPE_CHECKING:
    from trace_dag.settings import RuleSetName


@click.command(
    epilog=examples(
        "trace-dag compare-published published/ --cohort virginia",
    )
)
@click.argument("folder", type=click.Path(exists=True, file_okay=False, path_type=Path))
@click.option("--cohort", help="The cohort that holds the same cases; else each by itself.")
@rules_option
@click.option("--json", "as_json", is_flag=True, help="Every crash of both, as JSON.")
@pass_root
def compare_published(root: str, folder: Path, cohort: str | None, rules: RuleSetName | None, as_json: bool) -> None:
    """Run a published benchmark's scenarios on its own maps, judged by the same rules, beside ours.

    FOLDER holds simulations/ and maps/, or folders of years (2015/, ...) that do. Every judgement enters the warehouse,
    as table benchmark_comparison. Cases in whose report no two vehicles touch are left out of both and named.
    """
    from dataclasses import asdict

    from trace_dag.cli.problems import Problems
    from trace_dag.flow.workspace import Workspace
    from trace_dag.studies.peer import published_comparison
    from trace_dag.studies.summaries import peer_table

    workspace, problems = Workspace.open(root), Problems()
    compared = of_cohorts(
        workspace,
        cohort,
        lambda name: published_comparison(judged_by(workspace, rules), name, folder, on_problem=problems.add),
        problems,
    ).values()
    found = [row for each in compared for row in each.rows]
    left_out = {key: why for each in compared for key, why in each.left_out.items()}
    into_warehouse(workspace, problems)
    if left_out:
        print_problem(f"{len(left_out)} left out of both, no collision of two vehicles by their reports:")
        for key, why in left_out.items():
            print_problem(f"  {key}  {why}")
    if as_json:
        write_json([asdict(row) for row in found])
        sys.exit(problems.print_all())
    print_table(*peer_table(found)[:2])
    sys.exit(problems.print_all())
