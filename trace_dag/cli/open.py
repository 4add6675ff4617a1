"""The benchmark page in a browser: ``open``."""

from __future__ import annotations

import click

from trace_dag.cli.options import examples
from trace_dag.cli.printing import say
from trace_dag.errors import UserError


@click.command("open", epilog=examples("trace-dag open", "trace-dag open 2023-510179"))
@click.argument("key", required=False)
@click.pass_obj
def open_page(root: str, key: str | None) -> None:
    """Open the benchmark page in a browser, or the page of one crash, and print where it is."""
    from trace_dag.benchmark.build import INDEX, page_name
    from trace_dag.crash.keys import parse_key
    from trace_dag.storage.files import Storage

    storage = Storage.open(root, to_read=True)
    if key is not None:
        parse_key(key)
    name = INDEX if key is None else page_name(key)
    if not storage.exists(name):
        raise UserError(f"{storage.path(name)}: there is no such page yet; trace-dag run makes it")
    say(storage.path(name))
    if storage.local_root is None:
        raise UserError("the root is not on this machine; serve it with any web server and open benchmark/")
    click.launch(storage.path(name))
