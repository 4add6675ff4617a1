"""Studies as commands of this folder, with the root option and the error lines of ``trace-dag``."""

from __future__ import annotations

import sys

import click

from trace_dag.cli.main import cli, main


def run_study(command: click.Command) -> None:
    """Run a study on the root of ``python -m lab --root DIR NAME``; its arguments are those after the name."""
    name = sys.argv[0].removeprefix("lab ")
    cli.add_command(command, name)
    sys.argv = ["lab", name, *sys.argv[1:]]
    main("python -m lab")
