"""The bundled sample: ``demo`` and ``score-truth``."""

from __future__ import annotations

import shlex
import sys
import time
from dataclasses import asdict
from pathlib import Path
from typing import Any

import click

from trace_dag.cli.options import examples, execution_overrides, executor_options
from trace_dag.cli.printing import print_table, write_json
from trace_dag.errors import DamagedFile, Stage, UserError

COHORT = "sample"


def sample_folder() -> Path:
    """Where the sample lies: in the installed package, or in the repository beside it."""
    package = Path(__file__).resolve().parents[1]
    for folder in (package / "sample_data" / "sample", package.parent / "data" / "sample"):
        if (folder / "truth.json").is_file():
            return folder
    raise UserError("the bundled sample is not installed; expected it in trace_dag/sample_data/sample")


@click.command(
    epilog=examples(
        "trace-dag --root demo demo",
    )
)
@executor_options
@click.pass_context
def demo(context: click.Context, executor: str | None, workers: int | None) -> None:
    """Run the bundled sample: a fictional town and crashes whose true course is known.

    Registers it as cohort "sample", runs it through all stages, and prints the funnel, the coverage and where to look.
    """
    from trace_dag.cli.ingesting import ingest
    from trace_dag.cli.running import carry_out
    from trace_dag.pipeline.benchmark import INDEX
    from trace_dag.pipeline.home import Home
    from trace_dag.pipeline.selection import select_stale
    from trace_dag.pipeline.stages import FLOW
    from trace_dag.warehouse.query import query

    root, began, folder = context.obj, time.monotonic(), sample_folder()
    context.invoke(ingest, reports=(str(folder / "reports"),), maps=(str(folder / "osm"),), cohort=COHORT)
    settings = {"execution": execution_overrides(executor, workers)}
    code = carry_out(root, settings, lambda pipeline: select_stale(pipeline, COHORT))
    home = Home(root, FLOW)
    storage = home.pipeline().storage
    if not storage.exists(INDEX):  # what went wrong is told
        sys.exit(code)
    click.echo()
    print_table(*query(home.warehouse, "SELECT * FROM coverage"))
    click.echo(f"\nDone in {time.monotonic() - began:.0f} s. Where to look:")
    click.echo(f"  {storage.path(INDEX)}  the crashes, each with its page, replay and package")
    for command, shows in (
        ("ui", "the same as Dagster assets"),
        ('sql "FROM verdicts"', "any question, in SQL"),
        ("score-truth", "how close the estimates come to the truth"),
    ):
        click.echo(f"  trace-dag --root {shlex.quote(root)} {command}  {shows}")
    sys.exit(code)


@click.command(
    "score-truth",
    epilog=examples(
        "trace-dag --root demo score-truth",
    ),
)
@click.option("--json", "as_json", is_flag=True, help="Every vehicle of every crash, as JSON.")
@click.pass_obj
def score_truth(root: str, as_json: bool) -> None:
    """Compare the estimates of the bundled sample with the truth it was made from."""
    from trace_dag.cli.complaints import Complaints
    from trace_dag.pipeline.flow import read_artefact
    from trace_dag.pipeline.home import Home
    from trace_dag.pipeline.records import read_records
    from trace_dag.pipeline.stages import FLOW
    from trace_dag.pipeline.standing import standing, valid_records
    from trace_dag.pipeline.truth import load_truth
    from trace_dag.pipeline.truth import score_truth as score
    from trace_dag.states.json_io import estimate_from_json
    from trace_dag.verdict.json_io import verdict_from_json

    truth = load_truth(sample_folder() / "truth.json")
    storage = Home(root, FLOW).pipeline().storage
    complaints = Complaints()
    records = read_records(storage, truth.by_key, complain=complaints.hear)
    if not any(records.values()):
        raise UserError(f"the sample has not been run in {storage.root}; trace-dag demo runs it")
    estimates, hypotheses, outcomes = {}, {}, {}
    for key, of_crash in records.items():
        valid, stand = valid_records(of_crash), standing(key, of_crash)
        outcomes[key] = (stand.final_state.value, stand.reason.value if stand.reason else None)
        try:
            if (record := valid.get(Stage.STATE_ESTIMATE)) and (file := record.artefact("json")):
                estimate = estimate_from_json(read_artefact(storage, record, file))
                if (record := valid.get(Stage.VERDICT)) and (file := record.artefact("json")):
                    hypotheses[key] = verdict_from_json(read_artefact(storage, record, file)).hypothesis
                estimates[key] = estimate
        except DamagedFile as damaged:
            complaints.hear(damaged)
    result = score(truth, estimates, outcomes=outcomes, hypothesis=hypotheses)
    if as_json:
        write_json(
            {
                "summary": asdict(result.summary),
                "vehicles": [asdict(row) for row in result.rows],
                "outcomes": [{**asdict(row), "as_expected": row.as_expected} for row in result.outcomes],
            }
        )
        sys.exit(complaints.told())
    rows: list[tuple[str, Any]] = [(name.replace("_", " "), value) for name, value in asdict(result.summary).items()]
    print_table(["estimates against the truth", ""], rows)
    unexpected = [row for row in result.outcomes if not row.as_expected]
    if unexpected:
        click.echo()
        print_table(
            ["crash", "what it is", "expected", "reason", "found", "reason found"],
            [
                (row.key, row.title, row.expected_state, row.expected_reason, row.state, row.reason)
                for row in unexpected
            ],
        )
    sys.exit(complaints.told())
