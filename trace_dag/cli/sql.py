"""Questions to the warehouse: ``sql``."""

from __future__ import annotations

from pathlib import Path

import click

from trace_dag.cli.options import examples
from trace_dag.cli.printing import print_table, say, write_csv, write_json
from trace_dag.cli.row_files import FORMATS, write_rows
from trace_dag.errors import UserError
from trace_dag.messages.wording import counted
from trace_dag.storage.disk_errors import naming


@click.command(
    epilog=examples(
        'trace-dag sql "SELECT * FROM funnel"',
        'trace-dag sql "SELECT key, accepted FROM verdicts" --format csv',
        'trace-dag sql "FROM crashes" --format xlsx --output crashes.xlsx',
    )
)
@click.argument("query")
@click.option(
    "--format",
    "output",
    type=click.Choice(["table", "csv", "json", *FORMATS]),
    default="table",
    show_default=True,
    help="How the rows are printed, or the kind of file they are written to.",
)
@click.option(
    "--output", "path", type=click.Path(dir_okay=False, path_type=Path), help="The file, for xlsx and the like."
)
@click.pass_obj
def sql(root: str, query: str, output: str, path: Path | None) -> None:
    """Ask the warehouse in SQL (DuckDB), read-only.

    trace-dag tables lists what there is and what the columns mean. In a terminal, long texts stand last and are cut;
    csv, json and the files have them whole.
    """
    from trace_dag.flow.workspace import Workspace
    from trace_dag.warehouse.asking import ask

    if (path is not None) != (output in FORMATS):
        raise UserError(f"sql: --output FILE goes with --format {', '.join(FORMATS)}, and each of them needs it")
    workspace = Workspace.open(root, to_read=True)
    names, rows = ask(workspace.warehouse, query, workspace.settings.warehouse)
    if path is not None:
        with naming(path):
            write_rows(path, output, names, rows)
        say(f"{path}  {counted(len(rows), 'row')}")
    elif output == "csv":
        write_csv(names, rows)
    elif output == "json":
        write_json([dict(zip(names, row, strict=True)) for row in rows])
    else:
        print_table(names, rows, fit=True)
