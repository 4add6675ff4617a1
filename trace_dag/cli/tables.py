"""Tables of the warehouse: ``tables``."""

from __future__ import annotations

import click

from trace_dag.cli.options import examples, pass_root
from trace_dag.cli.printing import print_table
from trace_dag.common.errors import UserError


@click.command(epilog=examples("trace-dag tables", "trace-dag tables verdicts"))
@click.argument("table", required=False)
@pass_root
def tables(root: str, table: str | None) -> None:
    """List the tables and views of the warehouse with their meaning, or the columns of one of them."""
    from trace_dag.flow.workspace import Workspace
    from trace_dag.warehouse.query import columns_of, tables_of

    warehouse = Workspace.open(root, to_read=True).warehouse
    if table is None:
        print_table(["table", "rows", "what it holds"], tables_of(warehouse))
        return
    columns = columns_of(warehouse, table)
    if not columns:
        raise UserError(f"tables {table}: there is no such table; trace-dag tables lists all of them")
    print_table(["column", "type", "what it means"], columns)
