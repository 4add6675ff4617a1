"""Estimators side by side on the same mapped crashes: ``python -m lab compare_estimators``."""

from __future__ import annotations

import sys
from collections.abc import Sequence
from dataclasses import asdict
from pathlib import Path
from typing import Any

import click

from lab.commands import run_study
from lab.estimator_rows import EstimatorRow, EstimatorSummary, summarise
from lab.estimators import estimators_compared, usual_estimators
from lab.truth.vehicles import SampleTruth, load_truth
from trace_dag.cli.demo import COHORT, sample_folder
from trace_dag.cli.options import examples, execution_overrides, executor_options, pass_root
from trace_dag.cli.printing import print_table, progress_bar, write_json
from trace_dag.cli.study import Problems, into_warehouse
from trace_dag.common.errors import Failure, UserError
from trace_dag.common.messages.wording import percent
from trace_dag.flow.workspace import Workspace
from trace_dag.language.client import KEY_MISSING

_WITHOUT_KEY = (
    "without a key: python -m lab score_truth compares the crashes of the bundled sample with their truth, and "
    "--estimators analytic,llm@ollama/MODEL asks a model on this machine"
)


@click.command(
    epilog=examples(
        "python -m lab compare_estimators --estimators analytic,llm --cohort virginia",
    )
)
@click.option(
    "--estimators",
    help="Separated by commas: analytic, llm, llm:PROMPT, llm@MODEL, one of another package; default all that are "
    "installed, that of the settings first. The first is what the others are compared with.",
)
@click.option("--cohort", help="Which cohort; can be left out if there is but one.")
@click.option(
    "--truth",
    type=click.Path(exists=True, dir_okay=False, path_type=Path),
    help="A truth.json to measure against; the bundled sample is measured against its own.",
)
@click.option("--json", "as_json", is_flag=True, help="Every crash of every estimator, as JSON.")
@executor_options
@pass_root
def compare_estimators(
    root: str,
    estimators: str | None,
    cohort: str | None,
    truth: Path | None,
    as_json: bool,
    executor: str | None,
    workers: int | None,
) -> None:
    """Let several estimators estimate the same mapped crashes, simulate and judge each, and compare.

    The estimates stay side by side in the folder estimators/ of the root, and every row enters the warehouse, as
    table estimator_comparison. The crashes' own artefacts do not change."""

    workspace = Workspace.open(root, overrides={"execution": execution_overrides(executor, workers)})
    chosen = cohort or only_cohort(list(workspace.registry.cohorts()), root)
    names = [name.strip() for name in (estimators or "").split(",") if name.strip()]
    names = names or usual_estimators(workspace.settings.states)
    with progress_bar("crashes") as on_progress:
        try:
            rows = estimators_compared(workspace, chosen, names, truth=_truth(truth, chosen), listener=on_progress)
        except UserError as error:
            if KEY_MISSING in str(error):
                raise UserError(f"{error}; {_WITHOUT_KEY}") from error
            raise
    problems = Problems()
    into_warehouse(workspace, problems)
    for row in rows:
        if row.outcome == "failed":
            problems.add(Failure(f"{row.key} with {row.estimator}: {row.detail}"))
    if as_json:
        write_json([{"cohort": chosen, **asdict(row)} for row in rows])
        sys.exit(problems.print_all())
    print_table(*estimators_table(rows))
    sys.exit(problems.print_all())


def only_cohort(names: list[str], root: str) -> str:
    """Return the one cohort of a root.

    Raises UserError where there are several, or none.
    """
    if not names:
        raise UserError(f"{root} holds no cohort yet; trace-dag ingest registers one")
    if len(names) > 1:
        raise UserError(f"{root} holds {len(names)} cohorts; say which with --cohort: {', '.join(names)}")
    return names[0]


def _truth(given: Path | None, cohort: str) -> SampleTruth | None:

    if given is None and cohort == COHORT:
        given = sample_folder() / "truth.json"
    return load_truth(given) if given is not None else None


def estimators_table(rows: Sequence[EstimatorRow]) -> tuple[list[str], list[tuple[Any, ...]]]:
    """Return estimators side by side, a column each; lines that say nothing of any are left out."""
    summaries = summarise(rows)
    columns = [_estimator_column(summary) for summary in summaries]
    shown = [name for name in columns[0] if any(column[name] for column in columns)]
    rows_shown = [(name, *(column[name] for column in columns)) for name in shown]
    return ["", *(summary.estimator for summary in summaries)], rows_shown


def _estimator_column(summary: EstimatorSummary) -> dict[str, str]:
    return {
        "crashes": str(summary.crashes),
        "estimated by itself": str(summary.estimated),
        "estimated by another in its place": str(summary.fallbacks or ""),
        "rejected": str(summary.rejected or ""),
        "failed": str(summary.failed or ""),
        "same approaches": percent(summary.approach_agreement),
        "same lanes": percent(summary.lane_agreement),
        "all checks passed": percent(summary.all_checks_passed),
        "accepted by the verdict": percent(summary.accepted),
        "answers per crash": "" if not summary.tokens else f"{summary.mean_attempts or 0:.2f}",
        "tokens": f"{summary.tokens:,}" if summary.tokens else "",
        "cost, USD": f"{summary.cost_usd:.4f}" if summary.tokens else "",
        "true approaches": percent(summary.approach_correct),
        "true lanes": percent(summary.lane_correct),
        "impact point off, median m": _number(summary.median_impact_point_error_m),
        "heading off, median degrees": _number(summary.median_heading_error_deg),
        "initial position off, median m": _number(summary.median_initial_position_error_m),
    }


def _number(value: float | None) -> str:
    return "" if value is None else f"{value:.2f}"


if __name__ == "__main__":
    run_study(compare_estimators)
