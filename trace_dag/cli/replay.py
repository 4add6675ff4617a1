"""A crash to watch: ``replay``."""

from __future__ import annotations

import sys
from pathlib import Path
from typing import TYPE_CHECKING, cast

import click

from trace_dag.cli.options import OutputFile, agent_arguments, examples, kind_of_file, pass_root, traffic_option
from trace_dag.cli.printing import say
from trace_dag.common.storage.disk_errors import name_file_in_errors

if TYPE_CHECKING:
    from trace_dag.agents.replays import ReplayFormat

_FORMATS = ("html", "glb", "webp")


@click.command(
    epilog=examples(
        "trace-dag replay 2023-510179",
        "trace-dag replay 2023-510179 --agent idm --ego struck --format webp",
        "trace-dag replay 2023-510179 --agent idm --agent brake",
        "trace-dag replay 2023-510179-c02 --agent idm --traffic persistent",
    )
)
@click.argument("key")
@click.option(
    "--format",
    "replay_format",
    type=click.Choice(_FORMATS),
    help="A page with a time slider, glTF in three dimensions, or an animated picture; else the file's name says it, "
    "and a page is written without one.",
)
@click.option(
    "--agent",
    "agents",
    multiple=True,
    metavar="NAME",
    help="With an agent at one of the wheels: a name, or module:Class; several beside each other.",
)
@agent_arguments
@click.option(
    "--ego",
    type=click.Choice(["first", "second", "striking", "struck"]),
    default="first",
    show_default=True,
    help="Whose place the agent takes.",
)
@traffic_option
@click.option("--output", type=OutputFile(), help="Where to; else ./replay-KEY.FORMAT.")
@pass_root
def replay(
    root: str,
    key: str,
    replay_format: ReplayFormat | None,
    agents: tuple[str, ...],
    arguments: tuple[str, ...],
    ego: str,
    traffic: str,
    output: Path | None,
) -> None:
    """Write a simulated crash to watch, from above and in three dimensions: roads, vehicles, contact and speeds.

    With an agent, KEY may also be a variation or likely course, as evaluations name them.
    """
    from trace_dag.agents.evaluation.registry import set_arguments
    from trace_dag.agents.evaluation.traffic import Traffic
    from trace_dag.agents.replays import replay as made_of
    from trace_dag.agents.replays import replay_with
    from trace_dag.agents.stored_cases import AgentRole
    from trace_dag.flow.stored_crashes import stored_crash
    from trace_dag.flow.workspace import Workspace

    replay_format = cast("ReplayFormat", kind_of_file("replay", output, replay_format, _FORMATS) or _FORMATS[0])
    workspace = Workspace.open(root, to_read=True)
    if not agents:
        content = made_of(stored_crash(workspace, key), replay_format)
    else:
        sys.path.insert(0, str(Path.cwd()))  # where the module of an agent under development is
        content = replay_with(
            workspace,
            key,
            [set_arguments(agent, arguments) for agent in agents],
            AgentRole(ego),
            Traffic(traffic),
            replay_format,
        )
    target = output or Path(f"replay-{key}.{replay_format}")
    with name_file_in_errors(target):
        target.write_bytes(content)
    say(f"{target}  {len(content) // 1024} kB")
