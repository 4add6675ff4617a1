"""Options and arguments that several commands share."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable, Mapping
from functools import wraps
from pathlib import Path
from typing import Any, TypeVar, cast

import click

from trace_dag.common.errors import UserError
from trace_dag.common.plugins import resolve_reference
from trace_dag.common.stage import Stage

F = TypeVar("F", bound=Callable[..., Any])


def examples(*lines: str) -> str:
    """Return the command lines to end a command's help with, as its ``epilog``."""
    # After \b click keeps the lines as they are.
    return "\n".join(("\b", "Examples:" if len(lines) > 1 else "Example:", *(f"  {line}" for line in lines)))


class GroupedCommands(click.Group):
    """A group whose help lists its commands under headings.

    A command's module is imported when the command is asked for: all of them together take a tenth of a second.
    """

    def __init__(self, *args: Any, commands_by_heading: Mapping[str, Mapping[str, str]], **settings: Any) -> None:
        super().__init__(*args, **settings)
        self._by_heading = commands_by_heading
        self._references = {name: each for names in commands_by_heading.values() for name, each in names.items()}

    def list_commands(self, ctx: click.Context) -> list[str]:
        """Return the names in the order of the headings, which puts the first steps first."""
        return [*self._references, *super().list_commands(ctx)]

    def get_command(self, ctx: click.Context, cmd_name: str) -> click.Command | None:
        """Return a command; None if there is none of that name."""
        if reference := self._references.get(cmd_name):
            command: click.Command = resolve_reference(f"trace_dag.cli.{reference}")
            return command
        return super().get_command(ctx, cmd_name)

    def format_commands(self, ctx: click.Context, formatter: click.HelpFormatter) -> None:
        """Write a section for each heading, each command with its whole first sentence."""
        for heading, names in self._by_heading.items():
            with formatter.section(heading):
                commands = {name: self.get_command(ctx, name) for name in names}
                formatter.write_dl([(name, each.get_short_help_str(200)) for name, each in commands.items() if each])


class ManyValuesCommand(click.Command):
    """A command whose repeatable options also take several values at once: ``--maps A B`` is ``--maps A --maps B``.

    For commands without positional arguments, where that can mean nothing else.
    """

    def parse_args(self, ctx: click.Context, args: list[str]) -> list[str]:
        """Repeat the option's name before each further value."""
        many = {
            name
            for parameter in self.params
            if isinstance(parameter, click.Option) and parameter.multiple and parameter.nargs == 1
            for name in parameter.opts
        }
        spread: list[str] = []
        option, values = "", 0
        for arg in args:
            if arg.startswith("-"):
                option, values = (arg if arg in many else ""), 0
            elif option:
                if values:
                    spread.append(option)
                values += 1
            spread.append(arg)
        return super().parse_args(ctx, spread)


class Within(click.FloatRange):
    """A number between two others. Unlike click's own type it does not take NaN, which is neither below nor above."""

    name = "number"

    def convert(self, value: Any, param: click.Parameter | None, ctx: click.Context | None) -> float:
        """Return the number."""
        number = float(super().convert(value, param, ctx))
        if math.isnan(number):
            self.fail(f"{value} is not in the range {self._describe_range()}.", param, ctx)
        return number


def pass_root(command: F) -> F:
    """Pass a command the storage root, which has to exist.

    Only demo, ingest and map start without a root.
    """

    @click.pass_obj
    @wraps(command)
    def on_root(root: str, /, *arguments: Any, **options: Any) -> Any:
        from trace_dag.common.storage.files import Storage

        Storage.open(root, to_read=True)
        return command(root, *arguments, **options)

    return cast("F", on_root)


class OutputFile(click.Path):
    """A file to write.

    Its folder exists, it replaces no file of the storage root, and its extension, if any, is a known kind. This is
    checked before the work is done.
    """

    def __init__(self) -> None:
        super().__init__(dir_okay=False, path_type=Path)

    def convert(self, value: Any, param: click.Parameter | None, ctx: click.Context | None) -> Any:
        """See :class:`click.ParamType`."""
        path = cast(Path, super().convert(value, param, ctx))
        if not path.parent.is_dir():
            self.fail(f"{path}: there is no folder {path.parent}; make it first", param, ctx)
        root = ctx.obj if ctx is not None and isinstance(ctx.obj, str) else ""
        if root and path.exists() and path.resolve().is_relative_to(Path(root).resolve()):
            self.fail(f"{path} is a file of the storage root, which is not written over; name another", param, ctx)
        return path


def kind_of_file(command: str, path: Path | None, chosen: str | None, kinds: Iterable[str]) -> str | None:
    """Return the kind of file to write: the one chosen, or the one of the file's extension.

    None if neither is given. Raises :class:`UserError` for an unknown extension.
    """
    if path is None or chosen is not None:
        return chosen
    named = path.suffix.lower().removeprefix(".")
    if named not in kinds:
        raise UserError(f"{command}: {path}: name the file .{', .'.join(kinds)}, or say its kind with --format")
    return named


def stage_option(*names: str, help: str) -> Callable[[F], F]:
    """Return an option whose value is the name of a stage."""

    def as_stage(_context: click.Context, _parameter: click.Parameter, value: str | None) -> Stage | None:
        return Stage(value) if value else None

    return click.option(*names, type=click.Choice([stage.value for stage in Stage]), callback=as_stage, help=help)


def executor_options(command: F) -> F:
    """Add the options of execution, over the settings of the root."""
    command = click.option("--workers", type=click.IntRange(min=1), help="Processes; default one per core.")(command)
    return click.option(
        "--executor",
        type=click.Choice(["in_process", "processes", "dask"]),
        help="Where the work runs; default processes.",
    )(command)


def estimator_option(command: F) -> F:
    """Add the option of the estimator, over the settings of the root."""
    return click.option(
        "--estimator", metavar="NAME", help="How states are estimated, for this run; trace-dag plugins lists the names."
    )(command)


def run_overrides(executor: str | None, workers: int | None, estimator: str | None) -> dict[str, Any]:
    """Return the options of a run as settings."""
    states = {"states": {"estimator": estimator}} if estimator else {}
    return {"execution": execution_overrides(executor, workers), **states}


def execution_overrides(executor: str | None, workers: int | None) -> dict[str, Any]:
    """Return the executor options as settings."""
    return {name: value for name, value in (("executor", executor), ("workers", workers)) if value is not None}


traffic_option = click.option(
    "--traffic",
    type=click.Choice(["recorded", "reactive", "persistent", "surrounding"]),
    default="recorded",
    show_default=True,
    help="The others do as recorded, keep their distance once the agent does something else, or keep the conflict: "
    "they come when it comes; or do as recorded among the vehicles that trace-dag traffic put around the crash.",
)

agent_arguments = click.option(
    "--agent-arg",
    "arguments",
    multiple=True,
    metavar="NAME=VALUE",
    help="An argument for the class of the agent, as text, such as checkpoint=a.pt.",
)
