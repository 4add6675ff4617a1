"""Crash tables that can be read by name, and mappings for others: ``registers``."""

from __future__ import annotations

from pathlib import Path

import click

from trace_dag.cli.options import examples
from trace_dag.cli.printing import say
from trace_dag.common.errors import UserError


@click.command(epilog=examples("trace-dag registers", "trace-dag registers --new crashes.csv"))
@click.option("--new", metavar="TABLE", help="Write a mapping for a table of yours, with guesses that are marked.")
@click.option("--output", metavar="FILE", help="Name of that mapping; else that of the table, as .toml.")
def registers(new: str | None, output: str | None) -> None:
    """List the crash tables whose mappings are part of the package, with their coverage and limits.

    ``ingest --register NAME FILE`` reads one; if several files belong together, FILE is their folder.
    """
    from trace_dag.crash.registers.guess import guess_mapping
    from trace_dag.crash.registers.mapping import list_shipped_mappings, read_mapping

    if new is not None:
        target = Path(output or f"{Path(new).name.split('.')[0]}.toml")
        if target.exists():
            raise UserError(f"{target} is there already; name another with --output")
        target.write_text(guess_mapping(Path(new)), encoding="utf-8")
        say(f"{target}: fill in each ?, check each guess, then trace-dag ingest --register {target} {new} --check")
        return
    for name in list_shipped_mappings():
        mapping = read_mapping(name)
        say(f"{name}: {mapping.attribution}, {mapping.name}")
        files = [mapping.table, *dict.fromkeys(file.name for file in mapping.files)] if mapping.files else []
        for title, words in (
            ("crashes", ", ".join(mapping.covers)),
            ("files", ", ".join(files)),
            ("columns", ", ".join(dict.fromkeys(mapping.columns()))),
            ("not in it", mapping.lacks_in_words),
            ("download", mapping.source),
            ("made from", mapping.documented),
        ):
            if words:
                say(f"  {title}: {words}")
