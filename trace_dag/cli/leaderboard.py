"""Results that others hand in: ``leaderboard add``."""

from __future__ import annotations

import sys
from pathlib import Path

import click

from trace_dag.cli.options import examples, pass_root
from trace_dag.cli.printing import print_table, say
from trace_dag.cli.study import Problems, into_warehouse
from trace_dag.common.errors import UserError
from trace_dag.common.messages.wording import count_of


@click.group(epilog=examples("trace-dag leaderboard add results.json"))
def leaderboard() -> None:
    """Enter results of agents that were evaluated elsewhere; evaluate enters those of this root."""


@leaderboard.command(epilog=examples("trace-dag leaderboard weighted trace-bench.json"))
@click.argument("bench", type=click.Path(dir_okay=False, path_type=Path))
@pass_root
def weighted(root: str, bench: Path) -> None:
    """Show how often each agent avoids the crash: unweighted, and weighted by a release made with --national.

    The 95 % intervals take the crash as the unit. The table also has the effective number of crashes behind each
    weighted share.
    """
    from trace_dag.agents.summaries import weigh_table
    from trace_dag.export.release_metadata import read_definition
    from trace_dag.flow.workspace import Workspace
    from trace_dag.warehouse.query import rows

    if not bench.is_file():
        raise UserError(f"{bench}: there is no such file; trace-dag release writes one")
    definition = read_definition(bench.read_bytes(), str(bench))
    if definition["weights"] is None:
        raise UserError(f"{bench}: without weights; release --national makes them")
    weights = {key: crash["weight"] for key, crash in definition["crashes"].items()}
    runs = [run for run in rows(Workspace.open(root, to_read=True).warehouse, "evaluations") if run["key"] in weights]
    print_table(*weigh_table(runs, weights)[:2])


@leaderboard.command(epilog=examples("trace-dag leaderboard add results.json"))
@click.argument("file", type=click.Path(dir_okay=False, path_type=Path))
@pass_root
def add(root: str, file: Path) -> None:
    """Check a file of evaluate --results against the crashes of this root, and enter it.

    A file is refused, with the reason in one line, if it was changed, lacks runs, was measured by other code, has
    outcomes that do not follow from its measures, or if its crashes have been judged again since. The driver's identity
    is not proved.
    """
    from trace_dag.agents.evaluations import store_rows
    from trace_dag.agents.submissions import check
    from trace_dag.export.build import publish_leaderboard
    from trace_dag.flow.workspace import Workspace

    if not file.is_file():
        raise UserError(f"{file}: there is no such file; trace-dag evaluate --results writes one")
    workspace, problems = Workspace.open(root), Problems()
    agents = check(workspace, file.read_bytes(), str(file), on_problem=problems.add)
    for agent, rows in agents.items():
        store_rows(workspace.storage, agent, f"handed in: {file.name}", rows, problems.add)
        say(f"{agent}  {count_of(len(rows), 'run')} entered")
    into_warehouse(workspace, problems)
    publish_leaderboard(workspace.storage, workspace.warehouse)
    sys.exit(problems.print_all())
