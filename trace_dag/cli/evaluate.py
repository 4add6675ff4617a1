"""Agents in the place of a crash's drivers: ``evaluate``."""

from __future__ import annotations

import sys
from collections import Counter
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import TYPE_CHECKING

import click

from trace_dag.cli.options import (
    ManyValuesCommand,
    OutputFile,
    Within,
    agent_arguments,
    examples,
    pass_root,
    traffic_option,
)
from trace_dag.cli.printing import print_table, progress_of, say, write_json
from trace_dag.cli.study import Problems, into_warehouse
from trace_dag.common.errors import UserError
from trace_dag.common.messages.logs import print_problem
from trace_dag.common.storage.disk_errors import name_file_in_errors

if TYPE_CHECKING:
    from trace_dag.agents.evaluation.table import Row

_DIMENSIONS = ("collision_type", "road_topology", "vehicle_trajectory")
_FAULTS_SHOWN = 5


@click.command(
    cls=ManyValuesCommand,
    epilog=examples(
        "trace-dag evaluate --agent my_module:MyAgent --ego striking",
        "trace-dag evaluate --variations --by road_topology",
        "trace-dag evaluate --departures --agent idm",
        "trace-dag evaluate --courses --agent idm --traffic persistent",
        "trace-dag evaluate --agent my_module:MyAgent --split test --results results.json",
        "trace-dag evaluate --remove my_module:MyAgent",
    ),
)
@click.option(
    "--agent", "agents", multiple=True, metavar="NAME", help="A name, or module:Class; default the baselines."
)
@agent_arguments
@click.option(
    "--ego",
    type=click.Choice(["both", "first", "second", "striking", "struck"]),
    default="both",
    show_default=True,
    help="Whose place the agent takes, of the two that collided first; both takes one after the other.",
)
@click.option("--cohort", help="Only crashes of this cohort.")
@click.option("--only", multiple=True, metavar="KEY", help="Only these crashes.")
@click.option(
    "--split",
    type=click.Choice(["train", "validation", "test"]),
    help="Only this part of the crashes, split by place as in a release; see its PROTOCOL.md.",
)
@click.option(
    "--results",
    type=OutputFile(),
    help="Also write the results of a --split to this file, to hand in: leaderboard add takes it.",
)
@click.option(
    "--departures",
    is_flag=True,
    help="The crashes in which a vehicle left the road by itself instead: does the agent stay on it? Not on the "
    "leaderboard.",
)
@click.option("--variations", is_flag=True, help="The stored variations of the crashes instead of the crashes.")
@click.option(
    "--courses",
    is_flag=True,
    help="The likely courses of each crash instead of one: an agent's result is a probability.",
)
@click.option("--hz", "rate_hz", type=Within(20, 100), default=20.0, show_default=True, help="How often it acts.")
@click.option("--range-m", type=Within(min=0, max=10_000), default=150.0, show_default=True, help="How far it sees.")
@click.option(
    "--noise",
    "noise_m",
    type=Within(min=0, max=1_000),
    default=0.0,
    show_default=True,
    help="Standard deviation of the positions it sees, m; of velocities the same number in m/s.",
)
@click.option("--occlusion", is_flag=True, help="It does not see whom another body hides.")
@traffic_option
@click.option("--seed", type=click.IntRange(min=0), default=1, show_default=True, help="Seed of the noise.")
@click.option(
    "--time-limit",
    "time_limit_s",
    type=Within(min=0.1, max=86_400),
    default=20.0,
    show_default=True,
    help="Processor time of an agent in one evaluation, s; five times that in all. Beyond either it is faulty there.",
)
@click.option(
    "--memory-limit",
    "memory_limit_mb",
    type=click.IntRange(min=64, max=1_048_576),
    default=2048,
    show_default=True,
    help="MB of address space each process of an agent may take.",
)
@click.option(
    "--isolate",
    is_flag=True,
    help="For agents of strangers: no network, no other process, files only to read (namespaces of Linux).",
)
@click.option(
    "--by", type=click.Choice(_DIMENSIONS), default="collision_type", show_default=True, help="Classes of the table."
)
@click.option("--workers", type=click.IntRange(min=1), help="Processes; default one per core.")
@click.option("--remove", metavar="NAME", help="Delete the evaluations of this agent, and do nothing else.")
@click.option("--json", "as_json", is_flag=True, help="Every evaluation, as JSON.")
@pass_root
def evaluate(
    root: str,
    agents: tuple[str, ...],
    arguments: tuple[str, ...],
    ego: str,
    cohort: str | None,
    only: tuple[str, ...],
    split: str | None,
    results: Path | None,
    departures: bool,
    variations: bool,
    courses: bool,
    rate_hz: float,
    range_m: float,
    noise_m: float,
    occlusion: bool,
    traffic: str,
    seed: int,
    time_limit_s: float,
    memory_limit_mb: int,
    isolate: bool,
    by: str,
    workers: int | None,
    remove: str | None,
    as_json: bool,
) -> None:
    """Put agents into the verified crashes and see whether they avoid them.

    An agent drives one vehicle; the others move as recorded until somebody touches them, keep their distance
    (--traffic reactive), or come to the conflict when the agent does, however slow it is (--traffic persistent). Every
    evaluation enters the warehouse, as tables evaluations and leaderboard.
    """
    from trace_dag.agents.evaluation.agent_main import AgentLimits
    from trace_dag.agents.evaluation.evaluate import Conditions
    from trace_dag.agents.evaluation.isolation import isolation
    from trace_dag.agents.evaluation.observation import Sensing
    from trace_dag.agents.evaluation.registry import BASELINES, set_arguments
    from trace_dag.agents.evaluation.splits import Split
    from trace_dag.agents.evaluation.traffic import Traffic
    from trace_dag.agents.evaluations import evaluate_agents, remove_agent, try_agents
    from trace_dag.agents.stored_cases import AgentRole, likely_courses, stored_variations, verified_cases
    from trace_dag.agents.submissions import results_file
    from trace_dag.export.build import publish_leaderboard
    from trace_dag.flow.workspace import Workspace

    if split and (only or variations):
        raise UserError("--split takes a part as a whole; leave out --only and --variations")
    if departures and (split or variations):
        raise UserError("--departures cannot be combined with --split or --variations")
    if courses and (departures or variations or results):
        raise UserError("--courses are of crashes between parties; leave out --departures, --variations and --results")
    if results and not split:
        raise UserError("--results needs --split, since a submission has the runs of one part")
    sys.path.insert(0, str(Path.cwd()))  # where the module of an agent under development is
    workspace = Workspace.open(root, overrides={"execution": {"workers": workers} if workers else {}})
    problems = Problems()
    if remove is not None:
        rows_removed = remove_agent(workspace.storage, remove)
        into_warehouse(workspace, problems)
        publish_leaderboard(workspace.storage, workspace.warehouse)
        say(f"{rows_removed} evaluations of {remove} removed")
        sys.exit(problems.print_all())
    part = Split(split) if split else None
    cases = verified_cases(workspace, cohort, only, split=part, departures=departures, on_problem=problems.add)
    if variations:
        cases = stored_variations(workspace, cases, on_problem=problems.add)
    if courses:
        cases = likely_courses(cases)
    names = tuple(set_arguments(agent, arguments) for agent in agents or BASELINES)
    limits = AgentLimits(time_s=time_limit_s, memory_mb=memory_limit_mb)
    around = isolation(str(Path(root).absolute())) if isolate else None
    try_agents(names, limits, around)  # before anything begins
    roles = (AgentRole.FIRST, AgentRole.SECOND) if ego == "both" else (AgentRole(ego),)
    with progress_of("evaluations", len(cases) * len(names) * len(roles)) as on_progress:
        rows = evaluate_agents(
            workspace,
            cases,
            names,
            roles,
            Conditions(rate_hz, Sensing(range_m, noise_m, occlusion), seed, Traffic(traffic)),
            limits,
            split=part,
            isolation=around,
            on_progress=lambda row: on_progress(f"{row['agent']} in {row['case_id']}"),
            on_problem=problems.add,
        )
    into_warehouse(workspace, problems)
    publish_leaderboard(workspace.storage, workspace.warehouse)
    if results and part:
        with name_file_in_errors(results):
            results.write_bytes(results_file(rows, part, cohort))
    if as_json:
        write_json(rows)
    elif courses:
        _print_probabilities(workspace.warehouse, rows)
    else:
        classes = _classes(workspace.warehouse, by)
        _print_results(rows, lambda row: classes[row["key"]], by)
    sys.exit(problems.print_all())


