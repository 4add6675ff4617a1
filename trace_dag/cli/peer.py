"""Beside a published benchmark: ``peer``."""

from __future__ import annotations

import sys
from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING

import click

from trace_dag.cli.options import examples
from trace_dag.cli.printing import print_table, write_json

if TYPE_CHECKING:
    from trace_dag.settings import RuleSetName
    from trace_dag.verdict.peer import ComparisonRow
from trace_dag.cli.cohorts_compared import cohorts_of, judged_by, of_each, rules_option, workspace_of


@click.command(
    epilog=examples(
        "trace-dag peer published/ --cohort virginia",
    )
)
@click.argument("folder", type=click.Path(exists=True, file_okay=False, path_type=Path))
@click.option("--cohort", help="The cohort that holds the same cases; else each by itself.")
@rules_option
@click.option("--json", "as_json", is_flag=True, help="Every crash of both, as JSON.")
@click.pass_obj
def peer(root: str, folder: Path, cohort: str | None, rules: RuleSetName | None, as_json: bool) -> None:
    """Run a published benchmark's scenarios on its own maps, judged by the same rules, beside ours.

    FOLDER holds simulations/ and maps/. Every judgement enters the warehouse, as table benchmark_comparison. Cases in
    whose report no two vehicles touch are left out of both and named.
    """
    from dataclasses import asdict

    from trace_dag.cli.complaints import Complaints
    from trace_dag.studies.peer import published_comparison
    from trace_dag.warehouse.build import build_warehouse

    workspace, complaints = workspace_of(root), Complaints()
    compared = of_each(
        cohorts_of(workspace, cohort),
        lambda name: published_comparison(judged_by(workspace, rules), name, folder, complain=complaints.hear),
        complaints,
    ).values()
    found = [row for each in compared for row in each.rows]
    left_out = {key: why for each in compared for key, why in each.left_out.items()}
    build_warehouse(workspace.storage, workspace.local_folder, complain=complaints.hear)
    if left_out:
        click.echo(f"{len(left_out)} left out of both, no collision of two vehicles by their reports:", err=True)
        for key, why in left_out.items():
            click.echo(f"  {key}  {why}", err=True)
    if as_json:
        write_json([asdict(row) for row in found])
        sys.exit(complaints.told())
    names = sorted({row.benchmark for row in found})
    columns = [_peer_column([row for row in found if row.benchmark == name]) for name in names]
    print_table(["", *names], [(title, *(column[title] for column in columns)) for title in columns[0]])
    sys.exit(complaints.told())


def _peer_column(rows: Sequence[ComparisonRow]) -> dict[str, str]:
    def share(good: Sequence[bool | None]) -> str:
        known = [each for each in good if each is not None]
        return f"{sum(known)} of {len(known)}"

    return {
        "crashes": str(len(rows)),
        "contact": share([row.contact for row in rows]),
        "first contact within the threshold": share([row.within_distance for row in rows]),
        "impacts as reported": share([bool(row.clocks_ok) for row in rows]),
        "both": share([row.within_distance and bool(row.clocks_ok) for row in rows]),
        "both speeds kept, where both are reported": share([row.speeds_kept for row in rows]),
        "accepted": share([row.accepted for row in rows]),
    }
