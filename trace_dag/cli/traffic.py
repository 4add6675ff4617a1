"""Vehicles around crashes: ``traffic``."""

from __future__ import annotations

import sys
from dataclasses import asdict

import click

from trace_dag.cli.options import Within, examples, pass_root
from trace_dag.cli.printing import print_table, progress_of, write_json
from trace_dag.cli.study import Problems, into_warehouse
from trace_dag.common.errors import Failure
from trace_dag.common.messages.wording import last_line


@click.command(epilog=examples("trace-dag traffic", "trace-dag traffic --only 2023-510179 --factor 2 --seed 7"))
@click.option("--factor", type=Within(0, 10), default=1.0, show_default=True, help="Multiple of the usual volumes.")
@click.option("--seed", default=1, show_default=True, help="The same crash, factor and seed give the same traffic.")
@click.option("--cohort", help="Only crashes of this cohort.")
@click.option("--only", multiple=True, metavar="KEY", help="Only these crashes.")
@click.option("--json", "as_json", is_flag=True, help="What came of each crash, as JSON.")
@click.option("--workers", type=click.IntRange(min=1), help="Processes; default one per core.")
@pass_root
def traffic(
    root: str, factor: float, seed: int, cohort: str | None, only: tuple[str, ...], as_json: bool, workers: int | None
) -> None:
    """Put traffic around each verified crash, typical of its hour, day, area and roads; the crash stays as it is.

    SUMO (the extra sumo) drives the vehicles, which see the parties and react to them. They enter replays, packages,
    and the warehouse as table traffic.
    """
    from trace_dag.agents.stored_cases import verified_cases
    from trace_dag.agents.stored_traffic import make_traffic
    from trace_dag.agents.summaries import traffic_table
    from trace_dag.flow.workspace import Workspace
    from trace_dag.scenario.traffic.simulation import TrafficRequest

    workspace = Workspace.open(root, overrides={"execution": {"workers": workers} if workers else {}})
    problems = Problems()
    cases = verified_cases(workspace, cohort, only, departures=None, on_problem=problems.add)
    with progress_of("traffic", len(cases)) as on_progress:
        request = TrafficRequest(factor, seed)
        reports = make_traffic(workspace, cases, request, on_progress=lambda report: on_progress(report.key))
    into_warehouse(workspace, problems)
    if as_json:
        write_json([asdict(report) for report in reports])
    else:
        print_table(*traffic_table(reports)[:2])
    for report in reports:
        if report.error:
            problems.add(Failure(f"{report.key}: {last_line(report.error)}"))
    sys.exit(problems.print_all())
