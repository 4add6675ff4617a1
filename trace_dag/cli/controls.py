"""What a verdict is worth: ``controls``."""

from __future__ import annotations

import sys
from typing import TYPE_CHECKING, Any

import click

from trace_dag.cli.options import (
    ManyValuesCommand,
    examples,
    execution_overrides,
    executor_options,
    pass_root,
)
from trace_dag.cli.printing import print_table, say, write_json
from trace_dag.cli.progress import progress_bar
from trace_dag.cli.study import into_warehouse, judged_by, of_cohorts, rules_option

if TYPE_CHECKING:
    from trace_dag.cli.problems import Problems
    from trace_dag.flow.workspace import Workspace
    from trace_dag.settings import RuleSetName
    from trace_dag.studies.perturbed import Request


@click.command(
    cls=ManyValuesCommand,
    epilog=examples(
        "trace-dag controls",
        "trace-dag controls --rules strict --json",
        "trace-dag controls --perturbed --most 12 --cohort va-2023",
        "trace-dag controls --perturbed --only 2023-510179 --kinds 'clock*' foreign_site --draws 5",
    ),
)
@click.option("--cohort", help="Only this cohort; else each by itself.")
@rules_option
@click.option(
    "--most",
    type=click.IntRange(min=1),
    help="Of a larger cohort, so many crashes drawn at random; default 500, and 12 with --perturbed.",
)
@click.option("--json", "as_json", is_flag=True, help="Every judgement, as JSON.")
@click.option("--perturbed", is_flag=True, help="Change one thing of each report and run all stages again.")
@click.option("--only", metavar="KEY", multiple=True, help="With --perturbed: only these crashes.")
@click.option("--kinds", metavar="NAME", multiple=True, help="With --perturbed: only these changes; * and ? match.")
@click.option("--draws", default=1, show_default=True, type=click.IntRange(min=1), help="Of each change that is drawn.")
@click.option("--seed", default=1, show_default=True, type=click.IntRange(min=0), help="Of what --perturbed draws.")
@executor_options
@pass_root
def controls(
    root: str,
    cohort: str | None,
    rules: RuleSetName | None,
    most: int | None,
    as_json: bool,
    perturbed: bool,
    only: tuple[str, ...],
    kinds: tuple[str, ...],
    draws: int,
    seed: int,
    executor: str | None,
    workers: int | None,
) -> None:
    """Judge crashes against what they are not: another report of their kind, one vehicle or the person late, a person
    from the other side, one contact dropped, two swapped, a parked vehicle moved aside; a vehicle that leaves the road
    to the other side, and the object that it struck moved farther than the verdict allows.

    Prints for each kind how many are accepted beside the true pairing's rate; and how many of them with every reported
    speed driven as well, which the paper's criteria do not ask for. Every judgement enters the warehouse, as table
    negative_controls.

    With --perturbed: verified crashes, each with one thing of its report changed, through all stages again. Prints
    for each change how many are still verified, how many corroborated, and how many of the unchanged simulations the
    changed report accepts (own). Every changed report enters the warehouse, as table perturbed_controls.
    """
    from dataclasses import asdict

    from trace_dag.cli.problems import Problems
    from trace_dag.flow.workspace import Workspace
    from trace_dag.studies.controls import negative_controls
    from trace_dag.studies.summaries import controls_table

    workspace = Workspace.open(root)
    problems = Problems()
    if perturbed:
        from trace_dag.studies.perturbed import MOST, Request

        request = Request(most or MOST, only, kinds, draws, seed)
        _perturbed(workspace, cohort, rules, request, as_json, execution_overrides(executor, workers), problems)
        sys.exit(problems.print_all())
    if only or kinds:
        raise click.UsageError("--only and --kinds go with --perturbed")
    workspace = judged_by(workspace, rules)
    most = _MOST_CONTROLS if most is None else most
    with progress_bar("read, then judged") as on_progress:
        found = of_cohorts(
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


_MOST_CONTROLS = 500


def _perturbed(
    workspace: Workspace,
    cohort: str | None,
    rules: RuleSetName | None,
    request: Request,
    as_json: bool,
    execution: dict[str, Any],
    problems: Problems,
) -> None:
    from dataclasses import asdict

    from trace_dag.studies.perturbed import perturbed_controls
    from trace_dag.studies.summaries import perturbed_table

    overrides: dict[str, Any] = {"execution": execution}
    workspace = workspace.with_settings(overrides | ({"verdict": {"rule_set": rules}} if rules else {}))
    with progress_bar("changed reports") as on_progress:
        found = of_cohorts(
            workspace,
            cohort,
            lambda name: perturbed_controls(workspace, name, request, on_progress=on_progress, on_problem=problems.add),
            problems,
        )
    into_warehouse(workspace, problems)
    if as_json:
        write_json([{"cohort": name, **asdict(row)} for name, rows in found.items() for row in rows])
        return
    for name, rows in found.items():
        say(f"cohort {name}, {len({row.key for row in rows})} verified crashes, seed {request.seed}")
        print_table(*perturbed_table(rows)[:2])
