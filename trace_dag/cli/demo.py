"""Running the bundled sample: ``demo``."""

from __future__ import annotations

import shlex
import sys
import time
from pathlib import Path

import click

from trace_dag.cli.options import examples, execution_overrides, executor_options
from trace_dag.cli.printing import print_table, say
from trace_dag.common.errors import UserError

COHORT = "sample"


@click.command(epilog=examples("trace-dag --root demo demo", "trace-dag --root demo demo --people"))
@click.option("--people", is_flag=True, help="And the town's crashes with pedestrians, cyclists and animals.")
@executor_options
@click.pass_context
def demo(context: click.Context, people: bool, executor: str | None, workers: int | None) -> None:
    """Run the bundled sample: a fictional town and crashes whose true course is known.

    Registers it as cohort "sample", runs it through all stages, and prints the funnel, the coverage and the next
    commands.
    """
    from trace_dag.cli.ingest import ingest
    from trace_dag.cli.run import run_selection
    from trace_dag.export.build import INDEX
    from trace_dag.flow.selection import select_stale
    from trace_dag.flow.workspace import Workspace
    from trace_dag.warehouse.query import query

    root, began, folder = context.obj, time.monotonic(), sample_folder()
    reports = [folder / "reports", *([folder / "people" / "reports"] if people else [])]
    context.invoke(ingest, reports=tuple(map(str, reports)), maps=(str(folder / "osm"),), cohort=COHORT)
    settings = {"execution": execution_overrides(executor, workers)}
    code = run_selection(root, settings, lambda workspace: select_stale(workspace, COHORT))
    workspace = Workspace.open(root)
    storage = workspace.storage
    if not storage.exists(INDEX):  # what went wrong is told
        sys.exit(code)
    say()
    print_table(*query(workspace.warehouse, "SELECT * FROM coverage"))
    say(f"\nDone in {time.monotonic() - began:.0f} s. Where to look:")
    say(f"  {storage.path(INDEX)}  the crashes, each with its page, replay and package")
    for command, shows in (
        ("ui", "the same as Dagster assets"),
        ('sql "SELECT key, kind, grade FROM judged_crashes"', "any question, in SQL"),
    ):
        say(f"  trace-dag --root {shlex.quote(root)} {command}  {shows}")
    sys.exit(code)


def sample_folder() -> Path:
    """Return the folder of the sample, in the installed package or in the repository beside it."""
    package = Path(__file__).resolve().parents[1]
    for folder in (package / "sample_data" / "sample", package.parent / "data" / "sample"):
        if (folder / "truth.json").is_file():
            return folder
    raise UserError("the bundled sample is not installed; expected it in trace_dag/sample_data/sample")
