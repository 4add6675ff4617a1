"""Tables of the warehouse: ``tables``."""

from __future__ import annotations

import click

from trace_dag.cli.options import examples, pass_root
from trace_dag.cli.printing import print_table
from trace_dag.common.errors import UserError


@click.command(epilog=examples("trace-dag tables", "trace-dag tables verdicts", 'trace-dag tables "impact speed"'))
@click.argument("words", metavar="[TABLE | WORDS]", required=False)
@pass_root
def tables(root: str, words: str | None) -> None:
    """List the tables and views of the warehouse with their meaning, or the columns of one of them.

    Any other words find the columns that have all of them in their name or meaning.
    """
    from trace_dag.flow.workspace import Workspace
    from trace_dag.warehouse.query import columns_of, tables_of

    warehouse = Workspace.open(root, to_read=True).warehouse
    if words is None:
        print_table(["table", "rows", "what it holds"], tables_of(warehouse))
        return
    columns = columns_of(warehouse)
    if own := [column[1:] for column in columns if column[0] == words]:
        print_table(["column", "type", "what it means"], own)
        return
    sought = words.lower().replace("_", " ").split()
    found = [each for each in columns if all(word in " ".join(each).lower().replace("_", " ") for word in sought)]
    if not found:
        raise UserError(
            f"tables {words}: no table has this name and no column this meaning; trace-dag tables lists all"
        )
    print_table(["table", "column", "type", "what it means"], found)
