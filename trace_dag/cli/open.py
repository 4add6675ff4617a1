"""The benchmark page in a browser: ``open``."""

from __future__ import annotations

from dataclasses import replace

import click

from trace_dag.cli.options import examples, pass_root
from trace_dag.cli.printing import say
from trace_dag.cli.progress import progress_bar
from trace_dag.common.errors import UserError
from trace_dag.common.messages.logs import print_problem


@click.command("open", epilog=examples("trace-dag open", "trace-dag open 2023-510179"))
@click.argument("key", required=False)
@pass_root
def open_page(root: str, key: str | None) -> None:
    """Open the benchmark page in a browser, or the page of one crash, and print where it is.

    Runs make no pages if there are more crashes than execution.pages_up_to; this command makes them.
    """
    from trace_dag.crash.keys import parse_key
    from trace_dag.export.build import INDEX, build_benchmark, page_name
    from trace_dag.flow.workspace import Workspace

    workspace = Workspace.open(root, to_read=True)
    storage = workspace.storage
    if key is not None:
        parse_key(key)
    name = INDEX if key is None else page_name(key)
    if not workspace.pages_in_runs and workspace.warehouse.is_file():
        with progress_bar("pages") as on_progress:
            errors = build_benchmark(replace(workspace, page_listener=on_progress)).errors
        for of_crash, error in errors.items():
            print_problem(f"no page of {of_crash}: {error.strip().splitlines()[-1]}")
    if not storage.exists(name):
        raise UserError(f"{storage.path(name)}: there is no such page yet; trace-dag run makes it")
    say(storage.path(name))
    if storage.local_root is None:
        raise UserError("the root is not on this machine; serve it with any web server and open benchmark/")
    click.launch(storage.path(name))
