"""Questions to the warehouse: ``sql``."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import click

from trace_dag.cli.options import OutputFile, examples, kind_of_file, pass_root
from trace_dag.cli.printing import print_table, say, write_csv, write_json
from trace_dag.cli.row_files import FORMATS, PRINTED, write_rows
from trace_dag.common.errors import UserError
from trace_dag.common.messages.wording import count_of
from trace_dag.common.storage.disk_errors import name_file_in_errors


@click.command(
    epilog=examples(
        'trace-dag sql "SELECT * FROM funnel"',
        'trace-dag sql "SELECT key, accepted FROM verdicts" --format csv',
        'trace-dag sql "FROM judged_crashes" --output crashes.xlsx',
    )
)
@click.argument("query")
@click.option(
    "--format",
    "output",
    type=click.Choice(["table", *FORMATS]),
    help="How the rows are printed, a table unless said, or the kind of file; else the file's name says it.",
)
@click.option(
    "--output",
    "path",
    type=OutputFile(),
    help=f"The file to write: {', '.join(f'.{name}' for name in FORMATS)}.",
)
@pass_root
def sql(root: str, query: str, output: str | None, path: Path | None) -> None:
    """Ask the warehouse in SQL (DuckDB), read-only.

    trace-dag tables lists the tables, columns and their meaning. Rows that are wider than the terminal are printed as a
    block each.
    """
    from trace_dag.flow.workspace import Workspace
    from trace_dag.warehouse.asking import ask
    from trace_dag.warehouse.query import query as rows_of
    from trace_dag.warehouse.query import query_typed

    output = kind_of_file("sql", path, output, FORMATS)
    if (path is not None and output not in FORMATS) or (path is None and output in FORMATS and output not in PRINTED):
        raise UserError(f"sql: --format {output} {'needs --output FILE' if path is None else 'is for the terminal'}")
    workspace = Workspace.open(root, to_read=True)
    how: Any = query_typed if output == "parquet" else rows_of
    names, rows = ask(workspace.warehouse, query, workspace.settings.warehouse, how)
    if path is not None:
        with name_file_in_errors(path):
            write_rows(path, str(output), names, rows)
        say(f"{path}  {count_of(len(rows), 'row')}")
    elif output == "csv":
        write_csv(names, rows)
    elif output == "json":
        write_json([dict(zip(names, row, strict=True)) for row in rows])
    else:
        print_table(names, rows, fit=True)
