"""Estimates against the truth of the bundled sample: ``python -m lab score_truth``."""

from __future__ import annotations

import sys
from dataclasses import asdict, astuple, fields
from typing import Any

import click

from lab.commands import run_study
from lab.truth.contacts import ContactsSummary, contacts_by_kind
from lab.truth.people import KindSummary, by_kind, load_people_truth, score_people
from lab.truth.vehicles import load_truth
from lab.truth.vehicles import score_truth as score
from trace_dag.cli.demo import sample_folder
from trace_dag.cli.options import examples, pass_root
from trace_dag.cli.printing import print_table, say, write_json
from trace_dag.cli.study import Problems
from trace_dag.common.errors import DamagedFile, UserError
from trace_dag.common.stage import Stage
from trace_dag.flow.contract import read_artefact
from trace_dag.flow.crash_status import crash_status, valid_records
from trace_dag.flow.records import read_records
from trace_dag.flow.workspace import Workspace
from trace_dag.simulation.states import estimate_from_json
from trace_dag.verdict.types import verdict_from_json


@click.command(
    epilog=examples(
        "python -m lab --root demo score_truth",
    ),
)
@click.option("--json", "as_json", is_flag=True, help="Every vehicle of every crash, as JSON.")
@pass_root
def score_truth(root: str, as_json: bool) -> None:
    """Compare the estimates of the bundled sample with the truth it was made from."""

    truth = load_truth(sample_folder() / "truth.json")
    of_people = load_people_truth(sample_folder() / "people" / "truth.json")
    of_contacts = load_truth(sample_folder() / "chains" / "truth.json")
    of_roadside = load_truth(sample_folder() / "roadside" / "truth.json")
    storage = Workspace.open(root, to_read=True).storage
    problems = Problems()
    keys = [*truth.by_key, *of_contacts.by_key, *of_roadside.by_key, *(crash.key for crash in of_people.crashes)]
    records = read_records(storage, keys, on_problem=problems.add)
    if not any(records.values()):
        raise UserError(f"the sample has not been run in {storage.root}; trace-dag demo runs it")
    estimates, hypotheses, outcomes = {}, {}, {}
    for key, of_crash in records.items():
        valid, stand = valid_records(of_crash), crash_status(key, of_crash)
        outcomes[key] = (stand.final_state.value, stand.reason.value if stand.reason else None)
        try:
            if (record := valid.get(Stage.STATE_ESTIMATE)) and (file := record.artefact("json")):
                estimate = estimate_from_json(read_artefact(storage, record, file))
                if (record := valid.get(Stage.VERDICT)) and (file := record.artefact("json")):
                    hypotheses[key] = verdict_from_json(read_artefact(storage, record, file)).hypothesis
                estimates[key] = estimate
        except DamagedFile as damaged:
            problems.add(damaged)
    result = score(truth, estimates, outcomes=outcomes, hypothesis=hypotheses)
    people = score_people(of_people, estimates, hypotheses)
    contacts = score(of_contacts, estimates, outcomes=outcomes, hypothesis=hypotheses)
    roadside = score(of_roadside, estimates, outcomes=outcomes, hypothesis=hypotheses)
    if as_json:
        write_json(
            {
                "summary": asdict(result.summary),
                "vehicles": [asdict(row) for row in result.rows],
                "people": [{**asdict(row), "course_correct": row.course_correct} for row in people],
                "contacts": [asdict(row) for row in contacts.rows],
                "roadside": [asdict(row) for row in roadside.rows],
                "outcomes": [{**asdict(row), "as_expected": row.as_expected} for row in result.outcomes],
            }
        )
        sys.exit(problems.print_all())
    rows: list[tuple[str, Any]] = [(name.replace("_", " "), value) for name, value in asdict(result.summary).items()]
    print_table(["estimates against the truth", ""], rows)
    if any(row.course_correct is not None for row in people):
        say()
        print_table(
            [each.name.replace("_", " ") for each in fields(KindSummary)], [astuple(row) for row in by_kind(people)]
        )
    lines = [
        astuple(line)
        for sample, found in ((of_contacts, contacts), (of_roadside, roadside))
        if any(row.lane_correct is not None for row in found.rows)
        for line in contacts_by_kind(sample, found.rows)
    ]
    if lines:
        say()
        print_table([each.name.replace("_", " ") for each in fields(ContactsSummary)], lines)
    unexpected = [row for row in result.outcomes if not row.as_expected]
    if unexpected:
        say()
        print_table(
            ["crash", "what it is", "expected", "reason", "found", "reason found"],
            [
                (row.key, row.title, row.expected_state, row.expected_reason, row.state, row.reason)
                for row in unexpected
            ],
        )
    sys.exit(problems.print_all())


if __name__ == "__main__":
    run_study(score_truth)
