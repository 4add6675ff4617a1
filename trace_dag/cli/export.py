"""Taking verified crashes elsewhere: ``export``."""

from __future__ import annotations

import sys
from pathlib import Path

import click

from trace_dag.cli.options import ManyValuesCommand, examples, pass_root
from trace_dag.cli.printing import progress_of, say
from trace_dag.cli.study import Problems
from trace_dag.common.messages.wording import count_of
from trace_dag.export.formats import FORM_OF_READER


@click.command(
    cls=ManyValuesCommand,
    epilog=examples(
        "trace-dag export --output packages/",
        "trace-dag export --format commonroad --only 2023-510179",
        "trace-dag export --for metadrive",
    ),
)
@click.option(
    "--format",
    "export_format",
    metavar="NAME",
    help="packages, the default (a folder per crash), commonroad, lanelet2, glb (glTF), scenarionet (MetaDrive), sumo, "
    "osi, openlabel (tags), points (GeoParquet and GPX), or what another package offers: trace-dag plugins.",
)
@click.option(
    "--for",
    "reader",
    type=click.Choice(sorted(FORM_OF_READER), case_sensitive=False),
    help="The tool that will read them, in place of --format: the form that it reads best.",
)
@click.option("--cohort", help="Only crashes of this cohort.")
@click.option("--only", multiple=True, metavar="KEY", help="Only these crashes, such as 2023-510179.")
@click.option("--output", type=click.Path(file_okay=False, path_type=Path), help="Where to; else ./NAME.")
@pass_root
def export(
    root: str,
    export_format: str | None,
    reader: str | None,
    cohort: str | None,
    only: tuple[str, ...],
    output: Path | None,
) -> None:
    """Write the verified crashes out, for use without this program.

    A repeated export writes only the files that have changed.
    """
    from trace_dag.export.export import accepted_keys
    from trace_dag.export.export import export as write
    from trace_dag.flow.workspace import Workspace

    if export_format and reader:
        raise click.UsageError("--format and --for both choose a form: leave one out.")
    export_format = export_format or ("packages" if reader is None else FORM_OF_READER[reader])
    workspace, folder = Workspace.open(root, to_read=True), output or Path(export_format)
    problems, exported = Problems(), 0
    keys = accepted_keys(workspace, cohort, only, on_problem=problems.add)
    with progress_of("crashes", len(keys)) as told:

        def on_progress(key: str) -> None:
            nonlocal exported
            exported += 1
            told(key)

        left_out: list[str] = []
        written = write(
            workspace, keys, folder, export_format, told=on_progress, on_problem=problems.add, left_out=left_out.append
        )
    say(f"{folder}  {count_of(exported, 'crash', 'crashes')}, {count_of(written, 'file')} written")
    for why in left_out:
        say(f"left out  {why}")
    sys.exit(problems.print_all())
