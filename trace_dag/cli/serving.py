"""The Dagster UI on a storage root: ``ui``."""

from __future__ import annotations

import os
import sys

import click


@click.command()
@click.option("--host", default="127.0.0.1", show_default=True, help="Address to listen on.")
@click.option("--port", default=3000, show_default=True, help="Port to listen on.")
@click.pass_obj
def ui(root: str, host: str, port: int) -> None:
    """Open the Dagster UI on this storage root: the web server, and the daemon that runs what is launched there."""
    from trace_dag.assets.launch import open_instance
    from trace_dag.assets.partitions import add_partitions
    from trace_dag.pipeline.home import Home
    from trace_dag.pipeline.stages import FLOW

    home = Home(root, FLOW)
    with open_instance(home) as instance:
        add_partitions(instance, home.pipeline().registry.keys())
    click.echo(f"Dagster UI on http://{host}:{port} for {home.root} (Ctrl-C ends it)")
    os.chdir(home.dagster_home)
    command = [sys.executable, "-m", "dagster", "dev", "-m", "trace_dag.definitions", "-h", host, "-p", str(port)]
    # In place of this process, so that a signal sent to it reaches the servers.
    os.execv(sys.executable, command)  # noqa: S606 - our own interpreter
