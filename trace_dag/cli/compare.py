"""Estimators side by side: ``compare``."""

from __future__ import annotations

import sys
from pathlib import Path
from typing import TYPE_CHECKING

import click

from trace_dag.cli.options import examples, execution_overrides, executor_options
from trace_dag.cli.printing import print_table, write_json
from trace_dag.cli.progress import progress_told

if TYPE_CHECKING:
    from trace_dag.states.compare import EstimatorSummary
    from trace_dag.studies.truth import SampleTruth


@click.command(
    epilog=examples(
        "trace-dag compare --estimators analytic,llm --cohort virginia",
    )
)
@click.option(
    "--estimators",
    default="analytic,llm",
    show_default=True,
    help="Separated by commas: analytic, llm, llm:PROMPT, llm@MODEL. The first is what the others are compared with.",
)
@click.option("--cohort", help="Which cohort; can be left out if there is but one.")
@click.option(
    "--truth",
    type=click.Path(exists=True, dir_okay=False, path_type=Path),
    help="A truth.json to measure against; the bundled sample is measured against its own.",
)
@click.option("--json", "as_json", is_flag=True, help="Every crash of every estimator, as JSON.")
@executor_options
@click.pass_obj
def compare(
    root: str,
    estimators: str,
    cohort: str | None,
    truth: Path | None,
    as_json: bool,
    executor: str | None,
    workers: int | None,
) -> None:
    """Let several estimators estimate the same mapped crashes, simulate and judge each, and compare.

    The estimates stay side by side in the folder estimators/ of the root, and every row enters the warehouse, as table
    estimator_comparison. What the crashes' own artefacts say does not change.
    """
    from dataclasses import asdict

    from trace_dag.cli.complaints import Complaints
    from trace_dag.errors import Failure
    from trace_dag.flow.workspace import Workspace
    from trace_dag.states.compare import summarise
    from trace_dag.studies.estimators import estimators_compared
    from trace_dag.warehouse.build import build_warehouse

    workspace = Workspace.open(root)
    workspace = workspace.with_settings({"execution": execution_overrides(executor, workers)})
    chosen = cohort or _only_cohort(list(workspace.registry.cohorts()), root)
    names = [name.strip() for name in estimators.split(",") if name.strip()]
    with progress_told("crashes") as tell:
        rows = estimators_compared(workspace, chosen, names, truth=_truth(truth, chosen), listener=tell)
    complaints = Complaints()
    build_warehouse(workspace.storage, workspace.local_folder, complain=complaints.hear)
    for row in rows:
        if row.outcome == "failed":
            complaints.hear(Failure(f"{row.key} with {row.estimator}: {row.detail}"))
    if as_json:
        write_json([{"cohort": chosen, **asdict(row)} for row in rows])
        sys.exit(complaints.told())
    columns = [_column(summary) for summary in summarise(rows)]
    shown = [name for name in columns[0] if any(column[name] for column in columns)]
    print_table(["", *names], [(name, *(column[name] for column in columns)) for name in shown])
    sys.exit(complaints.told())


def _only_cohort(names: list[str], root: str) -> str:
    from trace_dag.errors import UserError

    if len(names) != 1:
        raise UserError(
            f"{root} holds {len(names)} cohorts; say which with --cohort" + (f": {', '.join(names)}" if names else "")
        )
    return names[0]


def _truth(given: Path | None, cohort: str) -> SampleTruth | None:
    from trace_dag.cli.sample import COHORT, sample_folder
    from trace_dag.studies.truth import load_truth

    if given is None and cohort == COHORT:
        given = sample_folder() / "truth.json"
    return load_truth(given) if given is not None else None


def _column(summary: EstimatorSummary) -> dict[str, str]:
    return {
        "crashes": str(summary.crashes),
        "estimated": str(summary.estimated),
        "rejected": str(summary.rejected or ""),
        "failed": str(summary.failed or ""),
        "same approaches": _percent(summary.approach_agreement),
        "same lanes": _percent(summary.lane_agreement),
        "all checks passed": _percent(summary.all_checks_passed),
        "accepted by the verdict": _percent(summary.accepted),
        "answers per crash": "" if not summary.tokens else f"{summary.mean_attempts or 0:.2f}",
        "fallbacks": str(summary.fallbacks or ""),
        "tokens": f"{summary.tokens:,}" if summary.tokens else "",
        "cost, USD": f"{summary.cost_usd:.4f}" if summary.tokens else "",
        "true approaches": _percent(summary.approach_correct),
        "true lanes": _percent(summary.lane_correct),
        "impact point off, median m": _number(summary.median_impact_point_error_m),
        "heading off, median degrees": _number(summary.median_heading_error_deg),
        "initial position off, median m": _number(summary.median_initial_position_error_m),
    }


def _percent(share: float | None) -> str:
    return "" if share is None else f"{100 * share:.1f} %"


def _number(value: float | None) -> str:
    return "" if value is None else f"{value:.2f}"
