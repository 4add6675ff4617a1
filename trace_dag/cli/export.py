"""Taking verified crashes elsewhere: ``export``."""

from __future__ import annotations

import sys
from pathlib import Path
from typing import TYPE_CHECKING

import click

from trace_dag.cli.options import ManyValuesCommand, examples
from trace_dag.cli.progress import progress_of

if TYPE_CHECKING:
    from trace_dag.benchmark.export import Layout


@click.command(
    cls=ManyValuesCommand,
    epilog=examples(
        "trace-dag export --output packages/",
        "trace-dag export --layout published --only 2023-510179",
    ),
)
@click.option(
    "--layout",
    type=click.Choice(["packages", "published"]),
    default="packages",
    show_default=True,
    help="A scenario package per crash, as a folder; or the published benchmark's layout, for scripts written for it.",
)
@click.option("--cohort", help="Only crashes of this cohort.")
@click.option("--only", multiple=True, metavar="KEY", help="Only these crashes, such as 2023-510179.")
@click.option("--output", type=click.Path(file_okay=False, path_type=Path), help="Where to; else ./LAYOUT.")
@click.pass_obj
def export(root: str, layout: Layout, cohort: str | None, only: tuple[str, ...], output: Path | None) -> None:
    """Write the verified crashes out, for use without this program.

    Exported again, only what has changed is written.
    """
    from trace_dag.benchmark.export import export as write
    from trace_dag.benchmark.export import verified_keys
    from trace_dag.cli.complaints import Complaints
    from trace_dag.flow.workspace import Workspace

    workspace, folder = Workspace.open(root), output or Path(layout)
    complaints, exported = Complaints(), 0
    keys = verified_keys(workspace, cohort, only, complain=complaints.hear)
    with progress_of("crashes", len(keys)) as told:

        def tell(key: str) -> None:
            nonlocal exported
            exported += 1
            told(key)

        left_out: list[str] = []
        written = write(workspace, keys, folder, layout, told=tell, complain=complaints.hear, left_out=left_out.append)
    click.echo(f"{folder}  {exported} crashes, {written} files written")
    for why in left_out:
        click.echo(f"left out  {why}")
    sys.exit(complaints.told())