def _classes(warehouse: Path, dimension: str) -> dict[str, str]:
    from trace_dag.warehouse.query import query

    return dict(query(warehouse, f"SELECT key, {dimension} FROM crashes")[1])  # noqa: S608 - one of ours


def _print_probabilities(warehouse: Path, rows: Sequence[Row]) -> None:
    """Print each agent's probabilities for each crash, and over all of them."""
    from trace_dag.agents.summaries import probabilities_table
    from trace_dag.warehouse.query import rows as rows_of

    driven = {(row["agent"], row["key"]) for row in rows}
    found = [row for row in rows_of(warehouse, "agent_probabilities") if (row["agent"], row["key"]) in driven]
    print_table(*probabilities_table(found)[:2])


def _print_results(rows: Sequence[Row], class_of: Callable[[Row], str], dimension: str) -> None:
    """Print the outcomes of each agent, in total and by class of crash, and the faults."""
    from trace_dag.agents.summaries import evaluations_table

    print_table(*evaluations_table(rows, class_of, dimension)[:2])
    faults = Counter((row["agent"], row["fault"]) for row in rows if row["fault"])
    for (agent, fault), count in faults.most_common(_FAULTS_SHOWN):
        print_problem(f"{agent} faulty in {count}: {fault}")
    if len(faults) > _FAULTS_SHOWN:
        print_problem(f'... and {len(faults) - _FAULTS_SHOWN} other faults; trace-dag sql "FROM evaluations"')
