"""Crashes by words: ``find``."""

from __future__ import annotations

import click

from trace_dag.cli.options import examples, pass_root
from trace_dag.cli.printing import print_table, say, write_json
from trace_dag.common.errors import UserError
from trace_dag.common.messages.wording import count_of

_SHOWN = 20
_COLUMNS = ("key", "final_state", "pre_crash_scenario", "light", "place", "kind", "euro_ncap", "odd")
_PRINTED = 5  # of the columns


@click.command(epilog=examples('trace-dag find "night pedestrian signalised"', "trace-dag find motorcycle T-junction"))
@click.argument("words", nargs=-1, required=True)
@click.option("--json", "as_json", is_flag=True, help="All that are found, as JSON.")
@pass_root
def find(root: str, words: tuple[str, ...], as_json: bool) -> None:
    """Find crashes that match all given words in kind, conditions, road, place, parties, domain or summary.

    A word matches the beginnings of words. Verified crashes come first. The words are those of the warehouse's table
    catalogue; sql can search further.
    """
    from trace_dag.flow.workspace import Workspace
    from trace_dag.warehouse.asking import ask
    from trace_dag.warehouse.query import query

    sought = [word.lower().replace("'", "''") for word in " ".join(words).split()]
    where = " AND ".join(f"contains(' ' || words, ' {word}')" for word in sought)
    workspace = Workspace.open(root, to_read=True)
    sql = (
        f"SELECT {', '.join(_COLUMNS)} FROM catalogue JOIN crashes USING (key) WHERE {where} "  # noqa: S608 - read-only
        "ORDER BY final_state <> 'verified', key"
    )
    names, rows = ask(workspace.warehouse, sql, workspace.settings.warehouse, query)
    if as_json:
        write_json([dict(zip(names, row, strict=True)) for row in rows])
        return
    if not rows:
        raise UserError(f"find {' '.join(words)}: no crash has all of these words; leave one out")
    print_table(names[:_PRINTED], [row[:_PRINTED] for row in rows[:_SHOWN]], fit=True)
    more = f"; --json lists all, {_SHOWN} are shown" if len(rows) > _SHOWN else ""
    say(f"{count_of(len(rows), 'crash', 'crashes')}{more}")
