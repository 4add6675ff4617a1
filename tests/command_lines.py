"""What the command line makes of words somebody types, without doing it."""

from __future__ import annotations

import click

from trace_dag.cli.main import cli


def taken_by(words: list[str]) -> click.Command:
    """The command that takes these words, its options and arguments checked. Raises click's UsageError."""
    context = click.Context(cli, info_name="trace-dag")
    cli.parse_args(context, words)
    command: click.Command = cli
    rest = [*context._protected_args, *context.args]
    while isinstance(command, click.Group):
        _, found, rest = command.resolve_command(context, rest)
        assert found is not None
        command = found
    command.make_context(command.name, rest, parent=context)
    return command
