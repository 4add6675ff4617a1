"""Every command tells what it does, what each option means, and shows command lines that it would take."""

from __future__ import annotations

import re
import shlex
from collections.abc import Iterator

import click
import pytest
from click.testing import CliRunner
from command_lines import taken_by
from sample_runs import trace_dag_process

from trace_dag.cli.main import cli

EXAMPLE = re.compile(r"^ +trace-dag (.+)$", re.MULTILINE)


def commands(group: click.Group = cli, path: tuple[str, ...] = ()) -> Iterator[tuple[tuple[str, ...], click.Command]]:
    for name in group.list_commands(click.Context(group)):
        command = group.get_command(click.Context(group), name)
        yield (*path, name), command
        if isinstance(command, click.Group):
            yield from commands(command, (*path, name))


COMMANDS = {" ".join(path): command for path, command in commands()}


@pytest.mark.parametrize("name", COMMANDS)
def test_help_names_what_the_command_does_and_what_each_option_means(name):
    command = COMMANDS[name]
    assert command.help
    for parameter in command.params:
        if isinstance(parameter, click.Option):
            assert parameter.help, parameter.name


@pytest.mark.parametrize("name", COMMANDS)
def test_help_ends_with_examples_the_command_would_take(name, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    (tmp_path / "published").mkdir()  # a folder and a file that have to be there for an example to be taken
    (tmp_path / "FARS2015-accident.zip").touch()
    done = CliRunner().invoke(cli, [*name.split(), "--help"])
    assert done.exit_code == 0, done.output
    examples = EXAMPLE.findall(done.output.partition("\n  Example")[2])
    assert examples
    for example in examples:
        assert taken_by(shlex.split(example)) is COMMANDS[name] or isinstance(COMMANDS[name], click.Group), example


def test_help_touches_no_root(tmp_path):
    done = trace_dag_process(tmp_path / "root", "run", "--help")
    assert done.returncode == 0
    assert not list(tmp_path.iterdir())
