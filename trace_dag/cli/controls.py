"""Negative controls: ``controls``."""

from __future__ import annotations

import sys
from dataclasses import asdict
from typing import TYPE_CHECKING

import click

from trace_dag.cli.options import examples, pass_root
from trace_dag.cli.printing import print_table, progress_bar, write_json
from trace_dag.cli.study import Problems, apply_rules, into_warehouse, rules_option, run_for_cohorts

if TYPE_CHECKING:
    from trace_dag.common.settings import RuleSetName


@click.command(epilog=examples("trace-dag controls", "trace-dag controls --rules strict --json"))
@click.option("--cohort", help="Only this cohort; else each by itself.")
@rules_option
@click.option(
    "--most",
    default=500,
    show_default=True,
    type=click.IntRange(min=1),
    help="Of a larger cohort, so many crashes drawn at random.",
)
@click.option("--json", "as_json", is_flag=True, help="Every judgement, as JSON.")
@pass_root
def controls(root: str, cohort: str | None, rules: RuleSetName | None, most: int, as_json: bool) -> None:
    """Judge simulations against reports that they should not match.

    The controls are another report of the same kind, one vehicle or the person late, a person from the other side, one
    contact dropped, two contacts swapped, and a parked vehicle moved aside. For a vehicle that leaves the road they are
    the other side, and the struck object moved farther than the verdict allows.

    Prints for each control the share that is accepted, beside the share of true pairings, and the share in which every
    reported speed is driven as well, which the paper's criteria do not require. Every judgement enters the warehouse,
    as table negative_controls.
    """

    from trace_dag.agents.summaries import controls_table
    from trace_dag.flow.controls import negative_controls
    from trace_dag.flow.workspace import Workspace

    workspace = Workspace.open(root)
    problems = Problems()
    workspace = apply_rules(workspace, rules)
    with progress_bar("read, then judged") as on_progress:
        found = run_for_cohorts(
            workspace,
            cohort,
            lambda name: negative_controls(
                workspace, name, most=most, on_progress=on_progress, on_problem=problems.add
            ),
            problems,
        )
    into_warehouse(workspace, problems)
    if as_json:
        write_json([{"cohort": name, **asdict(row)} for name, rows in found.items() for row in rows])
        sys.exit(problems.print_all())
    print_table(*controls_table(found)[:2])
    sys.exit(problems.print_all())
