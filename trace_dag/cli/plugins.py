"""Plug-ins of installed packages: ``plugins``."""

from __future__ import annotations

import click

from trace_dag.cli.options import examples
from trace_dag.cli.printing import print_table, write_json


@click.command(epilog=examples("trace-dag plugins"))
@click.option("--json", "as_json", is_flag=True, help="The same as JSON.")
def plugins(as_json: bool) -> None:
    """List the back-ends, converters, estimators, agents and sources that can be chosen by name.

    Any installed package can add some as entry points; see the documentation.
    """
    from trace_dag.common.plugins import PluginKind, list_plugins

    rows = [
        (kind.value.replace("_", " "), each.name, each.package, each.version, each.reference)
        for kind in PluginKind
        for each in list_plugins(kind).values()
    ]
    names = ["kind", "name", "package", "version", "what it is"]
    if as_json:
        write_json([dict(zip(("kind", "name", "package", "version", "reference"), row, strict=True)) for row in rows])
    else:
        print_table(names, rows)
