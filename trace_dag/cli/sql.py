"""Questions to the warehouse: ``sql``."""

from __future__ import annotations

import click

from trace_dag.cli.options import examples
from trace_dag.cli.printing import print_table, write_csv, write_json


@click.command(
    epilog=examples(
        'trace-dag sql "SELECT * FROM funnel"',
        'trace-dag sql "SELECT key, accepted FROM verdicts" --format csv',
    )
)
@click.argument("query")
@click.option(
    "--format",
    "output",
    type=click.Choice(["table", "csv", "json"]),
    default="table",
    show_default=True,
    help="How the rows are printed.",
)
@click.pass_obj
def sql(root: str, query: str, output: str) -> None:
    """Ask the warehouse in SQL (DuckDB), read-only.

    SHOW TABLES lists what there is; DESCRIBE and duckdb_columns() tell what the columns mean.
    """
    from trace_dag.flow.workspace import Workspace
    from trace_dag.warehouse.query import query as ask

    names, rows = ask(Workspace.open(root).warehouse, query)
    if output == "csv":
        write_csv(names, rows)
    elif output == "json":
        write_json([dict(zip(names, row, strict=True)) for row in rows])
    else:
        print_table(names, rows)
