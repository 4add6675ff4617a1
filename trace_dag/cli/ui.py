"""The Dagster UI on a storage root: ``ui``."""

from __future__ import annotations

import os
import socket
import sys

import click

from trace_dag.cli.options import examples, pass_root
from trace_dag.common.errors import UserError


@click.command(epilog=examples("trace-dag ui", "trace-dag --root virginia ui --port 3001"))
@click.option("--host", default="127.0.0.1", show_default=True, help="Address to listen on.")
@click.option("--port", default=3000, show_default=True, help="Port to listen on.")
@click.option(
    "--allow-host", "allowed", multiple=True, metavar="NAME", help="A further name it is reached by, as by a proxy."
)
@click.option("--read-only", is_flag=True, help="To look at: nothing can be run, changed or deleted.")
@pass_root
def ui(root: str, host: str, port: int, allowed: tuple[str, ...], read_only: bool) -> None:
    """Open the Dagster UI on this storage root: the web server, and the daemon that runs what is launched there.

    It accepts requests only to its own names and from its own pages. It has no users: anyone who can reach the port may
    do anything.
    """
    from trace_dag.assets.automation import schedules
    from trace_dag.assets.launch import dagster_records
    from trace_dag.assets.run_requests import add_partitions
    from trace_dag.flow.workspace import Workspace

    _refuse_port_in_use(host, port)
    workspace = Workspace.open(root, to_read=read_only)
    schedules(workspace.settings.automation)  # a mistake in them is one line here, and a traceback of Dagster's servers
    with dagster_records(workspace) as instance:
        add_partitions(instance, workspace.registry.keys())
    os.environ["DAGSTER_HOME"] = str(workspace.dagster_home)
    os.environ.setdefault("PYTHONWARNINGS", "ignore")  # Dagster's to its own developers, one for each process
    command = [sys.executable, "-m", "trace_dag.assets.webserver", str(workspace.root), host, str(port)]
    command += ["read-only" if read_only else "-", *allowed]
    # In place of this process, so that a signal sent to it reaches the servers.
    os.execv(sys.executable, command)  # noqa: S606 - our own interpreter


def _refuse_port_in_use(host: str, port: int) -> None:
    with socket.socket() as probe:
        probe.setsockopt(socket.SOL_SOCKET, socket.SO_REUSEADDR, 1)
        try:
            probe.bind((host, port))
        except OSError as error:
            raise UserError(
                f"ui: cannot listen on {host}:{port} ({error.strerror}); choose another with --port"
            ) from error
